// SPDX-License-Identifier: Apache-2.0
//
// The camera: looks each pixel up on the desk through the lens, then blur, noise and sRGB as of a sensor.
#pragma once

#include "desk.hpp"
#include "path.hpp"
#include "pyramid.hpp"

#include <arhost/camera.h>

#include <optional>
#include <span>
#include <vector>

namespace arhost::synthetic {

struct Sensor {
    double blur_px; // sigma of the lens' softness
    double noise;   // 1: as a small camera's indoors
    double exposure_ev;
    std::uint64_t seed;
};

// Where a card lies that may hide the marker, and how it is turned.
struct Card {
    Point at;
    double degrees;
};

struct Shot {
    std::span<const Mt> poses; // in the desk's units; several: the mean of them, for motion blur
    std::optional<Card> card;
    std::uint64_t sequence; // chooses the noise
};

class Renderer {
public:
    Renderer(const arhost_intrinsics &camera, const Sensor &sensor, int threads);

    // BGR, rows of `stride` bytes.
    void render(const Pyramid &desk, const Pyramid *card, const Shot &shot, uint8_t *bgr, std::size_t stride) const;

private:
    struct Node { // of the coarse grid, for what varies slowly over the image
        float step_u, step_v, lod;
        float gain;   // of the light, towards the image's corners
        float mirror; // light that a glossy surface adds
    };
    struct Plane { // (u, v) = (row 0, row 1) · ray / (row 2 · ray)
        std::array<std::array<float, 3>, 3> row;
        Vec3 eye;
        std::array<Vec3, 3> axes; // of the camera, x right, y down, z forward, in the desk's axes
    };
    struct Sweep;

    static Plane plane_of(const Mt &pose);
    std::vector<Node> nodes_of(const Plane &plane, const Pyramid &desk) const;
    void warp_span(int x, int y, const Sweep &sweep, Paint16 *out) const;
    struct Scratch;
    void develop_row(int y, const Sweep &sweep, Scratch &scratch, uint8_t *bgr) const;

    int width_, height_, threads_;
    int padded_; // width and a column more, up to whole spans
    // Directions at every lens_px-th pixel, linear between; (0, 0, 0) where no light arrives.
    static constexpr int lens_px = 4;
    int lens_columns_;
    std::vector<float> ray_[3];
    int grid_width_, grid_height_;
    double focal_px_;
    // Of the blur: the middle's weight, then that of each two neighbours; a channel has its own, given twice.
    std::vector<std::array<uint16_t, 8>> kernel_;
    // With light in units of full_scale:
    std::vector<uint8_t> srgb_;                 // code of light's square root
    float shot_, read2_;                        // variance of the noise = shot_·light + read2_
    std::vector<std::array<int16_t, 4>> grain_; // a tile of noise
    std::uint64_t seed_;
};

} // namespace arhost::synthetic
