// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "image_encoder.hpp"
#include "sink_common/files.hpp"

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

namespace arhost::images {

// Keeps the newest frame in a file until the run ends, because it is not known in advance which frame is the last,
// and encoding every frame is expensive. `keep` writes the raw pixels to the older of two slots. It marks this slot
// as empty before writing and as filled afterwards, so a slot marked as filled is complete even if the process is
// killed.
class LastFrame {
public:
    // Discards kept frames whose number is `first_sequence` or higher.
    LastFrame(const std::filesystem::path &file, std::uint32_t width, std::uint32_t height, PixelFormat format,
              std::uint64_t first_sequence);

    void keep(const Image &image, std::uint64_t sequence);
    std::optional<Image> newest(); // std::nullopt if there is no frame; valid until the next call

private:
    std::size_t newest_slot() const;
    void write_marks();

    files::File file_;
    std::uint32_t width_, height_;
    PixelFormat format_;
    std::uint64_t slot_size_;
    std::array<std::uint64_t, 2>
        marks_{}; // for each slot: the frame's sequence number + 1, or 0 if the slot is empty
    std::vector<std::uint8_t> pixels_;
};

} // namespace arhost::images
