// SPDX-License-Identifier: Apache-2.0
// All wrong sinks: each frame becomes a file and a line of a log, with a defect that this library's file name
// selects.
#include "defect.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <directories.hpp>
#include <fcntl.h>
#include <fstream>
#include <sstream>
#include <thread>

namespace {

using namespace arhost;
using namespace arhost::test;
namespace fs = std::filesystem;

Failure write_failure(const std::string &file) {
    return Failure(ARHOST_STATUS_ERROR_IO, "cannot write " + file + ": " + std::strerror(errno));
}

// Writes to a file without buffering.
void write_file(const std::string &file, const std::string &bytes, int flags) {
    const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | flags, 0666);
    if (fd < 0)
        throw write_failure(file);
    std::string_view left = bytes;
    bool failed = false;
    while (!left.empty() && !failed) {
        const ssize_t count = ::write(fd, left.data(), left.size());
        failed = count < 0;
        if (failed && has("hangs_on_a_full_disk"))
            hang();
        if (failed && has("crash_on_a_full_disk"))
            crash();
        left.remove_prefix(failed ? 0 : static_cast<std::size_t>(count));
    }
    ::close(fd);
    if (failed && !has("hides_a_full_disk"))
        throw write_failure(file);
}

std::string line_of(const arhost_record &record) {
    std::ostringstream line;
    line << record.sequence << ' ' << record.capture_ns << ' ' << record.overlay << ' '
         << (record.has_camera ? record.camera.eye[2] : 0);
    if (has("ignores_struct_size")) {
        for (std::uint32_t i = 0; i < record.target_count; ++i)
            line << ' ' << record.targets[i].mt[14];
    } else {
        for (const arhost_target &target : elements(record.targets, record.target_count))
            line << ' ' << target.mt[14];
    }
    for (const arhost_observation &seen : elements(record.observations, record.observation_count))
        line << ' ' << seen.id;
    return line.str() + "\n";
}

std::string shared_path; // for mixes_instances
bool is_in_use = false;

class Files {
public:
    Files(const Host &host, const Options &options) : host_(host), path_(options.text("path")) {}
    ~Files() {
        if (has("crash_after_a_failed_start") && is_starting_)
            crash();
    }
    Files(const Files &) = delete;
    Files &operator=(const Files &) = delete;

