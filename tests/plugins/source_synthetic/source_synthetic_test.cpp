// SPDX-License-Identifier: Apache-2.0
#include <fiducial/aruco.hpp>
#include <plugin_under_test.hpp>

#include <gmock/gmock.h>

#include <apriltag.h>
#include <tag16h5.h>
#include <tag25h9.h>
#include <tag36h10.h>
#include <tag36h11.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

namespace {

using arhost::test::GuardedBuffer;
using arhost::test::PluginUnderTest;
using Options = std::map<std::string, std::string>;
using Corners =
    std::array<cv::Point2d, 4>; // order in the upright print: top left, top right, bottom right, bottom left
using testing::HasSubstr;

arhost_intrinsics camera_of(int width, int height, double focal, double cx, double cy,
                            arhost_distortion distortion = ARHOST_DISTORTION_NONE,
                            const std::vector<double> &coefficients = {}) {
    arhost_intrinsics camera{};
    camera.struct_size = sizeof camera;
    camera.width = static_cast<uint32_t>(width);
    camera.height = static_cast<uint32_t>(height);
    camera.fx = camera.fy = focal;
    camera.cx = cx;
    camera.cy = cy;
    camera.distortion = distortion;
    camera.coefficient_count = static_cast<uint32_t>(coefficients.size());
    std::copy(coefficients.begin(), coefficients.end(), camera.coefficients);
    return camera;
}

// The images are small, to keep the tests fast.
const std::vector<double> brown4{-0.21, 0.11, 0.0015, -0.001};
const arhost_intrinsics small_camera = camera_of(640, 480, 560, 330.2, 231.7, ARHOST_DISTORTION_BROWN, brown4);
const arhost_intrinsics quick_camera = camera_of(320, 240, 280, 164.8, 115.6, ARHOST_DISTORTION_BROWN, brown4);

struct Frame {
    arhost_status status;
    cv::Mat picture; // BGR
    arhost_frame_info info;
    bool intact;
};

class Source {
public:
    explicit Source(const Options &options = {}, const arhost_intrinsics *camera = &quick_camera, bool paced = false,
                    double fps = 0)
        : plugin_("source_synthetic") {
        const arhost_source_setup setup{.struct_size = sizeof setup,
                                        .reserved = 0,
                                        .first_sequence = 0,
                                        .fps = fps,
                                        .paced = paced,
                                        .reserved_2 = 0,
                                        .intrinsics = camera};
        properties_.struct_size = sizeof properties_;
        properties_.format.struct_size = sizeof properties_.format;
        if (plugin_.create(options) != ARHOST_STATUS_OK ||
            functions().start(plugin_.instance(), &setup, &properties_) != ARHOST_STATUS_OK)
            throw std::runtime_error(plugin_.log());
    }
    ~Source() { functions().stop(plugin_.instance()); }
    void cancel(int after) { plugin_.cancel(after); }
    const arhost_source_properties &properties() const { return properties_; }

