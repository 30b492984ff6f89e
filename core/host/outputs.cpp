// SPDX-License-Identifier: Apache-2.0
#include "host/outputs.hpp"

#include "host/documents.hpp"
#include "run_config/access.hpp"

#include <arhost-cpp/numbered_name.hpp>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <random>
#include <utility>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;

namespace {

std::string random_id() {
    std::random_device random;
    return fmt::format("{:08x}{:08x}", random(), random());
}

} // namespace

Outputs::Outputs(RunParts &parts, Assembly &assembly, OnRequest on_request,
                 std::optional<std::filesystem::path> check_scratch)
    : parts_(parts), assembly_(assembly), on_request_(std::move(on_request)),
      check_scratch_(std::move(check_scratch)), compositing_(parts) {}

std::filesystem::path Outputs::check_folder(const std::filesystem::path &scratch, std::size_t output) {
    return scratch / std::to_string(output);
}

// ---- start ----------------------------------------------------------------------------------------------

void Outputs::start() {
    const std::vector<run_config::ComponentConfiguration> &outputs = parts_.configuration.outputs;
    slots_ = std::make_shared<SlotPool>(supervise::make_host_region(
        "arhost-outputs",
        {OutputSlot(parts_.video.format).byte_size,
         // Sinks may lag by different amounts and hold different frames, so each sink needs slots of its own.
         static_cast<std::uint32_t>(live_sink_depth + 2 * (outputs.size() + max_started) + 2)}));
    for (std::size_t i = 0; i < outputs.size(); ++i) {
        std::string name = outputs[i].plugins.front().stem().string();
        if (std::ranges::any_of(sinks_, [&](const auto &sink) { return sink->component->name() == name; }))
            name += "#" + std::to_string(i);
        SinkQueue &sink = make_sink(outputs[i], name);
        if (check_scratch_)
            sink.folder = check_folder(*check_scratch_, i);
    }
}

bool Outputs::have_started() const {
    return std::ranges::all_of(sinks_, [](const auto &sink) { return sink->closed || sink->component->running(); });
}

void Outputs::begin_video() {
    const auto has_debug_view = [](const auto &sink) {
        return std::ranges::count(sink->component->description().options, "debug_view", &OptionDeclaration::key) > 0;
    };
    const auto &outputs = parts_.configuration.outputs;
    if (!outputs.empty() && outputs.front().debug_view && std::ranges::none_of(sinks_, has_debug_view))
        parts_.log(ARHOST_SEVERITY_WARNING,
                   "--debug-view has no effect, because no output can draw it; add one that can, such as "
                   "{plugin: sink_video, path: out/debug.mp4}");
    end_without_sinks();
}

// `path`: for an output that a command starts, the file to write instead of the configured one.
SinkQueue &Outputs::make_sink(const run_config::ComponentConfiguration &output, const std::string &name,
                              const std::string &path) {
    sinks_.push_back(std::make_unique<SinkQueue>(parts_.statistics));
    SinkQueue *sink = sinks_.back().get();
    sink->configuration = &output;
    sink->id = random_id();
    sink->max_waiting = parts_.live() ? live_sink_depth : 0;
    sink->path = path;
    sink->first_message = parts_.messages.last_number();
    Component::Callbacks callbacks = parts_.callbacks(name, output.node);
    callbacks.hello = [this, sink](const PluginDescription &plugin, std::size_t candidate) {
        return on_hello(*sink, plugin, candidate);
    };
    callbacks.ready = [sink](const messages::Ready &ready) {
        sink->set_inputs(ready.capabilities &
                         (ARHOST_SINK_CAPABILITY_VIDEO_INPUT | ARHOST_SINK_CAPABILITY_OVERLAY_INPUT));
        return SlotLayout{};
    };
    callbacks.running = [this, sink] { on_running(*sink); };
    callbacks.result = [this, sink](const Command &command, const Result &result) {
        on_result(*sink, command, result);
    };
    callbacks.lost = [sink](const std::vector<Command> &) { sink->on_lost(); };
    callbacks.end_requested = [this, sink] { end_sink(*sink); };
    callbacks.request = [this, sink](const messages::Request &request) { on_request_(*sink, request); };
    callbacks.stopped = [this, sink, report = callbacks.stopped](arhost_status status, const std::string &text) {
        report(status, text);
        conclude(*sink, status == ARHOST_STATUS_OK ? "" : text.empty() ? status_text(status) : text);
    };
    callbacks.disabled = [this, sink, report = callbacks.disabled](const std::string &reason,
                                                                   bool is_configuration_error) {
        report(reason, is_configuration_error);
        conclude(*sink, reason);
        close_sink(*sink);
    };
    sink->component = std::make_unique<Component>(parts_.context, name, output.plugins, output.limits, output.policy,
                                                  std::move(callbacks));
    sink->component->start();
    return *sink;
}

