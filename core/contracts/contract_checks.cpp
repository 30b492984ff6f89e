// SPDX-License-Identifier: Apache-2.0
#include "contracts/contract_checks.hpp"

#include "camera/lens_model.hpp"
#include "pixels/linear.hpp"
#include "scene/motion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>
#include <string_view>
#include <tuple>

namespace arhost::contracts {
namespace {

constexpr std::uint32_t sample_step = 16; // checks every 16th row or block of bytes of a frame

// Returns the index of the first row or block to check. It varies from frame to frame, even if only every fourth
// frame is checked.
std::uint32_t first_of(std::uint64_t frame) {
    return static_cast<std::uint32_t>((frame + frame / sample_step) % sample_step);
}

double seconds(std::int64_t ns) {
    return 1e-9 * static_cast<double>(ns);
}

std::string problem_with_corners(const arhost_observation &observation) {
    for (int i = 0; i < 4; ++i) {
        const auto corner = [&](int at) {
            return glm::dvec2(observation.corners_px[at % 4][0], observation.corners_px[at % 4][1]);
        };
        const glm::dvec2 a = corner(i + 1) - corner(i), b = corner(i + 2) - corner(i + 1);
        if (!(a.x * b.y - a.y * b.x > 0))
            return fmt::format("the corners of marker {} are not convex and clockwise in the image", observation.id);
    }
    return {};
}

std::string problem_with_repeats(std::span<const arhost_observation> observations) {
    const auto key = [](const arhost_observation &one) {
        return std::tuple(one.family, one.id, one.corners_px[0][0], one.corners_px[0][1], one.corners_px[2][0],
                          one.corners_px[2][1]);
    };
    std::set<decltype(key(observations.front()))> seen;
    for (const arhost_observation &observation : observations)
        if (!seen.insert(key(observation)).second)
            return fmt::format("marker {} is reported twice at the same place", observation.id);
    return {};
}

std::string problem_with_covariance(const arhost_target &target) {
    const double(&c)[36] = target.covariance;
    if (target.state == ARHOST_TARGET_LOST || std::ranges::all_of(c, [](double number) { return number == 0; }))
        return {};
    for (int row = 0; row < 6; ++row) {
        if (!(c[7 * row] >= 0))
            return fmt::format("{} has a variance of {:g}", target.name, c[7 * row]);
        for (int column = 0; column < row; ++column)
            if (std::abs(c[6 * row + column] - c[6 * column + row]) > 1e-6 * std::sqrt(c[7 * row] * c[7 * column]))
                return fmt::format("{} has a covariance that is not symmetric", target.name);
    }
    return {};
}

struct Rectangle {
    glm::dvec2 min{1e30}, max{-1e30};
};
// Returns the bounds of the box in the camera's image without lens distortion; nullopt if a corner is not in front of
// the camera.
std::optional<Rectangle> rectangle_of(const scene::Box &box, const arhost_camera &camera) {
    Rectangle bounds;
    arhost_intrinsics pinhole = camera.intrinsics;
    pinhole.distortion = ARHOST_DISTORTION_NONE;
    for (int corner = 0; corner < 8; ++corner) {
        const glm::vec3 part(corner & 1, corner >> 1 & 1, corner >> 2);
        const auto at = camera::project(pinhole, camera::in_camera(camera, glm::mix(box.min, box.max, part)));
        if (!at)
            return std::nullopt;
        bounds.min = glm::min(bounds.min, *at);
        bounds.max = glm::max(bounds.max, *at);
    }
    constexpr double margin = 1.5; // px; the ray tracer's samples are spread around the pixel's centre
    return Rectangle{bounds.min - margin, bounds.max + margin};
}

// How much of the video a virtual object in the pixel hides. In a linear image, a fully shadowed catcher has a
// transmittance of 0, too, but adds no light.
enum class Coverage { none, partial, full };
Coverage coverage_of(const std::uint8_t *bytes, const OverlayFormat &format) {
    if (!format.is_linear())
        return bytes[3] == 0 ? Coverage::none : bytes[3] == 255 ? Coverage::full : Coverage::partial;
    LinearPixel pixel;
    std::memcpy(&pixel, bytes, sizeof pixel);
    if (pixel == untouched)
        return Coverage::none;
    const auto is_zero = [](std::uint16_t half) { return half == 0; };
    return std::ranges::all_of(pixel.transmittance, is_zero) && !std::ranges::all_of(pixel.added, is_zero)
               ? Coverage::full
               : Coverage::partial;
}

std::string problem_with_light(const std::uint8_t *bytes, std::uint32_t x, std::uint32_t y) {
    std::uint16_t halves[8];
    std::memcpy(halves, bytes, sizeof halves);
    for (int i = 0; i < 8; ++i) {
        if (halves[i] >= 0x7c00) // infinite, NaN, or the sign is set
            return fmt::format("pixel ({}, {}): value {} is {}; it must be finite and not negative", x, y, i,
                               float_of(halves[i]));
        if (i % 4 == 3 && halves[i] != 0)
            return fmt::format("pixel ({}, {}): value {} is {}, but reserved; it must be 0", x, y, i,
                               float_of(halves[i]));
    }
    return {};
}

} // namespace

void ContractChecks::add(const std::string &name, std::uint64_t frame, const std::string &problem) {
    ContractCheck &check = all_[name];
    ++check.checked;
    if (problem.empty() || check.violations++ > 0)
        return;
    check.first_violation = fmt::format("frame {}: {}", frame, problem);
    if (on_first_)
        on_first_(name, check.first_violation);
}

void SourceChecks::check(ContractChecks &checks, const arhost_record &record, std::uint32_t skipped,
                         std::int64_t now_ns) {
    const bool is_first = clock_ == 0;
    if (is_first)
        clock_ = record.clock;
    checks.add("source.clock", record.sequence,
               record.clock == clock_ ? ""
                                      : fmt::format("has the clock {}, earlier frames had {}", record.clock, clock_));

    // A source may report any number as the time; the floating-point difference cannot overflow.
    const double capture_s = seconds(record.capture_ns), age_s = seconds(now_ns) - capture_s;
    std::string problem;
    if (record.clock == ARHOST_CLOCK_MONOTONIC && age_s < 0)
        problem = fmt::format("has a capture time {:.3f} s after its arrival at the host", -age_s);
    if (record.clock == ARHOST_CLOCK_MEDIA && capture_s < 0)
        problem = fmt::format("has the media time {:.3f} s, which must not be negative", capture_s);
    checks.add("source.capture-time", record.sequence, problem);

    if (is_first)
        first_s_ = last_s_ = capture_s;
    if (rate_.fps > 0 && record.clock == clock_ && clock_ == ARHOST_CLOCK_MEDIA)
        checks.add("source.rate", record.sequence,
                   is_first ? "" : problem_with_rate(capture_s - first_s_, capture_s - last_s_, skipped, now_ns));
    last_s_ = capture_s;
}

std::string SourceChecks::problem_with_rate(double since_first_s, double since_last_s, std::uint32_t skipped,
                                            std::int64_t now_ns) const {
    // tolerance_s: resolution of media clocks. head_start_s: the media time may be ahead by this, because a source
    // may produce frames before the host records the start.
    constexpr double tolerance_s = 0.001, head_start_s = 1;
    const double step_s = (1.0 + skipped) / rate_.fps;
    if (rate_.is_configured && std::abs(since_last_s - step_s) > tolerance_s)
        return fmt::format(
            "has a media time {:.3f} s after the previous frame, but {:g} fps and {} skipped frames require {:.3f} s",
            since_last_s, rate_.fps, skipped, step_s);
    const double elapsed_s = seconds(now_ns) - seconds(started_ns_);
    if (rate_.is_paced && since_first_s > elapsed_s + head_start_s)
        return fmt::format(
            "has a media time {:.3f} s after the first frame, but arrived only {:.3f} s after the start",
            since_first_s, elapsed_s);
    return {};
}

void check_tracking(ContractChecks &checks, std::uint64_t frame, std::span<const arhost_target> targets,
                    std::span<const arhost_observation> observations) {
    const auto first_problem = [](auto all, auto problem_with) {
        std::string problem;
        for (const auto &one : all)
            if (problem.empty())
                problem = problem_with(one);
        return problem;
    };
    checks.add("tracker.corners", frame, first_problem(observations, problem_with_corners));
    checks.add("tracker.repeats", frame, problem_with_repeats(observations));
    checks.add("tracker.covariance", frame, first_problem(targets, problem_with_covariance));
}

std::size_t sample_hash(std::span<const std::byte> bytes, std::uint64_t frame) {
    const std::size_t block = std::max<std::size_t>(bytes.size() / (16 * sample_step), 1);
    const std::string_view all(reinterpret_cast<const char *>(bytes.data()), bytes.size());
    std::size_t hash = 0;
    for (std::size_t at = first_of(frame) * block; at < all.size(); at += sample_step * block)
        hash = hash * 31 + std::hash<std::string_view>()(all.substr(at, block));
    return hash;
}

OverlayChecks::OverlayChecks(const arhost_scene &scene) {
    const auto is_opaque = [](float alpha) { return alpha * 255 >= 254.5f; };
    checks_place_ = !scene::is_moving(scene);
    has_translucent_shadows_ = scene.integrator == ARHOST_INTEGRATOR_WHITTED &&
                               !is_opaque(scene.shadow_alpha_opaque) && !is_opaque(scene.shadow_alpha_translucent);
    if (!checks_place_)
        return;
    const auto array = [&]<class T>(const arhost_buffer &buffer, const T *) {
        return std::span(reinterpret_cast<const T *>(reinterpret_cast<const std::byte *>(&scene) + buffer.offset),
                         buffer.count);
    };
    const auto geometries = array(scene.geometries, static_cast<const arhost_geometry *>(nullptr));
    std::map<std::uint32_t, scene::Box> boxes; // bounding box of each geometry; several objects may share a geometry
    for (const arhost_object &object : array(scene.objects, static_cast<const arhost_object *>(nullptr))) {
        const arhost_geometry &geometry = geometries[object.geometry];
        if (object.role != ARHOST_ROLE_VIRTUAL || geometry.positions.count == 0)
            continue;
        const auto [box, is_new] = boxes.try_emplace(object.geometry);
        if (is_new)
            box->second = geometry.type == ARHOST_GEOMETRY_SPHERES
                              ? scene::box_of(array(geometry.positions, static_cast<const glm::vec4 *>(nullptr)))
                              : scene::box_of(array(geometry.positions, static_cast<const glm::vec3 *>(nullptr)));
        if (!virtual_box_)
            virtual_box_.emplace();
        virtual_box_->include(scene::transformed(object.world_from_object, box->second));
    }
}

void OverlayChecks::check(ContractChecks &checks, std::uint64_t frame, const arhost_camera &camera,
                          const Region &region, const ImageView &overlay) {
    const std::optional<Rectangle> rectangle = virtual_box_ ? rectangle_of(*virtual_box_, camera) : Rectangle();
    const bool can_check_place =
        (overlay.format.is_linear() || has_translucent_shadows_) && checks_place_ && rectangle;
    const bool is_pinhole = camera.intrinsics.distortion == ARHOST_DISTORTION_NONE;
    if (!is_pinhole && can_check_place && !lens_)
        lens_.emplace(camera.intrinsics);
    // Returns the position of a pixel in the image without lens distortion; nullopt if no direction maps to it.
    const auto undistorted = [&](std::uint32_t x, std::uint32_t y) -> std::optional<glm::dvec2> {
        if (is_pinhole)
            return glm::dvec2(x, y);
        const auto ray = lens_->ray({static_cast<double>(x), static_cast<double>(y)});
        if (!ray || ray->z <= 0)
            return std::nullopt;
        return glm::dvec2(camera.intrinsics.fx * ray->x / ray->z + camera.intrinsics.cx,
                          camera.intrinsics.fy * ray->y / ray->z + camera.intrinsics.cy);
    };
    const auto check_place = [&](std::uint32_t x, std::uint32_t y) -> std::string {
        const std::optional<glm::dvec2> at = undistorted(x, y);
        if (!at || (at->x >= rectangle->min.x && at->x <= rectangle->max.x && at->y >= rectangle->min.y &&
                    at->y <= rectangle->max.y))
            return {};
        return fmt::format("pixel ({}, {}): {}, but {}", x, y,
                           overlay.format.is_linear() ? "adds light and hides the video" : "alpha is 255",
                           virtual_box_ ? fmt::format("all virtual objects are between ({:.0f}, {:.0f}) and ({:.0f}, "
                                                      "{:.0f}){}",
                                                      rectangle->min.x, rectangle->min.y, rectangle->max.x,
                                                      rectangle->max.y, is_pinhole ? "" : " before lens distortion")
                                        : std::string("there is no virtual object"));
    };
    std::string outside_region, misplaced, not_a_light;
    for (std::uint32_t y = first_of(frame); y < camera.intrinsics.height; y += sample_step) {
        std::optional<std::uint32_t> first, last; // opaque pixels of this row that are inside the region
        for (std::uint32_t x = 0; x < camera.intrinsics.width; ++x) {
            const Coverage coverage = coverage_of(overlay.at(x, y), overlay.format);
            if (coverage == Coverage::none)
                continue;
            if (overlay.format.is_linear() && not_a_light.empty())
                not_a_light = problem_with_light(overlay.at(x, y), x, y);
            // Left of or above the region, the subtraction wraps to a large number.
            const bool in_region = x - region.x < region.width && y - region.y < region.height;
            if (outside_region.empty() && !in_region)
                outside_region = fmt::format(
                    "pixel ({}, {}) is outside the reported region, but {}; the region is {} x {} px at ({}, {})", x,
                    y,
                    overlay.format.is_linear() ? "changes the video"
                                               : fmt::format("has alpha {}", overlay.at(x, y)[3]),
                    region.width, region.height, region.x, region.y);
            if (coverage == Coverage::full && in_region) {
                if (!first)
                    first = x;
                last = x;
            }
        }
        // Opaque pixels between the first and the last cannot be further left or right. With lens distortion, they
        // may be further up or down. This is not checked, because undistorting a pixel takes a microsecond.
        if (can_check_place && first && misplaced.empty())
            misplaced = check_place(*first, y);
        if (can_check_place && last && misplaced.empty())
            misplaced = check_place(*last, y);
    }
    checks.add("raytracer.region", frame, outside_region);
    if (can_check_place)
        checks.add("raytracer.place", frame, misplaced);
    if (overlay.format.is_linear())
        checks.add("raytracer.light", frame, not_a_light);
}

} // namespace arhost::contracts