    Frame read(uint64_t sequence) {
        const arhost_frame_format &format = properties_.format;
        const GuardedBuffer slot(format.byte_size);
        arhost_frame_buffer buffer{};
        buffer.struct_size = sizeof buffer;
        buffer.format = &format;
        buffer.plane[0] = slot.data();
        buffer.grey = slot.data() + format.grey_offset;
        buffer.sequence = sequence;
        Frame frame{};
        frame.info.struct_size = sizeof frame.info;
        frame.status = functions().read(plugin_.instance(), &buffer, &frame.info);
        frame.picture = cv::Mat(static_cast<int>(format.height), static_cast<int>(format.width), CV_8UC3, slot.data(),
                                format.stride[0])
                            .clone();
        frame.intact = slot.intact();
        for (uint32_t y = 0; y < format.height; ++y) // row padding
            for (uint32_t x = 3 * format.width; x < format.stride[0]; ++x)
                frame.intact &= slot.data()[y * format.stride[0] + x] == 0xa5;
        for (uint64_t i = format.grey_offset; i < format.byte_size; ++i) // grey plane
            frame.intact &= slot.data()[i] == 0xa5;
        return frame;
    }

private:
    const arhost_source &functions() const { return plugin_.functions<arhost_source>(); }
    PluginUnderTest plugin_;
    arhost_source_properties properties_{};
};

bool same(const cv::Mat &a, const cv::Mat &b) {
    return a.size() == b.size() && cv::norm(a, b, cv::NORM_INF) == 0;
}

// Projects points of the marker's plane (x to the right, y up, in mm) to pixels with OpenCV.
std::vector<cv::Point2d> project(const Frame &frame, const arhost_intrinsics &camera,
                                 const std::vector<cv::Point3d> &points) {
    const double *m = frame.info.true_mt;
    const cv::Matx33d rotation(m[0], m[4], m[8], -m[1], -m[5], -m[9], -m[2], -m[6], -m[10]);
    cv::Vec3d turn;
    cv::Rodrigues(rotation, turn);
    const cv::Vec3d move(m[12], -m[13], -m[14]);
    const cv::Matx33d matrix(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
    const std::vector<double> coefficients(camera.coefficients, camera.coefficients + camera.coefficient_count);
    std::vector<cv::Point2d> pixels;
    if (camera.distortion == ARHOST_DISTORTION_FISHEYE)
        cv::fisheye::projectPoints(points, pixels, turn, move, matrix, coefficients);
    else
        cv::projectPoints(points, turn, move, matrix, coefficients, pixels);
    return pixels;
}

std::vector<cv::Point3d> corner_points(double side_mm) {
    const double h = side_mm / 2;
    return {{-h, h, 0}, {h, h, 0}, {h, -h, 0}, {-h, -h, 0}};
}

Corners true_corners(const Frame &frame, const arhost_intrinsics &camera, double side_mm) {
    const auto pixels = project(frame, camera, corner_points(side_mm));
    return {pixels[0], pixels[1], pixels[2], pixels[3]};
}

// Fits a straight line to each of the four sides, which the lens distorts, and returns the intersections of these
// lines. A detector that fits straight lines finds these intersections instead of the true corners.
Corners line_corners(const Frame &frame, const arhost_intrinsics &camera, double side_mm) {
    const auto corners = corner_points(side_mm);
    std::array<cv::Point3d, 4> lines; // in homogeneous coordinates
    for (int side = 0; side < 4; ++side) {
        std::vector<cv::Point3d> points;
        for (double t = 0.05; t < 0.96; t += 0.05)
            points.push_back(corners[side] + t * (corners[(side + 1) % 4] - corners[side]));
        cv::Vec4d line;
        cv::fitLine(project(frame, camera, points), line, cv::DIST_L2, 0, 1e-6, 1e-6);
        lines[side] = {-line[1], line[0], line[1] * line[2] - line[0] * line[3]};
    }
    Corners meet;
    for (int i = 0; i < 4; ++i) {
        const cv::Point3d p = lines[(i + 3) % 4].cross(lines[i]);
        meet[i] = {p.x / p.z, p.y / p.z};
    }
    return meet;
}

// Checks that a detector has found the marker at these corners.
void expect_found_at(const Corners &truth, const std::optional<Corners> &found, double tolerance_px) {
    ASSERT_TRUE(found);
    for (int i = 0; i < 4; ++i)
        EXPECT_LT(cv::norm((*found)[i] - truth[i]), tolerance_px) << "corner " << i;
}

cv::Mat grey_of(const cv::Mat &picture) {
    cv::Mat grey;
    cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
    return grey;
}

// Detects a tag with the AprilTag library.
std::optional<Corners> find_april_tag(const cv::Mat &picture, apriltag_family_t *family, int id) {
    cv::Mat grey = grey_of(picture);
    const std::unique_ptr<apriltag_detector_t, void (*)(apriltag_detector_t *)> detector(apriltag_detector_create(),
                                                                                         apriltag_detector_destroy);
    apriltag_detector_add_family(detector.get(), family);
    detector->quad_decimate = 1;
    image_u8_t image{grey.cols, grey.rows, static_cast<int32_t>(grey.step), grey.data};
    zarray_t *found = apriltag_detector_detect(detector.get(), &image);
    std::optional<Corners> corners;
    for (int i = 0; i < zarray_size(found); ++i) {
        apriltag_detection_t *detection;
        zarray_get(found, i, static_cast<void *>(&detection));
        if (detection->id != id)
            continue;
        Corners upright; // the library's first corner is the bottom left one; its pixel centres are at +0.5
        for (int k = 0; k < 4; ++k)
            upright[3 - k] = {detection->p[k][0] - 0.5, detection->p[k][1] - 0.5};
        corners = upright;
    }
    apriltag_detections_destroy(found);
    return corners;
}

std::optional<Corners> find_tag36h11(const cv::Mat &picture, int id = 0) {
    const std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t *)> family(tag36h11_create(),
                                                                                   tag36h11_destroy);
    return find_april_tag(picture, family.get(), id);
}

std::optional<Corners> find_aruco(const cv::Mat &picture, arhost::aruco::PredefinedDictionary dictionary, int id) {
    const auto [ids, corners, rejected] =
        arhost::aruco::detect(grey_of(picture), arhost::aruco::predefined(dictionary), {});
    for (std::size_t i = 0; i < ids.size(); ++i)
        if (ids[i] == id)
            return Corners{corners[i][0], corners[i][1], corners[i][2], corners[i][3]};
    return {};
}

// Measures the position of the border's outer edge without a detector. At many points along the four sides, returns
// the distance in px, positive outwards, of the edge in the image from its projection. The edge is at the position
// where a sharp step from black to white would give the same mean grey as the image.
std::vector<double> edge_offsets(const Frame &frame, const arhost_intrinsics &camera, double side_mm) {
    const cv::Mat grey = grey_of(frame.picture);
    const auto sample = [&](cv::Point2d p) {
        const int x = static_cast<int>(std::floor(p.x)), y = static_cast<int>(std::floor(p.y));
        const double a = p.x - x, b = p.y - y;
        const auto at = [&](int row, int column) { return static_cast<double>(grey.at<uint8_t>(row, column)); };
        return (1 - b) * ((1 - a) * at(y, x) + a * at(y, x + 1)) +
               b * ((1 - a) * at(y + 1, x) + a * at(y + 1, x + 1));
    };
    const auto corners = corner_points(side_mm);
    std::vector<cv::Point3d> points; // pairs of nearby points on a side
    for (int side = 0; side < 4; ++side)
        for (double t = 0.1; t < 0.91; t += 0.04)
            for (const double further : {0.0, 0.01})
                points.push_back(corners[side] + (t + further) * (corners[(side + 1) % 4] - corners[side]));
    const auto pixels = project(frame, camera, points);
    std::vector<double> offsets;
    for (std::size_t i = 0; i < pixels.size(); i += 2) {
        const cv::Point2d at = pixels[i], along = pixels[i + 1] - at;
        const cv::Point2d outwards = cv::Point2d(along.y, -along.x) / cv::norm(along);
        constexpr double range = 3.5, step = 0.05;
        const double black = sample(at - range * outwards), white = sample(at + range * outwards);
        double dark = 0;
        for (double n = -range + step / 2; n < range; n += step)
            dark += step * (white - sample(at + n * outwards)) / (white - black);
        offsets.push_back(dark - range);
    }
    return offsets;
}

// Mean error and mean offset of the corners over many frames.
struct Error {
    double mean_px = 0;
    cv::Point2d bias;
    int count = 0;
    void add(const Corners &found, const Corners &truth) {
        for (int i = 0; i < 4; ++i, ++count) {
            mean_px += cv::norm(found[i] - truth[i]);
            bias += found[i] - truth[i];
        }
    }
    void finish() {
        mean_px /= count;
        bias = bias / count;
    }
};

struct Lens {
    const char *name;
    arhost_intrinsics camera;
};
void PrintTo(const Lens &lens, std::ostream *out) {
    *out << lens.name;
}
class EveryLens : public testing::TestWithParam<Lens> {};
INSTANTIATE_TEST_SUITE_P(
    Lenses, EveryLens,
    testing::Values(Lens{"undistorted", camera_of(640, 480, 560, 319.5, 239.5)}, Lens{"brown4", small_camera},
                    Lens{"brown12", camera_of(641, 479, 540, 300.4, 250.1, ARHOST_DISTORTION_BROWN,
                                              {0.12, -0.08, 0.001, 0.0005, 0.02, 0.05, -0.01, 0.004, 0.001, -0.0004,
                                               -0.0007, 0.0002})},
                    Lens{"fisheye", camera_of(640, 480, 480, 315.3, 244.8, ARHOST_DISTORTION_FISHEYE,
                                              {0.03, -0.012, 0.004, -0.001})}),
    [](const auto &info) { return std::string(info.param.name); });

TEST_P(EveryLens, PlacesMarkerEdgesAtTheirProjection) {
    Source source(Options{{"frames", "0"}, {"noise", "0"}}, &GetParam().camera);
    double sum = 0, distance = 0;
    std::size_t count = 0;
    for (int sequence = 0; sequence < 300; sequence += 23)
        for (const double offset : edge_offsets(source.read(sequence), GetParam().camera, 80)) {
            sum += offset;
            distance += std::abs(offset);
            ++count;
        }
    EXPECT_LT(std::abs(sum / static_cast<double>(count)), 0.01);
    EXPECT_LT(distance / static_cast<double>(count), 0.03);
}

TEST_P(EveryLens, AprilTagLibraryFindsTheTrueCorners) {
    Source source(Options{{"frames", "0"}}, &GetParam().camera);
    Error error;
    for (int sequence = 5; sequence < 300; sequence += 37) {
        const Frame frame = source.read(sequence);
        const auto found = find_tag36h11(frame.picture);
        ASSERT_TRUE(found) << "frame " << sequence;
        ASSERT_EQ(frame.info.has_truth, 1);
        ASSERT_STREQ(frame.info.truth_target, "tag36h11-0");
        error.add(*found, line_corners(frame, GetParam().camera, 80));
        const Corners truth = true_corners(frame, GetParam().camera, 80);
        for (int i = 0; i < 4; ++i)
            EXPECT_LT(cv::norm((*found)[i] - truth[i]), 0.8) << "frame " << sequence << ", corner " << i;
    }
    error.finish();
    EXPECT_LT(error.mean_px, 0.15);
    EXPECT_LT(std::abs(error.bias.x), 0.05);
    EXPECT_LT(std::abs(error.bias.y), 0.05);
}

struct AprilFamily {
    const char *name;
    apriltag_family_t *(*create)();
    void (*destroy)(apriltag_family_t *);
};
class EveryAprilFamily : public testing::TestWithParam<AprilFamily> {};
INSTANTIATE_TEST_SUITE_P(Families, EveryAprilFamily,
                         testing::Values(AprilFamily{"tag36h11", tag36h11_create, tag36h11_destroy},
                                         AprilFamily{"tag36h10", tag36h10_create, tag36h10_destroy},
                                         AprilFamily{"tag25h9", tag25h9_create, tag25h9_destroy},
                                         AprilFamily{"tag16h5", tag16h5_create, tag16h5_destroy}),
                         [](const auto &info) { return std::string(info.param.name); });

void PrintTo(const AprilFamily &family, std::ostream *out) {
    *out << family.name;
}

TEST_P(EveryAprilFamily, IsPrintedUprightAsInAprilTagsLibrary) {
    Source source(Options{{"family", GetParam().name}, {"id", "7"}, {"path", "still"}});
    const Frame frame = source.read(0);
    const std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t *)> family(GetParam().create(),
                                                                                   GetParam().destroy);
    expect_found_at(true_corners(frame, quick_camera, 80), find_april_tag(frame.picture, family.get(), 7), 0.5);
    EXPECT_EQ(frame.info.truth_target, std::string(GetParam().name) + "-7");
}

