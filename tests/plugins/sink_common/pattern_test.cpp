// SPDX-License-Identifier: Apache-2.0
#include "sink_common/pattern.hpp"

#include <arhost-cpp/plugin.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

using arhost::files::FramePattern;

namespace {

std::string file(const std::string &pattern, std::uint64_t number) {
    return FramePattern::parse(pattern).value().file(number).string();
}

} // namespace

TEST(FramePattern, PutsTheNumberIntoTheName) {
    EXPECT_EQ(file("out/frame_%05d.png", 7), "out/frame_00007.png");
    EXPECT_EQ(file("out/frame_%05d.png", 1234567), "out/frame_1234567.png");
    EXPECT_EQ(file("%d.jpg", 0), "0.jpg");
    EXPECT_EQ(file("/a/%020d", 18446744073709551615u), "/a/18446744073709551615");
}

TEST(FramePattern, TwoPercentSignsAreOne) {
    EXPECT_EQ(file("100%%_%d_50%%.png", 3), "100%_3_50%.png");
}

TEST(FramePattern, ANameWithoutPercentSignIsPlain) {
    EXPECT_FALSE(FramePattern::parse("out/demo.png"));
    EXPECT_FALSE(FramePattern::parse("50%_%d/demo.png")); // folders are taken as they are
}

TEST(FramePattern, FoldersAreTakenAsTheyAre) {
    EXPECT_EQ(file("50%/%d.png", 1), "50%/1.png");
}

class BadPattern : public testing::TestWithParam<const char *> {};

TEST_P(BadPattern, IsRefusedWithTheWayToWriteIt) {
    try {
        FramePattern::parse(GetParam());
        FAIL() << "nothing was thrown";
    } catch (const arhost::Failure &failure) {
        EXPECT_EQ(failure.status(), ARHOST_STATUS_ERROR_CONFIGURATION);
        EXPECT_THAT(failure.what(), testing::HasSubstr(GetParam()));
        EXPECT_THAT(failure.what(), testing::HasSubstr("%05d"));
    }
}

INSTANTIATE_TEST_SUITE_P(All, BadPattern,
                         testing::Values("%d_%d.png", "%s.png", "%n.png", "%5d.png", "%0d.png", "%-5d.png",
                                         "%.5d.png", "%ld.png", "%05i.png", "%05", "%", "a%", "100%%.png",
                                         "%021d.png", "%0999999999999999999999d.png", "%05x.png", "%*d.png",
                                         "%1$d.png"));

TEST(FramePattern, KnowsItsOwnNames) {
    const FramePattern pattern = FramePattern::parse("out/f_%03d.png").value();
    EXPECT_TRUE(pattern.matches("f_007.png"));
    EXPECT_TRUE(pattern.matches("f_1234.png"));
    for (const char *other : {"f_07.png", "f_0007.png", "f_.png", "f_0x7.png", "f_-07.png", "g_007.png", "f_007.jpg",
                              "f_007.png.partial", ".f_007.png", "f_99999999999999999999999.png", "", "f_007"})
        EXPECT_FALSE(pattern.matches(other)) << other;
}
