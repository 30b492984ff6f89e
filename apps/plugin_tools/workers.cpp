// SPDX-License-Identifier: Apache-2.0
#include "plugin_tools/workers.hpp"

#include "base/program.hpp"
#include "base/text.hpp"

#include <cstdio>

namespace arhost::plugin_tools {
namespace {

void log(arhost_severity severity, const std::string &component, const std::string &text) {
    if (severity < ARHOST_SEVERITY_INFO)
        return;
    const char *level = severity >= ARHOST_SEVERITY_ERROR     ? "error"
                        : severity == ARHOST_SEVERITY_WARNING ? "warning"
                                                              : "info";
    const char *blame = severity == ARHOST_SEVERITY_PLUGIN_MISBEHAVING ? "the plugin misbehaves: "
                        : severity == ARHOST_SEVERITY_HOST_MISBEHAVING ? "the host misbehaves: "
                                                                       : "";
    std::fprintf(stderr, "%s: %s: %s%s\n", level, component.c_str(), blame, base::printable(text).c_str());
}

} // namespace

std::filesystem::path built_in_plugins() {
    return base::own_prefix() / "lib/arhost/plugins";
}

Workers::Workers()
    : launcher_(base::own_folder() / "arhost-launcher"), context_{reactor_, launcher_,
                                                                  base::own_folder() / "arhost-worker", log} {}

} // namespace arhost::plugin_tools
