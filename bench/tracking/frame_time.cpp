// SPDX-License-Identifier: Apache-2.0
//
// Time of a search of the whole frame by both trackers, in sharp, blurred and overexposed pictures of many tags,
// relative to the bare libraries on the same pictures.
#include "bare_detectors.hpp"

#include "command_line/command_line.hpp"

#include <fiducial/tag_sheet.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <exception>
#include <functional>
#include <limits>
#include <vector>

namespace {

using namespace arhost;

struct Detected {
    std::chrono::nanoseconds spent;
    std::ptrdiff_t found; // tags
};
using Detector = std::function<Detected(const test::GreyFrame &)>;

// Of all threads of this process; other processes on the machine hardly affect it.
std::chrono::nanoseconds cpu_time() {
    timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

template <class Detect, class Tags> Detector timed(Detect detect, Tags tags) {
    return [=](const test::GreyFrame &frame) {
        const auto begin = cpu_time();
        const auto found = detect(frame);
        return Detected{cpu_time() - begin, tags(found)};
    };
}

struct Result {
    double ms = std::numeric_limits<double>::infinity(); // the shortest time
    std::ptrdiff_t found = 0;                            // tags
};

// The detectors take turns, so what else the machine does affects all of them.
template <std::size_t Count>
std::array<Result, Count> measure(const test::GreyFrame &frame, const std::array<Detector, Count> &detectors,
                                  int repetitions) {
    std::array<Result, Count> results;
    for (int repetition = 0; repetition < repetitions; ++repetition)
        for (std::size_t turn = 0; turn < Count; ++turn) {
            const std::size_t i = (static_cast<std::size_t>(repetition) + turn) % Count;
            const Detected detected = detectors[i](frame);
            results[i].ms = std::min(results[i].ms, 1e-6 * static_cast<double>(detected.spent.count()));
            results[i].found = detected.found;
        }
    return results;
}

} // namespace

int main(int argc, char **argv) try {
    bool is_quick = false;
    arhost::command_line::CommandLine line("Measures the time of the trackers in pictures of many tags.");
    line.flag("--quick", is_quick, "Measure with fewer repetitions; the figures are less precise");
    if (const auto status = line.parse(argc, argv))
        return *status;
    constexpr double max_ratio = 3, max_sheet_ratio = 2;
    bool met = true;
    std::printf("search of the whole frame, tags of 40 px; time relative to the bare library\n"
                "%-10s %5s %-12s %9s %9s %7s %7s %7s\n",
                "tracker", "tags", "picture", "bare ms", "ms", "ratio", "bare", "found");
    for (const test::TagSheet &sheet : {test::few_tags, test::many_tags}) {
        const arhost_intrinsics camera = test::plain_camera(sheet.size);
        std::vector<test::Listed> listed;
        for (int id = 0; id < sheet.count(); ++id)
            listed.push_back({id});
        const test::Options options{{"closer_look", "false"}}; // as the bare library
        test::Tracker april("tracker_apriltag", options, camera, listed),
            aruco("tracker_aruco", options, camera, listed);
        const bench::BareAprilTag bare_april;
        const bench::BareOpenCv bare_aruco(false);
        const auto size = [](const auto &found) { return std::ssize(found); };
        const auto bare = [&](const auto &detector) {
            return timed([&](const test::GreyFrame &frame) { return detector(frame); }, size);
        };
        const auto plugin = [&](test::Tracker &tracker) {
            return timed([&](const test::GreyFrame &frame) { return tracker.track(frame); }, size);
        };
        const std::array detectors = {bare(bare_april), plugin(april), bare(bare_aruco), plugin(aruco)};
        for (const test::Exposure &exposure : test::exposures) {
            const auto results = measure(sheet.frame(exposure), detectors, is_quick ? 3 : 15);
            for (const std::size_t i : {std::size_t{0}, std::size_t{2}}) {
                const Result &alone = results[i], &tracker = results[i + 1];
                const double ratio = tracker.ms / alone.ms;
                std::printf("%-10s %5d %-12s %9.2f %9.2f %7.2f %7td %7td\n", i == 0 ? "apriltag" : "aruco",
                            sheet.count(), exposure.name, alone.ms, tracker.ms, ratio, alone.found, tracker.found);
                std::fflush(stdout);
                met = met && ratio <= (sheet.count() > test::few_tags.count() ? max_sheet_ratio : max_ratio) &&
                      tracker.found >= alone.found;
            }
        }
    }
    std::printf("Targets: ratios of 3, and of 2 for the sheet; as many tags as the bare library\n");
    return met ? 0 : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "frame-time: %s\n", error.what());
    return 1;
}
