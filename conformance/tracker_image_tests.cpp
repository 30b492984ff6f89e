// SPDX-License-Identifier: Apache-2.0
// Detection of markers in good and degraded frames, and false positives.
#include "conformance/tracker.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace arhost::conformance {
namespace {

constexpr double side_mm = 80;

std::vector<Listed> listed(std::span<const Print> prints, double side = side_mm) {
    std::vector<Listed> all;
    all.reserve(prints.size());
    for (const Print &print : prints)
        all.push_back({print.id, side});
    return all;
}

// Adds normally distributed sensor noise (Box–Muller).
Grey noisy(const Grey &image, double sigma, Context &context) {
    return filled(image.width, image.height, [&](auto x, auto y) {
        const double radius = std::sqrt(-2 * std::log(1 - context.uniform(0, 1)));
        return static_cast<int>(
            std::lround(image.at(x, y) + sigma * radius * std::cos(context.uniform(0, 2 * std::numbers::pi))));
    });
}

// ---- Degraded frames -------------------------------------------------------------------------------

// Expects the first print at several poses in images degraded by `change`.
template <class Change> void expect_found_in(Context &context, const std::string &where, Change &&change) {
    const Print print = prints_of(context).front();
    Tracker tracker(context);
    tracker.start(wide_camera(context), {{print.id, side_mm}});
    for (const Pose &at : {tilted({0, 0, -230}, 30, 20, 0), tilted({35, -20, -270}, 40, 140, 100),
                           tilted({-40, 25, -250}, 25, 260, 200)}) {
        const Placed marker{print, side_mm, at};
        expect_found(tracker, wide_camera(context), marker, change(draw(wide_camera(context), marker)), roughly,
                     where);
    }
}

void blur(Context &context) {
    expect_found_in(context, "blurred by 1.5 px", [](const Grey &image) { return blurred(image, 1.5); });
}

void noise(Context &context) {
    expect_found_in(context, "with Gaussian noise (σ = 7 grey levels)",
                    [&](const Grey &image) { return noisy(image, 7, context); });
}

void exposure(Context &context) {
    struct Light {
        const char *name;
        double gain, offset, slope; // codes are gain · code + offset, times 1 ± slope from left to right
    };
    for (const Light &light :
         {Light{"in the dark, grey levels up to 66", 0.3, 0, 0}, Light{"overexposed", 1.35, 0, 0},
          Light{"behind haze, grey levels 133 to 199", 0.35, 122, 0}, Light{"lit from the side", 0.8, 0, 0.45}})
        expect_found_in(context, light.name, [&](const Grey &image) {
            return filled(image.width, image.height, [&](auto x, auto y) {
                const double side = 2.0 * x / image.width - 1;
                return static_cast<int>(
                    std::lround((light.gain * image.at(x, y) + light.offset) * (1 + light.slope * side)));
            });
        });
}

void occlusion(Context &context) {
    const Print print = prints_of(context).front();
    const Placed marker{print, side_mm, tilted({5, 5, -230}, 30, 40, 20)};
    const Grey whole = draw(wide_camera(context), marker);
    const auto hidden = corners_of(wide_camera(context), marker);
    Tracker tracker(context);
    tracker.start(wide_camera(context), {{print.id, side_mm}});
    for (std::size_t corner = 0; corner < hidden.size(); ++corner)
        for (const double radius : {5.0, 14.0, 30.0})
            for (const int code : {ink_code, background_code, paper_code}) {
                const std::string where =
                    fmt::format("with corner {} hidden by a disc of {} px radius and code {}", corner, radius, code);
                const Grey image = filled(whole.width, whole.height, [&](auto x, auto y) {
                    return glm::distance(glm::dvec2(x, y), hidden[corner]) < radius ? code : whole.at(x, y);
                });
                for (const arhost_observation &found : tracker.track_first(image))
                    expect_corners(found, wide_camera(context), marker, {5, 0.03}, where, image);
            }
}

void recall(Context &context) {
    constexpr int count = 20, min_found = 19;
    const Print print = prints_of(context).front();
    Tracker tracker(context);
    tracker.start(wide_camera(context), {{print.id, side_mm}});
    int found = 0;
    std::optional<Grey> missed;
    for (int i = 0; i < count; ++i) {
        const double distance = context.uniform(170, 480);
        const glm::dvec3 centre(context.uniform(-0.2, 0.2) * distance, context.uniform(-0.12, 0.12) * distance,
                                -distance);
        const Placed marker{print, side_mm,
                            tilted(centre, context.uniform(0, 50), context.uniform(0, 360), context.uniform(0, 360))};
        const Grey image = draw(wide_camera(context), marker);
        const std::vector<arhost_observation> markers = tracker.track_first(image);
        if (markers.empty()) {
            missed = image;
            continue;
        }
        ++found;
        const std::string where = fmt::format("in view {} at a distance of {:.0f} mm", i + 1, distance);
        expect_corners(expect_one(markers, print.id, where, image), wide_camera(context), marker, {180, 0.1}, where,
                       image);
    }
    context.note = fmt::format("{} of {} found", found, count);
    if (found < min_found)
        throw Failure(
            fmt::format("of {} frames with a marker 50 to 140 px wide, it is detected in {}; the minimum is {}",
                        count, found, min_found))
            .with("a frame where it is missed", missed->picture());
}

// ---- A moving marker --------------------------------------------------------------------------------

void follows(Context &context) {
    const Print print = prints_of(context).front();
    Tracker tracker(context);
    tracker.start(wide_camera(context), {{print.id, side_mm}});
    const auto expect_at = [&](const Pose &where, const std::string &when) {
        const Placed marker{print, side_mm, where};
        const Grey image = draw(wide_camera(context), marker);
        expect_corners(expect_one(tracker.track(image), marker.print.id, when, image), wide_camera(context), marker,
                       roughly, when, image);
    };
    const Pose here = tilted({10, -5, -260}, 25, 40, 15), there = tilted({-60, 40, -320}, 45, 200, 120);
    const Grey empty = empty_image(wide_camera(context));
    for (int i = 0; i < 5; ++i)
        expect_at(tilted({10 + 2 * i, -5, -260 - i}, 25, 40, 15 + i), "while it moves slowly");
    expect_at(there, "after a jump");
    for (int i = 0; i < 5; ++i)
        expect_none(tracker.track(empty), "after the marker has left", empty);
    expect_at(here, "with the marker back in view");
    for (int i = 0; i < 5; ++i)
        expect_at(here, "at rest");
}

// ---- Several markers -------------------------------------------------------------------------------

// Each print in a quarter of the image, with different sides.
struct Group {
    explicit Group(Context &context) {
        std::vector<Print> prints = prints_of(context);
        if (prints.size() < 3)
            throw Skip("the test needs three prints");
        prints.resize(std::min<std::size_t>(prints.size(), 4), prints[0]);
        const glm::dvec3 places[] = {{-62, 45, -250}, {62, 45, -250}, {62, -48, -260}, {-62, -48, -240}};
        for (std::size_t i = 0; i < prints.size(); ++i) {
            const double side = 50 + 5.0 * static_cast<double>(i);
            markers.push_back({prints[i], side,
                               tilted(places[i], 25, 80.0 * static_cast<double>(i), 50.0 * static_cast<double>(i))});
        }
    }
    std::vector<Placed> markers;

