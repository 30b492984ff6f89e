// SPDX-License-Identifier: Apache-2.0
//
// Restrictions that a process applies to itself before it runs untrusted code or reads untrusted data
// (docs/security.md). The layers overlap: if a layer is missing on a machine, others cover part of it. None of them
// needs privileges.
#pragma once

#include "base/usb_device.hpp"

#include <nlohmann/json_fwd.hpp>

#include <array>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::sandbox {

// Permissions beyond the default: the valid values in arhost_descriptor.needs and of the key `allow`.
constexpr std::array<std::string_view, 8> allowances = {"video",   "usb",    "gpu",       "display",
                                                        "network", "listen", "processes", "jit"};

enum class Mode {
    standard = 1, // like permissive, but opens only arhost's own plugins if no layer limits which files can be read
    permissive,   // applies every layer that the machine supports
    strict,       // applies all layers; throws if one is incomplete
    none          // no sandbox, for debuggers
};

struct Policy {
    Mode mode = Mode::standard;
    std::set<std::string, std::less<>> allow{}; // elements of `allowances`
    // Absolute paths; a folder includes its contents. System libraries and settings are always readable.
    std::vector<std::filesystem::path> readable{};
    std::vector<std::filesystem::path> writable{}; // folders; created if missing
    base::UsbIdentity usb_device{};   // the only USB device that may be used, unless `allow` has "usb"; empty: none
    std::filesystem::path usb_node{}; // node of usb_device; set by enter()
    std::filesystem::path scratch{};  // the plugin's private folder; set by enter_for(); empty: none
    std::set<std::string, std::less<>> environment{}; // variables to keep in addition to the standard ones
    std::uint64_t memory_bytes = 0;   // limit of private memory; 0: three quarters of the memory of the machine
    bool makes_shared_memory = false; // set for supervise::Loading; such memory does not count towards memory_bytes
    bool standard_output = false;     // the worker writes to the standard output of the host

    bool allows(std::string_view what) const { return allow.contains(what); }
    // Whether a plugin that needs `need` (an element of `allowances`) may run.
    bool meets(std::string_view need) const {
        return allows(need) || (need == "usb" && !usb_device.empty()) || (need == "jit" && may_generate_code());
    }
    // Whether the plugin may execute memory and files that it can write: drivers compile shaders for the processor.
    bool may_generate_code() const { return allows("jit") || allows("gpu") || allows("display"); }
};

// The number of bytes that a process with this policy may use; 0 (only in a build with sanitizers): unlimited.
std::uint64_t memory_limit(const Policy &policy);

// The folder of the calling process's control group (version 2), or an empty path if there is none.
std::filesystem::path control_group();
// How the names of workers' control groups begin.
constexpr std::string_view worker_group = "arhost-worker-";

// Whether `path` is `folder` or a path below it. Compares only names, so both must be canonical.
bool contains(const std::filesystem::path &folder, const std::filesystem::path &path);

// Returns why access to `path` cannot be granted by name, and what to do instead; "" if it can. The sandbox has its
// own root folder, /proc and /dev, so such a grant would take effect only in some of its layers.
std::string obstacle_to_grant(const std::filesystem::path &path);

// Grants read access to an absolute path that an option names. Returns false if the path does not exist or is too
// broad: a folder that contains the home folder, or a path in /dev, /proc or /sys.
bool allow_read(Policy &policy, const std::filesystem::path &file);
// Like allow_read. If the path is a numbered file name (frame-%04d.png), grants access to its folder.
void allow_read_files(Policy &policy, const std::filesystem::path &file_or_pattern);

constexpr std::array<std::string_view, 4> modes = {"standard", "permissive", "strict", "none"};
Mode mode_of(std::string_view text); // an element of `modes`

nlohmann::json to_json(const Policy &policy);
Policy policy_from_json(const nlohmann::json &json); // throws nlohmann::json::exception

// Whether `name` is valid in Policy::environment: not empty, and without "=", blanks and control characters.
bool is_variable_name(std::string_view name);

// Result of applying one layer on this machine.
struct Layer {
    std::string name;
    std::string active;          // the restrictions that are enforced; "": none
    std::string missing;         // the restrictions that are not enforced, and why; "": none
    bool confines_files = false; // limits which files can be read
};
using Level = std::vector<Layer>;

bool complete(const Level &level);
// Returns, for example, "no_new_privs: yes; namespaces: user, net; … MISSING landlock: not in this kernel".
std::string to_text(const Level &level);

// Enters a user namespace that maps only the calling user. In it, the process has all capabilities. Returns "", or
// why the process cannot enter the namespace and what an administrator can change. The process must be
// single-threaded.
std::string enter_user_namespace();

// Permanently sandboxes the calling process, which must be single-threaded. Returns the state of each layer; throws
// std::runtime_error if a layer is incomplete and the mode is strict. Mode::none does nothing.
Level enter(Policy policy);

// Like enter, for a process that will open `plugin`. Also makes readable the file `plugin` and the folder of the
// plugins that are installed with this program.
Level enter_for(const std::filesystem::path &plugin, Policy policy);

} // namespace arhost::sandbox
