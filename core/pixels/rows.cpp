// SPDX-License-Identifier: Apache-2.0
#include "pixels/rows.hpp"

#include "pixels/linear.hpp"

#include <algorithm>
#include <array>
#include <cstring>

// Highway compiles this file once for each instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pixels/rows.cpp"
#include <hwy/foreach_target.h>

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace arhost::rows::HWY_NAMESPACE {

using Bytes = const std::uint8_t *;

HWY_INLINE bool is_untouched(const std::uint16_t *pixel) {
    const auto expected = std::bit_cast<std::array<std::uint64_t, 2>>(untouched);
    std::uint64_t words[2];
    std::memcpy(words, pixel, sizeof words);
    return ((words[0] ^ expected[0]) | (words[1] ^ expected[1])) == 0;
}

#if HWY_TARGET == HWY_SCALAR
void add_light(Bytes bgr, const std::uint16_t *linear, std::uint8_t *out, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i, linear += 8)
        for (std::size_t c = 0; c < 3; ++c)
            out[3 * i + c] = is_untouched(linear)
                                 ? bgr[3 * i + c]
                                 : added_and_transmitted(linear[2 - c], linear[6 - c], bgr[3 * i + c]);
}

void interpolate_light(const std::uint16_t *above, const std::uint16_t *below, std::uint32_t row_weight,
                       const Between *columns, std::uint16_t *out, std::size_t count) {
    const auto mix = [](float a, float b, std::uint32_t weight) {
        return a + static_cast<float>(weight) / Between::one * (b - a);
    };
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t c = 0; c < 8; ++c) {
            const auto in_row = [&](const std::uint16_t *row) {
                return mix(float_of(row[8 * std::size_t{columns[i].first} + c]),
                           float_of(row[8 * std::size_t{columns[i].second} + c]), columns[i].weight);
            };
            out[8 * i + c] = half_of(mix(in_row(above), in_row(below), row_weight));
        }
}

void blend(Bytes bgr, Bytes rgba, std::uint8_t *out, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t c = 0; c < 3; ++c)
            out[3 * i + c] = blended(bgr[3 * i + c], rgba[4 * i + 2 - c], rgba[4 * i + 3]);
}

void put(const Bgr &pixel, std::uint8_t *bgr, std::size_t i) {
    std::memcpy(bgr + 3 * i, &pixel, 3);
}

void bgr_from_grey(Bytes grey, std::uint8_t *bgr, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        put({grey[i], grey[i], grey[i]}, bgr, i);
}
void bgr_from_rgb(Bytes rgb, std::uint8_t *bgr, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        put({rgb[3 * i + 2], rgb[3 * i + 1], rgb[3 * i]}, bgr, i);
}
void bgr_from_yuyv(Bytes yuyv, const YuvMatrix &matrix, std::uint8_t *bgr, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        put(bgr_from_yuv(matrix, yuyv[2 * i], yuyv[i / 2 * 4 + 1], yuyv[i / 2 * 4 + 3]), bgr, i);
}
void bgr_from_nv12(Bytes y, Bytes uv, const YuvMatrix &matrix, std::uint8_t *bgr, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        put(bgr_from_yuv(matrix, y[i], uv[i / 2 * 2], uv[i / 2 * 2 + 1]), bgr, i);
}
void bgr_from_i420(Bytes y, Bytes u, Bytes v, const YuvMatrix &matrix, std::uint8_t *bgr, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        put(bgr_from_yuv(matrix, y[i], u[i / 2], v[i / 2]), bgr, i);
}
void grey_from_bgr(Bytes bgr, std::uint8_t *grey, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        grey[i] = arhost::grey_from_rgb(bgr[3 * i + 2], bgr[3 * i + 1], bgr[3 * i]);
}
void grey_from_rgb(Bytes rgb, std::uint8_t *grey, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        grey[i] = arhost::grey_from_rgb(rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]);
}
void grey_from_yuyv(Bytes yuyv, bool limited, std::uint8_t *grey, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        grey[i] = limited ? full_range(yuyv[2 * i]) : yuyv[2 * i];
}
void grey_from_limited_luma(Bytes luma, std::uint8_t *grey, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        grey[i] = full_range(luma[i]);
}

#else
namespace hn = hwy::HWY_NAMESPACE;

