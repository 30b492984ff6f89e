// SPDX-License-Identifier: Apache-2.0
#include "camera/calibration.hpp"

#include "artoolkit_bytes.hpp"
#include "camera/coordinates.hpp"
#include "camera/lens_model.hpp"
#include "errors.hpp"
#include "plugin_under_test.hpp"

#include <directories.hpp>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include <fstream>
#include <vector>

namespace arhost::camera {
namespace {

using test::error_of;

class Calibration : public testing::Test {
protected:
    std::filesystem::path write(const std::string &text) const {
        std::ofstream(folder_.path() / "camera.yaml", std::ios::binary) << text;
        return folder_.path() / "camera.yaml";
    }
    // Returns the error message for a calibration file with the contents `text`, without the name of the file.
    std::string error_in(const std::string &text, std::optional<Size> expected = {},
                         const std::optional<std::string> &name = {}) const {
        const auto file = write(text);
        return test::after(file.string() + ":", error_of([&] { read_calibration(file, expected, name); }));
    }
    test::ScratchFolder folder_;
};

std::vector<double> coefficients(const arhost_intrinsics &intrinsics) {
    return {intrinsics.coefficients, intrinsics.coefficients + intrinsics.coefficient_count};
}

arhost_intrinsics parsed(const std::string &text) {
    return parse_camera(yaml::Node::parse(text, "lab.yaml"));
}

// Returns the error message without the name of the file.
std::string error_in_block(const std::string &text) {
    return test::after("lab.yaml:", error_of([&] { parsed(text); }));
}

// Returns a calibration file that ends with `lines`, which describe the distortion.
std::string with_distortion(const std::string &lines) {
    return "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n"
           "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
           "   data: [ 600., 0., 320., 0., 601., 240., 0., 0., 1. ]\n" +
           lines;
}

const std::string no_distortion = "distortion_coefficients: [0, 0, 0, 0]\n";

// Returns a calibration as ROS's camera_calibration writes it.
std::string ros(const std::string &model, const std::string &coefficients) {
    return "image_width: 640\nimage_height: 480\ncamera_name: narrow_stereo\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
           "  data: [600.5, 0, 320, 0, 601, 240, 0, 0, 1]\ndistortion_model: " +
           model + "\ndistortion_coefficients:\n  rows: 1\n  cols: " +
           std::to_string(std::count(coefficients.begin(), coefficients.end(), ',') + 1) + "\n  data: [" +
           coefficients +
           "]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
           "projection_matrix:\n  rows: 3\n  cols: 4\n  data: [590, 0, 322, 0, 0, 590, 241, 0, 0, 0, 1, 0]\n";
}

// Returns one camera of a camchain as Kalibr writes it.
std::string kalibr(const std::string &name, const std::string &model, const std::string &distortion_model,
                   const std::string &coefficients) {
    return name + ":\n  cam_overlaps: [1]\n  camera_model: " + model + "\n  distortion_coeffs: [" + coefficients +
           "]\n  distortion_model: " + distortion_model +
           "\n  intrinsics: [600.5, 601, 320, 240]\n  resolution: [640, 480]\n  rostopic: /" + name + "/image_raw\n";
}

const std::vector<cv::Point3d> points = {{0, 0, 1}, {0.5, 0.4, 1}, {-500, 300, 1000}, {0.1, -0.4, 1}, {-1, -1, 4}};
const cv::Matx33d opencv_matrix(600.5, 0, 320, 0, 601, 240, 0, 0, 1); // of `ros` and `kalibr`

void expect_projection(const std::vector<cv::Point2d> &expected, const arhost_intrinsics &intrinsics) {
    EXPECT_EQ(intrinsics.width, 640u);
    EXPECT_EQ(intrinsics.height, 480u);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const auto pixel = project(intrinsics, {points[i].x, points[i].y, points[i].z});
        EXPECT_NEAR(pixel->x, expected[i].x, 1e-9);
        EXPECT_NEAR(pixel->y, expected[i].y, 1e-9);
    }
}

void expect_projects_like_opencv(const arhost_intrinsics &intrinsics, const std::vector<double> &coefficients) {
    std::vector<cv::Point2d> expected;
    cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), opencv_matrix, coefficients, expected);
    expect_projection(expected, intrinsics);
}