class EveryDictionary : public testing::TestWithParam<std::pair<const char *, arhost::aruco::PredefinedDictionary>> {
};
INSTANTIATE_TEST_SUITE_P(Dictionaries, EveryDictionary,
                         testing::Values(std::pair{"DICT_4X4_50", cv::aruco::DICT_4X4_50},
                                         std::pair{"DICT_5X5_100", cv::aruco::DICT_5X5_100},
                                         std::pair{"DICT_6X6_250", cv::aruco::DICT_6X6_250},
                                         std::pair{"DICT_7X7_1000", cv::aruco::DICT_7X7_1000},
                                         std::pair{"DICT_ARUCO_ORIGINAL", cv::aruco::DICT_ARUCO_ORIGINAL}),
                         [](const auto &info) { return std::string(info.param.first); });

TEST_P(EveryDictionary, IsPrintedUprightAsInOpenCv) {
    Source source(Options{{"family", GetParam().first}, {"id", "23"}, {"path", "still"}});
    const Frame frame = source.read(0);
    expect_found_at(true_corners(frame, quick_camera, 80), find_aruco(frame.picture, GetParam().second, 23),
                    1.5); // the detector does not refine corners
}

TEST(SourceSynthetic, NamesTheTargetOfTheTruth) {
    const std::string longest(ARHOST_MAX_NAME - 1, 'a');
    EXPECT_EQ(Source(Options{{"target", longest}}).read(0).info.truth_target, longest);
    EXPECT_STREQ(Source(Options{{"family", "DICT_4X4_50"}, {"id", "3"}}).read(0).info.truth_target, "DICT_4X4_50-3");
}

