// SPDX-License-Identifier: Apache-2.0
#include "errors.hpp"
#include "run_config/options.hpp"

#include <gmock/gmock.h>

using namespace arhost;
using testing::HasSubstr;

namespace {

model::PluginDescription plugin() {
    model::PluginDescription description;
    description.id = "tracker_x";
    description.options = {{"threads", ARHOST_OPTION_INTEGER, "2", 1, 8, {}, "Threads."},
                           {"sigma", ARHOST_OPTION_REAL, "0.5", 0, 0, {}, "Blur in px."},
                           {"refine", ARHOST_OPTION_BOOL, "true", 0, 0, {}, "Refine."},
                           {"family", ARHOST_OPTION_TEXT, "tag36h11", 0, 0, {"tag36h11", "tag25h9"}, "Family."},
                           {"path", ARHOST_OPTION_INPUT_PATH, std::nullopt, 0, 0, {}, "The file."}};
    return description;
}

std::vector<model::OptionValue> resolve(const std::string &yaml, std::vector<std::string> *notes = nullptr,
                                        arhost_kind kind = ARHOST_KIND_TRACKER) {
    const yaml::Node owner = yaml::Node::parse(yaml, "/lab/a.yaml");
    model::PluginDescription description = plugin();
    description.kind = kind;
    std::vector<std::string> ignored;
    return run_config::resolve_options(description, owner.find("options"), owner.find("path"), owner,
                                       notes ? *notes : ignored);
}

std::string option_error(const std::string &yaml) {
    return test::error_of([&] { resolve(yaml); });
}

} // namespace

TEST(Options, UseDefaultsAndGivenValuesInDeclaredOrder) {
    const auto values = resolve("{path: x.png, options: {threads: 4, family: tag25h9}}");
    ASSERT_EQ(values.size(), 5u);
    EXPECT_EQ(values[0].integer, 4);
    EXPECT_EQ(values[1].real, 0.5);
    EXPECT_EQ(values[2].integer, 1);
    EXPECT_EQ(values[3].text, "tag25h9");
    EXPECT_EQ(values[4].text, "/lab/x.png") << "relative to the configuration's folder";
}

TEST(Options, ReportErrorsWithTheirPosition) {
    EXPECT_EQ(option_error("{path: x, options: {threads: 9}}"),
              "/lab/a.yaml:1:30: options.threads: must be 1 to 8, but is 9");
    EXPECT_THAT(option_error("{path: x, options: {family: tag36h12}}"), HasSubstr("did you mean 'tag36h11'?"));
    EXPECT_THAT(option_error("{path: x, options: {family: TAG36H11}}"), HasSubstr("did you mean 'tag36h11'?"));
    EXPECT_THAT(option_error("{path: x, options: {refine: 1}}"), HasSubstr("options.refine: must be true or false"));
    EXPECT_THAT(option_error("{path: x, options: {tread: 1}}"),
                HasSubstr("options.tread: unknown key; did you mean 'threads'?"));
    EXPECT_THAT(option_error("{options: {}}"), HasSubstr("tracker_x needs 'path': The file."));
    EXPECT_THAT(option_error("{path: x, options: {path: y}}"), HasSubstr("remove one of them"));
}

TEST(Options, OfAnotherPluginAreSetAsideWithANote) {
    for (const arhost_kind kind :
         {ARHOST_KIND_SOURCE, ARHOST_KIND_TRACKER, ARHOST_KIND_RAYTRACER, ARHOST_KIND_SINK}) {
        std::vector<std::string> notes;
        const auto values = resolve("{path: x, options: {quad_decimate: 2, threads: 4}}", &notes, kind);
        EXPECT_EQ(values[0].integer, 4);
        EXPECT_THAT(notes,
                    testing::ElementsAre("/lab/a.yaml:1:21: options.quad_decimate: set aside, because tracker_x "
                                         "has no such option"));
    }
}

TEST(Options, AChoiceOfAnotherPluginIsSetAsideWithANote) {
    std::vector<std::string> notes;
    const auto values = resolve("{path: x, options: {family: DICT_4X4_50}}", &notes);
    EXPECT_EQ(values[3].text, "tag36h11") << "the default";
    EXPECT_THAT(notes, testing::ElementsAre("/lab/a.yaml:1:29: options.family: 'DICT_4X4_50' is set aside, because "
                                            "tracker_x has no such choice"));
}