void expect_projects_like_opencv_fisheye(const arhost_intrinsics &intrinsics,
                                         const std::vector<double> &coefficients) {
    std::vector<cv::Point2d> expected;
    cv::fisheye::projectPoints(points, expected, cv::Vec3d(), cv::Vec3d(), opencv_matrix, coefficients);
    expect_projection(expected, intrinsics);
}

} // namespace

TEST_F(Calibration, ReadsOpenCvFileStorage) {
    const std::vector<double> k = {0.0995485, -0.206384, 0.00754589, 0.00336531, 1e-17};
    const auto file = folder_.path() / "camera.yaml";
    {
        cv::FileStorage storage(file.string(), cv::FileStorage::WRITE);
        storage << "image_width" << 1280 << "image_height" << 960;
        storage << "camera_matrix"
                << cv::Mat(cv::Matx33d(1006.126285753055, 0, 655.86392441504, 0, 1004.0154330, 490.61, 0, 0, 1));
        storage << "distortion_coefficients" << cv::Mat(k, true);
    }
    const arhost_intrinsics intrinsics = read_calibration(file);
    EXPECT_EQ(intrinsics.struct_size, sizeof intrinsics);
    EXPECT_EQ(intrinsics.width, 1280u);
    EXPECT_EQ(intrinsics.height, 960u);
    EXPECT_EQ(intrinsics.fx, 1006.126285753055);
    EXPECT_EQ(intrinsics.fy, 1004.0154330);
    EXPECT_EQ(intrinsics.cx, 655.86392441504);
    EXPECT_EQ(intrinsics.cy, 490.61);
    EXPECT_EQ(intrinsics.distortion, ARHOST_DISTORTION_BROWN);
    EXPECT_EQ(coefficients(intrinsics), k);
}

TEST_F(Calibration, ReadsOpenCvTutorialFiles) {
    ARHOST_REQUIRE_SHARED_DATA("markers/opencv_doc/tutorial_camera_charuco.yml");
    const arhost_intrinsics charuco =
        read_calibration(test::shared_data("markers/opencv_doc/tutorial_camera_charuco.yml"));
    EXPECT_EQ(charuco.width, 640u);
    EXPECT_EQ(charuco.height, 480u);
    EXPECT_EQ(charuco.fx, 452.51072219637672);
    EXPECT_EQ(charuco.cy, 277.75155919135995);
    EXPECT_EQ(coefficients(charuco),
              (std::vector<double>{1.2136925618707872e-01, -1.0854664722560681e+00, 1.1786843796668460e-04,
                                   -4.6240686046485508e-04, 2.9542589406810080e+00}));

    const auto without_size = test::shared_data("markers/opencv_doc/tutorial_camera_params.yml");
    EXPECT_EQ(read_calibration(without_size, Size{640, 480}).fx, 628.158);
    EXPECT_EQ(read_calibration(without_size, Size{640, 480}).width, 640u);
    EXPECT_EQ(error_of([&] { read_calibration(without_size); }),
              without_size.string() +
                  ":2:1: the key 'image_width' is missing; give the size of the calibration's images in px, here or "
                  "as width and height next to 'file' in the configuration");
}

TEST_F(Calibration, ReadsKeysOfOlderOpenCvReleases) {
    const auto intrinsics = read_calibration(
        write("%YAML:1.0\nimage_Width: 640\nimage_Height: 480\nCamera_Matrix: [600, 0, 320, 0, 601, 240, 0, 0, 1]\n"
              "Distortion_Coefficients: [0.1, 0, 0, 0, 0]\n"));
    EXPECT_EQ(intrinsics.fy, 601);
    EXPECT_EQ(intrinsics.coefficients[0], 0.1);
}

