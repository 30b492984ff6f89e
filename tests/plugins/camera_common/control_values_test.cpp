// SPDX-License-Identifier: Apache-2.0
#include "camera_common/control_values.hpp"

#include <gtest/gtest.h>

using namespace arhost;

TEST(ControlValues, IntegersAreWithinTheirRangeAndStep) {
    const ControlValues values{ControlKind::integer, -10, 20, 0, 5, {}};
    EXPECT_EQ(parse_value(values, "-10"), -10);
    EXPECT_EQ(parse_value(values, "15"), 15);
    for (const char *text : {"", "-11", "21", "14", "5x", "0x5", "5.0", "true", "99999999999999999999"})
        EXPECT_FALSE(parse_value(values, text)) << text;
    EXPECT_EQ(describe_values(values), "-10 to 20 in steps of 5");
    EXPECT_EQ(describe_values({ControlKind::integer, 0, 255, 0, 1, {}}), "0 to 255");
}

TEST(ControlValues, MenusAcceptNumbersAndNamesOfTheirItems) {
    const ControlValues values{ControlKind::menu, 0, 3, 0, 1, {{1, "manual_mode"}, {3, "aperture_priority_mode"}}};
    EXPECT_EQ(parse_value(values, "manual_mode"), 1);
    EXPECT_EQ(parse_value(values, "3"), 3);
    EXPECT_FALSE(parse_value(values, "2")) << "not an item, although it is in the range";
    EXPECT_FALSE(parse_value(values, "auto_mode"));
    EXPECT_EQ(describe_values(values), "1 (manual_mode), 3 (aperture_priority_mode)");
}

TEST(ControlValues, BooleansAcceptWordsAndNumbers) {
    const ControlValues values{ControlKind::boolean, 0, 1, 0, 1, {}};
    EXPECT_EQ(parse_value(values, "true"), 1);
    EXPECT_EQ(parse_value(values, "false"), 0);
    EXPECT_EQ(parse_value(values, "1"), 1);
    EXPECT_FALSE(parse_value(values, "2"));
    EXPECT_FALSE(parse_value(values, "yes"));
    EXPECT_EQ(describe_values(values), "true or false");
}

TEST(ControlValues, ListsAreSplitAtCommas) {
    const auto settings = split_settings(" gain = 20,auto_exposure=manual_mode , broken,=3, a=b=c ,");
    ASSERT_EQ(settings.size(), 5u);
    EXPECT_EQ(settings[0].name, "gain");
    EXPECT_EQ(settings[0].value, "20");
    EXPECT_EQ(settings[1].value, "manual_mode");
    EXPECT_EQ(settings[2].text, "broken");
    EXPECT_FALSE(settings[2].value);
    EXPECT_EQ(settings[3].name, "");
    EXPECT_EQ(settings[4].value, "b=c");
    EXPECT_TRUE(split_settings("  ").empty());
}
