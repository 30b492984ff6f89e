// SPDX-License-Identifier: Apache-2.0
#include "schema/schema_text.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <fstream>
#include <sstream>

using namespace arhost::schema;

namespace {

std::string document(const std::string &name) {
    std::ifstream stream(arhost::test::source_directory() + "/docs/" + name);
    std::ostringstream text;
    text << stream.rdbuf();
    return text.str();
}

} // namespace

TEST(Schema, MatchesTheDocumentation) {
    EXPECT_THAT(document("config.md"), testing::HasSubstr(as_markdown()))
        << "docs/config.md is out of date: replace its table with the output of 'arhost schema --markdown'";
}

TEST(Schema, MatchesTheJsonSchemaFile) {
    EXPECT_EQ(document("arhost.schema.json"), as_json_schema())
        << "docs/arhost.schema.json is out of date: replace it with the output of 'arhost schema'";
}