TEST_F(Calibration, ReadsRosCameraInfo) {
    expect_projects_like_opencv(read_calibration(write(ros("plumb_bob", "0.1, -0.2, 0.001, 0.002, 0"))),
                                {0.1, -0.2, 0.001, 0.002, 0});
    expect_projects_like_opencv(
        read_calibration(write(ros("rational_polynomial", "0.1, -0.2, 0.001, 0.002, 0.05, 0.2, -0.1, 0.03"))),
        {0.1, -0.2, 0.001, 0.002, 0.05, 0.2, -0.1, 0.03});
    for (const char *model : {"equidistant", "fisheye"})
        expect_projects_like_opencv_fisheye(read_calibration(write(ros(model, "0.1, -0.2, 0.001, 0.002"))),
                                            {0.1, -0.2, 0.001, 0.002});
    // The message camera_info, as 'rostopic echo' prints it.
    expect_projects_like_opencv_fisheye(
        read_calibration(
            write("width: 640\nheight: 480\nK: [600.5, 0, 320, 0, 601, 240, 0, 0, 1]\ndistortion_model: equidistant\n"
                  "D: [0.1, -0.2, 0.001, 0.002]\nR: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n")),
        {0.1, -0.2, 0.001, 0.002});
}

TEST_F(Calibration, ReadsKalibrCamchains) {
    expect_projects_like_opencv(read_calibration(write(kalibr("cam0", "pinhole", "radtan", "0.1, -0.2, 1e-3, 2e-3"))),
                                {0.1, -0.2, 1e-3, 2e-3});
    expect_projects_like_opencv_fisheye(
        read_calibration(write(kalibr("cam0", "pinhole", "equidistant", "0.1, -0.2, 1e-3, 2e-3"))),
        {0.1, -0.2, 1e-3, 2e-3});
    const auto none = read_calibration(write(kalibr("cam0", "pinhole", "none", "")));
    expect_projects_like_opencv(none, {});
    EXPECT_EQ(none.distortion, ARHOST_DISTORTION_NONE);
}

TEST_F(Calibration, ReadsTheChosenCameraOfACamchain) {
    const std::string stereo = kalibr("cam0", "pinhole", "radtan", "0.1, 0, 0, 0") +
                               kalibr("cam1", "pinhole", "radtan", "0.2, 0, 0, 0") + "  timeshift_cam_imu: 0.01\n";
    EXPECT_EQ(read_calibration(write(stereo)).coefficients[0], 0.1);
    EXPECT_EQ(read_calibration(write(stereo), {}, "cam1").coefficients[0], 0.2);
    EXPECT_EQ(error_in(stereo, {}, "cam2"),
              "1:1: there is no camera 'cam2'; set 'name' next to 'file' in the configuration to one of cam0, cam1");
    EXPECT_EQ(error_in(kalibr("left", "pinhole", "none", "")),
              "1:1: there is no camera 'cam0'; set 'name' next to 'file' in the configuration to one of left");
    const std::string other_format = " has only one camera; remove 'name: cam1' next to 'file' in the configuration, "
                                     "which is for camchain files of Kalibr";
    EXPECT_EQ(error_in(with_distortion(no_distortion), {}, "cam1"), other_format);
    EXPECT_EQ(error_in(test::artoolkit_version_4().bytes(), {}, "cam1"), other_format);
}

TEST_F(Calibration, ErrorsInACamchainNameLineKeyAndFix) {
    const std::string calibrate_again = "' is not supported; calibrate again with Kalibr's option '--models "
                                        "pinhole-radtan' or '--models pinhole-equi'";
    for (const std::string model : {"omni", "eucm", "ds"})
        EXPECT_EQ(error_in(kalibr("cam0", model, "none", "")),
                  "3:17: cam0.camera_model: '" + model + calibrate_again);
    EXPECT_EQ(error_in(kalibr("cam0", "pinhole", "fov", "0.9")),
              "5:21: cam0.distortion_model: 'fov" + calibrate_again);
    EXPECT_EQ(error_in(kalibr("cam0", "pinhole", "equidistant", "0.1")),
              "4:22: cam0.distortion_coeffs: the fisheye model needs 4 coefficients (k1 k2 k3 k4), not 1");
    EXPECT_EQ(error_in(kalibr("cam0", "pinhole", "none", ""), Size{320, 240}),
              "7:15: cam0.resolution: the calibration is for images of 640×480 px, but 320×240 px are requested; "
              "calibrate at that size");
    const std::string beginning = "cam0: {camera_model: pinhole, distortion_model: none, distortion_coeffs: [], ";
    EXPECT_EQ(error_in(beginning + "intrinsics: [600, 601, 320], resolution: [640, 480]}"),
              "1:90: cam0.intrinsics: must be a list of 4 numbers, but has 3");
    EXPECT_EQ(error_in(beginning + "intrinsics: [600, 0, 320, 240], resolution: [640, 480]}"),
              "1:90: cam0.intrinsics: the focal length must be greater than 0 px, but is 0");
    EXPECT_EQ(error_in(beginning + "intrinsics: [600, 601, 320, 240], resolution: [640]}"),
              "1:124: cam0.resolution: must be [width, height]");
    EXPECT_EQ(error_in(beginning + "resolution: [640, 480]}"), "1:7: cam0: the key 'intrinsics' is missing");
}

