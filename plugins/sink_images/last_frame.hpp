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

// The newest frame, kept in a file until it is known to be the last. Nobody can tell beforehand which
// frame will be, and encoding each would be dear, so the pixels go there as they are: into the older of
// two slots, which is marked as empty before and as filled after. Whenever the process dies, what is
// marked as filled is whole.
class LastFrame {
public:
    // `first_sequence`: frames from there on that are kept already are forgotten; 0: all of them are.
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