Component::Create Outputs::on_hello(SinkQueue &sink, const PluginDescription &plugin, std::size_t candidate) {
    const run_config::ComponentConfiguration &output = *sink.configuration;
    const run_config::Configuration &configuration = parts_.configuration;
    const Video &video = parts_.video;
    if (plugin.capabilities & ARHOST_SINK_CAPABILITY_REALTIME)
        sink.max_waiting = live_sink_depth; // a window drops frames instead of delaying other outputs
    messages::SinkSetup setup{video.format, video.format.fps, sink.first_sequence(), {}};
    if (configuration.source && configuration.source->fps > 0)
        setup.fps = configuration.source->fps;
    if (video.intrinsics.width > 0)
        setup.intrinsics = video.intrinsics;
    if (plugin.capabilities & ARHOST_SINK_CAPABILITY_RUN_DESCRIPTION)
        setup.run_description = run_description(parts_, assembly_, sink.id);
    std::vector<OptionValue> options = parts_.options.choose(*sink.component, ARHOST_KIND_SINK, output, candidate);
    expect_distinct_files(output, plugin);
    for (OptionValue &option : options)
        if (!sink.folder.empty() && option.type == ARHOST_OPTION_OUTPUT_PATH && !option.text.empty() &&
            option.text != "-")
            option.text = sink.folder / std::filesystem::path(option.text).filename();
        else if (option.key == "path" && !sink.path.empty())
            option.text = sink.path;
    if (std::ranges::count(plugin.needs, "display") > 0)
        parts_.flow.set_paced(configuration.paced.value_or(true));
    std::vector<int> sockets = open_sockets(output, options);
    return {{std::move(options), setup}, std::move(sockets)};
}

// Opens the sockets of an output's options, unless they are still open because its worker has restarted. Returns
// their descriptors.
std::vector<int> Outputs::open_sockets(const run_config::ComponentConfiguration &output,
                                       std::vector<OptionValue> &options) {
    std::vector<int> descriptors;
    for (OptionValue &option : options) {
        if (option.type != ARHOST_OPTION_LISTEN || option.text.empty())
            continue;
        const auto configured = output.options ? output.options->find(option.key) : std::nullopt;
        const yaml::Node node = configured.value_or(output.node);
        if (output.policy.mode != sandbox::Mode::none && !output.policy.allows("listen"))
            node.fail("needs 'allow: [listen]' in " + output.node.path() + " (docs/security.md)");
        auto socket = sockets_.find({&output, option.key});
        if (socket == sockets_.end()) {
            try {
                socket = sockets_.try_emplace({&output, option.key}, option.text).first;
            } catch (const std::exception &error) {
                node.fail(error.what());
            }
        }
        option.text = socket->second.address();
        option.integer = static_cast<std::int64_t>(descriptors.size());
        descriptors.push_back(socket->second.fd());
    }
    return descriptors;
}

// Compares the output's file with those of the plugins that are already known.
void Outputs::expect_distinct_files(const run_config::ComponentConfiguration &output,
                                    const PluginDescription &plugin) {
    if (const auto path = run_config::path_of(output.node))
        files_.insert_or_assign(&output, run_config::OutputFile{*path, (plugin.capabilities &
                                                                        ARHOST_SINK_CAPABILITY_NUMBERED_FILES) != 0});
    std::vector<run_config::OutputFile> files = parts_.configuration.report_files();
    for (const auto &[writer, file] : files_)
        files.push_back(file);
    run_config::expect_distinct(files);
}

