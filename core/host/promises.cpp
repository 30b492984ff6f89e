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

constexpr std::uint32_t share = 16; // of a frame's rows, or blocks of bytes, that are looked at

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
    const double s = side_mm / 2, corners[4][2] = {{-s, s}, {s, s}, {s, -s}, {-s, -s}}; // arhost/tracker.h
    const double(&m)[16] = marker.mt;
    double sum = 0;
    for (int i = 0; i < 4; ++i) {
        const auto [x, y] = corners[i];
        const glm::dvec3 eye_space(m[0] * x + m[4] * y + m[12], m[1] * x + m[5] * y + m[13],
                                   m[2] * x + m[6] * y + m[14]);
        const auto seen = camera::project(intrinsics, {eye_space.x, -eye_space.y, -eye_space.z}); // GL → OpenCV
        if (!seen)
            return std::nullopt;
        sum += std::pow(seen->x - marker.corners_px[i][0], 2) + std::pow(seen->y - marker.corners_px[i][1], 2);
    }
    return std::sqrt(sum / 4);
}

std::string problem_with_pose(const arhost_marker &marker, const arhost_intrinsics &intrinsics, double side_mm) {
    constexpr double far_off_px = 3;
    const auto off_px = reprojection_px(marker, intrinsics, side_mm);
    if (!off_px)
        return name_of(marker) + " is seen, and its pose is behind the camera";
    if (*off_px > far_off_px)
        return fmt::format("{}: its pose has the corners {:.1f} px from where they are told to be (of up to {:g} px)",
                           name_of(marker), *off_px, far_off_px);
    if (std::abs(*off_px - marker.reprojection_px) > 0.05 + 0.02 * *off_px)
        return fmt::format("{}: its reprojection is told as {:.3f} px and is {:.3f} px", name_of(marker),
                           marker.reprojection_px, *off_px);
    return {};
}

// A rectangle in the image that holds the box; none where a part of it is not in front of the camera.
struct Rectangle {
    glm::dvec2 min{1e30}, max{-1e30};
};
template <class Box> std::optional<Rectangle> rectangle_of(const Box &box, const arhost_camera &camera) {
    constexpr int steps = 8; // a lens bends edges
    Rectangle seen;
    for (int axis = 0; axis < 3; ++axis)
        for (int edge = 0; edge < 4; ++edge)
            for (int step = 0; step <= steps; ++step) {
                glm::dvec3 part;
                part[axis] = static_cast<double>(step) / steps;
                part[(axis + 1) % 3] = edge & 1;
                part[(axis + 2) % 3] = edge >> 1;
                const auto at =
                    camera::project(camera.intrinsics, camera::in_camera(camera, glm::mix(box.min, box.max, part)));
                if (!at)
                    return std::nullopt;
                seen.min = glm::min(seen.min, *at);
                seen.max = glm::max(seen.max, *at);
            }
    // A pixel's samples lie around its centre; between its samples an edge may bend out.
    const double margin = 1.5 + 0.01 * std::max(seen.max.x - seen.min.x, seen.max.y - seen.min.y);
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

void look_at_capture_time(Promises &promises, const arhost_record &record, std::int64_t now_ns) {
    if (record.clock != ARHOST_CLOCK_MONOTONIC)
        return;
    constexpr double longest_s = 10;
    const double age_s = 1e-9 * static_cast<double>(now_ns - record.capture_ns);
    promises.look("source.capture-time", record.sequence,
                  age_s < 0           ? fmt::format("was captured {:.3f} s after it came", -age_s)
                  : age_s > longest_s ? fmt::format("was captured {:.0f} s before it came", age_s)
                                      : std::string());
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
    constexpr std::size_t block = 4096;
    const std::string_view all(reinterpret_cast<const char *>(bytes.data()), bytes.size());
    std::size_t sum = 0;
    for (std::size_t at = frame % share * block; at < all.size(); at += share * block)
        sum = sum * 31 + std::hash<std::string_view>()(all.substr(at, block));
    return sum;
}

OverlayPromises::OverlayPromises(const arhost_scene &scene)
    : knows_place_(scene.duration_s == 0 && scene.shadow_alpha_opaque < 1 && scene.shadow_alpha_translucent < 1) {
    const auto at = [&]<class T>(const arhost_buffer &buffer, std::uint32_t i, const T *) {
        return reinterpret_cast<const T *>(reinterpret_cast<const std::byte *>(&scene) + buffer.offset +
                                           std::size_t(i) * buffer.stride);
    };
    for (std::uint32_t i = 0; i < scene.objects.count; ++i) {
        const arhost_object &object = *at(scene.objects, i, static_cast<const arhost_object *>(nullptr));
        if (object.role != ARHOST_VIRTUAL)
            continue;
        const auto &geometry = *at(scene.geometries, object.geometry, static_cast<const arhost_geometry *>(nullptr));
        const float(&m)[12] = object.world_from_object;
        for (std::uint32_t v = 0; v < geometry.positions.count; ++v) {
            const float *p = at(geometry.positions, v, static_cast<const float *>(nullptr));
            const float radius = geometry.type == ARHOST_SPHERES ? p[3] : 0;
            glm::dvec3 centre, reach;
            for (int k = 0; k < 3; ++k) {
                centre[k] = double(m[k]) * p[0] + double(m[3 + k]) * p[1] + double(m[6 + k]) * p[2] + m[9 + k];
                reach[k] = radius * std::hypot(m[k], m[3 + k], m[6 + k]); // a sphere may become an ellipsoid
            }
            if (!virtual_box_)
                virtual_box_ = Box{centre - reach, centre + reach};
            virtual_box_->min = glm::min(virtual_box_->min, centre - reach);
            virtual_box_->max = glm::max(virtual_box_->max, centre + reach);
        }
    }
}

void OverlayPromises::look(Promises &promises, std::uint64_t frame, const arhost_camera &camera, const Region &region,
                           const ImageView &overlay) const {
    const std::optional<Rectangle> rectangle =
        virtual_box_ && knows_place_ ? rectangle_of(*virtual_box_, camera) : Rectangle();
    const bool looks_at_place = knows_place_ && rectangle;
    std::string outside, elsewhere;
    for (std::uint32_t y = frame % share; y < camera.intrinsics.height; y += share) {
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
