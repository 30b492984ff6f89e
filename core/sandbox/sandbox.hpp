// SPDX-License-Identifier: Apache-2.0
//
// What a process gives up before it runs code or reads data that nobody vouches for (docs/security.md).
// Layer lies on layer: what one can't do on a machine, another does in part. None needs rights or set-up.
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

// What a policy can allow beyond computing: what arhost_descriptor.needs and the key `allow` are made of.
constexpr std::array<std::string_view, 6> allowances = {"video", "usb", "gpu", "display", "network", "processes"};

enum class Mode {
    permissive = 1, // each layer as far as the machine has it
    strict,         // all layers, or the process does not begin
    none            // for debuggers and for what the sandbox should not stop
};

struct Policy {
    Mode mode = Mode::permissive;
    std::set<std::string, std::less<>> allow{}; // of `allowances`
    // Absolute; a folder stands for all below it. The system's libraries and settings are readable anyway.
    std::vector<std::filesystem::path> readable{};
    std::vector<std::filesystem::path> writable{};    // folders; made where they are missing
    std::set<std::string, std::less<>> environment{}; // variables to keep besides the usual ones
    std::uint64_t memory_bytes = 0;                   // of its own; 0: three quarters of the machine's
    bool makes_shared_memory = false;                 // what arhost's scene loader does; evades the limit

    bool allows(std::string_view what) const { return allow.contains(what); }
};

// Whether `path` is `folder` or lies below it, by their names: both without links and dots.
bool holds(const std::filesystem::path &folder, const std::filesystem::path &path);

// Lets a file or folder be read that stands as a value somewhere: not one that is not there, what holds the whole
// home, devices or what is the kernel's, which are for other keys to give. False: it does not. Absolute.
bool let_read(Policy &policy, const std::filesystem::path &file);
// The same, and of a printf pattern (frame-%04d.png) the folder.
void let_read_files(Policy &policy, const std::filesystem::path &file_or_pattern);

// "permissive", "strict", "none", as the configuration has them.
constexpr std::array<std::string_view, 3> modes = {"permissive", "strict", "none"};
Mode mode_of(std::string_view text);

nlohmann::json to_json(const Policy &policy);
Policy policy_from_json(const nlohmann::json &json); // throws nlohmann::json::exception

// Whether it is one for Policy::environment: no "name=value", nothing blank.
bool is_variable(std::string_view name);

// How far a layer was reached.
struct Layer {
    std::string name;
    std::string reached; // "" where it was not at all
    std::string lacks;   // and why; "" where nothing does
};
using Level = std::vector<Layer>;

bool whole(const Level &level);
// "no_new_privs; namespaces: user, net; … lacking landlock: not in this kernel".
std::string to_text(const Level &level);

// Puts the calling process, which must have one thread, into the sandbox for good. A layer that the machine
// lacks is told in the result; with Mode::strict it is a std::runtime_error. Mode::none does nothing.
Level enter(const Policy &policy);

// The same for a process that is to open `plugin`: it may read what lies beside it, and beside a link's target.
Level enter_for(const std::filesystem::path &plugin, Policy policy);

} // namespace arhost::sandbox
