// SPDX-License-Identifier: Apache-2.0
#include "sandbox/layers.hpp"

#include <fstream>

namespace arhost::sandbox {

std::filesystem::path control_group() {
    const std::string version_2 = "0::";
    const std::filesystem::path mount_point = "/sys/fs/cgroup";
    std::ifstream file("/proc/self/cgroup");
    std::error_code ignored;
    for (std::string line; std::getline(file, line);)
        if (line.starts_with(version_2) && std::filesystem::exists(mount_point / "cgroup.procs", ignored)) {
            const auto group = std::filesystem::path(line.substr(version_2.size())).relative_path();
            return group.empty() ? mount_point : mount_point / group; // without a slash at the end
        }
    return {};
}

Layer report_control_group() {
    const std::filesystem::path group = control_group();
    if (!group.filename().string().starts_with(worker_group))
        return {"control group", "none", ""}; // not missing, because few machines delegate a group
    Layer layer{"control group", "", ""};
    const auto value = [&](const char *file) {
        std::string text;
        std::ifstream(group / file) >> text;
        return text;
    };
    std::error_code ignored;
    if (std::filesystem::exists(group / "cgroup.kill", ignored)) // since Linux 5.14
        add_to(layer.active, "kill");
    for (const char *limit : {"memory.max", "pids.max"})
        if (const std::string text = value(limit); !text.empty() && text != "max")
            add_to(layer.active, limit);
    if (!value("cpu.weight").empty())
        add_to(layer.active, "cpu.weight");
    return layer;
}

} // namespace arhost::sandbox
