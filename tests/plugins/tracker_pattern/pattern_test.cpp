// SPDX-License-Identifier: Apache-2.0
#include "failure_of.hpp"
#include "plugin_under_test.hpp"

#include <tracker_pattern/pattern.hpp>

#include <gmock/gmock.h>

#include <fstream>

namespace {

using testing::HasSubstr;
using tracker_pattern::normalized;
using tracker_pattern::Pattern;
using tracker_pattern::Samples;

// A pattern file of 4 × 4 whose upright picture has this first row, in all colours and orientations.
std::string pattern_text(const std::string &first_row) {
    std::string text;
    for (int i = 0; i < 4 * 3; ++i)
        text += first_row + "\n 200 200 200 200\n 200 200 200 200\n 200 200 200 200\n\n";
    return text;
}

class PatternFile : public testing::Test {
protected:
    std::string write(const std::string &text) const {
        const std::string path = (folder_.path() / "a.patt").string();
        std::ofstream(path, std::ios::binary) << text;
        return path;
    }
    std::string error_in(const std::string &text) const {
        const auto [status, message] = arhost::test::failure_of([&] { Pattern pattern(write(text)); });
        EXPECT_EQ(status, ARHOST_STATUS_ERROR_CONFIGURATION);
        return message;
    }
    arhost::test::ScratchFolder folder_;
};

TEST_F(PatternFile, MatchesItsPictureInEveryOrientation) {
    const Pattern pattern(write(pattern_text("10 10 200 200")));
    EXPECT_EQ(pattern.side(), 4);
    Samples picture(4, 4, 200.0F);
    picture(0, 0) = picture(0, 1) = 10;
    for (int turns = 0; turns < 4; ++turns) {
        const auto match = pattern.match(normalized(picture));
        EXPECT_NEAR(match.correlation, 1, 1e-6);
        EXPECT_EQ(match.quarter_turns, turns);
        Samples next;
        cv::rotate(picture, next, cv::ROTATE_90_CLOCKWISE);
        picture = next;
    }
    Samples other(4, 4, 200.0F);
    other(1, 1) = other(2, 2) = 10;
    EXPECT_LT(pattern.match(normalized(other)).correlation, 0.5);
}

TEST_F(PatternFile, UniformSamplesAreNoPicture) {
    EXPECT_TRUE(normalized(Samples(4, 4, 77.0F)).empty());
}

TEST_F(PatternFile, RejectsFilesThatAreNoPatterns) {
    EXPECT_THAT(error_in(""), HasSubstr("a.patt' is not a pattern of ARToolKit: it has 0 numbers"));
    const std::string whole = pattern_text("10 10 200 200");
    EXPECT_THAT(error_in(whole.substr(0, whole.size() - 60)),
                AllOf(HasSubstr("is not a pattern of ARToolKit: it has "), HasSubstr("cut short, copy it again")));
    EXPECT_THAT(error_in("1 2 3\n4 x 6\n"), HasSubstr("line 2 has something other than numbers from 0 to 255"));
    EXPECT_THAT(error_in(pattern_text("256 1 1 1")), HasSubstr("line 1 has something other"));
    EXPECT_THAT(error_in(pattern_text("-1 1 1 1")), HasSubstr("line 1 has something other"));
    EXPECT_THAT(error_in(pattern_text("200 200 200 200")), HasSubstr("has an almost uniform picture"));
    EXPECT_THAT(error_in(std::string(3'000'000, ' ')), HasSubstr("is too large"));
    EXPECT_THAT(error_in(std::string(1000, '\0')), HasSubstr("line 1 has something other"));
    EXPECT_THROW(Pattern("/nowhere/a.patt"), arhost::Failure);
}

} // namespace
