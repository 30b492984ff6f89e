// SPDX-License-Identifier: Apache-2.0
//
// Sends the user's commands, which keys trigger, to the host, and stores the host's answers (docs/control.md).
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <nlohmann/json_fwd.hpp>

#include <chrono>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace sink_window {

class HostCommands {
public:
    using Clock = std::chrono::steady_clock;
    // Receives a message to the user.
    using Show = std::function<void(const std::string &text, bool is_error)>;

    // Values from the host's status document.
    struct Numbers {
        double fps = 0;
        std::optional<double> latency_ms; // median, from capture to compositing of a frame
        // Percentiles p50/p95/p99 of each stage and output, with its name.
        std::vector<std::pair<std::string, std::string>> timings;
        int targets = 0, restarts = 0;
    };

    // A warning or an error of the run.
    struct Problem {
        std::string text;
        bool is_error;
    };

    HostCommands(const arhost::Host &host, Show show) : control_(host), show_(std::move(show)) {}

    void freeze();
    void snapshot();
    void record();
    void load_scene(std::size_t index);
    // Asks for the status twice a second, unless the host has refused it. Call it often while frames arrive.
    void poll(Clock::time_point now);

    bool frozen() const { return frozen_; }
    bool recording() const { return recording_; }
    const std::vector<std::string> &scenes() const { return scenes_; } // empty: unknown
    const std::string &scene() const { return scene_; }                // the current scene
    const std::optional<Numbers> &numbers() const { return numbers_; }
    const std::vector<Problem> &problems() const { return problems_; }    // the last ones, the oldest first
    const std::string &missing_target() const { return missing_target_; } // "": a target is visible, or unknown
    // Returns whether this output may send the command. True if this is not known yet.
    bool grants(const std::string &command) const { return !granted_ || granted_->contains(command); }
    // Returns whether an answer has changed the state since the last call.
    bool take_changed() { return std::exchange(changed_, false); }

private:
    // Receives the answer to a command that has succeeded.
    using Take = std::function<void(const nlohmann::json &answer)>;
    void send(const nlohmann::json &command, Take take);
    void take_status(const nlohmann::json &status);
    void take_problems(const nlohmann::json &messages);

    arhost::HostControl control_;
    Show show_;
    bool frozen_ = false, recording_ = false, changed_ = false;
    std::vector<std::string> scenes_;
    std::string scene_;
    std::optional<Numbers> numbers_;
    std::vector<Problem> problems_;
    std::optional<std::uint64_t> last_problem_; // its number
    std::string missing_target_;
    std::optional<std::set<std::string>> granted_;
    bool status_granted_ = true, status_pending_ = false; // granted until the host refuses it
    Clock::time_point next_poll_{};
};

} // namespace sink_window
