// SPDX-License-Identifier: Apache-2.0
//
// A plane's picture at many resolutions. Finer levels cover less, as a clipmap's do: the
// middle, where the camera comes near, is finest.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace arhost::synthetic {

// Red, green and blue, encoded by sRGB's curve (1 stands for `full_scale`), and a fourth channel that means
// what the painter says; all 0 to 1. Filtering is done in these codes. Were it done in linear light, the
// edges of a black square on white would be seen inside of where they are, since half the light is far more
// than half of the code; markers' corners would then not lie where the pose puts them.
using Paint = std::array<float, 4>;
using Paint16 = std::array<uint16_t, 4>; // the same times paint_unit
inline constexpr float paint_unit = 255 * 256;
inline constexpr float full_scale = 1.6f; // white in full light is 1

// Paints a row of texels: their centres are at (x + i·texel, y).
using PaintRow = std::function<void(float x, float y, float texel, std::span<Paint> row)>;

struct PyramidSize {
    int side;          // texels of each level, a power of two, until `half_extent` is reached
    float texel;       // length of the finest level's
    float half_extent; // the whole covers ± this, side·texel/2 times a power of two
};

// Sixteen pixels of a row to look up. `step` is half the distance of the two samples of a pixel, which
// share the footprint's longer side; what a pair holds is at the span's first pixel and at the next span's.
inline constexpr int span_px = 16;
struct Footprints {
    alignas(64) float u[span_px], v[span_px];
    std::array<float, 2> step_u, step_v, lod;
};

class Pyramid {
public:
    // Rows are painted on `threads` threads; `progress` (0 to 1) is called on the caller's.
    Pyramid(PyramidSize size, int threads, const PaintRow &paint, const std::function<void(double)> &progress);

    // Trilinear at two samples a pixel.
    void sample(const Footprints &at, Paint16 (&out)[span_px]) const;

    // The finest level of detail that holds a point at the distance `r` (the larger of |u| and |v|), with
    // a soft step to the next before its end.
    float finest_at(float r) const;
    float texel() const { return levels_[0].texel; }

private:
    using Texel = std::array<uint8_t, 4>;
    struct Level {
        float texel;
        int side;
        std::vector<Texel> texels;
        // Of a row. Were it a power of two, the texels below one another would share the same few cache lines.
        int pitch() const { return side + 16; }
        std::size_t size() const { return static_cast<std::size_t>(pitch()) * side; }
        const Texel *row(int y) const { return texels.data() + static_cast<std::size_t>(pitch()) * y; }
        Texel *row(int y) { return texels.data() + static_cast<std::size_t>(pitch()) * y; }
        float half() const { return 0.5f * static_cast<float>(side) * texel; }
    };
    struct Taps { // of bilinear look-ups: the upper left texel, and the weights of columns and rows
        alignas(64) std::int32_t index[span_px];
        alignas(64) std::uint32_t wx[span_px], wy[span_px];
    };
    static void encode(std::span<const Paint> row, int y, Texel *out);
    static void shrink(const Level &fine, Level &coarse);
    static Taps taps(const Level &level, const Footprints &at, float direction, const float *weight);

    std::vector<Level> levels_;
};

} // namespace arhost::synthetic
