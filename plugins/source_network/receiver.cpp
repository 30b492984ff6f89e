// SPDX-License-Identifier: Apache-2.0
#include "receiver.hpp"

#include "stream_url.hpp"

#include <algorithm>
#include <utility>

namespace arhost {

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

} // namespace

Receiver::Receiver(const Host &host, ReceiverSettings settings)
    : host_(host), settings_(std::move(settings)), log_(host, &without_credentials),
      thread_([this](const std::stop_token &stop) { run(stop); }) {}

std::optional<Received> Receiver::take(milliseconds limit) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, limit, [&] { return !kept_.empty() || error_ || ended_; });
    if (!kept_.empty()) {
        Received taken = std::move(kept_.front());
        kept_.pop_front();
        return taken;
    }
    if (error_)
        std::rethrow_exception(error_);
    return std::nullopt;
}

bool Receiver::ended() {
    const std::lock_guard lock(mutex_);
    return ended_ && kept_.empty() && !error_; // if error_ is set, take throws it
}

double Receiver::fps() {
    const std::lock_guard lock(mutex_);
    return fps_;
}

Receiver::Losses Receiver::losses() const {
    const std::lock_guard lock(mutex_);
    return losses_;
}

void Receiver::run(const std::stop_token &stop) {
    while (!stop.stop_requested()) {
        try {
            receive(stop);
            return finish({});
        } catch (const Failure &failure) {
            if (!has_received_ && !settings_.retries_at_once)
                return finish(std::current_exception());
            if (!std::exchange(is_lost_, true) && !stop.stop_requested()) {
                host_.warn(std::string(failure.what()) + "; reconnecting until it is back");
                const std::lock_guard lock(mutex_);
                ++losses_.connections;
            }
        } catch (...) {
            return finish(std::current_exception());
        }
        if (!wait(stop, Clock::now() + delay_))
            return;
        delay_ = std::min(2 * delay_, longest_delay);
    }
}

// Receives one connection until the end of a recording. Throws Failure if the connection is lost.
void Receiver::receive(const std::stop_token &stop) {
    NetworkStream stream(settings_.stream, log_, stop);
    const Clock::time_point begin = Clock::now();
    clock_.restart();
    epoch_ns_.reset();
    while (stream.next()) {
        if (std::exchange(is_lost_, false))
            host_.info("the stream '" + without_credentials(settings_.stream.url) + "' is back");
        has_received_ = true;
        if (Clock::now() - begin > longest_delay)
            delay_ = first_delay; // the connection is stable
        if (stream.is_ahead_of_time() && !wait_until_due(stream, stop))
            return;
        publish(stream);
    }
}

bool Receiver::wait(const std::stop_token &stop, Clock::time_point until) {
    std::unique_lock lock(mutex_);
    changed_.wait_until(lock, stop, until, [] { return false; });
    return !stop.stop_requested();
}

bool Receiver::wait_until_due(const NetworkStream &stream, const std::stop_token &stop) {
    constexpr std::int64_t latest_ns = 500'000'000, earliest_ns = 10'000'000'000;
    const auto sender_ns = stream.sender_ns();
    if (!sender_ns)
        return true;
    const std::int64_t now_ns = monotonic_ns();
    const std::int64_t early_ns = epoch_ns_ ? *epoch_ns_ + *sender_ns - now_ns : 0;
    // A picture that is far too late or far too early indicates an interruption or a jump of the time stamps.
    if (!epoch_ns_ || early_ns < -latest_ns || early_ns > earliest_ns)
        epoch_ns_ = now_ns - *sender_ns;
    return wait(stop, Clock::time_point(std::chrono::nanoseconds(*epoch_ns_ + *sender_ns)));
}

std::int64_t Receiver::capture_ns(const NetworkStream &stream) {
    // A picture that arrives ahead of time waits until it is due. The due time then counts as its arrival.
    const std::int64_t now_ns = monotonic_ns(), arrival_ns = stream.is_ahead_of_time() ? now_ns : stream.arrival_ns();
    const auto utc_ns = stream.sender_utc_ns();
    if (!settings_.uses_sender_clock || !utc_ns)
        return clock_.capture_ns(stream.sender_ns(), arrival_ns);
    const std::int64_t utc_now_ns =
        std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
            .count();
    const std::int64_t age_ns = utc_now_ns - *utc_ns;
    constexpr std::int64_t oldest_ns = 10'000'000'000;
    if (age_ns >= 0 && age_ns < oldest_ns)
        return clock_.capture_ns(std::nullopt, now_ns - age_ns);
    if (!std::exchange(clock_reported_, true))
        host_.warn("sender_clock: by the camera's clock, pictures arrive " + std::to_string(age_ns / 1'000'000) +
                   " ms after their capture, so the clocks differ; "
                   "the times of arrival are used instead");
    return clock_.capture_ns(stream.sender_ns(), arrival_ns);
}

void Receiver::publish(const NetworkStream &stream) {
    Received received{libav::allocated<libav::FramePointer>(av_frame_clone(&stream.picture())), capture_ns(stream),
                      0};
    const std::lock_guard lock(mutex_);
    fps_ = stream.fps();
    skipped_ += stream.damaged();
    losses_.damaged += stream.damaged();
    received.skipped = std::exchange(skipped_, 0);
    kept_.push_back(std::move(received));
    if (kept_.size() > settings_.capacity) {
        const std::uint32_t dropped = kept_.front().skipped + 1;
        kept_.pop_front();
        kept_.front().skipped += dropped;
        ++losses_.superseded;
    }
    changed_.notify_all();
}

void Receiver::finish(std::exception_ptr error) {
    const std::lock_guard lock(mutex_);
    ended_ = true;
    error_ = std::move(error);
    changed_.notify_all();
}

} // namespace arhost
