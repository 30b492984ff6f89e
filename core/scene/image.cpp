// SPDX-License-Identifier: Apache-2.0
#include "scene/image.hpp"

#include "scene/image_reader.hpp"
#include "scene/srgb.hpp"

#include <dlfcn.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string_view>

namespace arhost::scene {
namespace {

// Loads the shared object that links OpenImageIO. It is never unloaded, because libraries that OpenImageIO loads may
// have running threads.
ReadImage *reader() {
    static ReadImage *const found = [] {
        // Absolute path: the sanitizers' dlopen interceptor ignores our RUNPATH.
        const std::filesystem::path file =
            std::filesystem::read_symlink("/proc/self/exe").parent_path() / "../lib/arhost/arhost-images.so";
        void *module = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
        void *symbol = module ? ::dlsym(module, read_image_symbol) : nullptr;
        if (!symbol)
            throw ImageError(std::string("images cannot be loaded: ") + ::dlerror());
        return reinterpret_cast<ReadImage *>(symbol);
    }();
    return found;
}

constexpr std::ptrdiff_t start_size = 12; // bytes of a file that show its format

// Returns OpenImageIO's name of the format, according to the file's magic number, because file extensions are
// unreliable. Only the decoders named here are ever used.
const char *format_of(std::string_view start) {
    using namespace std::string_view_literals;
    if (start.starts_with("\x89PNG\r\n"sv))
        return "png";
    if (start.starts_with("\xff\xd8\xff"sv))
        return "jpeg";
    if (start.starts_with("\x76\x2f\x31\x01"sv))
        return "openexr";
    if (start.starts_with("RIFF"sv) && start.substr(std::min<std::size_t>(8, start.size())).starts_with("WEBP"sv))
        return "webp";
    if (start.starts_with("#?"sv))
        return "hdr";
    if (start.size() > 2 && start[0] == 'P' && (std::string_view("123456Ff").find(start[1]) != start.npos))
        return "pnm";
    return nullptr;
}

std::string start_of(const std::filesystem::path &file) {
    std::error_code ignored;
    if (std::filesystem::exists(file, ignored) && !std::filesystem::is_regular_file(file, ignored))
        throw ImageError(file.string() + ": is not a regular file");
    errno = 0;
    std::ifstream stream(file, std::ios::binary);
    char start[start_size] = {};
    stream.read(start, sizeof start);
    if (stream.gcount() == 0)
        throw ImageError(file.string() + (errno ? std::string(": cannot be read: ") + std::strerror(errno)
                                                : std::string(": is empty")));
    return {start, static_cast<std::size_t>(stream.gcount())};
}

std::span<float> floats_of(const Texels &texels) {
    return {reinterpret_cast<float *>(texels.bytes.get()), texels.size / sizeof(float)};
}

// Clamps all values to 0 … radiance_limit and logs the number of clamped values.
void clamp_radiance(const Image &image, const std::string &name, const Reporter &reporter) {
    std::size_t clamped = 0;
    for (float &value : floats_of(image.texels)) {
        if (value >= 0 && value <= radiance_limit) {
            value += 0.f; // −0 becomes 0
            continue;
        }
        value = value > radiance_limit ? radiance_limit : 0; // NaN becomes 0
        ++clamped;
    }
    if (clamped > 0)
        reporter.info(name + ": " + std::to_string(clamped) +
                      " values were below 0, above 1e6 or NaN; they were clamped to 0 or 1e6");
}

const std::array<float, 256> &linear_from_byte() {
    static const std::array<float, 256> table = [] {
        std::array<float, 256> t;
        for (int i = 0; i < 256; ++i)
            t[i] = static_cast<float>(linear_from_srgb(i / 255.0));
        return t;
    }();
    return table;
}

// Writes the cumulative sums of `values` to `sums`, normalized so that the last one is 1. If all values are 0, they
// count as equal.
void accumulate(std::span<const double> values, std::span<float> sums) {
    double total = 0;
    for (const double value : values)
        total += value;
    double sum = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
        sum += total > 0 ? values[i] / total : 1.0 / static_cast<double>(values.size());
        sums[i] = static_cast<float>(std::min(sum, 1.0));
    }
    sums.back() = 1;
}

} // namespace

