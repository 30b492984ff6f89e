// SPDX-License-Identifier: Apache-2.0
//
// SIMD types with 16 lanes, like Embree's widest ray packets: Float, Bool and Int. Each consists of compiler vectors
// that are as wide as the processor's registers.
//
// Code that uses them is compiled once per instruction set, each in its own namespace (ARHOST_ISA), so that code for
// one instruction set is never linked into another. For the same reason it calls no inline functions of the standard
// library.
//
// The Highway library is not used: its vectors are as wide as a register, so every formula would need a loop over the
// 16 lanes. The attribute target_clones is not used either: GCC lowers vector types to the base instruction set
// before it clones the function.
#pragma once

#include <arhost/shading/vec3.hpp>

#include <utility>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace arhost::raytracer_common::ARHOST_ISA {

#define ARHOST_INLINE inline __attribute__((always_inline))
// A large function with several callers. Packets are passed by reference: how they are passed by value depends on the
// instruction set.
#define ARHOST_FUNCTION __attribute__((noinline))

inline constexpr int lanes = 16;
#if defined(__AVX512F__)
inline constexpr int width = 16; // 4-byte values per register
#elif defined(__AVX2__)
inline constexpr int width = 8;
#else
inline constexpr int width = 4;
#endif

typedef float FloatPart __attribute__((vector_size(4 * width)));
typedef int IntPart __attribute__((vector_size(4 * width)));
typedef unsigned UnsignedPart __attribute__((vector_size(4 * width)));

// The registers that hold `count` lanes, as nested halves. An array would be simpler, but GCC keeps arrays in memory,
// and members in registers.
template <class Part, int count> struct Wide { Wide<Part, count / 2> low, high; };
template <class Part> struct Wide<Part, width> { Part part; };

// Computes `to` = `op`(`from`…) register by register.
template <class Op, class To, class... From> ARHOST_INLINE void apply(Op op, To &to, const From &...from) {
    if constexpr (requires { to.part; }) {
        to.part = op(from.part...);
    } else {
        apply(op, to.low, from.low...);
        apply(op, to.high, from.high...);
    }
}

// The body of a function of the packets `a` (and `b`) that returns a `Type`. Evaluates `expression` for each
// register; `expression` refers to the registers of `a` and `b` as `a_` and `b_`.
#define ARHOST_UNARY(Type, expression)                                                                               \
    Type to;                                                                                                         \
    apply(                                                                                                           \
        [](auto a_) __attribute__((always_inline)) { return expression; }, to.lane, a.lane);                         \
    return to
#define ARHOST_BINARY(Type, expression)                                                                              \
    Type to;                                                                                                         \
    apply(                                                                                                           \
        [](auto a_, auto b_) __attribute__((always_inline)) { return expression; }, to.lane, a.lane, b.lane);        \
    return to

// Each lane is 0 (false) or −1 (true).
struct alignas(64) Bool {
    Wide<IntPart, lanes> lane;
    ARHOST_INLINE friend Bool operator&(Bool a, Bool b) { ARHOST_BINARY(Bool, a_ & b_); }
    ARHOST_INLINE friend Bool operator|(Bool a, Bool b) { ARHOST_BINARY(Bool, a_ | b_); }
    ARHOST_INLINE friend Bool operator~(Bool a) { ARHOST_UNARY(Bool, ~a_); }
};