    std::vector<InFamily> expected() const {
        std::vector<InFamily> all;
        for (const Placed &marker : markers)
            all.push_back({marker});
        return all;
    }
};

void several(Context &context) {
    const Group group(context);
    const Grey image = draw(wide_camera(context), group.markers);
    Tracker tracker(context);
    for (const bool reversed : {false, true}) {
        std::vector<Listed> list;
        for (const Placed &marker : group.markers)
            list.push_back({marker.print.id, marker.side_mm});
        if (reversed)
            std::ranges::reverse(list);
        tracker.start(wide_camera(context), list);
        expect_all(tracker.track_first(image), wide_camera(context), group.expected(), "with several markers in view",
                   image);
    }
}

// Of those expected, each must be found; others may be found too.
void expected_places(Context &context) {
    const Group group(context);
    const Grey image = draw(wide_camera(context), group.markers), empty = empty_image(wide_camera(context));
    Tracker tracker(context);
    std::vector<Listed> list;
    std::vector<Tracker::Expected> expected, outside;
    for (const Placed &marker : group.markers) {
        const auto index = static_cast<std::uint32_t>(list.size());
        list.push_back({marker.print.id, marker.side_mm});
        Corners near = corners_of(wide_camera(context), marker), far = near;
        for (std::size_t i = 0; i < 4; ++i) {
            near[i] += glm::dvec2(5, -4);
            far[i] += glm::dvec2(index % 2 == 0 ? -1000 : 1e9, 0);
        }
        expected.push_back({index, near, 8});
        outside.push_back({index, far, 8});
    }
    tracker.start(wide_camera(context), list);
    tracker.expect(expected);
    expect_all(tracker.track_first(image), wide_camera(context), group.expected(),
               "with markers that are up to 7 px from the expected places", image);
    expect_none(tracker.track_first(empty), "with markers that are expected but not there", empty);

    const auto expect_at_least = [&](const std::vector<Tracker::Expected> &markers, const std::string &where) {
        tracker.expect(markers);
        const std::vector<arhost_observation> found = tracker.track_first(image);
        std::vector<InFamily> all = group.expected();
        for (std::size_t i = all.size(); i-- > markers.size();)
            if (std::ranges::count(found, all[i].marker.print.id, &arhost_observation::id) == 0)
                all.erase(all.begin() + static_cast<std::ptrdiff_t>(i));
        expect_all(found, wide_camera(context), all, where, image);
    };
    expect_at_least({expected[0]}, "with one of several markers expected");
    expect_at_least({expected[0], expected[1]}, "with two of several markers expected");
    tracker.expect(outside);
    (void)tracker.track_first(image);
    tracker.search_everywhere();
    expect_all(tracker.track_first(image), wide_camera(context), group.expected(),
               "after frames with expected markers", image);
}

void unlisted(Context &context) {
    const Group group(context);
    const Grey image = draw(wide_camera(context), group.markers);
    const Placed &listed = group.markers[1];
    Tracker tracker(context);
    tracker.start(wide_camera(context), {{listed.print.id, listed.side_mm}});
    const std::vector<arhost_observation> found = tracker.track_first(image);
    std::vector<InFamily> expected = group.expected(); // in which those that it leaves out are not expected
    std::erase_if(expected, [&](const InFamily &one) {
        return one.marker.print.id != listed.print.id &&
               std::ranges::count(found, one.marker.print.id, &arhost_observation::id) == 0;
    });
    expect_all(found, wide_camera(context), expected, "with unlisted markers in view", image);
}

// Markers of two families, some with the same id.
void families(Context &context) {
    if (!context.prints.empty())
        throw Skip("the pictures of --print are of one family");
    const auto try_both = [&](const std::string &other) {
        const std::vector<Print> prints[] = {prints_of(context), prints_of({}, other)};
        const glm::dvec3 places[] = {{-62, 45, -250}, {62, 45, -250}, {62, -48, -260}, {-62, -48, -240}};
        for (const bool swapped : {false, true}) {
            std::vector<Placed> markers;
            std::vector<InFamily> expected;
            TrackerSetup setup(context, wide_camera(context),
                               swapped ? std::vector<std::string>{other, context.family}
                                       : std::vector<std::string>{context.family, other});
            for (std::size_t i = 0; i < std::size(places); ++i) {
                const Print &print = prints[i / 2][i % 2 ? 1 : i]; // 31 and 7 of the one, 12 and 7 of the other
                markers.push_back({print, 60, tilted(places[i], 25, 80.0 * static_cast<double>(i), 10)});
                expected.push_back({markers.back(), static_cast<std::uint32_t>(i / 2 == (swapped ? 0 : 1))});
                setup.add({print.id, 60, expected.back().family});
            }
            Tracker tracker(context);
            const std::string where = fmt::format("with {} and {}", context.family, other);
            const arhost_status status = tracker.start_with(setup);
            if (status == ARHOST_STATUS_ERROR_CONFIGURATION)
                return false;
            tracker.instance().expect_ok((where + ", start").c_str(), status);
            const Grey image = draw(wide_camera(context), markers);
            expect_all(tracker.track(image), wide_camera(context), expected, where, image);
        }
        context.note = fmt::format("with {} and {}", context.family, other);
        return true;
    };
    if (std::ranges::none_of(drawn_families,
                             [&](const char *other) { return other != context.family && try_both(other); }))
        throw Skip(fmt::format("it knows only one of the families {}", fmt::join(drawn_families, ", ")));
}

void copies(Context &context) {
    const Print print = prints_of(context).front();
    const Placed twice[] = {{print, 60, tilted({-55, 10, -250}, 20, 40)},
                            {print, 60, tilted({60, -10, -260}, 25, 120)}};
    const Grey image = draw(wide_camera(context), twice);
    Tracker tracker(context);
    tracker.start(wide_camera(context), {{print.id, 60}});
    const InFamily expected[] = {{twice[0]}, {twice[1]}};
    expect_all(tracker.track_first(image), wide_camera(context), expected, "with two copies of a print in view",
               image);
}

void mirrored(Context &context) {
    const std::vector<Print> prints = prints_of(context);
    Tracker tracker(context);
    tracker.start(wide_camera(context), listed(prints));
    for (const Print &print : prints) {
        const Grey image =
            draw(wide_camera(context), Placed{print.mirrored(), side_mm, tilted({0, 0, -230}, 25, 60)});
        expect_none(tracker.track_first(image), "for a mirrored print", image);
    }
}

// ---- False positives -------------------------------------------------------------------------------

void no_marker(Context &context) {
    const std::vector<Print> prints = prints_of(context);
    Tracker tracker(context);
    const arhost_intrinsics camera = pinhole(320, 256, 300);
    tracker.start(camera, listed(prints));
    const auto expect_nothing = [&](const std::string &content, const auto &code) {
        const Grey image = filled(camera.width, camera.height, code);
        expect_none(tracker.track_first(image), "in " + content, image);
    };
    for (const int grey : {0, 255, 128})
        expect_nothing(fmt::format("an image of code {}", grey), [&](auto, auto) { return grey; });
    expect_nothing("noise", [&](auto, auto) { return static_cast<int>(context.random() & 255); });
    expect_nothing("a gradient", [](auto x, auto y) { return static_cast<int>(x / 4 + y / 2); });
    expect_nothing("a chessboard", [](auto x, auto y) { return (x / 24 + y / 24) % 2 ? ink_code : paper_code; });
    expect_nothing("stripes", [](auto x, auto y) { return (x + y / 3) / 10 % 2 ? ink_code : paper_code; });
    expect_nothing("a black square",
                   [](auto x, auto y) { return x > 90 && x < 210 && y > 60 && y < 180 ? ink_code : paper_code; });
    expect_nothing("a frame", [](auto x, auto y) {
        const bool outer = x > 90 && x < 210 && y > 60 && y<180, inner = x> 105 && x < 195 && y > 75 && y < 165;
        return outer && !inner ? ink_code : paper_code;
    });
    Grey clutter = empty_image(camera);
    for (int i = 0; i < 60; ++i) {
        const auto x0 = static_cast<std::uint32_t>(context.uniform(0, 280)),
                   y0 = static_cast<std::uint32_t>(context.uniform(0, 220));
        const auto x1 = x0 + static_cast<std::uint32_t>(context.uniform(4, 40)),
                   y1 = y0 + static_cast<std::uint32_t>(context.uniform(4, 36));
        const auto code = static_cast<std::uint8_t>(context.uniform(0, 255));
        for (std::uint32_t y = y0; y < y1; ++y)
            std::fill(&clutter.at(x0, y), &clutter.at(x0, y) + (x1 - x0), code);
    }
    expect_none(tracker.track_first(clutter), "among rectangles", clutter);
}

// ---- Sizes and layouts -----------------------------------------------------------------------------

void sizes(Context &context) {
    struct Size {
        std::uint32_t width, height;
    };
    const std::vector<Print> prints = prints_of(context);
    for (const Size &size :
         {Size{1, 1}, {2, 3}, {7, 7}, {8, 8}, {13, 12}, {1, 300}, {300, 1}, {33, 9}, {16, 16}, {65, 47}}) {
        Tracker tracker(context);
        const arhost_status status = tracker.try_start(pinhole(size.width, size.height, 100), listed(prints));
        if (status == ARHOST_STATUS_ERROR_UNSUPPORTED || status == ARHOST_STATUS_ERROR_CONFIGURATION)
            continue;
        tracker.instance().expect_ok(fmt::format("for frames of {}×{}, start", size.width, size.height).c_str(),
                                     status);
        for (const bool flat : {true, false}) {
            const Grey image = filled(size.width, size.height, [&](auto, auto) {
                return flat ? 0 : static_cast<int>(context.random() & 255);
            });
            expect_none(tracker.track_first(image),
                        fmt::format("in {} of {}×{}", flat ? "black" : "noise", size.width, size.height), image);
        }
    }
}

void stride(Context &context) {
    // Rows of 331 px are 384 bytes apart.
    const arhost_intrinsics camera = camera_for(context, 331, 247, 300);
    const Placed marker{prints_of(context).front(), side_mm, tilted({15, 10, -240}, 30, 70, 30)};
    const Grey image = draw(camera, marker);
    Tracker tracker(context);
    tracker.start(camera, {{marker.print.id, side_mm}});
    for (const std::uint64_t filler : {1, 2}) {
        const arhost_observation found =
            expect_one(tracker.track_first(SealedFrame(image, ARHOST_PIXEL_FORMAT_GREY8, filler)), marker.print.id,
                       "with padding between rows", image);
        expect_corners(found, camera, marker, roughly, "with padding between rows", image);
    }
}

void formats(Context &context) {
    const std::pair<const char *, arhost_pixel_format> formats[] = {{"RGB8", ARHOST_PIXEL_FORMAT_RGB8},
                                                                    {"BGR8", ARHOST_PIXEL_FORMAT_BGR8},
                                                                    {"YUYV", ARHOST_PIXEL_FORMAT_YUYV},
                                                                    {"NV12", ARHOST_PIXEL_FORMAT_NV12},
                                                                    {"I420", ARHOST_PIXEL_FORMAT_I420}};
    const Placed marker{prints_of(context).front(), side_mm, tilted({15, 10, -240}, 30, 70, 30)};
    const Grey image = draw(wide_camera(context), marker);
    for (const auto &[name, format] : formats) {
        Tracker tracker(context);
        tracker.start(wide_camera(context), {{marker.print.id, side_mm}}, format);
        const std::string where = fmt::format("in a frame of {}", name);
        const arhost_observation found =
            expect_one(tracker.track_first(SealedFrame(image, format)), marker.print.id, where, image);
        expect_corners(found, wide_camera(context), marker, roughly, where, image);
    }
}

constexpr const char *gate = "tracker.track", *corner_gate = "tracker.corners";
constexpr Test tests[] = {
    {"tracker.blur",
     "A marker blurred by 1.5 px is detected; its corners give a pose accurate to 3° and 2 % of the distance.",
     corner_gate, 20s, blur},
    {"tracker.noise",
     "A marker in Gaussian noise (σ = 7 grey levels) is detected; the pose is accurate to 3° and 2 % of the "
     "distance.",
     corner_gate, 20s, noise},
    {"tracker.exposure",
     "A marker is detected with a correct pose in the dark, overexposed, behind haze and lit from the side.",
     corner_gate, 20s, exposure},
    {"tracker.occlusion", "A marker with a hidden corner is missed, or detected to 5° and 3 % of the distance.",
     corner_gate, 20s, occlusion},
    {"tracker.recall",
     "In at least 19 of 20 random views, a marker 50 to 140 px wide is detected, always at the correct position.",
     corner_gate, 30s, recall},
    {"tracker.follows",
     "In each frame, also with state, a marker that moves, jumps, leaves and returns is observed where it is.",
     corner_gate, 20s, follows},
    {"tracker.several",
     "Several markers are observed, each once with its id and its corners; their order in the list does not matter.",
     corner_gate, 20s, several},
    {"tracker.expected",
     "If only some places have to be searched, the markers that are expected there are found, and those that have "
     "left are not reported.",
     corner_gate, 20s, expected_places},
    {"tracker.families", "Markers of two families are told apart, also with the same id.", corner_gate, 20s,
     families},
    {"tracker.unlisted", "Markers that no target lists are left out, or reported with their ids and corners.",
     corner_gate, 20s, unlisted},
    {"tracker.copies", "All copies of a marker are observed, each once.", corner_gate, 20s, copies},
    {"tracker.mirrored", "A mirrored marker is not detected.", gate, 20s, mirrored},
    {"tracker.no-marker", "Nothing is detected in uniform, noisy and cluttered frames without markers.", gate, 20s,
     no_marker},
    {"tracker.sizes",
     "Images of one pixel, one row, one column and other small sizes are rejected, or nothing is detected.", gate,
     20s, sizes},
    {"tracker.stride", "Padding between rows is ignored.", corner_gate, 20s, stride},
    {"tracker.formats", "In colour formats, it reads the separate grey plane.", corner_gate, 20s, formats},
};

} // namespace

std::span<const Test> tracker_image_tests() {
    return tests;
}

} // namespace arhost::conformance
