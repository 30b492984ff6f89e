// SPDX-License-Identifier: Apache-2.0
//
// Compares the compositor with memcpy, at 1280×720 and single-threaded. Successive calls use different frames, which
// together exceed the caches. The reference memcpy moves as many bytes (read plus written) as the compositor. The
// compositor reads 3 bytes of the frame and 4 bytes of the overlay and writes 3 bytes, which makes 10 bytes per
// pixel; memcpy therefore copies 5 bytes per pixel.
#include "compositor/compositor.hpp"
#include "pixels/grey.hpp"
#include "pixels/linear.hpp"

#include <benchmark/benchmark.h>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <random>
#include <stdexcept>
#include <vector>

namespace {

constexpr std::uint32_t width = 1280, height = 720;
constexpr std::size_t pixels = std::size_t(width) * height;
constexpr std::size_t pool_bytes = std::size_t(768) << 20; // per stream

// A pool of frames that are page-aligned, like arhost's slots. Every byte is written once, so that all pages are
// mapped.
class Pool {
public:
    explicit Pool(std::size_t frame_bytes) : frame_bytes_((frame_bytes + 4095) / 4096 * 4096) {
        count_ = pool_bytes / frame_bytes_;
        bytes_.reset(static_cast<std::uint8_t *>(std::aligned_alloc(4096, count_ * frame_bytes_)));
        if (!bytes_)
            throw std::bad_alloc();
        std::memset(bytes_.get(), 0x5a, count_ * frame_bytes_);
    }
    std::uint8_t *frame(std::size_t i) const { return bytes_.get() + i % count_ * frame_bytes_; }
    std::size_t count() const { return count_; }

private:
    struct Free {
        void operator()(std::uint8_t *p) const { std::free(p); }
    };
    std::size_t frame_bytes_, count_ = 0;
    std::unique_ptr<std::uint8_t, Free> bytes_;
};

enum Overlay { translucent, opaque, mixed, sparse, empty };

void fill_overlay(std::uint8_t *rgba, Overlay kind, std::uint32_t seed) {
    std::mt19937 random(seed);
    for (std::size_t i = 0; i < pixels; ++i) {
        const std::size_t x = i % width, y = i / width;
        const std::uint32_t bits = random();
        std::memcpy(rgba + 4 * i, &bits, 3);
        // `mixed` consists of 8×8 blocks, each transparent, opaque or translucent. `sparse` is an opaque disc with a
        // soft edge on a transparent background.
        const std::uint32_t block = static_cast<std::uint32_t>((x / 8 * 2654435761u) ^ (y / 8 * 40503u)) >> 7;
        const double dx = double(x) - width / 2.0, dy = double(y) - height / 2.0, r2 = dx * dx + dy * dy;
        const std::uint8_t soft = static_cast<std::uint8_t>(1 + (bits >> 24) % 254);
        std::uint8_t alpha = 0;
        if (kind == translucent)
            alpha = soft;
        else if (kind == opaque)
            alpha = 255;
        else if (kind == mixed)
            alpha = block % 3 == 0 ? 0 : block % 3 == 1 ? 255 : soft;
        else if (kind == sparse)
            alpha = r2 < 150 * 150 ? 255 : r2 < 154 * 154 ? soft : 0;
        rgba[4 * i + 3] = alpha;
    }
}

arhost_frame_format frame_format(arhost_pixel_format pixel_format) {
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = pixel_format;
    format.width = width;
    format.height = height;
    format.yuv_matrix = ARHOST_YUV_MATRIX_BT601;
    format.yuv_range = ARHOST_YUV_RANGE_LIMITED;
    if (!arhost_frame_layout(&format))
        throw std::logic_error("frame layout");
    return format;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Runs `work(i)` and a memcpy of `moved` / 2 bytes alternately, so that both are timed under the same conditions.
template <class Work> void against_memcpy(benchmark::State &state, std::size_t moved, const Work &work) {
    const Pool from(moved / 2), to(moved / 2);
    double work_s = 0, memcpy_s = 0;
    std::size_t i = 0;
    for (auto _ : state) {
        const auto start = std::chrono::steady_clock::now();
        work(i);
        const double elapsed = seconds_since(start);
        state.SetIterationTime(elapsed);
        work_s += elapsed;
        const auto copy_start = std::chrono::steady_clock::now();
        std::memcpy(to.frame(i), from.frame(i), moved / 2);
        benchmark::ClobberMemory();
        memcpy_s += seconds_since(copy_start);
        ++i;
    }
    state.counters["memcpy_ms"] = memcpy_s / double(i) * 1e3;
    state.counters["ratio"] = work_s / memcpy_s;
    state.SetBytesProcessed(static_cast<std::int64_t>(i * moved));
}

void composite_overlay(benchmark::State &state, Overlay kind, bool whole) {
    const arhost_frame_format format = frame_format(ARHOST_PIXEL_FORMAT_BGR8);
    const Pool frames(format.byte_size), overlays(4 * pixels), outputs(3 * pixels);
    for (std::size_t i = 0; i < overlays.count(); ++i)
        if (i < 4)
            fill_overlay(overlays.frame(i), kind, static_cast<std::uint32_t>(i));
        else
            std::memcpy(overlays.frame(i), overlays.frame(i % 4), 4 * pixels);
    // If not `whole`, the region is the bounding rectangle of the sparse overlay's disc, as a ray tracer would report
    // it.
    const arhost::Region region =
        whole ? arhost::Region{0, 0, width, height} : arhost::Region{width / 2 - 154, height / 2 - 154, 309, 309};
    const std::size_t moved = 6 * pixels + 4 * std::size_t(region.width) * region.height;
    against_memcpy(state, moved, [&](std::size_t i) {
        const std::uint8_t *planes[ARHOST_MAX_PLANES] = {frames.frame(i)};
        arhost::composite(format, planes, {overlays.frame(i), 4 * width}, region, {outputs.frame(i), 3 * width});
    });
}
BENCHMARK_CAPTURE(composite_overlay, all_translucent, translucent, true)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(composite_overlay, all_opaque, opaque, true)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(composite_overlay, mixed, mixed, true)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(composite_overlay, sparse, sparse, true)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(composite_overlay, all_empty, empty, true)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(composite_overlay, sparse_with_region, sparse, false)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

// Blends an overlay of which `percent` of the pixels, a block of rows, are not transparent: 60 % of these hide the
// video and 40 % are translucent. Reports ns per pixel of the picture.
void blend_forms(benchmark::State &state, const arhost::OverlayFormat &form) {
    const auto w = static_cast<std::uint32_t>(state.range(0)), h = static_cast<std::uint32_t>(state.range(1));
    const std::uint32_t rows = h * static_cast<std::uint32_t>(state.range(2)) / 100;
    arhost_frame_format format = frame_format(ARHOST_PIXEL_FORMAT_BGR8);
    format.width = w;
    format.height = h;
    arhost_frame_layout(&format);
    const std::size_t count = std::size_t{w} * h, bytes = form.pixel_bytes();
    const Pool frames(format.byte_size), overlays(bytes * count), outputs(3 * count);
    std::mt19937 random(1);
    for (std::size_t i = 0; i < overlays.count(); ++i) {
        if (i >= 4) {
            std::memcpy(overlays.frame(i), overlays.frame(i % 4), bytes * count);
            continue;
        }
        for (std::size_t at = 0; at < count; ++at) {
            std::uint8_t *const pixel = overlays.frame(i) + bytes * at;
            const bool is_drawn = at < std::size_t{rows} * w, hides = random() % 5 < 3;
            if (form.is_linear()) {
                arhost::LinearPixel light = arhost::untouched;
                for (int c = 0; is_drawn && c < 3; ++c) {
                    light.added[c] = arhost::half_of(static_cast<float>(random() % 1000) / 1000);
                    light.transmittance[c] = hides ? std::uint16_t{0} : arhost::half_of(0.7f);
                }
                std::memcpy(pixel, &light, sizeof light);
            } else {
                const std::uint32_t bits = random();
                std::memcpy(pixel, &bits, 3);
                pixel[3] = static_cast<std::uint8_t>(!is_drawn ? 0 : hides ? 255 : 77);
            }
        }
    }
    std::size_t i = 0;
    for (auto _ : state) {
        const std::uint8_t *planes[ARHOST_MAX_PLANES] = {frames.frame(i)};
        arhost::composite(format, planes, {overlays.frame(i), bytes * w, form}, {0, 0, w, h},
                          {outputs.frame(i), std::size_t{3} * w});
        ++i;
    }
    state.counters["ns_per_px"] =
        benchmark::Counter(1e-9 * static_cast<double>(count),
                           benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
#define SIZES Args({640, 480, 30})->Args({640, 480, 100})->Args({1280, 720, 30})->Args({1280, 720, 100})
BENCHMARK_CAPTURE(blend_forms, straight_srgb, arhost::OverlayFormat{})->SIZES;
BENCHMARK_CAPTURE(blend_forms, straight_linear,
                  arhost::OverlayFormat{ARHOST_IMAGE_FORM_STRAIGHT, ARHOST_COMPOSITING_LINEAR})
    ->SIZES;
BENCHMARK_CAPTURE(blend_forms, linear, arhost::OverlayFormat{ARHOST_IMAGE_FORM_LINEAR, ARHOST_COMPOSITING_LINEAR})
    ->SIZES;
#undef SIZES

void plain_frame(benchmark::State &state, arhost_pixel_format pixel_format) {
    const arhost_frame_format format = frame_format(pixel_format);
    const Pool frames(format.byte_size), outputs(3 * pixels);
    std::size_t read = 0;
    for (std::uint32_t p = 0; p < format.plane_count; ++p)
        read += std::size_t(format.stride[p]) * (p == 0 ? height : height / 2);
    against_memcpy(state, read + 3 * pixels, [&](std::size_t i) {
        const std::uint8_t *planes[ARHOST_MAX_PLANES] = {};
        for (std::uint32_t p = 0; p < format.plane_count; ++p)
            planes[p] = frames.frame(i) + format.offset[p];
        arhost::composite(format, planes, {}, {}, {outputs.frame(i), 3 * width});
    });
}
BENCHMARK_CAPTURE(plain_frame, bgr8, ARHOST_PIXEL_FORMAT_BGR8)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(plain_frame, rgb8, ARHOST_PIXEL_FORMAT_RGB8)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(plain_frame, grey8, ARHOST_PIXEL_FORMAT_GREY8)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(plain_frame, yuyv, ARHOST_PIXEL_FORMAT_YUYV)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(plain_frame, nv12, ARHOST_PIXEL_FORMAT_NV12)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(plain_frame, i420, ARHOST_PIXEL_FORMAT_I420)->UseManualTime()->Unit(benchmark::kMillisecond);

void grey_plane(benchmark::State &state, arhost_pixel_format pixel_format) {
    const arhost_frame_format format = frame_format(pixel_format);
    const Pool frames(format.byte_size);
    against_memcpy(state, std::size_t(format.stride[0] + format.grey_stride) * height, [&](std::size_t i) {
        const std::uint8_t *planes[ARHOST_MAX_PLANES] = {frames.frame(i)};
        arhost::fill_grey(format, planes, frames.frame(i) + format.grey_offset);
    });
}
BENCHMARK_CAPTURE(grey_plane, bgr8, ARHOST_PIXEL_FORMAT_BGR8)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(grey_plane, yuyv, ARHOST_PIXEL_FORMAT_YUYV)->UseManualTime()->Unit(benchmark::kMillisecond);

void expanded_luma(benchmark::State &state) {
    const arhost_frame_format format = frame_format(ARHOST_PIXEL_FORMAT_NV12);
    const Pool frames(format.byte_size);
    std::vector<std::uint8_t> grey(std::size_t(format.grey_stride) * height);
    against_memcpy(state, 2 * grey.size(),
                   [&](std::size_t i) { arhost::expand_luma_plane(format, frames.frame(i), grey.data()); });
}
BENCHMARK(expanded_luma)->UseManualTime()->Unit(benchmark::kMillisecond);

} // namespace

BENCHMARK_MAIN();