// A file's name does not matter.
TEST_F(Calibration, RecognisesArtoolkitByItsContent) {
    const std::string bytes = test::artoolkit_version_4().bytes();
    const auto intrinsics = read_calibration(write(bytes), Size{640, 480});
    EXPECT_EQ(intrinsics.fy, 590);
    EXPECT_EQ(coefficients(intrinsics), (std::vector<double>{0.0992, -0.0921, -0.0019, 0.0013}));
    EXPECT_EQ(error_in(bytes, Size{320, 240}), " xsize, ysize: the calibration is for images of 640×480 px, but "
                                               "320×240 px are requested; calibrate at that size");
    EXPECT_EQ(error_in(bytes.substr(1)),
              " is a binary file of 175 bytes, but ARToolKit's camera parameters have 136, 144, 152, 176 or 240; if "
              "the file is truncated, copy it again; if it is YAML, save it as UTF-8 without NUL characters");
}

TEST_F(Calibration, DetectsFisheyeByItsModelKey) {
    const std::string four = "distortion_coefficients: [0.1, 0.2, 0.3, 0.4]\n";
    EXPECT_EQ(read_calibration(write(with_distortion(four))).distortion, ARHOST_DISTORTION_BROWN);
    EXPECT_EQ(read_calibration(write(with_distortion("distortion_model: fisheye\n" + four))).distortion,
              ARHOST_DISTORTION_FISHEYE);
    EXPECT_EQ(read_calibration(write(with_distortion("fisheye_model: 1\n" + four))).distortion,
              ARHOST_DISTORTION_FISHEYE);
    // With the fisheye model, a lens distorts even if all coefficients are 0.
    EXPECT_EQ(read_calibration(write(with_distortion("distortion_model: fisheye\n" + no_distortion))).distortion,
              ARHOST_DISTORTION_FISHEYE);
}

TEST_F(Calibration, AcceptsAllBrownCoefficientCounts) {
    for (const std::size_t count : {4, 5, 8, 12}) {
        std::string list = "0.5";
        for (std::size_t i = 1; i < count; ++i)
            list += ", 0.25";
        const auto intrinsics = read_calibration(write(with_distortion("distortion_coefficients: [" + list + "]\n")));
        EXPECT_EQ(intrinsics.distortion, ARHOST_DISTORTION_BROWN);
        EXPECT_EQ(intrinsics.coefficient_count, count);
        EXPECT_EQ(intrinsics.coefficients[count - 1], 0.25);
    }
    EXPECT_EQ(read_calibration(write(with_distortion("distortion_coefficients: []\n"))).distortion,
              ARHOST_DISTORTION_NONE);
}

TEST_F(Calibration, HasNoDistortionIfAllCoefficientsAreZero) {
    const auto intrinsics = read_calibration(write(with_distortion(no_distortion)));
    EXPECT_EQ(intrinsics.distortion, ARHOST_DISTORTION_NONE);
    EXPECT_EQ(intrinsics.coefficient_count, 0u);
}

TEST_F(Calibration, AcceptsFourteenCoefficientsOnlyWithoutTilt) {
    const std::string twelve = "distortion_coefficients: [0.1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.2, ";
    EXPECT_EQ(read_calibration(write(with_distortion(twelve + "0, 0]\n"))).coefficient_count, 12u);
    EXPECT_EQ(error_in(with_distortion(twelve + "0, 0.01]\n")),
              "10:26: distortion_coefficients: a tilted sensor (tauX, tauY) is not supported; calibrate without "
              "CALIB_TILTED_MODEL");
}

