// SPDX-License-Identifier: Apache-2.0
//
// libFuzzer entry point of the target whose function is ARHOST_FUZZ_RUN.
#include "targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size) {
    arhost::fuzz::ARHOST_FUZZ_RUN({data, size});
    return 0;
}
