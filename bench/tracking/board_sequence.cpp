// SPDX-License-Identifier: Apache-2.0
//
// The pose of a board of tags on a real sequence: core/pose/ with the corners of tracker_apriltag, compared with
// bare OpenCV and bare AprilTag on the same frames, and the map of `arhost map` compared with the nominal layout.
#include "bare_detectors.hpp"
#include "map/learning.hpp"
#include "pose/track.hpp"

#include <fiducial/rbt_sequence.hpp>

#include <apriltag_pose.h>
#include <opencv2/calib3d.hpp>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <memory>
#include <numbers>

namespace {

using namespace arhost;
using pose::Estimate;
using pose::ObservedMarker;
using pose::Rigid;
using test::RbtSequence;

constexpr double degree = std::numbers::pi / 180;
constexpr double corner_sigma_px = 1; // includes the errors of the board's layout, which is known only roughly

// The frames that are evaluated.
struct Selection {
    std::size_t first = 0, step = 1;
};

std::array<Eigen::Vector3d, 4> on_board(int id) {
    std::array<Eigen::Vector3d, 4> corners;
    const auto flat = RbtSequence::on_board_mm(id);
    std::ranges::transform(flat, corners.begin(), [](cv::Point2d p) { return Eigen::Vector3d(p.x, p.y, 0); });
    return corners;
}

Rigid reference(const RbtSequence &sequence, std::size_t frame) {
    const auto &rows = sequence.camera_from_board(frame);
    Rigid pose;
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column)
            pose.rotation(row, column) = rows[row][column];
        pose.translation_mm[row] = 1000 * rows[row][3].get<double>();
    }
    return pose;
}

// Poses of the board by frame; nothing where a method finds none.
using Poses = std::vector<std::optional<Rigid>>;

struct Results {
    Poses poses;
    std::vector<double> left_out_px; // reprojection error of corners that the pose was not computed from
};

std::vector<map::Frame> detect(const RbtSequence &sequence) {
    test::Tracker tracker("tracker_apriltag", {{"quad_decimate", "1"}});
    std::vector<map::Frame> frames;
    for (const auto &found : sequence.run(tracker)) {
        map::Frame &frame = frames.emplace_back();
        for (const auto &[id, marker] : found) {
            map::Detection &detection = frame.detections.emplace_back();
            detection.id = id;
            for (int i = 0; i < 4; ++i)
                detection.corners_px[i] = {marker.corners_px[i][0], marker.corners_px[i][1]};
        }
    }
    return frames;
}

// Corners of the tags on the board, by id.
using Layout = std::map<int, std::array<Eigen::Vector3d, 4>>;

Layout nominal_layout(const RbtSequence &sequence) {
    Layout layout;
    for (const int id : sequence.ids())
        layout[id] = on_board(id);
    return layout;
}

// Learns the layout from the even frames, and moves it without scaling to where the nominal layout is.
Layout learned_layout(const RbtSequence &sequence, const std::vector<map::Frame> &frames) {
    std::vector<map::Frame> even;
    for (std::size_t k = 0; k < frames.size(); k += 2)
        even.push_back(frames[k]);
    map::Settings settings;
    for (const int id : sequence.ids())
        settings.sides_mm[id] = RbtSequence::side_mm;
    const map::Map learned = map::learn(even, RbtSequence::camera(), settings);
    std::printf("the map learned from the even frames: %zu tags, RMS %.3f px\n", learned.markers.size(),
                learned.rms_px);
    Eigen::Matrix3Xd from(3, 4 * learned.markers.size()), to(from);
    Eigen::Index at = 0;
    for (const map::LearnedMarker &marker : learned.markers)
        for (int i = 0; i < 4; ++i, ++at) {
            from.col(at) = marker.map_from_marker * pose::square_corners_mm(marker.side_mm)[i];
            to.col(at) = on_board(marker.id)[i];
        }
    const Eigen::Matrix4d board_from_map = Eigen::umeyama(from, to, false);
    Layout layout;
    at = 0;
    for (const map::LearnedMarker &marker : learned.markers)
        for (int i = 0; i < 4; ++i, ++at)
            layout[marker.id][i] = (board_from_map * from.col(at).homogeneous()).head<3>();
    return layout;
}

