// SPDX-License-Identifier: Apache-2.0
#include "pyramid.hpp"

#include "parallel.hpp"
#include "simd.hpp"

#include <algorithm>
#include <cmath>

namespace arhost::synthetic {
Pyramid::Pyramid(PyramidSize size, int threads, const PaintRow &paint, const std::function<void(double)> &progress) {
    const int painted =
        1 +
        static_cast<int>(std::lround(std::log2(2 * size.half_extent / (static_cast<float>(size.side) * size.texel))));
    for (int k = 0; k < painted; ++k) {
        Level level{std::ldexp(size.texel, k), size.side, {}};
        level.texels.resize(level.size());
        const int quarter = k ? level.side / 4 : 0; // the middle comes from the finer level
        const float origin = (0.5f - 0.5f * static_cast<float>(level.side)) * level.texel;
        const auto paint_rows = [&](int first, int last) {
            std::vector<Paint> colours(level.side);
            for (int row = first; row < last; ++row) {
                const float y = origin + static_cast<float>(row) * level.texel;
                const auto paint_part = [&](int from, int count) {
                    const std::span part = std::span(colours).first(count);
                    paint(origin + static_cast<float>(from) * level.texel, y, level.texel, part);
                    encode(part, row, level.row(row) + from);
                };
                if (quarter && row >= quarter && row < level.side - quarter) {
                    paint_part(0, quarter);
                    paint_part(level.side - quarter, quarter);
                } else {
                    paint_part(0, level.side);
                }
            }
        };
        constexpr int batch = 128; // rows between two reports
        for (int row = 0; row < level.side; row += batch) {
            const int count = std::min(batch, level.side - row);
            in_parallel(count, threads, [&](int first, int last) { paint_rows(row + first, row + last); });
            progress((k + static_cast<double>(row + count) / level.side) / painted);
        }
        if (k)
            shrink(levels_.back(), level);
        levels_.push_back(std::move(level));
    }
    while (levels_.back().side > 4) {
        Level level{2 * levels_.back().texel, levels_.back().side / 2, {}};
        level.texels.resize(level.size());
        shrink(levels_.back(), level);
        levels_.push_back(std::move(level));
    }
}

// Rounded at random, so that soft shades show no steps.
void Pyramid::encode(std::span<const Paint> row, int y, Texel *out) {
    for (std::size_t x = 0; x < row.size(); ++x) {
        std::uint32_t dice =
            static_cast<std::uint32_t>(x) * 0x9e3779b1u ^ static_cast<std::uint32_t>(y) * 0x85ebca77u;
        dice = (dice ^ dice >> 15) * 0x2c1b3c6du;
        dice = (dice ^ dice >> 12) * 0x297a2d39u;
        for (int c = 0; c < 4; ++c, dice = dice << 8 | dice >> 24) {
            const float code = std::clamp(row[x][c], 0.0f, 1.0f) * 255 + static_cast<float>(dice >> 8) * 0x1p-24f;
            out[x][c] = static_cast<uint8_t>(std::min(code, 255.0f));
        }
    }
}

// Each of the coarse texels that `fine` covers is the mean of the sixteen about it, weighted 1 3 3 1 both
// ways: smoother than a box, so that what is out of focus shows no stairs.
void Pyramid::shrink(const Level &fine, Level &coarse) {
    const int half = fine.side / 2, margin = (coarse.side - half) / 2;
    const auto inside = [&](int i) { return std::clamp(i, 0, fine.side - 1); };
    std::vector<std::array<std::uint32_t, 4>> column(fine.side); // the sum of four rows
    std::vector<Paint> mean(half);
    for (int y = 0; y < half; ++y) {
        const Texel *row[4];
        for (int i = 0; i < 4; ++i)
            row[i] = fine.row(inside(2 * y - 1 + i));
        for (int x = 0; x < fine.side; ++x)
            for (int c = 0; c < 4; ++c)
                column[x][c] = row[0][x][c] + 3u * (row[1][x][c] + row[2][x][c]) + row[3][x][c];
        for (int x = 0; x < half; ++x)
            for (int c = 0; c < 4; ++c)
                mean[x][c] = static_cast<float>(column[inside(2 * x - 1)][c] + column[inside(2 * x + 2)][c] +
                                                3 * (column[2 * x][c] + column[2 * x + 1][c])) /
                             (64 * 255);
        encode(mean, margin + y, coarse.row(margin + y) + margin);
    }
}

float Pyramid::finest_at(float r) const {
    float lod = 0;
    for (const Level &level : levels_) {
        if (level.half() >= levels_.back().half())
            break; // covers all
        const float inside = r / level.half();
        if (inside < 0.7f)
            break;
        lod += std::min(1.0f, (inside - 0.7f) / 0.25f);
        if (inside < 0.95f)
            break;
    }
    return lod;
}

[[gnu::always_inline]] inline Pyramid::Taps Pyramid::taps(const Level &level, const Footprints &at, float direction,
                                                          const float *weight) {
    const float scale = 1 / level.texel, centre = 0.5f * static_cast<float>(level.side) - 0.5f;
    const float end = static_cast<float>(level.side) - 1.01f, pitch = static_cast<float>(level.pitch());
    const float step_u = direction * at.step_u[0], slope_u = direction * (at.step_u[1] - at.step_u[0]) / span_px;
    const float step_v = direction * at.step_v[0], slope_v = direction * (at.step_v[1] - at.step_v[0]) / span_px;
    Taps taps;
    for (int i = 0; i < span_px; ++i) {
        const float along = static_cast<float>(i);
        float s = (at.u[i] + (step_u + slope_u * along)) * scale + centre;
        float t = (at.v[i] + (step_v + slope_v * along)) * scale + centre;
        s = s > 0 ? s : 0; // NaN too
        t = t > 0 ? t : 0;
        s = s < end ? s : end;
        t = t < end ? t : end;
        const float column = static_cast<float>(static_cast<std::int32_t>(s));
        const float row = static_cast<float>(static_cast<std::int32_t>(t));
        taps.index[i] = static_cast<std::int32_t>(row * pitch + column); // exact: below 2^24
        const float right = (s - column) * weight[i];
        taps.wx[i] = pair_of(static_cast<std::int32_t>(weight[i] - right), static_cast<std::int32_t>(right));
        const auto below = static_cast<std::int32_t>((t - row) * 65535.0f);
        taps.wy[i] = pair_of(65535 - below, below);
    }
    return taps;
}

ARHOST_WIDE void Pyramid::sample(const Footprints &at, Paint16 (&out)[span_px]) const {
    const float last = static_cast<float>(levels_.size() - 1);
    const float middle = std::clamp(0.5f * (at.lod[0] + at.lod[1]), 0.0f, last);
    const int k = std::min(static_cast<int>(middle), static_cast<int>(levels_.size()) - 2);
    constexpr float whole = 32767.5f; // 65535/2: two samples a pixel
    float fine[span_px], coarse[span_px], fine_total = 0, coarse_total = 0;
    for (int i = 0; i < span_px; ++i) {
        const float along = static_cast<float>(i) / span_px;
        float share = at.lod[0] + (at.lod[1] - at.lod[0]) * along - static_cast<float>(k);
        share = 2 * share - 0.5f; // most spans need but one of the two levels
        share = share > 0 ? share : 0;
        share = share < 1 ? share : 1;
        coarse[i] = whole * share;
        fine[i] = whole - coarse[i];
        fine_total += fine[i];
        coarse_total += coarse[i];
    }
    // The two rows blended by wy, then the two columns weighted by wx, still side by side.
    const auto look_up = [](const Level &level, const Taps &taps, int i) {
        const Texel *upper = level.texels.data() + taps.index[i], *lower = upper + level.pitch();
        const U16x8 column = times(U16x8::load_bytes(upper), U16x8::low_of(taps.wy[i])) +
                             times(U16x8::load_bytes(lower), U16x8::high_of(taps.wy[i]));
        return times(column, U16x8::spread(taps.wx[i]));
    };
    const bool has_fine = fine_total > 0, has_both = has_fine && coarse_total > 0;
    const Level &near = levels_[has_fine ? k : k + 1], &far = levels_[k + 1];
    const float *near_weight = has_fine ? fine : coarse;
    const Taps a = taps(near, at, -1, near_weight), b = taps(near, at, +1, near_weight);
    if (has_both) {
        const Taps c = taps(far, at, -1, coarse), d = taps(far, at, +1, coarse);
        for (int i = 0; i < span_px; ++i)
            (look_up(near, a, i) + look_up(near, b, i) + look_up(far, c, i) + look_up(far, d, i))
                .store_folded(&out[i]);
    } else {
        for (int i = 0; i < span_px; ++i)
            (look_up(near, a, i) + look_up(near, b, i)).store_folded(&out[i]);
    }
}

} // namespace arhost::synthetic
