// SPDX-License-Identifier: Apache-2.0
//
// Pictures of the patterns of ARToolKit, which are in shared/data/markers/artoolkit.
#pragma once

#include <fiducial/rendered_marker.hpp>
#include <fiducial/tracker_support.hpp>

#include <fstream>
#include <random>
#include <string>
#include <vector>

namespace arhost::test {

inline const arhost_intrinsics camera = intrinsics_of({640, 480}, 600, 600, 319.5, 239.5);

inline std::string file_of(const std::string &name) {
    return (shared_data("markers/artoolkit") / (name + ".patt")).string();
}

// The print of a pattern with a black border, as wide as half of the picture.
inline Print print_of(const std::string &name) {
    std::ifstream stream(file_of(name));
    constexpr int side = 16, border = 8;
    Print print{cv::Mat_<std::uint8_t>(side + 2 * border, side + 2 * border, std::uint8_t{0}), side + 2 * border};
    for (int y = 0; y < side; ++y) // the first of three colours: the patterns are black and white
        for (int x = 0; x < side; ++x) {
            int value = 0;
            stream >> value;
            print.cells(border + y, border + x) = static_cast<std::uint8_t>(value);
        }
    return print.with_margin(4);
}

inline std::vector<Listed> both() {
    return {{0, 80, "pattern", file_of("hiro"), 0.5}, {1, 80, "pattern", file_of("kanji"), 0.5}};
}

inline cv::Mat picture_of(const std::vector<Placed> &markers, std::uint64_t seed = 1) {
    cv::Mat picture = render(camera, markers);
    cv::GaussianBlur(picture, picture, {}, 0.6);
    add_noise(picture, 1.5, seed);
    return picture;
}

// Hiro and kanji, tilted about the x or the y axis, at random places and turned by random angles.
inline std::vector<Placed> side_by_side(double tilt_degrees, bool about_x, std::mt19937 &random) {
    std::uniform_real_distribution<double> turn(-180, 180), shift(-20, 20);
    std::vector<Placed> placed;
    for (int id = 0; id < 2; ++id) {
        const double x = id * 150 - 75 + shift(random), y = shift(random);
        placed.push_back({print_of(id == 0 ? "hiro" : "kanji"), 80,
                          pose_of(x, y, 500, about_x ? tilt_degrees : 0, about_x ? 0 : tilt_degrees, turn(random))});
    }
    return placed;
}

} // namespace arhost::test
