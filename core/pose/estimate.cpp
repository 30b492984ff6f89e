// SPDX-License-Identifier: Apache-2.0
#include "pose/estimate.hpp"

#include "pose/planar.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace arhost::pose {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Jacobian26 = Eigen::Matrix<double, 2, 6>;

constexpr double infinity = std::numeric_limits<double>::infinity();

// Tukey's biweight loss. Its argument is the length of an error in units of the noise. The loss is constant beyond
// the cutoff.
class Biweight {
public:
    explicit Biweight(double cutoff) : cutoff2_(cutoff * cutoff) {}
    bool is_outlier(double error2) const { return error2 >= cutoff2_; }
    double loss(double error2) const {
        const double x = std::min(error2 / cutoff2_, 1.0);
        return cutoff2_ * x * (1 - x + x * x / 3); // near 0: error2
    }
    double weight(double error2) const {
        const double rest = 1 - std::min(error2 / cutoff2_, 1.0);
        return rest * rest;
    }

private:
    double cutoff2_;
};

struct Residual {
    Eigen::Vector2d error; // in units of sigma_px
    Jacobian26 jacobian;   // with respect to translation and rotation in camera axes
};

bool evaluate(const Rigid &pose, std::span<const Correspondence> points, const Projection &projection,
              std::vector<Residual> &residuals) {
    residuals.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
        const Eigen::Vector3d turned = pose.rotation * points[i].on_target_mm;
        Jacobian23 derivative;
        const auto pixel = projection.pixel(turned + pose.translation_mm, &derivative);
        if (!pixel)
            return false;
        residuals[i].error = (points[i].pixel_px - *pixel) / points[i].sigma_px;
        residuals[i].jacobian << derivative / points[i].sigma_px,
            derivative / -points[i].sigma_px * cross_matrix(turned);
    }
    return true;
}

Rigid moved(const Rigid &pose, const Vector6d &step) {
    return {orthonormal(rotation_by(step.tail<3>()) * pose.rotation), pose.translation_mm + step.head<3>()};
}

// Estimates the noise from the median residual, in units of sigma_px. For two-dimensional Gaussian errors, the median
// length is 1.177. The second factor corrects the bias that occurs after a fit to few residuals (Rousseeuw and Leroy,
// Robust Regression and Outlier Detection, 1987).
double noise_of(const std::vector<Residual> &residuals) {
    std::vector<double> lengths;
    lengths.reserve(residuals.size());
    for (const Residual &residual : residuals)
        lengths.push_back(residual.error.norm());
    const auto median = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
    std::nth_element(lengths.begin(), median, lengths.end());
    const double freedom = 2 * static_cast<double>(lengths.size()) - 6;
    return std::max(*median / 1.177 * (1 + 5 / freedom), 0.8);
}

template <class Loss> double total_loss(const std::vector<Residual> &residuals, const Loss &loss) {
    double sum = 0;
    for (const Residual &residual : residuals)
        sum += loss.loss(residual.error.squaredNorm());
    return sum;
}

struct LeastSquares {
    double loss(double error2) const { return error2; }
    double weight(double) const { return 1; }
};

// Levenberg–Marquardt with iteratively re-weighted least squares. Updates pose and residuals.
template <class Loss>
bool minimize(Rigid &pose, std::vector<Residual> &residuals, std::span<const Correspondence> points,
              const Projection &projection, const Loss &loss) {
    double damping = 1e-6, before = total_loss(residuals, loss);
    std::vector<Residual> next_residuals;
    for (int iteration = 0; iteration < 50; ++iteration) {
        Matrix6d normal = Matrix6d::Zero();
        Vector6d gradient = Vector6d::Zero();
        for (const Residual &residual : residuals) {
            const double weight = loss.weight(residual.error.squaredNorm());
            normal += weight * residual.jacobian.transpose() * residual.jacobian;
            gradient += weight * residual.jacobian.transpose() * residual.error;
        }
        Matrix6d damped = normal;
        damped.diagonal() *= 1 + damping;
        const Vector6d step = damped.ldlt().solve(gradient);
        if (!step.allFinite())
            return false;
        if (step.head<3>().norm() < 1e-10 * pose.translation_mm.norm() && step.tail<3>().norm() < 1e-10)
            return true;
        const Rigid next = moved(pose, step);
        const double after =
            evaluate(next, points, projection, next_residuals) ? total_loss(next_residuals, loss) : infinity;
        if (after < before) {
            const bool converged = before - after < 1e-12 * before;
            pose = next;
            residuals.swap(next_residuals);
            before = after;
            damping *= 0.1;
            if (converged)
                return true;
        } else {
            damping = std::max(damping, 1e-9) * 100;
            if (damping > 1e6) // no step reduces the error
                return true;
        }
    }
    return true;
}

