// SPDX-License-Identifier: Apache-2.0
#include <arhost-cpp/numbered_name.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

using arhost::NumberedName;

TEST(NumberedName, FormatsTheNumber) {
    EXPECT_EQ(NumberedName("frame_%05d.png").name(7), "frame_00007.png");
    EXPECT_EQ(NumberedName("frame_%05d.png").name(1234567), "frame_1234567.png");
    EXPECT_EQ(NumberedName("%d.jpg").name(0), "0.jpg");
    EXPECT_EQ(NumberedName("%020d").name(18446744073709551615u), "18446744073709551615");
}

TEST(NumberedName, TwoPercentSignsAreOne) {
    EXPECT_EQ(NumberedName("100%%_%d_50%%.png").name(3), "100%_3_50%.png");
}

TEST(NumberedName, ReadsBackEveryNameThatItFormats) {
    for (const char *text : {"%d", "f_%03d.png", "frame_%010d.png", "50%%_%020d"})
        for (const std::uint64_t number :
             {std::uint64_t(0), std::uint64_t(7), std::uint64_t(1234567), ~std::uint64_t(0)})
            EXPECT_EQ(NumberedName(text).number(NumberedName(text).name(number)), number) << text;
}

TEST(NumberedName, RejectsOtherNames) {
    const NumberedName pattern("f_%03d.png");
    EXPECT_EQ(pattern.number("f_007.png"), 7u);
    EXPECT_EQ(pattern.number("f_1234.png"), 1234u);
    for (const char *other : {"f_07.png", "f_0007.png", "f_.png", "f_0x7.png", "f_-07.png", "g_007.png", "f_007.jpg",
                              "f_007.png.partial", ".f_007.png", "f_99999999999999999999999.png", "", "f_007"})
        EXPECT_FALSE(pattern.number(other)) << other;
}

class InvalidNumberedName : public testing::TestWithParam<const char *> {};

TEST_P(InvalidNumberedName, IsRejectedWithTheCorrectSyntax) {
    try {
        const NumberedName pattern(GetParam());
        FAIL() << "nothing was thrown";
    } catch (const std::invalid_argument &error) {
        EXPECT_THAT(error.what(), testing::HasSubstr(GetParam()));
        EXPECT_THAT(error.what(), testing::HasSubstr("%05d"));
    }
}

INSTANTIATE_TEST_SUITE_P(All, InvalidNumberedName,
                         testing::Values("", "plain.png", "%d_%d.png", "%s.png", "%n.png", "%5d.png", "%0d.png",
                                         "%00d.png", "%-5d.png", "%.5d.png", "%ld.png", "%05i.png", "%05", "%", "a%",
                                         "100%%.png", "%021d.png", "%0999999999999999999999d.png", "%05x.png",
                                         "%*d.png", "%1$d.png"));
