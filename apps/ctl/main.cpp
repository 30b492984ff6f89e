// SPDX-License-Identifier: Apache-2.0
//
// arhost-ctl sends a command to a running arhost whose configuration has the output sink_control. `arhost ctl` runs
// it.
#include "base/listening_socket.hpp"
#include "base/program.hpp"
#include "base/text.hpp"
#include "base/write_all.hpp"
#include "command_line/command_line.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <unistd.h>

namespace {

using Json = nlohmann::ordered_json;
namespace base = arhost::base;

struct Arguments {
    std::string name = "arhost"; // name of the run: its socket is $XDG_RUNTIME_DIR/arhost/NAME.sock
    std::string command;
    std::vector<std::string> values; // values of the command's members
    bool json = false;               // print the answer as it is
};

// The members of each command, in the order of the values on the command line.
const std::vector<std::pair<std::string, std::vector<std::string>>> commands = {
    {"quit", {}},
    {"freeze", {"on"}},
    {"snapshot", {}},
    {"record", {"on"}},
    {"load_scene", {"scene"}},
    {"swap", {"component", "plugin"}},
    {"set", {"component", "option", "value"}},
    {"status", {}},
};

Json command_of(const Arguments &arguments) {
    Json command = {{"command", arguments.command}};
    const std::vector<std::string> &members = // the command line was checked
        std::ranges::find(commands, arguments.command, &decltype(commands)::value_type::first)->second;
    if (arguments.values.size() > members.size())
        throw base::InvalidInput("'" + arguments.command + "' takes at most " + std::to_string(members.size()) +
                                 " values");
    for (std::size_t i = 0; i < arguments.values.size(); ++i) {
        const std::string &value = arguments.values[i];
        if (members[i] != "on")
            command[members[i]] = value;
        else if (value == "on" || value == "off")
            command["on"] = value == "on";
        else
            throw base::InvalidInput("'" + arguments.command + "' takes 'on' or 'off'; without one, it toggles");
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

void print(const std::string &line) {
    std::printf("%s\n", base::printable(line).c_str());
}

std::string number(const Json &value, int digits) {
    char text[64];
    std::snprintf(text, sizeof text, "%.*f", digits, value.is_number() ? value.get<double>() : 0.0);
    return text;
}

// Prints what a user asks first: whether all components run, how fast, what the tracker sees, and what went wrong.
void print_status(const Json &status) {
    const Json &frames = status.at("frames"), &scene = status.at("scene"), &recording = status.at("recording");
    print("arhost " + status.at("arhost").get<std::string>() + ", mode " + status.at("mode").get<std::string>() +
          (scene.is_string() ? ", scene " + scene.get<std::string>() : "") +
          (status.at("frozen").get<bool>() ? ", frozen" : "") +
          (recording.is_string() ? ", recording " + recording.get<std::string>() : ""));
    std::string rate = number(status.at("fps"), 1) + " fps";
    if (const auto latency = status.at("stages").find("latency"); latency != status.at("stages").end())
        rate += ", latency p50 " + number(latency->at("p50_ms"), 1) + " ms, p95 " + number(latency->at("p95_ms"), 1) +
                " ms, p99 " + number(latency->at("p99_ms"), 1) + " ms, from " +
                status.at("latency").at("from").get<std::string>();
    print(rate);
    std::string dropped;
    for (const auto &[cause, frame_count] : frames.at("dropped").items())
        if (frame_count != 0)
            dropped += (dropped.empty() ? ", dropped: " : ", ") + cause + " " + frame_count.dump();
    print(base::count_of(frames.at("composited"), "frame") + ": " + frames.at("tracked").dump() + " with a target, " +
          frames.at("augmented").dump() + " with an overlay" + dropped);
    for (const Json &target : status.at("targets"))
        print("target " + target.at("name").get<std::string>() + ": " + target.at("state").get<std::string>() +
              (target.at("state") == "lost"
                   ? ""
                   : ", distance " + number(target.at("distance_mm"), 0) + " mm, reprojection error " +
                         number(target.at("reprojection_px"), 2) + " px"));
    if (const Json &missing = status.at("missing_target"); missing.is_string())
        print("no target: " + missing.get<std::string>());
    for (const Json &component : status.at("components")) {
        const std::uint64_t restarts = component.at("restarts");
        print(component.at("name").get<std::string>() + ": " + component.at("plugin").get<std::string>() + " " +
              component.at("version").get<std::string>() + ", " + component.at("state").get<std::string>() +
              (restarts > 0 ? ", " + base::count_of(restarts, "restart") : ""));
    }
    for (const Json &message : status.at("messages"))
        print(message.at("time").get<std::string>() + " " + message.at("severity").get<std::string>() + ": " +
              message.at("component").get<std::string>() + ": " + message.at("text").get<std::string>());
}

// Prints the answer's members for a human reader.
void print_members(const Json &answer) {
    for (const auto &[key, value] : answer.items())
        if (key == "status")
            print_status(value);
        else if (key != "ok" && key != "granted")
            print(key + ": " + (value.is_string() ? value.get<std::string>() : value.dump()));
}

// Returns the exit status. Prints the answer, or an error.
int send(const Arguments &arguments) {
    const std::string command = command_of(arguments).dump() + "\n";
    const auto path = base::named_socket(arguments.name);
    base::UniqueFd socket;
    try {
        socket = base::connect_to(path);
    } catch (const std::system_error &error) {
        return base::print_error("no run with the name '" + arguments.name + "' can be reached (" +
                                     error.code().message() + ": " + path.string() +
                                     "); its configuration needs the output sink_control "
                                     "(docs/control.md)",
                                 base::failed);
    }
    base::write_all(socket.get(), command);
    const std::string line = receive_line(socket.get());
    const Json answer = Json::parse(line);
    if (arguments.json)
        std::printf("%s\n", line.c_str());
    else if (answer.value("ok", false))
        print_members(answer);
    if (!answer.value("ok", false))
        return arguments.json ? base::failed
                              : base::print_error(answer.value("error", "unknown error"), base::failed);
    return base::success;
}

} // namespace

int main(int argc, char **argv) {
    base::prepare_process();
    arhost::command_line::CommandLine app("Send a command to a running arhost (docs/control.md)", "arhost ctl");
    Arguments arguments;
    std::vector<std::string> names(commands.size());
    std::ranges::transform(commands, names.begin(), [](const auto &command) { return command.first; });
    app.option("COMMAND", arguments.command, "The command").required().one_of(names);
    app.option("VALUE", arguments.values,
               "freeze and record: on|off; load_scene: SCENE; swap: COMPONENT PLUGIN; set: COMPONENT OPTION VALUE");
    app.option("--name", arguments.name, "Name of the run, the option 'listen' of its sink_control")
        .type_name("NAME")
        .show_default();
    app.flag("--json", arguments.json, "Print the complete answer as JSON; of the status, it has more");
    return base::exit_status_of([&] {
        const auto status = app.parse(argc, argv);
        return status ? *status : send(arguments);
    });
}
