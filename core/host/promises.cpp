// SPDX-License-Identifier: Apache-2.0
#include "host/promises.hpp"

#include "camera/lens.hpp"
#include "camera/mapping.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

namespace arhost::host {
namespace {

constexpr std::uint32_t share = 16; // of a frame's rows, or blocks of bytes, one is looked at

// Which: others with each frame, also where only every fourth one is looked at.
std::uint32_t first_of(std::uint64_t frame) {
    return static_cast<std::uint32_t>((frame + frame / share) % share);
}

double seconds(std::int64_t ns) {
    return 1e-9 * static_cast<double>(ns);
}

std::string name_of(const arhost_marker &marker) {
    return fmt::format("marker {}", marker.id);
}

std::string problem_with_order(std::span<const arhost_marker> markers, std::span<const arhost_marker_config> listed) {
    auto from = listed.begin();
    for (const arhost_marker &marker : markers) {
        from = std::find_if(from, listed.end(), [&](const auto &one) { return one.id == marker.id; });
        if (from == listed.end())
            return name_of(marker) + " is not in the order of the configuration's list";
    }
    return {};
}

std::string problem_with_numbers(const arhost_marker &marker) {
    if (!(marker.ambiguity >= 0 && marker.ambiguity <= 1))
        return fmt::format("{} has the ambiguity {:g}, which must be 0 to 1", name_of(marker), marker.ambiguity);
    if (!(marker.reprojection_px >= 0))
        return fmt::format("{} is off by {:g} px, which must not be negative", name_of(marker),
                           marker.reprojection_px);
    if (marker.state == ARHOST_MARKER_DETECTED && marker.age_frames != 0)
        return fmt::format("{} is seen, and {} frames old", name_of(marker), marker.age_frames);
    const bool none = std::all_of(std::begin(marker.mt_alternative), std::end(marker.mt_alternative),
                                  [](double number) { return number == 0; });
    if (const char *problem = none ? nullptr : camera::problem_with(marker.mt_alternative))
        return fmt::format("{}'s alternative: {}", name_of(marker), problem);
    return {};
}

// RMS over the corners, px; none where one is behind the camera.
std::optional<double> reprojection_px(const arhost_marker &marker, const arhost_intrinsics &intrinsics,
                                      double side_mm) {
    const double s = side_mm / 2;
    const glm::dvec2 corners[] = {{-s, s}, {s, s}, {s, -s}, {-s, -s}}; // arhost/tracker.h
    const double(&m)[16] = marker.mt;
    double sum = 0;
    for (int i = 0; i < 4; ++i) {
        const glm::dvec2 &p = corners[i];
        const glm::dvec3 eye_space(m[0] * p.x + m[4] * p.y + m[12], m[1] * p.x + m[5] * p.y + m[13],
                                   m[2] * p.x + m[6] * p.y + m[14]);
        const auto seen = camera::project(intrinsics, {eye_space.x, -eye_space.y, -eye_space.z}); // GL → OpenCV
        if (!seen)
            return std::nullopt;
        sum += std::pow(seen->x - marker.corners_px[i][0], 2) + std::pow(seen->y - marker.corners_px[i][1], 2);
    }
    return std::sqrt(sum / 4);
}

std::string problem_with_pose(const arhost_marker &marker, const arhost_intrinsics &intrinsics, double side_mm) {
    const auto off_px = reprojection_px(marker, intrinsics, side_mm);
    if (!off_px)
        return name_of(marker) + " is seen, and its pose is behind the camera";
    if (!(std::abs(*off_px - marker.reprojection_px) <= 0.05 + 0.02 * marker.reprojection_px)) // a NaN, too
        return fmt::format("{}: its reprojection is told as {:.3f} px and is {:.3f} px", name_of(marker),
                           marker.reprojection_px, *off_px);
    return {};
}

// A rectangle in a pinhole's image that holds the box; none where a part of it is not in front of the camera.
struct Rectangle {
    glm::dvec2 min{1e30}, max{-1e30};
};
std::optional<Rectangle> rectangle_of(const scene::Box &box, const arhost_camera &camera) {
    Rectangle seen;
    for (int corner = 0; corner < 8; ++corner) {
        const glm::vec3 part(corner & 1, corner >> 1 & 1, corner >> 2);
        const auto at =
            camera::project(camera.intrinsics, camera::in_camera(camera, glm::mix(box.min, box.max, part)));
        if (!at)
            return std::nullopt;
        seen.min = glm::min(seen.min, *at);
        seen.max = glm::max(seen.max, *at);
    }
    constexpr double margin = 1.5; // a pixel's samples lie around its centre
    return Rectangle{seen.min - margin, seen.max + margin};
}

} // namespace

void Promises::look(const std::string &name, std::uint64_t frame, const std::string &problem) {
    Promise &promise = all_[name];
    ++promise.looked;
    if (problem.empty() || promise.broken++ > 0)
        return;
    promise.first = fmt::format("frame {}: {}", frame, problem);
    if (on_first_)
        on_first_(name, promise.first);
}

void SourcePromises::look(Promises &promises, const arhost_record &record, std::uint32_t skipped,
                          std::int64_t now_ns) {
    const bool is_first = clock_ == 0;
    if (is_first)
        clock_ = record.clock;
    promises.look(
        "source.clock", record.sequence,
        record.clock == clock_ ? "" : fmt::format("has the clock {}, those before had {}", record.clock, clock_));

    // As numbers that can't overflow: a source may tell any.
    const double capture_s = seconds(record.capture_ns), age_s = seconds(now_ns) - capture_s;
    std::string problem;
    if (record.clock == ARHOST_CLOCK_MONOTONIC && age_s < 0)
        problem = fmt::format("was captured {:.3f} s after it came", -age_s);
    if (record.clock == ARHOST_CLOCK_MEDIA && capture_s < 0)
        problem = fmt::format("is of {:.3f} s, before the beginning", capture_s);
    promises.look("source.capture-time", record.sequence, problem);

    if (is_first)
        first_s_ = last_s_ = capture_s;
    if (rate_.fps > 0 && record.clock == clock_ && clock_ == ARHOST_CLOCK_MEDIA)
        promises.look("source.rate", record.sequence,
                      is_first ? "" : problem_with_rate(capture_s - first_s_, capture_s - last_s_, skipped, now_ns));
    last_s_ = capture_s;
}

std::string SourcePromises::problem_with_rate(double since_first_s, double since_last_s, std::uint32_t skipped,
                                              std::int64_t now_ns) const {
    // Of files' clocks; and what a source may begin with before its start returns.
    constexpr double tolerance_s = 0.001, head_start_s = 1;
    const double step_s = (1.0 + skipped) / rate_.fps;
    if (rate_.is_asked && std::abs(since_last_s - step_s) > tolerance_s)
        return fmt::format("comes {:.3f} s after the one before, which at {:g} frames a second, {} of them skipped, "
                           "is {:.3f} s",
                           since_last_s, rate_.fps, skipped, step_s);
    const double elapsed_s = seconds(now_ns) - seconds(began_ns_);
    if (rate_.is_paced && since_first_s > elapsed_s + head_start_s)
        return fmt::format("is {:.3f} s behind the first, and came {:.3f} s after the start", since_first_s,
                           elapsed_s);
    return {};
}

void look_at_markers(Promises &promises, const arhost_record &record, const arhost_intrinsics &intrinsics,
                     std::span<const arhost_marker_config> listed) {
    const std::span markers(record.markers, record.marker_count);
    promises.look("tracker.order", record.sequence, problem_with_order(markers, listed));
    std::string numbers, pose;
    for (const arhost_marker &marker : markers) {
        if (numbers.empty())
            numbers = problem_with_numbers(marker);
        const auto known =
            std::find_if(listed.begin(), listed.end(), [&](const auto &one) { return one.id == marker.id; });
        if (pose.empty() && marker.state == ARHOST_MARKER_DETECTED && known != listed.end())
            pose = problem_with_pose(marker, intrinsics, known->side_mm);
    }
    promises.look("tracker.numbers", record.sequence, numbers);
    promises.look("tracker.pose", record.sequence, pose);
}

std::size_t sample_of(std::span<const std::byte> bytes, std::uint64_t frame) {
    const std::size_t block = std::max<std::size_t>(bytes.size() / (16 * share), 1);
    const std::string_view all(reinterpret_cast<const char *>(bytes.data()), bytes.size());
    std::size_t sum = 0;
    for (std::size_t at = first_of(frame) * block; at < all.size(); at += share * block)
        sum = sum * 31 + std::hash<std::string_view>()(all.substr(at, block));
    return sum;
}

OverlayPromises::OverlayPromises(const arhost_scene &scene) {
    const auto is_opaque = [](float alpha) { return alpha * 255 >= 254.5f; };
    knows_place_ =
        scene.duration_s == 0 && !is_opaque(scene.shadow_alpha_opaque) && !is_opaque(scene.shadow_alpha_translucent);
    if (!knows_place_)
        return;
    const auto all = [&]<class T>(const arhost_buffer &buffer, const T *) {
        return std::span(reinterpret_cast<const T *>(reinterpret_cast<const std::byte *>(&scene) + buffer.offset),
                         buffer.count);
    };
    const auto geometries = all(scene.geometries, static_cast<const arhost_geometry *>(nullptr));
    std::map<std::uint32_t, scene::Box> of_geometries; // which may be many objects'
    for (const arhost_object &object : all(scene.objects, static_cast<const arhost_object *>(nullptr))) {
        const arhost_geometry &geometry = geometries[object.geometry];
        if (object.role != ARHOST_ROLE_VIRTUAL || geometry.positions.count == 0)
            continue;
        const auto [box, is_new] = of_geometries.try_emplace(object.geometry);
        if (is_new)
            box->second = geometry.type == ARHOST_GEOMETRY_SPHERES
                              ? scene::box_of(all(geometry.positions, static_cast<const glm::vec4 *>(nullptr)))
                              : scene::box_of(all(geometry.positions, static_cast<const glm::vec3 *>(nullptr)));
        if (!virtual_box_)
            virtual_box_.emplace();
        virtual_box_->include(scene::transformed(object.world_from_object, box->second));
    }
}

void OverlayPromises::look(Promises &promises, std::uint64_t frame, const arhost_camera &camera, const Region &region,
                           const ImageView &overlay) const {
    // A lens may bend what is far outside of the image into it (camera/lens.hpp).
    const bool is_pinhole = camera.intrinsics.distortion == ARHOST_DISTORTION_NONE;
    const std::optional<Rectangle> rectangle = virtual_box_ ? rectangle_of(*virtual_box_, camera) : Rectangle();
    const bool looks_at_place = knows_place_ && is_pinhole && rectangle;
    std::string outside, elsewhere;
    for (std::uint32_t y = first_of(frame); y < camera.intrinsics.height; y += share) {
        const std::uint8_t *alpha = overlay.rgba + y * overlay.stride + 3;
        for (std::uint32_t x = 0; x < camera.intrinsics.width; ++x, alpha += 4) {
            if (*alpha == 0)
                continue;
            const bool in_region = x - region.x < region.width && y - region.y < region.height; // unsigned
            if (outside.empty() && !in_region)
                outside = fmt::format("pixel ({}, {}): alpha is {} outside of the region, which is {} x {} px from "
                                      "({}, {})",
                                      x, y, *alpha, region.width, region.height, region.x, region.y);
            if (elsewhere.empty() && looks_at_place && *alpha == 255 && in_region &&
                (x < rectangle->min.x || x > rectangle->max.x || y < rectangle->min.y || y > rectangle->max.y))
                elsewhere = fmt::format("pixel ({}, {}): alpha is 255, but {}", x, y,
                                        virtual_box_ ? fmt::format("all virtual objects are between ({:.0f}, {:.0f}) "
                                                                   "and ({:.0f}, {:.0f})",
                                                                   rectangle->min.x, rectangle->min.y,
                                                                   rectangle->max.x, rectangle->max.y)
                                                     : std::string("there is no virtual object"));
        }
    }
    promises.look("raytracer.region", frame, outside);
    if (looks_at_place)
        promises.look("raytracer.place", frame, elsewhere);
}

} // namespace arhost::host
