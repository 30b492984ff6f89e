// SPDX-License-Identifier: Apache-2.0
//
// The outputs of a run: the configured ones, and those that commands start (recordings and snapshots).
#pragma once

#include "base/listening_socket.hpp"
#include "host/assembly.hpp"
#include "host/compositing.hpp"
#include "host/sink_queue.hpp"

#include <map>

namespace arhost::host {

class Outputs {
public:
    using OnRequest = std::function<void(SinkQueue &, const ipc::messages::Request &)>;
    // `check_scratch`: sinks write to check_folder(*check_scratch, …) instead of their own folders.
    Outputs(RunParts &parts, Assembly &assembly, OnRequest on_request,
            std::optional<std::filesystem::path> check_scratch);
    static std::filesystem::path check_folder(const std::filesystem::path &scratch, std::size_t output);

    void start(); // the configured outputs
    bool have_started() const;
    void begin_video(); // from now on, the run ends if all outputs have ended

    // Composites a frame and offers it to the outputs. Returns when the frame was composited.
    Frame::Clock::time_point show(Frame &frame);
    bool are_full() const; // no memory is free for a frame
    void pump();           // submits waiting frames, stops outputs that are ending
    bool have_written_all() const;
    void stop();
    void stop_waiting(); // makes sinks return that wait for their receivers
    void remove_ended(); // the outputs that commands have started, and that have ended

    // ---- outputs that commands start; each throws control::Error -----------------------------------
    void take_snapshot(const control::Done &done);
    void set_recording(std::optional<bool> on, const control::Done &done); // nullopt: toggle

    const std::vector<std::unique_ptr<SinkQueue>> &sinks() const { return sinks_; }
    // The last snapshots and recordings that were written completely, by their numbers.
    const std::map<std::uint64_t, std::string> &files() const { return written_files_; }

private:
    static constexpr std::size_t max_files = 100;
    static constexpr std::size_t max_started = 4; // outputs that commands have started and that still run

    SinkQueue &make_sink(const run_config::ComponentConfiguration &output, const std::string &name,
                         const std::string &path = "");
    SinkQueue &start_output(const run_config::ComponentConfiguration &output, const std::string &name,
                            const control::Done &done);
    std::filesystem::path free_path(const std::filesystem::path &pattern) const;
    supervise::Component::Create on_hello(SinkQueue &sink, const model::PluginDescription &plugin,
                                          std::size_t candidate);
    std::vector<int> open_sockets(const run_config::ComponentConfiguration &output,
                                  std::vector<model::OptionValue> &options);
    void expect_distinct_files(const run_config::ComponentConfiguration &output,
                               const model::PluginDescription &plugin);
    void on_running(SinkQueue &sink);
    void on_result(SinkQueue &sink, const ipc::Command &command, const ipc::Result &result);
    void end_sink(SinkQueue &sink); // the sink has ended
    // Answers the command in progress when the component of an output has stopped; `error`: why it failed.
    void conclude(SinkQueue &sink, std::string error);
    void close_sink(SinkQueue &sink);
    void end_without_sinks(); // ends the run if all outputs are closed

    RunParts &parts_;
    Assembly &assembly_;
    const OnRequest on_request_;
    const std::optional<std::filesystem::path> check_scratch_;
    std::vector<std::unique_ptr<SinkQueue>> sinks_;
    std::shared_ptr<SlotPool> slots_;
    Compositing compositing_;
    OutputFramePointer last_frame_; // for snapshots
    std::map<std::uint64_t, std::string> written_files_;
    std::string failed_recording_; // why the last recording failed; "" if it did not, or a command was told
    std::map<const run_config::ComponentConfiguration *, run_config::OutputFile> files_;
    std::map<std::pair<const run_config::ComponentConfiguration *, std::string>, base::ListeningSocket>
        sockets_; // by output and option; sockets stay open while a worker restarts
};

// Returns all components of a run, including those that start or end.
std::vector<supervise::Component *> components_of(const Assembly &assembly, const Outputs &outputs);

} // namespace arhost::host
