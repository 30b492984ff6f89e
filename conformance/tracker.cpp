// SPDX-License-Identifier: Apache-2.0
#include "conformance/tracker.hpp"

#include "worker/library.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <cstring>

namespace arhost::conformance {

using ipc::Call;

arhost_frame_format format_of(std::uint32_t width, std::uint32_t height, arhost_pixel_format pixel_format) {
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = pixel_format;
    format.width = width;
    format.height = height;
    format.yuv_matrix = ARHOST_YUV_MATRIX_BT709;
    format.yuv_range = ARHOST_YUV_RANGE_FULL;
    format.fps = 30;
    if (!arhost_frame_layout(&format))
        throw std::runtime_error("the test's frame format is invalid");
    return format;
}

SealedFrame::SealedFrame(const Grey &image, arhost_pixel_format pixel_format, std::uint64_t filler)
    : format_(format_of(image.width, image.height, pixel_format)), memory_(format_.byte_size) {
    auto *bytes = reinterpret_cast<std::uint8_t *>(memory_.data());
    std::mt19937_64 noise(filler);
    std::generate_n(bytes, format_.byte_size, [&] { return static_cast<std::uint8_t>(noise()); });
    const auto put = [&](std::uint64_t offset, std::uint32_t stride, std::uint32_t x, std::uint32_t y, int code) {
        bytes[offset + std::uint64_t{stride} * y + x] = static_cast<std::uint8_t>(code);
    };
    for (std::uint32_t y = 0; y < image.height; ++y)
        for (std::uint32_t x = 0; x < image.width; ++x) {
            const int code = image.at(x, y);
            put(format_.grey_offset, format_.grey_stride, x, y, code);
            if (pixel_format == ARHOST_PIXEL_FORMAT_BGR8 || pixel_format == ARHOST_PIXEL_FORMAT_RGB8)
                for (std::uint32_t channel = 0; channel < 3; ++channel)
                    put(format_.offset[0], format_.stride[0], 3 * x + channel, y, code);
            if (pixel_format == ARHOST_PIXEL_FORMAT_YUYV) {
                put(format_.offset[0], format_.stride[0], 2 * x, y, code);
                put(format_.offset[0], format_.stride[0], 2 * x + 1, y, 128);
            }
        }
    memory_.seal();
}

arhost_frame SealedFrame::frame(std::uint64_t sequence, std::int64_t capture_ns) const {
    const auto *bytes = reinterpret_cast<const std::uint8_t *>(memory_.data());
    arhost_frame frame{};
    frame.struct_size = sizeof frame;
    frame.clock = ARHOST_CLOCK_MEDIA;
    frame.format = &format_;
    for (std::uint32_t i = 0; i < format_.plane_count; ++i)
        frame.plane[i] = bytes + format_.offset[i];
    frame.grey = bytes + format_.grey_offset;
    frame.sequence = sequence;
    frame.capture_ns = capture_ns;
    return frame;
}

Tracker::Tracker(Context &context, Settings overrides)
    : library_(context.library), overrides_(std::move(overrides)),
      functions_(*static_cast<const arhost_tracker *>(context.library.plugin().functions)),
      result_memory_(sizeof(arhost_tracker_result)) {
    create();
}

void Tracker::create() {
    instance_.emplace(library_, overrides_);
    instance_->create_or_fail();
}

arhost_status Tracker::try_start(const arhost_intrinsics &camera, const std::vector<Listed> &listed,
                                 arhost_pixel_format pixel_format) {
    camera_ = camera;
    listed_ = listed;
    format_ = pixel_format;
    std::vector<arhost_marker_config> markers;
    markers.reserve(listed.size());
    for (const Listed &marker : listed)
        markers.push_back({sizeof(arhost_marker_config), marker.id, marker.side_mm});
    const arhost_frame_format format = format_of(camera.width, camera.height, pixel_format);
    return start_with(
        {sizeof(arhost_tracker_setup), static_cast<std::uint32_t>(markers.size()), &format, &camera, markers.data()});
}

arhost_status Tracker::start_with(const arhost_tracker_setup &setup) {
    stop();
    if (!std::exchange(fresh_, false))
        create();
    const arhost_status status =
        in_call(library_.calls(), Call::start, [&] { return functions_.start(instance_->get(), &setup); });
    started_ = status == ARHOST_STATUS_OK;
    sequence_ = 0;
    state_before_.reset();
    state_size_ = started_ ? in_call(library_.calls(), Call::start,
                                     [&] { return worker::state_size_of(functions_, instance_->get()); })
                           : 0;
    return status;
}

void Tracker::start(const arhost_intrinsics &camera, const std::vector<Listed> &listed,
                    arhost_pixel_format pixel_format) {
    instance_->expect_ok("start", try_start(camera, listed, pixel_format));
}

void Tracker::stop() {
    if (std::exchange(started_, false))
        in_call(library_.calls(), Call::stop, [&] { functions_.stop(instance_->get()); });
}

arhost_status Tracker::try_track(const SealedFrame &frame, std::uint64_t sequence, std::int64_t capture_ns) {
    auto *result = new (result_memory_.data()) arhost_tracker_result{};
    result->struct_size = sizeof *result;
    const arhost_frame input = frame.frame(sequence, capture_ns);
    arhost_track_request request{};
    request.struct_size = sizeof request;
    request.frame = &input;
    std::unique_ptr<GuardedMemory> after;
    if (state_size_ > 0) {
        after = std::make_unique<GuardedMemory>(aligned_state_size());
        std::fill_n(after->data(), aligned_state_size(), state_filler_);
        request.state_before = state_before_ ? state_before_->data() : nullptr;
        request.state_after = after->data();
        request.state_size = state_size_;
    }
    const arhost_status status = in_call(library_.calls(), Call::per_frame,
                                         [&] { return functions_.track(instance_->get(), &request, result); });
    if (after && status == ARHOST_STATUS_OK) {
        after->seal();
        state_before_ = std::move(after);
    }
    return status;
}

std::vector<std::byte> Tracker::state() const {
    if (!state_before_)
        return {};
    return {state_before_->data(), state_before_->data() + state_size_};
}

void Tracker::set_state(const std::vector<std::byte> &state, std::byte filler) {
    state_filler_ = filler;
    state_before_.reset();
    if (state.size() != state_size_ || state.empty())
        return;
    state_before_ = std::make_unique<GuardedMemory>(aligned_state_size());
    std::ranges::copy(state, state_before_->data());
    state_before_->seal();
}

std::vector<arhost_marker> Tracker::records() const {
    const auto &result = *reinterpret_cast<const arhost_tracker_result *>(result_memory_.data());
    if (result.marker_count > ARHOST_MAX_MARKERS)
        throw Failure(
            fmt::format("it reports {} markers; the limit is {}", result.marker_count, +ARHOST_MAX_MARKERS));
    return {result.markers, result.markers + result.marker_count};
}

std::vector<arhost_marker> Tracker::seen() const {
    std::vector<arhost_marker> all = records();
    std::erase_if(all, [](const arhost_marker &marker) {
        const bool is_smoothed = marker.state == ARHOST_MARKER_PREDICTED && marker.age_frames == 0;
        return marker.state != ARHOST_MARKER_DETECTED && !is_smoothed;
    });
    return all;
}

std::vector<arhost_marker> Tracker::track(const SealedFrame &frame) {
    instance_->expect_ok("track", try_track(frame, sequence_, static_cast<std::int64_t>(sequence_) * frame_ns));
    ++sequence_;
    return seen();
}

std::vector<arhost_marker> Tracker::track_first(const SealedFrame &frame) {
    if (sequence_ > 0)
        start(camera_, listed_, format_);
    return track(frame);
}

// ---- Expectations ----------------------------------------------------------------------------------

Pose pose_of(const arhost_marker &marker) {
    return glm::make_mat4(marker.mt);
}

double angle_degrees(const Pose &a, const Pose &b) {
    const glm::dmat3 between = glm::transpose(glm::dmat3(a)) * glm::dmat3(b);
    return glm::degrees(std::acos(std::clamp((between[0][0] + between[1][1] + between[2][2] - 1) / 2, -1.0, 1.0)));
}

arhost_marker expect_one(const std::vector<arhost_marker> &found, int id, const std::string &where,
                         const Grey &image) {
    if (found.size() != 1)
        throw Failure(fmt::format("{}, it reports {} markers instead of 1", where, found.size()))
            .with("frame", image.picture());
    if (found[0].id != id)
        throw Failure(fmt::format("{}, it reports marker {} instead of {}", where, found[0].id, id))
            .with("frame", image.picture());
    return found[0];
}

void expect_pose(const arhost_marker &marker, const Pose &expected, const Bounds &bounds, const std::string &where,
                 const Grey &image) {
    const Pose actual = pose_of(marker);
    const glm::dvec3 at = actual[3], expected_at = expected[3];
    const double error = glm::distance(at, expected_at) / glm::length(expected_at);
    if (!(error <= bounds.share))
        throw Failure(fmt::format("{}, marker {} is at ({:.2f}, {:.2f}, {:.2f}) mm instead of ({:.2f}, {:.2f}, "
                                  "{:.2f}): an error of {:.2f} % of the distance; the limit is {} %",
                                  where, marker.id, at.x, at.y, at.z, expected_at.x, expected_at.y, expected_at.z,
                                  100 * error, 100 * bounds.share))
            .with("frame", image.picture());
    if (const double angle = angle_degrees(actual, expected); !(angle <= bounds.degrees))
        throw Failure(fmt::format("{}, the rotation of marker {} is off by {:.2f}°; the limit is {}°", where,
                                  marker.id, angle, bounds.degrees))
            .with("frame", image.picture());
}

void expect_none(const std::vector<arhost_marker> &found, const std::string &where, const Grey &image) {
    if (!found.empty())
        throw Failure(fmt::format("{}, it reports marker {}", where, found[0].id)).with("frame", image.picture());
}

void expect_found(Tracker &tracker, const Placed &marker, const Grey &image, const Bounds &bounds,
                  const std::string &where) {
    expect_pose(expect_one(tracker.track_first(image), marker.print.id, where, image), marker.camera_from_marker,
                bounds, where, image);
}

} // namespace arhost::conformance