TEST(SourceSynthetic, KeepsTheWholeMarkerInViewOnEveryPath) {
    for (const char *path : {"orbit", "still", "approach"}) {
        Source source({{"path", path}, {"frames", "0"}, {"fps", "5"}, {"width", "320"}, {"height", "180"}}, nullptr);
        for (int sequence = 0; sequence < 50; sequence += 2) {
            const Frame frame = source.read(sequence);
            for (const cv::Point2d corner : true_corners(frame, source.properties().intrinsics, 80))
                EXPECT_TRUE(corner.x > 10 && corner.y > 10 && corner.x < 310 && corner.y < 170) << path << sequence;
            const double *m = frame.info.true_mt;
            const double distance = std::hypot(m[12], m[13], m[14]);
            EXPECT_TRUE(distance > 345 && distance < 705) << path << distance;
            const double cosine = (m[8] * -m[12] + m[9] * -m[13] + m[10] * -m[14]) / distance;
            const double tilt = std::acos(cosine) * 180 / CV_PI;
            EXPECT_TRUE(tilt > 25 && tilt < 60) << path << tilt;
        }
    }
}

TEST(SourceSynthetic, ClosesThePathAfterThePeriod) {
    Source source(Options{{"frames", "0"}, {"period", "2"}, {"fps", "25"}});
    const Frame first = source.read(3), again = source.read(53);
    for (int i = 0; i < 16; ++i)
        EXPECT_NEAR(first.info.true_mt[i], again.info.true_mt[i], 1e-9);
}

