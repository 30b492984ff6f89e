// SPDX-License-Identifier: Apache-2.0
#include "host/failures.hpp"

namespace arhost::host {

void Failures::add(const std::string &reason, bool is_configuration_error, bool was_logged) {
    if (!was_logged)
        log_(ARHOST_SEVERITY_DEBUG, "arhost", reason);
    if (text_.empty()) {
        text_ = reason;
        was_logged_ = was_logged;
        is_configuration_error_ = is_configuration_error && phase_ == Phase::starting;
    }
    ends_run_ = ends_run_ || phase_ == Phase::starting;
}

void Failures::add_disabled(const std::string &name, const yaml::Node &node, const std::string &reason,
                            bool is_configuration_error) {
    // Configuration errors already start with a position in the file or with an option's name.
    const bool located = reason.starts_with(node.file().string() + ":") || reason.starts_with("--");
    const std::string text = located ? reason : node.where() + ": " + name + ": " + reason;
    if (video_runs())
        log_(ARHOST_SEVERITY_ERROR, "arhost",
             text + (name == "source" ? "; the video ends" : "; the video continues without it"));
    add(text, is_configuration_error, video_runs());
}

} // namespace arhost::host
