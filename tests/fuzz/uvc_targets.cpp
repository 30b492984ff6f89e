// SPDX-License-Identifier: Apache-2.0
//
// Targets for bytes that a USB camera sends.
#include "targets.hpp"

#include "source_uvc/descriptors.hpp"

#include <algorithm>
#include <stdexcept>

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
                std::ranges::for_each(format.frames, check);
            }
        }
    }
}

} // namespace arhost::fuzz
