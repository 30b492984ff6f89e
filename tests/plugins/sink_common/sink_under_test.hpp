// SPDX-License-Identifier: Apache-2.0
//
// Calls a sink's functions like the worker does. Also provides test pictures and fault injection.
#pragma once

#include "plugin_under_test.hpp"

#include <arhost/sink.h>

#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace arhost::test {

// A BGR8 picture in protected memory: writing to it, or reading past its last pixel, causes a segmentation fault.
class Picture {
public:
    // Paints smooth gradients that move with `number`. If the picture is at least 128 px wide, also draws `number` in
    // binary, as black and white squares of 8 px along the top edge. If `stride` is 0, rows have no padding.
    Picture(int width, int height, std::uint64_t number, int stride = 0)
        : width_(width), height_(height), stride_(stride ? stride : 3 * width) {
        const std::size_t page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
        const std::size_t used =
            static_cast<std::size_t>(stride_) * (height - 1) + 3 * static_cast<std::size_t>(width);
        const std::size_t readable = (used + page - 1) / page * page;
        mapped_ = readable + page;
        void *map = mmap(nullptr, mapped_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (map == MAP_FAILED)
            throw std::runtime_error("mmap");
        map_ = static_cast<std::uint8_t *>(map);
        bgr_ = map_ + readable - used;
        paint(number);
        mprotect(map_, readable, PROT_READ);
        mprotect(map_ + readable, page, PROT_NONE);
    }
    ~Picture() { munmap(map_, mapped_); }
    Picture(const Picture &) = delete;
    Picture &operator=(const Picture &) = delete;

    int width() const { return width_; }
    int height() const { return height_; }
    int stride() const { return stride_; }
    const std::uint8_t *bgr() const { return bgr_; }
    const std::uint8_t *pixel(int x, int y) const { return bgr_ + static_cast<std::size_t>(y) * stride_ + 3 * x; }

    static constexpr int square_px = 8, squares = 16;

private:
    void paint(std::uint64_t number) {
        for (int y = 0; y < height_; ++y)
            for (int x = 0; x < width_; ++x) {
                std::uint8_t *p = bgr_ + static_cast<std::size_t>(y) * stride_ + 3 * x;
                const double t = static_cast<double>(number % 1000);
                p[0] = wave(0.021 * x + 0.009 * y + 0.05 * t);
                p[1] = wave(0.013 * x - 0.017 * y + 1.0 + 0.03 * t);
                p[2] = wave(0.007 * x + 0.023 * y + 2.0 - 0.04 * t);
                if (y < square_px && x < square_px * squares && width_ >= square_px * squares)
                    p[0] = p[1] = p[2] = (number >> (x / square_px)) & 1 ? 255 : 0;
            }
    }
    static std::uint8_t wave(double phase) {
        return static_cast<std::uint8_t>(std::lround(128 + 100 * std::sin(phase)));
    }

    int width_, height_, stride_;
    std::size_t mapped_;
    std::uint8_t *map_, *bgr_;
};

inline arhost_record make_record(std::uint64_t sequence, double fps) {
    arhost_record record{};
    record.struct_size = sizeof record;
    record.clock = ARHOST_CLOCK_MEDIA;
    record.sequence = sequence;
    record.capture_ns = static_cast<std::int64_t>(sequence) * static_cast<std::int64_t>(1e9 / fps);
    record.overlay = ARHOST_OVERLAY_NONE;
    return record;
}
inline arhost_record make_record(std::uint64_t sequence) {
    return make_record(sequence, 30);
}

// Returns a camera for pictures of this size. Its numbers need many decimal digits, to test that sinks do not round
// them.
inline arhost_intrinsics make_intrinsics(int width, int height) {
    arhost_intrinsics intrinsics{};
    intrinsics.struct_size = sizeof intrinsics;
    intrinsics.width = static_cast<std::uint32_t>(width);
    intrinsics.height = static_cast<std::uint32_t>(height);
    intrinsics.distortion = ARHOST_DISTORTION_BROWN;
    intrinsics.fx = 1000.0 / 3;
    intrinsics.fy = 1000.0 / 7;
    intrinsics.cx = width / 2.1;
    intrinsics.cy = height / 1.9;
    intrinsics.coefficient_count = 4;
    const double coefficients[] = {0.1 / 3, -1e-17, 0, 2e-3};
    std::ranges::copy(coefficients, intrinsics.coefficients);
    return intrinsics;
}

// An overlay whose rows end with padding. Its alpha covers all values.
class OverlayPicture {
public:
    OverlayPicture(std::uint32_t width, std::uint32_t height)
        : stride((4 * width + 63) / 64 * 64 + 64), rgba(std::size_t{stride} * height, 0xee) {
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                for (std::uint32_t channel = 0; channel < 4; ++channel)
                    pixel(x, y)[channel] = static_cast<std::uint8_t>(3 * x + (5 + channel) * y + 60 * channel);
    }
    std::uint8_t *pixel(std::uint32_t x, std::uint32_t y) { return rgba.data() + std::size_t{y} * stride + 4 * x; }

