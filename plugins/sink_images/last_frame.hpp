// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "encoder.hpp"
#include "sink_common/files.hpp"

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

namespace arhost::images {

// Keeps the newest frame in a file until the run ends: which frame is the last is not known in advance, and encoding
// every frame is expensive. The raw pixels go to the older of two slots, which is marked empty before and filled
// after, so that a slot marked filled is complete even if the process is killed.
class LastFrame {
public:
    // Discards kept frames with numbers from `first_sequence` on.
    LastFrame(const std::filesystem::path &file, std::uint32_t width, std::uint32_t height,
              std::uint64_t first_sequence);

    void keep(const Image &image, std::uint64_t sequence);
    std::optional<Image> newest(); // valid until the next call

private:
    std::size_t newest_slot() const;
    void write_marks();

    files::File file_;
    std::uint32_t width_, height_;
    std::uint64_t slot_size_;
    std::array<std::uint64_t, 2> marks_{}; // a slot's sequence number + 1; 0: empty
    std::vector<std::uint8_t> pixels_;
};

} // namespace arhost::images