Results with_core_pose(const std::vector<map::Frame> &frames, const Layout &layout, Selection selection) {
    const pose::Projection projection(RbtSequence::camera());
    Results results;
    results.poses.resize(frames.size());
    pose::Track track{};
    for (std::size_t k = selection.first; k < frames.size(); k += selection.step) {
        std::vector<ObservedMarker> markers;
        for (const map::Detection &detection : frames[k].detections)
            if (const auto on_layout = layout.find(detection.id); on_layout != layout.end())
                markers.push_back({on_layout->second, detection.corners_px, corner_sigma_px});
        const auto poses = estimate_poses(markers, projection);
        if (poses.empty())
            continue;
        const pose::Step step = next_step(track, poses, 33'333'333 * static_cast<std::int64_t>(k + 1));
        track = step.track;
        results.poses[k] = poses[step.chosen].camera_from_target;
        for (std::size_t left_out = 0; left_out < markers.size(); ++left_out) {
            std::vector<ObservedMarker> others = markers;
            others.erase(others.begin() + static_cast<std::ptrdiff_t>(left_out));
            const auto without = estimate_poses(others, projection);
            for (int i = 0; !without.empty() && i < 4; ++i)
                results.left_out_px.push_back(
                    (*projection.pixel(without[0].camera_from_target * markers[left_out].corners_on_target_mm[i]) -
                     markers[left_out].corners_px[i])
                        .norm());
        }
    }
    return results;
}

cv::Matx33d camera_matrix() {
    const arhost_intrinsics c = RbtSequence::camera();
    return {c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1};
}

// detectMarkers with sub-pixel corners, and solvePnP with all of them.
Poses with_opencv(const RbtSequence &sequence) {
    const bench::BareOpenCv detect(true);
    Poses poses;
    for (const test::GreyFrame &frame : sequence.frames()) {
        std::vector<cv::Point3d> object;
        std::vector<cv::Point2d> image;
        for (const auto &[id, corners] : detect(frame))
            if (std::ranges::count(sequence.ids(), id))
                for (std::size_t i = 0; i < corners.size(); ++i) {
                    const cv::Point2d on_board = RbtSequence::on_board_mm(id)[i];
                    object.emplace_back(on_board.x, on_board.y, 0);
                    image.push_back(corners[i]);
                }
        cv::Vec3d r, t;
        if (object.empty() || !cv::solvePnP(object, image, camera_matrix(), cv::noArray(), r, t)) {
            poses.emplace_back();
            continue;
        }
        poses.emplace_back(Rigid{pose::rotation_by({r[0], r[1], r[2]}), {t[0], t[1], t[2]}});
    }
    return poses;
}

// estimate_tag_pose of the tag with the smallest id: the library has no boards.
Poses with_apriltag(const RbtSequence &sequence) {
    const std::unique_ptr<apriltag_family_t, decltype(&tag36h11_destroy)> family(tag36h11_create(), tag36h11_destroy);
    const std::unique_ptr<apriltag_detector_t, decltype(&apriltag_detector_destroy)> detector(
        apriltag_detector_create(), apriltag_detector_destroy);
    detector->quad_decimate = 1;
    apriltag_detector_add_family(detector.get(), family.get());
    const arhost_intrinsics camera = RbtSequence::camera();
    Poses poses;
    for (const test::GreyFrame &frame : sequence.frames()) {
        const cv::Mat pixels = bench::grey_of(frame);
        image_u8_t image{pixels.cols, pixels.rows, static_cast<int>(pixels.step), pixels.data};
        const std::unique_ptr<zarray_t, decltype(&apriltag_detections_destroy)> tags(
            apriltag_detector_detect(detector.get(), &image), apriltag_detections_destroy);
        apriltag_detection_t *first = nullptr;
        for (int i = 0; i < zarray_size(tags.get()); ++i) {
            apriltag_detection_t *tag = nullptr;
            zarray_get(tags.get(), i, &tag);
            if (std::ranges::count(sequence.ids(), tag->id) && (!first || tag->id < first->id))
                first = tag;
        }
        if (!first) {
            poses.emplace_back();
            continue;
        }
        // The library's pixel centres are at +0.5.
        apriltag_detection_info_t info{first,     RbtSequence::side_mm, camera.fx,
                                       camera.fy, camera.cx + 0.5,      camera.cy + 0.5};
        apriltag_pose_t found{};
        estimate_tag_pose(&info, &found);
        Rigid camera_from_tag; // tag axes: x right, y down, z into the paper
        for (int row = 0; row < 3; ++row) {
            for (int column = 0; column < 3; ++column)
                camera_from_tag.rotation(row, column) = MATD_EL(found.R, row, column);
            camera_from_tag.translation_mm[row] = MATD_EL(found.t, row, 0);
        }
        std::free(found.R); // as matd_destroy does, which Debian's library does not export
        std::free(found.t);
        const auto corners = on_board(first->id);
        Rigid board_from_tag;
        board_from_tag.rotation.col(0) = (corners[1] - corners[0]).normalized();
        board_from_tag.rotation.col(1) = (corners[3] - corners[0]).normalized();
        board_from_tag.rotation.col(2) = board_from_tag.rotation.col(0).cross(board_from_tag.rotation.col(1));
        board_from_tag.translation_mm = (corners[0] + corners[2]) / 2;
        poses.emplace_back(camera_from_tag * board_from_tag.inverse());
    }
    return poses;
}

