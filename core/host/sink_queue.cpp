// SPDX-License-Identifier: Apache-2.0
#include "host/sink_queue.hpp"

#include "base/clock.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <utility>

namespace arhost::host {

using namespace ipc;

namespace {

std::chrono::nanoseconds latency_of(const OutputFrame &frame, const Result &result) {
    const std::int64_t captured_ns = std::chrono::nanoseconds(frame.captured.time_since_epoch()).count();
    // The value comes from the worker, so it may be any number.
    return std::chrono::nanoseconds(
        std::clamp(result.ended_ns, captured_ns, base::to_ns(base::steady_clock().now())) - captured_ns);
}

} // namespace

void SinkQueue::offer(OutputFramePointer frame) {
    if (closed || ending || (frame->inputs & inputs_) != inputs_)
        return;
    waiting_.push_back(std::move(frame));
    ending = is_single;
    if (max_waiting > 0 && waiting_.size() > max_waiting) {
        waiting_.pop_front();
        ++statistics_.dropped[component->name()];
    }
}

void SinkQueue::set_inputs(std::uint64_t inputs) {
    inputs_ = inputs;
    std::erase_if(waiting_, [&](const OutputFramePointer &frame) { return (frame->inputs & inputs) != inputs; });
    if (is_single && empty())
        ending = false;
}

void SinkQueue::pump() {
    while (!closed && component->running() && !waiting_.empty() && component->in_flight() < max_in_flight) {
        const OutputFramePointer frame = waiting_.front();
        waiting_.pop_front();
        unconfirmed_.push_back(frame);
        Command command{};
        command.kind = CommandKind::write;
        command.input_slot = frame->slot.index();
        command.sequence = frame->sequence;
        component->submit(command, frame->slot.region());
    }
}

void SinkQueue::on_result(const Command &command, const Result &result) {
    if (result.status > 0)
        next_sequence_ = command.sequence + 1;
    if (!unconfirmed_.empty()) {
        // A snapshot writes a frame that was composited long ago.
        if (result.status >= 0 && !on_demand)
            statistics_.latencies.add(component->name(), latency_of(*unconfirmed_.front(), result));
        unconfirmed_.pop_front();
    }
    statistics_.stages.add(component->name(), std::chrono::nanoseconds(result.busy_ns));
}

void SinkQueue::on_lost() {
    waiting_.insert(waiting_.begin(), unconfirmed_.begin(), unconfirmed_.end());
    unconfirmed_.clear();
}

void SinkQueue::answer(const std::string &error) {
    if (const control::Done answer = std::exchange(done, nullptr))
        answer(error, path.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json{{"file", path}});
}

void SinkQueue::clear() {
    waiting_.clear();
    unconfirmed_.clear();
}

std::uint64_t SinkQueue::first_sequence() const {
    if (next_sequence_ == 0)
        return 0; // no frame was confirmed, so the sink starts from the beginning
    if (!unconfirmed_.empty())
        return unconfirmed_.front()->sequence;
    return waiting_.empty() ? next_sequence_ : waiting_.front()->sequence;
}

} // namespace arhost::host
