// SPDX-License-Identifier: Apache-2.0
//
// Tests the accuracy of both trackers on a real sequence, with default options.
#include "rbt_sequence.hpp"

#include <gtest/gtest.h>

namespace {

using namespace arhost::test;

TEST(RbtSequence, BothTrackersAreAccurateAndAgree) {
    ARHOST_REQUIRE_SHARED_DATA("markers/rbt_sequence");
    const RbtSequence sequence;
    std::map<std::string, RbtSequence::Frames> frames;
    for (const char *plugin : {"tracker_aruco", "tracker_apriltag"}) {
        SCOPED_TRACE(plugin);
        Tracker tracker(plugin);
        frames[plugin] = sequence.run(tracker);
        const auto accuracy = sequence.accuracy(frames[plugin]);
        EXPECT_EQ(accuracy.listed, 336);
        EXPECT_GE(accuracy.found_fraction(), 0.99);
        EXPECT_LE(mean(accuracy.corner_px), 0.3);
        EXPECT_LE(percentile(accuracy.distance, 0.5), 0.01);
        for (const auto &frame : frames[plugin])
            for (const auto &[id, marker] : frame)
                EXPECT_TRUE(std::ranges::binary_search(sequence.ids(), id)) << "found another tag, " << id;
    }
    const auto disagreement_px = RbtSequence::disagreement_px(frames["tracker_aruco"], frames["tracker_apriltag"]);
    EXPECT_GE(disagreement_px.size(), 4 * 330u);
    EXPECT_LE(percentile(disagreement_px, 0.95), 0.5);
}

} // namespace
