// SPDX-License-Identifier: Apache-2.0
#include "compositor/compositor.hpp"
#include "pixels/formulas.hpp"

#include "../pixels/instruction_sets.hpp"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <random>
#include <vector>

namespace arhost {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr arhost_pixel_format all_formats[] = {ARHOST_PIXEL_FORMAT_GREY8, ARHOST_PIXEL_FORMAT_RGB8,
                                               ARHOST_PIXEL_FORMAT_BGR8,  ARHOST_PIXEL_FORMAT_YUYV,
                                               ARHOST_PIXEL_FORMAT_NV12,  ARHOST_PIXEL_FORMAT_I420};

arhost_frame_format layout(arhost_pixel_format pixel_format, std::uint32_t width, std::uint32_t height,
                           arhost_yuv_matrix matrix = ARHOST_YUV_MATRIX_BT601,
                           arhost_yuv_range range = ARHOST_YUV_RANGE_LIMITED) {
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = pixel_format;
    format.width = width;
    format.height = height;
    format.yuv_matrix = matrix;
    format.yuv_range = range;
    EXPECT_TRUE(arhost_frame_layout(&format));
    return format;
}

bool has_chroma_pairs(arhost_pixel_format format) {
    return format == ARHOST_PIXEL_FORMAT_YUYV || format == ARHOST_PIXEL_FORMAT_NV12 ||
           format == ARHOST_PIXEL_FORMAT_I420;
}

// A frame and an overlay with random contents. A `shift` other than 0 makes all pointers unaligned and all strides
// odd.
struct Scene {
    Scene(arhost_frame_format laid_out, std::size_t shift, std::mt19937 &random) : format(laid_out) {
        for (std::uint32_t p = 0; p < format.plane_count; ++p)
            format.stride[p] += static_cast<std::uint32_t>(shift);
        for (std::uint32_t p = 0; p < format.plane_count; ++p) {
            plane_bytes[p].resize(std::size_t(format.stride[p]) * format.height + shift);
            std::generate(plane_bytes[p].begin(), plane_bytes[p].end(), std::ref(random));
            planes[p] = plane_bytes[p].data() + shift;
        }
        overlay_stride = 4 * std::size_t(format.width) + 5 * shift;
        overlay_bytes.resize(overlay_stride * format.height + shift);
        // The overlay consists of runs of transparent, opaque and other pixels.
        for (std::size_t i = 0, alpha = 0, run = 0; i < overlay_bytes.size(); ++i) {
            if (run-- == 0) {
                alpha = random() % 3;
                run = random() % 400;
            }
            const auto any = static_cast<std::uint8_t>(random());
            overlay_bytes[i] = alpha == 0 && i >= shift && (i - shift) % overlay_stride % 4 == 3   ? 0
                               : alpha == 1 && i >= shift && (i - shift) % overlay_stride % 4 == 3 ? 255
                                                                                                   : any;
        }
        out_stride = 3 * std::size_t(format.width) + 7 * shift;
        out_shift = shift;
    }
    ImageView overlay() const { return {overlay_bytes.data() + out_shift, overlay_stride}; }

    // Returns what `function` writes, including the bytes between and around the rows.
    template <class Function>
    Bytes output(const Function &function, const ImageView &image, const Region &region) const {
        Bytes bytes(out_stride * format.height + out_shift + 100, 0xa5);
        function(format, planes, image, region, OutputView{bytes.data() + out_shift, out_stride});
        return bytes;
    }