void ImageBudget::take(std::uint64_t bytes, const std::string &name) {
    if (bytes > left_)
        throw ImageError(name + ": the decoded images of a scene may have at most " + std::to_string(limit_ >> 20) +
                         " MiB together, and this one exceeds it by " + std::to_string(((bytes - left_) >> 20) + 1) +
                         " MiB; scale some of them down");
    left_ -= bytes;
}

Image read_image(const std::filesystem::path &file, std::span<const unsigned char> content, const Reporter &reporter,
                 ImageBudget &budget) {
    const std::string name = file.string();
    if (content.empty())
        reporter.reads(file);
    const char *format =
        format_of(content.empty() ? start_of(file)
                                  : std::string(content.begin(),
                                                content.begin() + std::min<std::size_t>(start_size, content.size())));
    if (!format)
        throw ImageError(name +
                         ": is not a PNG, JPEG, WebP, PPM, HDR or EXR image; convert it to one of these formats");
    Image image;
    std::exception_ptr stopped; // exceptions must not propagate through OpenImageIO
    ImageRequest request{format, name, content, {}, {}};
    request.allocate = [&](std::uint32_t width, std::uint32_t height, bool is_float) {
        image.width = width;
        image.height = height;
        image.is_float = is_float;
        const std::size_t size = std::size_t(width) * height * (is_float ? 16 : 4);
        budget.take(size, name);
        image.texels = Texels::of_size(size);
        return image.texels.bytes.get();
    };
    request.report = [&](float fraction) {
        try {
            reporter.report(fraction);
            return true;
        } catch (...) {
            stopped = std::current_exception();
            return false;
        }
    };
    std::string error;
    reader()(request, error);
    if (stopped)
        std::rethrow_exception(stopped);
    if (!error.empty()) {
        while (!error.empty() && error.back() == '\n')
            error.pop_back();
        throw ImageError(name + ": " + error);
    }
    if (image.is_float)
        clamp_radiance(image, name, reporter);
    return image;
}

Image linearized(Image image, const Reporter &reporter) {
    if (image.is_float)
        return image;
    Image linear{image.width, image.height, true, Texels::of_size(image.texels.size * sizeof(float))};
    const std::span<float> to = floats_of(linear.texels);
    for (std::size_t i = 0; i < to.size(); ++i) {
        if (i % (std::size_t(4) * image.width) == 0)
            reporter.report(static_cast<double>(i) / static_cast<double>(to.size()));
        const auto value = std::to_integer<unsigned char>(image.texels.bytes[i]);
        to[i] = i % 4 == 3 ? static_cast<float>(value) / 255 : linear_from_byte()[value];
    }
    return linear;
}

void add_cumulative_sums(Environment &environment, const TexelImage &image, const Reporter &reporter) {
    const std::span<const float> texels = floats_of(image.texels);
    environment.rows.resize(image.height);
    environment.columns.resize(std::size_t(image.width) * image.height);
    const std::size_t width = image.width, height = image.height;
    // The mean of the bilinear interpolation over a texel has the weights 1, 6 and 1 along each axis.
    const auto mean = [](double before, double here, double after) { return (before + 6 * here + after) / 8; };
    std::vector<double> by_column(width), luminance(width), row_sums(height);
    for (std::size_t row = 0; row < height; ++row) {
        reporter.report(static_cast<double>(row) / image.height);
        for (std::size_t column = 0; column < width; ++column) {
            const auto at = [&](std::size_t y) {
                const float *t = &texels[4 * (y * width + column)];
                return 0.2126 * t[0] + 0.7152 * t[1] + 0.0722 * t[2]; // Rec. 709
            };
            by_column[column] = mean(at(row - (row > 0)), at(row), at(std::min(row + 1, height - 1)));
        }
        double sum = 0;
        for (std::size_t column = 0; column < width; ++column)
            sum += luminance[column] =
                mean(by_column[(column + width - 1) % width], by_column[column], by_column[(column + 1) % width]);
        accumulate(luminance, std::span(environment.columns).subspan(row * image.width, image.width));
        row_sums[row] = sum * std::sin(std::numbers::pi * (static_cast<double>(row) + 0.5) / image.height);
    }
    accumulate(row_sums, environment.rows);
}

} // namespace arhost::scene
