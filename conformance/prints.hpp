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
#include <vector>

namespace arhost::conformance {

// What is printed of a marker: the square that its corners bound.
struct Print {
    int id;
    std::uint32_t side;             // of the picture below, in its pixels
    std::vector<std::uint8_t> grey; // 0 ink, 255 paper; the first row is the print's top

    Print mirrored() const;
};

using PrintFiles = std::map<int, std::filesystem::path>; // by id

// Four of AprilTag's family tag36h11, or those of a user's PNG files. At least one; ids do not ascend.
std::vector<Print> prints_of(const PrintFiles &files);

// The image of a camera without colours.
struct Grey {
    std::uint32_t width, height;
    std::vector<std::uint8_t> codes; // without gaps

    std::uint8_t &at(std::uint32_t x, std::uint32_t y) { return codes[std::size_t{width} * y + x]; }
    std::uint8_t at(std::uint32_t x, std::uint32_t y) const { return codes[std::size_t{width} * y + x]; }
    Grey part(std::uint32_t x0, std::uint32_t y0, std::uint32_t part_width, std::uint32_t part_height) const;
    Picture picture() const; // for the report
};
// Of the codes that code(x, y) gives, clamped to 0 … 255.
template <class Code> Grey filled(std::uint32_t width, std::uint32_t height, Code &&code) {
    Grey image{width, height, std::vector<std::uint8_t>(std::size_t{width} * height)};
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x)
            image.at(x, y) = static_cast<std::uint8_t>(std::clamp<int>(code(x, y), 0, 255));
    return image;
}

// Marker to camera as arhost_marker.mt has it: GL eye space, mm.
using Pose = glm::dmat4;

// Turned from facing the camera upright by degrees about the camera's axes x, then y, then z.
Pose pose(const glm::dvec3 &centre, double about_x = 0, double about_y = 0, double about_z = 0);
// Leaning back by `tilt` degrees, in the direction `towards` degrees from the camera's x axis.
Pose tilted(const glm::dvec3 &centre, double tilt, double towards, double about_z = 0);

struct Placed {
    Print print;
    double side_mm;
    Pose camera_from_marker;
};

inline constexpr int paper_code = 220, ink_code = 30, background_code = 140;

// The prints, each on white paper an eighth of its side wider on every side. Each pixel is the mean of 32 rays
// through the lens, so that nothing is resampled and edges lie where projection puts them, to 1/64 px.
Grey draw(const arhost_intrinsics &camera, std::span<const Placed> markers);
inline Grey draw(const arhost_intrinsics &camera, const Placed &marker) {
    return draw(camera, std::span(&marker, 1));
}

// Where a point in GL eye space is seen; it is in view.
glm::dvec2 pixel_of(const arhost_intrinsics &camera, const glm::dvec3 &eye_point);
// In the order of arhost/tracker.h.
std::array<glm::dvec2, 4> corners_of(const arhost_intrinsics &camera, const Placed &marker);

Grey blurred(const Grey &image, double sigma_px);

} // namespace arhost::conformance