void Outputs::on_running(SinkQueue &sink) {
    if (sink.awaits_its_frame() && parts_.flow.is_frozen()) {
        sink.answer("the frame that is shown was composited without what this output writes; end the freeze and send "
                    "the command again");
        close_sink(sink);
        sink.component->stop();
    } else if (!sink.ending && !sink.is_single) {
        sink.answer("");
    }
}

// ---- frames ---------------------------------------------------------------------------------------------

bool Outputs::are_full() const {
    return !slots_->has_free() && std::ranges::any_of(sinks_, [](const auto &sink) { return !sink->closed; });
}

Frame::Clock::time_point Outputs::show(Frame &frame) {
    std::uint64_t inputs = 0;
    for (const auto &sink : sinks_)
        inputs |= sink->inputs();
    if (std::ranges::all_of(sinks_, [](const auto &sink) { return sink->closed; }))
        return parts_.context.reactor.now();
    auto output =
        std::make_shared<OutputFrame>(OutputFrame{frame.record.sequence, *slots_->acquire(), frame.captured, inputs});
    compositing_.write(frame, inputs, output->slot.bytes());
    const auto composited = parts_.context.reactor.now(); // before an output can have written the frame
    if (parts_.configuration.snapshot)
        last_frame_ = output;
    for (const auto &sink : sinks_)
        sink->offer(output);
    for (const auto &sink : sinks_)
        sink->pump();
    return composited;
}

void Outputs::pump() {
    for (const auto &sink : sinks_) {
        sink->pump();
        if (parts_.failures.video_runs() && sink->ending && sink->empty() && sink->component->running())
            sink->component->stop();
    }
}

bool Outputs::have_written_all() const {
    return std::ranges::all_of(sinks_, [](const auto &sink) { return sink->empty() || sink->closed; });
}

void Outputs::on_result(SinkQueue &sink, const Command &command, const Result &result) {
    sink.on_result(command, result);
    if (result.status == ARHOST_STATUS_END)
        end_sink(sink);
    if (result.status >= 0 || sink.closed)
        return;
    if (!parts_.flow.was_interrupted() || result.status != ARHOST_STATUS_ERROR_CANCELLED) {
        // A restart would not help, for example if the disk is full. Keeps the files that are complete and continues
        // with the other outputs.
        const std::string &name = sink.component->name();
        const std::string reason = "cannot write frame " + std::to_string(command.sequence) + ": " +
                                   status_text(result.status) + "; this output is closed";
        parts_.context.log(ARHOST_SEVERITY_ERROR, name, reason);
        parts_.failures.add(name + ": " + reason, false, true);
        sink.failure = reason; // the output's own message, which explains it, may arrive later
    }                          // otherwise the receiver did not take the frame in time
    close_sink(sink);
    sink.component->stop();
}

// ---- end ------------------------------------------------------------------------------------------------

void Outputs::end_sink(SinkQueue &sink) {
    const std::string &name = sink.component->name();
    if (sink.closed || sink.has_quit)
        return;
    if (sink.configuration->control.contains("quit")) {
        sink.has_quit = true;
        parts_.context.log(ARHOST_SEVERITY_INFO, name, "ends the run");
        return assembly_.end_input();
    }
    close_sink(sink);
    parts_.context.log(ARHOST_SEVERITY_INFO, name,
                       parts_.flow.input_has_ended()
                           ? "has ended"
                           : "has ended; the other outputs continue ('control: [quit]' lets it end the run)");
    sink.component->stop();
}

void Outputs::conclude(SinkQueue &sink, std::string error) {
    if (error.empty() && sink.awaits_its_frame())
        error = "the run ended before the next frame";
    else if (error.empty() && !sink.failure.empty())
        error = sink.failure;
    else if (error.empty() && sink.on_demand && !sink.has_written())
        error = "no frame arrived, so no file was written";
    if (!sink.failure.empty()) // prefers the output's own message
        if (const std::string reason =
                parts_.messages.error_of(sink.component->name(), sink.first_message, sink.failure);
            !reason.empty())
            error = reason;
    if (!sink.on_demand && error.empty() && !sink.has_written() && parts_.statistics.composited > 0 &&
        !parts_.flow.was_interrupted() && run_config::path_of(sink.configuration->node))
        parts_.failures.add(sink.component->name() + ": no frame arrived, so no file was written", false);
    if (sink.on_demand && !sink.done && !sink.is_single && !error.empty())
        failed_recording_ = "the recording '" + sink.path + "' failed: " + error;
    if (sink.on_demand && !sink.path.empty() && error.empty()) {
        written_files_.emplace(written_files_.empty() ? 1 : written_files_.rbegin()->first + 1, sink.path);
        if (written_files_.size() > max_files)
            written_files_.erase(written_files_.begin());
    }
    sink.answer(error);
}

