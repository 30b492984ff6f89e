// SPDX-License-Identifier: Apache-2.0
//
// sink_poses: writes the pose log, which has one line of JSON per frame, to a file, a pipe or the network.
#include "sink_common/json_text.hpp"
#include "sink_common/line_file.hpp"
#include "sink_common/pipe_stream.hpp"
#include "sink_common/record_line.hpp"
#include "udp_sender.hpp"

#include <arhost-cpp/plugin.hpp>

#include <sys/stat.h>

#include <optional>
#include <string>
#include <utility>

namespace {

using arhost::pipe::PipeStream;

bool is_stream(const std::string &path) {
    struct stat status {};
    return path == "-" || (::stat(path.c_str(), &status) == 0 && S_ISFIFO(status.st_mode));
}

class PoseSink {
public:
    PoseSink(const arhost::Host &host, const arhost::Options &options) : host_(host), receiver_(options.text("udp")) {
        const std::string path = options.text("path");
        if (path.empty() == receiver_.empty())
            throw arhost::Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                                  "set either 'path' or the option 'udp' (plugins/sink_poses/README.md)");
        if (is_stream(path))
            stream_.emplace(host, path, PipeStream::Content::text);
        else if (!path.empty())
            file_.emplace(host, path);
    }

    void start(const arhost_sink_setup &setup) {
        if (stream_)
            stream_->check();
        if (!receiver_.empty())
            udp_.emplace(host_, receiver_);
        is_continued_ = setup.first_sequence > 0;
        if (file_)
            file_->start(setup.first_sequence, [&](std::string_view line) {
                const auto frame = arhost::json_text::frame_of_line(line);
                return frame && *frame < setup.first_sequence;
            });
    }

    arhost_status write(const arhost_output &output) {
        line_.clear();
        arhost::record::append_line(line_, *output.record);
        if (file_)
            file_->append(line_);
        if (udp_)
            udp_->send(line_);
        return stream_ ? write_to_stream() : ARHOST_STATUS_OK;
    }

    void stop() {
        if (stream_)
            stream_->close();
    }

private:
    arhost_status write_to_stream() {
        for (;;) {
            if (!stream_->is_open()) {
                stream_->open(false);
                // The previous process may have ended within a line.
                if (std::exchange(is_continued_, false))
                    line_.insert(0, "\n");
            }
            if (stream_->write({reinterpret_cast<const std::uint8_t *>(line_.data()), line_.size()}))
                return ARHOST_STATUS_OK;
            if (stream_->is_standard_output())
                return ARHOST_STATUS_END;
            stream_->close(); // and wait for the next reader
        }
    }

    arhost::Host host_;
    std::string receiver_;
    std::optional<arhost::files::LineFile> file_;
    std::optional<PipeStream> stream_;
    std::optional<arhost::poses::UdpSender> udp_;
    bool is_continued_ = false;
    std::string line_;
};

constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_OUTPUT_PATH, "path", "",
                   "The log to write, one JSON line per frame; or an existing FIFO, or '-' for standard output."),
    arhost::option(ARHOST_OPTION_TEXT, "udp", "",
                   "HOST:PORT that receives each line as a datagram, instead of 'path'; needs 'allow: [network]'."),
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SINK,
    .id = "org.arhost.sink_poses",
    .name = "Pose log",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Writes the targets, poses and camera of each frame as one line of JSON.",
    .capabilities = ARHOST_SINK_CAPABILITY_STANDARD_OUTPUT,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

} // namespace

ARHOST_SINK(PoseSink, descriptor)
