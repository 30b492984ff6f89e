// SPDX-License-Identifier: Apache-2.0
#include "payload.hpp"

#include <algorithm>
#include <utility>

namespace arhost::uvc {

std::optional<PayloadHeader> parse_payload_header(Bytes payload) {
    // bmHeaderInfo
    constexpr unsigned frame_id = 1, end_of_frame = 2, has_presentation = 4, has_clock = 8, still_image = 0x20,
                       error = 0x40;
    if (payload.size() < 2 || payload[0] < 2 || payload[0] > payload.size())
        return std::nullopt;
    PayloadHeader header;
    header.size = payload[0];
    const unsigned info = payload[1];
    header.frame_id = info & frame_id;
    header.ends_frame = info & end_of_frame;
    header.has_error = info & error;
    header.is_still = info & still_image;
    std::size_t at = 2;
    const auto ticks = [&] {
        const std::uint8_t *bytes = payload.data() + at;
        return bytes[0] | std::uint32_t{bytes[1]} << 8 | std::uint32_t{bytes[2]} << 16 |
               std::uint32_t{bytes[3]} << 24;
    };
    // Some cameras set bits of fields that their header is too short to contain.
    if (info & has_presentation && header.size >= at + 4) {
        header.presentation_ticks = ticks();
        at += 4;
    }
    if (info & has_clock && header.size >= at + 6)
        header.clock_ticks = ticks();
    return header;
}

void Losses::count(Damage damage) {
    switch (damage) {
    case Damage::none:
        return;
    case Damage::marked:
        ++marked;
        return;
    case Damage::lost_packet:
        ++lost_packet;
        return;
    case Damage::malformed:
        ++malformed;
        return;
    case Damage::truncated:
        ++truncated;
        return;
    case Damage::oversized:
        ++oversized;
        return;
    }
}

FrameAssembler::FrameAssembler(std::size_t max_bytes, std::size_t exact_bytes, Take take)
    : max_bytes_(max_bytes), exact_bytes_(exact_bytes), take_(std::move(take)) {
    frame_.bytes.reserve(max_bytes);
}

inline void FrameAssembler::append(Bytes data) {
    if (!in_frame_)
        return;
    const std::size_t space = max_bytes_ - frame_.bytes.size();
    if (data.size() > space)
        damage(Damage::oversized);
    const Bytes kept = data.first(std::min(data.size(), space));
    frame_.bytes.insert(frame_.bytes.end(), kept.begin(), kept.end());
}

void FrameAssembler::add_payload(Bytes payload, std::int64_t arrival_ns) {
    begin(payload, arrival_ns);
    end();
}

void FrameAssembler::add_bulk(Bytes bytes, bool ends_payload, std::int64_t arrival_ns) {
    if (!in_payload_ && !bytes.empty())
        begin(bytes, arrival_ns);
    else if (in_payload_ && !skips_payload_)
        append(bytes);
    if (in_payload_ && ends_payload)
        end();
}

void FrameAssembler::lose_packet() {
    if (in_frame_)
        damage(Damage::lost_packet);
}

void FrameAssembler::begin(Bytes payload, std::int64_t arrival_ns) {
    in_payload_ = true;
    ends_frame_ = false;
    const std::optional<PayloadHeader> header = parse_payload_header(payload);
    skips_payload_ = !header || header->is_still;
    if (!header && in_frame_)
        damage(Damage::malformed);
    if (skips_payload_)
        return;
    if (in_frame_ && header->frame_id != frame_id_) // the end of the frame was lost, or the camera does not mark it
        finish();
    const Bytes data = payload.subspan(header->size);
    frame_id_ = header->frame_id;
    ends_frame_ = header->ends_frame;
    if (!in_frame_ && data.empty())
        return; // isochronous cameras send headers without data between frames
    if (!in_frame_) {
        in_frame_ = true;
        frame_.bytes.clear();
        frame_.arrival_ns = arrival_ns;
        frame_.presentation_ticks.reset();
        frame_.clock_ticks.reset();
        frame_.damage = Damage::none;
    }
    if (!frame_.presentation_ticks)
        frame_.presentation_ticks = header->presentation_ticks;
    if (!frame_.clock_ticks && header->clock_ticks) {
        frame_.clock_ticks = header->clock_ticks;
        frame_.clock_arrival_ns = arrival_ns;
    }
    if (header->has_error)
        damage(Damage::marked);
    append(data);
}

void FrameAssembler::end() {
    in_payload_ = false;
    if (in_frame_ && ends_frame_)
        finish();
}

void FrameAssembler::finish() {
    in_frame_ = false;
    if (frame_.bytes.size() < exact_bytes_)
        damage(Damage::truncated);
    take_(frame_);
}

void FrameAssembler::damage(Damage cause) {
    if (frame_.damage == Damage::none)
        frame_.damage = cause;
}

} // namespace arhost::uvc
