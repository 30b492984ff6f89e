// SPDX-License-Identifier: Apache-2.0
//
// Frames of printed markers at exactly known poses.
#pragma once

#include "conformance/picture.hpp"

#include <arhost/camera.h>

#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::conformance {

// A square print of a marker.
struct Print {
    int id;
    std::uint32_t side;             // of `grey`, in pixels
    std::vector<std::uint8_t> grey; // 0 ink, 255 paper; the first row is the print's top
    std::uint32_t border = 0;       // pixels of `grey` outside the square between the marker's corners, on each side

    Print mirrored() const;
};

using PrintFiles = std::map<int, std::filesystem::path>; // by id

// The families of ARToolKit's patterns and of pictures, whose prints are defined by files
// (arhost_marker_config.file).
inline constexpr std::string_view pattern_family = "pattern", picture_family = "image";
constexpr bool has_files(std::string_view family) {
    return family == pattern_family || family == picture_family;
}

// The families whose markers the suite can draw.
inline constexpr std::array drawn_families = {"tag36h11", "DICT_6X6_250", "tag25h9",
                                              "pattern",  "image",        "artoolkit-5x5-bch-22-7-7"};

// Returns four markers of one of these families, or the prints in the user's PNG files. Never empty. The ids are not
// in ascending order, and some ids occur in several families.
std::vector<Print> prints_of(const PrintFiles &files, std::string_view family = drawn_families.front());

// Returns the file that defines the print of a marker of a family that has_files. Writes it to `folder`, unless
// prints_of(files, family) has no such marker.
std::filesystem::path print_file(const std::filesystem::path &folder, const std::string &family, int id,
                                 const PrintFiles &files);
double pattern_ratio_of(std::string_view family); // arhost_marker_config.pattern_ratio

// A picture with texture of all sizes, a different one for each id.
Print picture_of(int id);
void write_picture(const Print &print, const std::filesystem::path &file); // as PNG

// A greyscale camera image.
struct Grey {
    std::uint32_t width, height;
    std::vector<std::uint8_t> codes; // rows without padding

    std::uint8_t &at(std::uint32_t x, std::uint32_t y) { return codes[std::size_t{width} * y + x]; }
    std::uint8_t at(std::uint32_t x, std::uint32_t y) const { return codes[std::size_t{width} * y + x]; }
    Grey part(std::uint32_t x0, std::uint32_t y0, std::uint32_t part_width, std::uint32_t part_height) const;
    Picture picture() const; // for the report
};
// Returns an image with the grey codes code(x, y), clamped to 0–255.
template <class Code> Grey filled(std::uint32_t width, std::uint32_t height, Code &&code) {
    Grey image{width, height, std::vector<std::uint8_t>(std::size_t{width} * height)};
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x)
            image.at(x, y) = static_cast<std::uint8_t>(std::clamp<int>(code(x, y), 0, 255));
    return image;
}

// Marker to camera, as in arhost_target.mt: GL eye space, mm.
using Pose = glm::dmat4;

// Returns the pose of a marker that faces the camera upright, rotated by degrees about the camera's axes x, then y,
// then z.
Pose pose(const glm::dvec3 &centre, double about_x = 0, double about_y = 0, double about_z = 0);
// Returns the pose of a marker that is tilted by `tilt` degrees: the edge that lies in the image direction `towards`
// (degrees from the camera's x axis) is farther from the camera.
Pose tilted(const glm::dvec3 &centre, double tilt, double towards, double about_z = 0);

struct Placed {
    Print print;
    double side_mm;
    Pose camera_from_marker;
};

inline constexpr int paper_code = 220, ink_code = 30, background_code = 140;

// Draws the prints, each on white paper with a margin of at least an eighth of the marker's side. Each pixel is the
// mean of 32 rays through the lens: nothing is resampled, and edges are exact to 1/64 px.
Grey draw(const arhost_intrinsics &camera, std::span<const Placed> markers);
inline Grey draw(const arhost_intrinsics &camera, const Placed &marker) {
    return draw(camera, std::span(&marker, 1));
}

// Projects a point in GL eye space, which must be in view.
glm::dvec2 pixel_of(const arhost_intrinsics &camera, const glm::dvec3 &eye_point);
// Returns the projected corners, ordered as in arhost/tracker.h.
std::array<glm::dvec2, 4> corners_of(const arhost_intrinsics &camera, const Placed &marker);

Grey blurred(const Grey &image, double sigma_px);

} // namespace arhost::conformance