const hn::ScalableTag<std::uint8_t> d8;
const hn::ScalableTag<std::uint16_t> d16;
const hn::ScalableTag<std::int16_t> di16;
const hn::ScalableTag<std::uint32_t> d32;
using V8 = hn::Vec<decltype(d8)>;
using V16 = hn::Vec<decltype(d16)>;
using VI16 = hn::Vec<decltype(di16)>;

// Divides a row into chunks. The number of pixels of a chunk equals the number of bytes of a vector. Calls chunk(in,
// out) for each chunk. `pair_bytes[i]` is the number of bytes of in[i] for two pixels. The last, incomplete chunk is
// processed in stack buffers, so that no bytes past the end of the row are accessed.
template <std::size_t streams, std::size_t out_bytes, class Chunk>
HWY_INLINE void for_each_chunk(std::array<Bytes, streams> in, const std::array<std::size_t, streams> &pair_bytes,
                               std::uint8_t *out, std::size_t count, const Chunk &chunk) {
    const std::size_t lanes = hn::Lanes(d8);
    for (; count >= lanes; count -= lanes, out += out_bytes * lanes) {
        chunk(in, out);
        for (std::size_t i = 0; i < streams; ++i)
            in[i] += lanes * pair_bytes[i] / 2;
    }
    if (count == 0)
        return;
    constexpr std::size_t max_lanes = hn::MaxLanes(hn::ScalableTag<std::uint8_t>());
    alignas(64) std::uint8_t rest[streams][4 * max_lanes] = {};
    alignas(64) std::uint8_t rest_out[out_bytes * max_lanes];
    for (std::size_t i = 0; i < streams; ++i) {
        std::memcpy(rest[i], in[i], count * pair_bytes[i] / 2);
        in[i] = rest[i];
    }
    chunk(in, rest_out);
    std::memcpy(out, rest_out, out_bytes * count);
}

// low_bytes and high_bytes keep only the low or the high byte of each 16-bit lane. even and odd widen the bytes at
// even or odd positions to 16 bits.
HWY_INLINE V16 low_bytes(V16 v) {
    return hn::And(v, hn::Set(d16, 0x00ff));
}
HWY_INLINE V16 high_bytes(V16 v) {
    return hn::And(v, hn::Set(d16, 0xff00));
}
HWY_INLINE V16 even(V8 v) {
    return low_bytes(hn::BitCast(d16, v));
}
HWY_INLINE V16 odd(V8 v) {
    return hn::ShiftRight<8>(hn::BitCast(d16, v));
}

// Returns round(x / 255) in the high byte of each lane, for x = 0 to 255² (J. Blinn, "Three Wrongs
// Make a Right", IEEE Computer Graphics & Applications 15(6), 1995).
HWY_INLINE V16 over_255_times_256(V16 x) {
    const V16 t = hn::Add(x, hn::Set(d16, 128));
    return hn::Add(t, hn::ShiftRight<8>(t));
}

class Mixer {
public:
    HWY_INLINE explicit Mixer(V8 alpha)
        : alpha_even_(even(alpha)), alpha_odd_(odd(alpha)), rest_even_(hn::Xor(alpha_even_, hn::Set(d16, 255))),
          rest_odd_(hn::Xor(alpha_odd_, hn::Set(d16, 255))) {}

    HWY_INLINE V8 operator()(V8 a, V8 b) const {
        const V16 e = hn::Add(hn::Mul(even(a), rest_even_), hn::Mul(even(b), alpha_even_));
        const V16 o = hn::Add(hn::Mul(odd(a), rest_odd_), hn::Mul(odd(b), alpha_odd_));
        return hn::BitCast(d8, hn::Or(hn::ShiftRight<8>(over_255_times_256(e)), high_bytes(over_255_times_256(o))));
    }

private:
    V16 alpha_even_, alpha_odd_, rest_even_, rest_odd_;
};