    std::uint32_t stride;
    std::vector<std::uint8_t> rgba;
};

// A sink plugin under test. Destroying it without calling `stop` simulates that its worker was killed.
class SinkUnderTest {
public:
    SinkUnderTest(const std::string &id, const std::map<std::string, std::string> &options) : plugin_(id) {
        created_ = plugin_.create(options);
    }

    bool knows_camera = true; // whether start() passes the intrinsics to the sink
    bool has_depth = false;   // whether the source delivers depth

    arhost_status created() const { return created_; }
    arhost_status start(int width, int height, std::uint64_t first_sequence = 0, double fps = 30) {
        if (created_ != ARHOST_STATUS_OK)
            return created_;
        width_ = width;
        height_ = height;
        fps_ = fps > 0 ? fps : 30;
        arhost_sink_setup setup{};
        setup.struct_size = sizeof setup;
        setup.width = static_cast<std::uint32_t>(width);
        setup.height = static_cast<std::uint32_t>(height);
        setup.fps = fps;
        setup.first_sequence = first_sequence;
        const arhost_intrinsics intrinsics = make_intrinsics(width, height);
        setup.intrinsics = knows_camera ? &intrinsics : nullptr;
        format_ = {};
        format_.struct_size = sizeof format_;
        format_.pixel_format = ARHOST_PIXEL_FORMAT_BGR8;
        format_.width = setup.width;
        format_.height = setup.height;
        format_.has_depth = has_depth;
        (void)arhost_frame_layout(&format_); // tests may use sizes that are too large
        setup.video_format = &format_;
        return functions().start(plugin_.instance(), &setup);
    }
    const arhost_frame_format &video_format() const { return format_; }
    std::uint64_t capabilities() const {
        return functions().capabilities ? functions().capabilities(plugin_.instance()) : descriptor().capabilities;
    }
    arhost_status write(const Picture &picture, const arhost_record &record, const OverlayPicture *overlay = nullptr,
                        const std::uint16_t *depth_mm = nullptr) {
        arhost_output output{};
        if (overlay) {
            output.overlay_rgba = overlay->rgba.data();
            output.overlay_stride = overlay->stride;
        }
        output.depth_mm = depth_mm;
        output.struct_size = sizeof output;
        output.stride = static_cast<std::uint32_t>(picture.stride());
        output.width = static_cast<std::uint32_t>(picture.width());
        output.height = static_cast<std::uint32_t>(picture.height());
        output.bgr = picture.bgr();
        output.record = &record;
        return functions().write(plugin_.instance(), &output);
    }
    arhost_status write(std::uint64_t sequence) {
        return write(Picture(width_, height_, sequence), make_record(sequence, fps_));
    }
    arhost_status write(std::uint64_t first, std::uint64_t end) { // [first, end)
        for (; first < end; ++first)
            if (const arhost_status status = write(first); status != ARHOST_STATUS_OK)
                return status;
        return ARHOST_STATUS_OK;
    }
    // Starts the sink and writes the frames [first, end). Throws if a call fails.
    void start_and_write(int width, int height, std::uint64_t first, std::uint64_t end, double fps = 30) {
        if (start(width, height, first, fps) != ARHOST_STATUS_OK || write(first, end) != ARHOST_STATUS_OK)
            throw std::runtime_error(log());
    }
    // Like start_and_write(), then stops the sink.
    void run(int width, int height, std::uint64_t first, std::uint64_t end, double fps = 30) {
        start_and_write(width, height, first, end, fps);
        if (stop() != ARHOST_STATUS_OK)
            throw std::runtime_error(log());
    }
    arhost_status idle() { return functions().idle(plugin_.instance()); }
    arhost_status stop() { return functions().stop(plugin_.instance()); }

