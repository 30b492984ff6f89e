// SPDX-License-Identifier: Apache-2.0
#include "pixels/rows.hpp"

#include "fenced_bytes.hpp"
#include "instruction_sets.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <numeric>
#include <random>
#include <string>
#include <tuple>
#include <vector>

namespace arhost {
namespace {

using Bytes = std::vector<std::uint8_t>;
using test::FencedBytes;

using Run = std::function<void(const std::vector<const std::uint8_t *> &in, std::uint8_t *out, std::size_t count)>;

struct Kernel {
    std::string name;
    std::vector<std::size_t> bytes_per_2px; // of each input
    std::size_t out_bytes_per_px;
    std::size_t step_px; // the number of pixels is a multiple of it
    Run run, expected;
};

void put(const Bgr &pixel, std::uint8_t *to) {
    to[0] = pixel.b;
    to[1] = pixel.g;
    to[2] = pixel.r;
}

std::vector<Kernel> kernels() {
    const YuvMatrix m = yuv_matrix(0.2126, 0.0722, true);
    std::vector<Kernel> kernels;
    // `pixel(in, i, to)` writes the expected value of pixel i to `to`.
    const auto add = [&](Kernel kernel, auto pixel) {
        kernel.expected = [=, bytes = kernel.out_bytes_per_px](auto &in, auto *out, auto count) {
            for (std::size_t i = 0; i < count; ++i)
                pixel(in, i, out + bytes * i);
        };
        kernels.push_back(std::move(kernel));
    };
    const Run blend = [](auto &in, auto *out, auto n) { rows::blend(in[0], in[1], out, n); };
    add({"blend", {6, 8}, 3, 1, blend, {}}, [](auto &in, auto i, auto *to) {
        for (std::size_t c = 0; c < 3; ++c)
            to[c] = blended(in[0][3 * i + c], in[1][4 * i + 2 - c], in[1][4 * i + 3]);
    });
    const Run bgr_from_grey = [](auto &in, auto *out, auto n) { rows::bgr_from_grey(in[0], out, n); };
    add({"bgr_from_grey", {2}, 3, 1, bgr_from_grey, {}}, [](auto &in, auto i, auto *to) {
        put(Bgr{in[0][i], in[0][i], in[0][i]}, to);
    });
    const Run bgr_from_rgb = [](auto &in, auto *out, auto n) { rows::bgr_from_rgb(in[0], out, n); };
    add({"bgr_from_rgb", {6}, 3, 1, bgr_from_rgb, {}}, [](auto &in, auto i, auto *to) {
        put(Bgr{in[0][3 * i + 2], in[0][3 * i + 1], in[0][3 * i]}, to);
    });
    const Run bgr_from_yuyv = [=](auto &in, auto *out, auto n) { rows::bgr_from_yuyv(in[0], m, out, n); };
    add({"bgr_from_yuyv", {4}, 3, 2, bgr_from_yuyv, {}}, [=](auto &in, auto i, auto *to) {
        put(bgr_from_yuv(m, in[0][2 * i], in[0][i / 2 * 4 + 1], in[0][i / 2 * 4 + 3]), to);
    });
    const Run bgr_from_nv12 = [=](auto &in, auto *out, auto n) { rows::bgr_from_nv12(in[0], in[1], m, out, n); };
    add({"bgr_from_nv12", {2, 2}, 3, 2, bgr_from_nv12, {}}, [=](auto &in, auto i, auto *to) {
        put(bgr_from_yuv(m, in[0][i], in[1][i / 2 * 2], in[1][i / 2 * 2 + 1]), to);
    });
    const Run bgr_from_i420 = [=](auto &in, auto *out, auto n) {
        rows::bgr_from_i420(in[0], in[1], in[2], m, out, n);
    };
    add({"bgr_from_i420", {2, 1, 1}, 3, 2, bgr_from_i420, {}},
        [=](auto &in, auto i, auto *to) { put(bgr_from_yuv(m, in[0][i], in[1][i / 2], in[2][i / 2]), to); });
    const Run grey_from_bgr = [](auto &in, auto *out, auto n) { rows::grey_from_bgr(in[0], out, n); };
    add({"grey_from_bgr", {6}, 1, 1, grey_from_bgr, {}},
        [](auto &in, auto i, auto *to) { *to = grey_from_rgb(in[0][3 * i + 2], in[0][3 * i + 1], in[0][3 * i]); });
    const Run grey_from_rgb_row = [](auto &in, auto *out, auto n) { rows::grey_from_rgb(in[0], out, n); };
    add({"grey_from_rgb", {6}, 1, 1, grey_from_rgb_row, {}},
        [](auto &in, auto i, auto *to) { *to = grey_from_rgb(in[0][3 * i], in[0][3 * i + 1], in[0][3 * i + 2]); });
    for (const bool is_limited : {true, false}) {
        const Run run = [=](auto &in, auto *out, auto n) { rows::grey_from_yuyv(in[0], is_limited, out, n); };
        add({is_limited ? "grey_from_yuyv, limited" : "grey_from_yuyv, full", {4}, 1, 2, run, {}},
            [=](auto &in, auto i, auto *to) { *to = is_limited ? full_range(in[0][2 * i]) : in[0][2 * i]; });
    }
    const Run expand = [](auto &in, auto *out, auto n) { rows::grey_from_limited_luma(in[0], out, n); };
    add({"grey_from_limited_luma", {2}, 1, 1, expand, {}},
        [](auto &in, auto i, auto *to) { *to = full_range(in[0][i]); });
    return kernels;
}

} // namespace

// All input and output buffers are next to guard pages, so out-of-bounds accesses crash.
TEST(Rows, MatchTheFormulasForEveryLengthAndAccessNoOtherBytes) {
    test::on_each_instruction_set([] {
        std::mt19937 random(1);
        for (const Kernel &kernel : kernels())
            for (const FencedBytes::Side side : {FencedBytes::at_front, FencedBytes::at_back})
                for (std::size_t count = kernel.step_px; count <= 130; count += kernel.step_px) {
                    std::vector<std::unique_ptr<FencedBytes>> inputs;
                    std::vector<const std::uint8_t *> in;
                    for (const std::size_t per_2px : kernel.bytes_per_2px) {
                        inputs.push_back(std::make_unique<FencedBytes>(count * per_2px / 2, side));
                        std::generate_n(inputs.back()->data(), inputs.back()->size(), std::ref(random));
                        in.push_back(inputs.back()->data());
                    }
                    const FencedBytes out(count * kernel.out_bytes_per_px, side);
                    kernel.run(in, out.data(), count);
                    Bytes expected(out.size());
                    kernel.expected(in, expected.data(), count);
                    ASSERT_TRUE(std::equal(expected.begin(), expected.end(), out.data()))
                        << kernel.name << ", " << count << " pixels";
                }
    });
}

TEST(Rows, BlendEveryCombinationOfColoursAndAlpha) {
    test::on_each_instruction_set([] {
        Bytes a(3 * 256), b(4 * 256), out(3 * 256), expected(3 * 256);
        for (std::size_t i = 0; i < 256; ++i)
            b[4 * i + 3] = static_cast<std::uint8_t>(
                i); // consecutive alphas, so that no chunk is uniformly transparent or opaque
        for (int ca = 0; ca < 256; ++ca)
            for (int cb = 0; cb < 256; ++cb) {
                std::fill(a.begin(), a.end(), static_cast<std::uint8_t>(ca));
                for (std::size_t i = 0; i < 256; ++i) {
                    std::fill_n(&b[4 * i], 3, static_cast<std::uint8_t>(cb));
                    std::fill_n(&expected[3 * i], 3, blended(ca, cb, static_cast<int>(i)));
                }
                rows::blend(a.data(), b.data(), out.data(), 256);
                ASSERT_EQ(out, expected) << "A " << ca << ", B " << cb;
            }
    });
}

TEST(Rows, BlendEmptyAndOpaqueRunsAndTheirEdges) {
    test::on_each_instruction_set([] {
        std::mt19937 random(2);
        constexpr std::size_t count = 300;
        Bytes a(3 * count), b(4 * count), out(3 * count), expected(3 * count);
        for (const std::uint8_t background : {0, 255})
            for (std::size_t length = 0; length <= 140; length += 7)
                for (std::size_t at = 0; at + length <= count; at += 13) {
                    std::generate(a.begin(), a.end(), std::ref(random));
                    std::generate(b.begin(), b.end(), std::ref(random));
                    for (std::size_t i = 0; i < count; ++i) {
                        if (i < at || i >= at + length)
                            b[4 * i + 3] = background;
                        for (std::size_t c = 0; c < 3; ++c)
                            expected[3 * i + c] = blended(a[3 * i + c], b[4 * i + 2 - c], b[4 * i + 3]);
                    }
                    rows::blend(a.data(), b.data(), out.data(), count);
                    ASSERT_EQ(out, expected) << "other alphas from " << at << ", " << length << " long";
                    rows::blend(a.data(), b.data(), a.data(), count);
                    ASSERT_EQ(a, expected) << "in place";
                }
    });
}

class EveryYuvRow : public testing::TestWithParam<std::tuple<double, double, bool>> {}; // kr, kb, limited

TEST_P(EveryYuvRow, MatchesTheFormula) {
    const YuvMatrix m = std::apply([](auto... of) { return yuv_matrix(of...); }, GetParam());
    Bytes y(256), u(128), v(128), out(3 * 256), expected(3 * 256);
    std::iota(y.begin(), y.end(), std::uint8_t(0));
    test::on_each_instruction_set([&] {
        for (int cu = 0; cu < 256; ++cu)
            for (int cv = 0; cv < 256; ++cv) {
                std::fill(u.begin(), u.end(), static_cast<std::uint8_t>(cu));
                std::fill(v.begin(), v.end(), static_cast<std::uint8_t>(cv));
                for (int i = 0; i < 256; ++i)
                    put(bgr_from_yuv(m, i, cu, cv), &expected[3 * static_cast<std::size_t>(i)]);
                rows::bgr_from_i420(y.data(), u.data(), v.data(), m, out.data(), 256);
                ASSERT_EQ(out, expected) << "U " << cu << ", V " << cv;
            }
    });
}
INSTANTIATE_TEST_SUITE_P(Matrices, EveryYuvRow,
                         testing::Values(std::tuple(0.299, 0.114, true), std::tuple(0.299, 0.114, false),
                                         std::tuple(0.2126, 0.0722, true), std::tuple(0.2126, 0.0722, false)));

} // namespace arhost
