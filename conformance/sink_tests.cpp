// SPDX-License-Identifier: Apache-2.0
// Sinks: accepted input, and files in normal operation, after a kill, and on a full or slow disk.
#include "conformance/cancelling.hpp"
#include "conformance/frame_times.hpp"
#include "conformance/process_usage.hpp"
#include "conformance/sink_process.hpp"
#include "conformance/sink_run.hpp"
#include "conformance/slow_disk.hpp"
#include "conformance/source_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstring>
#include <deque>
#include <fstream>
#include <limits>
#include <set>
#include <sys/resource.h>
#include <thread>

namespace arhost::conformance {
namespace {

// Skips tests of files if there is no output path.
void require_files(Context &context) {
    const Settings &settings = context.library.settings();
    for (const arhost_option_descriptor *option : options_of(context.library.descriptor())) {
        const auto set = settings.find(option->key);
        const char *const path = set != settings.end() ? set->second.c_str() : option->default_value;
        if (option->type == ARHOST_OPTION_OUTPUT_PATH &&
            (!path || (*path && path != std::string(standard_output)))) // without a path, create reports this
            return;
    }
    throw Skip("it has no output file, so its output cannot be checked");
}

void expect_same(const Files &actual, const Files &expected, const std::string &when) {
    for (const auto &[name, bytes] : expected) {
        const auto found = actual.find(name);
        if (found == actual.end())
            throw Failure(fmt::format("{}: '{}' is missing", when, name));
        if (found->second.size() != bytes.size())
            throw Failure(
                fmt::format("{}: '{}' has {} bytes instead of {}", when, name, found->second.size(), bytes.size()));
        const auto at = std::mismatch(bytes.begin(), bytes.end(), found->second.begin());
        if (at.first != bytes.end())
            throw Failure(fmt::format("{}: '{}' differs from byte {} on", when, name, at.first - bytes.begin()));
    }
    for (const auto &[name, bytes] : actual)
        if (!expected.contains(name))
            throw Failure(fmt::format("{}: '{}' is unexpected", when, name));
}

// The files after each frame of an uninterrupted run, and at its end.
struct History {
    std::vector<Files> after; // after[n]: once n frames were written
    Files end;

