// SPDX-License-Identifier: Apache-2.0
//
// Targets for bytes that a USB camera sends.
#include "input.hpp"
#include "targets.hpp"

#include "camera_common/jpeg.hpp"
#include "source_uvc/clock.hpp"
#include "source_uvc/descriptors.hpp"
#include "source_uvc/payload.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <vector>

namespace arhost::fuzz {
namespace {

void require(bool holds, const char *what) {
    if (!holds)
        throw std::logic_error(what);
}

void check(const uvc::FrameSize &frame) {
    require(frame.width > 0 && frame.height > 0 && frame.index > 0, "an empty frame");
    require(std::ranges::is_sorted(frame.intervals) && std::ranges::count(frame.intervals, 0u) == 0,
            "intervals that are 0 or not sorted");
    require(frame.intervals.size() <= uvc::max_intervals, "too many intervals");
    require(frame.max_fps() >= 0 && frame.max_fps() <= uvc::intervals_per_second, "an impossible rate");
    for (const std::uint32_t wanted : {0u, 333333u, ~0u})
        require(frame.nearest_interval(wanted) > 0 || (frame.intervals.empty() && frame.longest_interval == 0),
                "a frame interval of 0");
}

} // namespace

void run_uvc_descriptors(Bytes bytes) {
    const uvc::Configuration found = uvc::parse_configuration(bytes);
    require(found.functions.size() <= uvc::max_functions && found.defects.size() <= uvc::max_defects, "no limit");
    for (const uvc::VideoFunction &function : found.functions) {
        require(function.units.size() <= uvc::max_units && function.streams.size() <= uvc::max_streams, "no limit");
        for (const uvc::StreamingInterface &stream : function.streams) {
            require(stream.formats.size() <= uvc::max_formats && stream.alternates.size() <= uvc::max_alternates,
                    "no limit");
            for (const uvc::AlternateSetting &alternate : stream.alternates)
                require((alternate.endpoint & 0x80) && alternate.payload_bytes > 0 &&
                            alternate.payload_bytes <= 48 << 10,
                        "an endpoint that cannot be used");
            for (const uvc::Format &format : stream.formats) {
                require(format.frames.size() <= uvc::max_frames && !format.name.empty(), "no limit or no name");
                for (const uvc::FrameSize &frame : format.frames)
                    check(frame);
            }
        }
    }
}

// Input: the sizes of a frame, the frequency of the clock, and payloads, each after its size, kind and time of
// arrival.
void run_uvc_payloads(Bytes bytes) {
    Input input(bytes);
    const std::size_t max_bytes = input.number<std::uint16_t>();
    const std::size_t exact_bytes = std::min<std::size_t>(input.number<std::uint16_t>(), max_bytes);
    uvc::CaptureTimes times(input.number<std::uint32_t>());
    uvc::Losses losses;
    std::int64_t last_ns = 0, now_ns = 0;
    uvc::FrameAssembler assembler(max_bytes, exact_bytes, [&](uvc::AssembledFrame &frame) {
        require(frame.bytes.size() <= max_bytes, "a frame larger than its maximum");
        require(frame.damage != uvc::Damage::none || frame.bytes.size() >= exact_bytes, "a truncated frame");
        if (frame.clock_ticks)
            times.add_clock(*frame.clock_ticks, frame.clock_arrival_ns);
        const std::int64_t time_ns = times.time_of(frame.presentation_ticks, frame.arrival_ns);
        require(time_ns >= last_ns && time_ns <= frame.arrival_ns, "a time that decreases or is in the future");
        last_ns = time_ns;
        losses.count(frame.damage);
    });
    while (!input.empty()) {
        const std::uint8_t size = input.number(), kind = input.number();
        now_ns += std::int64_t{1000} * input.number<std::uint16_t>() * input.number();
        const Bytes payload = input.take(size);
        if (kind & 1)
            assembler.add_bulk(payload, kind & 2, now_ns);
        else if (kind & 4)
            assembler.lose_packet();
        else
            assembler.add_payload(payload, now_ns);
    }
}

// Motion-JPEG: the input as the first picture of a stream, which sets the format, and as a later one of 32 × 24
// pixels.
void run_uvc_frames(Bytes bytes) {
    constexpr std::uint32_t max_pixels = 1 << 20; // source_uvc accepts only the size that it has negotiated
    JpegDecoder decoder;
    const auto decode = [&](arhost_frame_format format) {
        if (!arhost_frame_layout(&format)) // the picture is too wide or too high, which source_uvc checks, too
            return;
        std::vector<std::uint8_t> pixels(format.byte_size);
        std::array<std::uint8_t *, ARHOST_MAX_PLANES> planes{};
        for (std::uint32_t plane = 0; plane < format.plane_count; ++plane)
            planes[plane] = pixels.data() + format.offset[plane];
        std::string fault;
        require(decoder.decode(bytes, format, planes.data(), fault) || !fault.empty(), "a fault without a reason");
    };
    arhost_frame_format first{};
    if (decoder.describe(bytes, first) && std::uint64_t{first.width} * first.height <= max_pixels)
        decode(first);
    for (const arhost_pixel_format pixels :
         {ARHOST_PIXEL_FORMAT_I420, ARHOST_PIXEL_FORMAT_GREY8, ARHOST_PIXEL_FORMAT_BGR8}) {
        arhost_frame_format stream{};
        stream.width = 32;
        stream.height = 24;
        stream.pixel_format = pixels;
        decode(stream);
    }
}

} // namespace arhost::fuzz
