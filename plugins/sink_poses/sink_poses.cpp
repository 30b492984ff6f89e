// SPDX-License-Identifier: Apache-2.0
//
// A log of the poses: a line of JSON a frame.
#include "common_files/files.hpp"
#include "pose_line.hpp"

#include <arhost-cpp/plugin.hpp>

#include <fcntl.h>
#include <optional>
#include <string>

namespace {

using arhost::files::File;

class PoseSink {
public:
    PoseSink(const arhost::Host &host, const arhost::Options &options) : host_(host), path_(options.text("path")) {}

    void start(const arhost_sink_setup &setup) {
        arhost::files::make_parent_folders(path_);
        if (setup.first_sequence == 0) // a run that is refused leaves an earlier log as it was
            return arhost::files::check_can_write(path_);
        open();
        end_ = end_of_frames_before(setup.first_sequence);
        if (end_ == 0)
            host_.warn("'" + path_ + "' holds no frame before " + std::to_string(setup.first_sequence) +
                       ": what was logged before the restart is gone");
        file_->truncate(end_);
    }

    arhost_status write(const arhost_output &output) {
        if (!file_) {
            open();
            file_->truncate(0);
        }
        line_.clear();
        arhost::poses::append_line(line_, *output.record);
        try {
            file_->append({reinterpret_cast<const std::uint8_t *>(line_.data()), line_.size()});
        } catch (const arhost::Failure &) {
            file_->truncate(end_); // a line that the disk took in part only
            throw;
        }
        end_ += line_.size();
        return ARHOST_OK;
    }

private:
    void open() { file_.emplace(path_, O_RDWR | O_CREAT | O_APPEND); }

    // The log is whole lines, frames ascending, and after a kill perhaps a part of a line.
    std::uint64_t end_of_frames_before(std::uint64_t first_sequence) const {
        std::string text(file_->size(), '\0');
        file_->read_at(0, {reinterpret_cast<std::uint8_t *>(text.data()), text.size()});
        std::size_t end = 0;
        for (std::size_t next = 0; (next = text.find('\n', end)) != std::string::npos; end = next + 1) {
            const auto frame = arhost::poses::frame_of_line(std::string_view(text).substr(end, next - end));
            if (!frame || *frame >= first_sequence)
                break;
        }
        return end;
    }

    arhost::Host host_;
    std::string path_;
    std::optional<File> file_;
    std::uint64_t end_ = 0; // of the last whole line
    std::string line_;
};

constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr, "The log to write, a line of JSON a frame."),
};

constexpr arhost_descriptor descriptor = {
    sizeof(arhost_descriptor),
    ARHOST_KIND_SINK,
    "sink_poses",
    "Pose log",
    "0.1.0",
    "arhost",
    "Apache-2.0",
    "Writes what is known of each frame (markers, poses, camera) as a line of JSON.",
    0,
    std::size(options),
    options,
    nullptr,
};

} // namespace

ARHOST_SINK(PoseSink, descriptor)
