// SPDX-License-Identifier: Apache-2.0
#include "host_commands.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>

namespace sink_window {

using Json = nlohmann::json;

namespace {

std::string percentiles_of(const Json &timing) {
    return fmt::format("{:.1f}/{:.1f}/{:.1f} ms", timing.at("p50_ms").get<double>(),
                       timing.at("p95_ms").get<double>(), timing.at("p99_ms").get<double>());
}

} // namespace

void HostCommands::send(const Json &command, Take take) {
    if (!control_)
        return show_("this version of arhost takes no commands from outputs", true);
    const arhost_status status =
        control_.send(command.dump(), [this, take = std::move(take)](const std::string &text) {
            changed_ = true;
            const Json answer = Json::parse(text, nullptr, false);
            try {
                if (answer.at("ok").get<bool>())
                    take(answer);
                else
                    show_(answer.at("error").get<std::string>(), true);
            } catch (const Json::exception &error) {
                show_(std::string("cannot understand the answer of arhost: ") + error.what(), true);
            }
        });
    if (status != ARHOST_STATUS_OK)
        show_("arhost has not answered the previous commands yet; retry later", true);
}

void HostCommands::freeze() {
    send({{"command", "freeze"}}, [this](const Json &answer) { frozen_ = answer.at("frozen").get<bool>(); });
}

void HostCommands::snapshot() {
    send({{"command", "snapshot"}},
         [this](const Json &answer) { show_("snapshot: " + answer.value("file", "written"), false); });
}

void HostCommands::record() {
    send({{"command", "record"}, {"on", !recording_}}, [this, on = !recording_](const Json &answer) {
        recording_ = on;
        show_((on ? "recording: " : "recorded: ") + answer.value("file", ""), false);
    });
}

void HostCommands::load_scene(std::size_t index) {
    if (scenes_.empty())
        return show_("the names of the scenes are not known: add status to the output's key 'control'", true);
    if (index >= scenes_.size())
        return show_("there is no scene " + std::to_string(index + 1) + "; add more to the key 'scenes'", true);
    show_("loading scene " + scenes_[index], false);
    send({{"command", "load_scene"}, {"scene", scenes_[index]}}, [this](const Json &answer) {
        scene_ = answer.at("scene").get<std::string>();
        show_("scene: " + scene_, false);
    });
}

void HostCommands::poll(Clock::time_point now) {
    if (!control_ || !status_granted_ || status_pending_ || now < next_poll_)
        return;
    next_poll_ = now + std::chrono::milliseconds(500);
    status_pending_ = control_.send(R"({"command": "status"})", [this](const std::string &text) {
        status_pending_ = false;
        changed_ = true;
        try {
            const Json answer = Json::parse(text);
            status_granted_ = answer.at("ok").get<bool>();
            if (const auto granted = answer.find("granted"); granted != answer.end())
                granted_ = granted->get<std::set<std::string>>();
            if (status_granted_)
                take_status(answer.at("status"));
        } catch (const Json::exception &) {
            status_granted_ = false;
        }
    }) == ARHOST_STATUS_OK;
}

void HostCommands::take_status(const Json &status) {
    frozen_ = status.at("frozen").get<bool>();
    recording_ = !status.at("recording").is_null();
    scenes_ = status.at("scenes").get<std::vector<std::string>>();
    scene_ = status.at("scene").is_string() ? status.at("scene").get<std::string>() : "";
    Numbers numbers;
    numbers.fps = status.at("fps").get<double>();
    const Json &stages = status.at("stages"), &outputs = status.at("latency").at("outputs");
    for (const auto &[name, timing] : stages.items())
        numbers.timings.emplace_back(name, percentiles_of(timing));
    for (const auto &[name, timing] : outputs.items())
        numbers.timings.emplace_back("to " + name, percentiles_of(timing));
    if (stages.contains("latency"))
        numbers.latency_ms = stages.at("latency").at("p50_ms").get<double>();
    for (const Json &target : status.at("targets"))
        numbers.targets += target.at("state") != "lost";
    for (const Json &component : status.at("components"))
        numbers.restarts += component.at("restarts").get<int>();
    numbers_ = numbers;
    const Json &missing = status.at("missing_target");
    missing_target_ = missing.is_string() ? missing.get<std::string>() : "";
    take_problems(status.at("messages"));
}

// Shows the first new message, because the others are often its consequences, but an error before a warning.
void HostCommands::take_problems(const Json &messages) {
    constexpr std::size_t max_problems = 6;
    const Problem *shown = nullptr;
    std::vector<Problem> all;
    all.reserve(messages.size());
    for (const Json &message : messages) {
        all.push_back({message.at("component").get<std::string>() + ": " + message.at("text").get<std::string>(),
                       message.at("severity") == "error"});
        const auto number = message.at("number").get<std::uint64_t>();
        if (last_problem_ && number > *last_problem_ && (!shown || (all.back().is_error && !shown->is_error)))
            shown = &all.back();
    }
    if (shown && (shown->is_error || missing_target_.empty())) // the missing target is shown already
        show_(shown->text, true);
    last_problem_ = messages.empty() ? 0 : messages.back().at("number").get<std::uint64_t>();
    problems_.assign(all.end() - static_cast<std::ptrdiff_t>(std::min(all.size(), max_problems)), all.end());
}

} // namespace sink_window