struct alignas(64) Int {
    Wide<IntPart, lanes> lane;
    Int() = default;
    ARHOST_INLINE Int(int s) {
        apply(
            [s]() __attribute__((always_inline)) { return IntPart{} + s; }, lane);
    }
    ARHOST_INLINE friend Int operator+(Int a, Int b) { ARHOST_BINARY(Int, a_ + b_); }
    ARHOST_INLINE friend Int operator-(Int a, Int b) { ARHOST_BINARY(Int, a_ - b_); }
    ARHOST_INLINE friend Int operator&(Int a, Int b) { ARHOST_BINARY(Int, a_ & b_); }
    ARHOST_INLINE friend Int operator|(Int a, Int b) { ARHOST_BINARY(Int, a_ | b_); }
    ARHOST_INLINE friend Int operator^(Int a, Int b) { ARHOST_BINARY(Int, a_ ^ b_); }
    ARHOST_INLINE friend Int operator<<(Int a, Int b) { ARHOST_BINARY(Int, a_ << b_); }
    ARHOST_INLINE friend Int operator>>(Int a, Int b) { ARHOST_BINARY(Int, a_ >> b_); }
    ARHOST_INLINE friend Bool operator==(Int a, Int b) { ARHOST_BINARY(Bool, a_ == b_); }
    ARHOST_INLINE friend Bool operator!=(Int a, Int b) { ARHOST_BINARY(Bool, a_ != b_); }
    ARHOST_INLINE friend Int operator*(Int a, Int b) { ARHOST_BINARY(Int, a_ * b_); }
    ARHOST_INLINE friend Bool operator<(Int a, Int b) { ARHOST_BINARY(Bool, a_ < b_); }
    ARHOST_INLINE friend Bool operator>=(Int a, Int b) { ARHOST_BINARY(Bool, a_ >= b_); }
};

struct alignas(64) Float {
    Wide<FloatPart, lanes> lane;
    Float() = default;
    ARHOST_INLINE Float(float s) {
        apply(
            [s]() __attribute__((always_inline)) { return FloatPart{} + s; }, lane);
    }
    ARHOST_INLINE explicit Float(double s) : Float(static_cast<float>(s)) {}
    ARHOST_INLINE friend Float operator-(Float a) { ARHOST_UNARY(Float, -a_); }
    ARHOST_INLINE friend Float operator+(Float a, Float b) { ARHOST_BINARY(Float, a_ + b_); }
    ARHOST_INLINE friend Float operator-(Float a, Float b) { ARHOST_BINARY(Float, a_ - b_); }
    ARHOST_INLINE friend Float operator*(Float a, Float b) { ARHOST_BINARY(Float, a_ * b_); }
    ARHOST_INLINE friend Float operator/(Float a, Float b) { ARHOST_BINARY(Float, a_ / b_); }
    ARHOST_INLINE friend Bool operator<(Float a, Float b) { ARHOST_BINARY(Bool, a_ < b_); }
    ARHOST_INLINE friend Bool operator>(Float a, Float b) { ARHOST_BINARY(Bool, a_ > b_); }
    ARHOST_INLINE friend Bool operator>=(Float a, Float b) { ARHOST_BINARY(Bool, a_ >= b_); }
    ARHOST_INLINE friend Bool operator==(Float a, Float b) { ARHOST_BINARY(Bool, a_ == b_); }
};

using Vec3 = shading::Vec3T<Float>;

ARHOST_INLINE Bool bool_of(bool b) {
    Bool a;
    apply(
        [b]() __attribute__((always_inline)) { return IntPart{} - static_cast<int>(b); }, a.lane);
    return a;
}
// min() and max() return `b` if `a` is NaN.
ARHOST_INLINE Float min(Float a, Float b) {
    ARHOST_BINARY(Float, a_ < b_ ? a_ : b_);
}
ARHOST_INLINE Float max(Float a, Float b) {
    ARHOST_BINARY(Float, a_ > b_ ? a_ : b_);
}

template <class T> ARHOST_INLINE T select_lanes(Bool b, T yes, T no) {
    T to;
    apply(
        [](auto b_, auto yes_, auto no_) __attribute__((always_inline)) { return b_ ? yes_ : no_; }, to.lane, b.lane,
        yes.lane, no.lane);
    return to;
}
ARHOST_INLINE Float select(Bool b, Float yes, Float no) {
    return select_lanes(b, yes, no);
}
ARHOST_INLINE Int select(Bool b, Int yes, Int no) {
    return select_lanes(b, yes, no);
}
ARHOST_INLINE Vec3 select(Bool b, Vec3 yes, Vec3 no) {
    return {select(b, yes.x, no.x), select(b, yes.y, no.y), select(b, yes.z, no.z)};
}

