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
        if (line.starts_with(version_2) && std::filesystem::exists(mount_point / "cgroup.procs", ignored))
            return mount_point / std::filesystem::path(line.substr(version_2.size())).relative_path();
    return {};
}

Layer report_control_group() {
    const std::filesystem::path group = control_group();
    if (!group.filename().string().starts_with(worker_group))
        return {"control group", "not delegated", ""}; // most machines delegate none, so this is no fault
    Layer layer{"control group", "kill", ""};
    std::ifstream file(group / "cgroup.controllers");
    for (std::string controller; file >> controller;)
        add_to(layer.active, controller);
    return layer;
}

} // namespace arhost::sandbox
