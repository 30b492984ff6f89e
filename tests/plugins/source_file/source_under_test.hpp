// SPDX-License-Identifier: Apache-2.0
//
// Calls a source's functions like arhost-worker does. Returns frames without row padding.
#pragma once

#include "plugin_under_test.hpp"

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace arhost::test {

struct SourceFrame {
    arhost_status status = 0;
    arhost_frame_info info{};
    std::vector<std::uint8_t> bytes;     // the planes in order, each with its rows in order
    std::vector<std::uint16_t> depth_mm; // empty without depth
};

// Returns a calibration for frames of this size, of which a source uses only the size.
inline arhost_intrinsics intrinsics_of_size(std::uint32_t width, std::uint32_t height) {
    arhost_intrinsics camera{};
    camera.struct_size = sizeof camera;
    camera.width = width;
    camera.height = height;
    return camera;
}

inline arhost_source_setup source_setup(double fps, bool is_live) {
    arhost_source_setup setup{};
    setup.fps = fps;
    setup.paced = is_live;
    return setup;
}

class SourceUnderTest {
public:
    explicit SourceUnderTest(const std::string &id) : plugin_(id), source_(plugin_.functions<arhost_source>()) {}
    // Starts the source; throws if that fails.
    SourceUnderTest(const std::string &id, const std::map<std::string, std::string> &options,
                    arhost_source_setup setup = {})
        : SourceUnderTest(id) {
        if (start(options, setup) != ARHOST_STATUS_OK)
            throw std::runtime_error(log());
    }
    ~SourceUnderTest() { stop(); }

    // Creates an instance of the plugin and starts it. Returns the status of the first call that fails, else
    // ARHOST_STATUS_OK.
    arhost_status start(const std::map<std::string, std::string> &options, arhost_source_setup setup = {}) {
        stop();
        if (const arhost_status status = plugin_.create(options); status != ARHOST_STATUS_OK)
            return status;
        setup.struct_size = sizeof setup;
        properties_ = {};
        properties_.struct_size = sizeof properties_;
        properties_.format.struct_size = sizeof properties_.format;
        properties_.intrinsics.struct_size = sizeof properties_.intrinsics;
        const arhost_status status = source_.start(plugin_.instance(), &setup, &properties_);
        running_ = status == ARHOST_STATUS_OK;
        if (running_) {
            arhost_frame_format again = properties_.format;
            EXPECT_TRUE(arhost_frame_layout(&again));
            EXPECT_EQ(again.byte_size, properties_.format.byte_size)
                << "the source must set the layout of the planes";
            buffer_.emplace(properties_.format.byte_size);
        }
        return status;
    }

    SourceFrame read(std::uint64_t sequence) {
        const arhost_frame_format &format = properties_.format;
        arhost_frame_buffer buffer{};
        buffer.struct_size = sizeof buffer;
        buffer.format = &format;
        buffer.grey = buffer_->data() + format.grey_offset;
        buffer.sequence = sequence;
        if (format.has_depth)
            buffer.depth_mm = reinterpret_cast<std::uint16_t *>(buffer_->data() + format.depth_offset);
        for (std::uint32_t p = 0; p < format.plane_count; ++p)
            buffer.plane[p] = buffer_->data() + format.offset[p];
        SourceFrame frame;
        frame.info.struct_size = sizeof frame.info;
        frame.status = source_.read(plugin_.instance(), &buffer, &frame.info);
        EXPECT_TRUE(buffer_->intact()) << "the source wrote beyond the slot at frame " << sequence;
        if (frame.status != ARHOST_STATUS_OK)
            return frame;
        for (std::uint32_t p = 0; p < format.plane_count; ++p) {
            const std::size_t rows = p == 0 ? format.height : format.height / 2;
            for (std::size_t y = 0; y < rows; ++y) {
                const std::uint8_t *row = buffer.plane[p] + y * format.stride[p];
                frame.bytes.insert(frame.bytes.end(), row, row + row_bytes(p));
            }
        }
        for (std::size_t y = 0; format.has_depth && y < format.height; ++y) {
            const std::uint16_t *row = buffer.depth_mm + y * format.depth_stride / 2;
            frame.depth_mm.insert(frame.depth_mm.end(), row, row + format.width);
        }
        return frame;
    }

    // Reads a frame; throws if the source delivers none.
    SourceFrame read_frame(std::uint64_t sequence) {
        SourceFrame frame = read(sequence);
        if (frame.status != ARHOST_STATUS_OK)
            throw std::runtime_error("frame " + std::to_string(sequence) + ": status " +
                                     std::to_string(frame.status) + "\n" + log());
        return frame;
    }

    // Reads frames up to and including the first whose status is not ARHOST_STATUS_OK, but at most `at_most`.
    std::vector<SourceFrame> read_all(std::uint64_t from = 0, std::size_t at_most = 1000) {
        std::vector<SourceFrame> frames;
        do
            frames.push_back(read(from + frames.size()));
        while (frames.back().status == ARHOST_STATUS_OK && frames.size() < at_most);
        return frames;
    }

    void stop() {
        if (running_)
            source_.stop(plugin_.instance());
        running_ = false;
        plugin_.destroy();
    }

    const arhost_source_properties &properties() const { return properties_; }
    const arhost_frame_format &format() const { return properties_.format; }
    PluginUnderTest &plugin() { return plugin_; }
    std::string log() const { return plugin_.log(); }

    // Returns the log messages of one severity.
    std::string log(arhost_severity severity) const {
        std::string found, line;
        for (const char c : plugin_.log()) {
            line += c;
            if (c != '\n')
                continue;
            if (line.starts_with(std::to_string(severity) + " "))
                found += line;
            line.clear();
        }
        return found;
    }

    // Returns the error message of a start that must fail with this status and one message.
    static std::string rejection(const std::string &id, const std::map<std::string, std::string> &options,
                                 arhost_status expected = ARHOST_STATUS_ERROR_CONFIGURATION,
                                 arhost_source_setup setup = {}) {
        SourceUnderTest source(id);
        EXPECT_EQ(source.start(options, setup), expected) << source.log();
        const std::string errors = source.log(ARHOST_SEVERITY_ERROR);
        EXPECT_EQ(std::ranges::count(errors, '\n'), 1) << "expected one error message, got:\n" << errors;
        return errors;
    }

private:
    std::size_t row_bytes(std::uint32_t plane) const {
        const std::size_t w = properties_.format.width;
        switch (properties_.format.pixel_format) {
        case ARHOST_PIXEL_FORMAT_RGB8:
        case ARHOST_PIXEL_FORMAT_BGR8:
            return 3 * w;
        case ARHOST_PIXEL_FORMAT_YUYV:
            return 2 * w;
        case ARHOST_PIXEL_FORMAT_I420:
            return plane == 0 ? w : w / 2;
        default: // GREY8, NV12
            return w;
        }
    }

    PluginUnderTest plugin_;
    const arhost_source &source_;
    arhost_source_properties properties_{};
    std::optional<GuardedBuffer> buffer_;
    bool running_ = false;
};

} // namespace arhost::test