    arhost_frame_format format;
    Bytes plane_bytes[ARHOST_MAX_PLANES], overlay_bytes;
    const std::uint8_t *planes[ARHOST_MAX_PLANES] = {};
    std::size_t overlay_stride = 0, out_stride = 0, out_shift = 0;
};

bool contains(const Region &region, std::size_t x, std::size_t y) {
    return x >= region.x && x - region.x < region.width && y >= region.y && y - region.y < region.height;
}

Bgr pixel(const arhost_frame_format &format, const std::uint8_t *const planes[], std::size_t x, std::size_t y) {
    const auto row = [&](std::size_t plane, std::size_t at) { return planes[plane] + at * format.stride[plane]; };
    const std::uint8_t *first = row(0, y);
    const YuvMatrix matrix = yuv_matrix(format);
    switch (format.pixel_format) {
    case ARHOST_PIXEL_FORMAT_GREY8:
        return {first[x], first[x], first[x]};
    case ARHOST_PIXEL_FORMAT_RGB8:
        return {first[3 * x + 2], first[3 * x + 1], first[3 * x]};
    case ARHOST_PIXEL_FORMAT_YUYV:
        return bgr_from_yuv(matrix, first[2 * x], first[x / 2 * 4 + 1], first[x / 2 * 4 + 3]);
    case ARHOST_PIXEL_FORMAT_NV12:
        return bgr_from_yuv(matrix, first[x], row(1, y / 2)[x / 2 * 2], row(1, y / 2)[x / 2 * 2 + 1]);
    case ARHOST_PIXEL_FORMAT_I420:
        return bgr_from_yuv(matrix, first[x], row(1, y / 2)[x / 2], row(2, y / 2)[x / 2]);
    default:
        return {first[3 * x], first[3 * x + 1], first[3 * x + 2]};
    }
}

// Writes the same bytes as composite(), but processes one pixel at a time.
void composite_reference(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
                         const ImageView &overlay, const Region &region, const OutputView &out) {
    for (std::size_t y = 0; y < format.height; ++y)
        for (std::size_t x = 0; x < format.width; ++x) {
            Bgr c = pixel(format, planes, x, y);
            if (contains(region, x, y)) {
                const std::uint8_t *rgba = overlay.at(x, y);
                c = {blended(c.b, rgba[2], rgba[3]), blended(c.g, rgba[1], rgba[3]), blended(c.r, rgba[0], rgba[3])};
            }
            std::memcpy(out.bgr + y * out.stride + 3 * x, &c, 3);
        }
}

} // namespace

TEST(Composite, MatchesTheReferenceForEveryFormatWidthStrideAndRegion) {
    test::on_each_instruction_set([] {
        std::mt19937 random(4);
        for (const arhost_pixel_format pixel_format : all_formats)
            for (const arhost_yuv_matrix matrix : {ARHOST_YUV_MATRIX_BT601, ARHOST_YUV_MATRIX_BT709})
                for (const arhost_yuv_range range : {ARHOST_YUV_RANGE_LIMITED, ARHOST_YUV_RANGE_FULL}) {
                    const std::uint32_t step = has_chroma_pairs(pixel_format) ? 2 : 1;
                    for (std::uint32_t width = step; width <= 130; width += step) {
                        const Scene scene(layout(pixel_format, width, 4, matrix, range), random() % 4, random);
                        const std::uint32_t x = random() % width, y = random() % 4, w = 1 + random() % width;
                        for (const Region &region : {Region{0, 0, width, 4}, Region{x, y, w, 2}})
                            ASSERT_EQ(scene.output(composite, scene.overlay(), region),
                                      scene.output(composite_reference, scene.overlay(), region))
                                << "format " << pixel_format << ", width " << width << ", region from " << region.x;
                    }
                }
    });
}

TEST(Composite, ImplementsEquation36) {
    const arhost_frame_format format = layout(ARHOST_PIXEL_FORMAT_BGR8, 4, 1);
    Bytes frame(format.byte_size);
    const std::uint8_t bgr[] = {10, 20, 30, 10, 20, 30, 10, 20, 30, 200, 100, 50};
    std::copy(std::begin(bgr), std::end(bgr), frame.begin());
    const std::uint8_t rgba[] = {1, 2, 3, 0, 1, 2, 3, 255, 0, 0, 0, 153, 60, 90, 120, 128};
    const std::uint8_t *planes[ARHOST_MAX_PLANES] = {frame.data()};
    Bytes out(12);
    composite(format, planes, {rgba, 16}, {0, 0, 4, 1}, {out.data(), 12});
    EXPECT_EQ(out, (Bytes{10, 20, 30, // alpha 0: the video frame's pixel
                          3, 2, 1,    // alpha 255: the overlay's pixel, converted to BGR
                          4, 8, 12,   // black with alpha 0.6 (a shadow): 40 % of the video frame's pixel
                          160, 95, 55}));
}

TEST(Composite, CopiesTheFrameWithoutOverlayOrRegion) {
    std::mt19937 random(5);
    const Scene scene(layout(ARHOST_PIXEL_FORMAT_BGR8, 67, 5), 1, random);
    const Bytes none = scene.output(composite, ImageView{}, Region{0, 0, 67, 5});
    for (std::size_t y = 0; y < 5; ++y)
        EXPECT_EQ(std::memcmp(none.data() + scene.out_shift + y * scene.out_stride,
                              scene.planes[0] + y * scene.format.stride[0], 3 * 67),
                  0);
    EXPECT_EQ(scene.output(composite, scene.overlay(), Region{}), none);
    EXPECT_EQ(scene.output(composite, scene.overlay(), Region{5, 2, 0, 3}), none);
    EXPECT_EQ(scene.output(composite, scene.overlay(), Region{67, 0, 1, 1}), none);
    EXPECT_EQ(scene.output(composite, scene.overlay(), Region{0, 5, 1, 1}), none);
}

