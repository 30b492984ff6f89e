// SPDX-License-Identifier: Apache-2.0
#include "supervise/component.hpp"

#include <algorithm>
#include <csignal>

namespace arhost::supervise {

using namespace ipc;
using namespace model;

namespace {

bool is_valid_status(arhost_kind kind, arhost_status status) {
    if (status == ARHOST_STATUS_END)
        return kind == ARHOST_KIND_SOURCE || kind == ARHOST_KIND_SINK;
    if (status == ARHOST_STATUS_END_TRUNCATED)
        return kind == ARHOST_KIND_SOURCE;
    return status == ARHOST_STATUS_OK || (status < 0 && status >= ARHOST_STATUS_ERROR_INTERNAL);
}

// Whether a restart may fix the error `status`, because a new process reopens its device and starts with free memory.
// The host handles other errors: it restarts a source and disables a sink.
bool needs_new_process(arhost_kind kind, arhost_status status) {
    if (kind == ARHOST_KIND_SINK)
        return status == ARHOST_STATUS_ERROR_DEVICE_LOST;
    return kind != ARHOST_KIND_SOURCE &&
           (status == ARHOST_STATUS_ERROR_DEVICE_LOST || status == ARHOST_STATUS_ERROR_OUT_OF_MEMORY);
}

constexpr const char *in_total = " in total, although it reported progress";

// Returns what a user can change if a call takes too long.
const char *remedy_for(arhost_kind kind) {
    switch (kind) {
    case ARHOST_KIND_RAYTRACER:
        return " (deadline_ms); raise it, or lower the samples or the image size";
    case ARHOST_KIND_TRACKER:
        return " (deadline_ms)";
    default:
        return " (deadline_ms); a plugin that waits must report progress (in Python, host.wait)";
    }
}

} // namespace

RegionPointer make_host_region(const char *name, const SlotLayout &layout) {
    auto region = std::make_shared<Region>();
    region->memory = SharedMemory::create(name, layout.byte_size());
    region->layout = layout;
    region->mapping = region->memory.map(Access::read_write);
    region->memory.seal_future_writes();
    return region;
}

Component::Component(Context &context, std::string name, std::vector<std::filesystem::path> plugins,
                     const base::Limits &limits, sandbox::Policy sandbox, Callbacks callbacks)
    : context_(context), name_(std::move(name)), plugins_(std::move(plugins)), limits_(limits),
      sandbox_(std::move(sandbox)), callbacks_(std::move(callbacks)), budget_(context.log, name_),
      restart_policy_(limits.restart) {}

void Component::start() {
    spawn();
}

void Component::spawn() {
    state_ = State::starting;
    handshake_ = Handshake::opening;
    stop_sent_ = false;
    stop_response_.reset();
    configuration_error_.clear();
    failure_.clear();
    has_lost_device_ = false;
    description_ = {};
    Process::Callbacks callbacks;
    callbacks.message = [this](Message &message) { on_message(message); };
    callbacks.result = [this](const Result &result) { on_result(result); };
    callbacks.died = [this](const Death &death) { on_died(death); };
    try {
        process_ = std::make_unique<Process>(context_, budget_, std::move(callbacks),
                                             messages::Open{plugin().string()}, sandbox_);
    } catch (const std::exception &error) { // handled like the death of a process
        state_ = State::waiting;
        return restart(error.what());
    }
    set_start_deadline();
    set_deadline(total_deadline_, limits_.start_total, "did not start", in_total);
}

void Component::stop() {
    stop_requested_ = true;
    if (state_ == State::running)
        stop_when_idle();
    else if (state_ == State::idle || state_ == State::disabled)
        stopped(ARHOST_STATUS_OK, "");
}

void Component::kill() {
    stop_requested_ = true;
    restart_timer_.cancel();
    deadline_.cancel();
    total_deadline_.cancel();
    if (process_) {
        cpu_seconds_of_dead_ += process_->cpu_seconds();
        process_.reset();
    }
    state_ = State::stopped;
}

void Component::cancel_call() {
    call_cancelled_ = true;
    if (process_)
        process_->request_cancel();
}

void Component::end_process(const std::string &reason) {
    if (process_)
        process_->end(reason);
}

void Component::disable(const std::string &reason) {
    if (!process_)
        return;
    configuration_error_ = reason;
    process_->kill_now();
}

std::size_t Component::earlier_outputs() const {
    return static_cast<std::size_t>(
        std::ranges::count_if(earlier_outputs_, [](const auto &region) { return !region.expired(); }));
}

// Returns the worker's generation number for this memory.
std::uint32_t Component::attach(const RegionPointer &input) {
    for (const AttachedInput &attached : attached_inputs_)
        if (attached.region.lock() == input)
            return attached.generation;
    attached_inputs_.push_back({input, next_generation_++});
    process_->send_ordered(messages::Attach{false, attached_inputs_.back().generation, input->layout},
                           {input->memory.fd()});
    return attached_inputs_.back().generation;
}

void Component::submit(Command command, const RegionPointer &input, const RegionPointer &state,
                       const RegionPointer &video) {
    if (input)
        command.input_generation = attach(input);
    if (state)
        command.state_generation = attach(state);
    if (video)
        command.video_generation = attach(video);
    std::erase_if(attached_inputs_, [this](const AttachedInput &attached) {
        if (!attached.region.expired())
            return false;
        process_->send_ordered(messages::Detach{attached.generation});
        return true;
    });
    command.ticket = next_ticket_++;
    in_flight_.push_back(command);
    if (in_flight_.size() == 1)
        begin_command();
    process_->submit(command);
}

void Component::on_message(Message &message) {
    if (is<messages::Progress>(message)) {
        if (state_ == State::starting)
            set_start_deadline();
        else if (stop_sent_)
            set_stop_deadline();
        else if (!call_cancelled_ && !in_flight_.empty()) {
            waits_ = description_.kind == ARHOST_KIND_SINK;
            set_frame_deadline();
        }
    } else if (is<messages::Hello>(message) && handshake_ == Handshake::opening) {
        on_hello(message);
    } else if (is<messages::Ready>(message) && handshake_ == Handshake::creating) {
        on_ready(message);
    } else if (is<messages::Attached>(message)) {
        on_attached(parse<messages::Attached>(message));
    } else if (is<messages::Failed>(message)) {
        const auto [status, text] = parse<messages::Failed>(message);
        has_lost_device_ = has_lost_device_ || status == ARHOST_STATUS_ERROR_DEVICE_LOST;
        if (state_ != State::starting)
            log(ARHOST_SEVERITY_WARNING, text);
        else if (status == ARHOST_STATUS_ERROR_CONFIGURATION || status == ARHOST_STATUS_ERROR_UNSUPPORTED)
            configuration_error_ = text;
        else
            failure_ = text;
    } else if (is<messages::Stopped>(message) && stop_sent_) {
        stop_response_ = parse<messages::Stopped>(message);
    } else if (is<messages::End>(message) && description_.kind == ARHOST_KIND_SINK) {
        callbacks_.end_requested();
    } else if (is<messages::Request>(message) && description_.kind == ARHOST_KIND_SINK && running()) {
        callbacks_.request(parse<messages::Request>(message));
    } else if (is<messages::OptionSet>(message) && !unset_options_.empty()) {
        const auto [status, text] = parse<messages::OptionSet>(message);
        const auto done = std::move(unset_options_.front());
        unset_options_.pop_front();
        done(status > 0 ? "" : text.empty() ? status_text(status) : text);
    } else if (is<messages::CountersChanged>(message)) {
        counters_ = parse<messages::CountersChanged>(message).counters;
        if (!are_valid(counters_)) {
            counters_.clear();
            process_->end("protocol violation: invalid counters");
        }
    } else if (!is<messages::Detached>(message)) {
        process_->end("protocol violation: unexpected message " + message.body["type"].dump());
    }
}

void Component::on_hello(const Message &message) {
    handshake_ = Handshake::creating;
    try {
        messages::Hello hello = parse<messages::Hello>(message);
        description_ = std::move(hello.descriptor);
        sandbox_level_ = std::move(hello.sandbox);
        if (const std::string problem = problem_with_id(description_.id, plugin()); !problem.empty())
            throw std::runtime_error(plugin().string() + ": " + problem);
        const Create create = callbacks_.hello(description_, candidate_);
        process_->send(create.message, create.fds);
        set_start_deadline();
    } catch (const std::exception &error) {
        configuration_error_ = error.what();
        process_->kill_now();
    }
}

void Component::on_ready(const Message &message) {
    handshake_ = Handshake::done;
    SlotLayout layout;
    try {
        layout = callbacks_.ready(parse<messages::Ready>(message));
    } catch (const std::exception &error) {
        configuration_error_ = error.what();
        return process_->kill_now();
    }
    if (layout.count == 0)
        return run();
    pending_output_ = std::make_shared<Region>();
    Region &region = *pending_output_;
    region.layout = layout;
    region.memory = SharedMemory::create(("arhost-" + name_).c_str(), layout.byte_size());
    process_->send_ordered(messages::Attach{true, next_generation_++, layout}, {region.memory.fd()});
}

void Component::on_attached(const messages::Attached &attached) {
    if (!attached.is_output || !pending_output_)
        return;
    // The worker has mapped the memory writable. From now on, no other process can do so.
    Region &region = *pending_output_;
    region.memory.seal_future_writes();
    region.mapping = region.memory.map(Access::read_only);
    output_ = std::move(pending_output_);
    run();
}

void Component::run() {
    deadline_.cancel();
    total_deadline_.cancel();
    state_ = State::running;
    if (!std::exchange(missing_device_, "").empty())
        log(ARHOST_SEVERITY_INFO, "its device is back");
    callbacks_.running();
    if (stop_requested_)
        stop_when_idle();
}

void Component::stop_when_idle() {
    if (!running() || !in_flight_.empty() || stop_sent_)
        return;
    stop_sent_ = true;
    process_->send_ordered(messages::Stop{});
    set_stop_deadline();
    set_deadline(total_deadline_, limits_.stop_total, "did not stop", in_total);
}

void Component::answer(const messages::Answer &answer, std::uint32_t restarts) {
    if (running() && restarts == restarts_ && !stop_sent_)
        process_->send_ordered(answer);
}

void Component::set_option(const OptionValue &option, std::function<void(const std::string &)> done) {
    constexpr std::size_t max_unset_options = 4; // the command ring has room for them besides other commands
    if (!running() || stop_sent_)
        return done(name_ + " is not running");
    if (unset_options_.size() >= max_unset_options)
        return done(name_ + " has not applied the previous changes yet; retry later");
    unset_options_.push_back(std::move(done));
    process_->send_ordered(messages::SetOption{option});
}

void Component::on_result(const Result &result) {
    if (in_flight_.empty() || result.ticket != in_flight_.front().ticket)
        return process_->end("protocol violation: unexpected response");
    if (!is_valid_status(description_.kind, result.status))
        return process_->end("contract violation: its status is " + std::to_string(result.status));
    if (result.status == ARHOST_STATUS_ERROR_DEVICE_LOST) {
        has_lost_device_ = true;
        device_losses_.push_back(context_.reactor.now());
    }
    if (needs_new_process(description_.kind, result.status))
        return process_->end(status_text(result.status)); // the command counts as unanswered, as after a crash
    const Command command = in_flight_.front();
    in_flight_.pop_front();
    waits_ = false;
    begin_command();
    callbacks_.result(command, result);
    // Does not count errors as completed frames, nor results because of which the host terminates the process.
    if (result.status > 0 && process_ && !process_->ending())
        restart_policy_.frame_done();
    if (stop_requested_)
        stop_when_idle();
}

void Component::on_died(const Death &death) {
    const std::unique_ptr<Process> dead = std::move(process_);
    cpu_seconds_of_dead_ += death.cpu_seconds;
    deadline_.cancel();
    total_deadline_.cancel();
    counters_of_dead_ = counters();
    counters_.clear();
    std::erase_if(earlier_outputs_, [](const auto &region) { return region.expired(); });
    if (output_)
        earlier_outputs_.push_back(std::exchange(output_, nullptr));
    pending_output_.reset();
    attached_inputs_.clear();
    const std::vector<Command> unanswered(in_flight_.begin(), in_flight_.end());
    in_flight_.clear();
    waits_ = false;
    for (const auto &done : std::exchange(unset_options_, {}))
        done(name_ + " has died");

    state_ = State::waiting;
    const bool finished = death.clean && stop_response_;
    if (!finished)
        callbacks_.lost(unanswered);

    const std::uint64_t frame = unanswered.empty() ? Crash::no_frame : unanswered.front().sequence;
    const bool crash = !death.clean && configuration_error_.empty();
    if (crash)
        record_crash({description_.id.empty() ? plugin().stem().string() : description_.short_name(), death.how,
                      death.log_tail, frame});
    std::string reason = failure_.empty() ? death.how : failure_;
    if (frame != Crash::no_frame)
        reason += ", at frame " + std::to_string(frame);

    if (stop_response_) { // the plugin has finished its work, so a later crash does not matter
        if (crash)
            budget_.log_death(reason + ", after it had finished");
        return stopped(stop_response_->status, stop_response_->text);
    }
    // If a component dies during stop, it is restarted only if it is a sink, because a sink may have to complete
    // files. A sink that the host killed for a hang is restarted once; a sink that crashed, up to the limit
    // quarantine_after.
    const bool is_sink = description_.kind == ARHOST_KIND_SINK;
    deaths_in_stop_ += !stop_sent_ ? 0 : death.by_host ? limits_.restart.quarantine_after - 1 : 1;
    if (stop_sent_ && (!is_sink || deaths_in_stop_ >= limits_.restart.quarantine_after)) {
        budget_.log_death(reason);
        return stopped(is_sink ? ARHOST_STATUS_ERROR_INTERNAL : ARHOST_STATUS_OK, reason);
    }
    if (!configuration_error_.empty())
        return fall_back_or_disable(configuration_error_, true);
    // The process died before Hello, but the host did not kill it, so its library is unusable.
    if (description_.id.empty() && !death.by_host && death.signal != SIGKILL)
        return fall_back_or_disable(plugin().string() + ": " + death.how, true);
    if (loses_its_device_often() && candidate_ + 1 < plugins_.size())
        return fall_back_or_disable(reason + "; its device was lost " + std::to_string(device_losses_.size()) +
                                        " times within a minute",
                                    false);
    if (has_lost_device_ && may_wait_for_device())
        return wait_for_device(reason);
    restart(reason);
}

// Restarts do not help against a device that is lost again and again, even if frames are delivered in between.
bool Component::loses_its_device_often() {
    constexpr std::size_t often = 3;
    std::erase_if(device_losses_, [minute_ago = context_.reactor.now() - std::chrono::minutes(1)](const auto &time) {
        return time < minute_ago;
    });
    return device_losses_.size() >= often;
}

void Component::record_crash(Crash crash) {
    crashes_.push_back(std::move(crash));
    if (crashes_.size() > Crash::max_kept)
        crashes_.pop_front();
}

void Component::restart(const std::string &reason) {
    const auto delay = restart_policy_.delay_after_death(std::uniform_real_distribution<double>(0, 1)(jitter_));
    if (!delay)
        return fall_back_or_disable(
            reason + (restart_policy_.failures() > 1
                          ? "; it failed " + std::to_string(restart_policy_.failures()) + " times in a row"
                          : ""),
            false);
    const std::string wait = delay->count() ? " in " + std::to_string(delay->count()) + " ms" : "";
    budget_.log_death(reason + "; restarting it" + wait);
    ++restarts_;
    spawn_after(*delay);
}

void Component::spawn_after(std::chrono::milliseconds delay) {
    restart_timer_ = context_.reactor.at(context_.reactor.now() + delay, [this] { spawn(); });
}

// A camera that has worked may come back after any time. Sources have no fallback plugin.
bool Component::may_wait_for_device() const {
    return description_.kind == ARHOST_KIND_SOURCE && description_.capabilities & ARHOST_SOURCE_CAPABILITY_LIVE &&
           restart_policy_.has_completed_frames();
}

// Restarts the process until it finds its device, because a worker's sandbox has no devices that were connected
// later. Counts and reports one restart, however many attempts are necessary.
void Component::wait_for_device(const std::string &reason) {
    restarts_ += missing_device_.empty();
    if (missing_device_ != reason)
        budget_.log_death(reason + "; waiting for its device");
    missing_device_ = reason;
    spawn_after(restart_policy_.delay_while_device_is_lost(std::uniform_real_distribution<double>(0, 1)(jitter_)));
}

void Component::fall_back_or_disable(const std::string &reason, bool is_configuration_error) {
    if (candidate_ + 1 < plugins_.size()) {
        budget_.log_death(reason + "; falling back to " + plugins_[candidate_ + 1].stem().string());
        ++candidate_;
        device_losses_.clear();
        restart_policy_ = RestartPolicy(limits_.restart);
        ++restarts_;
        spawn_after(std::chrono::milliseconds(0));
        return;
    }
    state_ = State::disabled;
    callbacks_.disabled(reason, is_configuration_error);
    if (stop_requested_)
        stopped(ARHOST_STATUS_ERROR_INTERNAL, reason);
}

void Component::stopped(arhost_status status, const std::string &text) {
    state_ = State::stopped;
    budget_.report_repetitions();
    callbacks_.stopped(status, text);
}

Counters Component::counters() const {
    Counters sum = counters_of_dead_;
    for (const auto &[name, value] : counters_)
        if (sum.contains(name) || sum.size() < ARHOST_MAX_COUNTERS) // restarts must not add names without end
            sum[name] += value;
    return sum;
}

void Component::set_start_deadline() {
    set_deadline(deadline_, limits_.start, "did not start",
                 " (start_deadline_ms); it must call host->progress if it needs longer");
}

void Component::set_stop_deadline() {
    set_deadline(deadline_, limits_.stop, "did not stop", " (stop_deadline_ms)");
}

// Sets the deadlines of the oldest command in flight, if any.
void Component::begin_command() {
    total_deadline_.cancel();
    if (!in_flight_.empty() && !may_wait())
        set_deadline(total_deadline_, limits_.frame_total, "too slow: no answer",
                     " in total, although it reported progress, 30 times the limit without progress",
                     remedy_for(description_.kind));
    set_frame_deadline();
}

void Component::set_frame_deadline() {
    deadline_.cancel();
    if (in_flight_.empty())
        return;
    set_deadline(deadline_, limits_.frame, "hung: neither an answer nor progress", "", remedy_for(description_.kind));
}

void Component::set_deadline(ipc::Reactor::Registration &deadline, std::chrono::milliseconds limit, const char *what,
                             const char *details, const char *remedy) {
    deadline = context_.reactor.at(context_.reactor.now() + limit, [this, limit, what, details, remedy] {
        process_->end(std::string(what) + " within " + std::to_string(limit.count()) + " ms" + details + remedy);
    });
}

// Whether the component may wait in a command for any time, if it reports progress: a source for a frame, a sink for
// the receiver of its frames.
bool Component::may_wait() const {
    return description_.kind == ARHOST_KIND_SINK || description_.kind == ARHOST_KIND_SOURCE;
}

} // namespace arhost::supervise
