// SPDX-License-Identifier: Apache-2.0
// All wrong sources: a small moving pattern with intrinsics and true pose, with a defect that this library's file
// name selects.
#include "defect.hpp"

#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <sys/socket.h>
#include <thread>

namespace {

using namespace arhost;
using namespace arhost::test;
using Clock = std::chrono::steady_clock;

// Shared by all instances.
std::uint64_t position = 0, instances = 0;
bool is_in_use = false;

class Pattern {
public:
    Pattern(const Host &host, const Options &options)
        : host_(host), frames_(static_cast<std::uint64_t>(options.integer("frames"))) {}
    ~Pattern() {
        if (start_failed_)
            crash();
    }
    Pattern(const Pattern &) = delete;
    Pattern &operator=(const Pattern &) = delete;

    void start(const arhost_source_setup &setup, arhost_source_properties &properties) {
        misbehave_in("start");
        if (has("cannot_restart") && std::exchange(is_in_use, true))
            throw Failure(ARHOST_STATUS_ERROR_IO, "the device is busy");
        if (has("start_cancelled_is_internal") && host_.cancelled())
            throw Failure(ARHOST_STATUS_ERROR_INTERNAL, "unexpected cancellation");
        if (has("crash_after_a_failed_start") && host_.cancelled()) {
            start_failed_ = true;
            throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled");
        }
        if (has("one_frame_rate") && setup.fps > 0 && setup.fps != 25)
            throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "only 25 frames/s are supported");
        if (has("opens_a_socket")) {
            const int fd = ::socket(AF_INET, SOCK_DGRAM, 0);
            if (fd < 0)
                throw Failure(ARHOST_STATUS_ERROR_IO, std::string("no socket: ") + std::strerror(errno));
            ::close(fd);
        }
        if (has("leaks_descriptors_in_start"))
            (void)::dup(0);
        delivered_ = 0;
        fps_ = setup.fps > 0 && !has("ignores_frame_rate") ? setup.fps : 25;
        paced_ = setup.paced != 0;
        first_ = position = setup.first_sequence;
        start_time_ = Clock::now() - time_of(first_);
        arhost_frame_format &format = properties.format;
        format.pixel_format = has("no_pixel_format") ? 9
                              : has("no_yuv_matrix") ? ARHOST_PIXEL_FORMAT_I420
                                                     : ARHOST_PIXEL_FORMAT_BGR8;
        format.width = 62;
        format.height = 46;
        format.fps = fps_;
        arhost_frame_layout(&format);
        if (has("stride_without_padding"))
            format.stride[0] = 3 * format.width;
        if (has("slot_too_small"))
            format.byte_size -= 64;
        properties.frame_count = has("frame_count_too_high")  ? frames_ + 1
                                 : has("frame_count_too_low") ? frames_ - 1
                                                              : frames_;
        properties.has_intrinsics = 1;
        arhost_intrinsics &camera = properties.intrinsics;
        camera.width = has("intrinsics_of_other_size") ? 640 : format.width;
        camera.height = format.height;
        camera.fx = has("no_focal_length") ? 0 : 70;
        camera.fy = 70;
        camera.cx = 30.5;
        camera.cy = has("no_principal_point") ? std::nan("") : 22.5;
        camera.distortion = ARHOST_DISTORTION_BROWN;
        camera.coefficient_count = has("seven_coefficients") ? 7 : 5;
    }

    arhost_status read(const arhost_frame_buffer &buffer, arhost_frame_info &info) {
        misbehave_in("read");
        if (has("exits_in_read"))
            std::exit(0);
        if (has("status_0"))
            return 0;
        if (has("leaks_descriptors"))
            (void)::dup(0);
        if (has("leaks_memory"))
            leak_memory(1024);
        if (has("leaves_threads"))
            std::thread(hang).detach();
        if (has("slow"))
            std::this_thread::sleep_for(std::chrono::milliseconds(120));
        if (has("cancelled_is_internal") && host_.cancelled())
            return ARHOST_STATUS_ERROR_INTERNAL;
        std::uint64_t n = has("shared_position") ? position : first_ + delivered_;
        if (has("resumes_one_frame_late") && first_ > 0)
            ++n;
        if (has("resumes_at_0"))
            n -= first_;
        if (n >= frames_ && has("crash_at_end"))
            crash();
        if (n >= frames_ && has("frames_after_end") && !std::exchange(at_end_, true))
            return ARHOST_STATUS_END;
        if (n >= frames_ && has("error_instead_of_end"))
            return ARHOST_STATUS_ERROR_IO;
        if (n >= frames_ && !has("frames_after_end"))
            return ARHOST_STATUS_END;
        if (paced_) {
            if (const auto due = start_time_ + time_of(n); has("ignores_cancel_while_waiting"))
                std::this_thread::sleep_until(due);
            else if (!host_.wait_until(due))
                return has("cancelled_wait_is_internal") ? ARHOST_STATUS_ERROR_INTERNAL
                                                         : ARHOST_STATUS_ERROR_CANCELLED;
            if (has("skips_silently")) {
                const auto late = static_cast<std::uint64_t>(std::max(0.0, delay_s(n) * fps_));
                n += late;
                delivered_ += late;
            }
            if (has("late_frames_keep_their_time"))
                n += static_cast<std::uint64_t>(std::max(0.0, delay_s(n) * fps_));
        }
        ++delivered_;
        ++position;
        fill_info(has("late_frames_keep_their_time") ? first_ + delivered_ - 1 : n, info);
        paint(n, buffer);
        info.has_grey = 1;
        return ARHOST_STATUS_OK;
    }

