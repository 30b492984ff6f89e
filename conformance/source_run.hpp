// SPDX-License-Identifier: Apache-2.0
//
// A source at work, and the frames that it gives.
#pragma once

#include "conformance/plugin_library.hpp"
#include "conformance/test.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace arhost::conformance {

// The rows of a plane.
struct PlaneShape {
    std::uint32_t row_bytes, rows;
};
PlaneShape shape_of(const arhost_frame_format &format, std::uint32_t plane);

// A frame's pixels alone, plane after plane and row after row, and what was told of it.
struct Frame {
    std::vector<std::uint8_t> pixels;
    arhost_frame_info info;
};

// "plane 0, row 17, byte 42": where `index` of Frame::pixels lies.
std::string place_of(const arhost_frame_format &format, std::size_t index);

// Memory that a frame is read into, with guard bytes before and behind it.
class Slot {
public:
    explicit Slot(std::size_t size);
    std::uint8_t *data() { return lines_.front().bytes + guard_size; }
    const std::uint8_t *data() const { return lines_.front().bytes + guard_size; }
    std::size_t size() const { return size_; }
    std::string damage() const; // what was written beside it, as the end of a sentence; empty: nothing

private:
    struct alignas(64) Line {
        std::uint8_t bytes[64];
    };
    static constexpr std::uint8_t guard = 0xa5;
    static constexpr std::size_t guard_size = 64 * sizeof(Line); // before and behind
    std::size_t size_;
    std::vector<Line> lines_;
};

// What the host asks of a source: by default all there is, as fast as it comes.
struct Wish {
    std::uint64_t first_sequence = 0;
    double fps = 0;
    bool paced = false;
    const arhost_intrinsics *intrinsics = nullptr;
};

// An instance is started once: another start makes another one.
class SourceRun {
public:
    explicit SourceRun(Context &context);
    ~SourceRun() { stop(); }
    SourceRun(const SourceRun &) = delete;
    SourceRun &operator=(const SourceRun &) = delete;

    arhost_status try_start(const Wish &wish = {});
    void start(const Wish &wish = {}) { accept(try_start(wish)); }
    void accept(arhost_status started); // throws Failure unless it succeeded with a format of the ABI's
    void stop();

    // The next frame into slot(). Its bytes are zeros before, unless `filled`.
    arhost_status try_read(bool filled = false);
    std::optional<Frame> read(bool filled = false);   // nothing: the source is at its end
    std::vector<Frame> read_up_to(std::size_t count); // fewer: it is at its end
    Frame frame() const;                              // what was read last
    std::uint64_t next() const { return next_; }      // arhost_frame_buffer.sequence of the next one

    bool is_live() const { return (library_.descriptor().capabilities & ARHOST_CAPABILITY_LIVE) != 0; }
    bool can_seek() const { return (library_.descriptor().capabilities & ARHOST_CAPABILITY_SEEK) != 0; }
    const arhost_source_properties &properties() const { return properties_; }
    const arhost_frame_format &format() const { return properties_.format; }
    Instance &instance() { return *instance_; }
    Slot &slot() { return *slot_; }

private:
    std::string problem() const; // of what start told, as a sentence; empty: none

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
