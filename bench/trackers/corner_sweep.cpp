// SPDX-License-Identifier: Apache-2.0
//
// Prints what both trackers find of rendered tags of many sizes, with blur, noise and low exposure, with and without
// arhost's refinement of the corners. The arguments are options of the two plugins:
//   corner-sweep [aruco:key=value …] [apriltag:key=value …]
#include "tracker_options.hpp"

#include <fiducial/rbt_sequence.hpp>
#include <fiducial/tag_pictures.hpp>

#include <cstdio>

namespace {

using namespace arhost::test;

constexpr int tags = 112; // at least, for each row of the table

std::vector<Conditions> all_conditions() {
    std::vector<Conditions> all;
    for (const double side_px : {8, 10, 13, 16, 20, 28, 40, 60})
        all.push_back({"sharp", side_px});
    for (const double side_px : {13, 20, 28, 40, 60})
        all.push_back({"noisy", side_px, 0, 1, 10});
    for (const double side_px : {16, 20, 28, 40, 60})
        all.push_back({"dark", side_px, 0, 0.1, 2});
    for (const double side_px : {20, 28, 40, 60})
        all.push_back({"moved by 3 px", side_px, 3});
    for (const double side_px : {60, 80, 110, 150})
        all.push_back({"moved by 13 px", side_px, 13});
    return all;
}

void print(const char *tracker, const Conditions &conditions, const TagPictures &pictures,
           const TagPictures::Outcome &plain, const TagPictures::Outcome &refined) {
    const auto corner_px = [](const TagPictures::Outcome &outcome, double fraction) {
        return outcome.found ? percentile(outcome.corner_px, fraction) : 0;
    };
    std::printf("%-9s %-15s %6.0f %6d %6d %6d %8d %8d %9.3f %9.3f %9.3f %9.3f\n", tracker, conditions.name,
                conditions.side_px, pictures.shown(), plain.found, refined.found, plain.wrong, refined.wrong,
                corner_px(plain, 0.5), corner_px(refined, 0.5), corner_px(plain, 0.99), corner_px(refined, 0.99));
    std::fflush(stdout);
}

} // namespace

int main(int argc, char **argv) try {
    auto options = options_of_both(argc, argv);
    std::printf("%-9s %-15s %6s %6s %13s %17s %19s %19s\n", "", "", "side", "tags", "found", "wrong pose",
                "corner p50, px", "corner p99, px");
    std::printf("%-9s %-15s %6s %6s %6s %6s %8s %8s %9s %9s %9s %9s\n", "tracker", "pictures", "px", "shown", "none",
                "edges", "none", "edges", "none", "edges", "none", "edges");
    for (const Conditions &conditions : all_conditions()) {
        const TagPictures pictures(conditions, tags);
        for (const char *name : {"aruco", "apriltag"}) {
            const auto outcome = [&](const char *refinement) {
                options[name]["corner_refinement"] = refinement;
                Tracker tracker("tracker_" + std::string(name), options[name]);
                if (tracker.created() != ARHOST_STATUS_OK)
                    throw std::runtime_error(tracker.log());
                return pictures.show_to(tracker);
            };
            const auto plain = outcome("none");
            print(name, conditions, pictures, plain, outcome("edges"));
        }
    }
    return 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "corner-sweep: %s\n", error.what());
    return 1;
}
