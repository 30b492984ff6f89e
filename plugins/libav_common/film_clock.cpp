// SPDX-License-Identifier: Apache-2.0
#include "libav_common/film_clock.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace arhost::libav {

namespace {

constexpr std::int64_t longest_gap_s = 10; // as in the ffmpeg program

bool is_jump(const AVPacket &from, const AVPacket &to, AVRational time_base) {
    return from.dts != AV_NOPTS_VALUE && to.dts != AV_NOPTS_VALUE &&
           (to.dts < from.dts || av_compare_ts(to.dts - from.dts, time_base, longest_gap_s, {1, 1}) > 0);
}

} // namespace

std::int64_t FilmClock::next_ns(std::optional<std::int64_t> stamp_ns, bool has_jumps) {
    constexpr std::int64_t longest_gap_ns = longest_gap_s * 1'000'000'000;
    const std::int64_t expected_ns = time_ns_ + (is_first_ ? 0 : period_ns_);
    if (stamp_ns && !offset_ns_)
        offset_ns_ = expected_ns - (is_first_ ? 0 : *stamp_ns);
    if (stamp_ns && has_jumps && !is_first_) {
        const auto error_ns = [&](std::int64_t offset_ns) { return std::abs(*stamp_ns + offset_ns - expected_ns); };
        const auto before_jump_ns = std::exchange(offset_before_jump_ns_, std::nullopt);
        if (before_jump_ns && error_ns(*before_jump_ns) < error_ns(*offset_ns_))
            offset_ns_ = before_jump_ns; // only the last time stamp was wrong
        const std::int64_t step_ns = *stamp_ns + *offset_ns_ - time_ns_;
        // A smaller step back is no jump: the time stamps of the pictures are not in order.
        if (step_ns < -2 * period_ns_ || step_ns > longest_gap_ns)
            offset_before_jump_ns_ = std::exchange(offset_ns_, expected_ns - *stamp_ns);
    }
    const std::int64_t found_ns = stamp_ns ? *stamp_ns + *offset_ns_ : expected_ns;
    return time_ns_ = std::exchange(is_first_, false) ? found_ns : std::max(found_ns, time_ns_);
}

PacketReader::PacketReader() : packet_(allocated<PacketPointer>(av_packet_alloc())) {}

int PacketReader::read() {
    av_packet_unref(packet_.get());
    if (ahead_.empty() && !end_)
        read_ahead();
    if (ahead_.empty())
        return *std::exchange(end_, std::nullopt);
    packet_ = std::move(ahead_.front());
    ahead_.pop_front();
    return 0;
}

void PacketReader::read_ahead() {
    // A parser passes the mark on to the packet before the last one of the first video.
    constexpr std::size_t max_ahead = 2;
    do {
        PacketPointer next = allocated<PacketPointer>(av_packet_alloc());
        if (const int result = read_one(*next); result < 0) {
            end_ = result;
            return;
        }
        const bool is_join = !ahead_.empty() && is_jump(*ahead_.back(), *next, stream_->time_base);
        if (is_join)
            for (const PacketPointer &before : ahead_)
                before->flags &= ~AV_PKT_FLAG_CORRUPT;
        ahead_.push_back(std::move(next));
        if (is_join)
            return;
    } while (ahead_.front()->flags & AV_PKT_FLAG_CORRUPT && input_->iformat->flags & AVFMT_TS_DISCONT &&
             ahead_.size() <= max_ahead);
}

int PacketReader::read_one(AVPacket &packet) {
    int result = 0;
    while ((result = av_read_frame(input_, &packet)) >= 0 && packet.stream_index != stream_->index)
        av_packet_unref(&packet);
    return result;
}

} // namespace arhost::libav
