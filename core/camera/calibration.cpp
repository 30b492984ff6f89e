// SPDX-License-Identifier: Apache-2.0
#include "camera/calibration.hpp"

#include "camera/artoolkit.hpp"

#include <arhost/frame.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <span>
#include <sstream>

namespace arhost::camera {
namespace {

using yaml::Node;

std::string text(const Size &size) {
    return std::to_string(size.width) + "×" + std::to_string(size.height) + " px";
}

std::uint32_t side(const Node &node) {
    return static_cast<std::uint32_t>(node.integer(1, ARHOST_MAX_IMAGE_SIDE));
}

arhost_intrinsics intrinsics_for(const Size &size) {
    arhost_intrinsics intrinsics{};
    intrinsics.struct_size = sizeof intrinsics;
    intrinsics.width = size.width;
    intrinsics.height = size.height;
    intrinsics.distortion = ARHOST_DISTORTION_NONE;
    return intrinsics;
}

void set_focal_length(double &to, double value, const Node &node) {
    if (!(value > 0)) {
        std::ostringstream message;
        message << "the focal length must be greater than 0 px, but is " << value;
        node.fail(message.str());
    }
    to = value;
}

// Sets the focal lengths for square pixels. `degrees` is the angle between the upper and the lower edge of the image.
void set_vertical_fov(arhost_intrinsics &to, double degrees) {
    to.fx = to.fy = to.height / 2.0 / std::tan(degrees / 2 * std::numbers::pi / 180);
}

void centre_principal_point(arhost_intrinsics &to) {
    to.cx = (to.width - 1) / 2.0;
    to.cy = (to.height - 1) / 2.0;
}

// Checks the number of coefficients and drops those without effect.
void set_distortion(arhost_intrinsics &to, arhost_distortion model, std::span<const double> k, const Node &node) {
    const auto zero = [](double x) { return x == 0; };
    const std::string count = std::to_string(k.size());
    if (model == ARHOST_DISTORTION_FISHEYE) {
        if (k.size() != 4)
            node.fail("the fisheye model needs 4 coefficients (k1 k2 k3 k4), not " + count);
    } else {
        if (k.size() == 14) {
            if (!std::all_of(k.begin() + 12, k.end(), zero))
                node.fail("a tilted sensor (tauX, tauY) is not supported; calibrate without CALIB_TILTED_MODEL");
            k = k.first(12);
        }
        if (!k.empty() && k.size() != 4 && k.size() != 5 && k.size() != 8 && k.size() != 12)
            node.fail("the Brown model needs 4, 5, 8 or 12 coefficients "
                      "(k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4]]]), not " +
                      count);
        if (model == ARHOST_DISTORTION_NONE && !std::all_of(k.begin(), k.end(), zero))
            node.fail(
                "the distortion model is 'none', but a coefficient is not 0; set the model to brown or fisheye");
        model = std::all_of(k.begin(), k.end(), zero) ? ARHOST_DISTORTION_NONE : ARHOST_DISTORTION_BROWN;
        if (model == ARHOST_DISTORTION_NONE)
            k = {};
    }
    to.distortion = model;
    to.coefficient_count = static_cast<std::uint32_t>(k.size());
    std::copy(k.begin(), k.end(), to.coefficients);
}

// Finds a key, ignoring case and underscores, because programs and releases spell the keys differently:
// camera_matrix, Camera_Matrix, cameraMatrix.
std::optional<Node> find(const Node &root, std::initializer_list<std::string_view> names) {
    for (const auto &[key, value] : root.entries()) {
        std::string plain;
        for (const char c : key)
            if (c != '_')
                plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
        if (std::find(names.begin(), names.end(), plain) != names.end())
            return value;
    }
    return std::nullopt;
}

// Reads a list of numbers, or a matrix of OpenCV ({rows, cols, dt, data}) or ROS ({rows, cols, data}).
std::vector<double> numbers(const Node &node) {
    if (node.is_sequence())
        return node.reals();
    const std::int64_t cells = node.require("rows").integer(0, 1000) * node.require("cols").integer(0, 1000);
    if (const auto type = node.find("dt"))
        type->choice({"d", "f"});
    const Node data = node.require("data");
    std::vector<double> values = data.reals();
    if (static_cast<std::int64_t>(values.size()) != cells)
        data.fail("has " + std::to_string(values.size()) + " numbers, but rows × cols is " + std::to_string(cells));
    return values;
}

void read_camera_matrix(arhost_intrinsics &to, const Node &node) {
    const std::vector<double> k = numbers(node);
    if (k.size() != 9)
        node.fail("must be a 3×3 matrix with 9 numbers, but has " + std::to_string(k.size()) + " numbers");
    if (k[1] != 0)
        node.fail("skew (row 1, column 2) is not supported and must be 0");
    if (k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1)
        node.fail("must be [fx, 0, cx, 0, fy, cy, 0, 0, 1], row by row");
    set_focal_length(to.fx, k[0], node);
    set_focal_length(to.fy, k[4], node);
    to.cx = k[2];
    to.cy = k[5];
}

arhost_distortion model_of(const Node &root) {
    if (const auto model = find(root, {"distortionmodel"})) {
        const std::string name =
            model->choice({"brown", "plumb_bob", "radtan", "rational_polynomial", "fisheye", "equidistant", "none"});
        if (name == "none")
            return ARHOST_DISTORTION_NONE;
        return name == "fisheye" || name == "equidistant" ? ARHOST_DISTORTION_FISHEYE : ARHOST_DISTORTION_BROWN;
    }
    const auto fisheye = find(root, {"fisheyemodel"}); // key written by OpenCV's calibration sample program
    return fisheye && fisheye->integer(0, 1) ? ARHOST_DISTORTION_FISHEYE : ARHOST_DISTORTION_BROWN;
}

std::string problem_with_size(const Size &size, const std::optional<Size> &expected) {
    return expected && size != *expected ? "the calibration is for images of " + text(size) + ", but " +
                                               text(*expected) + " are requested; calibrate at that size"
                                         : "";
}

Size size_of(const Node &root, const std::optional<Size> &expected) {
    const auto width = find(root, {"imagewidth", "width"}), height = find(root, {"imageheight", "height"});
    if (!width && !height && expected)
        return *expected;
    if (!width || !height)
        root.fail(std::string("the key '") + (width ? "image_height" : "image_width") +
                  "' is missing; give the size of the calibration's images in px, "
                  "here or as width and height next to 'file' in the configuration");
    const Size size{side(*width), side(*height)};
    if (const std::string problem = problem_with_size(size, expected); !problem.empty())
        width->fail(problem);
    return size;
}

// The formats of calibrations in YAML.

arhost_intrinsics read_opencv_or_ros(const Node &root, const std::optional<Size> &expected) {
    arhost_intrinsics intrinsics = intrinsics_for(size_of(root, expected));
    const auto matrix = find(root, {"cameramatrix", "k"});
    if (!matrix)
        root.fail("the key 'camera_matrix' is missing; is this a camera calibration?");
    read_camera_matrix(intrinsics, *matrix);
    if (const auto distortion = find(root, {"distortioncoefficients", "distcoeffs", "d"}))
        set_distortion(intrinsics, model_of(root), numbers(*distortion), *distortion);
    else
        root.fail("the key 'distortion_coefficients' is missing; for a lens without distortion, write [0, 0, 0, 0]");
    return intrinsics;
}

// Whether the document is a camchain: a map of cameras.
bool is_kalibr(const Node &root) {
    return std::ranges::any_of(
        root.entries(), [](const auto &entry) { return entry.second.is_map() && entry.second.find("camera_model"); });
}

arhost_intrinsics read_kalibr(const Node &root, const std::optional<Size> &expected, const std::string &name) {
    const auto camera = root.find(name);
    if (!camera) {
        std::string names;
        for (const auto &[key, value] : root.entries())
            names += (names.empty() ? "" : ", ") + key;
        root.fail("there is no camera '" + name + "'; set 'name' next to 'file' in the configuration to one of " +
                  names);
    }
    const auto expect_supported = [&](std::string_view key, std::initializer_list<std::string_view> supported) {
        const Node model = camera->require(key);
        if (std::ranges::find(supported, model.text()) == supported.end())
            model.fail("'" + model.text() +
                       "' is not supported; calibrate again with Kalibr's option '--models pinhole-radtan' or "
                       "'--models pinhole-equi'");
    };
    expect_supported("camera_model", {"pinhole"});
    expect_supported("distortion_model", {"radtan", "equidistant", "none"});
    const Node resolution = camera->require("resolution");
    const std::vector<Node> sides = resolution.items();
    if (sides.size() != 2)
        resolution.fail("must be [width, height]");
    const Size size{side(sides[0]), side(sides[1])};
    if (const std::string problem = problem_with_size(size, expected); !problem.empty())
        resolution.fail(problem);
    arhost_intrinsics intrinsics = intrinsics_for(size);
    const Node pinhole = camera->require("intrinsics");
    const std::vector<double> k = pinhole.reals(4); // fx, fy, cx, cy
    set_focal_length(intrinsics.fx, k[0], pinhole);
    set_focal_length(intrinsics.fy, k[1], pinhole);
    intrinsics.cx = k[2];
    intrinsics.cy = k[3];
    const Node coefficients = camera->require("distortion_coeffs");
    set_distortion(intrinsics, model_of(*camera), coefficients.reals(), coefficients);
    return intrinsics;
}

std::optional<Size> size_next_to_file(const Node &node) {
    const auto width = node.find("width"), height = node.find("height");
    if (width.has_value() != height.has_value())
        node.fail("set both width and height, or neither");
    if (!width)
        return std::nullopt;
    return Size{side(*width), side(*height)};
}

} // namespace

arhost_intrinsics read_calibration(const std::filesystem::path &file, std::optional<Size> expected,
                                   const std::optional<std::string> &name) {
    const std::string content = yaml::read_file(file);
    const auto expect_no_name = [&] {
        if (name)
            throw yaml::Error(file.string() + ": has only one camera; remove 'name: " + *name +
                              "' next to 'file' in the configuration, which is for camchain files of Kalibr");
    };
    if (content.find('\0') != std::string::npos) { // never in YAML
        const arhost_intrinsics intrinsics = parse_artoolkit(content, file.string());
        if (const std::string problem = problem_with_size({intrinsics.width, intrinsics.height}, expected);
            !problem.empty())
            throw yaml::Error(file.string() + ": xsize, ysize: " + problem);
        expect_no_name();
        return intrinsics;
    }
    const Node root = Node::parse(content, file.string());
    if (root.is_null())
        root.fail("is empty");
    if (!root.is_map())
        root.fail("is not a calibration: expected YAML of OpenCV, ROS or Kalibr, or ARToolKit's camera parameters; "
                  "OpenCV's FileStorage writes YAML if the file name ends in .yaml");
    if (is_kalibr(root))
        return read_kalibr(root, expected, name.value_or("cam0"));
    expect_no_name();
    return read_opencv_or_ros(root, expected);
}

arhost_intrinsics parse_camera(const Node &node) {
    if (const auto file = node.find("file")) {
        node.allow_keys({"file", "name", "width", "height"});
        const std::filesystem::path path = file->input_path();
        if (!std::filesystem::exists(path))
            file->fail("the calibration file " + path.string() + " does not exist");
        const auto name = node.find("name");
        return read_calibration(path, size_next_to_file(node), name ? std::optional(name->text()) : std::nullopt);
    }
    node.allow_keys({"file", "width", "height", "fx", "fy", "vertical_fov_degrees", "cx", "cy", "distortion"});
    arhost_intrinsics intrinsics = intrinsics_for({side(node.require("width")), side(node.require("height"))});
    if (const auto fov = node.find("vertical_fov_degrees")) {
        if (node.find("fx") || node.find("fy"))
            fov->fail("must not be combined with fx and fy; remove either this key or those two");
        set_vertical_fov(intrinsics, fov->real(0.01, 179));
    } else {
        const Node fx = node.require("fx"), fy = node.find("fy").value_or(fx);
        set_focal_length(intrinsics.fx, fx.real(), fx);
        set_focal_length(intrinsics.fy, fy.real(), fy);
    }
    centre_principal_point(intrinsics);
    if (const auto cx = node.find("cx"))
        intrinsics.cx = cx->real();
    if (const auto cy = node.find("cy"))
        intrinsics.cy = cy->real();
    if (const auto distortion = node.find("distortion")) {
        distortion->allow_keys({"model", "coefficients"});
        const std::string model = distortion->require("model").choice({"none", "brown", "fisheye"});
        const auto coefficients = distortion->find("coefficients");
        if (!coefficients && model != "none")
            distortion->fail("the key 'coefficients' is missing; it lists the model's coefficients");
        set_distortion(intrinsics,
                       model == "none"    ? ARHOST_DISTORTION_NONE
                       : model == "brown" ? ARHOST_DISTORTION_BROWN
                                          : ARHOST_DISTORTION_FISHEYE,
                       coefficients ? coefficients->reals() : std::vector<double>(),
                       coefficients.value_or(*distortion));
    }
    return intrinsics;
}

arhost_intrinsics dissertation_camera(const Size &size) {
    arhost_intrinsics intrinsics = intrinsics_for(size);
    set_vertical_fov(intrinsics, 45);
    centre_principal_point(intrinsics);
    return intrinsics;
}

std::string doubt_about_focal_length(const arhost_intrinsics &intrinsics) {
    const double shortest_px = std::min(intrinsics.fx, intrinsics.fy);
    if (shortest_px >= 100 || shortest_px >= intrinsics.width / 2.0) // at most 90° wide
        return {};
    std::ostringstream message;
    message << "a focal length of " << shortest_px << " px is implausible for an image width of " << intrinsics.width
            << " px; check the unit, which is px";
    return message.str();
}

void check_size(const arhost_intrinsics &intrinsics, std::uint32_t width, std::uint32_t height) {
    const Size calibrated{intrinsics.width, intrinsics.height}, actual{width, height};
    if (calibrated != actual)
        throw yaml::Error("the camera is calibrated for images of " + text(calibrated) + ", but the frames are " +
                          text(actual) + "; calibrate at the frame size, or set the source to the calibration size");
}

} // namespace arhost::camera
