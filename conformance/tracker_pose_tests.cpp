// SPDX-License-Identifier: Apache-2.0
// Poses: axes, units, and accuracy on frames rendered at known poses.
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
    explicit Studio(Context &context, const arhost_intrinsics &camera = wide_camera())
        : camera_(camera), print_(prints_of(context.prints).front()), tracker_(context) {
        tracker_.start(camera, {{print_.id, side_mm}});
    }

    struct Shot {
        Placed marker;
        Grey image;
        arhost_marker found;
    };
    Shot shoot(const Pose &at, const std::string &where) {
        const Placed marker{print_, side_mm, at};
        const Grey image = draw(camera_, marker);
        return {marker, image, expect_one(tracker_.track_first(image), print_.id, where, image)};
    }
    void expect_found(const Pose &at, const Bounds &bounds, const std::string &where) {
        const Shot shot = shoot(at, where);
        expect_pose(shot.found, at, bounds, where, shot.image);
    }
    const arhost_intrinsics &camera() const { return camera_; }

private:
    arhost_intrinsics camera_;
    Print print_;
    Tracker tracker_;
};

std::string text_of(const glm::dvec3 &v) {
    return fmt::format("({:.2f}, {:.2f}, {:.2f})", v.x, v.y, v.z);
}

void axes(Context &context) {
    Studio studio(context);
    for (const double turn : {0.0, 90.0, 180.0, 270.0}) {
        const Pose at = tilted({15, 20, -260}, 20, 30, turn);
        const Studio::Shot shot = studio.shoot(at, fmt::format("rotated by {}°", turn));
        const Pose found = pose_of(shot.found);
        for (int axis = 0; axis < 3; ++axis)
            if (const glm::dvec3 actual = found[axis], expected = at[axis];
                !(glm::dot(actual, expected) > std::cos(glm::radians(5.0))))
                throw Failure(fmt::format("with a print rotated by {}°, the {} axis is {}; expected {} (x right, y "
                                          "up, z to the viewer)",
                                          turn, "xyz"[axis], text_of(actual), text_of(expected)))
                    .with("frame", shot.image.picture());
    }
}

