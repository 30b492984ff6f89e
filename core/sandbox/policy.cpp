// SPDX-License-Identifier: Apache-2.0
#include "sandbox/layers.hpp"

#include <algorithm>
#include <cstdlib>
#include <glob.h>
#include <nlohmann/json.hpp>
#include <sstream>

namespace arhost::sandbox {
namespace {

namespace fs = std::filesystem;

using PathList = std::initializer_list<const char *>;

// Paths that libraries commonly need. Does not include /home, /tmp, /run and the /proc folders of other processes.
constexpr PathList system_readable = {
    // programs and libraries
    "/usr", "/lib", "/lib32", "/lib64", "/libx32", "/bin", "/sbin", "/opt", "/nix/store", "/gnu/store",
    // their settings
    "/etc/ld.so.cache", "/etc/ld.so.conf", "/etc/ld.so.conf.d", "/etc/localtime", "/etc/alternatives", "/etc/fonts",
    "/etc/OpenCL", "/etc/vulkan", "/etc/glvnd", "/etc/drirc", "/etc/python3", "/etc/mime.types",
    // the process, without net and task, because they describe the network (task contains net of each thread)
    "/proc/self/attr", "/proc/self/auxv", "/proc/self/cgroup", "/proc/self/cmdline", "/proc/self/comm",
    "/proc/self/environ", "/proc/self/fd", "/proc/self/fdinfo", "/proc/self/io", "/proc/self/limits",
    "/proc/self/maps", "/proc/self/numa_maps", "/proc/self/oom_score", "/proc/self/oom_score_adj", "/proc/self/smaps",
    "/proc/self/smaps_rollup", "/proc/self/stat", "/proc/self/statm", "/proc/self/status",
    // the machine
    "/proc/cpuinfo", "/proc/meminfo", "/proc/stat", "/proc/version", "/proc/filesystems",
    "/proc/sys/vm/overcommit_memory", "/proc/sys/vm/max_map_count", "/proc/sys/kernel/osrelease",
    "/sys/devices/system", "/sys/fs/cgroup", "/sys/kernel/mm/transparent_hugepage"};
constexpr PathList system_devices = {"/dev/null", "/dev/full", "/dev/random", "/dev/urandom"};

constexpr PathList gpu_readable = {"/sys/dev",    "/sys/bus/pci", "/sys/class/drm", "/sys/devices",
                                   "/sys/module", "/proc/driver", "/proc/devices",  "/proc/modules"};
constexpr PathList gpu_devices = {"/dev/dri", "/dev/nvidia*", "/dev/kfd"};

struct Allowance {
    std::string_view name;
    PathList readable, devices;
};
constexpr Allowance granted[] = {
    {"video",
     {"/sys/class/video4linux", "/sys/devices", "/sys/dev/char", "/dev/v4l"}, // links to the nodes, by serial number
     {"/dev/video*", "/dev/media*", "/dev/v4l-subdev*"}},
    {"usb", {"/sys/bus/usb", "/sys/devices", "/sys/class", "/run/udev/data"}, {"/dev/bus/usb"}},
    {"gpu", gpu_readable, gpu_devices},
    {"display", gpu_readable, gpu_devices},
    {"network",
     {"/etc/resolv.conf", "/etc/hosts", "/etc/host.conf", "/etc/nsswitch.conf", "/etc/gai.conf", "/etc/services",
      "/etc/protocols", "/etc/ssl/certs", "/etc/ssl/openssl.cnf", "/etc/ca-certificates", "/run/systemd/resolve"},
     {}},
    {"processes", {"/etc/passwd", "/etc/group", "/etc/nsswitch.conf"}, {}},
};

void append(std::vector<fs::path> &paths, PathList patterns) {
    for (const char *pattern : patterns) {
        glob_t found{};
        if (::glob(pattern, GLOB_NOSORT, nullptr, &found) == 0)
            paths.insert(paths.end(), found.gl_pathv, found.gl_pathv + found.gl_pathc);
        ::globfree(&found);
    }
}

// libx.so or libx.so.1
bool is_library(const std::string &name) {
    return name.ends_with(".so") || name.find(".so.") != std::string::npos;
}

// Appends the shared libraries in the folders of LD_LIBRARY_PATH. The folders may contain other files, too.
void append_library_path(std::vector<fs::path> &paths) {
    const char *value = std::getenv("LD_LIBRARY_PATH");
    std::istringstream list(value ? value : "");
    std::error_code ignored;
    for (std::string folder; std::getline(list, folder, ':');)
        if (fs::path(folder).is_absolute())
            for (fs::directory_iterator entry(folder, ignored), end; entry != end; entry.increment(ignored))
                if (is_library(entry->path().filename().string()) && entry->is_regular_file(ignored))
                    paths.push_back(entry->path());
}

// Appends the sockets of the X and Wayland servers, and the file with the X server's cookie.
void append_display(Paths &paths) {
    const auto variable = [](const char *name) -> std::string {
        const char *value = std::getenv(name);
        return value ? value : "";
    };
    const std::string display = variable("DISPLAY"); // ":0" or ":0.0"; other forms use TCP
    if (const auto number = display.substr(0, display.find('.')); number.starts_with(':'))
        paths.sockets.push_back("/tmp/.X11-unix/X" + number.substr(1));
    if (const fs::path wayland = variable("WAYLAND_DISPLAY"); !wayland.empty()) // a name, or an absolute path
        paths.sockets.push_back(variable("XDG_RUNTIME_DIR") / wayland);
    const fs::path authority = variable("XAUTHORITY");
    paths.readable.push_back(authority.empty() ? variable("HOME") / fs::path(".Xauthority") : authority);
}

} // namespace

Paths paths_of(const Policy &policy) {
    Paths paths;
    append(paths.readable, system_readable);
    if (under_sanitizer) // LeakSanitizer stops all threads at the end
        append(paths.readable, {"/proc/self/task"});
    append(paths.devices, system_devices);
    if (may_share_memory(policy)) // RLIMIT_DATA does not count shared mappings of this device
        append(paths.devices, {"/dev/zero"});
    append_library_path(paths.readable);
    for (const Allowance &allowance : granted)
        if (policy.allows(allowance.name)) {
            append(paths.readable, allowance.readable);
            append(paths.devices, allowance.devices);
        }
    if (!policy.usb_node.empty())
        paths.devices.push_back(policy.usb_node);
    if (policy.allows("display"))
        append_display(paths);
    paths.readable.insert(paths.readable.end(), policy.readable.begin(), policy.readable.end());
    return paths;
}

bool contains(const fs::path &folder, const fs::path &path) {
    return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first == folder.end();
}

std::string obstacle_to_grant(const fs::path &path) {
    std::error_code ignored;
    const fs::path real = fs::weakly_canonical(path, ignored);
    if (real.has_relative_path() && !contains("/proc", real) &&
        (!contains("/dev", real) || contains("/dev/shm", real)))
        return "";
    return "the sandbox cannot grant '" + path.string() +
           "'; name the files or folders that the plugin needs outside of /proc and /dev, and devices with 'allow'";
}

bool allow_read(Policy &policy, const fs::path &file) {
    std::error_code ignored;
    const auto type = fs::status(file, ignored).type();
    if (type != fs::file_type::regular && type != fs::file_type::directory && type != fs::file_type::fifo)
        return false;
    const char *home = std::getenv("HOME");
    const fs::path real = fs::weakly_canonical(file, ignored);
    if (home && contains(real, fs::weakly_canonical(home, ignored)))
        return false;
    if (!obstacle_to_grant(real).empty() || contains("/sys", real))
        return false;
    policy.readable.push_back(file);
    return true;
}

void allow_read_files(Policy &policy, const fs::path &file_or_pattern) {
    if (!allow_read(policy, file_or_pattern) && file_or_pattern.filename().string().find('%') != std::string::npos)
        allow_read(policy, file_or_pattern.parent_path());
}

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Policy, mode, allow, readable, writable, usb_device, environment, memory_bytes,
                                   makes_shared_memory, standard_output)

nlohmann::json to_json(const Policy &policy) {
    return policy;
}

Policy policy_from_json(const nlohmann::json &json) {
    return json.get<Policy>();
}

Mode mode_of(std::string_view text) {
    return static_cast<Mode>(std::ranges::find(modes, text) - modes.begin() + 1);
}

} // namespace arhost::sandbox
