// SPDX-License-Identifier: Apache-2.0
//
// Restrictions that a process applies to itself before it runs untrusted code or reads untrusted data
// (docs/security.md). The layers overlap: if a machine lacks one, others cover part of it. None needs privileges.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <array>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::sandbox {

// Permissions beyond computing: the values of arhost_descriptor.needs and of the key `allow`.
constexpr std::array<std::string_view, 6> allowances = {"video", "usb", "gpu", "display", "network", "processes"};

enum class Mode {
    permissive = 1, // every layer that the machine supports
    strict,         // all layers, or an exception
    none            // no sandbox, for debuggers
};

struct Policy {
    Mode mode = Mode::permissive;
    std::set<std::string, std::less<>> allow{}; // of `allowances`
    // Absolute paths; folders include their contents. System libraries and settings are always readable.
    std::vector<std::filesystem::path> readable{};
    std::vector<std::filesystem::path> writable{};    // folders; created if missing
    std::set<std::string, std::less<>> environment{}; // variables to keep besides the standard ones
    std::uint64_t memory_bytes = 0;                   // private memory; 0: three quarters of the machine's
    bool makes_shared_memory = false;                 // needed by the scene loader; bypasses memory_bytes

    bool allows(std::string_view what) const { return allow.contains(what); }
};

// Whether `path` is `folder` or below it. Compares names only: both must be canonical.
bool contains(const std::filesystem::path &folder, const std::filesystem::path &path);

// Grants read access to a path named by an option (absolute); false if it is missing or too broad: a folder that
// contains the home folder, or anything in /dev, /proc or /sys.
bool allow_read(Policy &policy, const std::filesystem::path &file);
// The same; for a printf pattern (frame-%04d.png), its folder.
void allow_read_files(Policy &policy, const std::filesystem::path &file_or_pattern);

constexpr std::array<std::string_view, 3> modes = {"permissive", "strict", "none"};
Mode mode_of(std::string_view text);

nlohmann::json to_json(const Policy &policy);
Policy policy_from_json(const nlohmann::json &json); // throws nlohmann::json::exception

// Whether it can be in Policy::environment: not empty, no "=", no blanks.
bool is_variable_name(std::string_view name);

// State of one layer on this machine.
struct Layer {
    std::string name;
    std::string active;  // what is enforced; "": nothing
    std::string missing; // what is not, and why; "": nothing
};
using Level = std::vector<Layer>;

bool complete(const Level &level);
// "no_new_privs: yes; namespaces: user, net; … MISSING landlock: not in this kernel".
std::string to_text(const Level &level);

// Permanently sandboxes the calling process, which must be single-threaded. Returns the state of each layer; throws
// std::runtime_error if a layer is incomplete and the mode is strict. Mode::none does nothing.
Level enter(const Policy &policy);

// The same for a process that will open `plugin`; its folder, and that of a link's target, become readable.
Level enter_for(const std::filesystem::path &plugin, Policy policy);

} // namespace arhost::sandbox