TEST_F(Calibration, ErrorsNameLineKeyAndFix) {
    EXPECT_EQ(error_in(with_distortion("distortion_coefficients: [1, 2, 3]\n")),
              "10:26: distortion_coefficients: the Brown model needs 4, 5, 8 or 12 coefficients (k1 k2 p1 p2 [k3 [k4 "
              "k5 k6 [s1 s2 s3 s4]]]), not 3");
    EXPECT_EQ(error_in(with_distortion("distortion_model: fisheye\ndistortion_coefficients: [1, 2, 3, 4, 5]\n")),
              "11:26: distortion_coefficients: the fisheye model needs 4 coefficients (k1 k2 k3 k4), not 5");
    EXPECT_EQ(error_in(with_distortion("distortion_model: radtn\n" + no_distortion)),
              "10:19: distortion_model: 'radtn' is not one of brown, plumb_bob, radtan, rational_polynomial, "
              "fisheye, equidistant, none; did you mean 'radtan'?");
    EXPECT_EQ(error_in(with_distortion("distortion_model: none\ndistortion_coefficients: [1, 2, 3, 4]\n")),
              "11:26: distortion_coefficients: the distortion model is 'none', but a coefficient is not 0; set the "
              "model to brown or fisheye");
    EXPECT_EQ(error_in(with_distortion("")),
              "3:1: the key 'distortion_coefficients' is missing; for a lens without distortion, write [0, 0, 0, 0]");
    EXPECT_EQ(error_in("image_width: 640\nimage_height: 480\n" + no_distortion),
              "1:1: the key 'camera_matrix' is missing; is this a camera calibration?");
    EXPECT_EQ(error_in("image_width: 640\n"),
              "1:1: the key 'image_height' is missing; give the size of the calibration's images in px, here or as "
              "width and height next to 'file' in the configuration");
    EXPECT_EQ(error_in("<?xml version=\"1.0\"?>\n"),
              "1:1: is not a calibration: expected YAML of OpenCV, ROS or Kalibr, or ARToolKit's camera parameters; "
              "OpenCV's FileStorage writes YAML if the file name ends in .yaml");
    EXPECT_EQ(error_in(""), " is empty");
}

TEST_F(Calibration, RejectsInvalidCameraMatrices) {
    const auto with_matrix = [](const std::string &value) {
        return "image_width: 640\nimage_height: 480\ncamera_matrix: " + value + "\n" + no_distortion;
    };
    EXPECT_EQ(error_in(with_matrix("[600, 0, 320, 0, 601, 240]")),
              "3:16: camera_matrix: must be a 3×3 matrix with 9 numbers, but has 6 numbers");
    EXPECT_EQ(error_in(with_matrix("[600, 0.5, 320, 0, 601, 240, 0, 0, 1]")),
              "3:16: camera_matrix: skew (row 1, column 2) is not supported and must be 0");
    EXPECT_EQ(error_in(with_matrix("[600, 0, 0, 0, 601, 0, 320, 240, 1]")),
              "3:16: camera_matrix: must be [fx, 0, cx, 0, fy, cy, 0, 0, 1], row by row");
    EXPECT_EQ(error_in(with_matrix("[600, 0, 320, 0, -601, 240, 0, 0, 1]")),
              "3:16: camera_matrix: the focal length must be greater than 0 px, but is -601");
    EXPECT_EQ(error_in(with_matrix("[.Nan, 0, 320, 0, 601, 240, 0, 0, 1]")),
              "3:17: camera_matrix[0]: must be a finite number, but is .Nan");
    EXPECT_EQ(error_in(with_matrix("{rows: 3, cols: 3, dt: d, data: [1, 2]}")),
              "3:48: camera_matrix.data: has 2 numbers, but rows × cols is 9");
    EXPECT_EQ(error_in(with_matrix("{rows: 3, cols: 3, dt: u, data: [1, 2]}")),
              "3:39: camera_matrix.dt: 'u' is not one of d, f; did you mean 'd'?");
}

