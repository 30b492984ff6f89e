// SPDX-License-Identifier: Apache-2.0
// Life cycle of a tracker: restarts, rejected input, records, and independence of earlier frames.
#include "conformance/cancelling.hpp"
#include "conformance/frame_times.hpp"
#include "conformance/process_usage.hpp"
#include "conformance/tracker.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace arhost::conformance {
namespace {

constexpr double side_mm = 80;

Placed first_print(Context &context, const Pose &at = tilted({10, -5, -260}, 25, 40, 15)) {
    return {prints_of(context.prints).front(), side_mm, at};
}

// A tracker started with the first print.
struct Started {
    explicit Started(Context &context, Settings overrides = {})
        : marker(first_print(context)), tracker(context, std::move(overrides)) {
        tracker.start(wide_camera(), {{marker.print.id, side_mm}});
    }
    Grey at(const Pose &where) const { return draw(wide_camera(), Placed{marker.print, side_mm, where}); }

    Placed marker;
    Tracker tracker;
};

// The pose that a new instance reports.
Pose pose_from_new_instance(Context &context, const arhost_intrinsics &camera, const Placed &marker,
                            const Grey &image) {
    Tracker tracker(context);
    tracker.start(camera, {{marker.print.id, marker.side_mm}});
    return pose_of(expect_one(tracker.track(image), marker.print.id, "in a new instance", image));
}

void start(Context &context) {
    Started started(context);
}

void track(Context &context) {
    Started started(context);
    const Grey image = started.at(pose({0, 0, -250}));
    expect_one(started.tracker.track(image), started.marker.print.id, "facing the camera", image);
}

// ---- Rejected input --------------------------------------------------------------------------------

void unknown_id(Context &context) {
    Tracker tracker(context);
    for (const int id : {-1, std::numeric_limits<int>::max()})
        if (const arhost_status status = tracker.try_start(wide_camera(), {{id, side_mm}});
            status != ARHOST_STATUS_ERROR_CONFIGURATION)
            throw Failure(
                fmt::format("with marker {}, which is in no dictionary, start returned {}; expected CONFIGURATION",
                            id, status_name(status)));
}

void unusable_lens(Context &context) {
    const Print print = prints_of(context.prints).front();
    Tracker tracker(context);
    const auto expect_rejected = [&](const char *description, const arhost_intrinsics &camera) {
        if (const arhost_status status = tracker.try_start(camera, {{print.id, side_mm}});
            status != ARHOST_STATUS_ERROR_CONFIGURATION && status != ARHOST_STATUS_ERROR_UNSUPPORTED)
            throw Failure(fmt::format("with {}, start returned {}; expected CONFIGURATION or UNSUPPORTED",
                                      description, status_name(status)));
    };
    const auto lens = [](arhost_distortion model, std::uint32_t count) {
        arhost_intrinsics camera = wide_camera();
        camera.distortion = model;
        camera.coefficient_count = count;
        return camera;
    };
    expect_rejected("the unknown distortion model 99", lens(99, 4));
    expect_rejected("Brown's model with 3 coefficients", lens(ARHOST_DISTORTION_BROWN, 3));
    expect_rejected("a fisheye lens with 5 coefficients", lens(ARHOST_DISTORTION_FISHEYE, 5));
}

void cancelled(Context &context) {
    Started running(context);
    running.tracker.instance().host().cancel();
    const SealedFrame frame(running.at(running.marker.camera_from_marker), ARHOST_PIXEL_FORMAT_GREY8);
    expect_ok_or_cancelled("track", running.tracker.try_track(frame, 0, 0));
    Tracker starting(context);
    starting.instance().host().cancel();
    expect_ok_or_cancelled("start", starting.try_start(wide_camera(), {{running.marker.print.id, side_mm}}));
}

// ---- Restarts --------------------------------------------------------------------------------------

void start_again(Context &context) {
    Started started(context);
    started.tracker.track(started.at(started.marker.camera_from_marker));
    const Placed marker{prints_of(context.prints).back(), side_mm / 2, tilted({-12, 8, -150}, 30, 100)};
    const arhost_intrinsics camera = pinhole(240, 200, 250);
    const Grey image = draw(camera, marker);
    started.tracker.start(camera, {{marker.print.id, marker.side_mm}});
    expect_one(started.tracker.track(image), marker.print.id, "after a restart with another camera and marker",
               image);
}

void leaks(Context &context) {
    const Placed marker = first_print(context);
    const arhost_intrinsics camera = pinhole(192, 160, 180);
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
    struct Longer {
        arhost_marker_config known;
        std::uint64_t unknown[2];
    };
    const std::vector<Print> prints = prints_of(context.prints);
    if (prints.size() < 2)
        throw Skip("the test needs two prints");
    const std::uint64_t garbage = 0xa5a5a5a5a5a5a5a5;
    std::vector<Longer> listed;
    listed.reserve(2);
    for (const Print &print : {prints[1], prints[0]})
        listed.push_back({{sizeof(Longer), print.id, side_mm}, {garbage, garbage}});
    const arhost_intrinsics camera = wide_camera();
    const arhost_frame_format format = format_of(camera.width, camera.height, ARHOST_PIXEL_FORMAT_GREY8);
    Tracker tracker(context);
    tracker.instance().expect_ok(
        "with markers of a longer struct_size, start",
        tracker.start_with({sizeof(arhost_tracker_setup), 2, &format, &camera, &listed[0].known}));
    const Placed marker = first_print(context);
    const Grey image = draw(camera, marker);
    constexpr const char *where = "with markers of a longer struct_size";
    expect_pose(expect_one(tracker.track(image), marker.print.id, where, image),
                pose_from_new_instance(context, camera, marker, image), roughly, where, image);
}

// ---- Determinism -----------------------------------------------------------------------------------

bool same_bytes(const arhost_marker &a, const arhost_marker &b) {
    return std::ranges::equal(std::as_bytes(std::span(&a, 1)), std::as_bytes(std::span(&b, 1)));
}

void expect_same(std::span<const arhost_marker> actual, std::span<const arhost_marker> expected,
                 const std::string &where) {
    if (actual.size() != expected.size())
        throw Failure(
            fmt::format("{}, the same frame gives {} records; expected {}", where, actual.size(), expected.size()));
    for (std::size_t i = 0; i < actual.size(); ++i)
        if (!same_bytes(actual[i], expected[i]))
            throw Failure(fmt::format("{}, the same frame gives a different record of marker {}: the position "
                                      "differs by {:.3g} mm, the first corner by {:.3g} px",
                                      where, expected[i].id,
                                      glm::distance(pose_of(actual[i])[3], pose_of(expected[i])[3]),
                                      std::hypot(actual[i].corners_px[0][0] - expected[i].corners_px[0][0],
                                                 actual[i].corners_px[0][1] - expected[i].corners_px[0][1])));
}

Grey without_print() {
    return filled(320, 256, [](auto, auto) { return background_code; });
}

void deterministic(Context &context) {
    Started one(context), other(context);
    const Grey here = one.at(one.marker.camera_from_marker), elsewhere = one.at(tilted({-15, 20, -280}, 30, 70, 30));
    const Grey empty_frame = without_print();
    std::vector<arhost_marker> before;
    int number = 0;
    for (const Grey *image : {&here, &here, &here, &elsewhere, &empty_frame, &here}) {
        const std::string frame = fmt::format("in frame {}", ++number);
        one.tracker.track(*image);
        other.tracker.track(*image);
        const std::vector<arhost_marker> records = one.tracker.records();
        expect_same(other.tracker.records(), records, frame + " of another instance");
        if (number == 2 || number == 3)
            if (const arhost_marker &record = expect_one(one.tracker.seen(), one.marker.print.id, frame, *image);
                record.state == ARHOST_MARKER_DETECTED)
                expect_same(records, before, frame);
        before = records;
    }
}

void threads(Context &context) {
    const arhost_option_descriptor *option = context.library.option("threads");
    if (!option || option->type != ARHOST_OPTION_INTEGER)
        throw Skip("it has no integer option 'threads'");
    Started one(context, {{"threads", "1"}});
    const Grey image = one.at(one.marker.camera_from_marker);
    const std::vector<arhost_marker> alone = one.tracker.track(image);
    for (const char *count : {"2", "3"})
        expect_same(Started(context, {{"threads", count}}).tracker.track(image), alone,
                    fmt::format("with {} threads", count));
}

arhost_marker detect_with_new(Context &context, const Started &started, const Grey &image) {
    Started other(context);
    return expect_one(other.tracker.track(image), started.marker.print.id, "in a new instance", image);
}

// The record of this frame equals that of a new instance, unless it is smoothed.
void expect_as_new(Context &context, const Started &started, const Grey &image, const std::string &when) {
    const arhost_marker actual = expect_one(started.tracker.seen(), started.marker.print.id, when, image);
    const arhost_marker expected = detect_with_new(context, started, image);
    if (actual.state == ARHOST_MARKER_DETECTED && expected.state == ARHOST_MARKER_DETECTED)
        expect_same({&actual, 1}, {&expected, 1}, when);
}

void frames_before(Context &context) {
    Started started(context);
    const Pose here = started.marker.camera_from_marker, there = tilted({-60, 40, -320}, 45, 200, 120);
    const Grey empty = without_print();
    const auto expect_at = [&](const Pose &where, const char *when) {
        const Grey image = started.at(where);
        started.tracker.track(image);
        expect_as_new(context, started, image, when);
    };
    expect_at(here, "in the first frame");
    expect_at(there, "after a move in the next frame");
    expect_none(started.tracker.track(empty), "with the marker removed", empty);
    expect_none(started.tracker.track(empty), "with the marker removed", empty);
    expect_at(here, "with the marker back in view");
}

// A new instance that gets the state of another one continues as that one does.
void state(Context &context) {
    Started started(context);
    const Grey here = started.at(started.marker.camera_from_marker),
               near = started.at(tilted({-15, 20, -280}, 30, 70, 30)), empty = without_print();
    std::vector<std::byte> before;
    int number = 0;
    for (const Grey *image : {&here, &near, &here, &empty, &empty, &near, &here}) {
        const std::string when = fmt::format("in frame {}, with the state of the frame before it,", number + 1);
        const auto next = [&](Started &one, std::byte filler) {
            one.tracker.set_state(before, filler);
            one.tracker.instance().expect_ok(
                "track", one.tracker.try_track(SealedFrame(*image, ARHOST_PIXEL_FORMAT_GREY8),
                                               static_cast<std::uint64_t>(number), number * frame_ns));
            return one.tracker.records();
        };
        constexpr std::byte filler{0xa5}, other_filler{0x3c};
        const std::vector<arhost_marker> expected = next(started, filler);
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

void settles(Context &context) {
    constexpr int moving = 10, still = 60; // arhost/tracker.h
    Started started(context);
    const Grey elsewhere = started.at(tilted({-60, 40, -320}, 45, 200, 120)),
               image = started.at(started.marker.camera_from_marker);
    for (int i = 0; i < moving; ++i)
        started.tracker.track(elsewhere);
    for (int i = 0; i < still; ++i)
        started.tracker.track(image);
    const std::string when = fmt::format("at rest for {} frames", still);
    const arhost_marker found = expect_one(started.tracker.seen(), started.marker.print.id, when, image);
    if (found.state == ARHOST_MARKER_DETECTED)
        return; // not smoothed: covered by other tests
    expect_pose(found, pose_of(detect_with_new(context, started, image)), roughly, when, image);
}

void out_of_order(Context &context) {
    struct Stamp {
        const char *when;
        std::uint64_t sequence;
        std::int64_t capture_ns;
    };
    Started started(context);
    const Pose places[] = {started.marker.camera_from_marker, tilted({-30, 30, -300}, 30, 130)};
    const Grey images[] = {started.at(places[0]), started.at(places[1])};
    std::size_t count = 0;
    for (const Stamp &stamp :
         {Stamp{"in the first frame", 0, 0}, Stamp{"in the second frame", 1, frame_ns},
          Stamp{"in a repeated frame", 1, frame_ns}, Stamp{"after 7 dropped frames", 9, 9 * frame_ns},
          Stamp{"in a frame 4 frames older", 5, 5 * frame_ns},
          Stamp{"in another frame with the same capture time", 6, 5 * frame_ns},
          Stamp{"after an hour", 108'000, 108'000 * frame_ns}, Stamp{"in frame 0 again", 0, 0}}) {
        const Grey &image = images[count++ % 2];
        started.tracker.instance().expect_ok(fmt::format("{}, track", stamp.when).c_str(),
                                             started.tracker.try_track(SealedFrame(image, ARHOST_PIXEL_FORMAT_GREY8),
                                                                       stamp.sequence, stamp.capture_ns));
        expect_as_new(context, started, image, stamp.when);
    }
}

// ---- Records ---------------------------------------------------------------------------------------

constexpr double orthonormal = 1e-9; // arhost/tracker.h

// Returns why the matrix is not a rigid transform, as a predicate ("is not finite"); empty if it is rigid.
std::string not_rigid(const double *m, double tolerance) {
    if (!std::all_of(m, m + 16, [](double value) { return std::isfinite(value); }))
        return "is not finite";
    if (m[3] != 0 || m[7] != 0 || m[11] != 0 || m[15] != 1)
        return fmt::format("has the last row ({}, {}, {}, {}); expected (0, 0, 0, 1)", m[3], m[7], m[11], m[15]);
    const glm::dvec3 axis[] = {{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j <= i; ++j)
            if (const double off = glm::dot(axis[i], axis[j]) - (i == j ? 1 : 0); !(std::abs(off) <= tolerance))
                return fmt::format("has a rotation that deviates from orthonormality by {:.3g}; the limit is {}",
                                   std::abs(off), tolerance);
    if (glm::dot(glm::cross(axis[0], axis[1]), axis[2]) < 0)
        return "mirrors: its determinant is −1";
    return "";
}

template <class Check> void check_several_records(Context &context, Check &&check) {
    Started started(context);
    for (const Pose &at :
         {pose({0, 0, -250}), tilted({40, 30, -300}, 50, 20, 90), tilted({-60, -20, -280}, 40, 250, 200)}) {
        const Grey image = started.at(at);
        const arhost_marker marker =
            expect_one(started.tracker.track_first(image), started.marker.print.id, "in view", image);
        if (const std::string problem = check(marker); !problem.empty())
            throw Failure("the record's " + problem).with("frame", image.picture());
    }
}

void rigid(Context &context) {
    check_several_records(context, [](const arhost_marker &marker) {
        const std::string problem = not_rigid(marker.mt, orthonormal);
        return problem.empty() ? "" : "mt " + problem;
    });
}

void record(Context &context) {
    check_several_records(context, [](const arhost_marker &marker) -> std::string {
        if (marker.struct_size != sizeof marker)
            return fmt::format("struct_size is {}; expected {}", marker.struct_size, sizeof marker);
        const auto *end = static_cast<const char *>(std::memchr(marker.family, 0, sizeof marker.family));
        if (!end || end == marker.family)
            return end ? "family is empty" : "family has no NUL within its 32 bytes";
        if (marker.age_frames != 0)
            return fmt::format("age_frames is {} in a frame where the marker is visible; expected 0",
                               marker.age_frames);
        if (!(marker.reprojection_px >= 0 && marker.reprojection_px <= 1))
            return fmt::format("reprojection_px is {}; expected 0 to 1 in a sharp frame", marker.reprojection_px);
        if (!(marker.ambiguity >= 0 && marker.ambiguity <= 1))
            return fmt::format("ambiguity is {}; expected 0 to 1", marker.ambiguity);
        const double *other = marker.mt_alternative;
        if (std::any_of(other, other + 16, [](double value) { return value != 0; }))
            if (const std::string problem = not_rigid(other, orthonormal); !problem.empty())
                return "mt_alternative " + problem;
        return "";
    });
}

// Records of a marker that is out of view, if there are any.
void out_of_view(Context &context) {
    constexpr std::uint32_t visible_for = 3, lost_for = 12;
    Started started(context);
    const Grey here = started.at(started.marker.camera_from_marker), empty_frame = without_print();
    bool reported = false;
    for (int time = 0; time < 2; ++time) {
        std::vector<arhost_marker> last, last_seen;
        for (std::uint32_t i = 0; i < visible_for; ++i) {
            started.tracker.track(here);
            last = last_seen = started.tracker.records();
            if (const arhost_marker found = expect_one(last, started.marker.print.id, "in view", here);
                found.age_frames != 0)
                throw Failure(fmt::format("while visible, its age_frames is {}; expected 0", found.age_frames));
        }
        for (std::uint32_t age = 1; age <= lost_for; ++age) {
            started.tracker.track(empty_frame);
            const std::vector<arhost_marker> records = started.tracker.records();
            if (records.empty())
                continue;
            reported = true;
            const std::string when = fmt::format("{} frames after it was last seen", age);
            const arhost_marker found = expect_one(records, started.marker.print.id, when, empty_frame);
            if (found.state != ARHOST_MARKER_PREDICTED && found.state != ARHOST_MARKER_LOST)
                throw Failure(fmt::format("{}, its state is {}; expected PREDICTED or LOST", when, found.state));
            if (found.age_frames != age)
                throw Failure(fmt::format("{}, its age_frames is {}; expected {}", when, found.age_frames, age));
            if (const std::string problem = not_rigid(found.mt, orthonormal); !problem.empty())
                throw Failure(fmt::format("{}, its mt {}", when, problem));
            if (found.state == ARHOST_MARKER_LOST && !std::equal(found.mt, found.mt + 16, last[0].mt) &&
                !std::equal(found.mt, found.mt + 16, last_seen[0].mt))
                throw Failure(fmt::format("{}, it is LOST, but its mt is not the last known one", when));
            last = records;
        }
    }
    if (!reported)
        throw Skip("it reports no markers that are out of view");
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

constexpr arhost_kind kind = ARHOST_KIND_TRACKER;
constexpr const char *gate = "tracker.track";
constexpr Test tests[] = {
    {"tracker.start", "It starts with a camera and a marker, and stops.", kind, "abi.create", 30s, start},
    {"tracker.track", "It detects a marker that faces the camera, in a read-only frame between inaccessible pages.",
     kind, "tracker.start", 30s, track},
    {"tracker.start-again", "After a stop, another instance starts with another camera and marker.", kind, gate, 30s,
     start_again},
    {"tracker.leaks", "Frames, starts and stops leak no descriptors, threads or memory.", kind, gate, 60s, leaks},
    {"tracker.unknown-id", "A marker id that is in no dictionary is rejected with CONFIGURATION.", kind, gate, 20s,
     unknown_id},
    {"tracker.unusable-lens", "A lens with an unknown model, or the wrong number of coefficients, is rejected.", kind,
     gate, 20s, unusable_lens},
    {"tracker.longer-structs", "It uses struct_size as the stride of the markers array.", kind, gate, 20s,
     longer_structs},
    {"tracker.cancelled", "After cancellation, start and track promptly return OK or CANCELLED.", kind, gate, 20s,
     cancelled},
    {"tracker.record",
     "A record is complete: struct_size, family, age 0, reprojection error and ambiguity within their ranges.", kind,
     gate, 20s, record},
    {"tracker.rigid", "A pose is finite, orthonormal to 1e-9, with determinant 1 and last row 0 0 0 1.", kind, gate,
     20s, rigid},
    {"tracker.deterministic",
     "The same frames give the same records in another instance; so does a repeated frame if DETECTED.", kind, gate,
     20s, deterministic},
    {"tracker.threads", "The result does not depend on the number of threads.", kind, gate, 20s, threads},
    {"tracker.frames-before", "A DETECTED record depends only on the current frame.", kind, "tracker.deterministic",
     20s, frames_before},
    {"tracker.state", "Results and state_after depend only on the frame and state_before.", kind,
     "tracker.frames-before", 30s, state},
    {"tracker.out-of-view", "A marker out of view is omitted, PREDICTED or LOST, with its age and a rigid pose.",
     kind, "tracker.frames-before", 20s, out_of_view},
    {"tracker.settles", "The pose of a marker at rest is correct within 60 frames, smoothed or not.", kind, gate, 30s,
     settles},
    {"tracker.out-of-order", "Dropped, repeated and older frames are handled like any other.", kind,
     "tracker.deterministic", 20s, out_of_order},
    {"tracker.speed", "The median time of track at 640×480 is at most 50 ms; otherwise a warning.", kind, gate, 60s,
     speed},
};

} // namespace

std::span<const Test> tracker_life_tests() {
    return tests;
}

} // namespace arhost::conformance
