// SPDX-License-Identifier: Apache-2.0
//
// Vectors of eight 16-bit numbers: two texels, or the two columns of a bilinear lookup. Results are identical with
// and without SSE2.
#pragma once

#include <cstdint>
#include <cstring>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

// Compiles a function twice, with and without AVX2, and selects a version when the plugin is loaded. Both give the
// same results, because neither fuses multiplications and additions (-ffp-contract=off).
#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define ARHOST_WIDE [[gnu::target_clones("avx2", "default")]]
#else
#define ARHOST_WIDE
#endif

namespace arhost::synthetic {

// Packs two 16-bit weights, the first in the low half.
constexpr std::uint32_t pair_of(std::int32_t low, std::int32_t high) {
    return static_cast<std::uint32_t>(low) | static_cast<std::uint32_t>(high) << 16;
}

#if defined(__SSE2__)

struct U16x8 {
    __m128i lanes;
    static U16x8 load(const void *p) { return {_mm_loadu_si128(static_cast<const __m128i *>(p))}; }
    static U16x8 load_bytes(const void *p) { // loads eight bytes and multiplies them by 256
        return {_mm_unpacklo_epi8(_mm_setzero_si128(), _mm_loadl_epi64(static_cast<const __m128i *>(p)))};
    }
    static U16x8 low_of(std::uint32_t pair) { // the low weight in all lanes
        return {_mm_shuffle_epi32(doubled(pair), 0x00)};
    }
    static U16x8 high_of(std::uint32_t pair) { return {_mm_shuffle_epi32(doubled(pair), 0x55)}; }
    static U16x8
    spread(std::uint32_t pair) { // the low weight in the lower four lanes, the high weight in the upper four
        return {_mm_shuffle_epi32(doubled(pair), 0x50)};
    }
    void store(void *p) const { _mm_storeu_si128(static_cast<__m128i *>(p), lanes); }
    void store_folded(void *p) const { // stores the sums of the lower and the upper four lanes
        _mm_storel_epi64(static_cast<__m128i *>(p), _mm_add_epi16(lanes, _mm_srli_si128(lanes, 8)));
    }
    friend U16x8 operator+(U16x8 a, U16x8 b) { return {_mm_add_epi16(a.lanes, b.lanes)}; }
    friend U16x8 mean(U16x8 a, U16x8 b) { return {_mm_avg_epu16(a.lanes, b.lanes)}; }    // rounded up
    friend U16x8 times(U16x8 a, U16x8 b) { return {_mm_mulhi_epu16(a.lanes, b.lanes)}; } // a·b/65536

private:
    static __m128i doubled(std::uint32_t pair) {
        const __m128i w = _mm_cvtsi32_si128(static_cast<int>(pair));
        return _mm_unpacklo_epi16(w, w); // low low high high
    }
};

#else

struct U16x8 {
    std::uint16_t lane[8];
    template <class Value> static U16x8 each(Value value) {
        U16x8 r;
        for (int i = 0; i < 8; ++i)
            r.lane[i] = static_cast<std::uint16_t>(value(i));
        return r;
    }
    static U16x8 load(const void *p) {
        U16x8 r;
        std::memcpy(r.lane, p, sizeof r.lane);
        return r;
    }
    static U16x8 load_bytes(const void *p) {
        std::uint8_t bytes[8];
        std::memcpy(bytes, p, sizeof bytes);
        return each([&](int i) { return bytes[i] << 8; });
    }
    static U16x8 low_of(std::uint32_t pair) {
        return each([&](int) { return pair; });
    }
    static U16x8 high_of(std::uint32_t pair) {
        return each([&](int) { return pair >> 16; });
    }
    static U16x8 spread(std::uint32_t pair) {
        return each([&](int i) { return i < 4 ? pair : pair >> 16; });
    }
    void store(void *p) const { std::memcpy(p, lane, sizeof lane); }
    void store_folded(void *p) const {
        const U16x8 sum = each([&](int i) { return lane[i % 4] + lane[i % 4 + 4]; });
        std::memcpy(p, sum.lane, 8);
    }
    friend U16x8 operator+(U16x8 a, U16x8 b) {
        return each([&](int i) { return a.lane[i] + b.lane[i]; });
    }
    friend U16x8 mean(U16x8 a, U16x8 b) {
        return each([&](int i) { return (a.lane[i] + b.lane[i] + 1) >> 1; });
    }
    friend U16x8 times(U16x8 a, U16x8 b) {
        return each([&](int i) { return (std::uint32_t{a.lane[i]} * b.lane[i]) >> 16; });
    }
};

#endif

} // namespace arhost::synthetic