TEST_F(Calibration, RejectsAnotherImageSizeAndNamesBoth) {
    EXPECT_EQ(error_in(with_distortion(no_distortion), Size{1280, 720}),
              "3:14: image_width: the calibration is for images of 640×480 px, but 1280×720 px are requested; "
              "calibrate at that size");
    const auto intrinsics = read_calibration(write(with_distortion(no_distortion)), Size{640, 480});
    EXPECT_EQ(error_of([&] { check_size(intrinsics, 640, 480); }), "no error");
    EXPECT_EQ(error_of([&] { check_size(intrinsics, 1280, 720); }),
              "the camera is calibrated for images of 640×480 px, but the frames are 1280×720 px; calibrate at the "
              "frame size, or set the source to the calibration size");
}

TEST_F(Calibration, ReportsAMissingFile) {
    EXPECT_EQ(error_of([] { read_calibration("/no/camera.yaml"); }),
              "/no/camera.yaml: cannot be read: No such file or directory");
}

TEST(CameraBlock, DefaultsToACentredPrincipalPoint) {
    const arhost_intrinsics intrinsics = parsed("{width: 640, height: 480, fx: 600}");
    EXPECT_EQ(intrinsics.struct_size, sizeof intrinsics);
    EXPECT_EQ(intrinsics.fx, 600);
    EXPECT_EQ(intrinsics.fy, 600);
    EXPECT_EQ(intrinsics.cx, 319.5);
    EXPECT_EQ(intrinsics.cy, 239.5);
    EXPECT_EQ(intrinsics.distortion, ARHOST_DISTORTION_NONE);
    EXPECT_EQ(intrinsics.coefficient_count, 0u);
}

TEST(CameraBlock, AcceptsAFieldOfViewInsteadOfFocalLengths) {
    const arhost_intrinsics intrinsics = parsed("{width: 800, height: 600, vertical_fov_degrees: 45, cx: 400}");
    // The upper and lower edges of the image are half a pixel outside the outermost pixel centres, 300 px from the
    // centre.
    EXPECT_NEAR(intrinsics.fx, 724.2640687, 1e-6);
    EXPECT_EQ(intrinsics.fy, intrinsics.fx);
    EXPECT_EQ(intrinsics.cx, 400);
    EXPECT_EQ(intrinsics.cy, 299.5);
    const arhost_intrinsics dissertation = dissertation_camera({800, 600});
    EXPECT_EQ(dissertation.fy, intrinsics.fy);
    EXPECT_EQ(dissertation.cx, 399.5);
    EXPECT_EQ(dissertation.distortion, ARHOST_DISTORTION_NONE);
    EXPECT_EQ(error_in_block("{width: 8, height: 6, fx: 9, vertical_fov_degrees: 45}"),
              "1:52: vertical_fov_degrees: must not be combined with fx and fy; remove either this key or those two");
    EXPECT_EQ(error_in_block("{width: 8, height: 6, vertical_fov_degrees: 180}"),
              "1:45: vertical_fov_degrees: must be 0.01 to 179, but is 180");
}

TEST(CameraBlock, UsesEveryGivenNumber) {
    const arhost_intrinsics intrinsics = parsed("{width: 800, height: 600, fx: 700, fy: 701, cx: 400, cy: 300,\n"
                                                " distortion: {model: fisheye, coefficients: [0.1, 0.2, 0.3, 0.4]}}");
    EXPECT_EQ(intrinsics.width, 800u);
    EXPECT_EQ(intrinsics.height, 600u);
    EXPECT_EQ(intrinsics.fy, 701);
    EXPECT_EQ(intrinsics.cx, 400);
    EXPECT_EQ(intrinsics.cy, 300);
    EXPECT_EQ(intrinsics.distortion, ARHOST_DISTORTION_FISHEYE);
    EXPECT_EQ(coefficients(intrinsics), (std::vector<double>{0.1, 0.2, 0.3, 0.4}));
    EXPECT_EQ(parsed("{width: 8, height: 6, fx: 7, distortion: {model: none}}").distortion, ARHOST_DISTORTION_NONE);
    EXPECT_EQ(
        parsed("{width: 8, height: 6, fx: 7, distortion: {model: brown, coefficients: [1, 0, 0, 0]}}").distortion,
        ARHOST_DISTORTION_BROWN);
}