HWY_INLINE void blend_chunk(Bytes bgr, Bytes rgba, std::uint8_t *out) {
    const std::size_t lanes = hn::Lanes(d8), quarter = hn::Lanes(d32);
    // Fast paths, because most pixels of an overlay are transparent and most of the others are opaque.
    const auto *pixels = reinterpret_cast<const std::uint32_t *>(rgba);
    const auto p0 = hn::LoadU(d32, pixels), p1 = hn::LoadU(d32, pixels + quarter);
    const auto p2 = hn::LoadU(d32, pixels + 2 * quarter), p3 = hn::LoadU(d32, pixels + 3 * quarter);
    const auto alpha_bits = hn::Set(d32, 0xff000000u);
    const auto any = hn::And(hn::Or(hn::Or(p0, p1), hn::Or(p2, p3)), alpha_bits);
    if (hn::AllTrue(d32, hn::Eq(any, hn::Zero(d32)))) {
        if (bgr != out)
            std::memcpy(out, bgr, 3 * lanes);
        return;
    }
    V8 b_red, b_green, b_blue, alpha;
    hn::LoadInterleaved4(d8, rgba, b_red, b_green, b_blue, alpha);
    const auto all = hn::And(hn::And(hn::And(p0, p1), hn::And(p2, p3)), alpha_bits);
    if (hn::AllTrue(d32, hn::Eq(all, alpha_bits))) {
        hn::StoreInterleaved3(b_blue, b_green, b_red, d8, out);
        return;
    }
    V8 a_blue, a_green, a_red;
    hn::LoadInterleaved3(d8, bgr, a_blue, a_green, a_red);
    const Mixer mix(alpha);
    hn::StoreInterleaved3(mix(a_blue, b_blue), mix(a_green, b_green), mix(a_red, b_red), d8, out);
}

void blend(Bytes bgr, Bytes rgba, std::uint8_t *out, std::size_t count) {
    for_each_chunk<2, 3>({bgr, rgba}, {6, 8}, out, count,
                         [](const auto &in, std::uint8_t *to) HWY_ATTR { blend_chunk(in[0], in[1], to); });
}

const hn::FixedTag<float, 4> df4;
const hn::FixedTag<std::int32_t, 4> di4;

HWY_INLINE auto floats_of(const std::uint16_t *halves) {
#if HWY_ARCH_X86 && HWY_TARGET > HWY_AVX2 // Highway's emulation is wrong for infinity and NaN
    const float numbers[] = {float_of(halves[0]), float_of(halves[1]), float_of(halves[2]), float_of(halves[3])};
    return hn::LoadU(df4, numbers);
#else
    const hn::Rebind<hwy::float16_t, decltype(df4)> d_half;
    return hn::PromoteTo(df4, hn::LoadU(d_half, reinterpret_cast<const hwy::float16_t *>(halves)));
#endif
}

using Floats = decltype(hn::Zero(df4));

HWY_INLINE void store_halves(Floats numbers, std::uint16_t *halves) {
#if HWY_ARCH_X86 && HWY_TARGET > HWY_AVX2
    float each[4];
    hn::StoreU(numbers, df4, each);
    for (std::size_t i = 0; i < 4; ++i)
        halves[i] = half_of(each[i]);
#else
    const hn::Rebind<hwy::float16_t, decltype(df4)> d_half;
    hn::StoreU(hn::DemoteTo(d_half, numbers), d_half, reinterpret_cast<hwy::float16_t *>(halves));
#endif
}

HWY_INLINE Floats mix(Floats a, Floats b, std::uint32_t weight) {
    return hn::MulAdd(hn::Set(df4, static_cast<float>(weight) / Between::one), hn::Sub(b, a), a);
}

void interpolate_light(const std::uint16_t *above, const std::uint16_t *below, std::uint32_t row_weight,
                       const Between *columns, std::uint16_t *out, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t part = 0; part < 8; part += 4) { // added light, transmittance
            const auto in_row = [&](const std::uint16_t *row) HWY_ATTR {
                return mix(floats_of(row + 8 * std::size_t{columns[i].first} + part),
                           floats_of(row + 8 * std::size_t{columns[i].second} + part), columns[i].weight);
            };
            store_halves(mix(in_row(above), in_row(below), row_weight), out + 8 * i + part);
        }
}

