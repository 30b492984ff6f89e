// SPDX-License-Identifier: Apache-2.0
#include "model/target.hpp"

#include <gtest/gtest.h>

using namespace arhost::model;

TEST(Targets, NameEachFamilyOnce) {
    const std::vector<Target> targets = {{"a", {{1, "DICT_4X4_50", {}}, {2, "tag36h11", {}}}, ""},
                                         {"b", {}, "body"},
                                         {"c", {{1, "tag36h11", {}}, {3, "DICT_5X5_50", {}}}, ""}};
    EXPECT_EQ(families_of(targets), (std::vector<std::string>{"DICT_4X4_50", "tag36h11", "DICT_5X5_50"}));
    EXPECT_TRUE(families_of({}).empty());
}
