// SPDX-License-Identifier: Apache-2.0
#include "host/compositing.hpp"

#include "host/raytracer.hpp"
#include "pixels/linear.hpp"

#include <algorithm>
#include <cstring>
#include <tuple>

namespace arhost::host {

using namespace ipc;
using Clock = std::chrono::steady_clock;

namespace {

// Copies the video frame and the overlay, each only if a sink reads it.
void copy_inputs(const Frame &frame, const arhost_frame_format &format, const ImageView &overlay,
                 const Region &region, std::uint64_t inputs, std::span<std::byte> slot) {
    const OutputSlot layout(format);
    if (inputs & ARHOST_SINK_CAPABILITY_VIDEO_INPUT)
        std::memcpy(slot.data() + layout.video_offset, frame.pixels.bytes().data(), format.byte_size);
    if (!(inputs & ARHOST_SINK_CAPABILITY_OVERLAY_INPUT))
        return;
    const std::size_t stride = overlay_stride(format.width);
    std::byte *const rgba = slot.data() + layout.overlay_offset;
    std::memset(rgba, 0, stride * format.height);
    if (!frame.has_overlay())
        return;
    for (std::size_t y = region.y; y < region.y + region.height; ++y) {
        const std::uint8_t *from = overlay.at(region.x, y);
        std::byte *const to = rgba + y * stride + 4 * std::size_t{region.x};
        if (overlay.format.is_linear())
            straight_from_linear(reinterpret_cast<const std::uint16_t *>(from), reinterpret_cast<std::uint8_t *>(to),
                                 region.width);
        else
            std::memcpy(to, from, 4 * std::size_t{region.width});
    }
}

} // namespace

void Compositing::write(Frame &frame, std::uint64_t inputs, std::span<std::byte> slot) {
    const arhost_frame_format &format = parts_.video.format;
    check_buffers_unmodified(frame);
    const Clock::time_point begin = Clock::now();
    const auto *pixels = reinterpret_cast<const std::uint8_t *>(frame.pixels.bytes().data());
    const std::uint8_t *planes[ARHOST_MAX_PLANES] = {};
    for (std::uint32_t i = 0; i < format.plane_count; ++i)
        planes[i] = pixels + format.offset[i];
    ImageView overlay;
    Region region;
    if (frame.has_overlay())
        std::tie(overlay, region) = full_size_overlay(frame);
    write_record(frame, slot);
    const OutputView out{reinterpret_cast<std::uint8_t *>(slot.data()) + OutputSlot::image_offset,
                         OutputSlot::stride(format.width)};
    if (parts_.configuration.time_codes)
        exchange_time_code(frame.observations, out);
    else
        composite(format, planes, overlay, region, out);
    copy_inputs(frame, format, overlay, region, inputs, slot);
    frame.times.composite = Clock::now() - begin;
    parts_.statistics.stages.add("composite", frame.times.composite);
}

void Compositing::write_record(Frame &frame, std::span<std::byte> slot) const {
    frame.record.target_count = static_cast<std::uint32_t>(frame.targets.size());
    frame.record.observation_count = static_cast<std::uint32_t>(frame.observations.size());
    frame.record.expected_count = static_cast<std::uint32_t>(frame.expected.size());
    std::memcpy(slot.data(), &frame.record, sizeof frame.record);
    const auto copy_array = [&]<class T>(const std::vector<T> &array, std::uint64_t offset) {
        std::ranges::copy(std::as_bytes(std::span(array)), slot.data() + offset);
    };
    copy_array(frame.targets, OutputSlot::targets_offset);
    copy_array(frame.observations, OutputSlot::observations_offset);
    copy_array(frame.expected, OutputSlot::expected_offset);
}

// Returns the overlay, scaled to the size of the frame, and its region. The result is valid until the next call.
std::pair<ImageView, Region> Compositing::full_size_overlay(const Frame &frame) {
    const arhost_frame_format &format = parts_.video.format;
    const auto [width, height] = overlay_size(format, frame.quality);
    const Region region = region_of(frame.render, width, height);
    const ImageView overlay = overlay_of(frame, format);
    if (width == format.width && height == format.height)
        return {overlay, region};
    const std::size_t stride = overlay_stride(format.width, overlay.format.form);
    enlarged_.resize(stride * format.height);
    const Region larger = enlarge(overlay, width, height, region, format, enlarged_.data(), stride);
    return {ImageView{enlarged_.data(), stride, overlay.format}, larger};
}

// Reports a contract violation if a buffer changed after hand-over.
void Compositing::check_buffers_unmodified(const Frame &frame) {
    const std::uint64_t sequence = frame.record.sequence;
    const auto check = [&](const char *name, const std::optional<std::size_t> &sample,
                           std::span<const std::byte> buffer, const char *problem) {
        if (sample && !buffer.empty())
            parts_.statistics.contract_checks.add(name, sequence,
                                                  contracts::sample_hash(buffer, sequence) == *sample ? "" : problem);
    };
    check("source.frame-stays", frame.pixels_sample,
          frame.pixels ? frame.pixels.bytes() : std::span<const std::byte>(), "the frame changed after hand-over");
    check("raytracer.image-stays", frame.overlay_sample, overlay_bytes(frame, parts_.video.format),
          "the image changed after hand-over");
}

// Measures the age of the picture that the frame shows, and draws the next picture.
void Compositing::exchange_time_code(std::span<const arhost_observation> observations, const OutputView &out) {
    const Clock::time_point now = Clock::now();
    if (!time_codes_)
        time_codes_.emplace(now);
    if (const auto age = time_codes_->see(observations, now))
        parts_.statistics.stages.add("glass_to_glass", *age);
    if (time_codes_->is_overdue(std::chrono::seconds(5), now))
        parts_.context.log(
            ARHOST_SEVERITY_WARNING, "latency",
            "the camera has not shown a time code for 5 s: point it at the output's picture, so that the whole black "
            "square with its white border is in view, sharp, without reflections and not mirrored");
    time_codes_->draw(out, parts_.video.format.width, parts_.video.format.height, now);
}

} // namespace arhost::host