void millimetres(Context &context) {
    const Print print = prints_of(context.prints).front();
    const Pose at = tilted({30, 20, -250}, 30, 60);
    const Grey image = draw(wide_camera(), Placed{print, side_mm, at});
    Tracker tracker(context);
    for (const double factor : {1.0, 0.5, 3.0}) {
        tracker.start(wide_camera(), {{print.id, factor * side_mm}});
        const glm::dvec3 actual = pose_of(expect_one(tracker.track_first(image), print.id, "in view", image))[3],
                         expected = factor * glm::dvec3(at[3]);
        if (!(glm::distance(actual, expected) <= 0.02 * glm::length(expected)))
            throw Failure(fmt::format("configured with a side of {} mm, the marker is at {} mm; expected {}",
                                      factor * side_mm, text_of(actual), text_of(expected)))
                .with("frame", image.picture());
    }
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

void corners(Context &context) {
    constexpr double bound_px = 0.3, bound_mean_px = 0.06;
    constexpr const char *names[] = {"top left", "top right", "bottom right", "bottom left"};
    Studio studio(context);
    glm::dvec2 sum(0);
    constexpr int count = 8;
    for (int i = 0; i < count; ++i) {
        const Pose at = tilted({5 * (i % 5) - 10, 4 * (i % 3) - 4, -220 - 15 * i}, 15 + 3 * i, 67 * i, 40 * i);
        const Studio::Shot shot = studio.shoot(at, "in view");
        const auto expected = corners_of(studio.camera(), shot.marker);
        for (int k = 0; k < 4; ++k) {
            const glm::dvec2 actual(shot.found.corners_px[k][0], shot.found.corners_px[k][1]);
            sum += actual - expected[k];
            if (!(glm::distance(actual, expected[k]) <= bound_px))
                throw Failure(
                    fmt::format("the {} corner is reported at ({:.2f}, {:.2f}) px instead of ({:.2f}, {:.2f})",
                                names[k], actual.x, actual.y, expected[k].x, expected[k].y))
                    .with("frame", shot.image.picture())
                    .at(static_cast<unsigned>(std::lround(expected[k].x)),
                        static_cast<unsigned>(std::lround(expected[k].y)));
        }
    }
    const glm::dvec2 mean = sum / (4.0 * count);
    if (glm::length(mean) > bound_mean_px)
        throw Failure(fmt::format(
            "the mean error of {} corners is ({:.3f}, {:.3f}) px; the limit is {} px (pixel centres are at integers)",
            4 * count, mean.x, mean.y, bound_mean_px));
}

void pixel_centres(Context &context) {
    constexpr double bound_px = 0.06;
    Studio studio(context);
    glm::dvec2 sum(0);
    constexpr int count = 8;
    for (int i = 0; i < count; ++i) {
        const Pose at = tilted({6 * (i % 4) - 9, 4 * (i % 3) - 4, -220 - 15 * i}, 12 + 3 * i, 71 * i, 31 * i);
        const Studio::Shot shot = studio.shoot(at, "in view");
        const Pose found = pose_of(shot.found);
        if (!(found[3].z < 0))
            throw Failure(
                fmt::format("the marker is at {} mm; z is negative in front of the camera", text_of(found[3])));
        sum += pixel_of(studio.camera(), found[3]) - pixel_of(studio.camera(), at[3]);
    }
    const glm::dvec2 mean = sum / static_cast<double>(count);
    if (!(glm::length(mean) <= bound_px))
        throw Failure(fmt::format("over {} poses, the mean error of the marker's projected centre is ({:.3f}, "
                                  "{:.3f}) px; the limit is {} px (pixel centres are at integers)",
                                  count, mean.x, mean.y, bound_px));
}

void focal_length(Context &context) {
    constexpr double tolerance = 0.004;
    for (const auto &[fx, fy] : {std::pair{330.0, 290.0}, {280.0, 320.0}}) {
        arhost_intrinsics camera = wide_camera();
        camera.fx = fx;
        camera.fy = fy;
        Studio studio(context, camera);
        double ratio = 0;
        constexpr int count = 4;
        for (int i = 0; i < count; ++i) {
            const Pose at = tilted({0, 0, -230 - 8 * i}, 15, 90 * i, 25 * i);
            ratio += pose_of(studio.shoot(at, "in view").found)[3].z / at[3].z / count;
        }
        if (!(std::abs(ratio - 1) <= tolerance))
            throw Failure(fmt::format("with fx = {} px and fy = {} px, distances are {:.4f} times the truth on "
                                      "average; the limits are {} and {}",
                                      fx, fy, ratio, 1 - tolerance, 1 + tolerance));
    }
}

void principal_point(Context &context) {
    arhost_intrinsics camera = wide_camera();
    camera.cx += 70;
    camera.cy -= 45;
    Studio(context, camera)
        .expect_found(tilted({-40, -20, -250}, 30, 70), {2, 0.01}, "with cx = 229.5 and cy = 82.5");
    // A crop of an image equals the image of a camera for that crop.
    constexpr std::uint32_t x0 = 90, y0 = 60;
    arhost_intrinsics part = wide_camera();
    part.width = 192;
    part.height = 160;
    part.cx -= x0;
    part.cy -= y0;
    const Placed marker{prints_of(context.prints).front(), side_mm, tilted({25, -10, -260}, 30, 160)};
    const Grey cropped = draw(wide_camera(), marker).part(x0, y0, part.width, part.height);
    Tracker tracker(context);
    tracker.start(part, {{marker.print.id, side_mm}});
    expect_found(tracker, marker, cropped, {2, 0.01}, "in a crop of the image, with the intrinsics of the crop");
}

void through_lens(Context &context, const arhost_intrinsics &camera, const std::string &lens) {
    Studio studio(context, camera);
    for (const glm::dvec3 &at : {glm::dvec3(75, 50, -250), {-80, -45, -260}, {-10, 55, -240}})
        studio.expect_found(tilted(at, 25, 50, 10), {1.5, 0.01}, "with " + lens);
}

arhost_intrinsics with_lens(arhost_distortion model, std::initializer_list<double> coefficients) {
    arhost_intrinsics camera = wide_camera();
    camera.distortion = model;
    camera.coefficient_count = static_cast<std::uint32_t>(coefficients.size());
    std::ranges::copy(coefficients, camera.coefficients);
    return camera;
}

void lens(Context &context) {
    through_lens(context, with_lens(ARHOST_DISTORTION_BROWN, {-0.28, 0.09, 0.015, -0.02}), "Brown's model");
    through_lens(context, with_lens(ARHOST_DISTORTION_BROWN, {0.2, -0.1, 0, 0, 0.05, 0.5, -0.1, 0.02}),
                 "Brown's model with 8 coefficients");
}

void fisheye(Context &context) {
    const arhost_intrinsics camera = with_lens(ARHOST_DISTORTION_FISHEYE, {0.15, -0.08, 0.03, -0.01});
    const Print print = prints_of(context.prints).front();
    const arhost_status status = Tracker(context).try_start(camera, {{print.id, side_mm}});
    if (status == ARHOST_STATUS_ERROR_UNSUPPORTED || status == ARHOST_STATUS_ERROR_CONFIGURATION) {
        context.note = "it is rejected";
        return;
    }
    through_lens(context, camera, "a fisheye lens");
}

constexpr arhost_kind kind = ARHOST_KIND_TRACKER;
// Prerequisites: if one fails, the other pose tests fail for the same reason.
constexpr const char *gate = "tracker.track", *axes_gate = "tracker.axes", *pose_gate = "tracker.millimetres";
constexpr Test tests[] = {
    {"tracker.axes",
     "A marker's x axis points right, y up and z out of the paper, to 5°, for any rotation of the print.", kind, gate,
     20s, axes},
    {"tracker.millimetres", "Positions are in mm, scaled by the listed side, to 2 % of the distance.", kind,
     axes_gate, 20s, millimetres},
    {"tracker.tilt-and-distance",
     "Poses of markers 30 to 130 px wide, tilted by 20° to 60°, are accurate to 1.5° and 1 % of the distance.", kind,
     pose_gate, 30s, tilt_and_distance},
    {"tracker.near-frontal", "The pose of a nearly frontal marker is accurate to 4°, not tilted to the wrong side.",
     kind, pose_gate, 20s, near_frontal},
    {"tracker.corners", "Corners are in the specified order, accurate to 0.3 px each and 0.06 px on average.", kind,
     gate, 20s, corners},
    {"tracker.pixel-centres", "Poses project to the marker's position, to 0.06 px on average.", kind, pose_gate, 20s,
     pixel_centres},
    {"tracker.focal-length", "fx and fy are used: distances are accurate to 0.4 % on average.", kind, pose_gate, 20s,
     focal_length},
    {"tracker.principal-point", "The principal point is used, also for a crop of an image.", kind, pose_gate, 20s,
     principal_point},
    {"tracker.lens", "With Brown's lens model, poses are accurate to 1.5° and 1 % of the distance.", kind, pose_gate,
     20s, lens},
    {"tracker.fisheye", "A fisheye lens is rejected, or poses are accurate to 1.5° and 1 % of the distance.", kind,
     pose_gate, 20s, fisheye},
};

} // namespace

std::span<const Test> tracker_pose_tests() {
    return tests;
}

} // namespace arhost::conformance
