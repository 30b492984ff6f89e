// SPDX-License-Identifier: Apache-2.0
//
// libFuzzer entry point. An environment variable selects the target, because libFuzzer restarts itself and passes on
// only its own arguments.
#include "targets.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>

using namespace arhost::fuzz;

namespace {

const Target &selected_target() {
    const char *name = std::getenv("ARHOST_FUZZ_TARGET");
    const auto *found = std::ranges::find(targets, std::string_view(name ? name : ""), &Target::name);
    if (found == std::end(targets)) {
        std::fputs("ARHOST_FUZZ_TARGET must be one of:", stderr);
        for (const Target &target : targets)
            std::fprintf(stderr, " %s", target.name.data());
        std::fputs("\n", stderr);
        std::exit(2);
    }
    return *found;
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size) {
    static const Target &target = selected_target();
    target.run({data, size});
    return 0;
}
