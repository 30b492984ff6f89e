// @NAME@: a sink for arhost. It writes each frame as a picture, <path>000000.ppm and so on.
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
        : path_(options.text("path")), part_(path_ + ".part") {}

    // Where nothing can be written this tells so now. It leaves what is there as it is until the first frame:
    // another component may yet refuse the run.
    void start(const arhost_sink_setup &setup) {
        std::error_code ignored; // what is wrong shows in the next lines
        fs::create_directories(fs::path(path_).parent_path(), ignored);
        if (!std::ofstream(part_))
            throw arhost::Failure(ARHOST_STATUS_ERROR_IO, "can't write " + part_);
        fs::remove(part_);
        row_.resize(std::size_t(3) * setup.width);
    }

    // FILL IN: what becomes of a frame. output.record tells its pose, its time and how its overlay arose.
    arhost_status write(const arhost_output &output) {
        char number[32];
        std::snprintf(number, sizeof number, "%06llu.ppm", static_cast<unsigned long long>(output.record->sequence));
        std::ofstream file(part_, std::ios::binary);
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
            throw arhost::Failure(ARHOST_STATUS_ERROR_IO, "can't write " + part_);
        fs::rename(part_, path_ + number); // under its own name only when it is whole
        return ARHOST_STATUS_OK;                  // the frame must now survive the death of this process
    }

private:
    std::string path_, part_; // absolute
    std::vector<char> row_;
};

// arhost checks the configuration against these before the constructor sees a value.
constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr,
                   "What the pictures' names begin with; a number and .ppm follow."),
};

constexpr arhost_descriptor descriptor = {
    sizeof(arhost_descriptor),
    ARHOST_KIND_SINK,
    "@NAME@", // the file's name
    "@NAME@",
    "0.1.0",
    "unknown", // FILL IN: you
    "NONE", // FILL IN: the licence (SPDX), "Apache-2.0"
    "Writes each frame as a picture (PPM).",
    0,
    std::size(options),
    options,
    nullptr, // what of the machine it needs: arhost/plugin.h
};

} // namespace

ARHOST_SINK(@CLASS@, descriptor)
