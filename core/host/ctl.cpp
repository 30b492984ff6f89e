// SPDX-License-Identifier: Apache-2.0
#include "host/ctl.hpp"

#include "base/listening_socket.hpp"
#include "base/text.hpp"
#include "base/write_all.hpp"
#include "host/commands.hpp"
#include "host/program.hpp"

#include <nlohmann/json.hpp>

#include <cstdio>
#include <map>
#include <unistd.h>

namespace arhost::host {
namespace {

using Json = nlohmann::ordered_json;

// The members of each command, in the order of the values on the command line.
const std::map<std::string, std::vector<std::string>, std::less<>> members_of = {
    {"quit", {}},
    {"freeze", {"on"}},
    {"snapshot", {}},
    {"record", {"on"}},
    {"load_scene", {"scene"}},
    {"swap", {"component", "plugin"}},
    {"set", {"component", "option", "value"}},
    {"status", {}},
};

Json command_of(const CtlArguments &arguments) {
    Json command = {{"command", arguments.command}};
    const std::vector<std::string> &members = members_of.at(arguments.command); // the command line was checked
    if (arguments.values.size() > members.size())
        throw std::runtime_error("'" + arguments.command + "' takes at most " + std::to_string(members.size()) +
                                 " values");
    for (std::size_t i = 0; i < arguments.values.size(); ++i) {
        const std::string &value = arguments.values[i];
        if (members[i] != "on")
            command[members[i]] = value;
        else if (value == "on" || value == "off")
            command["on"] = value == "on";
        else
            throw std::runtime_error("'" + arguments.command + "' takes 'on' or 'off'; without one, it toggles");
    }
    return command;
}

std::string receive_line(int socket) {
    std::string line;
    for (char buffer[65536]; line.find('\n') == std::string::npos;) {
        const ssize_t size = ::read(socket, buffer, sizeof buffer);
        if (size < 0 && errno == EINTR)
            continue;
        if (size <= 0)
            throw std::runtime_error("the run has ended before it answered");
        line.append(buffer, static_cast<std::size_t>(size));
    }
    return line.substr(0, line.find('\n'));
}

// Prints the answer's members for a reader.
void print_members(const Json &answer) {
    for (const auto &[key, value] : answer.items())
        if (key == "status")
            std::printf("%s\n", value.dump(2).c_str());
        else if (key != "ok" && key != "granted")
            std::printf("%s: %s\n", key.c_str(),
                        base::printable(value.is_string() ? value.get<std::string>() : value.dump()).c_str());
}

} // namespace

int ctl(const CtlArguments &arguments) {
    const std::string command = command_of(arguments).dump() + "\n";
    const auto path = base::named_socket(arguments.name);
    base::UniqueFd socket;
    try {
        socket = base::connect_to(path);
    } catch (const std::system_error &error) {
        return print_error("no run with the name '" + arguments.name + "' can be reached (" + error.code().message() +
                               ": " + path.string() +
                               "); its configuration needs the output sink_control "
                               "(docs/control.md)",
                           run_failed);
    }
    base::write_all(socket.get(), command);
    const std::string line = receive_line(socket.get());
    const Json answer = Json::parse(line);
    if (arguments.json)
        std::printf("%s\n", line.c_str());
    else if (answer.value("ok", false))
        print_members(answer);
    if (!answer.value("ok", false))
        return arguments.json ? run_failed : print_error(answer.value("error", "unknown error"), run_failed);
    return success;
}

} // namespace arhost::host
