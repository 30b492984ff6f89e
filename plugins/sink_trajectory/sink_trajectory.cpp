// SPDX-License-Identifier: Apache-2.0
//
// sink_trajectory: records the camera of every frame for `arhost replay`.
#include "lines.hpp"
#include "sink_common/json_text.hpp"
#include "sink_common/line_file.hpp"

#include <arhost-cpp/plugin.hpp>

#include <string>

namespace {

using arhost::Failure;

class TrajectorySink {
public:
    TrajectorySink(const arhost::Host &host, const arhost::Options &options)
        : file_(host, options.text("path")), dissertation_(options.text("format") == "dissertation") {}

    void start(const arhost_sink_setup &setup) {
        if (!setup.intrinsics)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "there is no camera to record; add a tracker or 'camera:' (docs/camera.md)");
        intrinsics_ = *setup.intrinsics;
        fps_ = setup.fps;
        file_.start(setup.first_sequence, [&](std::string_view line) {
            if (dissertation_) {
                const bool before = next_line_ < setup.first_sequence;
                next_line_ += before;
                return before;
            }
            const auto frame = arhost::json_text::frame_of_line(line);
            return frame ? *frame < setup.first_sequence : line.starts_with("{\"format\"");
        });
    }

    arhost_status write(const arhost_output &output) {
        const arhost_record &record = *output.record;
        text_.clear();
        if (dissertation_) {
            // The lines have no frame numbers, so each frame that live mode dropped also needs a line.
            if (record.sequence > next_line_)
                text_.assign(record.sequence - next_line_, '\n');
            arhost::trajectory::append_dissertation_frame(text_, record);
        } else {
            if (file_.empty())
                arhost::trajectory::append_header(text_, intrinsics_, record.clock, fps_);
            arhost::trajectory::append_frame(text_, record);
        }
        file_.append(text_);
        next_line_ = record.sequence + 1;
        return ARHOST_STATUS_OK;
    }

private:
    arhost::files::LineFile file_;
    bool dissertation_;
    arhost_intrinsics intrinsics_{};
    double fps_ = 0;
    std::uint64_t next_line_ = 0; // for `dissertation`: frame number of the next line
    std::string text_;
};

constexpr const char *formats[] = {"arhost", "dissertation", nullptr};
constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr, "The trajectory to write, one line per frame."),
    arhost::option(
        ARHOST_OPTION_TEXT, "format", "arhost",
        "arhost: JSON lines with time stamps and intrinsics; dissertation: eye, look-at point and up vector per "
        "line (docs/trajectories.md).",
        0, 0, formats),
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SINK,
    .id = "org.arhost.sink_trajectory",
    .name = "Trajectory",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Records the camera of each frame for 'arhost replay'.",
    .capabilities = 0,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

} // namespace

ARHOST_SINK(TrajectorySink, descriptor)
