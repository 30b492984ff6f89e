// SPDX-License-Identifier: Apache-2.0
//
// An image of a plane at many resolutions. As in a clipmap, finer levels cover less: the middle, where the camera
// comes close, has the finest.
#pragma once

#include <opencv2/core.hpp>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace arhost::synthetic {

// Texels are red, green and blue as sRGB codes, where the largest code stands for `full_scale`, and a fourth channel.
// Filtering is done on codes: on linear light, the edges of a black square on white would appear inside their true
// place, because half the light is far more than half the code (docs/adr/0007).
using Texel = cv::Vec4b;
using Texel16 = std::array<uint16_t, 4>; // code · 256
inline constexpr float texel16_unit = 255 * 256;
inline constexpr float full_scale = 1.6f; // white in full light is 1

// The samples of sixteen pixels of a row. A pixel is sampled at two points, `step` before and after (u, v), which
// share the longer side of its footprint. `step` and `lod` are given at the first pixel and at the next span's first.
inline constexpr int span_px = 16;
struct Footprints {
    alignas(64) float u[span_px], v[span_px];
    std::array<float, 2> step_u, step_v, lod;
};

class Pyramid {
public:
    // `clips`: RGBA images of equal size, a power of two, first row at the top. The texels of the first are `texel`
    // long, those of each further one twice as long as before; what a finer one covers is ignored.
    Pyramid(std::span<const cv::Mat> clips, float texel);

    // Trilinear, with two samples per pixel.
    void sample(const Footprints &at, Texel16 (&out)[span_px]) const;

    // The finest level of detail that covers a point at distance `r` (the larger of |u| and |v|), with a soft
    // transition to the next before the level's border.
    float finest_at(float r) const;
    float texel() const { return levels_[0].texel; }

private:
    struct Level {
        float texel;
        int side;
        // Rows are longer than `side`: with a power of two, a column of texels would share few cache lines.
        cv::Mat_<Texel> texels;
        float half() const { return 0.5f * static_cast<float>(side) * texel; }
    };
    struct Taps { // of bilinear lookups: the upper left texel, and the weights of columns and rows
        alignas(64) std::int32_t index[span_px];
        alignas(64) std::uint32_t wx[span_px], wy[span_px];
    };
    static Taps taps(const Level &level, const Footprints &at, float direction, const float *weight);

    std::vector<Level> levels_;
};

} // namespace arhost::synthetic