// Works in steps over a chunk, because a vector load that follows the stores of its parts at once is slow.
void add_light(Bytes bgr, const std::uint16_t *linear, std::uint8_t *out, std::size_t count) {
    using Table = shading::Srgb8Table;
    const LightTables &tables = light_tables();
    const auto smallest = hn::Set(df4, Table::smallest), one = hn::Set(df4, 1.0f);
    constexpr std::size_t chunk = 32;
    alignas(16) float video[4 * chunk] = {};
    alignas(16) std::int32_t bits[4 * chunk];
    std::uint8_t changed[chunk]; // indices of the pixels that change the video
    for (std::size_t n; count > 0; count -= n, bgr += 3 * n, linear += 8 * n, out += 3 * n) {
        n = std::min(count, chunk);
        std::size_t changed_count = 0;
        for (std::size_t i = 0; i < n; ++i) {
            changed[changed_count] = static_cast<std::uint8_t>(i);
            changed_count += !is_untouched(linear + 8 * i);
        }
        for (std::size_t k = 0; k < changed_count; ++k)
            for (std::size_t c = 0; c < 3; ++c)
                video[4 * k + c] = tables.light_of[bgr[3 * changed[k] + 2 - c]];
        if (bgr != out)
            std::memcpy(out, bgr, 3 * n);
        for (std::size_t k = 0; k < changed_count; ++k) {
            const std::uint16_t *pixel = linear + 8 * std::size_t{changed[k]};
            const auto light = hn::Add(floats_of(pixel), hn::Mul(floats_of(pixel + 4), hn::Load(df4, video + 4 * k)));
            // As in Srgb8Table: NaN becomes black.
            const auto clamped = hn::IfThenElse(hn::Gt(light, smallest), hn::Min(light, one), smallest);
            hn::Store(hn::BitCast(di4, clamped), di4, bits + 4 * k);
        }
        for (std::size_t k = 0; k < changed_count; ++k)
            for (std::size_t c = 0; c < 3; ++c)
                out[3 * std::size_t{changed[k]} + 2 - c] =
                    static_cast<std::uint8_t>(tables.code_of.code_of_bits(bits[4 * k + c]));
    }
}

void bgr_from_grey(Bytes grey, std::uint8_t *bgr, std::size_t count) {
    for_each_chunk<1, 3>({grey}, {2}, bgr, count, [](const auto &in, std::uint8_t *to) HWY_ATTR {
        const V8 y = hn::LoadU(d8, in[0]);
        hn::StoreInterleaved3(y, y, y, d8, to);
    });
}

void bgr_from_rgb(Bytes rgb, std::uint8_t *bgr, std::size_t count) {
    for_each_chunk<1, 3>({rgb}, {6}, bgr, count, [](const auto &in, std::uint8_t *to) HWY_ATTR {
        V8 r, g, b;
        hn::LoadInterleaved3(d8, in[0], r, g, b);
        hn::StoreInterleaved3(b, g, r, d8, to);
    });
}

// Two adjacent pixels share a chroma sample, so the even and the odd pixels are processed in separate vectors.
// Saturating addition gives the same result as exact addition, because the sums are clamped to 255 afterwards.
class YuvConverter {
public:
    HWY_INLINE explicit YuvConverter(const YuvMatrix &matrix) : m_(matrix) {}

    HWY_INLINE void store(V16 y_even, V16 y_odd, V16 u, V16 v, std::uint8_t *bgr) const {
        const VI16 cu = chroma(u), cv = chroma(v), e = luma(y_even), o = luma(y_odd);
        const VI16 blue = times(cu, m_.bu), red = times(cv, m_.rv);
        const VI16 green = hn::Add(times(cu, m_.gu), times(cv, m_.gv));
        hn::StoreInterleaved3(bytes(hn::SaturatedAdd(e, blue), hn::SaturatedAdd(o, blue)),
                              bytes(hn::Sub(e, green), hn::Sub(o, green)),
                              bytes(hn::SaturatedAdd(e, red), hn::SaturatedAdd(o, red)), d8, bgr);
    }

private:
    HWY_INLINE static VI16 times(VI16 a, std::int16_t b) { return hn::MulFixedPoint15(a, hn::Set(di16, b)); }
    HWY_INLINE static VI16 chroma(V16 c) {
        return hn::ShiftLeft<8>(hn::Sub(hn::BitCast(di16, c), hn::Set(di16, 128)));
    }
    HWY_INLINE VI16 luma(V16 y) const { // includes the rounding offset
        const VI16 above = hn::Sub(hn::BitCast(di16, y), hn::Set(di16, m_.y_offset));
        return hn::Add(times(hn::ShiftLeft<7>(above), m_.yy), hn::Set(di16, 32));
    }
    HWY_INLINE static V16 byte(VI16 x) {
        const VI16 whole = hn::ShiftRight<6>(x);
        return hn::BitCast(d16, hn::Min(hn::Max(whole, hn::Zero(di16)), hn::Set(di16, 255)));
    }
    HWY_INLINE static V8 bytes(VI16 of_even, VI16 of_odd) {
        return hn::BitCast(d8, hn::Or(byte(of_even), hn::ShiftLeft<8>(byte(of_odd))));
    }

