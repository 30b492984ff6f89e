// SPDX-License-Identifier: Apache-2.0
// Sources: frame memory, capture times, the end, and determinism.
#include "conformance/cancelling.hpp"
#include "conformance/frame_times.hpp"
#include "conformance/process_usage.hpp"
#include "conformance/rigid.hpp"
#include "conformance/source_run.hpp"
#include "pixels/grey.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <ctime>
#include <iterator>
#include <thread>

namespace arhost::conformance {
namespace {

constexpr const char *live_skip = "it is live: its frames are not reproducible";

// Same pixels and capture time.
void expect_same(const SourceRun &run, const Frame &actual, const Frame &expected, const std::string &where) {
    if (actual.pixels.size() != expected.pixels.size())
        throw Failure(fmt::format("{}: its pixels take {} bytes instead of {}", where, actual.pixels.size(),
                                  expected.pixels.size()));
    const auto at = std::mismatch(actual.pixels.begin(), actual.pixels.end(), expected.pixels.begin());
    if (at.first != actual.pixels.end())
        throw Failure(fmt::format("{}: {} is {} instead of {}", where,
                                  place_of(run.format(), static_cast<std::size_t>(at.first - actual.pixels.begin())),
                                  *at.first, *at.second));
    if (actual.info.capture_ns != expected.info.capture_ns)
        throw Failure(fmt::format("{}: its capture time is {} ns instead of {} ns", where, actual.info.capture_ns,
                                  expected.info.capture_ns));
}

void expect_same(const SourceRun &run, const std::vector<Frame> &actual, const std::vector<Frame> &expected,
                 const std::string &where) {
    if (actual.size() != expected.size())
        throw Failure(fmt::format("{}: there are {} frames instead of {}", where, actual.size(), expected.size()));
    for (std::size_t i = 0; i < actual.size(); ++i)
        expect_same(run, actual[i], expected[i], fmt::format("{}: frame {}", where, i));
}

std::int64_t now_ns() {
    timespec now{};
    ::clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * std::int64_t{1'000'000'000} + now.tv_nsec;
}

bool is_rejection(arhost_status status) {
    return status == ARHOST_STATUS_ERROR_UNSUPPORTED || status == ARHOST_STATUS_ERROR_CONFIGURATION;
}

// Starts at `fps`, or at the source's default rate if it rejects that.
void start_at(SourceRun &run, double fps, bool paced, std::uint64_t first = 0) {
    const arhost_status status = run.try_start({first, fps, paced});
    run.accept(is_rejection(status) ? run.try_start({first, 0, paced}) : status);
}

// ---- From start to stop ----------------------------------------------------------------------------

void start(Context &context) {
    SourceRun run(context);
    const arhost_status status = run.try_start();
    if (const char *const *needs = context.library.descriptor().needs; needs && *needs && status < 0)
        throw Skip(fmt::format("it needs '{}', and {}", *needs, call_result("start", status, run.instance().host())));
    run.accept(status);
}

void read(Context &context) {
    SourceRun run(context);
    run.start();
    const std::optional<Frame> frame = run.read();
    if (!frame)
        throw Failure("it ends before its first frame");
    if (frame->info.clock != ARHOST_CLOCK_MONOTONIC && frame->info.clock != ARHOST_CLOCK_MEDIA)
        throw Failure(fmt::format("its clock {} is invalid", frame->info.clock));
}

void start_again(Context &context) {
    constexpr std::size_t count = 3;
    SourceRun run(context);
    run.start();
    const std::vector<Frame> first = run.read_up_to(count);
    run.start();
    const std::vector<Frame> second = run.read_up_to(count);
    if (second.empty())
        throw Failure("after a restart, it ends before its first frame");
    if (!run.is_live())
        expect_same(run, second, first, "after a restart");
}

void leaks(Context &context) {
    SourceRun run(context);
    expect_no_leak([&](int frames) {
        run.start();
        for (int frame = 0; frame < frames && run.try_read() == ARHOST_STATUS_OK; ++frame) {
        }
        run.stop();
    });
}

// ---- Memory ----------------------------------------------------------------------------------------

void writes_every_pixel(Context &context) {
    // A byte keeps its value by chance with probability 1/256 per attempt.
    constexpr int attempts = 6;
    SourceRun run(context);
    run.start();
    std::vector<bool> kept, kept_grey;
    bool has_grey = true;
    for (int i = 0; i < attempts; ++i) {
        Slot &slot = run.slot();
        std::generate_n(slot.data(), slot.size(), [&] { return static_cast<std::uint8_t>(context.random() >> 24); });
        const std::vector<std::uint8_t> before = run.frame().pixels, all(slot.data(), slot.data() + slot.size());
        std::optional<Frame> frame = run.read(true);
        if (!frame && i > 0) { // a short source: restart
            run.start();
            --i;
            continue;
        }
        if (!frame)
            throw Failure("it ends before its first frame");
        kept.resize(before.size(), true);
        for (std::size_t k = 0; k < before.size(); ++k)
            kept[k] = kept[k] && frame->pixels[k] == before[k];
        has_grey = has_grey && frame->info.has_grey;
        kept_grey.resize(std::size_t{run.format().width} * run.format().height, true);
        for (std::size_t k = 0; k < kept_grey.size(); ++k) {
            const std::size_t at =
                run.format().grey_offset + k / run.format().width * run.format().grey_stride + k % run.format().width;
            kept_grey[k] = kept_grey[k] && run.slot().data()[at] == all[at];
        }
    }
    if (const auto at = std::find(kept.begin(), kept.end(), true); at != kept.end())
        throw Failure(fmt::format("in each of {} frames, {} of {} bytes keep their previous value, the first is {}",
                                  attempts, std::count(kept.begin(), kept.end(), true), kept.size(),
                                  place_of(run.format(), static_cast<std::size_t>(at - kept.begin()))));
    if (has_grey && std::find(kept_grey.begin(), kept_grey.end(), true) != kept_grey.end())
        throw Failure(
            fmt::format("it reports has_grey, but {} of the grey plane's {} bytes keep their previous value",
                        std::count(kept_grey.begin(), kept_grey.end(), true), kept_grey.size()));
}

void writes_nothing_else(Context &context) {
    SourceRun run(context);
    run.start();
    run.read_up_to(4);
    if (const std::string damage = run.slot().damage(); !damage.empty())
        throw Failure("it overwrote " + damage);
}

void grey(Context &context) {
    SourceRun run(context);
    run.start();
    const std::optional<Frame> frame = run.read();
    const arhost_frame_format &format = run.format();
    if (!frame || !frame->info.has_grey || format.grey_offset == 0)
        throw Skip("it does not write the grey plane");
    const std::uint8_t *planes[ARHOST_MAX_PLANES] = {};
    for (std::uint32_t i = 0; i < format.plane_count; ++i)
        planes[i] = run.slot().data() + format.offset[i];
    std::vector<std::uint8_t> expected(std::size_t{format.grey_stride} * format.height);
    fill_grey_reference(format, planes, expected.data());
    constexpr int tolerance = 3; // for rounding
    for (std::uint32_t y = 0; y < format.height; ++y)
        for (std::uint32_t x = 0; x < format.width; ++x) {
            const std::size_t at = std::size_t{format.grey_stride} * y + x;
            if (const int actual = run.slot().data()[format.grey_offset + at];
                std::abs(actual - expected[at]) > tolerance)
                throw Failure(fmt::format("pixel ({}, {}): its grey is {}; expected {} by its colour", x, y, actual,
                                          expected[at]));
        }
}

// ---- Time ------------------------------------------------------------------------------------------

void times(Context &context) {
    constexpr std::size_t count = 20;
    SourceRun run(context);
    const std::int64_t begin_ns = now_ns();
    run.start();
    const std::vector<Frame> frames = run.read_up_to(count);
    const std::int64_t end_ns = now_ns();
    for (std::size_t i = 0; i < frames.size(); ++i) {
        const arhost_frame_info &info = frames[i].info;
        if (info.clock != frames[0].info.clock)
            throw Failure(fmt::format("frame {} has the clock {}; previous frames had {}", i, info.clock,
                                      frames[0].info.clock));
        if (i > 0 && info.capture_ns < frames[i - 1].info.capture_ns)
            throw Failure(fmt::format("frame {} has a capture time of {} ns, less than the previous frame's {} ns", i,
                                      info.capture_ns, frames[i - 1].info.capture_ns));
        // Buffered frames may have been exposed long ago.
        constexpr std::int64_t buffered_ns = 10'000'000'000;
        if (info.clock == ARHOST_CLOCK_MONOTONIC &&
            (info.capture_ns < begin_ns - buffered_ns || info.capture_ns > end_ns))
            throw Failure(
                fmt::format("frame {} has an implausible capture time, {:.1f} s after the source was started", i,
                            static_cast<double>(info.capture_ns - begin_ns) / 1e9));
        if (info.clock == ARHOST_CLOCK_MEDIA && info.capture_ns < 0)
            throw Failure(fmt::format("frame {} has a negative capture time of {} ns", i, info.capture_ns));
    }
    if (frames.size() < 2 || run.is_live() || run.format().fps == 0)
        return;
    double periods = 0; // including skipped frames
    for (std::size_t i = 1; i < frames.size(); ++i)
        periods += 1.0 + frames[i].info.skipped;
    const double period_ns =
        static_cast<double>(frames.back().info.capture_ns - frames.front().info.capture_ns) / periods;
    // A video's frames need not be evenly spaced.
    constexpr double factor = 4;
    if (const double nominal_ns = 1e9 / run.format().fps;
        period_ns > factor * nominal_ns || period_ns < nominal_ns / factor)
        throw Failure(fmt::format("the mean frame period is {:.3f} ms; the reported {} frames/s give {:.3f} ms",
                                  period_ns / 1e6, run.format().fps, nominal_ns / 1e6));
}

void rate(Context &context) {
    SourceRun run(context);
    if (run.is_live())
        throw Skip(live_skip);
    std::string rejected, reason;
    bool accepted = false;
    for (const double fps : {10.0, 48.0}) {
        const arhost_status status = run.try_start({0, fps});
        if (is_rejection(status)) {
            rejected += fmt::format("{}{}", rejected.empty() ? "" : " and ", fps);
            reason = call_result("start", status, run.instance().host());
            continue;
        }
        run.accept(status);
        if (run.format().fps != fps)
            throw Failure(fmt::format("{} frames/s were requested, but start reports {}", fps, run.format().fps));
        const std::vector<Frame> frames = run.read_up_to(4);
        for (std::size_t i = 1; i < frames.size(); ++i) {
            const double ms = static_cast<double>(frames[i].info.capture_ns - frames[i - 1].info.capture_ns) / 1e6;
            if (constexpr double tolerance_ms = 1; std::abs(ms - 1000 / fps) > tolerance_ms) // of file time stamps
                throw Failure(fmt::format("with {} frames/s requested, frame {} is {:.3f} ms after the previous one",
                                          fps, i, ms));
        }
        accepted = true;
    }
    if (!accepted)
        throw Skip(fmt::format("it rejects {} frames/s: {}", rejected, reason));
    if (!rejected.empty())
        context.note = fmt::format("it rejects {} frames/s", rejected);
}

void late_reader(Context &context) {
    SourceRun unpaced(context), run(context);
    if (run.is_live())
        throw Skip(live_skip);
    constexpr double fps = 50;
    start_at(run, fps, true);
    std::vector<Frame> frames = run.read_up_to(2);
    std::this_thread::sleep_for(200ms);
    constexpr std::size_t count = 3;
    std::vector<Frame> late = run.read_up_to(count);
    std::move(late.begin(), late.end(), std::back_inserter(frames));
    const std::size_t count_before_restart = frames.size();
    if (run.can_seek() && late.size() == count) { // as after a worker's crash
        start_at(run, fps, true, run.next());
        if (std::optional<Frame> frame = run.read())
            frames.push_back(std::move(*frame));
    }
    start_at(unpaced, fps, false);
    std::optional<Frame> expected = unpaced.read();
    for (std::size_t i = 0; i < frames.size(); ++i) {
        while (expected && expected->info.capture_ns < frames[i].info.capture_ns)
            expected = unpaced.read();
        if (!expected)
            throw Failure(fmt::format("in live mode, a late reader gets a frame with the capture time {} ns, which "
                                      "an unpaced run does not deliver",
                                      frames[i].info.capture_ns));
        const bool is_restarted = i >= count_before_restart;
        expect_same(run, frames[i], *expected,
                    is_restarted ? "in live mode, the first frame after a late read and a restart"
                                 : fmt::format("in live mode with a late reader, frame {}", i));
    }
}

// ---- The end ---------------------------------------------------------------------------------------

void end(Context &context) {
    constexpr std::uint64_t max_frames = 400;
    SourceRun run(context);
    run.start();
    const std::uint64_t count = run.properties().frame_count;
    const std::uint64_t first = run.can_seek() && count > 3 ? count - 3 : 0;
    if (run.is_live() || count == 0 || count - first > max_frames)
        throw Skip(run.is_live() ? live_skip
                   : count == 0  ? "it does not report a frame count"
                                 : "it has too many frames to read them all and cannot seek");
    run.start({first});
    for (std::uint64_t i = first; i < count; ++i)
        if (!run.read())
            throw Failure(fmt::format("start reports {} frames, but it ends before frame {}", count, i));
    const arhost_status status = run.try_read();
    if (status != ARHOST_STATUS_END && status != ARHOST_STATUS_END_TRUNCATED)
        throw Failure(fmt::format("start reports {} frames, but after those {}", count,
                                  call_result("read", status, run.instance().host())));
    for (int again = 0; again < 3; ++again)
        if (const arhost_status then = run.try_read(); then != status)
            throw Failure(
                fmt::format("at the end, read returned {}, and then {}", status_name(status), status_name(then)));
}

// ---- Determinism -----------------------------------------------------------------------------------

void deterministic(Context &context) {
    constexpr std::size_t count = 4;
    SourceRun run(context), other(context);
    if (run.is_live())
        throw Skip(live_skip);
    run.start();
    const std::vector<Frame> first = run.read_up_to(count);
    run.stop();
    other.start();
    expect_same(run, other.read_up_to(count), first, "in another instance");
}

void two_instances(Context &context) {
    SourceRun first(context), second(context), alone(context);
    if (first.is_live())
        throw Skip(live_skip);
    alone.start();
    const std::vector<Frame> expected = alone.read_up_to(3);
    alone.stop();
    first.start();
    second.start();
    for (std::size_t i = 0; i < expected.size(); ++i)
        for (SourceRun *run : {&first, &second}) {
            const std::optional<Frame> frame = run->read();
            if (!frame)
                throw Failure(fmt::format("of two instances read alternately, one ends before frame {}", i));
            expect_same(*run, *frame, expected[i], fmt::format("of two instances read alternately, frame {}", i));
        }
}

void seek(Context &context) {
    SourceRun run(context);
    if (!run.can_seek())
        throw Skip("ARHOST_SOURCE_CAPABILITY_SEEK is not declared");
    run.start();
    const std::vector<Frame> frames = run.read_up_to(8);
    for (const std::size_t first : {std::size_t{1}, std::size_t{5}}) {
        if (first >= frames.size())
            continue;
        run.start({first});
        for (std::size_t i = first; i < std::min(first + 3, frames.size()); ++i) {
            const std::optional<Frame> frame = run.read();
            if (!frame)
                throw Failure(fmt::format("started at frame {}, it ends before frame {}", first, i));
            expect_same(run, *frame, frames[i], fmt::format("started at frame {}, frame {}", first, i));
        }
    }
}

// ---- Cancellation ----------------------------------------------------------------------------------

void cancelled(Context &context) {
    SourceRun running(context);
    running.start();
    running.instance().host().cancel();
    const arhost_status status = running.try_read();
    expect_ok_or_cancelled("read", status == ARHOST_STATUS_END ? ARHOST_STATUS_OK : status);
    running.stop();
    SourceRun starting(context);
    starting.instance().host().cancel();
    expect_ok_or_cancelled("start", starting.try_start());
}

void cancel_while_waiting(Context &context) {
    SourceRun run(context);
    constexpr double fps = 0.01; // the second frame is due in 100 s, after this test's deadline
    start_at(run, fps, true);
    if (run.format().fps != fps)
        context.note = fmt::format("it rejects {} frames/s: cancelled at its {} frames/s", fps, run.format().fps);
    expect_to_be_cancelled(context, run.instance().host(), "read", [&] { return run.try_read(); });
}

// ---- Camera ----------------------------------------------------------------------------------------

void intrinsics(Context &context) {
    SourceRun run(context);
    run.start();
    if (!run.properties().has_intrinsics)
        throw Skip("it does not report intrinsics");
    const arhost_intrinsics &camera = run.properties().intrinsics;
    const arhost_frame_format &format = run.format();
    if (camera.width != format.width || camera.height != format.height)
        throw Failure(fmt::format("its intrinsics are for {}×{} px, but its frames have {}×{}", camera.width,
                                  camera.height, format.width, format.height));
    if (!(camera.fx > 0 && camera.fy > 0 && std::isfinite(camera.fx) && std::isfinite(camera.fy)))
        throw Failure(fmt::format("its focal lengths are {} and {} px", camera.fx, camera.fy));
    if (!(std::isfinite(camera.cx) && std::isfinite(camera.cy))) // may be outside the frame, as in a crop
        throw Failure(fmt::format("its principal point is ({}, {})", camera.cx, camera.cy));
    const std::uint32_t n = camera.coefficient_count;
    const bool fits = (camera.distortion == ARHOST_DISTORTION_NONE && n == 0) ||
                      (camera.distortion == ARHOST_DISTORTION_BROWN && (n == 4 || n == 5 || n == 8 || n == 12)) ||
                      (camera.distortion == ARHOST_DISTORTION_FISHEYE && n == 4);
    if (!fits)
        throw Failure(fmt::format("its lens has the invalid combination of model {} and {} coefficients",
                                  camera.distortion, n));
    for (std::uint32_t i = 0; i < n; ++i)
        if (!std::isfinite(camera.coefficients[i]))
            throw Failure(fmt::format("coefficient {} of its lens is not finite", i));
}

void truth(Context &context) {
    SourceRun run(context);
    run.start();
    bool has_truth = false;
    for (const Frame &frame : run.read_up_to(4)) {
        if (!frame.info.has_truth)
            continue;
        has_truth = true;
        const char(&name)[ARHOST_MAX_NAME] = frame.info.truth_target;
        if (const void *end = std::memchr(name, 0, sizeof name); !end || end == name)
            throw Failure(end ? "truth_target is empty" : "truth_target has no NUL within its 64 bytes");
        const double *m = frame.info.true_mt;
        if (const std::string problem = not_rigid(m, 1e-9); !problem.empty())
            throw Failure("its true pose " + problem);
        if (!(m[14] < 0))
            throw Failure(fmt::format("its true pose has z = {} mm; z is negative in front of the camera", m[14]));
    }
    if (!has_truth)
        throw Skip("it does not report true poses");
}

void speed(Context &context) {
    SourceRun run(context);
    run.start();
    const std::uint64_t count = run.properties().frame_count; // does not measure the END call
    std::uint64_t next = 0;
    const std::vector<double> ms =
        frame_times_ms([&] { return (count == 0 || next++ < count) && run.try_read() == ARHOST_STATUS_OK; });
    if (ms.empty())
        throw Skip("it delivers no frame");
    check_speed(context, run.format().width, run.format().height, ms, 100);
}

constexpr const char *gate = "source.read";
constexpr Test tests[] = {
    {"source.start", "It starts with a valid pixel format and layout, and stops.", "abi.create", 30s, start},
    {"source.read", "It delivers a frame with a valid clock.", "source.start", 30s, read},
    {"source.deterministic",
     "Another instance delivers the same frames with the same capture times; not checked for live sources.", gate,
     30s, deterministic},
    {"source.start-again", "After a stop, another instance starts and delivers the same frames.", gate, 30s,
     start_again},
    {"source.two-instances",
     "Two instances read alternately deliver the frames of a single one; not checked for live sources.",
     "source.deterministic", 30s, two_instances},
    {"source.leaks", "Frames, starts and stops leak no descriptors, threads or memory.", gate, 120s, leaks},
    {"source.writes-every-pixel", "Every pixel of a frame is written.", gate, 30s, writes_every_pixel},
    {"source.writes-nothing-else", "No byte before or after the slot is written.", gate, 30s, writes_nothing_else},
    {"source.grey", "The grey plane, if written, equals the frame's luma.", gate, 30s, grey},
    {"source.times", "Capture times never decrease, and roughly match the reported rate.", gate, 30s, times},
    {"source.rate", "A source that is not live delivers the requested frame rate, or rejects it.", gate, 30s, rate},
    {"source.late-reader",
     "In live mode, a late reader gets frames with correct capture times, also after a restart.",
     "source.deterministic", 30s, late_reader},
    {"source.end", "It delivers the reported number of frames, and read keeps returning END after them.", gate, 60s,
     end},
    {"source.seek", "Started at any frame, it delivers the frames of an uninterrupted run.", gate, 30s, seek},
    {"source.cancelled", "After cancellation, start and read promptly return OK or CANCELLED.", gate, 20s, cancelled},
    {"source.cancel-while-waiting", "When cancelled while waiting for a frame, read returns within 2 s.", gate, 20s,
     cancel_while_waiting},
    {"source.intrinsics", "Reported intrinsics are valid and match the frame size.", gate, 20s, intrinsics},
    {"source.truth", "A reported true pose names its target, is rigid and in front of the camera.", gate, 20s, truth},
    {"source.speed", "The median time of read is at most 100 ms; otherwise a warning.", gate, 60s, speed},
};

} // namespace

std::span<const Test> source_tests() {
    return tests;
}

} // namespace arhost::conformance
