// SPDX-License-Identifier: Apache-2.0
// Corners: order and accuracy on frames rendered at known poses. Where the requirement is about poses, the suite
// computes them from the corners.
#include "conformance/tracker.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>

namespace arhost::conformance {
namespace {

constexpr double side_mm = 80;

// Tracks the first print, seen by one camera at many poses.
class Studio {
public:
    explicit Studio(Context &context) : Studio(context, wide_camera(context)) {}
    Studio(Context &context, const arhost_intrinsics &camera)
        : camera_(camera), print_(prints_of(context).front()), tracker_(context) {
        tracker_.start(camera, {{print_.id, side_mm}});
    }

    struct Shot {
        Grey image;
        Corners found, expected;
    };
    Shot shoot(const Pose &at, const std::string &where) {
        const Placed marker{print_, side_mm, at};
        const Grey image = draw(camera_, marker);
        return {image, corners_of(expect_one(tracker_.track_first(image), print_.id, where, image)),
                corners_of(camera_, marker)};
    }
    void expect_found(const Pose &at, const Bounds &bounds, const std::string &where) {
        const Placed marker{print_, side_mm, at};
        conformance::expect_found(tracker_, camera_, marker, draw(camera_, marker), bounds, where);
    }

private:
    arhost_intrinsics camera_;
    Print print_;
    Tracker tracker_;
};

std::string text_of(const glm::dvec2 &v) {
    return fmt::format("({:.2f}, {:.2f})", v.x, v.y);
}

// Returns how the corners are ordered, as the end of a sentence; empty if the order is that of arhost/tracker.h.
std::string problem_with_order(const Corners &found, const Corners &expected) {
    const auto error = [&](std::size_t first, bool is_clockwise) {
        double sum = 0;
        for (std::size_t i = 0; i < found.size(); ++i)
            sum += glm::distance(found[i], expected[(first + (is_clockwise ? i : found.size() - i)) % found.size()]);
        return sum;
    };
    std::size_t best = 0;
    bool is_clockwise = true;
    for (const bool clockwise : {true, false})
        for (std::size_t first = 0; first < found.size(); ++first)
            if (error(first, clockwise) < error(best, is_clockwise))
                best = first, is_clockwise = clockwise;
    if (best == 0 && is_clockwise)
        return "";
    return fmt::format("the corners begin at the {} corner of the upright print and run {}; expected top left, {}",
                       corner_names[best], is_clockwise ? "clockwise" : "counter-clockwise",
                       "top right, bottom right, bottom left");
}

void corner_order(Context &context) {
    Studio studio(context);
    for (const double turn : {0.0, 90.0, 180.0, 270.0}) {
        const std::string where = fmt::format("with a print rotated by {}°", turn);
        const Studio::Shot shot = studio.shoot(tilted({15, 20, -260}, 20, 30, turn), where);
        if (const std::string problem = problem_with_order(shot.found, shot.expected); !problem.empty())
            throw Failure(fmt::format("{}, {}", where, problem)).with("frame", shot.image.picture());
    }
}

// Expects each corner within `bound_px`. Returns the mean error.
glm::dvec2 expect_accurate(const Studio::Shot &shot, double bound_px, const std::string &where) {
    glm::dvec2 mean(0);
    for (std::size_t k = 0; k < shot.found.size(); ++k)
        mean += (shot.found[k] - shot.expected[k]) / static_cast<double>(shot.found.size());
    for (std::size_t k = 0; k < shot.found.size(); ++k)
        if (const glm::dvec2 at = shot.expected[k]; !(glm::distance(shot.found[k], at) <= bound_px)) {
            std::string text = fmt::format("{}, the {} corner is reported at {} px instead of {}; the limit is {} px",
                                           where, corner_names[k], text_of(shot.found[k]), text_of(at), bound_px);
            if (glm::distance(mean, glm::dvec2(0.5)) < 0.15 || glm::distance(mean, glm::dvec2(-0.5)) < 0.15)
                text += fmt::format(". The mean error of the four corners is {}: pixel centres are at integers",
                                    text_of(mean));
            throw Failure(text)
                .with("frame", shot.image.picture())
                .at(static_cast<unsigned>(std::lround(at.x)), static_cast<unsigned>(std::lround(at.y)));
        }
    return mean;
}

void corners(Context &context) {
    constexpr double bound_px = 0.3, bound_mean_px = 0.06;
    Studio studio(context);
    glm::dvec2 sum(0);
    constexpr int count = 8;
    for (int i = 0; i < count; ++i)
        sum += expect_accurate(
            studio.shoot(tilted({5 * (i % 5) - 10, 4 * (i % 3) - 4, -220 - 15 * i}, 15 + 3 * i, 67 * i, 40 * i),
                         "in view"),
            bound_px, "in view");
    const glm::dvec2 mean = sum / static_cast<double>(count);
    if (!(glm::length(mean) <= bound_mean_px))
        throw Failure(fmt::format(
            "the mean error of {} corners is ({:.3f}, {:.3f}) px; the limit is {} px (pixel centres are at integers)",
            4 * count, mean.x, mean.y, bound_mean_px));
}

void tilt_and_distance(Context &context) {
    Studio studio(context);
    for (const double distance : {170.0, 300.0, 430.0})
        for (const double tilt : {20.0, 40.0, 60.0})
            for (const double towards : {10.0, 190.0})
                studio.expect_found(tilted({towards / 10 - 13, 12 - tilt / 4, -distance}, tilt, towards, towards / 2),
                                    {1.5, 0.01}, fmt::format("{} mm away, tilted by {}°", distance, tilt));
}

void near_frontal(Context &context) {
    Studio studio(context);
    for (const double towards : {0.0, 90.0, 180.0, 270.0})
        studio.expect_found(tilted({0, 0, -240}, 8, towards), {4, 0.01},
                            fmt::format("nearly facing the camera, tilted by 8° towards {}°", towards));
    for (const glm::dvec3 &centre : {glm::dvec3(75, 50, -240), {-75, 45, -240}, {-70, -50, -240}, {75, -45, -240}})
        studio.expect_found(pose(centre), {4, 0.01}, "parallel to the image plane, off the axis");
}

void intrinsics(Context &context) {
    constexpr double bound_px = 0.3;
    const auto expect_accurate_with = [&](const arhost_intrinsics &camera, const Pose &at, const std::string &where) {
        expect_accurate(Studio(context, camera).shoot(at, where), bound_px, where);
    };
    const arhost_intrinsics wide = wide_camera(context);
    for (const auto &[x_factor, y_factor] : {std::pair{1.1, 0.97}, {0.93, 1.07}}) {
        arhost_intrinsics camera = wide;
        camera.fx *= x_factor;
        camera.fy *= y_factor;
        expect_accurate_with(camera, tilted({0, 0, -240}, 15, 90, 25),
                             fmt::format("with fx = {:.0f}, fy = {:.0f}", camera.fx, camera.fy));
    }
    arhost_intrinsics camera = wide;
    camera.cx += 0.22 * wide.width;
    camera.cy -= 0.18 * wide.height;
    expect_accurate_with(camera, tilted({-40, -20, -250}, 30, 70),
                         fmt::format("with cx = {:.1f} and cy = {:.1f}", camera.cx, camera.cy));
    // A crop of an image equals the image of a camera for that crop.
    const std::uint32_t x0 = wide.width * 9 / 32, y0 = wide.height * 15 / 64;
    arhost_intrinsics part = wide;
    part.width = wide.width * 3 / 5;
    part.height = wide.height * 5 / 8;
    part.cx -= x0;
    part.cy -= y0;
    const Placed marker{prints_of(context).front(), side_mm, tilted({25, -10, -260}, 30, 160)};
    const Grey cropped = draw(wide, marker).part(x0, y0, part.width, part.height);
    Tracker tracker(context);
    tracker.start(part, {{marker.print.id, side_mm}});
    expect_found(tracker, part, marker, cropped, {2, 0.01},
                 "in a crop of the image, with the intrinsics of the crop");
}

void through_lens(Context &context, const arhost_intrinsics &camera, const std::string &lens) {
    Studio studio(context, camera);
    for (const glm::dvec3 &at : {glm::dvec3(75, 50, -250), {-80, -45, -260}, {-10, 55, -240}})
        studio.expect_found(tilted(at, 25, 50, 10), {1.5, 0.01}, "with " + lens);
}

arhost_intrinsics with_lens(const Context &context, arhost_distortion model,
                            std::initializer_list<double> coefficients) {
    arhost_intrinsics camera = wide_camera(context);
    camera.distortion = model;
    camera.coefficient_count = static_cast<std::uint32_t>(coefficients.size());
    std::ranges::copy(coefficients, camera.coefficients);
    return camera;
}

void lens(Context &context) {
    through_lens(context, with_lens(context, ARHOST_DISTORTION_BROWN, {-0.28, 0.09, 0.015, -0.02}), "Brown's model");
    through_lens(context, with_lens(context, ARHOST_DISTORTION_BROWN, {0.2, -0.1, 0, 0, 0.05, 0.5, -0.1, 0.02}),
                 "Brown's model with 8 coefficients");
}

void fisheye(Context &context) {
    const arhost_intrinsics camera = with_lens(context, ARHOST_DISTORTION_FISHEYE, {0.15, -0.08, 0.03, -0.01});
    const Print print = prints_of(context).front();
    const arhost_status status = Tracker(context).try_start(camera, {{print.id, side_mm}});
    if (status == ARHOST_STATUS_ERROR_UNSUPPORTED || status == ARHOST_STATUS_ERROR_CONFIGURATION) {
        context.note = "it is rejected";
        return;
    }
    through_lens(context, camera, "a fisheye lens");
}

// The markers of a plane map, of which the corners together give a more accurate pose than those of one marker.
void map(Context &context) {
    std::vector<Print> prints = prints_of(context);
    const Pose at = tilted({10, 5, -330}, 25, 130, 20);
    std::vector<Placed> markers;
    for (std::size_t i = 0; i < prints.size() && i < 4; ++i) {
        const double x = i % 2 ? 60 : -50, y = i / 2 ? -60 : 45, turn = 90.0 * static_cast<double>(i);
        markers.push_back({prints[i], 60 + 5.0 * static_cast<double>(i), at * pose({x, y, 0}, 0, 0, turn)});
    }
    const Grey image = draw(wide_camera(context), markers);
    TrackerSetup setup(context, wide_camera(context), {context.family});
    setup.add_map(markers, at);
    Tracker tracker(context);
    const std::string where = fmt::format("with a map of {} markers", markers.size());
    tracker.instance().expect_ok((where + ", start").c_str(), tracker.start_with(setup));
    const std::vector<arhost_observation> found = tracker.track(image);
    std::vector<InFamily> expected;
    std::vector<Observed> observed;
    for (const Placed &marker : markers) {
        expected.push_back({marker});
        if (const auto seen = std::ranges::find(found, marker.print.id, &arhost_observation::id); seen != found.end())
            observed.push_back({*seen, marker});
    }
    expect_all(found, wide_camera(context), expected, where, image);
    expect_pose(solve(wide_camera(context), observed, at, where, image), at, {0.5, 0.003},
                where + ", the corners put it", image);
}

// If a prerequisite fails, the other tests of corners and poses fail for the same reason.
constexpr const char *gate = "tracker.track", *order_gate = "tracker.corner-order", *corner_gate = "tracker.corners";
constexpr Test tests[] = {
    {"tracker.corner-order",
     "Corners are top left, top right, bottom right, bottom left on the upright print, for any rotation of it.", gate,
     20s, corner_order},
    {"tracker.corners",
     "Corners are accurate to 0.3 px each and 0.06 px on average, where pixel centres are at integers.", order_gate,
     20s, corners},
    {"tracker.tilt-and-distance",
     "Corners of markers 30 to 130 px wide, tilted by 20° to 60°, give poses accurate to 1.5° and 1 % of the "
     "distance.",
     corner_gate, 30s, tilt_and_distance},
    {"tracker.near-frontal",
     "Corners of a nearly frontal marker give a pose accurate to 4°, not tilted to the wrong side.", corner_gate, 20s,
     near_frontal},
    {"tracker.intrinsics", "Corners are accurate with any focal lengths and principal point, also in a crop.",
     corner_gate, 20s, intrinsics},
    {"tracker.lens",
     "With Brown's lens model, corners are in the distorted frame: they give poses accurate to 1.5° and 1 % of the "
     "distance.",
     corner_gate, 20s, lens},
    {"tracker.fisheye",
     "A fisheye lens is rejected, or corners are in the distorted frame: they give poses accurate to 1.5° and 1 % of "
     "the distance.",
     corner_gate, 20s, fisheye},
    {"tracker.map",
     "The markers of a map are observed, each once; together, their corners give a pose accurate to 0.5° and 0.3 % "
     "of the distance.",
     corner_gate, 20s, map},
};

} // namespace

std::span<const Test> tracker_corner_tests() {
    return tests;
}

} // namespace arhost::conformance
