// SPDX-License-Identifier: Apache-2.0
//
// Single tags under one difficulty at a time: how many are found, how precise their corners are, and how precise the
// poses are that follow from the corners, compared with the errors of an estimator that reaches the Cramér–Rao bound
// at the measured noise of the corners. Both trackers, and the bare libraries on the same pictures. Writes a CSV file
// if its path is given; plots.py draws it.
#include "bare_detectors.hpp"
#include "cramer_rao.hpp"

#include "command_line/command_line.hpp"

#include <fiducial/prints.hpp>
#include <fiducial/rendered_marker.hpp>
#include <fiducial/search_regions.hpp>

#include <fmt/format.h>

#include <cstdio>
#include <deque>
#include <exception>
#include <fstream>
#include <functional>
#include <numbers>
#include <random>

namespace {

using namespace arhost;
using fiducial::Corners;
using pose::Rigid;
using test::GreyFrame;

constexpr double side_mm = 100;
constexpr double chi2_6_95 = 12.59;      // 95 % quantile of the chi-squared distribution with 6 degrees of freedom
constexpr double unknown_sigma_px = 0.3; // as the worker assumes
const cv::Size size(480, 360);
const arhost_intrinsics camera = test::intrinsics_of(size, 450, 450, 239.5, 179.5);

struct Conditions {
    double tilt_degrees = 30, side_px = 60;
    double blur_px = 0.6, noise = 1.5; // standard deviations; noise in grey levels
    double exposure = 1;               // 1: white is 0.8 of the largest level
    double hidden = 0;                 // side of the square that covers a corner, relative to the tag's side
    double rolling_px = 0;             // motion to the right while the sensor reads the tag's height
};

struct Dimension {
    const char *name, *unit;
    std::vector<double> values;
    double Conditions::*field;
};

const std::vector<Dimension> dimensions = {
    {"tilt", "degrees", {0, 10, 20, 30, 40, 50, 60, 70, 75, 80}, &Conditions::tilt_degrees},
    {"size", "px", {8, 10, 13, 16, 20, 25, 35, 50, 80, 120, 200}, &Conditions::side_px},
    {"blur", "px", {0.4, 0.6, 1, 1.5, 2, 3, 4}, &Conditions::blur_px},
    {"noise", "levels", {0, 1.5, 4, 8, 15, 25, 40}, &Conditions::noise},
    {"exposure", "", {0.03, 0.06, 0.1, 0.3, 1, 1.5, 2}, &Conditions::exposure},
    {"hidden", "of side", {0, 0.05, 0.1, 0.15, 0.2, 0.3}, &Conditions::hidden},
    {"rolling", "px", {0, 1, 2, 4, 8, 16}, &Conditions::rolling_px},
};

// Four times the resolution, so 512 rays per pixel. A lens blurs before the sensor samples.
constexpr int fine = 4;
const arhost_intrinsics fine_camera = test::enlarged(camera, fine);

struct SharpView {
    cv::Mat picture; // of the fine camera
    test::Mt truth;
};

// Tags at random places near the centre, turned at random and tilted about random axes: 3 MB each.
class SharpViews {
public:
    // Draws only if the conditions differ from the last ones in tilt or size.
    const std::vector<SharpView> &of(const Conditions &conditions, int count) {
        if (!views_.empty() && conditions.tilt_degrees == tilt_degrees_ && conditions.side_px == side_px_)
            return views_;
        views_.clear();
        tilt_degrees_ = conditions.tilt_degrees;
        side_px_ = conditions.side_px;
        std::mt19937 random(1);
        std::uniform_real_distribution<double> turn(-180, 180), shift(-30, 30);
        const test::Print print = test::april_tag("tag36h11", 0).with_margin(1);
        for (int i = 0; i < count; ++i) {
            const double z = camera.fx * side_mm / side_px_;
            const double axis = turn(random) * std::numbers::pi / 180;
            const Eigen::Matrix3d rotation = pose::rotation_by(tilt_degrees_ * std::numbers::pi / 180 *
                                                               Eigen::Vector3d(std::cos(axis), std::sin(axis), 0)) *
                                             pose::rotation_by({0, 0, turn(random) * std::numbers::pi / 180}) *
                                             Eigen::Vector3d(1, -1, -1).asDiagonal();
            const double x = shift(random) * z / camera.fx, y = shift(random) * z / camera.fy;
            const test::Mt truth = matrix_of(Rigid{rotation, {x, y, z}});
            views_.push_back({test::render(fine_camera, {{print, side_mm, truth}}), truth});
        }
        return views_;
    }

private:
    std::vector<SharpView> views_;
    double tilt_degrees_ = 0, side_px_ = 0;
};

struct View {
    GreyFrame frame;
    test::Mt truth;
};
using Views = std::deque<View>;

cv::Mat photo(const Conditions &conditions, const SharpView &sharp, std::uint64_t seed) {
    cv::Mat_<float> grey;
    sharp.picture.convertTo(grey, CV_32F);
    if (conditions.hidden > 0)
        test::hide_corner(grey, fine_camera, sharp.truth, side_mm, conditions.hidden, 120);
    if (conditions.rolling_px > 0) {
        const cv::Point2d centre = test::pixel_of(sharp.truth, fine_camera, 0, 0);
        const double skew = conditions.rolling_px / conditions.side_px;
        const cv::Matx23d shear(1, skew, -skew * centre.y, 0, 1, 0);
        cv::warpAffine(grey, grey, shear, grey.size(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
    }
    cv::GaussianBlur(grey, grey, {}, fine * conditions.blur_px);
    cv::Mat reduced;
    cv::resize(grey, reduced, size, 0, 0, cv::INTER_AREA);
    reduced.convertTo(reduced, CV_16S, conditions.exposure); // the sensor's noise comes before saturation
    test::add_noise(reduced, conditions.noise, seed);
    return reduced;
}

Views views_of(const Conditions &conditions, const std::vector<SharpView> &sharp) {
    Views views;
    for (std::size_t i = 0; i < sharp.size(); ++i)
        views.emplace_back(View{GreyFrame(photo(conditions, sharp[i], i + 1)), sharp[i].truth});
    return views;
}

double percentile(std::vector<double> values, double fraction) {
    return values.empty() ? 0 : test::percentile(std::move(values), fraction);
}

// Errors, and samples of the errors of an estimator that reaches the bound.
struct Errors {
    std::vector<double> found, bound, bound_of_edges;

    // 1: as good as the bound permits
    double relative(double fraction) const { return relative_to(bound, fraction); }
    double relative_to_edges(double fraction) const { return relative_to(bound_of_edges, fraction); }

private:
    double relative_to(const std::vector<double> &errors, double fraction) const {
        const double possible = percentile(errors, fraction);
        return possible > 0 ? percentile(found, fraction) / possible : 0;
    }
};

struct Result {
    int found = 0, covered = 0;
    int flips = 0;                     // neither of the two solutions is within 20° of the truth
    double corner_px = 0;              // RMS of each coordinate
    Errors rotation_degrees, shift_mm; // without flips

    double share(int count) const { return 100.0 * found / count; }
    double covered_share() const { return found > flips ? 100.0 * covered / (found - flips) : 0; }
};

// Corners, and the standard deviation that the detector tells; 0: none.
struct Detection {
    Corners corners;
    double sigma_px = 0;
};
using Detect = std::function<std::optional<Detection>(const GreyFrame &)>;

Result measure(const Views &views, const Detect &detect) {
    const pose::Projection projection(camera);
    Result result;
    double sum = 0;
    std::vector<std::pair<Rigid, pose::Estimate>> poses; // truth, and the nearest of the two solutions
    for (const View &view : views) {
        const std::optional<Detection> detection = detect(view.frame);
        if (!detection)
            continue;
        const Corners &corners = detection->corners;
        ++result.found;
        const auto expected = test::corners_of(view.truth, camera, side_mm);
        pose::ObservedMarker marker{
            pose::square_corners_mm(side_mm), {}, detection->sigma_px > 0 ? detection->sigma_px : unknown_sigma_px};
        for (std::size_t i = 0; i < 4; ++i) {
            const cv::Point2d error = corners[i] - expected[i];
            sum += error.dot(error) / 8;
            marker.corners_px[i] = {corners[i].x, corners[i].y};
        }
        const Rigid truth = pose::rigid_of(view.truth);
        const auto all = estimate_poses({&marker, 1}, projection);
        const auto nearest = std::ranges::min_element(all, {}, [&](const pose::Estimate &pose) {
            return pose::angle_between_rad(pose.camera_from_target.rotation, truth.rotation);
        });
        if (nearest != all.end())
            poses.emplace_back(truth, *nearest);
    }
    if (result.found == 0)
        return result;
    result.corner_px = std::sqrt(sum / result.found);
    constexpr int samples_per_pose = 100;
    constexpr double degrees = 180 / std::numbers::pi, min_noise_px = 1e-6;
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    for (const auto &[truth, found] : poses) {
        Eigen::Matrix<double, 6, 1> error;
        error << truth.translation_mm - found.camera_from_target.translation_mm,
            pose::rotation_vector(truth.rotation * found.camera_from_target.rotation.transpose());
        if (error.tail<3>().norm() * degrees > 20) {
            ++result.flips;
            continue;
        }
        result.covered += error.dot(found.covariance.ldlt().solve(error)) < chi2_6_95;
        result.shift_mm.found.push_back(error.head<3>().norm());
        result.rotation_degrees.found.push_back(error.tail<3>().norm() * degrees);
        const double noise_px = std::max(result.corner_px, min_noise_px);
        const auto sample = [&](const pose::Matrix6d &bound, std::vector<double> Errors::*errors) {
            const pose::Matrix6d root = bound.llt().matrixL();
            for (int i = 0; i < samples_per_pose; ++i) {
                const Eigen::Matrix<double, 6, 1> possible =
                    root * Eigen::Matrix<double, 6, 1>::NullaryExpr([&] { return normal(random); });
                (result.shift_mm.*errors).push_back(possible.head<3>().norm());
                (result.rotation_degrees.*errors).push_back(possible.tail<3>().norm() * degrees);
            }
        };
        sample(bench::cramer_rao(truth, projection, side_mm, noise_px), &Errors::bound);
        sample(bench::cramer_rao_of_edges(truth, projection, side_mm, noise_px), &Errors::bound_of_edges);
    }
    return result;
}

// Both trackers and both libraries.
class Detectors {
public:
    Detectors() {
        for (const char *name : {"tracker_apriltag", "tracker_aruco"}) {
            test::Tracker &tracker = trackers_.emplace_back(name);
            if (tracker.created() != ARHOST_STATUS_OK || tracker.start(camera, {{0, side_mm}}) != ARHOST_STATUS_OK)
                throw std::runtime_error(tracker.log());
        }
    }
    static constexpr unsigned looks = 2; // closer looks of each tracker
    static constexpr const char *names[] = {"tracker_apriltag", "AprilTag", "tracker_aruco", "OpenCV"};
    // Shows the picture to a tracker until it has taken each closer look in each tile.
    std::optional<Detection> detect(std::size_t which, const GreyFrame &frame) {
        if (which % 2 == 1) {
            const bench::Detections found = which == 1 ? april_tag_(frame) : opencv_(frame);
            return found.contains(0) ? std::optional(Detection{found.at(0)}) : std::nullopt;
        }
        for (std::uint64_t sequence = 0; sequence < looks * fiducial::SearchRegions::tile_count; ++sequence)
            for (const arhost_observation &seen :
                 trackers_[which / 2].track(GreyFrame(bench::grey_of(frame), ARHOST_TRANSFER_LINEAR, sequence)))
                if (seen.id == 0) {
                    Detection detection{{}, seen.corner_sigma_px};
                    for (std::size_t i = 0; i < 4; ++i)
                        detection.corners[i] = {seen.corners_px[i][0], seen.corners_px[i][1]};
                    return detection;
                }
        return std::nullopt;
    }

private:
    std::deque<test::Tracker> trackers_;
    bench::BareAprilTag april_tag_;
    bench::BareOpenCv opencv_{true};
};

std::vector<std::string> missed_targets(const Result &tracker, const std::array<const Result *, 2> &libraries,
                                        bool is_quick) {
    std::vector<std::string> missed;
    const int most = std::max(libraries[0]->found, libraries[1]->found);
    if (tracker.found < most)
        missed.push_back(fmt::format("found {} of the {} that a library finds", tracker.found, most));
    if (is_quick || tracker.found == 0)
        return missed;
    for (const Result *library : libraries)
        if (library->found > 0 && tracker.corner_px > library->corner_px)
            missed.emplace_back("noise of corners");
    for (const auto &[name, errors] :
         {std::pair("rotation", &tracker.rotation_degrees), std::pair("translation", &tracker.shift_mm)})
        if (errors->relative(0.99) > 1.3)
            missed.push_back(fmt::format("p99 of {} {:.2f} ({:.2f} of what four independent edges permit)", name,
                                         errors->relative(0.99), errors->relative_to_edges(0.99)));
    constexpr int min_poses = 50; // for a share
    if (const double covered = tracker.covered_share();
        tracker.found - tracker.flips >= min_poses && (covered < 90 || covered > 98))
        missed.push_back(fmt::format("covered {:.1f} %", covered));
    return missed;
}

} // namespace

int main(int argc, char **argv) try {
    bool is_quick = false;
    std::string only, csv_file;
    arhost::command_line::CommandLine line("Measures the errors of poses in synthetic pictures.");
    line.flag("--quick", is_quick, "Measure with fewer frames; the figures are less precise");
    line.option("--only", only, "Name of a dimension (default: all)");
    line.option("CSV", csv_file, "File to write");
    if (const auto status = line.parse(argc, argv))
        return *status;
    std::ofstream csv;
    if (!csv_file.empty())
        csv.open(csv_file);
    constexpr double fractions[] = {0.5, 0.95, 0.99};
    csv << "dimension,unit,value,detector,found,corner_px";
    for (const char *error :
         {"rotation_degrees", "bound_of_rotation_degrees", "translation_mm", "bound_of_translation_mm"})
        for (const double fraction : fractions)
            csv << ',' << error << "_p" << 100 * fraction;
    csv << ",covered,flips\n";
    const int count = is_quick ? 20 : 300;
    Detectors detectors;
    SharpViews sharp;
    std::vector<std::string> missed;
    std::printf(
        "%d pictures of a tag for each row, tilt 30 degrees, 60 px, blur 0.6 px, noise 1.5 levels where nothing "
        "else is said; p99 of the errors of poses relative to that of the Cramer-Rao bound at the corners' noise\n",
        count);
    for (const Dimension &dimension : dimensions) {
        if (!only.empty() && dimension.name != only)
            continue;
        std::printf("\n%-8s | %31s | %35s | %41s\n%-8s | %7s %7s %7s %7s | %8s %8s %8s %8s | %20s %20s\n",
                    dimension.name, "found, %", "noise of corners, px", "p99 of rotation, of translation; covered",
                    dimension.unit, "apriltag", "bare", "aruco", "bare", "apriltag", "bare", "aruco", "bare",
                    "apriltag", "aruco");
        for (const double value : dimension.values) {
            Conditions conditions;
            conditions.*dimension.field = value;
            const Views views = views_of(conditions, sharp.of(conditions, count));
            std::array<Result, 4> results;
            for (std::size_t which = 0; which < results.size(); ++which) {
                const Result &result = results[which] =
                    measure(views, [&](const GreyFrame &frame) { return detectors.detect(which, frame); });
                csv << dimension.name << ',' << dimension.unit << ',' << value << ',' << Detectors::names[which]
                    << ',' << result.share(count) << ',' << result.corner_px;
                for (const Errors *errors : {&result.rotation_degrees, &result.shift_mm})
                    for (const auto *lengths : {&errors->found, &errors->bound})
                        for (const double fraction : fractions)
                            csv << ',' << percentile(*lengths, fraction);
                csv << ',' << result.covered_share() << ',' << result.flips << '\n';
            }
            std::printf("%8g |", value);
            for (const Result &result : results)
                std::printf(" %7.1f", result.share(count));
            std::printf(" |");
            for (const Result &result : results)
                std::printf(" %8.3f", result.corner_px);
            std::printf(" |");
            for (const std::size_t which : {0U, 2U})
                std::printf(" %6.2f %6.2f %5.1f%%", results[which].rotation_degrees.relative(0.99),
                            results[which].shift_mm.relative(0.99), results[which].covered_share());
            std::printf("\n");
            std::fflush(stdout);
            for (const std::size_t which : {0U, 2U})
                for (const std::string &target : missed_targets(results[which], {&results[1], &results[3]}, is_quick))
                    missed.push_back(
                        fmt::format("{} {}, {}: {}", dimension.name, value, Detectors::names[which], target));
        }
    }
    std::printf(
        "\ntargets: each tracker finds at least as many as both libraries; noise of corners no larger; p99 at most "
        "1.3 of the bound's; covered 90 to 98 %%%s\n",
        is_quick ? " (only the first is checked for so few pictures)" : "");
    for (const std::string &target : missed)
        std::printf("missed: %s\n", target.c_str());
    return missed.empty() ? 0 : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "tracking-conditions: %s\n", error.what());
    return 1;
}