TEST(SourceSynthetic, PosesAreRigid) {
    Source source(Options{{"frames", "0"}});
    const auto info = source.read(77).info;
    const double *m = info.true_mt;
    const cv::Matx33d r(m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]);
    EXPECT_LT(cv::norm(r * r.t() - cv::Matx33d::eye()), 1e-12);
    EXPECT_NEAR(cv::determinant(r), 1, 1e-12);
    EXPECT_EQ(m[3], 0);
    EXPECT_EQ(m[7], 0);
    EXPECT_EQ(m[11], 0);
    EXPECT_EQ(m[15], 1);
}

TEST(SourceSynthetic, ScalesTheSceneWithTheMarkerSide) {
    Source small, large(Options{{"side_mm", "160"}});
    const Frame a = small.read(4), b = large.read(4);
    for (int i = 12; i < 15; ++i)
        EXPECT_NEAR(2 * a.info.true_mt[i], b.info.true_mt[i], 1e-9);
    expect_found_at(true_corners(b, quick_camera, 160), find_tag36h11(b.picture), 0.5);
}

TEST(SourceSynthetic, FramesDependOnNeitherOrderNorThreads) {
    Source forwards(Options{{"frames", "0"}}), backwards(Options{{"frames", "0"}, {"threads", "3"}});
    std::vector<cv::Mat> pictures;
    for (int sequence = 0; sequence < 4; ++sequence) {
        const Frame frame = forwards.read(sequence);
        ASSERT_EQ(frame.status, ARHOST_STATUS_OK);
        pictures.push_back(frame.picture);
    }
    for (int sequence = 3; sequence >= 0; --sequence)
        EXPECT_TRUE(same(backwards.read(sequence).picture, pictures[sequence])) << sequence;
    EXPECT_FALSE(same(pictures[0], pictures[1]));
}

