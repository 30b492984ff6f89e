// SPDX-License-Identifier: Apache-2.0
#include "yaml/yaml.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

using arhost::yaml::Error;
using arhost::yaml::Node;
using testing::HasSubstr;

namespace {

template <class Call> std::string error_of(Call &&call) {
    try {
        call();
    } catch (const Error &error) {
        return error.what();
    }
    return "no error";
}

Node sample() {
    return Node::parse("mode: lockstep\ntracker:\n  side_mm: -3\n  ids: [1, x]\noutputs: [{path: a.mp4}]\n",
                       "lab.yaml");
}

} // namespace

TEST(Yaml, NamesFileLineColumnAndKeyOfAWrongValue) {
    EXPECT_EQ(error_of([] { sample().require("tracker").require("side_mm").real(0); }),
              "lab.yaml:3:12: tracker.side_mm: must be at least 0, is -3");
    EXPECT_EQ(error_of([] { sample().require("tracker").require("ids").reals(); }),
              "lab.yaml:4:12: tracker.ids[1]: must be a number, is 'x'");
}

TEST(Yaml, NamesTheNearestKeyForAnUnknownOne) {
    const Node node = Node::parse("traker: 1\n", "a.yaml");
    EXPECT_EQ(error_of([&] {
                  node.allow_keys({"tracker", "source"});
              }),
              "a.yaml:1:9: traker: unknown key; did you mean 'tracker'?");
    EXPECT_THAT(error_of([&] { node.allow_keys({"source", "mode"}); }), HasSubstr("known here: source, mode"));
}

TEST(Yaml, RefusesAKeyThatStandsTwice) {
    const Node node = Node::parse("mode: live\nmode: lockstep\n", "a.yaml");
    EXPECT_EQ(error_of([&] { node.allow_keys({"mode"}); }),
              "a.yaml:2:7: mode: the key stands here twice; keep one of them");
}

TEST(Yaml, SaysWhereTheSyntaxIsWrong) {
    EXPECT_THAT(error_of([] { Node::parse("a: [1, 2\nb: 3\n", "a.yaml"); }),
                testing::MatchesRegex("a.yaml:[0-9]+:[0-9]+: YAML syntax: .*"));
}

TEST(Yaml, SaysWhereASecondDocumentBegins) {
    EXPECT_THAT(error_of([] { Node::parse("a: 1\n---\nb: 2\n", "a.yaml"); }),
                HasSubstr("a.yaml:2:1: another YAML document begins here; keep one"));
    // What is no document, though it does not end the one before it.
    EXPECT_THAT(error_of([] { Node::parse("[1, 2], 3\n", "a.yaml"); }), HasSubstr("a.yaml:1:7: another"));
    EXPECT_THAT(error_of([] { Node::parse(",", "a.yaml"); }), HasSubstr("a.yaml:1:1: another"));
}

TEST(Yaml, SaysWhyAFileCantBeRead) {
    EXPECT_EQ(error_of([] { Node::load("/no/such.yaml"); }),
              "/no/such.yaml: can't be read: No such file or directory");
    EXPECT_EQ(error_of([] { Node::load("/tmp"); }), "/tmp: is a folder, not a YAML file");
}

TEST(Yaml, OverridesValuesFromTheCommandLine) {
    Node node = sample();
    node.override_value("tracker.side_mm", "95.5");
    node.override_value("outputs[0].path", "b.mp4");
    node.override_value("raytracer.options.samples", "4");
    EXPECT_EQ(node.require("tracker").require("side_mm").real(), 95.5);
    EXPECT_EQ(node.require("outputs").items()[0].require("path").text(), "b.mp4");
    EXPECT_EQ(node.require("raytracer").require("options").require("samples").integer(), 4);
    EXPECT_EQ(error_of([&] { node.require("raytracer").require("options").require("samples").integer(8, 16); }),
              "--set: raytracer.options.samples: must be 8 to 16, is 4");
    EXPECT_THAT(error_of([&] { node.override_value("mode.x", "1"); }), HasSubstr("plain value above 'x'"));
    EXPECT_THAT(error_of([&] { node.override_value("outputs[7].path", "1"); }), HasSubstr("no index of a list of 1"));
}

TEST(Yaml, NamesTheOptionThatOverrodeAValue) {
    Node node = Node::parse("outputs: [{path: a}]\n", "lab.yaml");
    node.override_value("outputs", "[{path: b, fps: 3}]", "--output");
    node.override_text("outputs[0].path", "c: [d]", "--path");
    const Node output = node.require("outputs").items()[0];
    EXPECT_EQ(output.require("path").text(), "c: [d]");
    EXPECT_EQ(error_of([&] { output.require("path").integer(); }),
              "--path: outputs[0].path: must be a whole number, is 'c: [d]'");
    EXPECT_EQ(error_of([&] { output.require("fps").integer(4, 5); }),
              "--output: outputs[0].fps: must be 4 to 5, is 3");
}

TEST(Yaml, ReadsPathsAgainstTheFileTheyStandIn) {
    const Node node = Node::parse("mesh: ../meshes/a.obj\n", "/data/scenes/x.yaml");
    EXPECT_EQ(node.require("mesh").input_path(), "/data/meshes/a.obj");
}

TEST(Yaml, RefusesNumbersThatAreNotFinite) {
    const Node node = Node::parse("a: .nan\nb: 1e999\nc: inf\nd: +2.5\n", "a.yaml");
    for (const char *key : {"a", "b", "c"})
        EXPECT_THAT(error_of([&] { node.require(key).real(); }), HasSubstr("must be a number")) << key;
    EXPECT_EQ(node.require("d").real(), 2.5);
}

TEST(Yaml, AssigningANodeLeavesTheDocumentAsItIs) {
    const Node root = sample();
    Node node = root.require("mode");
    node = root.require("tracker").require("side_mm");
    EXPECT_EQ(node.text(), "-3");
    EXPECT_EQ(root.require("mode").text(), "lockstep");
}