ARHOST_INLINE Float to_float(Int a) {
    ARHOST_UNARY(Float, __builtin_convertvector(a_, FloatPart));
}
// Rounds towards 0.
ARHOST_INLINE Int to_int(Float a) {
    ARHOST_UNARY(Int, __builtin_convertvector(a_, IntPart));
}
ARHOST_INLINE Int bits_of(Float a) {
    ARHOST_UNARY(Int, reinterpret_cast<IntPart>(a_));
}
ARHOST_INLINE Float float_of(Int a) {
    ARHOST_UNARY(Float, reinterpret_cast<FloatPart>(a_));
}
ARHOST_INLINE Float floor(Float a) {
    const Float whole = to_float(to_int(a));
    return whole - select(whole > a, Float(1.0f), Float(0.0f));
}
ARHOST_INLINE Float abs(Float a) {
    return max(a, -a);
}
ARHOST_INLINE Vec3 vec3(Float x, Float y, Float z) {
    return {x, y, z};
}
ARHOST_INLINE Int shift_right_unsigned(Int a, int bits) {
    Int to;
    apply(
        [bits](auto a_) __attribute__((always_inline)) {
            return reinterpret_cast<IntPart>(reinterpret_cast<UnsignedPart>(a_) >> bits);
        },
        to.lane, a.lane);
    return to;
}

// Reverses the bytes of each lane.
#if defined(__SSE2__) && !defined(__SSSE3__) // SSE2 cannot shuffle bytes
ARHOST_INLINE Int reversed_bytes(Int a) {
    a = (shift_right_unsigned(a, 8) & Int(0x00ff00ff)) | ((a & Int(0x00ff00ff)) << Int(8));
    return shift_right_unsigned(a, 16) | (a << Int(16));
}
#else
typedef char BytePart __attribute__((vector_size(4 * width)));
template <int... i> ARHOST_INLINE BytePart reversed_bytes(BytePart a, std::integer_sequence<int, i...>) {
    return __builtin_shufflevector(a, a, (i ^ 3)...);
}
ARHOST_INLINE Int reversed_bytes(Int a) {
    using Numbers = std::make_integer_sequence<int, 4 * width>;
    ARHOST_UNARY(Int, reinterpret_cast<IntPart>(reversed_bytes(reinterpret_cast<BytePart>(a_), Numbers{})));
}
#endif

ARHOST_INLINE FloatPart sqrt_of(FloatPart a) {
#if defined(__AVX512F__)
    return _mm512_maskz_sqrt_ps(0xffff, a);
#elif defined(__AVX2__)
    return _mm256_sqrt_ps(a);
#elif defined(__SSE2__)
    return _mm_sqrt_ps(a);
#else
    for (int i = 0; i < width; ++i)
        a[i] = __builtin_sqrtf(a[i]);
    return a;
#endif
}
ARHOST_INLINE Float sqrt(Float a) {
    ARHOST_UNARY(Float, sqrt_of(a_));
}
ARHOST_INLINE Float length(Vec3 a) {
    return sqrt(dot(a, a));
}
ARHOST_INLINE Vec3 normalize(Vec3 a) {
    return a * (Float(1.0f) / length(a));
}

// Returns one bit per lane: 1 if the lane is true.
ARHOST_INLINE unsigned mask_of(Wide<IntPart, width> b) {
#if defined(__AVX512DQ__)
    return _mm512_movepi32_mask(reinterpret_cast<__m512i>(b.part));
#elif defined(__AVX2__)
    return static_cast<unsigned>(_mm256_movemask_ps(reinterpret_cast<__m256>(b.part)));
#elif defined(__SSE2__)
    return static_cast<unsigned>(_mm_movemask_ps(reinterpret_cast<__m128>(b.part)));
#else
    unsigned mask = 0;
    for (int i = 0; i < width; ++i)
        mask |= static_cast<unsigned>(b.part[i] & 1) << i;
    return mask;
#endif
}
template <int count> ARHOST_INLINE unsigned mask_of(Wide<IntPart, count> b) {
    return mask_of(b.low) | mask_of(b.high) << (count / 2);
}
ARHOST_INLINE bool any(Bool b) {
    return mask_of(b.lane) != 0;
}

