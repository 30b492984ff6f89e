// SPDX-License-Identifier: Apache-2.0
//
// Looks at every pixel of the counting plugins' frames, and whether they come in order. It keeps one line, PATH,
// which is whole at every moment and outlives its process: the number of the next frame, how many frames there were,
// how many of them with an overlay, how many were wrong, and when the last one came (ns, CLOCK_MONOTONIC). What was
// wrong is told in PATH.wrong.
#include "faults.hpp"

#ifndef ID // sink_suspect is the same, for tools/faults to strike
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
            throw Failure(ARHOST_STATUS_ERROR_IO, path_ + " can't be opened");
        std::array<char, 160> line{};
        if (::pread(file_, line.data(), line.size() - 1, 0) > 0)
            std::sscanf(line.data(), "%" SCNu64 " %" SCNu64 " %" SCNu64 " %" SCNu64, &next_, &frames_, &overlaid_,
                        &wrong_);
        // One that was written, but not confirmed, comes again. One that is left out is lost.
        if (setup.first_sequence > next_ && !gaps_)
            tell(setup.first_sequence, "goes on behind a frame that was not written");
        frames_ -= next_ > setup.first_sequence ? next_ - setup.first_sequence : 0;
        next_ = std::min(next_, setup.first_sequence);
    }

    arhost_status write(const arhost_output &output) {
        const std::uint64_t sequence = output.record->sequence;
        const bool has_overlay = output.record->overlay != ARHOST_OVERLAY_NONE;
        if (gaps_ ? sequence < next_ : sequence != next_)
            tell(sequence, "is out of order");
        if (!is_whole(output, has_overlay))
            tell(sequence, "is torn, or another's");
        next_ = sequence + 1;
        ++frames_;
        overlaid_ += has_overlay;
        std::array<char, 160> line{};
        const auto now = std::chrono::steady_clock::now().time_since_epoch();
        const int size = std::snprintf(
            line.data(), line.size(), "%020" PRIu64 " %020" PRIu64 " %020" PRIu64 " %020" PRIu64 " %020" PRId64 "\n",
            next_, frames_, overlaid_, wrong_, std::int64_t(now / std::chrono::nanoseconds(1)));
        if (::pwrite(file_, line.data(), static_cast<std::size_t>(size), 0) != size)
            throw Failure(ARHOST_STATUS_ERROR_IO, path_ + " can't be written");
        faults_.at(sequence);
        return ARHOST_STATUS_OK;
    }

private:
    // The overlay is a square of 16 px in the corner.
    static bool is_whole(const arhost_output &output, bool has_overlay) {
        const auto low = static_cast<std::uint8_t>(output.record->sequence),
                   high = static_cast<std::uint8_t>(output.record->sequence >> 8);
        for (std::uint32_t y = 0; y < output.height; ++y)
            for (std::uint32_t x = 0; x < output.width; ++x) {
                const std::uint8_t *pixel = output.bgr + y * output.stride + 3 * x;
                const bool laid_over = has_overlay && x < 16 && y < 16;
                if (pixel[0] != (laid_over ? 170 : low) || pixel[1] != high || pixel[2] != (laid_over ? low : 85))
                    return false;
            }
        return true;
    }

    void tell(std::uint64_t sequence, const std::string &what) {
        ++wrong_;
        std::ofstream(path_ + ".wrong", std::ios::app)
            << "frame " << sequence << ", where " << next_ << " comes next, " << what << "\n";
    }

    test::Faults faults_;
    bool gaps_;
    std::string path_;
    int file_ = -1;
    std::uint64_t next_ = 0, frames_ = 0, overlaid_ = 0, wrong_ = 0;
};

constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr, "The file with the line"),
    option(ARHOST_OPTION_BOOL, "gaps", "false", "Frames may be left out, as in mode live"), ARHOST_FAULT_OPTIONS};
constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_SINK,
                                          ID,
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
