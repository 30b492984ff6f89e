// SPDX-License-Identifier: Apache-2.0
#include "run_config/schema.hpp"

#include <gmock/gmock.h>

#include <set>

using namespace arhost::run_config;

TEST(Schema, ListsEachKeyOnceUnderAListedParent) {
    std::set<std::string> seen;
    for (const Key &key : schema()) {
        EXPECT_TRUE(seen.insert(std::string(key.path)).second) << key.path;
        const std::string path(key.path);
        const std::size_t dot = path.rfind('.');
        if (dot == std::string::npos)
            continue;
        std::string parent = path.substr(0, dot);
        if (parent.ends_with("[]"))
            parent.resize(parent.size() - 2);
        EXPECT_TRUE(seen.contains(parent)) << key.path;
    }
    EXPECT_THAT(keys_of("tracker.targets[]"),
                testing::ElementsAre("name", "marker", "ids", "family", "dictionary", "side_mm", "map", "pattern",
                                     "pattern_ratio", "image", "width_mm", "body"));
}