ARHOST_INLINE IntPart gather(const int *table, IntPart index) {
#if defined(__AVX512F__)
    return reinterpret_cast<IntPart>(
        _mm512_mask_i32gather_epi32(__m512i{}, 0xffff, reinterpret_cast<__m512i>(index), table, 4));
#elif defined(__AVX2__)
    return reinterpret_cast<IntPart>(_mm256_i32gather_epi32(table, reinterpret_cast<__m256i>(index), 4));
#else
    for (int i = 0; i < width; ++i)
        index[i] = table[index[i]];
    return index;
#endif
}
ARHOST_INLINE Int gather(const int *table, Int a) {
    Int to;
    apply(
        [table](auto index) __attribute__((always_inline)) { return gather(table, index); }, to.lane, a.lane);
    return to;
}
ARHOST_INLINE Float gather(const float *table, Int index) {
    return float_of(gather(reinterpret_cast<const int *>(table), index));
}

// Returns elements 0 to 15 of a table of 16 elements; with AVX-512 in a few cycles.
ARHOST_INLINE Float pick(const float *table, Int index) {
#if defined(__AVX512F__)
    Int to;
    to.lane.part = reinterpret_cast<IntPart>(_mm512_maskz_permutexvar_epi32(
        0xffff, reinterpret_cast<__m512i>(index.lane.part), _mm512_maskz_loadu_epi32(0xffff, table)));
    return float_of(to);
#else
    return gather(table, index);
#endif
}

// Loading and storing packets as arrays of 16 values, the layout of Embree's ray packets. These functions copy one
// register at a time: GCC would copy a whole packet in pieces of half a register, and the processor cannot forward
// two such stores to one load.
template <class To> ARHOST_INLINE void load_registers(To &to, const void *from) {
    if constexpr (requires { to.part; }) {
        __builtin_memcpy(&to.part, from, sizeof to.part);
    } else {
        load_registers(to.low, from);
        load_registers(to.high, static_cast<const char *>(from) + sizeof to.low);
    }
}
template <class From> ARHOST_INLINE void store_registers(void *to, const From &from) {
    if constexpr (requires { from.part; }) {
        __builtin_memcpy(to, &from.part, sizeof from.part);
    } else {
        store_registers(to, from.low);
        store_registers(static_cast<char *>(to) + sizeof from.low, from.high);
    }
}
ARHOST_INLINE Float load(const float *from) {
    Float a;
    load_registers(a.lane, from);
    return a;
}
ARHOST_INLINE Int load(const int *from) {
    Int a;
    load_registers(a.lane, from);
    return a;
}
ARHOST_INLINE Int load(const unsigned *from) {
    return load(reinterpret_cast<const int *>(from));
}
ARHOST_INLINE void store(float *to, Float a) {
    store_registers(to, a.lane);
}
ARHOST_INLINE void store(int *to, Int a) {
    store_registers(to, a.lane);
}
ARHOST_INLINE void store(unsigned *to, Int a) {
    store_registers(to, a.lane);
}
ARHOST_INLINE void store(int *to, Bool a) {
    store_registers(to, a.lane);
}

