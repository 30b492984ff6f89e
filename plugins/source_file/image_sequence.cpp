// SPDX-License-Identifier: Apache-2.0
#include "image_sequence.hpp"

#include "folder.hpp"
#include "webp_orientation.hpp"

#include <arhost-cpp/numbered_name.hpp>

#include <opencv2/imgcodecs.hpp>

#include <cctype>
#include <cstring>
#include <map>

namespace arhost {

namespace fs = std::filesystem;

namespace {

std::string size_text(const cv::Mat &image) {
    return std::to_string(image.cols) + "×" + std::to_string(image.rows);
}

// Reads an image. Converts 16 bits to 8, drops alpha, and applies the Exif orientation.
cv::Mat read_image(const fs::path &file, int flags) {
    cv::Mat image;
    std::string reason = "damaged or unknown image format (animated WebP and floating-point TIFF are not supported)";
    arhost_status status = ARHOST_STATUS_ERROR_CONFIGURATION; // a restart does not help
    try {
        image = cv::imread(file.string(), flags);
        if (const int orientation = webp_orientation(file); orientation != 1)
            image = oriented(image, orientation);
    } catch (const cv::Exception &error) {
        reason = error.err;
    }
    if (image.empty()) {
        std::error_code error;
        const auto size = fs::file_size(file, error);
        if (error)
            reason = error.message(), status = ARHOST_STATUS_ERROR_IO;
        else if (size == 0)
            reason = "the file is empty";
        throw Failure(status, "the image " + quoted(file) + " cannot be read: " + reason);
    }
    if (image.cols > ARHOST_MAX_IMAGE_SIDE || image.rows > ARHOST_MAX_IMAGE_SIDE)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "the image " + quoted(file) + " is " + size_text(image) +
                                                             " px; the limit per side is " +
                                                             std::to_string(ARHOST_MAX_IMAGE_SIDE));
    return image;
}

NumberedName numbered_name_of(const fs::path &path) try {
    return NumberedName(path.filename().string());
} catch (const std::invalid_argument &error) {
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                  "path: " + quoted(path) +
                      " does not exist and is not a valid name of numbered images: " + error.what());
}

} // namespace

bool is_image_name(const fs::path &path) {
    std::string extension = path.extension().string();
    for (char &c : extension)
        c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    for (const char *known :
         {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pbm", ".pgm", ".ppm", ".pnm", ".webp"})
        if (extension == known)
            return true;
    return false;
}

ImageSequence::ImageSequence(std::vector<fs::path> files)
    : files_(std::move(files)), image_(read_image(files_.front(), cv::IMREAD_ANYCOLOR)) {}

arhost_frame_format ImageSequence::format() const {
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = image_.channels() == 1 ? ARHOST_PIXEL_FORMAT_GREY8 : ARHOST_PIXEL_FORMAT_BGR8;
    format.width = static_cast<std::uint32_t>(image_.cols);
    format.height = static_cast<std::uint32_t>(image_.rows);
    return format;
}

arhost_status ImageSequence::go_to(std::uint64_t index) {
    if (index >= files_.size())
        return ARHOST_STATUS_END;
    if (index == current_)
        return ARHOST_STATUS_OK;
    const cv::Mat next = read_image(files_[index], image_.channels() == 1 ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR);
    if (next.size() != image_.size())
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "all images of a sequence must have the same size: " + quoted(files_[index]) + " is " +
                          size_text(next) + ", but " + quoted(files_.front()) + " is " + size_text(image_));
    image_ = next;
    current_ = index;
    return ARHOST_STATUS_OK;
}

void ImageSequence::copy_to(const arhost_frame_buffer &buffer) {
    const std::size_t row_bytes = static_cast<std::size_t>(image_.cols) * image_.elemSize();
    for (int y = 0; y < image_.rows; ++y)
        std::memcpy(buffer.plane[0] + static_cast<std::size_t>(y) * buffer.format->stride[0], image_.ptr(y),
                    row_bytes);
}

std::vector<fs::path> numbered_files(const fs::path &path, std::int64_t start, const Host &host) {
    const fs::path folder = path.parent_path();
    const NumberedName pattern = numbered_name_of(path);
    std::map<std::uint64_t, fs::path> found;
    std::error_code ignored; // if the folder cannot be listed, describe_folder reports it
    for (const auto &entry : fs::directory_iterator(folder, ignored))
        if (const auto number = pattern.number(entry.path().filename().string()))
            found.emplace(*number, entry.path());
    std::uint64_t number = start >= 0 ? static_cast<std::uint64_t>(start) : found.empty() ? 0 : found.begin()->first;
    auto next = found.find(number);
    if (next == found.end()) {
        std::string message = "path: no file matches the pattern " + quoted(path) + ": looked for " +
                              quoted(folder / pattern.name(number)) + " first; ";
        if (found.empty())
            message += describe_folder(folder);
        else
            message.append("the folder has ")
                .append(std::to_string(found.size()))
                .append(" matching files, with numbers from ")
                .append(std::to_string(found.begin()->first))
                .append(" to ")
                .append(std::to_string(found.rbegin()->first))
                .append("; set the option 'start'");
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, message);
    }
    std::vector<fs::path> files;
    for (; next != found.end() && next->first == number; ++next, ++number)
        files.push_back(next->second);
    if (next != found.end())
        host.warn(quoted(folder / pattern.name(number)) +
                  " is missing, so the sequence ends before it; there are files with higher numbers, up to " +
                  std::to_string(found.rbegin()->first));
    return files;
}

} // namespace arhost
