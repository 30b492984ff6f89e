// SPDX-License-Identifier: Apache-2.0
//
// A sink that checks every pixel and the order of the frames of the *_counter plugins. The file PATH contains one
// line, which is always complete and survives restarts: number of the next frame, number of frames so far, of frames
// with an overlay and of wrong frames, and the time of the last frame (ns, CLOCK_MONOTONIC). PATH.wrong describes the
// errors.
#include "faults.hpp"

#ifndef ID // sink_suspect is the same plugin with another id; tools/faults injects faults into it
#define ID "sink_checker"
#endif

#include <array>
#include <cinttypes>
#include <cstdio>
#include <string>

namespace {

using namespace arhost;

class Checker {
public:
    Checker(const Host &, const Options &options)
        : faults_(options), gaps_(options.boolean("gaps")), path_(options.text("path")) {}
    ~Checker() {
        if (file_ >= 0)
            ::close(file_);
    }
    Checker(const Checker &) = delete;
    Checker &operator=(const Checker &) = delete;

    void start(const arhost_sink_setup &setup) {
        file_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | (setup.first_sequence ? 0 : O_TRUNC), 0644);
        if (file_ < 0)
            throw Failure(ARHOST_STATUS_ERROR_IO, path_ + " cannot be opened");
        std::array<char, 160> line{};
        if (::pread(file_, line.data(), line.size() - 1, 0) > 0)
            std::sscanf(line.data(), "%" SCNu64 " %" SCNu64 " %" SCNu64 " %" SCNu64, &next_, &frames_, &overlaid_,
                        &wrong_);
        // The host sends a frame again if it was written but not confirmed. A skipped frame is an error.
        if (setup.first_sequence > next_ && !gaps_)
            report(setup.first_sequence, "follows a frame that was not written");
        frames_ -= next_ > setup.first_sequence ? next_ - setup.first_sequence : 0;
        next_ = std::min(next_, setup.first_sequence);
    }

    arhost_status write(const arhost_output &output) {
        const std::uint64_t sequence = output.record->sequence;
        const bool has_overlay = output.record->overlay != ARHOST_OVERLAY_NONE;
        if (gaps_ ? sequence < next_ : sequence != next_)
            report(sequence, "is out of order");
        if (!is_correct(output, has_overlay))
            report(sequence, "is torn or shows another frame");
        next_ = sequence + 1;
        ++frames_;
        overlaid_ += has_overlay;
        std::array<char, 160> line{};
        const auto now = std::chrono::steady_clock::now().time_since_epoch();
        const int size = std::snprintf(
            line.data(), line.size(), "%020" PRIu64 " %020" PRIu64 " %020" PRIu64 " %020" PRIu64 " %020" PRId64 "\n",
            next_, frames_, overlaid_, wrong_, std::int64_t(now / std::chrono::nanoseconds(1)));
        if (::pwrite(file_, line.data(), static_cast<std::size_t>(size), 0) != size)
            throw Failure(ARHOST_STATUS_ERROR_IO, path_ + " cannot be written");
        faults_.at(sequence);
        return ARHOST_STATUS_OK;
    }

private:
    // Returns whether all pixels are correct. The overlay is a square of 16 px in the top left corner.
    static bool is_correct(const arhost_output &output, bool has_overlay) {
        const auto low = static_cast<std::uint8_t>(output.record->sequence),
                   high = static_cast<std::uint8_t>(output.record->sequence >> 8);
        for (std::uint32_t y = 0; y < output.height; ++y)
            for (std::uint32_t x = 0; x < output.width; ++x) {
                const std::uint8_t *pixel = output.bgr + y * output.stride + 3 * x;
                const bool in_overlay = has_overlay && x < 16 && y < 16;
                if (pixel[0] != (in_overlay ? 170 : low) || pixel[1] != high || pixel[2] != (in_overlay ? low : 85))
                    return false;
            }
        return true;
    }

    void report(std::uint64_t sequence, const std::string &what) {
        ++wrong_;
        std::ofstream(path_ + ".wrong", std::ios::app)
            << "frame " << sequence << ", expected " << next_ << ": " << what << "\n";
    }

    test::Faults faults_;
    bool gaps_;
    std::string path_;
    int file_ = -1;
    std::uint64_t next_ = 0, frames_ = 0, overlaid_ = 0, wrong_ = 0;
};

constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr, "File for the results"),
    option(ARHOST_OPTION_BOOL, "gaps", "false", "Frames may be skipped, as in mode live"), ARHOST_FAULT_OPTIONS};
constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_SINK,
                                          "org.arhost.test." ID,
                                          "Checker",
                                          "0.1.0",
                                          "arhost",
                                          "Apache-2.0",
                                          "Checks numbered frames, for tests.",
                                          0,
                                          std::size(options),
                                          options,
                                          nullptr};

} // namespace

ARHOST_SINK(Checker, descriptor)
