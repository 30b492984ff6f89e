// SPDX-License-Identifier: Apache-2.0
//
// Provides tests of ray tracers with linear images and video.
#pragma once

#include "pixels/linear.hpp"
#include "tracer.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace arhost::test {

using LinearPixel = std::array<std::uint16_t, 8>;
inline constexpr LinearPixel untouched = {0, 0, 0, 0, 0x3c00, 0x3c00, 0x3c00, 0};

// A linear image with row padding and guard bytes.
class LinearPicture {
public:
    explicit LinearPicture(const arhost_intrinsics &in)
        : width(in.width), height(in.height), stride_((16 * width + 63) / 64 * 64 + 64),
          buffer_(std::size_t{stride_} * height) {}

    arhost_image image() {
        return {sizeof(arhost_image),
                stride_,
                width,
                height,
                nullptr,
                reinterpret_cast<std::uint16_t *>(buffer_.data()),
                nullptr};
    }
    LinearPixel at(std::uint32_t x, std::uint32_t y) const {
        LinearPixel pixel;
        std::memcpy(pixel.data(), buffer_.data() + std::size_t{stride_} * y + 16 * x, sizeof pixel);
        return pixel;
    }
    // Channels 0 to 2: added light; 4 to 6: transmittance.
    float value(std::uint32_t x, std::uint32_t y, std::size_t channel) const { return float_of(at(x, y)[channel]); }
    std::vector<LinearPixel> pixels() const {
        std::vector<LinearPixel> all;
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                all.push_back(at(x, y));
        return all;
    }
    bool only_pixels_written() const { return only_rows_written(buffer_, 16 * width, stride_, height); }

    std::uint32_t width, height;
    arhost_render_info info{sizeof(arhost_render_info), 0, 0, 0, 0, 0, 0, 0, 0};

private:
    std::uint32_t stride_;
    GuardedBuffer buffer_;
};

// A video whose picture is brighter to the right and bluer to the bottom.
class Video {
public:
    explicit Video(const arhost_intrinsics &in) {
        format_.struct_size = sizeof format_;
        format_.pixel_format = ARHOST_PIXEL_FORMAT_RGB8;
        format_.width = in.width;
        format_.height = in.height;
        arhost_frame_layout(&format_);
        bytes_.resize(format_.byte_size);
        for (std::uint32_t y = 0; y < in.height; ++y)
            for (std::uint32_t x = 0; x < in.width; ++x) {
                std::uint8_t *to = bytes_.data() + std::size_t{format_.stride[0]} * y + 3 * x;
                to[0] = to[1] = static_cast<std::uint8_t>(40 + 160 * x / in.width);
                to[2] = static_cast<std::uint8_t>(40 + 160 * y / in.height);
            }
        frame_.struct_size = sizeof frame_;
        frame_.format = &format_;
        frame_.plane[0] = bytes_.data();
    }
    // One grey everywhere.
    Video(const arhost_intrinsics &in, std::uint8_t code) : Video(in) { std::ranges::fill(bytes_, code); }
    Video(const Video &) = delete;
    Video &operator=(const Video &) = delete;
    const arhost_frame_format &format() const { return format_; }
    const arhost_frame &frame() const { return frame_; }

private:
    arhost_frame_format format_{};
    std::vector<std::uint8_t> bytes_;
    arhost_frame frame_{};
};

// A ray tracer that renders linear images, each with the state of the one before.
class LinearTracer {
public:
    LinearTracer(scene::ArenaBuilder scene, const Options &options, const std::string &plugin)
        : tracer_(std::move(scene), options, plugin) {}
    ~LinearTracer() { stop(); }
    LinearTracer(const LinearTracer &) = delete;
    LinearTracer &operator=(const LinearTracer &) = delete;

    arhost_status start(const arhost_intrinsics &in, const Video *video = nullptr) {
        stop();
        const arhost_raytracer_setup setup{sizeof setup,
                                           in.width,
                                           in.height,
                                           ARHOST_IMAGE_FORM_LINEAR,
                                           &tracer_.scene(),
                                           &in,
                                           ARHOST_COMPOSITING_LINEAR,
                                           0,
                                           video ? &video->format() : nullptr};
        const arhost_status status = functions().start(tracer_.plugin().instance(), &setup);
        started_ = status == ARHOST_STATUS_OK;
        state_.clear();
        return status;
    }
    std::uint32_t shading_px = 0; // of the next requests
    // The state after the last image.
    std::span<std::byte> state() { return std::as_writable_bytes(std::span(state_)).first(state_size()); }
    LinearPicture render(const arhost_camera &camera, std::uint64_t sequence = 0, const Video *video = nullptr,
                         std::optional<double> time_s = {}) {
        if (time_s && !motion_)
            motion_.emplace(tracer_.scene());
        arhost_motion motion{};
        if (time_s)
            motion = motion_->at(*time_s);
        std::vector<Page> after((state_size() + sizeof(Page) - 1) / sizeof(Page));
        const arhost_render_request request{sizeof request,
                                            0,
                                            sequence,
                                            0,
                                            camera,
                                            time_s ? &motion : nullptr,
                                            video ? &video->frame() : nullptr,
                                            state_.empty() ? nullptr : state_.data(),
                                            after.empty() ? nullptr : after.data(),
                                            state_size(),
                                            nullptr,
                                            shading_px,
                                            0};
        LinearPicture picture(camera.intrinsics);
        const arhost_image image = picture.image();
        EXPECT_EQ(functions().render(tracer_.plugin().instance(), &request, &image, &picture.info), ARHOST_STATUS_OK)
            << log();
        EXPECT_TRUE(picture.only_pixels_written());
        state_ = std::move(after);
        return picture;
    }
    std::string log() const { return tracer_.log(); }

private:
    struct alignas(4096) Page {
        std::byte bytes[4096];
    };
    std::uint64_t state_size() {
        return functions().state_size ? functions().state_size(tracer_.plugin().instance()) : 0;
    }
    void stop() {
        if (started_)
            functions().stop(tracer_.plugin().instance());
        started_ = false;
    }
    const arhost_raytracer &functions() { return tracer_.plugin().functions<arhost_raytracer>(); }

    Tracer tracer_;
    std::optional<scene::MotionEvaluator> motion_;
    std::vector<Page> state_;
    bool started_ = false;
};

} // namespace arhost::test