struct Summary {
    double degrees, mm;                // median error against the reference
    double virtual_px, virtual_p95_px; // frame-to-frame error of a virtual point
    int flips, missing;
};

Summary summarize(const RbtSequence &sequence, const Poses &poses, Selection selection) {
    const pose::Projection projection(RbtSequence::camera());
    const Eigen::Vector3d above_board(287.75, 227.75, 50);
    std::vector<double> degrees, mm, steps;
    Eigen::Vector2d last = Eigen::Vector2d::Zero();
    bool has_last = false;
    Summary summary{};
    for (std::size_t k = selection.first; k < poses.size(); k += selection.step) {
        if (!poses[k]) {
            ++summary.missing;
            has_last = false;
            continue;
        }
        const Rigid truth = reference(sequence, k);
        degrees.push_back(pose::angle_between_rad(poses[k]->rotation, truth.rotation) / degree);
        mm.push_back((poses[k]->translation_mm - truth.translation_mm).norm());
        summary.flips += degrees.back() > 20;
        const Eigen::Vector2d error =
            *projection.pixel(*poses[k] * above_board) - *projection.pixel(truth * above_board);
        if (has_last)
            steps.push_back((error - last).norm());
        last = error;
        has_last = true;
    }
    summary.degrees = test::percentile(degrees, 0.5);
    summary.mm = test::percentile(mm, 0.5);
    summary.virtual_px = test::percentile(steps, 0.5);
    summary.virtual_p95_px = test::percentile(steps, 0.95);
    return summary;
}

Summary print(const char *name, const RbtSequence &sequence, const Poses &poses, Selection selection = {}) {
    const Summary s = summarize(sequence, poses, selection);
    std::printf("%-34s %8.2f %8.2f %10.3f %10.3f %6d %8d\n", name, s.degrees, s.mm, s.virtual_px, s.virtual_p95_px,
                s.flips, s.missing);
    return s;
}

} // namespace

int main() try {
    const auto folder = test::shared_data("markers/rbt_sequence");
    if (!std::filesystem::exists(folder)) {
        std::printf("skipped: the folder %s is missing (set ARHOST_SHARED_DATA)\n", folder.c_str());
        return 0;
    }
    const RbtSequence sequence;
    std::printf("a board of 20 tags, 40 frames 640x480: median error against the reference pose, and frame-to-frame "
                "error of a point 50 mm above the board\n%-34s %8s %8s %10s %10s %6s %8s\n",
                "", "degrees", "mm", "point p50", "p95, px", "flips", "missing");
    const std::vector<map::Frame> frames = detect(sequence);
    const Layout nominal = nominal_layout(sequence);
    const Results own = with_core_pose(frames, nominal, {});
    const Summary s = print("arhost: joint pose of the board", sequence, own.poses);
    print("OpenCV: detectMarkers, solvePnP", sequence, with_opencv(sequence));
    print("AprilTag: pose of the first tag", sequence, with_apriltag(sequence));
    const auto print_left_out = [](const char *name, const Results &results) {
        std::printf("%s: corners of a tag that is left out reproject with an error of %.3f px (p50), %.3f px (p95)\n",
                    name, test::percentile(results.left_out_px, 0.5), test::percentile(results.left_out_px, 0.95));
        return test::percentile(results.left_out_px, 0.5);
    };
    print_left_out("arhost", own);
    constexpr Selection odd{1, 2};
    const Results with_nominal = with_core_pose(frames, nominal, odd),
                  with_learned = with_core_pose(frames, learned_layout(sequence, frames), odd);
    print("odd frames: nominal layout", sequence, with_nominal.poses, odd);
    print("odd frames: map of the even frames", sequence, with_learned.poses, odd);
    print_left_out("odd frames, nominal layout", with_nominal);
    const double left_out = print_left_out("odd frames, map of the even frames", with_learned);
    return s.degrees <= 0.2 && s.mm <= 1.3 && s.virtual_px <= 0.1 && s.virtual_p95_px <= 0.8 && s.flips == 0 &&
                   s.missing == 0 && left_out <= 0.2
               ? 0
               : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "board-sequence: %s\n", error.what());
    return 1;
}
