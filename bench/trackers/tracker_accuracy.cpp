// SPDX-License-Identifier: Apache-2.0
//
// Prints the accuracy and speed of both trackers on a real sequence. The arguments are options of the two plugins:
//   tracker-accuracy [aruco:key=value …] [apriltag:key=value …]
#include "tracker_options.hpp"

#include <fiducial/rbt_sequence.hpp>

#include <cstdio>
#include <exception>
#include <string>

namespace {

using namespace arhost::test;

struct Measurement {
    RbtSequence::Frames frames;
    bool passed; // found at least 99 % of the tags; mean corner error <= 0.3 px; median distance error <= 1 %
};

Measurement measure(const RbtSequence &sequence, const std::string &plugin, const Options &options) {
    Tracker tracker(plugin, options);
    if (tracker.created() != ARHOST_STATUS_OK)
        throw std::runtime_error(plugin + ": " + tracker.log());
    std::vector<double> ms;
    const auto frames = sequence.run(tracker, &ms);
    const auto accuracy = sequence.accuracy(frames);
    std::printf("%-18s %6.2f %% (%d of %d) %8.3f %8.3f %10.3f %% %8.2f\n", plugin.c_str(),
                100 * accuracy.found_fraction(), accuracy.found, accuracy.listed, mean(accuracy.corner_px),
                percentile(accuracy.corner_px, 0.95), 100 * percentile(accuracy.distance, 0.5), percentile(ms, 0.5));
    return {frames, accuracy.found_fraction() >= 0.99 && mean(accuracy.corner_px) <= 0.3 &&
                        percentile(accuracy.distance, 0.5) <= 0.01};
}

} // namespace

int main(int argc, char **argv) try {
    auto options = options_of_both(argc, argv);
    const auto folder = shared_data("markers/rbt_sequence");
    if (!std::filesystem::exists(folder)) {
        std::printf("skipped: the folder %s is missing (set ARHOST_SHARED_DATA)\n", folder.c_str());
        return 0;
    }
    const RbtSequence sequence;
    std::printf("rbt_sequence: 40 frames 640x480, tag36h11 of 95.5 mm\n%-18s %23s %8s %8s %12s %8s\n", "tracker",
                "found", "px mean", "px p95", "dist. p50", "ms p50");
    const auto a = measure(sequence, "tracker_aruco", options["aruco"]);
    const auto b = measure(sequence, "tracker_apriltag", options["apriltag"]);
    const double disagreement = percentile(RbtSequence::disagreement_px(a.frames, b.frames), 0.95);
    std::printf("distance between corresponding corners of the two trackers: p95 %.3f px\n", disagreement);
    return a.passed && b.passed && disagreement <= 0.5 ? 0 : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "tracker-accuracy: %s\n", error.what());
    return 1;
}