    void stop() { misbehave_in("stop"); }

private:
    std::chrono::nanoseconds time_of(std::uint64_t n) const {
        return std::chrono::nanoseconds(std::llround(static_cast<double>(n) * 1e9 / fps_));
    }
    double delay_s(std::uint64_t n) const {
        return std::chrono::duration<double>(Clock::now() - start_time_ - time_of(n)).count();
    }

    void fill_info(std::uint64_t n, arhost_frame_info &info) const {
        info.clock = has("no_clock")                       ? 0
                     : has("changes_clocks") && n % 3 == 2 ? ARHOST_CLOCK_MONOTONIC
                                                           : ARHOST_CLOCK_MEDIA;
        info.capture_ns = time_of(n).count();
        if (has("stale_times"))
            info.capture_ns = 0;
        if (has("times_go_back") && n == 6)
            info.capture_ns = time_of(4).count();
        if (has("times_jump") && n >= 6)
            info.capture_ns += 3'600'000'000'000;
        if (has("skipped_count_underflow") && n > 0)
            info.skipped = 0xffffffff;
        if (has("negative_media_time"))
            info.capture_ns -= 1'000'000'000;
        if (has("times_in_microseconds"))
            info.capture_ns /= 1000;
        if (has("times_since_creation"))
            info.capture_ns += created_.time_since_epoch().count();
        if (has("times_since_unix_epoch")) {
            info.clock = ARHOST_CLOCK_MONOTONIC;
            info.capture_ns += 1'700'000'000'000'000'000;
        }
        info.has_truth = 1;
        if (!has("truth_without_target"))
            std::memcpy(info.truth_target, "desk", 5);
        const double a = 0.1 * static_cast<double>(n), c = std::cos(a), s = std::sin(a);
        const double mt[16] = {c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, 5, 7, -400, 1};
        std::copy_n(mt, 16, info.true_mt);
        if (has("row_major_truth"))
            for (int row = 0; row < 4; ++row)
                for (int column = 0; column < 4; ++column)
                    info.true_mt[4 * row + column] = mt[4 * column + row];
        if (has("scaled_truth"))
            info.true_mt[0] *= 1.01;
        if (has("truth_behind_camera"))
            info.true_mt[14] = 400;
    }

    void paint(std::uint64_t n, const arhost_frame_buffer &buffer) const {
        const arhost_frame_format &format = *buffer.format;
        if (has("differs_per_instance"))
            n += instance_;
        if (has("depends_on_earlier_reads") && delivered_ > 1)
            n += 100;
        const std::uint32_t rows = format.height - has("unwritten_row"),
                            columns = format.width - has("unwritten_column");
        for (std::uint32_t y = 0; y < rows; ++y) {
            std::uint8_t *bgr = buffer.plane[0] + std::size_t{format.stride[0]} * y;
            std::uint8_t *grey = buffer.grey + std::size_t{format.grey_stride} * y;
            for (std::uint32_t x = 0; x < columns; ++x) {
                bgr[3 * x] = static_cast<std::uint8_t>(x + 4 * n);
                bgr[3 * x + 1] = static_cast<std::uint8_t>(3 * y + n);
                bgr[3 * x + 2] = 128;
                if (!has("unwritten_grey"))
                    grey[x] = static_cast<std::uint8_t>(
                        std::lround(0.114 * bgr[3 * x] + 0.587 * bgr[3 * x + 1] + 0.299 * bgr[3 * x + 2]));
                if (has("green_for_grey"))
                    grey[x] = bgr[3 * x + 1];
            }
        }
        if (has("writes_past_end"))
            std::memset(buffer.plane[0] + format.byte_size, 0, 64);
        if (has("writes_before_start"))
            buffer.plane[0][-1] = 0;
    }

    Host host_;
    std::uint64_t frames_, first_ = 0, delivered_ = 0;
    double fps_ = 25;
    bool paced_ = false, at_end_ = false, start_failed_ = false;
    std::uint64_t instance_ = ++instances;
    Clock::time_point created_ = Clock::now(), start_time_;
};

constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_INTEGER, "frames", "40", "Number of frames.", 2, 1000),
};
constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_SOURCE,
                                          "org.arhost.test.wrong_source",
                                          "Pattern",
                                          "0.1.0",
                                          "arhost",
                                          "Apache-2.0",
                                          "A small pattern that moves.",
                                          ARHOST_SOURCE_CAPABILITY_SEEK,
                                          std::size(options),
                                          options,
                                          nullptr};

} // namespace

extern "C" {
extern ARHOST_EXPORT const arhost_entry_point arhost_entry = {
    sizeof arhost_entry, 0, [](const arhost_offer *offer, arhost_answer *answer) {
        static arhost_source functions = detail::source_functions<Pattern>;
        if (has("no_read"))
            functions.read = nullptr;
        return negotiate_as<Pattern>(offer, answer, descriptor, &functions);
    }};
}
