// SPDX-License-Identifier: Apache-2.0
#include "supervise/component.hpp"

#include <algorithm>
#include <csignal>

namespace arhost::supervise {

using namespace ipc;

namespace {

bool may_answer(arhost_kind kind, arhost_status status) {
    if (status == ARHOST_STATUS_END)
        return kind == ARHOST_KIND_SOURCE || kind == ARHOST_KIND_SINK;
    if (status == ARHOST_STATUS_END_TRUNCATED)
        return kind == ARHOST_KIND_SOURCE;
    return status == ARHOST_STATUS_OK || (status < 0 && status >= ARHOST_STATUS_ERROR_INTERNAL);
}

// A new process may mend these: it opens its device anew, and has taken no memory yet. The host starts a source anew
// after any error, and gives a sink up.
bool calls_for_new_process(arhost_kind kind, arhost_status status) {
    return (kind == ARHOST_KIND_TRACKER || kind == ARHOST_KIND_RAYTRACER) &&
           (status == ARHOST_STATUS_ERROR_DEVICE_LOST || status == ARHOST_STATUS_ERROR_OUT_OF_MEMORY);
}

} // namespace

RegionPointer make_host_region(const char *name, const SlotLayout &layout) {
    auto region = std::make_shared<Region>();
    region->memory = SharedMemory::create(name, layout.byte_size());
    region->layout = layout;
    region->mapping = region->memory.map(Access::read_write);
    region->memory.seal_future_writes();
    region->generation = 1;
    return region;
}

Component::Component(Context &context, std::string name, std::vector<std::filesystem::path> plugins,
                     const Limits &limits, sandbox::Policy policy, Hooks hooks)
    : context_(context), name_(std::move(name)), plugins_(std::move(plugins)), limits_(limits),
      sandbox_(std::move(policy)), hooks_(std::move(hooks)), policy_(limits.restart) {}

void Component::start() {
    spawn();
}

void Component::spawn() {
    state_ = State::starting;
    stop_sent_ = false;
    stop_answer_.reset();
    configuration_error_.clear();
    failure_.clear();
    description_ = {};
    Process::Events events;
    events.message = [this](Message &message) { on_message(message); };
    events.result = [this](const Result &result) { on_result(result); };
    events.died = [this](const Death &death) { on_died(death); };
    try {
        process_ = std::make_unique<Process>(
            context_, name_, std::move(events),
            Json{{"type", "open"}, {"plugin", plugin().string()}, {"sandbox", sandbox::to_json(sandbox_)}});
    } catch (const std::exception &error) { // no process or memory to be had: as if it had died at once
        state_ = State::waiting;
        return try_again(error.what());
    }
    watch_start(limits_.start, "did not start");
}

void Component::stop() {
    stop_requested_ = true;
    if (state_ == State::running)
        stop_when_idle();
    else if (state_ == State::idle || state_ == State::given_up)
        stopped(ARHOST_STATUS_OK, "");
}

void Component::kill() {
    stop_requested_ = true;
    restart_timer_.cancel();
    deadline_.cancel();
    if (process_) {
        cpu_seconds_of_dead_ += process_->cpu_seconds();
        process_.reset();
    }
    state_ = State::stopped;
}

void Component::cancel_call() {
    if (process_)
        process_->ask_to_cancel();
}

void Component::end_process(const std::string &reason) {
    if (process_)
        process_->end(reason);
}

void Component::submit(Command command, const RegionPointer &input) {
    if (input && attached_inputs_.try_emplace(input->generation, input).second)
        process_->send_in_turn({{"type", "attach"},
                                {"role", "input"},
                                {"generation", input->generation},
                                {"layout", to_json(input->layout)}},
                               {input->memory.fd()});
    std::erase_if(attached_inputs_, [this](const auto &entry) {
        if (!entry.second.expired())
            return false;
        process_->send_in_turn({{"type", "detach"}, {"generation", entry.first}});
        return true;
    });
    command.ticket = next_ticket_++;
    if (input)
        command.input_generation = input->generation;
    in_flight_.push_back(command);
    if (in_flight_.size() == 1)
        watch_frame();
    process_->submit(command);
}

void Component::on_message(Message &message) {
    const std::string type = message.body.at("type").get<std::string>();
    if (type == "progress") {
        if (state_ == State::starting)
            watch_start(limits_.start, "did not start");
        else if (stop_sent_)
            watch_start(limits_.stop, "did not stop");
    } else if (type == "hello" && state_ == State::starting) {
        on_hello(message.body);
    } else if (type == "ready" && state_ == State::starting) {
        on_ready(message.body);
    } else if (type == "attached") {
        on_attached(message.body);
    } else if (type == "failed" && state_ == State::starting) {
        const auto status = message.body.at("status").get<arhost_status>();
        const std::string text = message.body.at("text").get<std::string>();
        if (status == ARHOST_STATUS_ERROR_CONFIGURATION || status == ARHOST_STATUS_ERROR_UNSUPPORTED)
            configuration_error_ = text;
        else
            failure_ = text;
    } else if (type == "stopped" && stop_sent_) {
        stop_answer_ = {message.body.at("status").get<arhost_status>(), message.body.at("text").get<std::string>()};
    } else if (type == "failed") {
        context_.log(ARHOST_SEVERITY_WARNING, name_, message.body.at("text").get<std::string>());
    } else if (type == "end") {
        hooks_.ended();
    } else if (type != "detached") {
        process_->end("broke the contract: unexpected message '" + type + "'");
    }
}

void Component::on_hello(const Json &body) {
    try {
        description_ = description_from_json(body.at("descriptor"));
        Create create = hooks_.hello(description_, candidate_);
        create.body["type"] = "create";
        if (create.fds.empty())
            process_->send(create.body);
        else
            process_->send(create.body, {create.fds.front()});
        watch_start(limits_.start, "did not start");
    } catch (const std::exception &error) {
        configuration_error_ = error.what();
        process_->kill_now();
    }
}

void Component::on_ready(const Json &body) {
    SlotLayout layout;
    try {
        layout = hooks_.ready(body);
    } catch (const std::exception &error) {
        configuration_error_ = error.what();
        return process_->kill_now();
    }
    if (layout.count == 0)
        return run();
    output_being_attached_ = std::make_shared<Region>();
    Region &region = *output_being_attached_;
    region.layout = layout;
    region.generation = next_generation_++;
    region.memory = SharedMemory::create(("arhost-" + name_).c_str(), layout.byte_size());
    process_->send_in_turn(
        {{"type", "attach"}, {"role", "output"}, {"generation", region.generation}, {"layout", to_json(layout)}},
        {region.memory.fd()});
}

void Component::on_attached(const Json &body) {
    if (body.at("role") != "output" || !output_being_attached_)
        return;
    // The worker has its writable mapping now: nobody else gets one.
    Region &region = *output_being_attached_;
    region.memory.seal_future_writes();
    region.mapping = region.memory.map(Access::read_only);
    output_ = std::move(output_being_attached_);
    run();
}

void Component::run() {
    deadline_.cancel();
    state_ = State::running;
    hooks_.running();
    if (stop_requested_)
        stop_when_idle();
}

void Component::stop_when_idle() {
    if (!running() || !in_flight_.empty() || stop_sent_)
        return;
    stop_sent_ = true;
    process_->send_in_turn({{"type", "stop"}});
    watch_start(limits_.stop, "did not stop");
}

void Component::on_result(const Result &result) {
    if (in_flight_.empty() || result.ticket != in_flight_.front().ticket)
        return process_->end("broke the contract: it answered what it was not asked");
    if (!may_answer(description_.kind, result.status))
        return process_->end("broke the contract: its status is " + std::to_string(result.status));
    if (calls_for_new_process(description_.kind, result.status))
        return process_->end(status_text(result.status)); // unanswered, as where it had died
    const Command command = in_flight_.front();
    in_flight_.pop_front();
    watch_frame();
    hooks_.result(command, result);
    // An error is no proof that it works, nor is a result that made the host end it.
    if (result.status > 0 && process_ && !process_->ending())
        policy_.frame_done();
    if (stop_requested_)
        stop_when_idle();
}

void Component::on_died(const Death &death) {
    const std::unique_ptr<Process> dead = std::move(process_);
    cpu_seconds_of_dead_ += death.cpu_seconds;
    deadline_.cancel();
    output_.reset();
    output_being_attached_.reset();
    attached_inputs_.clear();
    const std::vector<Command> unanswered(in_flight_.begin(), in_flight_.end());
    in_flight_.clear();

    state_ = State::waiting;
    const bool finished = death.clean && stop_answer_;
    if (!finished)
        hooks_.lost(unanswered);

    const std::uint64_t frame = unanswered.empty() ? Crash::no_frame : unanswered.front().sequence;
    const bool crash = !death.clean && configuration_error_.empty();
    if (crash)
        crashed(
            {description_.id.empty() ? plugin().stem().string() : description_.id, death.how, death.log_tail, frame});
    std::string reason = failure_.empty() ? death.how : failure_;
    if (frame != Crash::no_frame)
        reason += ", at frame " + std::to_string(frame);

    if (stop_answer_) { // it had finished; how it went after that does not matter
        if (crash)
            context_.log(ARHOST_SEVERITY_WARNING, name_, reason + ", after it had finished");
        return stopped(stop_answer_->first, stop_answer_->second);
    }
    // Only a sink has files that are worth further tries: one after a hang, several after a death.
    const bool matters = description_.kind == ARHOST_KIND_SINK;
    deaths_in_stop_ += !stop_sent_ ? 0 : death.by_host ? limits_.restart.quarantine_after - 1 : 1;
    if (stop_sent_ && (!matters || deaths_in_stop_ >= limits_.restart.quarantine_after)) {
        context_.log(ARHOST_SEVERITY_WARNING, name_, reason);
        return stopped(matters ? ARHOST_STATUS_ERROR_INTERNAL : ARHOST_STATUS_OK, reason);
    }
    if (!configuration_error_.empty())
        return give_up(configuration_error_, true);
    // It never even said hello, by its own fault: its library can't be used.
    if (description_.id.empty() && !death.by_host && death.signal != SIGKILL)
        return give_up(plugin().string() + ": " + death.how, true);
    try_again(reason);
}

void Component::crashed(Crash crash) {
    crashes_.push_back(std::move(crash));
    if (crashes_.size() > 100)
        crashes_.pop_front();
}

void Component::try_again(const std::string &reason) {
    const auto delay = policy_.died(std::uniform_real_distribution<double>(0, 1)(jitter_));
    if (!delay)
        return give_up(reason + "; it failed " + std::to_string(policy_.failures()) + " times in a row", false);
    const std::string wait = delay->count() ? " in " + std::to_string(delay->count()) + " ms" : "";
    context_.log(ARHOST_SEVERITY_WARNING, name_, reason + "; starting it again" + wait);
    ++restarts_;
    restart_timer_ = context_.reactor.at(Reactor::Clock::now() + *delay, [this] { spawn(); });
}

void Component::give_up(const std::string &reason, bool by_configuration) {
    if (candidate_ + 1 < plugins_.size()) {
        context_.log(ARHOST_SEVERITY_WARNING, name_,
                     reason + "; falling back to " + plugins_[candidate_ + 1].stem().string());
        ++candidate_;
        policy_ = RestartPolicy(limits_.restart);
        ++restarts_;
        restart_timer_ = context_.reactor.at(Reactor::Clock::now(), [this] { spawn(); });
        return;
    }
    state_ = State::given_up;
    hooks_.given_up(reason, by_configuration);
    if (stop_requested_)
        stopped(ARHOST_STATUS_ERROR_INTERNAL, reason);
}

void Component::stopped(arhost_status status, const std::string &text) {
    state_ = State::stopped;
    hooks_.stopped(status, text);
}

void Component::watch_start(std::chrono::milliseconds limit, const char *what) {
    deadline_ = context_.reactor.at(Reactor::Clock::now() + limit, [this, limit, what] {
        process_->end(std::string(what) + " within " + std::to_string(limit.count()) + " ms");
    });
}

void Component::watch_frame() {
    deadline_.cancel();
    if (in_flight_.empty())
        return;
    deadline_ = context_.reactor.at(Reactor::Clock::now() + limits_.frame, [this] {
        process_->end("hung: no answer within " + std::to_string(limits_.frame.count()) + " ms, its deadline_ms");
    });
}

} // namespace arhost::supervise