TEST(SourceSynthetic, AddsNewNoiseToEveryFrameUnlessDisabled) {
    Source noisy(Options{{"path", "still"}}), clean(Options{{"path", "still"}, {"noise", "0"}});
    const cv::Mat a = noisy.read(0).picture, b = noisy.read(1).picture;
    cv::Mat difference;
    cv::absdiff(a, b, difference);
    const double mean = cv::mean(difference)[1];
    EXPECT_GT(mean, 0.5);
    EXPECT_LT(mean, 5);
    EXPECT_TRUE(same(clean.read(0).picture, clean.read(1).picture));
}

TEST(SourceSynthetic, SeedSelectsTheNoise) {
    Source one, other(Options{{"seed", "2"}}), clean(Options{{"noise", "0"}}),
        clean_other({{"noise", "0"}, {"seed", "2"}});
    EXPECT_FALSE(same(one.read(0).picture, other.read(0).picture));
    EXPECT_TRUE(same(clean.read(0).picture, clean_other.read(0).picture));
}

TEST(SourceSynthetic, ExposureBrightensAndBlurSoftens) {
    const auto picture = [](const Options &options) { return Source(options).read(0).picture; };
    const auto brightness = [](const cv::Mat &m) { return cv::mean(grey_of(m))[0]; };
    const auto sharpness = [](const cv::Mat &m) {
        cv::Mat edges;
        cv::Laplacian(grey_of(m), edges, CV_64F);
        return cv::norm(edges);
    };
    const cv::Mat normal = picture({{"noise", "0"}}), bright = picture({{"noise", "0"}, {"exposure_ev", "0.7"}}),
                  blurred = picture({{"noise", "0"}, {"blur_px", "2"}}),
                  sharp = picture({{"noise", "0"}, {"blur_px", "0"}});
    EXPECT_GT(brightness(bright), brightness(normal) + 20);
    EXPECT_NEAR(brightness(blurred), brightness(normal), 1);
    EXPECT_LT(sharpness(blurred), 0.6 * sharpness(normal));
    EXPECT_GT(sharpness(sharp), 1.1 * sharpness(normal));
}

TEST(SourceSynthetic, MotionBlurKeepsTheTruePoseAtTheMiddleOfTheExposure) {
    const Options fast{{"period", "1.5"}, {"noise", "0"}};
    Options smeared = fast;
    smeared["motion_blur"] = "0.6";
    Source sharp(fast), blurred(smeared);
    const Frame a = sharp.read(5), b = blurred.read(5);
    EXPECT_TRUE(std::equal(a.info.true_mt, a.info.true_mt + 16, b.info.true_mt));
    EXPECT_GT(cv::norm(a.picture, b.picture, cv::NORM_L1) / static_cast<double>(3 * a.picture.total()), 1.0);
    EXPECT_NEAR(cv::mean(grey_of(a.picture))[0], cv::mean(grey_of(b.picture))[0], 1.5);
}

TEST(SourceSynthetic, CardCoversTheMarkerInTheConfiguredFrames) {
    Source source(Options{{"occlude_from", "30"}, {"occlude_to", "34"}});
    for (const int sequence : {0, 15, 48})
        EXPECT_TRUE(find_tag36h11(source.read(sequence).picture)) << sequence;
    for (const int sequence : {30, 32, 33}) {
        const Frame frame = source.read(sequence);
        EXPECT_FALSE(find_tag36h11(frame.picture)) << sequence;
        EXPECT_EQ(frame.info.has_truth, 1); // the source still reports the true pose
    }
    Source bare;
    EXPECT_TRUE(same(source.read(15).picture, bare.read(15).picture));
    EXPECT_FALSE(same(source.read(25).picture, bare.read(25).picture)); // the card slides in
}

