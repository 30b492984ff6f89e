// SPDX-License-Identifier: Apache-2.0
#include "last_frame.hpp"

#include <cstring>
#include <fcntl.h>

namespace arhost::images {

// The file has the pixels of slot 0, the pixels of slot 1, and the marks of both slots.
LastFrame::LastFrame(const std::filesystem::path &file, std::uint32_t width, std::uint32_t height, PixelFormat format,
                     std::uint64_t first_sequence)
    : file_(file, O_RDWR | O_CREAT), width_(width), height_(height), format_(format),
      slot_size_(std::uint64_t{bytes_per_pixel(format)} * width * height) {
    if (file_.size() == 2 * slot_size_ + sizeof marks_)
        file_.read_at(2 * slot_size_, {reinterpret_cast<std::uint8_t *>(marks_.data()), sizeof marks_});
    for (std::uint64_t &mark : marks_)
        if (mark > first_sequence)
            mark = 0;
    write_marks();
}

std::size_t LastFrame::newest_slot() const {
    return marks_[1] > marks_[0];
}

void LastFrame::keep(const Image &image, std::uint64_t sequence) {
    const std::size_t slot = 1 - newest_slot(), row_size = image.row_bytes();
    pixels_.resize(slot_size_);
    for (std::uint32_t y = 0; y < height_; ++y)
        std::memcpy(pixels_.data() + y * row_size, image.row(y), row_size);
    marks_[slot] = 0;
    write_marks();
    file_.write_at(slot * slot_size_, pixels_);
    marks_[slot] = sequence + 1;
    write_marks();
}

std::optional<Image> LastFrame::newest() {
    const std::size_t slot = newest_slot();
    if (marks_[slot] == 0)
        return std::nullopt;
    pixels_.resize(slot_size_);
    file_.read_at(slot * slot_size_, pixels_);
    return Image{width_, height_, bytes_per_pixel(format_) * width_, pixels_.data(), format_};
}

void LastFrame::write_marks() {
    file_.write_at(2 * slot_size_, {reinterpret_cast<const std::uint8_t *>(marks_.data()), sizeof marks_});
}

} // namespace arhost::images
