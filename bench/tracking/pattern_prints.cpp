// SPDX-License-Identifier: Apache-2.0
//
// Which patterns tracker_pattern reports for rendered prints of hiro and kanji, and the errors of their corners.
#include "command_line/command_line.hpp"

#include <tracker_pattern/printed_patterns.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <random>
#include <stdexcept>

int main(int argc, char **argv) try {
    using namespace arhost::test;
    bool is_quick = false;
    arhost::command_line::CommandLine line("Counts confusions of patterns.");
    line.flag("--quick", is_quick, "Measure with fewer frames; the figures are less precise");
    if (const auto status = line.parse(argc, argv))
        return *status;
    const int views = is_quick ? 20 : 200;
    if (!std::filesystem::exists(shared_data("markers/artoolkit"))) {
        std::printf("pattern-prints is skipped: the patterns are missing (%s)\n",
                    shared_data("markers/artoolkit").string().c_str());
        return 0;
    }
    Tracker tracker("tracker_pattern");
    if (tracker.start(camera, both()) != ARHOST_STATUS_OK)
        throw std::runtime_error(tracker.log());
    constexpr double max_error_px = 0.2;
    const std::array names = {"hiro", "kanji"};
    std::mt19937 random(1);
    bool is_met = true;
    std::printf("%d pictures of both patterns for each tilt: how often each is reported, and errors of corners\n%8s",
                views, "tilt");
    for (const char *shown : names)
        for (const char *reported : names)
            std::printf("  %5s as %5s", shown, reported);
    std::printf("  missed  RMS, px  max, px\n");
    for (const double tilt : {0.0, 15.0, 30.0, 45.0, 60.0}) {
        std::array<std::array<int, 2>, 2> reported{}; // [shown][reported]
        double squares = 0, max_px = 0;
        int corners = 0;
        for (int view = 0; view < views; ++view) {
            const std::vector<Placed> placed = side_by_side(tilt, view % 2 == 0, random);
            const GreyFrame frame(picture_of(placed, static_cast<std::uint64_t>(view) + 1));
            for (const arhost_observation &seen : tracker.track(frame))
                for (std::size_t shown = 0; shown < names.size(); ++shown) {
                    const auto truth = corners_of(placed[shown].mt, camera, placed[shown].side_mm);
                    constexpr double near_px = 10;
                    if (corner_distance_px(seen, 0, truth[0]) > near_px)
                        continue;
                    ++reported.at(shown).at(static_cast<std::size_t>(seen.id));
                    for (int k = 0; k < 4; ++k, ++corners) {
                        const double error_px = corner_distance_px(seen, k, truth[static_cast<std::size_t>(k)]);
                        squares += error_px * error_px;
                        max_px = std::max(max_px, error_px);
                    }
                }
        }
        const int missed = 2 * views - reported[0][0] - reported[0][1] - reported[1][0] - reported[1][1];
        std::printf("%7g°  %14d  %14d  %14d  %14d  %6d  %7.3f  %7.3f\n", tilt, reported[0][0], reported[0][1],
                    reported[1][0], reported[1][1], missed, std::sqrt(squares / corners), max_px);
        is_met &= missed == 0 && reported[0][1] == 0 && reported[1][0] == 0 && max_px <= max_error_px;
    }
    std::printf("target: no confusion, all found, corners %g px: %s\n", max_error_px, is_met ? "met" : "MISSED");
    return is_met ? 0 : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "pattern-prints: %s\n", error.what());
    return 1;
}
