// SPDX-License-Identifier: Apache-2.0
#include "planar_pose.hpp"

#include <arhost-cpp/plugin.hpp>

#include <opencv2/calib3d.hpp>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace arhost::fiducial {
namespace {

using Square = std::array<cv::Point3d, 4>;
using Jacobian = cv::Matx<double, 8, 6>;

struct Motion {
    cv::Vec3d rotation, translation; // from the marker to OpenCV's camera axes (x right, y down, z forward)
};

double rms(const Corners &a, const Corners &b) {
    double sum = 0;
    for (int i = 0; i < 4; ++i)
        sum += (a[i] - b[i]).dot(a[i] - b[i]);
    return std::sqrt(sum / 4);
}

// Returns whether `quad` is convex, has no angle near 0° or 180°, and is clockwise in the image (y down), like the
// front face of a marker.
bool is_convex_front(const std::vector<cv::Point2d> &quad) {
    constexpr double min_sine = 1e-3;
    for (int i = 0; i < 4; ++i) {
        const cv::Point2d a = quad[(i + 1) % 4] - quad[i], b = quad[(i + 2) % 4] - quad[(i + 1) % 4];
        if (!(a.cross(b) > min_sine * cv::norm(a) * cv::norm(b)))
            return false;
    }
    return true;
}

// Returns whether all corners are in front of the camera and the front of the print faces the camera.
bool is_visible(const Motion &motion, const Square &square) {
    cv::Matx33d r;
    cv::Rodrigues(motion.rotation, r);
    for (const cv::Point3d &p : square)
        if (!((r * cv::Vec3d(p) + motion.translation)[2] > 0))
            return false;
    return r.col(2).dot(motion.translation) < 0;
}

// Computes the pose of a square that is parallel to the image plane, from the undistorted pixels of its corners.
Motion frontal_pose(const std::vector<cv::Point2d> &quad, const Lens &lens, double side_mm) {
    const auto on_plane = [&](const cv::Point2d &px) { // z = 1
        return cv::Point2d(px.x / lens.undistorted_matrix()(0, 0), px.y / lens.undistorted_matrix()(1, 1));
    };
    const cv::Point2d right = on_plane((quad[1] - quad[0] + quad[2] - quad[3]) / 2),
                      centre = on_plane((quad[0] + quad[1] + quad[2] + quad[3]) / 4);
    const cv::Point2d x = right / cv::norm(right);
    Motion motion;
    cv::Rodrigues(cv::Matx33d(x.x, x.y, 0, x.y, -x.x, 0, 0, 0, -1), motion.rotation);
    motion.translation = side_mm / cv::norm(right) * cv::Vec3d(centre.x, centre.y, 1);
    return motion;
}

// Minimizes the reprojection error in distorted pixels with the Levenberg–Marquardt method.
void refine(Motion &motion, const Corners &corners_px, const Lens &lens, const Square &square) {
    double damping = 1e-6;
    Jacobian jacobian;
    Corners projected = lens.project(square, motion.rotation, motion.translation, &jacobian);
    for (int iteration = 0; iteration < 20; ++iteration) {
        cv::Matx<double, 8, 1> residual;
        for (int i = 0; i < 4; ++i) {
            residual(2 * i) = corners_px[i].x - projected[i].x;
            residual(2 * i + 1) = corners_px[i].y - projected[i].y;
        }
        cv::Matx66d normal = jacobian.t() * jacobian;
        for (int i = 0; i < 6; ++i)
            normal(i, i) *= 1 + damping;
        const cv::Matx<double, 6, 1> step = normal.solve(jacobian.t() * residual, cv::DECOMP_CHOLESKY);
        const Motion next{motion.rotation + cv::Vec3d(step.val), motion.translation + cv::Vec3d(step.val + 3)};
        Jacobian next_jacobian;
        const Corners next_projected = lens.project(square, next.rotation, next.translation, &next_jacobian);
        const double gain = rms(corners_px, projected) - rms(corners_px, next_projected);
        if (gain > 0 && is_visible(next, square)) {
            motion = next;
            projected = next_projected;
            jacobian = next_jacobian;
            damping *= 0.1;
            if (gain < 1e-9)
                return;
        } else {
            damping = std::max(damping, 1e-9) * 100;
            if (damping > 1e6)
                return;
        }
    }
}

Pose pose_of(const Motion &motion, const Corners &corners_px, const Lens &lens, const Square &square) {
    cv::Matx33d r;
    cv::Rodrigues(motion.rotation, r);
    Pose pose{};
    for (int row = 0; row < 3; ++row) {
        const double to_gl = row == 0 ? 1 : -1; // y down, z forward → y up, z backward
        for (int column = 0; column < 3; ++column)
            pose.mt[column * 4 + row] = to_gl * r(row, column);
        pose.mt[12 + row] = to_gl * motion.translation[row];
    }
    pose.mt[15] = 1;
    pose.reprojection_px = rms(corners_px, lens.project(square, motion.rotation, motion.translation));
    return pose;
}

} // namespace