    const YuvMatrix &m_;
};

void bgr_from_yuyv(Bytes yuyv, const YuvMatrix &matrix, std::uint8_t *bgr, std::size_t count) {
    const YuvConverter converter(matrix);
    for_each_chunk<1, 3>({yuyv}, {4}, bgr, count, [&](const auto &in, std::uint8_t *to) HWY_ATTR {
        V16 y_u, y_v;
        hn::LoadInterleaved2(d16, reinterpret_cast<const std::uint16_t *>(in[0]), y_u, y_v);
        converter.store(low_bytes(y_u), low_bytes(y_v), hn::ShiftRight<8>(y_u), hn::ShiftRight<8>(y_v), to);
    });
}

void bgr_from_nv12(Bytes y, Bytes uv, const YuvMatrix &matrix, std::uint8_t *bgr, std::size_t count) {
    const YuvConverter converter(matrix);
    for_each_chunk<2, 3>({y, uv}, {2, 2}, bgr, count, [&](const auto &in, std::uint8_t *to) HWY_ATTR {
        const V8 luma = hn::LoadU(d8, in[0]), chroma = hn::LoadU(d8, in[1]);
        converter.store(even(luma), odd(luma), even(chroma), odd(chroma), to);
    });
}

void bgr_from_i420(Bytes y, Bytes u, Bytes v, const YuvMatrix &matrix, std::uint8_t *bgr, std::size_t count) {
    const YuvConverter converter(matrix);
    for_each_chunk<3, 3>({y, u, v}, {2, 1, 1}, bgr, count, [&](const auto &in, std::uint8_t *to) HWY_ATTR {
        const hn::Half<hn::ScalableTag<std::uint8_t>> half;
        const V8 luma = hn::LoadU(d8, in[0]);
        converter.store(even(luma), odd(luma), hn::PromoteTo(d16, hn::LoadU(half, in[1])),
                        hn::PromoteTo(d16, hn::LoadU(half, in[2])), to);
    });
}

// The inputs must be in the high bytes of the lanes, because MulHigh returns only the upper half of each product.
HWY_INLINE V16 weighted(V16 r, V16 g, V16 b) {
    const V16 sum =
        hn::Add(hn::MulHigh(r, hn::Set(d16, red_weight)),
                hn::Add(hn::MulHigh(g, hn::Set(d16, green_weight)), hn::MulHigh(b, hn::Set(d16, blue_weight))));
    return hn::Add(sum, hn::Set(d16, grey_rounding));
}

HWY_INLINE V8 grey_of(V8 r, V8 g, V8 b) {
    const V16 r16 = hn::BitCast(d16, r), g16 = hn::BitCast(d16, g), b16 = hn::BitCast(d16, b);
    const V16 e = weighted(hn::ShiftLeft<8>(r16), hn::ShiftLeft<8>(g16), hn::ShiftLeft<8>(b16));
    const V16 o = weighted(high_bytes(r16), high_bytes(g16), high_bytes(b16));
    return hn::BitCast(d8, hn::Or(hn::ShiftRight<8>(e), high_bytes(o)));
}

void grey_from_bgr(Bytes bgr, std::uint8_t *grey, std::size_t count) {
    for_each_chunk<1, 1>({bgr}, {6}, grey, count, [](const auto &in, std::uint8_t *to) HWY_ATTR {
        V8 b, g, r;
        hn::LoadInterleaved3(d8, in[0], b, g, r);
        hn::StoreU(grey_of(r, g, b), d8, to);
    });
}

void grey_from_rgb(Bytes rgb, std::uint8_t *grey, std::size_t count) {
    for_each_chunk<1, 1>({rgb}, {6}, grey, count, [](const auto &in, std::uint8_t *to) HWY_ATTR {
        V8 r, g, b;
        hn::LoadInterleaved3(d8, in[0], r, g, b);
        hn::StoreU(grey_of(r, g, b), d8, to);
    });
}