std::optional<Estimate> summarize(const Rigid &pose, const std::vector<Residual> &residuals,
                                  std::span<const Correspondence> points) {
    // Weight of sigma_px, the noise assumed in advance, as a number of degrees of freedom.
    constexpr double prior_freedom = 12;
    Matrix6d normal = Matrix6d::Zero();
    double squares_px = 0, squares = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        normal += residuals[i].jacobian.transpose() * residuals[i].jacobian;
        squares += residuals[i].error.squaredNorm();
        squares_px += residuals[i].error.squaredNorm() * points[i].sigma_px * points[i].sigma_px;
    }
    // Scales the columns to the same size before the inversion: millimetres and radians differ.
    const Vector6d scale = normal.diagonal().cwiseSqrt().cwiseInverse();
    if (!scale.allFinite())
        return {};
    const Matrix6d scaled = scale.asDiagonal() * normal * scale.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(scaled, Eigen::EigenvaluesOnly);
    if (!(eigen.eigenvalues()[0] > 1e-12))
        return {};
    const double count = static_cast<double>(points.size()), freedom = 2 * count - 6;
    const double variance = (prior_freedom + squares) / (prior_freedom + freedom);
    return Estimate{pose,
                    variance * (scale.asDiagonal() * scaled.inverse() * scale.asDiagonal()),
                    std::sqrt(squares_px / count),
                    squares,
                    0,
                    2 * points.size() - 6};
}

// The rigid transform from a marker's own frame (origin at the centre, x right, y up, z out of the print) to the
// target, and the corners in that frame.
struct MarkerPlane {
    Rigid target_from_marker;
    std::array<Eigen::Vector2d, 4> corners_mm;
};

std::optional<MarkerPlane> plane_of(const std::array<Eigen::Vector3d, 4> &corners) {
    MarkerPlane plane;
    const Eigen::Vector3d right = corners[1] - corners[0] + corners[2] - corners[3],
                          up = corners[0] - corners[3] + corners[1] - corners[2];
    const Eigen::Vector3d x = right.normalized(), z = right.cross(up).normalized();
    if (!x.allFinite() || !(z.norm() > 0.5))
        return {};
    plane.target_from_marker.rotation << x, z.cross(x), z;
    plane.target_from_marker.translation_mm = (corners[0] + corners[1] + corners[2] + corners[3]) / 4;
    const Rigid marker_from_target = plane.target_from_marker.inverse();
    std::ranges::transform(corners, plane.corners_mm.begin(), [&](const Eigen::Vector3d &corner) -> Eigen::Vector2d {
        return (marker_from_target * corner).head<2>();
    });
    return plane;
}

// Returns whether the quadrilateral is convex, has no angle near 0° or 180°, and is clockwise in the image (y down),
// as the front of a marker is.
bool is_convex_front(const std::array<Eigen::Vector2d, 4> &quad) {
    constexpr double min_sine = 1e-3;
    for (int i = 0; i < 4; ++i) {
        const Eigen::Vector2d a = quad[(i + 1) % 4] - quad[i], b = quad[(i + 2) % 4] - quad[(i + 1) % 4];
        if (!(a.x() * b.y() - a.y() * b.x() > min_sine * a.norm() * b.norm())) // also true for NaN
            return false;
    }
    return true;
}

// Returns whether the corners are in front of the camera and the camera sees the front of the print.
bool shows_front(const Rigid &camera_from_target, const ObservedMarker &marker) {
    std::array<Eigen::Vector3d, 4> corners;
    for (int i = 0; i < 4; ++i) {
        corners[i] = camera_from_target * marker.corners_on_target_mm[i];
        if (!(corners[i].z() > 0))
            return false;
    }
    const Eigen::Vector3d normal = (corners[1] - corners[3]).cross(corners[0] - corners[2]);
    return normal.dot(corners[0]) < 0;
}

// Returns the two possible poses of the target according to one of its markers.
std::vector<Rigid> poses_from(const ObservedMarker &marker, const Projection &projection) {
    std::array<Eigen::Vector2d, 4> on_image;
    for (int i = 0; i < 4; ++i) {
        if (!marker.corners_px[i].allFinite())
            return {};
        const auto point = projection.on_plane(marker.corners_px[i]);
        if (!point)
            return {};
        on_image[i] = *point;
    }
    const auto plane = plane_of(marker.corners_on_target_mm);
    if (!plane || !is_convex_front(on_image))
        return {};
    std::array<PlanePoint, 4> points;
    for (int i = 0; i < 4; ++i)
        points[i] = {plane->corners_mm[i], on_image[i]};
    const auto solutions = planar_poses(points);
    if (!solutions)
        return {};
    std::vector<Rigid> poses;
    for (const Rigid &camera_from_marker : *solutions)
        if (const Rigid pose = camera_from_marker * plane->target_from_marker.inverse(); shows_front(pose, marker))
            poses.push_back(pose);
    return poses;
}

// Returns the error of a start pose. The error of each corner is bounded, so that wrong markers do not outvote the
// right ones.
double start_error(const Rigid &pose, std::span<const Correspondence> points, const Projection &projection) {
    constexpr double bound_px = 10;
    double sum = 0;
    for (const Correspondence &point : points) {
        const auto pixel = projection.pixel(pose * point.on_target_mm);
        sum += pixel ? std::min((*pixel - point.pixel_px).norm(), bound_px) : bound_px;
    }
    return sum;
}