    void start(const arhost_sink_setup &setup) {
        misbehave_in("start");
        is_starting_ = true;
        if (has("cannot_restart") && std::exchange(is_in_use, true))
            throw Failure(ARHOST_STATUS_ERROR_IO, "the file is busy");
        if (has("start_cancelled_is_internal") && host_.cancelled())
            throw Failure(ARHOST_STATUS_ERROR_INTERNAL, "unexpected cancellation");
        if (has("writes_beside_library"))
            write_file(library_file().replace_extension(".cache"), "sizes", O_TRUNC);
        if (has("rejects_odd_sizes_silently") && setup.width % 2)
            throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "");
        if (has("leaks_descriptors_in_start"))
            (void)::dup(0);
        shared_path = path_;
        fresh_ = setup.first_sequence == 0;
        log_ = fresh_ || has("truncates_log_on_restart") ? "" : kept_before(setup.first_sequence);
        waiting_.clear();
        next_ = setup.first_sequence;
        if (!has("no_write_check_in_start")) {
            fs::create_directories(fs::path(path_).parent_path());
            write_file(path_ + ".try", "", O_TRUNC);
            ::unlink((path_ + ".try").c_str());
        }
        if (has("truncates_log_in_start") && fresh_)
            write_file(path_ + ".log", "", O_TRUNC);
        if (!fresh_ && !has("writes_no_file"))
            write_file(path_ + ".log", log_, O_TRUNC);
        is_starting_ = false;
    }

    arhost_status write(const arhost_output &output) {
        const arhost_record &record = *output.record;
        misbehave_in("write");
        if (has("status_0"))
            return 0;
        if (has("writes_into_the_frame"))
            const_cast<std::uint8_t *>(output.bgr)[0] = 0;
        if (has("writes_into_the_record"))
            const_cast<arhost_record &>(record).target_count = 0;
        if (has("writes_into_a_target"))
            const_cast<arhost_target &>(record.targets[0]).age_frames = 1;
        if (has("crash_on_1x1") && output.width == 1 && output.height == 1)
            crash();
        if (has("crash_on_1024_targets") && record.target_count == ARHOST_MAX_TARGETS)
            crash();
        const volatile arhost_target *const after_targets = record.targets + record.target_count;
        if (has("reads_past_the_targets"))
            (void)after_targets->state;
        const volatile arhost_observation *const after_observations = record.observations + record.observation_count;
        if (has("reads_past_the_observations"))
            (void)after_observations->id;
        if (has("rejects_gaps") && record.sequence != next_)
            throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT, "a frame is missing");
        if (has("cancelled_is_internal") && host_.cancelled())
            return ARHOST_STATUS_ERROR_INTERNAL;
        if (has("slow") && output.width >= 640)
            std::this_thread::sleep_for(std::chrono::milliseconds(120));
        for (int i = 0; i < (has("leaks_many_descriptors") ? 3 : has("leaks_descriptors") ? 1 : 0); ++i)
            (void)::dup(0);
        if (has("leaks_memory"))
            leak_memory(1024);
        if (has("leaves_threads"))
            std::thread(hang).detach();
        next_ = record.sequence + 1;
        if ((has("drops_every_10th") && record.sequence % 10 == 9) || std::exchange(is_late_, false))
            return ARHOST_STATUS_OK;
        const auto begin = std::chrono::steady_clock::now();
        std::string pixels;
        for (std::uint32_t y = 0; y < output.height + has("reads_past_the_frame"); ++y)
            pixels.append(reinterpret_cast<const char *>(output.bgr) + std::size_t{stride(output)} * y,
                          std::size_t{3} * output.width);
        if (has("writes_previous_frame"))
            pixels.swap(before_);
        const std::string line =
            has("writes_previous_frame") ? std::to_string(record.sequence) + "\n" : line_of(record);
        waiting_.emplace_back(record.sequence, pixels, line);
        if (!(has("writes_frames_in_pairs") && waiting_.size() < 2) && !has("buffers_until_stop"))
            write_waiting();
        is_late_ = has("drops_frames_on_a_slow_disk") && path_.find("/slow/") != std::string::npos &&
                   std::chrono::steady_clock::now() - begin > std::chrono::milliseconds(80);
        return ARHOST_STATUS_OK;
    }

    arhost_status idle() {
        misbehave_in("idle");
        return has("idle_fails") ? ARHOST_STATUS_ERROR_UNSUPPORTED : ARHOST_STATUS_OK;
    }

    void stop() {
        misbehave_in("stop");
        if (has("stop_fails"))
            throw Failure(ARHOST_STATUS_ERROR_IO, "the files are incomplete");
        write_waiting();
    }