HWY_INLINE V16 expanded(V16 y) {
    const V16 above = hn::Min(hn::SaturatedSub(y, hn::Set(d16, 16)), hn::Set(d16, 219));
    const V16 scaled = hn::MulHigh(hn::ShiftLeft<8>(above), hn::Set(d16, full_range_gain)); // in units of 1/128
    return hn::ShiftRight<7>(hn::Add(scaled, hn::Set(d16, 64)));
}

void grey_from_yuyv(Bytes yuyv, bool limited, std::uint8_t *grey, std::size_t count) {
    for_each_chunk<1, 1>({yuyv}, {4}, grey, count, [&](const auto &in, std::uint8_t *to) HWY_ATTR {
        V16 y_u, y_v;
        hn::LoadInterleaved2(d16, reinterpret_cast<const std::uint16_t *>(in[0]), y_u, y_v);
        V16 e = low_bytes(y_u), o = low_bytes(y_v);
        if (limited) {
            e = expanded(e);
            o = expanded(o);
        }
        hn::StoreU(hn::BitCast(d8, hn::Or(e, hn::ShiftLeft<8>(o))), d8, to);
    });
}

void grey_from_limited_luma(Bytes luma, std::uint8_t *grey, std::size_t count) {
    for_each_chunk<1, 1>({luma}, {2}, grey, count, [](const auto &in, std::uint8_t *to) HWY_ATTR {
        const V8 y = hn::LoadU(d8, in[0]);
        hn::StoreU(hn::BitCast(d8, hn::Or(expanded(even(y)), hn::ShiftLeft<8>(expanded(odd(y))))), d8, to);
    });
}
#endif

} // namespace arhost::rows::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace arhost::rows {

HWY_EXPORT(blend);
HWY_EXPORT(add_light);
HWY_EXPORT(interpolate_light);
HWY_EXPORT(bgr_from_grey);
HWY_EXPORT(bgr_from_rgb);
HWY_EXPORT(bgr_from_yuyv);
HWY_EXPORT(bgr_from_nv12);
HWY_EXPORT(bgr_from_i420);
HWY_EXPORT(grey_from_bgr);
HWY_EXPORT(grey_from_rgb);
HWY_EXPORT(grey_from_yuyv);
HWY_EXPORT(grey_from_limited_luma);

void blend(const std::uint8_t *bgr, const std::uint8_t *rgba, std::uint8_t *out, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(blend)(bgr, rgba, out, count);
}
void add_light(const std::uint8_t *bgr, const std::uint16_t *linear, std::uint8_t *out, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(add_light)(bgr, linear, out, count);
}
void interpolate_light(const std::uint16_t *above, const std::uint16_t *below, std::uint32_t row_weight,
                       const Between *columns, std::uint16_t *out, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(interpolate_light)(above, below, row_weight, columns, out, count);
}
void bgr_from_grey(const std::uint8_t *grey, std::uint8_t *bgr, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(bgr_from_grey)(grey, bgr, count);
}
void bgr_from_rgb(const std::uint8_t *rgb, std::uint8_t *bgr, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(bgr_from_rgb)(rgb, bgr, count);
}
void bgr_from_yuyv(const std::uint8_t *yuyv, const YuvMatrix &matrix, std::uint8_t *bgr, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(bgr_from_yuyv)(yuyv, matrix, bgr, count);
}
void bgr_from_nv12(const std::uint8_t *y, const std::uint8_t *uv, const YuvMatrix &matrix, std::uint8_t *bgr,
                   std::size_t count) {
    HWY_DYNAMIC_DISPATCH(bgr_from_nv12)(y, uv, matrix, bgr, count);
}
void bgr_from_i420(const std::uint8_t *y, const std::uint8_t *u, const std::uint8_t *v, const YuvMatrix &matrix,
                   std::uint8_t *bgr, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(bgr_from_i420)(y, u, v, matrix, bgr, count);
}
void grey_from_bgr(const std::uint8_t *bgr, std::uint8_t *grey, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(grey_from_bgr)(bgr, grey, count);
}
void grey_from_rgb(const std::uint8_t *rgb, std::uint8_t *grey, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(grey_from_rgb)(rgb, grey, count);
}
void grey_from_yuyv(const std::uint8_t *yuyv, bool limited, std::uint8_t *grey, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(grey_from_yuyv)(yuyv, limited, grey, count);
}
void grey_from_limited_luma(const std::uint8_t *luma, std::uint8_t *grey, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(grey_from_limited_luma)(luma, grey, count);
}

} // namespace arhost::rows
#endif
