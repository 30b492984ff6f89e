// SPDX-License-Identifier: Apache-2.0
//
// A plugin's private folder for temporary files and caches: a small file system in memory, in the mount namespace of
// the worker. The kernel deletes it when the worker ends, however it ends.
#include "sandbox/layers.hpp"

#include <cstdlib>
#include <sys/mount.h>

namespace arhost::sandbox {

bool mount_scratch(const std::filesystem::path &folder, bool may_execute) {
    constexpr int max_files = 8192; // the kernel's memory for each file does not count towards the size
    std::error_code ignored;
    std::filesystem::create_directories(folder, ignored);
    const std::string options =
        "mode=700,size=" + std::to_string(scratch_bytes) + ",nr_inodes=" + std::to_string(max_files);
    return ::mount("tmpfs", folder.c_str(), "tmpfs", MS_NOSUID | MS_NODEV | (may_execute ? 0 : MS_NOEXEC),
                   options.c_str()) == 0;
}

void point_to_scratch(const Policy &policy) {
    const auto set = [&](const char *variable, const std::string &value) {
        if (!policy.environment.contains(variable))
            ::setenv(variable, value.c_str(), 1);
    };
    // Libraries look for these files in the user's home folder, but HOME is set to another folder below.
    if (const char *home = std::getenv("HOME")) {
        if (!std::getenv("PYTHONUSERBASE")) // may be granted with `reads`
            set("PYTHONUSERBASE", std::string(home) + "/.local");
        if (policy.allows("display") && !std::getenv("XAUTHORITY"))
            set("XAUTHORITY", std::string(home) + "/.Xauthority");
    }
    for (const char *variable : {"HOME", "TMPDIR", "MPLCONFIGDIR", "NUMBA_CACHE_DIR"})
        set(variable, policy.scratch);
    if (!policy.allows("gpu")) // otherwise, it is the folder of the shader cache
        set("XDG_CACHE_HOME", policy.scratch);
}

} // namespace arhost::sandbox
