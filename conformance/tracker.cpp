// SPDX-License-Identifier: Apache-2.0
#include "conformance/tracker.hpp"

#include "pose/estimate.hpp"
#include "worker/library.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <cstring>

namespace arhost::conformance {

using ipc::Call;

namespace {

// Returns a marker's corners, in mm, in the coordinates of a target.
std::array<glm::dvec3, 4> corners_in(const Placed &marker, const Pose &camera_from_target) {
    const Pose target_from_marker = glm::inverse(camera_from_target) * marker.camera_from_marker;
    const double h = marker.side_mm / 2;
    const auto corner = [&](double x, double y) { return glm::dvec3(target_from_marker * glm::dvec4(x, y, 0, 1)); };
    return {corner(-h, h), corner(h, h), corner(h, -h), corner(-h, -h)};
}

} // namespace

arhost_frame_format format_of(std::uint32_t width, std::uint32_t height, arhost_pixel_format pixel_format) {
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = pixel_format;
    format.width = width;
    format.height = height;
    format.yuv_matrix = ARHOST_YUV_MATRIX_BT709;
    format.yuv_range = ARHOST_YUV_RANGE_FULL;
    format.fps = 30;
    format.transfer = ARHOST_TRANSFER_LINEAR; // the pictures average the codes of their samples
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

TrackerSetup::TrackerSetup(const Context &context, const arhost_intrinsics &camera, std::vector<std::string> families,
                           arhost_pixel_format format, std::size_t extra)
    : context_(context), camera_(camera), format_(format_of(camera.width, camera.height, format)),
      families_(std::move(families)), targets_(extra), markers_(extra) {
    for (const std::string &family : families_)
        family_names_.push_back(family.c_str());
}

std::uint32_t TrackerSetup::add_target(const std::string &name, const char *body) {
    targets_.add({0, 0, names_.emplace_back(name).c_str(), body});
    return targets_.count() - 1;
}

void TrackerSetup::add(const Listed &marker) {
    const double h = marker.side_mm / 2;
    add_marker(marker.id, marker.family, add_target(fmt::format("{}-{}", families_[marker.family], marker.id)),
               {{{-h, h, 0}, {h, h, 0}, {h, -h, 0}, {-h, -h, 0}}});
}

void TrackerSetup::add_marker(int id, std::uint32_t family, std::uint32_t target,
                              const std::array<glm::dvec3, 4> &corners) {
    arhost_marker_config config{0, id, family, target, {}, nullptr, 0};
    for (std::size_t i = 0; i < corners.size(); ++i)
        std::copy_n(&corners[i].x, 3, config.corners_mm[i]);
    if (const std::string &name = families_[family]; has_files(name)) {
        const PrintFiles &files = name == context_.family ? context_.prints : PrintFiles();
        config.file = names_.emplace_back(print_file(context_.library.scratch(), name, id, files)).c_str();
        config.pattern_ratio = pattern_ratio_of(name);
    }
    markers_.add(config);
}

void TrackerSetup::add_map(std::span<const Placed> markers, const Pose &camera_from_map) {
    const std::uint32_t target = add_target("map");
    for (const Placed &marker : markers)
        add_marker(marker.print.id, 0, target, corners_in(marker, camera_from_map));
}

void TrackerSetup::add_body(const std::string &body) {
    add_target("body", names_.emplace_back(body).c_str());
}

arhost_tracker_setup TrackerSetup::setup() const {
    return {sizeof(arhost_tracker_setup),
            targets_.count(),
            &format_,
            &camera_,
            targets_.first(),
            markers_.count() ? markers_.first() : nullptr,
            markers_.count(),
            static_cast<std::uint32_t>(family_names_.size()),
            family_names_.empty() ? nullptr : family_names_.data()};
}

Tracker::Tracker(Context &context, Settings overrides)
    : context_(context), library_(context.library), overrides_(std::move(overrides)),
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
    TrackerSetup setup(context_, camera, {context_.family}, pixel_format);
    for (const Listed &marker : listed)
        setup.add(marker);
    return start_with(setup);
}

arhost_status Tracker::start_with(const TrackerSetup &arrays, std::size_t extra) {
    stop();
    if (!std::exchange(fresh_, false))
        create();
    const arhost_tracker_setup setup = arrays.setup();
    const arhost_status status =
        in_call(library_.calls(), Call::start, [&] { return functions_.start(instance_->get(), &setup); });
    started_ = status == ARHOST_STATUS_OK;
    sequence_ = 0;
    state_before_.reset();
    state_size_ = started_ ? in_call(library_.calls(), Call::start,
                                     [&] { return worker::state_size_of(functions_, instance_->get()); })
                           : 0;
    extra_ = extra;
    target_count_ = setup.target_count;
    observation_memory_ = std::make_unique<GuardedMemory>(std::size_t{observation_size()} * ARHOST_MAX_OBSERVATIONS);
    pose_memory_ = std::make_unique<GuardedMemory>(std::size_t{pose_size()} * target_count_);
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

// Fills the elements, so that numbers that the tracker does not write are NaN or out of range.
arhost_tracker_result Tracker::prepare_result() {
    const auto prepare = [](const GuardedMemory &memory, std::uint32_t stride, std::uint32_t count) {
        std::fill_n(memory.data(), std::size_t{stride} * count, std::byte{0xff});
        for (std::uint32_t i = 0; i < count; ++i)
            std::memcpy(memory.data() + std::size_t{stride} * i, &stride, sizeof stride); // struct_size
        return memory.data();
    };
    arhost_tracker_result result{};
    result.struct_size = sizeof result;
    result.observations = reinterpret_cast<arhost_observation *>(
        prepare(*observation_memory_, observation_size(), ARHOST_MAX_OBSERVATIONS));
    result.poses = reinterpret_cast<arhost_body_pose *>(prepare(*pose_memory_, pose_size(), target_count_));
    result.candidate_count = -1;
    return result;
}

arhost_status Tracker::try_track(const SealedFrame &frame, std::uint64_t sequence, std::int64_t capture_ns) {
    auto *result = new (result_memory_.data()) arhost_tracker_result(prepare_result());
    const arhost_frame input = frame.frame(sequence, capture_ns);
    arhost_track_request request{};
    request.struct_size = sizeof request;
    request.search_everywhere = expected_memory_ == nullptr;
    if (expected_memory_) {
        request.expected = reinterpret_cast<const arhost_expected_marker *>(expected_memory_->data());
        request.expected_count = expected_count_;
    }
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

void Tracker::expect(const std::vector<Expected> &markers) {
    Elements<arhost_expected_marker> elements(extra_);
    for (const Expected &marker : markers) {
        arhost_expected_marker one{};
        one.marker = marker.marker;
        for (std::size_t i = 0; i < 4; ++i)
            for (int axis = 0; axis < 2; ++axis)
                one.corners_px[i][axis] = marker.corners_px[i][axis];
        one.margin_px = marker.margin_px;
        elements.add(one);
    }
    expected_count_ = elements.count();
    const std::size_t size = expected_count_ * (sizeof(arhost_expected_marker) + extra_);
    expected_memory_ = std::make_unique<GuardedMemory>(size);
    std::memcpy(expected_memory_->data(), elements.first(), size);
    expected_memory_->seal();
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

namespace {

template <class T>
std::vector<T> elements_of(const GuardedMemory &memory, std::uint32_t stride, std::uint32_t count,
                           std::uint32_t limit, const char *what) {
    if (count > limit)
        throw Failure(fmt::format("it reports {} {}; the limit is {}", count, what, limit));
    std::vector<T> all(count);
    for (std::uint32_t i = 0; i < count; ++i)
        std::memcpy(&all[i], memory.data() + std::size_t{stride} * i, sizeof(T));
    return all;
}

} // namespace

std::vector<arhost_observation> Tracker::observations() const {
    const auto &result = *reinterpret_cast<const arhost_tracker_result *>(result_memory_.data());
    if (result.candidate_count != -1 &&
        (result.candidate_count < 0 || static_cast<std::uint32_t>(result.candidate_count) < result.observation_count))
        throw Failure("candidate_count is " + std::to_string(result.candidate_count) + ", but it reports " +
                      std::to_string(result.observation_count) +
                      " observations; set it to at least as many, or leave it at -1");
    return elements_of<arhost_observation>(*observation_memory_, observation_size(), result.observation_count,
                                           ARHOST_MAX_OBSERVATIONS, "observations");
}

std::vector<arhost_body_pose> Tracker::poses() const {
    const auto &result = *reinterpret_cast<const arhost_tracker_result *>(result_memory_.data());
    if (result.pose_count > 0 && !(library_.descriptor().capabilities & ARHOST_TRACKER_CAPABILITY_REPORTS_POSES))
        throw Failure("it reports poses, but does not declare ARHOST_TRACKER_CAPABILITY_REPORTS_POSES");
    return elements_of<arhost_body_pose>(*pose_memory_, pose_size(), result.pose_count, target_count_, "poses");
}

std::vector<arhost_observation> Tracker::track(const SealedFrame &frame) {
    instance_->expect_ok("track", try_track(frame, sequence_, static_cast<std::int64_t>(sequence_) * frame_ns));
    ++sequence_;
    (void)poses(); // checks their number
    return observations();
}

std::vector<arhost_observation> Tracker::track_first(const SealedFrame &frame) {
    if (sequence_ > 0)
        start(camera_, listed_, format_);
    return track(frame);
}

arhost_intrinsics camera_for(const Context &context, std::uint32_t width, std::uint32_t height, double focal) {
    const std::uint32_t scale = context.family == picture_family ? 4 : 1;
    return pinhole(scale * width, scale * height, scale * focal);
}

Grey empty_image(const arhost_intrinsics &camera) {
    return filled(camera.width, camera.height, [](auto, auto) { return background_code; });
}

std::vector<Print> prints_of(const Context &context) {
    if (context.family.empty())
        throw Skip(
            fmt::format("it knows none of the families {}: give --family NAME", fmt::join(drawn_families, ", ")));
    return prints_of(context.prints, context.family);
}

// ---- Expectations ----------------------------------------------------------------------------------

namespace {

// The seen marker's name in a message.
std::string text_of(const arhost_observation &seen) {
    return fmt::format("marker {} at ({:.1f}, {:.1f}) px", seen.id, seen.corners_px[0][0], seen.corners_px[0][1]);
}

Failure with_frame(const std::string &message, const Grey &image) {
    return Failure(message).with("frame", image.picture());
}

double angle_degrees(const Pose &a, const Pose &b) {
    const glm::dmat3 between = glm::transpose(glm::dmat3(a)) * glm::dmat3(b);
    return glm::degrees(std::acos(std::clamp((between[0][0] + between[1][1] + between[2][2] - 1) / 2, -1.0, 1.0)));
}

double mean_distance(const Corners &a, const Corners &b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i)
        sum += glm::distance(a[i], b[i]);
    return sum / static_cast<double>(a.size());
}

} // namespace

Corners corners_of(const arhost_observation &observation) {
    Corners corners;
    for (std::size_t i = 0; i < corners.size(); ++i)
        corners[i] = {observation.corners_px[i][0], observation.corners_px[i][1]};
    return corners;
}

Pose solve(const arhost_intrinsics &camera, std::span<const Observed> markers, const Pose &camera_from_target,
           const std::string &where, const Grey &image) {
    constexpr double corner_sigma_px = 0.2; // weights all corners equally
    std::vector<pose::ObservedMarker> seen;
    for (const auto &[observation, marker] : markers) {
        pose::ObservedMarker &one = seen.emplace_back();
        one.corner_sigma_px = corner_sigma_px;
        const auto on_target = corners_in(marker, camera_from_target);
        for (std::size_t i = 0; i < on_target.size(); ++i) {
            one.corners_on_target_mm[i] = {on_target[i].x, on_target[i].y, on_target[i].z};
            one.corners_px[i] = {observation.corners_px[i][0], observation.corners_px[i][1]};
        }
    }
    const auto estimates = pose::estimate_poses(seen, pose::Projection(camera));
    if (estimates.empty())
        throw with_frame(fmt::format("{}, no pose shows the front of {} at its corners", where,
                                     text_of(markers.front().observation)),
                         image);
    return glm::make_mat4(pose::matrix_of(estimates.front().camera_from_target).data());
}

arhost_observation expect_one(const std::vector<arhost_observation> &found, int id, const std::string &where,
                              const Grey &image) {
    if (found.size() != 1)
        throw with_frame(fmt::format("{}, it reports {} markers instead of 1", where, found.size()), image);
    if (found[0].id != id)
        throw with_frame(fmt::format("{}, it reports marker {} instead of {}", where, found[0].id, id), image);
    return found[0];
}

void expect_pose(const Pose &actual, const Pose &expected, const Bounds &bounds, const std::string &what,
                 const Grey &image) {
    const glm::dvec3 at = actual[3], expected_at = expected[3];
    const double error = glm::distance(at, expected_at) / glm::length(expected_at);
    if (!(error <= bounds.share))
        throw with_frame(
            fmt::format("{} at ({:.2f}, {:.2f}, {:.2f}) mm instead of ({:.2f}, {:.2f}, {:.2f}): an error of {:.2f} % "
                        "of the distance; the limit is {} %",
                        what, at.x, at.y, at.z, expected_at.x, expected_at.y, expected_at.z, 100 * error,
                        100 * bounds.share),
            image);
    if (const double angle = angle_degrees(actual, expected); !(angle <= bounds.degrees))
        throw with_frame(
            fmt::format("{} with a rotation that is off by {:.2f}°; the limit is {}°", what, angle, bounds.degrees),
            image);
}

void expect_corners(const arhost_observation &observation, const arhost_intrinsics &camera, const Placed &marker,
                    const Bounds &bounds, const std::string &where, const Grey &image) {
    const Observed observed{observation, marker};
    expect_pose(solve(camera, {&observed, 1}, marker.camera_from_marker, where, image), marker.camera_from_marker,
                bounds, fmt::format("{}, the corners put {}", where, text_of(observation)), image);
}

void expect_none(const std::vector<arhost_observation> &found, const std::string &where, const Grey &image) {
    if (!found.empty())
        throw with_frame(fmt::format("{}, it reports {}", where, text_of(found[0])), image);
}

void expect_found(Tracker &tracker, const arhost_intrinsics &camera, const Placed &marker, const Grey &image,
                  const Bounds &bounds, const std::string &where) {
    expect_corners(expect_one(tracker.track_first(image), marker.print.id, where, image), camera, marker, bounds,
                   where, image);
}

void expect_all(const std::vector<arhost_observation> &found, const arhost_intrinsics &camera,
                std::span<const InFamily> markers, const std::string &where, const Grey &image) {
    if (found.size() != markers.size())
        throw with_frame(fmt::format("{}, of {} markers in view, it reports {}", where, markers.size(), found.size()),
                         image);
    std::vector<arhost_observation> left = found;
    for (const auto &[marker, family] : markers) {
        const Corners expected = corners_of(camera, marker);
        const auto nearest = std::ranges::min_element(
            left, {}, [&](const arhost_observation &seen) { return mean_distance(corners_of(seen), expected); });
        if (nearest->id != marker.print.id || nearest->family != family)
            throw with_frame(fmt::format("{}, it reports {} of family {} in place of marker {} of family {}", where,
                                         text_of(*nearest), nearest->family, marker.print.id, family),
                             image);
        expect_corners(*nearest, camera, marker, roughly, where, image);
        left.erase(nearest);
    }
}

std::string difference(std::span<const arhost_observation> actual, std::span<const arhost_observation> expected) {
    if (actual.size() != expected.size())
        return fmt::format("gives {} observations; expected {}", actual.size(), expected.size());
    for (std::size_t i = 0; i < actual.size(); ++i)
        if (!std::ranges::equal(std::as_bytes(actual.subspan(i, 1)), std::as_bytes(expected.subspan(i, 1))))
            return fmt::format("gives other bytes for {}: the first corner differs by {:.3g} px",
                               text_of(expected[i]),
                               glm::distance(corners_of(actual[i])[0], corners_of(expected[i])[0]));
    return "";
}

} // namespace arhost::conformance