Lens::Lens(const arhost_intrinsics &intrinsics)
    : fisheye_(intrinsics.distortion == ARHOST_DISTORTION_FISHEYE),
      matrix_(intrinsics.fx, 0, intrinsics.cx, 0, intrinsics.fy, intrinsics.cy, 0, 0, 1),
      ideal_matrix_(intrinsics.fx, 0, 0, 0, intrinsics.fy, 0, 0, 0, 1) {
    const auto count = intrinsics.distortion == ARHOST_DISTORTION_NONE ? 0 : intrinsics.coefficient_count;
    const bool valid =
        intrinsics.distortion == ARHOST_DISTORTION_NONE ||
        (intrinsics.distortion == ARHOST_DISTORTION_FISHEYE && count == 4) ||
        (intrinsics.distortion == ARHOST_DISTORTION_BROWN && (count == 4 || count == 5 || count == 8 || count == 12));
    if (!valid || !(intrinsics.fx > 0) || !(intrinsics.fy > 0))
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "the camera calibration is invalid: fx and fy must be greater than 0, and the distortion must "
                      "be none, brown "
                      "with 4, 5, 8 or 12 coefficients, or fisheye with 4 coefficients");
    coefficients_.create(static_cast<int>(count), count ? 1 : 0);
    std::copy_n(intrinsics.coefficients, count, coefficients_.begin());
}

std::optional<std::vector<cv::Point2d>> Lens::undistort(const std::vector<cv::Point2d> &pixels) const {
    for (const cv::Point2d &pixel : pixels)
        if (!std::isfinite(pixel.x) || !std::isfinite(pixel.y))
            return std::nullopt;
    std::vector<cv::Point2d> result;
    if (coefficients_.empty()) {
        for (const cv::Point2d &pixel : pixels)
            result.push_back(pixel - principal_point());
        return result;
    }
    if (pixels.empty())
        return result;
    const cv::TermCriteria criteria(cv::TermCriteria::MAX_ITER + cv::TermCriteria::EPS, 500, 1e-11);
    if (fisheye_)
        cv::fisheye::undistortPoints(pixels, result, matrix_, coefficients_, cv::noArray(), ideal_matrix_, criteria);
    else
        cv::undistortPoints(pixels, result, matrix_, coefficients_, cv::noArray(), ideal_matrix_, criteria);
    // Where the distortion model is not one-to-one, the iteration may converge to a wrong point. Distort the result
    // again to detect this.
    const std::vector<cv::Point2d> check = distort(result);
    for (std::size_t i = 0; i < pixels.size(); ++i)
        if (!(cv::norm(check[i] - pixels[i]) < 1e-4))
            return std::nullopt;
    return result;
}