private:
    struct Waiting {
        Waiting(std::uint64_t n, std::string p, std::string l)
            : sequence(n), pixels(std::move(p)), line(std::move(l)) {}
        std::uint64_t sequence;
        std::string pixels, line;
    };

    static std::uint32_t stride(const arhost_output &output) {
        return has("ignores_the_stride") ? 3 * output.width : output.stride;
    }

    std::string kept_before(std::uint64_t first) const {
        std::ifstream old(path_ + ".log");
        std::string kept;
        for (std::string line; std::getline(old, line);)
            if (has("repeats_frames_on_restart") || std::stoull(line) < first)
                kept += line + "\n";
        return kept;
    }

    void write_waiting() {
        if (has("writes_frames_in_pairs"))
            std::reverse(waiting_.begin(), waiting_.end());
        const std::string &path = has("mixes_instances") ? shared_path : path_;
        std::string lines;
        for (const Waiting &frame : waiting_) {
            write_frame(path, frame);
            lines += frame.line;
        }
        waiting_.clear();
        if (lines.empty() || has("writes_no_file"))
            return;
        const bool is_first = std::exchange(fresh_, false) && !has("appends_to_an_old_log");
        if (has("reverses_log")) {
            log_ = is_first ? lines : lines + log_;
            write_file(path + ".part", log_, O_TRUNC);
            fs::rename(path + ".part", path + ".log");
        } else {
            write_file(path + ".log", lines, is_first ? O_TRUNC : O_APPEND);
        }
    }

    static void write_frame(const std::string &path, const Waiting &frame) {
        if (has("writes_no_file"))
            return;
        const std::uint64_t number = has("writes_each_frame_twice") ? 2 * frame.sequence : frame.sequence;
        const std::string name = path + std::to_string(number), part = path + ".part";
        if (has("partial_files")) {
            const std::size_t half = frame.pixels.size() / 2;
            write_file(name, frame.pixels.substr(0, half), O_TRUNC);
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
            write_file(name, frame.pixels.substr(half), O_APPEND);
        } else {
            try {
                write_file(part, frame.pixels, O_TRUNC);
            } catch (const Failure &) {
                if (has("partial_files_on_a_full_disk"))
                    fs::rename(part, name);
                throw;
            }
            // Swap before the rename, so that a kill between the two leaves the files of a completed frame.
            if (has("swaps_frames") && frame.sequence % 4 == 3)
                ::renameat2(AT_FDCWD, part.c_str(), AT_FDCWD, (path + std::to_string(frame.sequence - 1)).c_str(),
                            RENAME_EXCHANGE);
            fs::rename(part, name);
        }
        if (has("writes_each_frame_twice")) {
            write_file(part, frame.pixels, O_TRUNC);
            fs::rename(part, path + std::to_string(number + 1));
        }
        if (has("writes_extra_files")) // file names that sort before the frames' files
            for (const std::string &more : {"a" + std::to_string(frame.sequence), std::string("last")}) {
                write_file(part, frame.line, O_TRUNC);
                fs::rename(part, fs::path(path).replace_filename(more));
            }
        if (has("writes_timestamps"))
            write_file(name, std::to_string(std::chrono::steady_clock::now().time_since_epoch().count()), O_APPEND);
    }

    Host host_;
    std::string path_, log_, before_;
    std::vector<Waiting> waiting_;
    std::uint64_t next_ = 0;
    bool fresh_ = true, is_starting_ = false, is_late_ = false;
};

constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_OUTPUT_PATH, "path", "frame", "Prefix of the files' names."),
};
constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_SINK,
                                          "org.arhost.test.wrong_sink",
                                          "Files",
                                          "0.1.0",
                                          "arhost",
                                          "Apache-2.0",
                                          "Writes each frame's pixels to a file, and a log.",
                                          0,
                                          std::size(options),
                                          options,
                                          nullptr};

// sink_video, which gets a black picture instead of every fifth frame.
const arhost_plugin &black_video() {
    static const arhost_plugin &video = open_plugin(arhost::test::plugin_directory() + "/sink_video.so");
    static arhost_option_descriptor video_options[8];
    static arhost_descriptor named = *video.descriptor;
    static arhost_sink functions = *static_cast<const arhost_sink *>(video.functions);
    static arhost_plugin plugin = video;
    std::copy_n(video.descriptor->options, named.option_count, video_options);
    video_options[0].default_value = "video.mp4";
    named.options = video_options;
    named.id = library_id();
    functions.write = [](arhost_instance *instance, const arhost_output *output) {
        arhost_output black = *output;
        const std::vector<std::uint8_t> pixels(std::size_t{output->stride} * output->height);
        if (output->record->sequence % 5 == 3)
            black.bgr = pixels.data();
        return static_cast<const arhost_sink *>(video.functions)->write(instance, &black);
    };
    plugin.descriptor = &named;
    plugin.functions = &functions;
    return plugin;
}

} // namespace

extern "C" {
extern ARHOST_EXPORT const arhost_entry_point arhost_entry = {
    sizeof arhost_entry, 0, [](const arhost_offer *offer, arhost_answer *answer) {
        if (has("blackens_a_video_frame"))
            return negotiate(offer, answer, black_video());
        static arhost_sink functions = detail::sink_functions<Files>;
        if (has("no_write"))
            functions.write = nullptr;
        return negotiate_as<Files>(offer, answer, descriptor, &functions);
    }};
}
