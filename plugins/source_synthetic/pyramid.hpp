// SPDX-License-Identifier: Apache-2.0
//
// An image of a plane at many resolutions. As in a clipmap, finer levels cover a smaller area around the middle,
// which the camera approaches most closely.
#pragma once

#include <opencv2/core.hpp>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace arhost::synthetic {

// A texel has three sRGB codes (red, green, blue) and a fourth channel. The largest code represents `full_scale`.
// Filtering works on the codes instead of linear light. With linear light, the edges of a black square on white would
// appear inside their true position, because half the light has far more than half the code (docs/adr/0007).
using Texel = cv::Vec4b;
using Texel16 = std::array<uint16_t, 4>; // code · 256
inline constexpr float texel16_unit = 255 * 256;
inline constexpr float full_scale = 1.6f; // white in full light is 1

// Sample positions of a span: sixteen pixels of a row. Each pixel is sampled at the two points (u, v) ± step, which
// represent the two halves of its footprint's longer side. `step` and `lod` are interpolated between two values, one
// for the first pixel of this span and one for the first pixel of the next span.
inline constexpr int span_px = 16;
struct Footprints {
    alignas(64) float u[span_px], v[span_px];
    std::array<float, 2> step_u, step_v, lod;
};

class Pyramid {
public:
    // `clips` are RGBA images of equal size, which is a power of two; the top row is first. `texel` is the side of a
    // texel in the first clip. Each further clip has texels of twice the size of the previous clip. The area that a
    // finer clip covers is ignored in coarser clips.
    Pyramid(std::span<const cv::Mat> clips, float texel);

    // Samples with trilinear filtering and two samples per pixel.
    void sample(const Footprints &at, Texel16 (&out)[span_px]) const;

    // Returns the finest level of detail that covers a point at distance `r` (the larger of |u| and |v|). Near the
    // border of a level, the result increases gradually towards the next level.
    float finest_at(float r) const;
    float texel() const { return levels_[0].texel; }

private:
    struct Level {
        float texel;
        int side;
        // Rows are padded to more than `side` texels. If their length were a power of two, the texels of a column
        // would compete for a few cache sets.
        cv::Mat_<Texel> texels;
        float half() const { return 0.5f * static_cast<float>(side) * texel; }
    };
    struct Taps { // bilinear lookups: index of the upper left texel, and weights of the columns and rows
        alignas(64) std::int32_t index[span_px];
        alignas(64) std::uint32_t wx[span_px], wy[span_px];
    };
    static Taps taps(const Level &level, const Footprints &at, float direction, const float *weight);

    std::vector<Level> levels_;
};

} // namespace arhost::synthetic
