// SPDX-License-Identifier: Apache-2.0
#include "frames/frame_reader.hpp"

#include "base/text.hpp"
#include "base/write_all.hpp"
#include "pixels/grey.hpp"

#include <nlohmann/json.hpp>

#include <utility>

namespace arhost::frames {
namespace {

namespace fs = std::filesystem;

// JSON is valid YAML.
std::string quoted(const std::string &text) {
    if (!base::is_utf8(text))
        throw std::runtime_error(text + ": the path is not valid UTF-8; rename the file or the folder");
    return nlohmann::json(text).dump();
}

run_config::Configuration configuration_of(const Input &input) {
    std::string text =
        "version: 1\nrestart: {quarantine_after: 1, proven_after_frames: 1000000}\nsource:\n  plugin: " +
        input.plugin + "\n  allow: " + nlohmann::json(input.allow).dump() + "\n  options:\n";
    for (const auto &[key, value] : input.options)
        text += "    " + key + ": " + value + "\n";
    return run_config::parse(yaml::Node::parse(text, input.plugin), plugin_tools::built_in_plugins());
}

} // namespace

Input file_input(const fs::path &file) {
    std::error_code error;
    const fs::file_status status = fs::status(file, error);
    const bool is_numbered = file.string().find('%') != std::string::npos;
    if (fs::is_directory(status))
        throw std::runtime_error(file.string() + ": is a folder, not a file");
    if (status.type() == fs::file_type::not_found && !is_numbered)
        throw std::runtime_error(file.string() + ": there is no such file");
    if (status.type() == fs::file_type::none)
        throw std::runtime_error(file.string() + ": " + error.message());
    if (fs::exists(status) && !fs::is_regular_file(status))
        throw std::runtime_error(file.string() + ": is not a regular file");
    return {"source_file", {{"path", quoted(fs::absolute(file).string())}}};
}

Input camera_input(const std::string &name, int width, int height) {
    if (name.starts_with("/dev/")) {
        Input input{"source_v4l2", {{"device", quoted(name)}}, {"video"}};
        if (width > 0)
            input.options.insert({{"width", std::to_string(width)}, {"height", std::to_string(height)}});
        return input;
    }
    if (name.find("://") != std::string::npos)
        return {"source_network", {{"url", quoted(name)}}, {"network"}};
    return file_input(name);
}

FrameReader::FrameReader(plugin_tools::Workers &workers, const Input &input, int signals)
    : reactor_(workers.context().reactor), signals_(signals), configuration_(configuration_of(input)),
      component_(workers.context(), "source", configuration_.source->plugins, configuration_.source->limits,
                 configuration_.source->policy, callbacks()) {
    if (signals >= 0)
        signal_watch_ = reactor_.watch(signals, [this] { signal_ = base::take_signal(signals_); });
    component_.start();
}

supervise::Component::Callbacks FrameReader::callbacks() {
    supervise::Component::Callbacks callbacks;
    callbacks.hello = [this](const model::PluginDescription &plugin, std::size_t) { return on_hello(plugin); };
    callbacks.ready = [this](const ipc::messages::Ready &ready) { return on_ready(ready); };
    callbacks.running = [this] { read_ahead(); };
    callbacks.result = [this](const ipc::Command &command, const ipc::Result &result) { on_result(command, result); };
    callbacks.lost = [this](const std::vector<ipc::Command> &unanswered) {
        if (!unanswered.empty())
            next_sequence_ = unanswered.front().sequence;
    };
    callbacks.disabled = [this](const std::string &reason, bool) {
        // Omits the place in the configuration, which the user has not written.
        constexpr std::string_view place = ": source.options.";
        const std::size_t at = reason.find(place), end = reason.find(": ", at == std::string::npos ? at : at + 1);
        failure_ = end == std::string::npos ? reason : reason.substr(end + 2);
    };
    return callbacks;
}

supervise::Component::Create FrameReader::on_hello(const model::PluginDescription &plugin) {
    std::vector<std::string> notes; // only trackers and ray tracers add notes
    return {{run_config::options_for(plugin, ARHOST_KIND_SOURCE, *configuration_.source, 0, notes),
             ipc::messages::SourceSetup{next_sequence_, 0, false, std::nullopt}},
            {}};
}

ipc::SlotLayout FrameReader::on_ready(const ipc::messages::Ready &ready) {
    if (!ready.format)
        throw ipc::ProtocolViolation("the source's 'ready' lacks the frame format");
    const arhost_frame_format &format = *ready.format;
    // Frames of the previous process, which have its layout, may still be waiting.
    if (format_.width > 0 && (format.pixel_format != format_.pixel_format || format.width != format_.width ||
                              format.height != format_.height || format.yuv_range != format_.yuv_range ||
                              format.has_depth != format_.has_depth))
        throw std::runtime_error("the frame format differs after the restart");
    format_ = format;
    return {format_.byte_size, slot_count};
}

void FrameReader::on_result(const ipc::Command &command, const ipc::Result &result) {
    if (result.status >= ARHOST_STATUS_END)
        ended_ = true;
    else if (result.status < 0)
        component_.disable(std::string("a frame cannot be read: ") + model::status_text(result.status));
    else if (!ended_)
        arrived_.push_back({component_.output(), command.slot});
}

void FrameReader::read_ahead() {
    while (!ended_ && component_.running() &&
           component_.in_flight() + arrived_.size() + current_.has_value() < slot_count) {
        ipc::Command command{};
        command.kind = ipc::CommandKind::read;
        command.slot = static_cast<std::uint32_t>(next_sequence_ % slot_count);
        command.sequence = next_sequence_++;
        component_.submit(command);
    }
}

cv::Mat FrameReader::grey_of(const Arrived &frame) {
    std::uint8_t *grey =
        reinterpret_cast<std::uint8_t *>(frame.region->layout.slot(frame.region->mapping, frame.slot).data()) +
        format_.grey_offset;
    if (has_limited_luma_plane(format_)) {
        full_range_.resize(std::size_t{format_.grey_stride} * format_.height);
        expand_luma_plane(format_, grey, full_range_.data());
        grey = full_range_.data();
    }
    return {static_cast<int>(format_.height), static_cast<int>(format_.width), CV_8UC1, grey, format_.grey_stride};
}

std::optional<cv::Mat> FrameReader::next() {
    current_.reset();
    read_ahead();
    while (arrived_.empty() && !ended_ && failure_.empty() && signal_ == 0)
        reactor_.run_once();
    if (const int signal = std::exchange(signal_, 0))
        throw base::Interrupted(signal, "interrupted");
    if (arrived_.empty() && !failure_.empty())
        throw std::runtime_error(failure_);
    if (arrived_.empty())
        return std::nullopt;
    current_ = arrived_.front();
    arrived_.pop_front();
    return grey_of(*current_);
}

cv::Mat FrameReader::only(const std::string &name) {
    const std::optional<cv::Mat> first = next();
    if (!first)
        throw std::runtime_error(name + ": has no frame");
    cv::Mat image = first->clone();
    if (next())
        throw std::runtime_error(name + ": has several frames; read it with --video");
    return image;
}

} // namespace arhost::frames
