// SPDX-License-Identifier: Apache-2.0
//
// Frames of images, videos and cameras. A source plugin decodes them in a sandboxed worker, as in a run, so a damaged
// or hostile file cannot harm the process that uses the frames.
#pragma once

#include "plugin_tools/workers.hpp"
#include "run_config/configuration.hpp"
#include "supervise/component.hpp"

#include <opencv2/core/mat.hpp>

#include <deque>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace arhost::frames {

// A source plugin, its options in YAML syntax, and its permissions.
struct Input {
    std::string plugin;
    std::map<std::string, std::string> options{};
    std::vector<std::string> allow{};
};

// Returns the input that reads a video, an image or numbered images ("desk/%04d.png"). Throws std::runtime_error if
// there is no such regular file.
Input file_input(const std::filesystem::path &file);
// Returns the input for a device such as /dev/video0, a URL such as rtsp://camera/1, or a file. `width`, `height`:
// size of a device's images in px; 0: its default.
Input camera_input(const std::string &name, int width, int height);

class FrameReader {
public:
    // Starts the worker. `signals`: a signalfd whose signals interrupt next(), or -1.
    FrameReader(plugin_tools::Workers &workers, const Input &input, int signals);
    FrameReader(const FrameReader &) = delete;
    FrameReader &operator=(const FrameReader &) = delete;

    // Returns the grey pixels of the next frame, or nullopt at the end. They are valid until the next call. All
    // frames have the same size. Throws base::Interrupted, or std::runtime_error if the frames cannot be read.
    std::optional<cv::Mat> next();
    // Returns the grey pixels of a file that must have exactly one frame. `name` is for the error.
    cv::Mat only(const std::string &name);

private:
    static constexpr std::uint32_t slot_count = 3; // one for the caller, the others for frames that are being read
    struct Arrived {
        supervise::RegionPointer region;
        std::uint32_t slot;
    };
    supervise::Component::Callbacks callbacks();
    supervise::Component::Create on_hello(const model::PluginDescription &plugin);
    ipc::SlotLayout on_ready(const ipc::messages::Ready &ready);
    void on_result(const ipc::Command &command, const ipc::Result &result);
    void read_ahead();
    cv::Mat grey_of(const Arrived &frame);

    ipc::Reactor &reactor_;
    int signals_, signal_ = 0;
    ipc::Reactor::Registration signal_watch_;
    run_config::Configuration configuration_;
    arhost_frame_format format_{};
    std::uint64_t next_sequence_ = 0; // of the next frame to request
    std::deque<Arrived> arrived_;
    std::optional<Arrived> current_;
    std::vector<std::uint8_t> full_range_; // grey pixels of a format whose luma has limited range
    bool ended_ = false;
    std::string failure_;
    supervise::Component component_;
};

} // namespace arhost::frames