TEST(Composite, ClipsTheRegionToTheImage) {
    std::mt19937 random(6);
    const Scene scene(layout(ARHOST_PIXEL_FORMAT_NV12, 66, 6), 3, random);
    const std::uint32_t max = 0xffffffffu;
    EXPECT_EQ(scene.output(composite, scene.overlay(), Region{7, 1, max, max}),
              scene.output(composite, scene.overlay(), Region{7, 1, 59, 5}));
    EXPECT_EQ(scene.output(composite, scene.overlay(), Region{max, max, max, max}),
              scene.output(composite, ImageView{}, Region{}));
}

// Each row of the overlay is one memory page. Pages outside the region are inaccessible, so any access crashes.
TEST(Composite, DoesNotReadTheOverlayOutsideTheRegion) {
    const std::uint32_t page = static_cast<std::uint32_t>(getpagesize()), width = page / 4, height = 8;
    const Region region{0, 3, width, 2};
    auto *rgba =
        static_cast<std::uint8_t *>(mmap(nullptr, page * height, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
    ASSERT_NE(rgba, MAP_FAILED);
    ASSERT_EQ(mprotect(rgba + page * region.y, page * region.height, PROT_READ | PROT_WRITE), 0);
    std::memset(rgba + page * region.y, 255, page * region.height);
    for (const arhost_pixel_format pixel_format : all_formats) {
        const arhost_frame_format format = layout(pixel_format, width, height);
        const Bytes frame(format.byte_size, 40);
        const std::uint8_t *planes[ARHOST_MAX_PLANES] = {
            frame.data() + format.offset[0], frame.data() + format.offset[1], frame.data() + format.offset[2]};
        Bytes out(3 * std::size_t(width) * height);
        composite(format, planes, {rgba, page}, region, {out.data(), 3 * std::size_t(width)});
        EXPECT_EQ(out[3 * std::size_t(width) * 3], 255);
        EXPECT_NE(out[3 * std::size_t(width) * 5], 255);
    }
    munmap(rgba, page * height);
}

TEST(Composite, ConvertsBt601LikeOpenCv) {
    std::mt19937 random(7);
    const int codes[] = {cv::COLOR_YUV2BGR_YUY2, cv::COLOR_YUV2BGR_NV12, cv::COLOR_YUV2BGR_I420};
    const arhost_pixel_format formats[] = {ARHOST_PIXEL_FORMAT_YUYV, ARHOST_PIXEL_FORMAT_NV12,
                                           ARHOST_PIXEL_FORMAT_I420};
    for (int i = 0; i < 3; ++i) {
        constexpr int width = 128,
                      height = 64; // a size without row padding, because OpenCV's planar images have none
        const arhost_frame_format format = layout(formats[i], width, height);
        Bytes frame(format.byte_size);
        // Luma starts at 16 because OpenCV clamps smaller values.
        std::generate(frame.begin(), frame.end(), [&] { return static_cast<std::uint8_t>(16 + random() % 224); });
        const std::uint8_t *planes[ARHOST_MAX_PLANES] = {
            frame.data() + format.offset[0], frame.data() + format.offset[1], frame.data() + format.offset[2]};
        cv::Mat ours(height, width, CV_8UC3), opencv, difference;
        composite(format, planes, {}, {}, {ours.data, ours.step});
        if (formats[i] ==
            ARHOST_PIXEL_FORMAT_I420) { // chroma rows are aligned to 64 bytes; width / 2 is a multiple of 64
            ASSERT_EQ(format.stride[1], width / 2);
        }
        const cv::Mat yuv = formats[i] == ARHOST_PIXEL_FORMAT_YUYV
                                ? cv::Mat(height, width, CV_8UC2, frame.data())
                                : cv::Mat(height * 3 / 2, width, CV_8UC1, frame.data());
        cv::cvtColor(yuv, opencv, codes[i]);
        cv::absdiff(ours, opencv, difference);
        double greatest = 0;
        cv::minMaxLoc(difference.reshape(1), nullptr, &greatest);
        EXPECT_LE(greatest, 1) << "format " << formats[i];
    }
}

TEST(RegionOf, IsTheWholeImageUnlessTheRayTracerReportsOne) {
    arhost_render_info info{};
    info.struct_size = sizeof info;
    const Region whole = region_of(info, 640, 480);
    EXPECT_EQ(whole.width, 640u);
    EXPECT_EQ(whole.height, 480u);
    info = {sizeof info, 1, 5, 6, 7, 8, 0, 0, 0};
    const Region reported = region_of(info, 640, 480);
    EXPECT_EQ(reported.x, 5u);
    EXPECT_EQ(reported.y, 6u);
    EXPECT_EQ(reported.width, 7u);
    EXPECT_EQ(reported.height, 8u);
}

TEST(RegionOf, IsClippedToTheImage) {
    for (const auto &[x, y, width, height] :
         std::to_array<std::array<std::uint32_t, 4>>({{0, 0, 640, 481},
                                                      {630, 470, 0xffffffff, 0xffffffff},
                                                      {0x80000000, 3, 5, 5},
                                                      {640, 0, 1, 1},
                                                      {3, 0xffffffff, 2, 2}})) {
        const arhost_render_info info{sizeof info, 1, x, y, width, height, 0, 0, 0};
        const Region region = region_of(info, 640, 480);
        EXPECT_LE(std::uint64_t{region.x} + region.width, 640u);
        EXPECT_LE(std::uint64_t{region.y} + region.height, 480u);
    }
}

// An opaque rectangle on a transparent background of another colour.
struct SmallOverlay {
    static constexpr std::uint32_t width = 40, height = 30;
    static constexpr Region rectangle{10, 8, 12, 9};
    Bytes rgba;
    SmallOverlay() {
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x) {
                const bool inside = x >= rectangle.x && x < rectangle.x + rectangle.width && y >= rectangle.y &&
                                    y < rectangle.y + rectangle.height;
                const std::uint8_t pixel[] = {static_cast<std::uint8_t>(inside ? 200 : 13), 50, 7,
                                              static_cast<std::uint8_t>(inside ? 255 : 0)};
                rgba.insert(rgba.end(), pixel, pixel + 4);
            }
    }
    ImageView view() const { return {rgba.data(), 4 * std::size_t{width}}; }
};

TEST(Enlarge, KeepsThePlaceAndTheColour) {
    const SmallOverlay overlay;
    const arhost_frame_format format = layout(ARHOST_PIXEL_FORMAT_BGR8, 80, 60);
    Bytes large(std::size_t{4} * 80 * 60, 99);
    const Region region = enlarge(overlay.view(), SmallOverlay::width, SmallOverlay::height, SmallOverlay::rectangle,
                                  format, large.data(), std::size_t{4} * 80);
    double area = 0, sum_x = 0, sum_y = 0;
    for (std::uint32_t y = 0; y < 60; ++y)
        for (std::uint32_t x = 0; x < 80; ++x) {
            const std::uint8_t *pixel = &large[4 * (std::size_t{80} * y + x)];
            if (x < region.x || x >= region.x + region.width || y < region.y || y >= region.y + region.height) {
                ASSERT_EQ(pixel[0], 99) << "nothing is written outside the region";
                continue;
            }
            area += pixel[3] / 255.0;
            sum_x += pixel[3] / 255.0 * x;
            sum_y += pixel[3] / 255.0 * y;
            if (pixel[3] > 0) {
                EXPECT_EQ(pixel[0], 200) << "the colour of transparent pixels must not bleed";
            }
        }
    EXPECT_NEAR(area, 4 * 12 * 9, 0.5);
    EXPECT_NEAR(sum_x / area, (10 + 6) * 2 - 0.5, 0.01); // the centre; pixel centres are at integers
    EXPECT_NEAR(sum_y / area, (8 + 4.5) * 2 - 0.5, 0.01);
}

TEST(Enlarge, AcceptsAnyRegionAndRatio) {
    const SmallOverlay overlay;
    std::mt19937 random(1);
    for (int i = 0; i < 2000; ++i) {
        const arhost_frame_format format = layout(ARHOST_PIXEL_FORMAT_BGR8, SmallOverlay::width + random() % 60,
                                                  SmallOverlay::height + random() % 60);
        Bytes large(std::size_t{4} * format.width * format.height);
        const auto any = [&](std::uint32_t below) -> std::uint32_t {
            return random() % 8 == 0 ? UINT32_MAX - random() % 2 : random() % below;
        };
        const Region region =
            enlarge(overlay.view(), SmallOverlay::width, SmallOverlay::height, {any(50), any(40), any(50), any(40)},
                    format, large.data(), std::size_t{4} * format.width);
        ASSERT_LE(std::uint64_t{region.x} + region.width, format.width);
        ASSERT_LE(std::uint64_t{region.y} + region.height, format.height);
    }
}

} // namespace arhost
