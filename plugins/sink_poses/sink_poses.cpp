// SPDX-License-Identifier: Apache-2.0
//
// sink_poses: writes the pose log, which has one line of JSON per frame.
#include "sink_common/json_text.hpp"
#include "sink_common/line_file.hpp"
#include "sink_common/record_line.hpp"

#include <arhost-cpp/plugin.hpp>

#include <string>

namespace {

class PoseSink {
public:
    PoseSink(const arhost::Host &host, const arhost::Options &options) : file_(host, options.text("path")) {}

    void start(const arhost_sink_setup &setup) {
        file_.start(setup.first_sequence, [&](std::string_view line) {
            const auto frame = arhost::json_text::frame_of_line(line);
            return frame && *frame < setup.first_sequence;
        });
    }

    arhost_status write(const arhost_output &output) {
        line_.clear();
        arhost::record::append_line(line_, *output.record);
        file_.append(line_);
        return ARHOST_STATUS_OK;
    }

private:
    arhost::files::LineFile file_;
    std::string line_;
};

constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr, "The log to write, one JSON line per frame."),
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SINK,
    .id = "sink_poses",
    .name = "Pose log",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Writes the targets, poses and camera of each frame as one line of JSON.",
    .capabilities = 0,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

} // namespace

ARHOST_SINK(PoseSink, descriptor)