TEST(SourceSynthetic, EndsAfterItsFramesEvenIfReadAgain) {
    Source source(Options{{"frames", "3"}});
    EXPECT_EQ(source.properties().frame_count, 3u);
    EXPECT_EQ(source.read(2).status, ARHOST_STATUS_OK);
    EXPECT_EQ(source.read(3).status, ARHOST_STATUS_END);
    EXPECT_EQ(source.read(3).status, ARHOST_STATUS_END);
    EXPECT_EQ(source.read(0).status, ARHOST_STATUS_OK);
}

TEST(SourceSynthetic, ReportsTheExactMediaTimeOfEachFrame) {
    Source source(Options{{"frames", "0"}}, &quick_camera, false, 29.97);
    EXPECT_EQ(source.properties().format.fps, 29.97);
    for (const int64_t sequence : {0, 1, 2, 1000}) {
        const Frame frame = source.read(sequence);
        EXPECT_EQ(frame.info.clock, ARHOST_CLOCK_MEDIA);
        EXPECT_EQ(frame.info.capture_ns, std::llround(static_cast<double>(sequence) * 1e9 / 29.97));
        EXPECT_EQ(frame.info.skipped, 0u);
    }
}

TEST(SourceSynthetic, DefaultCameraMatchesItsFrames) {
    Source source(Options{{"width", "800"}, {"height", "450"}}, nullptr);
    const arhost_source_properties &properties = source.properties();
    ASSERT_EQ(properties.has_intrinsics, 1);
    EXPECT_EQ(properties.intrinsics.width, 800u);
    EXPECT_EQ(properties.format.height, 450u);
    EXPECT_EQ(properties.format.pixel_format, ARHOST_PIXEL_FORMAT_BGR8);
    EXPECT_EQ(properties.intrinsics.distortion, ARHOST_DISTORTION_BROWN);
    const Frame frame = source.read(40);
    expect_found_at(true_corners(frame, properties.intrinsics, 80), find_tag36h11(frame.picture), 0.3);
}

class EverySize : public testing::TestWithParam<std::pair<int, int>> {};
INSTANTIATE_TEST_SUITE_P(Sizes, EverySize,
                         testing::Values(std::pair{1, 1}, std::pair{1, 37}, std::pair{53, 1}, std::pair{2, 3},
                                         std::pair{15, 17}, std::pair{16, 16}, std::pair{127, 93},
                                         std::pair{1285, 11}),
                         [](const auto &info) {
                             return std::to_string(info.param.first) + "x" + std::to_string(info.param.second);
                         });

TEST_P(EverySize, FillsTheFrameAndNothingBeyondIt) {
    const auto [width, height] = GetParam();
    for (const char *blur : {"0", "0.5", "7"}) {
        const arhost_intrinsics camera = camera_of(width, height, std::max(width, height), (width - 1) / 2.0,
                                                   (height - 1) / 2.0, ARHOST_DISTORTION_BROWN, {-0.05, 0.01, 0, 0});
        Source source(Options{{"blur_px", blur}, {"occlude_from", "0"}, {"occlude_to", "1"}}, &camera);
        for (const int sequence : {0, 12}) {
            const Frame frame = source.read(sequence);
            ASSERT_EQ(frame.status, ARHOST_STATUS_OK);
            EXPECT_TRUE(frame.intact);
            // The slot initially contains 0xa5 in all channels. Few pixels may have this colour if the source writes
            // all pixels.
            cv::Mat unwritten;
            cv::inRange(frame.picture, cv::Scalar::all(0xa5), cv::Scalar::all(0xa5), unwritten);
            EXPECT_LE(cv::countNonZero(unwritten), 2 + static_cast<int>(frame.picture.total()) / 50);
        }
    }
}

