// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "reader.hpp"

#include <opencv2/core/mat.hpp>

#include <filesystem>
#include <vector>

namespace arhost {

// Returns whether the extension is that of an image format. Files with other extensions are decoded by libav.
bool is_image_name(const std::filesystem::path &path);

// A sequence of image files. The first image determines the size and the pixel format (grey or colour).
class ImageSequence final : public Reader {
public:
    explicit ImageSequence(std::vector<std::filesystem::path> files); // at least one

    arhost_frame_format format() const override;
    std::uint64_t frame_count() const override { return files_.size(); }
    arhost_status go_to(std::uint64_t index) override;
    void copy_to(const arhost_frame_buffer &buffer) override;

private:
    std::vector<std::filesystem::path> files_;
    std::uint64_t current_ = 0;
    cv::Mat image_; // the current image, 8-bit, 1 or 3 channels
};

// Returns the files that match a numbered file name ("frames/image_%04d.png"), from number `start` (−1: the lowest
// number that exists) up to the first missing number. Throws Failure if there are no such files.
std::vector<std::filesystem::path> numbered_files(const std::filesystem::path &path, std::int64_t start,
                                                  const Host &host);

} // namespace arhost