    const arhost_sink &functions() const { return plugin_.functions<arhost_sink>(); }
    const arhost_descriptor &descriptor() const { return plugin_.descriptor(); }
    void cancel(int after = 0) { plugin_.cancel(after); }
    std::string log() const { return plugin_.log(); }

private:
    PluginUnderTest plugin_;
    arhost_status created_;
    int width_ = 0, height_ = 0;
    double fps_ = 30;
    arhost_frame_format format_{};
};

// Runs a sink in a child process, beginning at frame `first_sequence`, and kills the process after the sink has
// acknowledged at least `frames` frames. Returns the number of the first unacknowledged frame, at which the host
// would continue.
template <class MakeRecord = arhost_record (*)(std::uint64_t)>
std::uint64_t write_until_killed(const std::string &id, const std::map<std::string, std::string> &options, int width,
                                 int height, std::uint64_t first_sequence, std::uint64_t frames,
                                 MakeRecord record = make_record) {
    int pipe_ends[2];
    if (pipe(pipe_ends) != 0)
        throw std::runtime_error("pipe");
    const pid_t child = fork();
    if (child < 0)
        throw std::runtime_error("fork");
    if (child == 0) {
        SinkUnderTest sink(id, options);
        if (sink.start(width, height, first_sequence) != ARHOST_STATUS_OK)
            _exit(1);
        for (std::uint64_t i = first_sequence;; ++i)
            if (sink.write(Picture(width, height, i), record(i)) != ARHOST_STATUS_OK ||
                ::write(pipe_ends[1], "a", 1) != 1)
                _exit(1);
    }
    ::close(pipe_ends[1]);
    std::uint64_t acknowledged = 0;
    for (char byte; ::read(pipe_ends[0], &byte, 1) == 1;)
        if (++acknowledged == frames)
            kill(child, SIGKILL);
    ::close(pipe_ends[0]);
    int status = 0;
    waitpid(child, &status, 0);
    if (!WIFSIGNALED(status) || acknowledged < frames)
        throw std::runtime_error("the sink failed before it was killed");
    return first_sequence + acknowledged;
}

// Simulates a full disk: as long as this object exists, no file can grow beyond `bytes`.
class FileSizeLimit {
public:
    explicit FileSizeLimit(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
        getrlimit(RLIMIT_FSIZE, &before_);
        const rlimit limit{bytes, before_.rlim_max};
        setrlimit(RLIMIT_FSIZE, &limit);
    }
    ~FileSizeLimit() {
        setrlimit(RLIMIT_FSIZE, &before_);
        std::signal(SIGXFSZ, handler_);
    }
    FileSizeLimit(const FileSizeLimit &) = delete;
    FileSizeLimit &operator=(const FileSizeLimit &) = delete;

private:
    void (*handler_)(int);
    rlimit before_{};
};

// Creates a folder in which this process cannot write. If it runs as root, it is user `nobody` until destruction,
// because permissions do not limit root.
class UnwritableFolder {
public:
    explicit UnwritableFolder(const std::filesystem::path &path) : path_(path) {
        std::filesystem::create_directories(path);
        chmod(path.c_str(), 0555);
        chmod(path.parent_path().c_str(), 0755);
        if (geteuid() == 0)
            was_root_ = seteuid(65534) == 0;
    }
    ~UnwritableFolder() {
        if (was_root_ && seteuid(0) != 0)
            std::abort();
        chmod(path_.c_str(), 0755);
    }
    UnwritableFolder(const UnwritableFolder &) = delete;
    UnwritableFolder &operator=(const UnwritableFolder &) = delete;

private:
    std::filesystem::path path_;
    bool was_root_ = false;
};

inline std::string read_text(const std::filesystem::path &file) {
    std::ifstream in(file, std::ios::binary);
    if (!in)
        throw std::runtime_error("cannot read " + file.string());
    return {std::istreambuf_iterator<char>(in), {}};
}

// Returns the sorted names of all files in a folder, including hidden files.
inline std::vector<std::string> names_in(const std::filesystem::path &folder) {
    std::vector<std::string> names;
    for (const auto &entry : std::filesystem::directory_iterator(folder))
        names.push_back(entry.path().filename().string());
    std::ranges::sort(names);
    return names;
}

} // namespace arhost::test