// Returns log2(a) with an error of at most 2e-7; `a` must be positive and not denormal. Splits `a` into an exponent
// and a mantissa m in [√½, √2), and computes log2(m) = 2 atanh(s) / ln 2, where s = (m − 1)/(m + 1), as an odd power
// series.
ARHOST_INLINE Float log2(Float a) {
    const Int bits = bits_of(a) - Int(0x3f3504f3); // the bits of √½
    const Int exponent = bits >> Int(23);
    const Float m = float_of(bits_of(a) - (exponent << Int(23)));
    const Float s = (m - Float(1.0f)) / (m + Float(1.0f)), s2 = s * s;
    const Float series = Float(2.88539008f) +
                         s2 * (Float(0.961796694f) +
                               s2 * (Float(0.577078016f) + s2 * (Float(0.412198583f) + s2 * Float(0.320598898f))));
    return to_float(exponent) + s * series;
}

// Returns 2^a with a relative error of at most 2e-7. The integer part of `a` becomes the exponent; the fraction f,
// from −½ to ½, is the argument of a Taylor series of e^(f ln 2).
ARHOST_INLINE Float exp2(Float a) {
    const Float x = min(max(a, Float(-126.0f)), Float(127.0f));
    const Float whole = floor(x + Float(0.5f)), f = x - whole;
    const Float series =
        Float(1.0f) +
        f * (Float(0.693147182f) +
             f * (Float(0.240226507f) +
                  f * (Float(0.0555041087f) +
                       f * (Float(0.00961812911f) + f * (Float(0.00133335581f) + f * Float(0.000154035304f))))));
    return series * float_of((to_int(whole) + Int(127)) << Int(23));
}

ARHOST_INLINE Float pow(Float a, Float b) { // requires a > 0
    return exp2(b * log2(a));
}

// Returns sin(2πt) with an error of at most 6e-8: reduces t to [−¼, ¼] and evaluates a Taylor series.
ARHOST_INLINE Float sine_of_turn(Float t) {
    const Float x = t - floor(t + Float(0.5f)); // from −½ to ½
    const Float folded = select(abs(x) > Float(0.25f), select(x < Float(0.0f), Float(-0.5f), Float(0.5f)) - x, x);
    const Float a = folded * Float(6.28318531f), a2 = a * a;
    return a * (Float(1.0f) + a2 * (Float(-0.166666667f) +
                                    a2 * (Float(0.00833333333f) +
                                          a2 * (Float(-0.000198412698f) +
                                                a2 * (Float(2.75573192e-6f) + a2 * Float(-2.50521084e-8f))))));
}
ARHOST_INLINE Float cosine_of_turn(Float t) {
    return sine_of_turn(t + Float(0.25f));
}
// Returns the angle from the y axis to the vector (x, y), positive towards the x axis, in turns from −½ to ½. The
// error is at most 2e-6 (Abramowitz and Stegun, 4.4.49).
ARHOST_INLINE Float turn_of(Float x, Float y) {
    const Float ax = abs(x), ay = abs(y);
    const Float q = min(ax, ay) / max(max(ax, ay), Float(1e-30f)), q2 = q * q;
    const Float angle =
        q *
        (Float(0.9998660f) +
         q2 * (Float(-0.3302995f) + q2 * (Float(0.1801410f) + q2 * (Float(-0.0851330f) + q2 * Float(0.0208351f)))));
    const Float turn = angle * Float(0.159154943f);
    const Float folded = select(ax > ay, Float(0.25f) - turn, turn);
    const Float half = select(y < Float(0.0f), Float(0.5f) - folded, folded);
    return select(x < Float(0.0f), -half, half);
}

#define ARHOST_LEAF ARHOST_INLINE
#include <arhost/shading/leaf/colour.h>

#include <arhost/shading/leaf/alpha.h>
#include <arhost/shading/leaf/bsdf.h>
#include <arhost/shading/leaf/environment.h>
#include <arhost/shading/leaf/film.h>
#include <arhost/shading/leaf/lens.h>
#include <arhost/shading/leaf/light.h>
#include <arhost/shading/leaf/sampling.h>
#include <arhost/shading/leaf/sheen.h>
#include <arhost/shading/leaf/surface.h>
#undef ARHOST_LEAF
#undef ARHOST_UNARY
#undef ARHOST_BINARY

} // namespace arhost::raytracer_common::ARHOST_ISA