std::vector<cv::Point2d> Lens::distort(const std::vector<cv::Point2d> &undistorted_px) const {
    std::vector<cv::Point2d> pixels;
    if (coefficients_.empty()) {
        for (const cv::Point2d &p : undistorted_px)
            pixels.push_back(p + principal_point());
        return pixels;
    }
    std::vector<cv::Point3d> rays;
    rays.reserve(undistorted_px.size());
    for (const cv::Point2d &p : undistorted_px)
        rays.emplace_back(p.x / matrix_(0, 0), p.y / matrix_(1, 1), 1);
    if (fisheye_)
        cv::fisheye::projectPoints(rays, pixels, cv::Vec3d(), cv::Vec3d(), matrix_, coefficients_);
    else
        cv::projectPoints(rays, cv::Vec3d(), cv::Vec3d(), matrix_, coefficients_, pixels);
    return pixels;
}

Corners Lens::project(const Square &points_mm, const cv::Vec3d &rotation, const cv::Vec3d &translation,
                      Jacobian *jacobian) const {
    const std::vector<cv::Point3d> points(points_mm.begin(), points_mm.end());
    std::vector<cv::Point2d> projected;
    cv::Mat_<double> derivatives;
    int first = 0; // first of three columns for the rotation; three columns for the translation follow
    if (fisheye_) {
        cv::fisheye::projectPoints(points, projected, rotation, translation, matrix_, coefficients_, 0, derivatives);
        first = 8;
    } else {
        cv::projectPoints(points, rotation, translation, matrix_, coefficients_, projected, derivatives);
    }
    if (jacobian)
        *jacobian = Jacobian(derivatives.colRange(first, first + 6).clone().ptr<double>());
    Corners result;
    std::copy_n(projected.begin(), 4, result.begin());
    return result;
}

std::optional<PlanarPose> planar_pose(const Corners &corners_px, const Lens &lens, double side_mm) {
    const auto ideal = lens.undistort({corners_px.begin(), corners_px.end()});
    if (!ideal || !is_convex_front(*ideal))
        return std::nullopt;
    const double h = side_mm / 2;
    const Square square{{{-h, h, 0}, {h, h, 0}, {h, -h, 0}, {-h, -h, 0}}}; // IPPE_SQUARE requires this order
    std::vector<cv::Vec3d> rotations, translations;
    cv::solvePnPGeneric(std::vector<cv::Point3d>(square.begin(), square.end()), *ideal, lens.undistorted_matrix(),
                        cv::noArray(), rotations, translations, false, cv::SOLVEPNP_IPPE_SQUARE);

    struct Solution {
        Motion motion;
        Pose pose;
    };
    std::vector<Solution> solutions;
    for (std::size_t i = 0; i < rotations.size(); ++i) {
        const Motion motion{rotations[i], translations[i]};
        const Pose pose = pose_of(motion, corners_px, lens, square);
        if (is_visible(motion, square) && std::isfinite(pose.reprojection_px))
            solutions.push_back({motion, pose});
    }
    // OpenCV's IPPE fails if the marker is exactly parallel to the image plane, which is a rotation by 180° in
    // OpenCV's axes.
    if (solutions.empty())
        solutions.push_back({frontal_pose(*ideal, lens, side_mm), {}});
    if (solutions.size() == 2 && solutions[1].pose.reprojection_px < solutions[0].pose.reprojection_px)
        std::swap(solutions[0], solutions[1]);
    // Refine only the better solution. For a near marker, the error has a single minimum, to which the other solution
    // would converge as well.
    refine(solutions[0].motion, corners_px, lens, square);
    const Pose best = pose_of(solutions[0].motion, corners_px, lens, square);
    if (solutions.size() == 1)
        return PlanarPose{best, std::nullopt, 0};
    const double worse = solutions[1].pose.reprojection_px;
    return PlanarPose{best, solutions[1].pose, worse > 0 ? std::min(best.reprojection_px / worse, 1.0) : 1.0};
}

} // namespace arhost::fiducial
