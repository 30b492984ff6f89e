// SPDX-License-Identifier: Apache-2.0
//
// Copies this machine's Vulkan driver manifests, so that tests can delete or duplicate them.
#pragma once

#include <filesystem>
#include <string>

namespace arhost::test {

// Copies all driver manifests to `folder`. Returns the paths of the copies as a value for VK_DRIVER_FILES.
inline std::string copy_drivers(const std::filesystem::path &folder) {
    namespace fs = std::filesystem;
    fs::create_directories(folder);
    std::string list;
    for (const char *place : {"/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d"}) {
        std::error_code ignored;
        for (const auto &driver : fs::directory_iterator(place, ignored)) {
            fs::copy_file(driver.path(), folder / driver.path().filename(), fs::copy_options::skip_existing);
            list += (list.empty() ? "" : ":") + (folder / driver.path().filename()).string();
        }
    }
    return list;
}

} // namespace arhost::test
