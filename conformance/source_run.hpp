// SPDX-License-Identifier: Apache-2.0
// Runs a source and keeps its frames.
#pragma once

#include "conformance/plugin_library.hpp"
#include "conformance/test.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace arhost::conformance {

// The rows of a plane. The depth plane has the index format.plane_count; without depth, it has no rows.
struct PlaneShape {
    std::uint32_t row_bytes, rows;
};
PlaneShape shape_of(const arhost_frame_format &format, std::uint32_t plane);

// A frame's pixels without padding, plane by plane and row by row, the depth plane last, and its info.
struct Frame {
    std::vector<std::uint8_t> pixels;
    arhost_frame_info info;
};

// Position of an index of Frame::pixels, as "plane 0, row 17, byte 42".
std::string place_of(const arhost_frame_format &format, std::size_t index);

// Memory for a frame, with guard bytes before and after it.
class Slot {
public:
    explicit Slot(std::size_t size);
    std::uint8_t *data() { return lines_.front().bytes + guard_size; }
    const std::uint8_t *data() const { return lines_.front().bytes + guard_size; }
    std::size_t size() const { return size_; }
    std::string
    damage() const; // describes the first overwritten guard byte, as the end of a sentence; empty if there is none

private:
    struct alignas(64) Line {
        std::uint8_t bytes[64];
    };
    static constexpr std::uint8_t guard = 0xa5;
    static constexpr std::size_t guard_size = 64 * sizeof(Line); // before and after
    std::size_t size_;
    std::vector<Line> lines_;
};

// The host's request to a source. Default: all frames, as fast as possible.
struct Request {
    std::uint64_t first_sequence = 0;
    double fps = 0;
    bool paced = false;
    const arhost_intrinsics *intrinsics = nullptr;
};

// Runs one source plugin. A plugin instance can be started only once, so each further start replaces it with a new
// instance.
class SourceRun {
public:
    explicit SourceRun(Context &context);
    ~SourceRun() { stop(); }
    SourceRun(const SourceRun &) = delete;
    SourceRun &operator=(const SourceRun &) = delete;

    arhost_status try_start(const Request &request = {});
    void start(const Request &request = {}) { accept(try_start(request)); }
    void accept(arhost_status started); // throws Failure unless it succeeded with a valid format
    void stop();

    // Reads the next frame into slot(), which is cleared first unless `filled`.
    arhost_status try_read(bool filled = false);
    std::optional<Frame> read(bool filled = false);   // nullopt at the end
    std::vector<Frame> read_up_to(std::size_t count); // fewer at the end
    Frame frame() const;                              // the last one read
    std::uint64_t next() const { return next_; }      // arhost_frame_buffer.sequence of the next one

    bool is_live() const { return (library_.descriptor().capabilities & ARHOST_SOURCE_CAPABILITY_LIVE) != 0; }
    bool can_seek() const { return (library_.descriptor().capabilities & ARHOST_SOURCE_CAPABILITY_SEEK) != 0; }
    const arhost_source_properties &properties() const { return properties_; }
    const arhost_frame_format &format() const { return properties_.format; }
    Instance &instance() { return *instance_; }
    Slot &slot() { return *slot_; }

private:
    std::string problem() const; // of the properties from start, as a sentence; empty if none

    PluginLibrary &library_;
    std::optional<Instance> instance_;
    const arhost_source &functions_;
    bool fresh_ = true, started_ = false;
    arhost_source_properties properties_{};
    std::optional<Slot> slot_;
    std::uint64_t next_ = 0;
    arhost_frame_info info_{};
};

} // namespace arhost::conformance