void Outputs::close_sink(SinkQueue &sink) {
    sink.closed = true;
    sink.clear();
    if (parts_.failures.video_runs())
        end_without_sinks();
}

void Outputs::end_without_sinks() {
    if (!sinks_.empty() &&
        std::ranges::all_of(sinks_, [](const auto &sink) { return sink->closed || sink->on_demand; }))
        assembly_.end_input();
}

void Outputs::stop() {
    // A sink that is not running is restarted once more, so that it can finish its files.
    for (const auto &sink : sinks_)
        if (sink->component->state() != Component::State::stopped)
            sink->component->stop();
}

void Outputs::stop_waiting() {
    for (const auto &sink : sinks_)
        if (sink->component->waits())
            sink->component->cancel_call();
}

void Outputs::remove_ended() {
    std::erase_if(sinks_,
                  [this](const auto &sink) { return sink->on_demand && parts_.take_if_ended(*sink->component); });
}

// ---- outputs that commands start ------------------------------------------------------------------------

void Outputs::take_snapshot(const control::Done &done) {
    if (!last_frame_)
        throw control::Error("there is no frame yet");
    SinkQueue &sink = start_output(*parts_.configuration.snapshot, "snapshot", done);
    sink.is_single = true;
    sink.offer(last_frame_);
}

void Outputs::set_recording(std::optional<bool> on, const control::Done &done) {
    const auto recording = [this](bool closed) { // `closed`: one that has failed, but has not ended yet
        return std::ranges::find_if(sinks_, [closed](const auto &sink) {
            return sink->on_demand && sink->component->name() == "record" && !sink->ending && sink->closed == closed;
        });
    };
    auto active = recording(false);
    if (on.value_or(active == sinks_.end())) {
        if (active != sinks_.end())
            throw control::Error("a recording is already in progress");
        failed_recording_.clear();
        start_output(*parts_.configuration.record, "record", done);
        return;
    }
    if (active == sinks_.end())
        active = recording(true);
    if (active == sinks_.end())
        throw control::Error(failed_recording_.empty() ? "there is no recording to stop"
                                                       : std::exchange(failed_recording_, ""));
    SinkQueue &sink = **active;
    if (!sink.component->running())
        throw control::Error("the recording is starting; retry when it has started");
    sink.done = done;
    sink.ending = true;
}

SinkQueue &Outputs::start_output(const run_config::ComponentConfiguration &output, const std::string &name,
                                 const control::Done &done) {
    std::string path;
    if (const auto node = run_config::path_of(output.node))
        path = free_path(node->output_path()).string();
    const auto started = std::ranges::count_if(sinks_, [](const auto &sink) { return sink->on_demand; });
    if (std::cmp_greater_equal(started, max_started))
        throw control::Error("too many recordings and snapshots are being written; retry later");
    SinkQueue &sink = make_sink(output, name, path);
    sink.on_demand = true;
    sink.done = done;
    return sink;
}

// Replaces the number in a numbered file name by the first number for which no file exists.
std::filesystem::path Outputs::free_path(const std::filesystem::path &pattern) const {
    if (pattern.filename().string().find('%') == std::string::npos)
        return pattern;
    const NumberedName name(pattern.filename().string());
    for (std::uint64_t number = 1;; ++number) {
        std::filesystem::path path = pattern.parent_path() / name.name(number);
        std::error_code ignored;
        if (!std::filesystem::exists(std::filesystem::symlink_status(path, ignored)) &&
            std::ranges::none_of(sinks_, [&](const auto &sink) { return sink->path == path; }))
            return path;
    }
}

std::vector<Component *> components_of(const Assembly &assembly, const Outputs &outputs) {
    std::vector<Component *> all = assembly.components();
    for (const auto &sink : outputs.sinks())
        all.push_back(sink->component.get());
    return all;
}

} // namespace arhost::host