TEST(SourceSynthetic, IsBlackWhereNoLightPassesTheLens) {
    // The fisheye polynomial is not monotonic beyond 1.2 rad. The circle at this angle is inside the image, so the
    // pixels beyond it have no ray.
    const arhost_intrinsics camera =
        camera_of(640, 480, 200, 319.5, 239.5, ARHOST_DISTORTION_FISHEYE, {-0.23, 0, 0, 0});
    Source source(Options{{"noise", "0"}}, &camera);
    const Frame frame = source.read(0);
    EXPECT_LT(cv::mean(frame.picture(cv::Rect(0, 0, 40, 40)))[1], 1);
    EXPECT_TRUE(find_tag36h11(frame.picture));
}

TEST(SourceSynthetic, RejectsInvalidOptionsByName) {
    const auto expect_rejected = [](const Options &options, const std::string &message) {
        PluginUnderTest plugin("source_synthetic");
        EXPECT_EQ(plugin.create(options), ARHOST_STATUS_ERROR_CONFIGURATION);
        EXPECT_EQ(plugin.instance(), nullptr);
        EXPECT_THAT(plugin.log(), HasSubstr(message));
    };
    expect_rejected({{"side_mm", "0"}}, "side_mm");
    expect_rejected({{"side_mm", "-80"}}, "side_mm");
    expect_rejected({{"side_mm", "nan"}}, "side_mm");
    expect_rejected({{"family", "tag99h1"}}, "family: unknown 'tag99h1'");
    expect_rejected({{"id", "587"}}, "id: tag36h11 has the ids 0 to 586, not 587");
    expect_rejected({{"id", "-1"}}, "id: tag36h11 has the ids 0 to 586, not -1");
    expect_rejected({{"family", "DICT_4X4_50"}, {"id", "50"}}, "id: DICT_4X4_50 has the ids 0 to 49, not 50");
    expect_rejected({{"target", std::string(64, 'a')}},
                    "target: has 64 characters; the name of a target has at most 63");
    expect_rejected({{"period", "0"}}, "period");
    expect_rejected({{"fps", "0"}}, "fps");
    expect_rejected({{"occlude_from", "20"}}, "occlude_to");
    expect_rejected({{"occlude_from", "20"}, {"occlude_to", "20"}}, "occlude_to");
}

TEST(SourceSynthetic, DeclaresThatItCanSeek) {
    const PluginUnderTest plugin("source_synthetic");
    EXPECT_TRUE(plugin.descriptor().capabilities & ARHOST_SOURCE_CAPABILITY_SEEK);
    EXPECT_STREQ(plugin.descriptor().id, "org.arhost.source_synthetic");
}

const arhost_intrinsics tiny_camera = camera_of(64, 48, 60, 31.5, 23.5);

TEST(SourceSynthetic, WaitsForEachFrameWhenPaced) {
    Source source(Options{{"frames", "0"}}, &tiny_camera, true, 20);
    const auto begin = std::chrono::steady_clock::now();
    uint64_t ahead = 0;
    for (int sequence = 0; sequence < 5; ++sequence) {
        const Frame frame = source.read(sequence + ahead);
        ASSERT_EQ(frame.status, ARHOST_STATUS_OK);
        ahead += frame.info.skipped;
        // capture_ns is the media time, and no frame may arrive before this time.
        EXPECT_EQ(frame.info.capture_ns, std::llround(static_cast<double>(sequence + ahead) * 1e9 / 20));
        EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::nanoseconds(frame.info.capture_ns));
    }
}

TEST(SourceSynthetic, SkipsFramesIfTheReaderIsLate) {
    Source source(Options{{"frames", "0"}}, &tiny_camera, true, 1e6); // no read takes less than a microsecond
    ASSERT_EQ(source.read(0).status, ARHOST_STATUS_OK);
    const Frame late = source.read(1);
    EXPECT_GE(late.info.skipped, 5u);
    EXPECT_EQ(late.info.capture_ns, static_cast<int64_t>(1 + late.info.skipped) * 1'000);
}

TEST(SourceSynthetic, StopsWaitingWhenCancelled) {
    Source source(Options{{"frames", "0"}}, &tiny_camera, true, 0.01);
    ASSERT_EQ(source.read(0).status, ARHOST_STATUS_OK);
    source.cancel(3);                                                // while it waits
    EXPECT_EQ(source.read(1).status, ARHOST_STATUS_ERROR_CANCELLED); // frame 1 is due after 100 s
}

} // namespace