TEST(CameraBlock, ReadsAFileRelativeToTheConfiguration) {
    const test::ScratchFolder folder;
    std::ofstream(folder.path() / "camera.yaml") << "K: [600, 0, 320, 0, 601, 240, 0, 0, 1]\nD: [0, 0, 0, 0]\n";
    std::ofstream(folder.path() / "lab.yaml") << "{file: camera.yaml, width: 640, height: 480}\n";
    const arhost_intrinsics intrinsics = parse_camera(yaml::Node::load(folder.path() / "lab.yaml"));
    EXPECT_EQ(intrinsics.fy, 601);
    EXPECT_EQ(intrinsics.height, 480u);
}

TEST(CameraBlock, ChoosesACameraOfACamchain) {
    const test::ScratchFolder folder;
    std::ofstream(folder.path() / "camchain.yaml")
        << kalibr("cam0", "pinhole", "none", "") << kalibr("cam1", "pinhole", "radtan", "0.1, 0, 0, 0");
    std::ofstream(folder.path() / "lab.yaml") << "{file: camchain.yaml, name: cam1}\n";
    EXPECT_EQ(parse_camera(yaml::Node::load(folder.path() / "lab.yaml")).coefficients[0], 0.1);
}

TEST(CameraBlock, ErrorsNameLineKeyAndFix) {
    EXPECT_EQ(error_in_block("width: 640\nheight: 480\n"), "1:1: the key 'fx' is missing");
    EXPECT_EQ(error_in_block("width: 640\nheight: 480\nfx: 0\n"),
              "3:5: fx: the focal length must be greater than 0 px, but is 0");
    EXPECT_EQ(error_in_block("width: 0\nheight: 480\nfx: 600\n"), "1:8: width: must be 1 to 16384, but is 0");
    EXPECT_EQ(error_in_block("width: 640\nheight: 480\nfx: 600\nf: 1\n"), "4:1: f: unknown key; did you mean 'fx'?");
    EXPECT_EQ(error_in_block("{width: 640, height: 480, fx: 600, distortion: {model: brown}}"),
              "1:48: distortion: the key 'coefficients' is missing; it lists the model's coefficients");
    EXPECT_EQ(error_in_block("{width: 640, height: 480, fx: 600, distortion: {model: lens}}"),
              "1:56: distortion.model: 'lens' is not one of none, brown, fisheye");
    EXPECT_EQ(error_in_block("{file: camera.yaml, width: 640}"),
              "1:8: file: the calibration file " + (std::filesystem::current_path() / "camera.yaml").string() +
                  " does not exist");
    EXPECT_EQ(error_in_block("{file: camera.yaml, fx: 640}"),
              "1:21: fx: unknown key; known keys: file, name, width, height");
}

TEST(CameraBlock, RequiresWidthAndHeightTogether) {
    const test::ScratchFolder folder;
    const std::string file = (folder.path() / "camera.yaml").string();
    std::ofstream(file) << "{}\n";
    EXPECT_EQ(error_in_block("{file: " + file + ", width: 640}"), "1:1: set both width and height, or neither");
}

// Tests the examples in docs/camera.md.
TEST(CameraDocumentation, HasValidExamples) {
    const test::ScratchFolder folder;
    std::ofstream(folder.path() / "camera.yaml") << "K: [600, 0, 320, 0, 601, 240, 0, 0, 1]\nD: [0, 0, 0, 0]\n";
    std::ifstream page(arhost::test::source_directory() + "/docs/camera.md");
    std::size_t cameras = 0, coordinates = 0;
    for (std::string line, example; std::getline(page, line);) {
        if (line != "```yaml")
            continue;
        for (example.clear(); std::getline(page, line) && line != "```";)
            example += line + "\n";
        const yaml::Node root = yaml::Node::parse(example, (folder.path() / "lab.yaml").string());
        if (const auto camera = root.find("camera")) {
            EXPECT_GT(parse_camera(*camera).fx, 0);
            ++cameras;
        }
        if (const auto block = root.find("coordinates")) {
            EXPECT_EQ(parse_coordinates(*block).rotations.size(), 1u);
            ++coordinates;
        }
    }
    EXPECT_EQ(cameras, 2u);
    EXPECT_EQ(coordinates, 1u);
}

} // namespace arhost::camera