    bool has_been(const std::string &name, const std::string &bytes) const {
        const auto in = [&](const Files &files) {
            const auto found = files.find(name);
            return found != files.end() && found->second == bytes;
        };
        return in(end) || std::any_of(after.begin(), after.end(), in);
    }
    // Whether a kill during a single write to a growing file can leave these bytes: the kernel then ends the write at
    // the end of a page, which no sink can prevent.
    bool is_cut_at_page(const std::string &name, const std::string &bytes) const {
        constexpr std::size_t page_size = 4096;
        const auto begins_with = [&](const Files &files) {
            const auto found = files.find(name);
            return found != files.end() && !found->second.empty() && bytes.starts_with(found->second);
        };
        const auto continues = [&](const Files &files) {
            const auto found = files.find(name);
            return found != files.end() && found->second.starts_with(bytes);
        };
        return bytes.size() % page_size == 0 && std::ranges::any_of(after, begins_with) &&
               std::ranges::any_of(after, continues);
    }
};
History history_of(Context &context, std::uint64_t frames, const Size &size = {}) {
    SinkRun run(context, "uninterrupted");
    History history;
    run.start(0, size);
    history.after.push_back(run.files());
    for (std::uint64_t n = 0; n < frames; ++n) {
        run.write(n, n + 1);
        history.after.push_back(run.files());
    }
    run.stop();
    history.end = run.files();
    return history;
}

// ---- From start to stop ----------------------------------------------------------------------------

void start(Context &context) {
    SinkRun run(context, "out");
    const arhost_status status = run.try_start();
    if (const char *const *needs = context.library.descriptor().needs; needs && *needs && status < 0)
        throw Skip(fmt::format("it needs '{}', and {}", *needs, call_result("start", status, run.instance().host())));
    run.instance().expect_ok("start", status);
    run.stop();
}

void write(Context &context) {
    SinkRun(context, "out").run(4);
}

void start_again(Context &context) {
    SinkRun run(context, "a"), fresh(context, "b");
    run.run(3);
    expect_same(run.run(3), fresh.run(3), "in the second run with the same frames");
    run.start(0, {90, 70}); // must succeed; the files are not checked
    run.write(0, 2);
    run.stop();
}

void two_instances(Context &context) {
    SinkRun first(context, "a"), second(context, "b"), alone(context, "c");
    first.start();
    second.start(0, {40, 30});
    for (std::uint64_t n = 0; n < 3; ++n) {
        first.write(n, n + 1);
        second.write(n, n + 1);
    }
    second.stop();
    first.stop();
    expect_same(first.files(), alone.run(3), "while another instance was active");
}

void leaks(Context &context) {
    SinkRun run(context, "out");
    expect_no_leak([&](int frames) { run.run(static_cast<std::uint64_t>(frames)); });
}

void idle(Context &context) {
    SinkRun run(context, "out");
    if (!run.has_idle())
        throw Skip("it has no function idle");
    run.start();
    for (std::uint64_t n = 0; n < 3; ++n) {
        for (int i = 0; i < 3; ++i)
            if (const arhost_status status = run.try_idle();
                status != ARHOST_STATUS_OK && status != ARHOST_STATUS_END)
                throw Failure(call_result("idle", status, run.instance().host()));
        run.write(n, n + 1);
    }
    run.stop();
}

void cancelled(Context &context) {
    SinkRun running(context, "a"), starting(context, "b");
    running.start();
    running.write(0, 1);
    running.instance().host().cancel();
    expect_ok_or_cancelled("write", running.try_write(SealedOutput({1})));
    expect_ok_or_cancelled("stop", running.try_stop());
    starting.instance().host().cancel();
    expect_ok_or_cancelled("start", starting.try_start());
}

// ---- Input -----------------------------------------------------------------------------------------

void sizes(Context &context) {
    int i = 0;
    for (const Size &size : {Size{1, 1}, Size{1, 40}, Size{67, 1}, Size{17, 13}, Size{22, 3}, Size{1280, 720}}) {
        SinkRun run(context, fmt::format("{}", i++));
        const arhost_status status = run.try_start(0, size);
        if (status == ARHOST_STATUS_ERROR_UNSUPPORTED || status == ARHOST_STATUS_ERROR_CONFIGURATION) {
            if (run.instance().host().last_error().empty())
                throw Failure(fmt::format("it rejects {}×{} without an error message", size.width, size.height));
            continue;
        }
        run.instance().expect_ok(fmt::format("start with {}×{}", size.width, size.height).c_str(), status);
        run.write(0, 2);
        run.stop();
    }
}

void stride(Context &context) {
    const auto run = [&](const char *folder, std::uint32_t padding, std::uint8_t in_padding) {
        constexpr Size size{50, 20}; // the host's stride has padding at this width, too
        SinkRun sink(context, folder);
        sink.start(0, size);
        for (std::uint64_t n = 0; n < 3; ++n)
            sink.write(SealedOutput({n, size, padding, in_padding}));
        sink.stop();
        return sink.files();
    };
    const Files expected = run("a", 0, 0);
    expect_same(run("b", 0, 0xa5), expected, "with different padding bytes");
    expect_same(run("c", 128, 0x5a), expected, "with 128 more bytes of padding per row");
}

void records(Context &context) {
    SinkRun run(context, "out");
    run.start();
    std::uint64_t n = 0;
    const auto write = [&](const char *description, auto change) {
        SealedOutput frame({n++});
        change(frame);
        run.instance().expect_ok(fmt::format("write of a frame {}", description).c_str(), run.try_write(frame));
    };
    const arhost_target cup = detected_target("cup", -500.5, 0, 1);
    arhost_target lost = detected_target("lid", -1e9, 0, 0);
    lost.state = ARHOST_TARGET_LOST;
    lost.age_frames = 17;
    write("with a camera and a target", [](SealedOutput &) {});
    write("without targets and camera", [](SealedOutput &frame) {
        frame.set_tracked({}, {});
        frame.change([](arhost_record &r) {
            r.has_camera = 0;
            r.camera = {};
            r.overlay = ARHOST_OVERLAY_NONE;
        });
    });
    write("with 1,024 targets and observations", [](SealedOutput &frame) {
        std::vector<arhost_target> targets;
        std::vector<arhost_observation> observations;
        for (std::uint32_t i = 0; i < ARHOST_MAX_TARGETS; ++i) {
            targets.push_back(detected_target(fmt::format("tag36h11-{}", i), -500.5, i, 1));
            observations.push_back(observation(static_cast<int>(i)));
        }
        static_assert(+ARHOST_MAX_TARGETS == +ARHOST_MAX_OBSERVATIONS);
        frame.set_tracked(targets, observations);
    });
    write("with a target of 1,024 observations", [](SealedOutput &frame) {
        frame.set_tracked({detected_target("board", -500.5, 0, ARHOST_MAX_OBSERVATIONS)},
                          std::vector<arhost_observation>(ARHOST_MAX_OBSERVATIONS, observation(7)));
    });
    write("with a name of 63 characters", [](SealedOutput &frame) {
        frame.set_tracked({detected_target(std::string(ARHOST_MAX_NAME - 1, 'x'), -500.5, 0, 1)}, {observation(3)});
    });
    write("with 16 families", [](SealedOutput &frame) {
        frame.change([](arhost_record &r) {
            for (auto &family : r.families)
                std::strcpy(family, "tagStandard52h13");
        });
        arhost_observation last = observation(3);
        last.family = ARHOST_MAX_FAMILIES - 1;
        frame.set_tracked({detected_target("cup", -500.5, 0, 1)}, {last});
    });
    write("with markers that no target lists", [](SealedOutput &frame) {
        frame.set_tracked({}, {observation(3), observation(4)});
    });
    write("with a lost target and a held overlay", [&](SealedOutput &frame) {
        frame.set_tracked({lost}, {});
        frame.change([](arhost_record &r) { r.overlay = ARHOST_OVERLAY_HELD; });
    });
    write("with the true pose", [&](SealedOutput &frame) {
        frame.change([&](arhost_record &r) {
            r.has_truth = 1;
            std::strcpy(r.truth_target, cup.name);
            std::copy_n(cup.mt, 16, r.true_mt);
        });
    });
    write("with detected, predicted and lost targets", [&](SealedOutput &frame) {
        arhost_target predicted = detected_target("lamp", -300, 0, 0);
        predicted.state = ARHOST_TARGET_PREDICTED;
        predicted.age_frames = std::numeric_limits<std::uint32_t>::max();
        frame.set_tracked({predicted, lost, detected_target("cup", -500.5, 0, 2)}, {observation(3), observation(4)});
    });
    write("with a body, which has no observations, covariance, error and ambiguity", [](SealedOutput &frame) {
        arhost_target body = detected_target("head", -500.5, 0, 0);
        std::fill_n(body.covariance, 36, 0.0);
        body.reprojection_px = body.ambiguity = 0;
        std::fill_n(body.mt_alternative, 16, 0.0);
        frame.set_tracked({body}, {});
    });
    write("with the largest finite numbers", [&](SealedOutput &frame) {
        constexpr double max = std::numeric_limits<double>::max();
        arhost_target huge = cup;
        huge.reprojection_px = huge.ambiguity = huge.covariance[1] = max;
        arhost_observation far = observation(std::numeric_limits<std::int32_t>::max());
        far.corners_px[0][0] = -max;
        far.decision_margin = max;
        far.hamming = std::numeric_limits<std::uint32_t>::max();
        frame.set_tracked({huge}, {far});
    });
    run.stop();
}

void longer_structs(Context &context) {
    const auto run = [&](const char *folder, std::size_t extra) {
        SinkRun sink(context, folder);
        sink.start();
        for (std::uint64_t n = 0; n < 3; ++n) {
            SealedOutput frame({n});
            frame.set_tracked({detected_target("cup", -500.5, 0, 1), detected_target("lid", -300, 1, 2)},
                              {observation(3), observation(4), observation(7)}, extra);
            sink.write(frame);
        }
        sink.stop();
        return sink.files();
    };
    const Files expected = run("a", 0);
    expect_same(run("b", 16), expected, "with a longer struct_size of targets and observations");
}

void gaps(Context &context) {
    SinkRun run(context, "out");
    run.start();
    for (const std::uint64_t sequence : {3u, 4u, 9u, 10u, 40u})
        run.write(sequence, sequence + 1);
    run.stop();
}

// ---- Files -----------------------------------------------------------------------------------------

void files(Context &context) {
    const Files once = history_of(context, 4).end;
    if (once.empty())
        throw Failure("4 frames were written, but there is no file");
    SinkRun run(context, "again");
    const Files again = run.run(4);
    try {
        expect_same(again, once, "in a second run with the same frames");
    } catch (const Failure &difference) { // for example a date
        throw Skip(std::string("its files are not reproducible: ") + difference.what());
    }
}

void require_every_frame(Context &context) {
    if (context.library.descriptor().capabilities & ARHOST_SINK_CAPABILITY_REALTIME)
        throw Skip("ARHOST_SINK_CAPABILITY_REALTIME is declared");
}

void every_frame(Context &context) {
    require_every_frame(context);
    constexpr std::uint64_t frames = 12;
    const History history = history_of(context, frames);
    for (std::size_t n = 0; n < frames; ++n)
        if (history.after[n] == history.after[n + 1])
            throw Failure(fmt::format(
                "write of frame {} returned OK, but no file has changed; the frame must be in a file by then", n));
}

using Number = std::pair<std::size_t, std::string>; // number of digits first, so that "10" sorts after "9"

// The numbers in a file's name, by the path with '#' in place of the number.
std::map<std::string, Number> numbers_in(const std::string &path) {
    constexpr const char *digits = "0123456789";
    std::map<std::string, Number> numbers;
    for (std::size_t at = path.find_first_of(digits, path.rfind('/') + 1), end; at != std::string::npos;
         at = path.find_first_of(digits, end)) {
        end = std::min(path.find_first_not_of(digits, at), path.size());
        numbers[path.substr(0, at) + '#' + path.substr(end)] = {end - at, path.substr(at, end - at)};
    }
    return numbers;
}

// Brightness of each pixel.
using Grey = std::vector<double>;

Grey grey_of(const arhost_output &output) {
    Grey grey;
    for (std::uint32_t y = 0; y < output.height; ++y)
        for (std::uint32_t x = 0; x < output.width; ++x) {
            const std::uint8_t *bgr = output.bgr + std::size_t{output.stride} * y + std::size_t{3} * x;
            grey.push_back(0.114 * bgr[0] + 0.587 * bgr[1] + 0.299 * bgr[2]);
        }
    return grey;
}

Grey grey_of(const arhost_frame_format &format, const Frame &frame) {
    const bool is_colour =
        format.pixel_format == ARHOST_PIXEL_FORMAT_BGR8 || format.pixel_format == ARHOST_PIXEL_FORMAT_RGB8;
    const std::size_t step = is_colour ? 3 : format.pixel_format == ARHOST_PIXEL_FORMAT_YUYV ? 2 : 1;
    Grey grey;
    for (std::size_t i = 0; i < std::size_t{format.width} * format.height; ++i) // the first plane has the brightness
        grey.push_back(frame.pixels[i * step + (is_colour ? 1 : 0)]);
    return grey;
}

// Pearson's correlation coefficient, which does not depend on the range of the brightness; 0 for a uniform picture.
double correlation(const Grey &a, const Grey &b) {
    const auto n = static_cast<double>(a.size());
    double sum_a = 0, sum_b = 0, aa = 0, bb = 0, ab = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        sum_a += a[i];
        sum_b += b[i];
        aa += a[i] * a[i];
        bb += b[i] * b[i];
        ab += a[i] * b[i];
    }
    const double variances = (n * aa - sum_a * sum_a) * (n * bb - sum_b * sum_b);
    return variances > 0 ? (n * ab - sum_a * sum_b) / std::sqrt(variances) : 0;
}

// Decodes a video of the frames 0 to `frames` − 1 with source_file, which is next to the reference. Throws Failure if
// the video's pictures are not these frames in order. Returns false if the file is not a video.
bool check_video(Context &context, const std::filesystem::path &video, std::uint64_t frames) {
    const std::filesystem::path decoder = context.reference.parent_path() / "source_file.so";
    if (!std::filesystem::is_regular_file(decoder))
        return false;
    PluginLibrary library(decoder, {{"path", video}}, context.library.calls());
    Context of_decoder{library, context.reference, context.random};
    SourceRun source(of_decoder);
    const arhost_status status = source.try_start();
    if (status != ARHOST_STATUS_OK)
        return false;
    source.accept(status);
    const std::vector<Frame> pictures = source.read_up_to(frames + 1);
    const std::string name = video.filename();
    if (pictures.size() != frames)
        throw Failure(fmt::format("'{}' has {} pictures, but {} frames were written", name, pictures.size(), frames));
    std::vector<Grey> written;
    for (std::uint64_t n = 0; n < frames; ++n)
        written.push_back(grey_of(SealedOutput({n}).output()));
    for (std::uint64_t n = 0; n < frames; ++n) {
        const Grey shown = grey_of(source.format(), pictures[n]);
        if (shown.size() != written[n].size())
            throw Failure(fmt::format("the pictures in '{}' have {} x {} px", name, source.format().width,
                                      source.format().height));
        constexpr double similar = 0.5; // different frames are noise, whose correlation is near 0
        if (const double same = correlation(shown, written[n]); same < similar)
            throw Failure(fmt::format("picture {} in '{}' does not show frame {}: their correlation is {:.2f}", n,
                                      name, n, same));
    }
    return true;
}

// Replaces one frame at a time and finds where the files change. This works for files of constant size, and for one
// file per frame with numbered file names. Videos are decoded.
void order(Context &context) {
    require_every_frame(context);
    constexpr std::uint64_t frames = 6;
    const auto files_with_other = [&](std::uint64_t other) {
        SinkRun run(context, fmt::format("{}", other));
        run.start();
        for (std::uint64_t n = 0; n < frames; ++n)
            run.write(SealedOutput({.sequence = n, .size = {}, .padding = 0, .in_padding = 0, .other = n == other}));
        run.stop();
        return run.files();
    };
    struct Change {
        std::uint64_t frame;
        std::size_t byte;
    };
    const Files unchanged = files_with_other(frames); // replaces no frame
    std::map<std::string, std::vector<Change>> changes;
    std::set<std::string> resized;
    for (std::uint64_t frame = 0; frame < frames; ++frame)
        for (const auto &[name, bytes] : files_with_other(frame)) {
            const auto found = unchanged.find(name);
            if (found == unchanged.end() || found->second == bytes)
                continue;
            if (found->second.size() != bytes.size())
                resized.insert(name);
            const auto at = std::mismatch(bytes.begin(), bytes.end(), found->second.begin(), found->second.end());
            changes[name].push_back({frame, static_cast<std::size_t>(at.first - bytes.begin())});
        }
    bool reported = false;
    struct File {
        std::uint64_t frame;
        std::string name;
    };
    std::map<std::string, std::map<Number, File>> families; // files that hold one frame
    for (const auto &[name, of_file] : changes) {
        if (of_file.size() == 1)
            for (const auto &[family, number] : numbers_in(name))
                families[family][number] = {of_file[0].frame, name};
        for (std::size_t i = 1; i < of_file.size() && !resized.contains(name); ++i) {
            reported = reported || of_file[i].byte > of_file[i - 1].byte; // equal: may be a checksum in the header
            if (of_file[i].byte < of_file[i - 1].byte)
                throw Failure(
                    fmt::format("in '{}', frame {} begins at byte {}, before frame {}, which begins at byte {}", name,
                                of_file[i].frame, of_file[i].byte, of_file[i - 1].frame, of_file[i - 1].byte));
        }
    }
    for (const auto &[family, files] : families) {
        std::set<std::uint64_t> in_files;
        for (const auto &[number, file] : files)
            in_files.insert(file.frame);
        if (in_files.size() != frames) // it is not a frame number
            continue;
        reported = true;
        const File *before = nullptr;
        for (const auto &[number, file] : files) {
            if (before && file.frame == before->frame)
                throw Failure(fmt::format("frame {} is in both '{}' and '{}'", file.frame, before->name, file.name));
            if (before && file.frame < before->frame)
                throw Failure(fmt::format("frame {} is in '{}', but the earlier frame {} is in '{}'", before->frame,
                                          before->name, file.frame, file.name));
            before = &file;
        }
    }
    for (const auto &[name, of_file] : changes)
        if (!reported && of_file.size() > 1) // the file contains several frames
            reported = check_video(context, context.library.scratch() / std::to_string(frames) / name, frames);
    if (!reported)
        throw Skip("the position of a frame in its files is unknown, and they are not videos");
}

void last_frame(Context &context) {
    const Files one = history_of(context, 3).end;
    SinkRun run(context, "other");
    run.start();
    run.write(0, 2);
    run.write(SealedOutput({.sequence = 2, .size = {}, .padding = 0, .in_padding = 0, .other = true}));
    run.stop();
    if (run.files() == one)
        throw Failure("its files do not depend on the last frame and its camera");
}

void earlier_files(Context &context) {
    const Files expected = history_of(context, 3).end;
    SinkRun run(context, "uninterrupted"); // the folder of the run above
    run.start();
    expect_same(run.files(), expected, "after a restart without a frame");
    run.stop();
    expect_same(run.files(), expected, "after a restart and a stop without a frame");
}

void unwritable_output(Context &context) {
    SinkRun run(context, "file");
    const std::filesystem::path folder = context.library.scratch() / "file";
    std::filesystem::remove(folder);
    std::ofstream(folder) << "not a folder";
    const arhost_status status = run.try_start();
    if (status == ARHOST_STATUS_OK)
        throw Failure("its output folder is a file, but start returned OK");
    if (run.instance().host().last_error().empty())
        throw Failure(fmt::format("start returned {} without an error message when its output folder was a file",
                                  status_name(status)));
}

// ---- Kills -----------------------------------------------------------------------------------------

// The minimum of several writes, which is the least affected by other load.
std::chrono::steady_clock::duration write_duration(Context &context, const Size &size) {
    auto shortest = std::chrono::steady_clock::duration::max();
    SinkRun run(context, "timed");
    run.start(0, size);
    for (std::uint64_t n = 0; n < 4; ++n) {
        const SealedOutput frame({n, size});
        const auto begin = std::chrono::steady_clock::now();
        run.write(frame);
        shortest = std::min(shortest, std::chrono::steady_clock::now() - begin);
    }
    run.stop();
    return shortest;
}

void killed(Context &context) {
    constexpr std::uint64_t frames = 4, done = 2;
    constexpr Size size{160, 120};
    const History history = history_of(context, frames, size);
    const std::chrono::duration<double> frame_duration = write_duration(context, size);
    int i = 0;
    for (const double fraction : {0.1, 0.3, 0.5, 0.7, 0.9}) {
        const std::string folder = fmt::format("killed-{}", i++);
        SinkProcess process(context, {folder, frames, size});
        process.wait_until_written(done);
        std::this_thread::sleep_for(fraction * frame_duration);
        process.kill();
        for (const auto &[name, bytes] : files_in(context.library.scratch() / folder))
            if (history.end.contains(name) && !history.has_been(name, bytes) && !history.is_cut_at_page(name, bytes))
                throw Failure(fmt::format(
                    "killed while writing frame {}, it leaves '{}' with {} bytes, which matches no completed frame",
                    done, name, bytes.size()));
    }
}

void restart(Context &context) {
    constexpr std::uint64_t frames = 8, first = 4;
    const Files expected = history_of(context, frames).end;
    {
        SinkProcess process(context, {"killed", frames, {}});
        process.wait_until_written(frames);
        process.kill();
    }
    SinkRun run(context, "killed");
    run.start(first);
    run.write(first, frames);
    run.stop();
    const Files actual = run.files();
    for (const auto &[name, bytes] : expected) {
        const auto found = actual.find(name);
        if (found == actual.end())
            throw Failure(fmt::format("killed and restarted at frame {}: '{}' is missing", first, name));
        // A re-encoded file has different bytes but a similar size.
        const double ratio = static_cast<double>(found->second.size()) / static_cast<double>(bytes.size());
        if (constexpr double min_ratio = 0.8; ratio < min_ratio || ratio > 1 / min_ratio)
            throw Failure(fmt::format(
                "killed after {} frames and restarted at frame {}: '{}' has {} bytes, but {} if uninterrupted",
                frames, first, name, found->second.size(), bytes.size()));
    }
    for (const auto &[name, bytes] : actual)
        if (!expected.contains(name))
            throw Failure(fmt::format("killed and restarted at frame {}: '{}' is left over", first, name));
}

// ---- A full disk -----------------------------------------------------------------------------------

// Simulates a full disk: no file of this process can grow beyond `bytes`. The errno differs (EFBIG).
class FullDisk {
public:
    explicit FullDisk(std::uint64_t bytes) {
        std::signal(SIGXFSZ, SIG_IGN); // a full disk sends no signal
        ::getrlimit(RLIMIT_FSIZE, &before_);
        const rlimit small{bytes, before_.rlim_max};
        ::setrlimit(RLIMIT_FSIZE, &small);
    }
    ~FullDisk() { ::setrlimit(RLIMIT_FSIZE, &before_); }
    FullDisk(const FullDisk &) = delete;
    FullDisk &operator=(const FullDisk &) = delete;

private:
    rlimit before_{};
};

void full_disk(Context &context) {
    constexpr std::uint64_t frames = 6;
    const History history = history_of(context, frames);
    std::uint64_t largest = 0;
    for (const Files &files : history.after)
        for (const auto &[name, bytes] : files)
            largest = std::max<std::uint64_t>(largest, bytes.size());
    SinkRun run(context, "full");
    arhost_status status = ARHOST_STATUS_OK;
    {
        const FullDisk disk(largest / 2);
        status = run.try_start();
        for (std::uint64_t n = 0; n < frames && status == ARHOST_STATUS_OK; ++n)
            status = run.try_write(SealedOutput({n}));
        const arhost_status stopped = run.try_stop();
        status = status == ARHOST_STATUS_OK ? stopped : status;
    }
    if (status == ARHOST_STATUS_OK)
        throw Failure(fmt::format("its largest file has {} bytes; with a limit of {} bytes, every call returned OK",
                                  largest, largest / 2));
    if (run.instance().host().last_error().empty())
        throw Failure(fmt::format("on a full disk it returned {} without an error message", status_name(status)));
    for (const auto &[name, bytes] : run.files())
        if (const auto complete = history.end.find(name);
            complete != history.end.end() && complete->second.starts_with(bytes) && !history.has_been(name, bytes))
            throw Failure(fmt::format("on a full disk, it leaves '{}' with {} of {} bytes", name, bytes.size(),
                                      complete->second.size()));
}

// ---- A slow disk -----------------------------------------------------------------------------------

void slow_disk(Context &context) {
    SlowDisk::run([&](SlowDisk &disk) {
        require_files(context);
        require_every_frame(context);
        constexpr std::uint64_t frames = 3;
        SinkRun run(context, "slow");
        run.start();
        Files before = run.files();
        bool has_delayed = false;
        for (std::uint64_t n = 0; n < frames; ++n) {
            disk.delay_next_write();
            run.write(n, n + 1);
            Files after = run.files();
            has_delayed = has_delayed || disk.has_delayed(); // a dropped frame has no write to delay
            if (!has_delayed)
                throw Skip("its writes cannot be delayed: it uses memory maps, io_uring or another process");
            if (after == before)
                throw Failure(
                    fmt::format("on a slow disk, write of frame {} returned OK, but no file has changed", n));
            before = std::move(after);
        }
        run.stop();
    });
}

// ---- Speed -----------------------------------------------------------------------------------------

void speed(Context &context) {
    constexpr Size size{640, 480};
    SinkRun run(context, "out");
    run.start(0, size);
    std::deque<SealedOutput> frames; // prepared, because generating noise is slow
    for (std::uint64_t n = 0; n < 8; ++n)
        frames.emplace_back(SealedOutput::Content{.sequence = n, .size = size});
    std::uint64_t next = 0;
    const std::vector<double> ms = frame_times_ms([&] {
        SealedOutput &frame = frames[next % frames.size()];
        frame.change([&](arhost_record &record) { record.sequence = next; });
        ++next;
        return run.write(frame), true;
    });
    check_speed(context, size.width, size.height, ms, 100);
}

template <void (*test)(Context &)> void of_files(Context &context) {
    require_files(context);
    test(context);
}

constexpr const char *gate = "sink.write", *same = "sink.files";
constexpr Test tests[] = {
    {"sink.start", "It starts and stops.", "abi.create", 30s, start},
    {"sink.write", "It accepts frames in read-only memory and does not read beyond them.", "sink.start", 30s, write},
    {"sink.sizes",
     "It accepts frames of any size, also one pixel, one row or one column, or rejects them with an error message.",
     gate, 60s, sizes},
    {"sink.records",
     "It accepts records with any number of targets and observations, without a camera, and with huge numbers.", gate,
     30s, records},
    {"sink.gaps", "It accepts gaps in the frames' sequence numbers.", gate, 30s, gaps},
    {"sink.idle", "idle succeeds between frames.", gate, 30s, idle},
    {"sink.cancelled", "After cancellation, start, write and stop promptly return OK or CANCELLED.", gate, 30s,
     cancelled},
    {"sink.leaks", "Frames, starts and stops leak no descriptors, threads or memory.", gate, 60s, leaks},
    {"sink.files", "It writes files. If the same frames give different files, tests that compare runs are skipped.",
     gate, 30s, of_files<files>},
    {"sink.start-again", "After a stop, another instance starts and writes the same files for the same frames.", same,
     30s, of_files<start_again>},
    {"sink.two-instances", "Two simultaneous instances do not mix their files.", same, 30s, of_files<two_instances>},
    {"sink.stride", "Its files do not depend on the padding between rows.", same, 30s, of_files<stride>},
    {"sink.longer-structs", "It uses struct_size as the stride of the arrays of targets and observations.", same, 30s,
     of_files<longer_structs>},
    {"sink.every-frame", "When write returns OK, the frame is in a file.", gate, 30s, of_files<every_frame>},
    {"sink.order", "Each frame is stored once and in order: within a file, or in files by the number in their names.",
     same, 30s, of_files<order>},
    {"sink.last-frame", "Its files contain the last frame.", same, 30s, of_files<last_frame>},
    {"sink.earlier-files", "It does not change the files of an earlier run before its first frame.", gate, 30s,
     of_files<earlier_files>},
    {"sink.unwritable-output", "start fails with an error message if its output cannot be written.", gate, 30s,
     of_files<unwritable_output>},
    {"sink.killed", "A kill leaves no incomplete file under a final file name.", same, 60s, of_files<killed>, true},
    {"sink.restart", "A restart after a kill keeps the frames before first_sequence and replaces the rest.", gate,
     60s, of_files<restart>, true},
    {"sink.full-disk", "On a full disk it reports an error and leaves no incomplete file.", same, 60s,
     of_files<full_disk>},
    {"sink.slow-disk", "Also on a slow disk, the frame is in a file when write returns OK.", "sink.every-frame", 60s,
     slow_disk},
    {"sink.speed", "The median time of write at 640×480 is at most 100 ms; otherwise a warning.", gate, 120s, speed},
};

} // namespace

std::span<const Test> sink_tests() {
    return tests;
}

} // namespace arhost::conformance