double area_px2(const ObservedMarker &marker) {
    const Eigen::Vector2d a = marker.corners_px[2] - marker.corners_px[0],
                          b = marker.corners_px[3] - marker.corners_px[1];
    return std::abs(a.x() * b.y() - a.y() * b.x()) / 2;
}

} // namespace

std::array<Eigen::Vector3d, 4> square_corners_mm(double side_mm) {
    const double s = side_mm / 2;
    return {{{-s, s, 0}, {s, s, 0}, {s, -s, 0}, {-s, -s, 0}}};
}

std::optional<Estimate> refine(const Rigid &start, std::span<const Correspondence> points,
                               const Projection &projection) {
    Rigid pose = start;
    std::vector<Residual> residuals;
    if (!evaluate(pose, points, projection, residuals))
        return {};
    std::vector<Correspondence> inliers(points.begin(), points.end());
    constexpr double cutoff = 5; // in units of the noise: excludes one of 300,000 corners with Gaussian noise
    double noise = 1;
    if (points.size() > 4) { // one marker has too few corners to find outliers
        noise = noise_of(residuals);
        for (int round = 0; round < 10; ++round) {
            if (!minimize(pose, residuals, points, projection, Biweight(cutoff * noise)))
                return {};
            const double next = noise_of(residuals);
            if (next >= 0.9 * noise)
                break;
            noise = next;
        }
        const Biweight loss(cutoff * noise);
        inliers.clear();
        for (std::size_t i = 0; i < points.size(); ++i)
            if (!loss.is_outlier(residuals[i].error.squaredNorm()))
                inliers.push_back(points[i]);
        if (inliers.size() < 4 || !evaluate(pose, inliers, projection, residuals))
            return {};
    }
    if (!minimize(pose, residuals, inliers, projection, LeastSquares()))
        return {};
    auto result = summarize(pose, residuals, inliers);
    if (result) {
        result->outliers = points.size() - inliers.size();
        result->normalized_error += static_cast<double>(result->outliers) * cutoff * cutoff * noise * noise;
    }
    return result;
}

std::optional<Estimate> assess(const Rigid &pose, std::span<const Correspondence> points,
                               const Projection &projection) {
    std::vector<Residual> residuals;
    if (points.size() < 4 || !evaluate(pose, points, projection, residuals))
        return {};
    return summarize(pose, residuals, points);
}

std::vector<Estimate> estimate_poses(std::span<const ObservedMarker> markers, const Projection &projection) {
    // The starts come from the largest markers, whose poses are the most precise.
    constexpr std::size_t max_markers_for_starts = 12, max_refined = 3;
    constexpr double distinct_rad = 0.02;
    std::vector<const ObservedMarker *> by_size;
    std::vector<Correspondence> points;
    for (const ObservedMarker &marker : markers) {
        by_size.push_back(&marker);
        for (int i = 0; i < 4; ++i)
            points.push_back({marker.corners_on_target_mm[i], marker.corners_px[i], marker.corner_sigma_px});
    }
    std::ranges::stable_sort(by_size, std::greater{}, [](const ObservedMarker *marker) { return area_px2(*marker); });
    by_size.resize(std::min(by_size.size(), max_markers_for_starts));

    struct Start {
        Rigid pose;
        double error;
    };
    std::vector<Start> starts;
    for (const ObservedMarker *marker : by_size)
        for (const Rigid &pose : poses_from(*marker, projection))
            starts.push_back({pose, start_error(pose, points, projection)});
    std::ranges::stable_sort(starts, {}, &Start::error);

    std::vector<Estimate> found;
    std::size_t refined = 0;
    for (const Start &start : starts) {
        if (refined == max_refined)
            break;
        // A start near a known solution would converge to it.
        const auto leads_to = [&](const Estimate &estimate) {
            return angle_between_rad(estimate.camera_from_target.rotation, start.pose.rotation) < 5 * distinct_rad;
        };
        if (markers.size() > 1 && std::ranges::any_of(found, leads_to))
            continue;
        ++refined;
        const auto estimate = refine(start.pose, points, projection);
        if (!estimate || 2 * estimate->outliers >= points.size() ||
            std::ranges::none_of(markers, [&](const ObservedMarker &marker) {
                return shows_front(estimate->camera_from_target, marker);
            }))
            continue;
        const auto is_same = [&](const Estimate &other) {
            return angle_between_rad(other.camera_from_target.rotation, estimate->camera_from_target.rotation) <
                   distinct_rad;
        };
        if (std::ranges::none_of(found, is_same))
            found.push_back(*estimate);
    }
    std::ranges::stable_sort(found, {}, &Estimate::normalized_error);
    if (found.size() > 2)
        found.resize(2);
    return found;
}

} // namespace arhost::pose
