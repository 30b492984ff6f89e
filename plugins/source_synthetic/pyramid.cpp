// SPDX-License-Identifier: Apache-2.0
#include "pyramid.hpp"

#include "simd.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>

namespace arhost::synthetic {

Pyramid::Pyramid(std::span<const cv::Mat> clips, float texel) {
    constexpr int smallest_side = 4;
    for (int side = clips[0].cols; side >= smallest_side; texel *= 2) {
        Level level{texel, side, cv::Mat_<Texel>(side, side + 16, Texel())};
        cv::Mat image = level.texels.colRange(0, side);
        if (levels_.size() < clips.size())
            clips[levels_.size()].copyTo(image);
        if (!levels_.empty()) {
            // Each texel is the mean of sixteen finer texels, with the weights 1 3 3 1 in both directions. This is
            // smoother than a box filter, which would cause visible steps where the image is out of focus.
            const Level &finer = levels_.back();
            cv::Mat smooth = finer.texels.colRange(0, finer.side)
                                 .clone(); // a copy, because OpenCV would otherwise also read the padding
            cv::GaussianBlur(smooth, smooth, {3, 3}, 0, 0, cv::BORDER_REPLICATE); // weights 1 2 1
            const int half = finer.side / 2, margin = (side - half) / 2;
            cv::Mat middle = image(cv::Rect(margin, margin, half, half));
            cv::resize(smooth, middle, middle.size(), 0, 0, cv::INTER_AREA);
        }
        levels_.push_back(std::move(level));
        if (levels_.size() >= clips.size())
            side /= 2;
    }
}

float Pyramid::finest_at(float r) const {
    float lod = 0;
    for (const Level &level : levels_) {
        if (level.half() >= levels_.back().half())
            break; // this level covers the whole plane
        const float position = r / level.half();
        if (position < 0.7f)
            break;
        lod += std::min(1.0f, (position - 0.7f) / 0.25f);
        if (position < 0.95f)
            break;
    }
    return lod;
}

[[gnu::always_inline]] inline Pyramid::Taps Pyramid::taps(const Level &level, const Footprints &at, float direction,
                                                          const float *weight) {
    const float scale = 1 / level.texel, centre = 0.5f * static_cast<float>(level.side) - 0.5f;
    const float end = static_cast<float>(level.side) - 1.01f, pitch = static_cast<float>(level.texels.cols);
    const float step_u = direction * at.step_u[0], slope_u = direction * (at.step_u[1] - at.step_u[0]) / span_px;
    const float step_v = direction * at.step_v[0], slope_v = direction * (at.step_v[1] - at.step_v[0]) / span_px;
    Taps taps;
    for (int i = 0; i < span_px; ++i) {
        const float along = static_cast<float>(i);
        float s = (at.u[i] + (step_u + slope_u * along)) * scale + centre;
        float t = centre - (at.v[i] + (step_v + slope_v * along)) * scale;
        s = s > 0 ? s : 0; // also maps NaN to 0
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

ARHOST_WIDE void Pyramid::sample(const Footprints &at, Texel16 (&out)[span_px]) const {
    const float last = static_cast<float>(levels_.size() - 1);
    const float middle = std::clamp(0.5f * (at.lod[0] + at.lod[1]), 0.0f, last);
    const int k = std::min(static_cast<int>(middle), static_cast<int>(levels_.size()) - 2);
    constexpr float whole = 32767.5f; // 65535/2, because each pixel has two samples
    float fine[span_px], coarse[span_px], fine_total = 0, coarse_total = 0;
    for (int i = 0; i < span_px; ++i) {
        const float along = static_cast<float>(i) / span_px;
        float share = at.lod[0] + (at.lod[1] - at.lod[0]) * along - static_cast<float>(k);
        share = 2 * share - 0.5f; // shortens the transition, so most spans need only one of the two levels
        share = share > 0 ? share : 0;
        share = share < 1 ? share : 1;
        coarse[i] = whole * share;
        fine[i] = whole - coarse[i];
        fine_total += fine[i];
        coarse_total += coarse[i];
    }
    // Blends the two rows with wy, then multiplies the two columns with wx. store_folded() adds the columns.
    const auto lookup = [](const Level &level, const Taps &taps, int i) {
        const Texel *upper = level.texels[0] + taps.index[i], *lower = upper + level.texels.cols;
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
            (lookup(near, a, i) + lookup(near, b, i) + lookup(far, c, i) + lookup(far, d, i)).store_folded(&out[i]);
    } else {
        for (int i = 0; i < span_px; ++i)
            (lookup(near, a, i) + lookup(near, b, i)).store_folded(&out[i]);
    }
}

} // namespace arhost::synthetic
