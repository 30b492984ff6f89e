// SPDX-License-Identifier: Apache-2.0
// Life cycle of a tracker: restarts, rejected input, ranges of numbers, and independence of earlier frames.
#include "conformance/cancelling.hpp"
#include "conformance/frame_times.hpp"
#include "conformance/process_usage.hpp"
#include "conformance/tracker.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace arhost::conformance {
namespace {

constexpr double side_mm = 80;

Placed first_print(Context &context, const Pose &at = tilted({10, -5, -260}, 25, 40, 15)) {
    return {prints_of(context).front(), side_mm, at};
}

// A tracker started with the first print.
struct Started {
    explicit Started(Context &context, Settings overrides = {})
        : camera(wide_camera(context)), marker(first_print(context)), tracker(context, std::move(overrides)) {
        tracker.start(camera, {{marker.print.id, side_mm}});
    }
    Grey at(const Pose &where) const { return draw(camera, Placed{marker.print, side_mm, where}); }
    Grey without_print() const { return empty_image(camera); }

    arhost_intrinsics camera;
    Placed marker;
    Tracker tracker;
};

void start(Context &context) {
    Started started(context);
    context.note = "with a marker of " + context.family;
}

void track(Context &context) {
    Started started(context);
    const Grey image = started.at(pose({0, 0, -250}));
    expect_one(started.tracker.track(image), started.marker.print.id, "facing the camera", image);
}

// ---- Rejected input --------------------------------------------------------------------------------

void expect_rejected(const std::string &what, arhost_status status) {
    if (status != ARHOST_STATUS_ERROR_CONFIGURATION)
        throw Failure(fmt::format("with {}, start returned {}; expected CONFIGURATION", what, status_name(status)));
}

void unknown_id(Context &context) {
    Tracker tracker(context);
    for (const int id : {-1, std::numeric_limits<int>::max()})
        expect_rejected(fmt::format("marker {}, which is not in its family", id),
                        tracker.try_start(wide_camera(context), {{id, side_mm}}));
}

void unknown_family(Context &context) {
    const int id = prints_of(context).front().id;
    Tracker tracker(context);
    for (const std::vector<std::string> &families :
         {std::vector<std::string>{"tag99h99"}, {""}, {context.family, "tag99h99"}}) {
        TrackerSetup setup(context, wide_camera(context), families);
        for (std::uint32_t i = 0; i < families.size(); ++i)
            setup.add({id, side_mm, i});
        expect_rejected(fmt::format("the unknown family '{}'", families.back()), tracker.start_with(setup));
    }
}

void unusable_lens(Context &context) {
    const Print print = prints_of(context).front();
    Tracker tracker(context);
    const auto expect_unusable = [&](const char *description, const arhost_intrinsics &camera) {
        if (const arhost_status status = tracker.try_start(camera, {{print.id, side_mm}});
            status != ARHOST_STATUS_ERROR_CONFIGURATION && status != ARHOST_STATUS_ERROR_UNSUPPORTED)
            throw Failure(fmt::format("with {}, start returned {}; expected CONFIGURATION or UNSUPPORTED",
                                      description, status_name(status)));
    };
    const auto lens = [&](arhost_distortion model, std::uint32_t count) {
        arhost_intrinsics camera = wide_camera(context);
        camera.distortion = model;
        camera.coefficient_count = count;
        return camera;
    };
    expect_unusable("the unknown distortion model 99", lens(99, 4));
    expect_unusable("Brown's model with 3 coefficients", lens(ARHOST_DISTORTION_BROWN, 3));
    expect_unusable("a fisheye lens with 5 coefficients", lens(ARHOST_DISTORTION_FISHEYE, 5));
}

void cancelled(Context &context) {
    Started running(context);
    running.tracker.instance().host().cancel();
    const SealedFrame frame(running.at(running.marker.camera_from_marker), ARHOST_PIXEL_FORMAT_GREY8);
    expect_ok_or_cancelled("track", running.tracker.try_track(frame, 0, 0));
    Tracker starting(context);
    starting.instance().host().cancel();
    expect_ok_or_cancelled("start", starting.try_start(wide_camera(context), {{running.marker.print.id, side_mm}}));
}

// ---- Restarts --------------------------------------------------------------------------------------

void start_again(Context &context) {
    Started started(context);
    started.tracker.track(started.at(started.marker.camera_from_marker));
    const Placed marker{prints_of(context).back(), side_mm / 2, tilted({-12, 8, -150}, 30, 100)};
    const arhost_intrinsics camera = camera_for(context, 240, 200, 250);
    const Grey image = draw(camera, marker);
    started.tracker.start(camera, {{marker.print.id, marker.side_mm}});
    expect_one(started.tracker.track(image), marker.print.id, "after a restart with another camera and marker",
               image);
}

void leaks(Context &context) {
    const Placed marker = first_print(context);
    const arhost_intrinsics camera = camera_for(context, 192, 160, 180);
    const Grey image = draw(camera, marker);
    Tracker tracker(context);
    expect_no_leak([&](int frames) {
        tracker.start(camera, {{marker.print.id, side_mm}});
        for (int frame = 0; frame < frames; ++frame)
            tracker.track(image);
        tracker.stop();
    });
}

void longer_structs(Context &context) {
    constexpr std::size_t extra = 16; // bytes
    const std::vector<Print> prints = prints_of(context);
    if (prints.size() < 2)
        throw Skip("the test needs two prints");
    const Placed markers[] = {{prints[1], 60, tilted({-55, 10, -250}, 20, 40)},
                              {prints[0], 60, tilted({60, -10, -260}, 25, 120)}};
    const Grey image = draw(wide_camera(context), markers);
    const auto found_with = [&](std::size_t more) {
        TrackerSetup setup(context, wide_camera(context), {context.family}, ARHOST_PIXEL_FORMAT_GREY8, more);
        for (const Placed &marker : markers)
            setup.add({marker.print.id, marker.side_mm});
        Tracker tracker(context);
        tracker.instance().expect_ok("start", tracker.start_with(setup, more));
        std::vector<Tracker::Expected> expected;
        for (std::uint32_t i = 0; i < 2; ++i)
            expected.push_back({i, corners_of(wide_camera(context), markers[i]), 8});
        tracker.expect(expected);
        std::vector<arhost_observation> found = tracker.track(image);
        for (arhost_observation &one : found)
            one.struct_size = sizeof one;
        return found;
    };
    const std::vector<arhost_observation> found = found_with(extra);
    if (const std::string text = difference(found, found_with(0)); !text.empty())
        throw Failure(
            "with a longer struct_size of targets, markers, expected markers and observations, the same frame " +
            text)
            .with("frame", image.picture());
}

// ---- Determinism -----------------------------------------------------------------------------------

void expect_same(std::span<const arhost_observation> actual, std::span<const arhost_observation> expected,
                 const std::string &where) {
    if (const std::string text = difference(actual, expected); !text.empty())
        throw Failure(fmt::format("{}, the same frame {}", where, text));
}

void deterministic(Context &context) {
    Started one(context), other(context);
    const Grey here = one.at(one.marker.camera_from_marker), elsewhere = one.at(tilted({-15, 20, -280}, 30, 70, 30));
    const Grey empty_frame = one.without_print();
    std::vector<arhost_observation> before;
    int number = 0;
    for (const Grey *image : {&here, &here, &here, &elsewhere, &empty_frame, &here}) {
        const std::string frame = fmt::format("in frame {}", ++number);
        const std::vector<arhost_observation> found = one.tracker.track(*image);
        expect_same(other.tracker.track(*image), found, frame + " of another instance");
        if ((number == 2 || number == 3) && !one.tracker.has_state())
            expect_same(found, before, frame);
        before = found;
    }
}

void threads(Context &context) {
    const arhost_option_descriptor *option = context.library.option("threads");
    if (!option || option->type != ARHOST_OPTION_INTEGER)
        throw Skip("it has no integer option 'threads'");
    Started one(context, {{"threads", "1"}});
    const Grey image = one.at(one.marker.camera_from_marker);
    const std::vector<arhost_observation> alone = one.tracker.track(image);
    for (const char *count : {"2", "3"})
        expect_same(Started(context, {{"threads", count}}).tracker.track(image), alone,
                    fmt::format("with {} threads", count));
}

void frames_before(Context &context) {
    Started started(context);
    if (started.tracker.has_state()) {
        context.note = "it has state, which tracker.state tests";
        return;
    }
    const Grey here = started.at(started.marker.camera_from_marker),
               there = started.at(tilted({-60, 40, -320}, 45, 200, 120)), empty = started.without_print();
    int number = 0;
    for (const Grey *image : {&here, &there, &empty, &empty, &here}) {
        const std::vector<arhost_observation> found = started.tracker.track(*image);
        expect_same(found, Started(context).tracker.track(*image),
                    fmt::format("in frame {}, compared with a new instance,", ++number));
    }
}

// A new instance that gets the state of another one continues as that one does.
void state(Context &context) {
    Started started(context);
    const Grey here = started.at(started.marker.camera_from_marker),
               near = started.at(tilted({-15, 20, -280}, 30, 70, 30)), empty = started.without_print();
    std::vector<std::byte> before;
    int number = 0;
    for (const Grey *image : {&here, &near, &here, &empty, &empty, &near, &here}) {
        const std::string when = fmt::format("in frame {}, with the state of the frame before it,", number + 1);
        const auto next = [&](Started &one, std::byte filler) {
            one.tracker.set_state(before, filler);
            one.tracker.instance().expect_ok(
                "track", one.tracker.try_track(SealedFrame(*image, ARHOST_PIXEL_FORMAT_GREY8),
                                               static_cast<std::uint64_t>(number), number * frame_ns));
            return one.tracker.observations();
        };
        constexpr std::byte filler{0xa5}, other_filler{0x3c};
        const std::vector<arhost_observation> expected = next(started, filler);
        const std::vector<std::byte> after = started.tracker.state();
        Started other(context), with_other_filler(context);
        expect_same(next(other, filler), expected, when + " a new instance");
        if (other.tracker.state() != after)
            throw Failure(when + " a new instance writes another state_after");
        expect_same(next(with_other_filler, other_filler), expected,
                    when + " and with other initial content of state_after, a new instance");
        before = after;
        ++number;
    }
}

void out_of_order(Context &context) {
    struct Stamp {
        const char *when;
        std::uint64_t sequence;
        std::int64_t capture_ns;
    };
    Started started(context);
    const Grey images[] = {started.at(started.marker.camera_from_marker),
                           started.at(tilted({-30, 30, -300}, 30, 130))};
    std::size_t count = 0;
    for (const Stamp &stamp :
         {Stamp{"in the first frame", 0, 0}, Stamp{"in the second frame", 1, frame_ns},
          Stamp{"in a repeated frame", 1, frame_ns}, Stamp{"after 7 dropped frames", 9, 9 * frame_ns},
          Stamp{"in a frame 4 frames older", 5, 5 * frame_ns},
          Stamp{"in another frame with the same capture time", 6, 5 * frame_ns},
          Stamp{"after an hour", 108'000, 108'000 * frame_ns}, Stamp{"in frame 0 again", 0, 0}}) {
        const Grey &image = images[count++ % 2];
        Started other(context);
        other.tracker.set_state(started.tracker.state());
        for (Tracker *tracker : {&started.tracker, &other.tracker})
            tracker->instance().expect_ok(
                fmt::format("{}, track", stamp.when).c_str(),
                tracker->try_track(SealedFrame(image, ARHOST_PIXEL_FORMAT_GREY8), stamp.sequence, stamp.capture_ns));
        expect_one(started.tracker.observations(), started.marker.print.id, stamp.when, image);
        expect_same(started.tracker.observations(), other.tracker.observations(),
                    fmt::format("{}, compared with a new instance,", stamp.when));
    }
}

// ---- Numbers ---------------------------------------------------------------------------------------

// Returns what is wrong with an observation, as a sentence; empty if nothing is.
std::string problem_with(const arhost_observation &seen, std::uint32_t struct_size, std::uint32_t family_count) {
    constexpr std::uint32_t max_bits = 64; // of a marker's code
    if (seen.struct_size != struct_size)
        return fmt::format("struct_size is {}; expected {}, as it was set", seen.struct_size, struct_size);
    if (seen.family >= family_count)
        return fmt::format("family is {}, but the number of families is {}", seen.family, family_count);
    if (seen.hamming > max_bits)
        return fmt::format("hamming is {}; expected the number of corrected bits", seen.hamming);
    if (!(seen.decision_margin >= 0 && std::isfinite(seen.decision_margin)))
        return fmt::format("decision_margin is {}; expected a finite number of at least 0", seen.decision_margin);
    if (!(seen.corner_sigma_px >= 0 && std::isfinite(seen.corner_sigma_px)))
        return fmt::format("corner_sigma_px is {}; expected a finite number of at least 0", seen.corner_sigma_px);
    if (!(seen.false_positive_rate >= 0 && seen.false_positive_rate <= 1))
        return fmt::format("false_positive_rate is {}; expected a number from 0 to 1", seen.false_positive_rate);
    const Corners corners = corners_of(seen);
    for (std::size_t i = 0; i < corners.size(); ++i) {
        if (!std::isfinite(corners[i].x) || !std::isfinite(corners[i].y))
            return fmt::format("the {} corner is at ({}, {}) px", corner_names[i], corners[i].x, corners[i].y);
        const glm::dvec2 next = corners[(i + 1) % 4], along = next - corners[i], then = corners[(i + 2) % 4] - next;
        if (!(along.x * then.y - along.y * then.x > 0))
            return "the corners are not those of a convex quadrilateral, clockwise in the image";
    }
    return "";
}

void numbers(Context &context) {
    Started started(context);
    for (const Pose &at :
         {pose({0, 0, -250}), tilted({40, 30, -300}, 50, 20, 90), tilted({-60, -20, -280}, 40, 250, 200)}) {
        const Grey image = started.at(at);
        const arhost_observation seen =
            expect_one(started.tracker.track_first(image), started.marker.print.id, "in view", image);
        if (const std::string problem = problem_with(seen, started.tracker.observation_size(), 1); !problem.empty())
            throw Failure("an observation's " + problem).with("frame", image.picture());
    }
}

// ---- Speed -----------------------------------------------------------------------------------------

void speed(Context &context) {
    const arhost_intrinsics camera = pinhole(640, 480, 600);
    const Placed marker = first_print(context);
    const SealedFrame frame(draw(camera, marker), ARHOST_PIXEL_FORMAT_GREY8);
    Tracker tracker(context);
    tracker.start(camera, {{marker.print.id, side_mm}});
    tracker.track(frame);
    check_speed(context, camera.width, camera.height, frame_times_ms([&] { return tracker.track(frame), true; }), 50);
}

constexpr const char *gate = "tracker.track";
constexpr Test tests[] = {
    {"tracker.start", "It starts with a camera and a marker, and stops.", "abi.create", 30s, start},
    {"tracker.track", "It detects a marker that faces the camera, in a read-only frame between inaccessible pages.",
     "tracker.start", 30s, track},
    {"tracker.start-again", "After a stop, another instance starts with another camera and marker.", gate, 30s,
     start_again},
    {"tracker.leaks", "Frames, starts and stops leak no descriptors, threads or memory.", gate, 60s, leaks},
    {"tracker.unknown-id",
     "A marker id that is not in its family, or whose file is missing, is rejected with CONFIGURATION.", gate, 20s,
     unknown_id},
    {"tracker.unknown-family", "A family that it does not know is rejected with CONFIGURATION.", gate, 20s,
     unknown_family},
    {"tracker.unusable-lens", "A lens with an unknown model, or the wrong number of coefficients, is rejected.", gate,
     20s, unusable_lens},
    {"tracker.longer-structs",
     "It uses struct_size as the stride of the arrays of targets, markers, expected markers and observations.", gate,
     20s, longer_structs},
    {"tracker.cancelled", "After cancellation, start and track promptly return OK or CANCELLED.", gate, 20s,
     cancelled},
    {"tracker.numbers",
     "All fields of an observation are set and within their ranges; the corners are finite, convex and clockwise.",
     gate, 20s, numbers},
    {"tracker.deterministic",
     "The same frames give the same bytes in another instance; so does a repeated frame, without state.", gate, 20s,
     deterministic},
    {"tracker.threads", "The result does not depend on the number of threads.", gate, 20s, threads},
    {"tracker.frames-before", "Without state, observations depend only on the current frame.",
     "tracker.deterministic", 20s, frames_before},
    {"tracker.state", "Results and state_after depend only on the frame and state_before.", "tracker.frames-before",
     30s, state},
    {"tracker.out-of-order", "Dropped, repeated and older frames are handled like any other.",
     "tracker.deterministic", 20s, out_of_order},
    {"tracker.speed", "The median time of track at 640×480 is at most 50 ms; otherwise a warning.", gate, 60s, speed},
};

} // namespace

std::span<const Test> tracker_life_tests() {
    return tests;
}

} // namespace arhost::conformance
