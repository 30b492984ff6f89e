// SPDX-License-Identifier: Apache-2.0
#include "model/plugin_description.hpp"

#include <gtest/gtest.h>

using namespace arhost::model;

TEST(Counters, HaveShortPlainNamesAndALimitedNumber) {
    EXPECT_TRUE(are_valid({}));
    EXPECT_TRUE(are_valid({{"lost_by_driver", 1}, {std::string(ARHOST_MAX_COUNTER_NAME, 'x'), 2}}));
    for (const char *name : {"", "Lost", "lost frames", "lost\n", "\xc3\xa9"})
        EXPECT_FALSE(are_valid({{name, 1}})) << name;
    EXPECT_FALSE(are_valid({{std::string(ARHOST_MAX_COUNTER_NAME + 1, 'x'), 1}}));
    Counters many;
    for (int i = 0; i <= ARHOST_MAX_COUNTERS; ++i)
        many["c" + std::to_string(i)] = 0;
    EXPECT_FALSE(are_valid(many));
}

TEST(PluginIds, HaveThePartsOfADomainAndEndWithTheNameOfTheFile) {
    for (const char *file : {"/a/rt.so", "librt.so"})
        EXPECT_EQ(problem_with_id("org.example-1.rt", file), "");
    for (const char *id :
         {"", "rt", "org.rt", "org..rt", ".org.rt", "org.example.", "org.exa mple.rt", "org.\xc3\xa9.rt"})
        EXPECT_NE(problem_with_id(id, "rt.so").find("must begin with a domain"), std::string::npos) << id;
    EXPECT_EQ(problem_with_id("org.example.other", "rt.so"),
              "its id is 'org.example.other'; rename the file to match");
}
