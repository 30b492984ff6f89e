// SPDX-License-Identifier: Apache-2.0
//
// Records why a run has failed. Before the video runs, a failure ends the run; later, the video continues without the
// failed component.
#pragma once

#include "supervise/launcher.hpp"
#include "yaml/yaml.hpp"

#include <string>

namespace arhost::host {

class Failures {
public:
    explicit Failures(const supervise::LogFunction &log) : log_(log) {}

    enum class Phase { starting, video_runs, ending };
    void set_phase(Phase phase) { phase_ = phase; }
    bool video_runs() const { return phase_ == Phase::video_runs; }

    // `was_logged`: the user has already seen the reason.
    void add(const std::string &reason, bool is_configuration_error, bool was_logged = false);
    // A component is disabled. `node`: its place in the configuration.
    void add_disabled(const std::string &name, const yaml::Node &node, const std::string &reason,
                      bool is_configuration_error);

    bool ends_run() const { return ends_run_; } // whether the run must end at once
    // Returns the first failure, as a message for the user; "" if there was none.
    const std::string &text() const { return text_; }
    bool was_logged() const { return was_logged_; }
    bool is_configuration_error() const { return is_configuration_error_; }

private:
    const supervise::LogFunction &log_;
    Phase phase_ = Phase::starting;
    std::string text_;
    bool ends_run_ = false, was_logged_ = false, is_configuration_error_ = false;
};

} // namespace arhost::host
