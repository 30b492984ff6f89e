// @NAME@: a sink for arhost. Writes each frame as an image: <path>000000.ppm, …
#include <arhost-cpp/plugin.hpp>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <vector>

namespace {

namespace fs = std::filesystem;

class @CLASS@ {
public:
    @CLASS@(const arhost::Host &, const arhost::Options &options)
        : path_(options.text("path")), temporary_(path_ + ".part") {}

    // Reports an unwritable path now, but leaves existing files unchanged until the first frame: another component
    // may still reject the run.
    void start(const arhost_sink_setup &setup) {
        std::error_code ignored; // the next statement reports errors
        fs::create_directories(fs::path(path_).parent_path(), ignored);
        if (!std::ofstream(temporary_))
            throw arhost::Failure(ARHOST_STATUS_ERROR_IO, "cannot write " + temporary_);
        fs::remove(temporary_);
        row_.resize(std::size_t(3) * setup.width);
    }

    // FILL IN: your output. output.record has the frame's pose, time and more.
    arhost_status write(const arhost_output &output) {
        char number[32];
        std::snprintf(number, sizeof number, "%06llu.ppm", static_cast<unsigned long long>(output.record->sequence));
        std::ofstream file(temporary_, std::ios::binary);
        file << "P6\n" << output.width << ' ' << output.height << "\n255\n";
        for (std::uint32_t row = 0; row < output.height; ++row) {
            const std::uint8_t *bgr = output.bgr + std::size_t(row) * output.stride;
            for (std::size_t i = 0; i < row_.size(); i += 3) {
                row_[i] = static_cast<char>(bgr[i + 2]);
                row_[i + 1] = static_cast<char>(bgr[i + 1]);
                row_[i + 2] = static_cast<char>(bgr[i]);
            }
            file.write(row_.data(), static_cast<std::streamsize>(row_.size()));
        }
        file.close();
        if (!file)
            throw arhost::Failure(ARHOST_STATUS_ERROR_IO, "cannot write " + temporary_);
        fs::rename(temporary_, path_ + number); // atomic: only complete files get the final name
        return ARHOST_STATUS_OK;                // from here on the frame must survive a kill of the process
    }

private:
    std::string path_, temporary_; // absolute
    std::vector<char> row_;
};

// arhost validates the configuration against these before it calls the constructor.
constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr,
                   "Prefix of the file names; a number and .ppm are appended."),
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SINK,
    .id = "org.example.@NAME@", // FILL IN: your domain in reverse order; ends with the file name
    .name = "@NAME@",
    .version = "0.1.0",
    .vendor = "unknown", // FILL IN: your name
    .licence = "NONE",   // FILL IN: SPDX identifier, e.g. "Apache-2.0"
    .description = "Writes each frame as an image (PPM).",
    .capabilities = 0,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr, // permissions from the sandbox: arhost/plugin.h
};

} // namespace

ARHOST_SINK(@CLASS@, descriptor)
