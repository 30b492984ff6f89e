// SPDX-License-Identifier: Apache-2.0
#include "run_config/schema.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <fstream>
#include <set>
#include <sstream>

using namespace arhost::run_config;

namespace {

std::string document(const std::string &name) {
    std::ifstream stream(arhost::test::source_directory() + "/docs/" + name);
    std::ostringstream text;
    text << stream.rdbuf();
    return text.str();
}

} // namespace

TEST(Schema, MatchesTheDocumentation) {
    EXPECT_THAT(document("config.md"), testing::HasSubstr(schema_as_markdown()))
        << "docs/config.md is out of date: replace its table with the output of 'arhost schema --markdown'";
}

TEST(Schema, MatchesTheJsonSchemaFile) {
    EXPECT_EQ(document("arhost.schema.json"), schema_as_json_schema())
        << "docs/arhost.schema.json is out of date: replace it with the output of 'arhost schema'";
}

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
