// SPDX-License-Identifier: Apache-2.0
//
// The commands that outputs send while the video runs (docs/control.md). Commands never extend privileges: a command
// chooses among the scenes, plugins and options of the configuration, and never contains a path or a permission.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <array>
#include <functional>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>

namespace arhost::control {

struct Quit {};
struct Freeze {
    std::optional<bool> on; // nullopt: toggle
};
struct Snapshot {};
struct Record {
    std::optional<bool> on; // nullopt: toggle
};
struct LoadScene {
    std::string scene; // "": missing, the answer lists the names
};
struct Swap {
    std::string component; // "tracker" or "raytracer"; others, and "": the answer lists both with their alternatives
    std::string plugin;    // name of an alternative; "": missing, the answer lists the names
};
struct Set {
    std::string component, option;
    std::string value; // in YAML syntax
};
struct Status {
    std::set<std::string, std::less<>> granted; // the commands that this output may send
};
using Command = std::variant<Quit, Freeze, Snapshot, Record, LoadScene, Swap, Set, Status>;

// The names of the commands, which the key `control` can grant to an output.
constexpr std::array<std::string_view, 8> names = {"quit",       "freeze", "snapshot", "record",
                                                   "load_scene", "swap",   "set",      "status"};

// Why a command was not executed, as a message for the user.
class Error : public std::runtime_error {
    using std::runtime_error::runtime_error;
};

struct NotGranted : Error {
    using Error::Error;
};

// Parses a command. `granted`: the elements of the output's key `control`. Throws NotGranted if the command is not
// granted, and Error if the text is not a valid command.
Command parse(const std::string &text, const std::set<std::string, std::less<>> &granted);

// Called once with the answer to a command. On success, `error` is "" and `members` contains the answer's members;
// otherwise `error` is the reason for the failure.
using Done = std::function<void(const std::string &error, const nlohmann::ordered_json &members)>;

std::string answer_text(const std::string &error, const nlohmann::ordered_json &members);

} // namespace arhost::control
