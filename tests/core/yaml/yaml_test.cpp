// SPDX-License-Identifier: Apache-2.0
#include "yaml/yaml.hpp"

#include "errors.hpp"
#include "plugin_under_test.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

using arhost::test::error_of;
using arhost::yaml::Node;
using testing::HasSubstr;

namespace {

Node sample() {
    return Node::parse("mode: lockstep\ntracker:\n  side_mm: -3\n  ids: [1, x]\noutputs: [{path: a.mp4}]\n",
                       "lab.yaml");
}

} // namespace

TEST(Yaml, ErrorsNameFileLineColumnAndKey) {
    EXPECT_EQ(error_of([] { sample().require("tracker").require("side_mm").real(0); }),
              "lab.yaml:3:12: tracker.side_mm: must be at least 0, but is -3");
    EXPECT_EQ(error_of([] { sample().require("tracker").require("ids").reals(); }),
              "lab.yaml:4:12: tracker.ids[1]: must be a number, but is 'x'");
}

TEST(Yaml, SuggestsTheNearestKeyForAnUnknownOne) {
    const Node node = Node::parse("traker: 1\n", "a.yaml");
    EXPECT_EQ(error_of([&] {
                  node.allow_keys({"tracker", "source"});
              }),
              "a.yaml:1:1: traker: unknown key; did you mean 'tracker'?");
    EXPECT_THAT(error_of([&] { node.allow_keys({"source", "mode"}); }), HasSubstr("known keys: source, mode"));
}

TEST(Yaml, RejectsDuplicateKeys) {
    const Node node = Node::parse("mode: live\nmode: lockstep\n", "a.yaml");
    EXPECT_EQ(error_of([&] { node.allow_keys({"mode"}); }), "a.yaml:2:1: mode: duplicate key; keep one of them");
}

TEST(Yaml, SyntaxErrorsNameTheirPosition) {
    EXPECT_THAT(error_of([] { Node::parse("a: [1, 2\nb: 3\n", "a.yaml"); }),
                testing::MatchesRegex("a.yaml:[0-9]+:[0-9]+: YAML syntax: .*"));
}

TEST(Yaml, HintsAtFrequentSyntaxErrors) {
    const auto error = [](const std::string &text) { return error_of([&] { Node::parse(text, "a.yaml"); }); };
    const std::string tab = " is indented with a tab; use spaces";
    EXPECT_THAT(error("a:\n\tb: 1\n"), testing::EndsWith("; line 2" + tab));
    EXPECT_THAT(error("a:\n  b: 1\n\tc: 2\n"), testing::EndsWith("; line 3" + tab));
    EXPECT_THAT(error("outputs:\n  \t- {plugin: x}\n"), testing::EndsWith("; line 2" + tab));
    const std::string space = "write a space after the colon: ";
    EXPECT_THAT(error("a:\n  width:640\n  height: 480\n"),
                testing::EndsWith("; in line 2, " + space + "'width: 640'"));
    EXPECT_THAT(error("a:\n  - x:1\n    y: 2\n"), testing::EndsWith("; in line 2, " + space + "'x: 1'"));
    const std::string hash = "'#' starts a comment; put the value in quotes: ";
    EXPECT_THAT(error("m: {c: {diffuse: #ff0000}}\nx: 1\ny: 2\n"),
                testing::EndsWith("; in line 1, " + hash + "'#ff0000'"));
    EXPECT_THAT(error("m: [#a, 1]\n"), testing::Not(HasSubstr(hash))) << "no blank precedes this '#'";
    for (const char *other :
         {"a: [1, 2\nb: 3\n", "a: b: c\n", "a: {url: http://x # why\nb: 1\n", "a: 1\n b:\n- c # d\n"})
        EXPECT_THAT(error(other), testing::Not(testing::AnyOf(HasSubstr(tab), HasSubstr(space), HasSubstr(hash))))
            << other;
}

TEST(Yaml, HintsAtAMissingSpaceInValidYaml) {
    EXPECT_EQ(error_of([] {
                  Node::parse("{width:640, height: 480}", "a.yaml").allow_keys({"width", "height"});
              }),
              "a.yaml:1:2: width:640: unknown key; write a space after the colon: 'width: 640'");
    EXPECT_EQ(error_of([] {
                  Node::parse("camera:\n  width:640\n  height:480\n", "a.yaml").require("camera").find("width");
              }),
              "a.yaml:2:3: camera: must be a map of keys; write a space after the colon: 'width: 640'");
    EXPECT_EQ(error_of([] { Node::parse("camera: file.yaml\n", "a.yaml").require("camera").find("width"); }),
              "a.yaml:1:9: camera: must be a map of keys");
}

TEST(Yaml, RejectsLargeFilesAtOnce) {
    const arhost::test::ScratchFolder scratch;
    const std::filesystem::path file = scratch.path() / "large.yaml";
    std::ofstream(file) << "a: 1\n#";
    EXPECT_EQ(Node::load(file).require("a").integer(), 1);
    std::filesystem::resize_file(file, arhost::yaml::max_file_bytes + 1);
    EXPECT_THAT(error_of([&] { Node::load(file); }),
                HasSubstr("large.yaml: is larger than 16 MB, the limit for YAML"));
}

TEST(Yaml, RejectsASecondDocument) {
    EXPECT_THAT(error_of([] { Node::parse("a: 1\n---\nb: 2\n", "a.yaml"); }),
                HasSubstr("a.yaml:2:1: YAML syntax: a second document starts here; the file must contain only one"));
    // Content after the end of a document.
    EXPECT_THAT(error_of([] { Node::parse("[1, 2], 3\n", "a.yaml"); }),
                HasSubstr("a.yaml:1:7: YAML syntax: a second"));
    EXPECT_THAT(error_of([] { Node::parse(",", "a.yaml"); }), HasSubstr("a.yaml:1:1: YAML syntax: a second"));
}

// yaml-cpp accepts the end of the text as the closing quote; all keys after the opening quote would be lost silently.
TEST(Yaml, RejectsUnterminatedQuotes) {
    const auto error = [](const std::string &text) { return error_of([&] { Node::parse(text, "a.yaml"); }); };
    const std::string why = "YAML syntax: this quoted value is not terminated";
    EXPECT_EQ(error("a: 1\nb: \"x\nmode: live\n"), "a.yaml:2:4: " + why);
    EXPECT_EQ(error("a: 1\nb: 'it''s\nmode: live\n"), "a.yaml:2:4: " + why);
    EXPECT_EQ(error("a: \"x\\\"\n"), "a.yaml:1:4: " + why);
    EXPECT_EQ(error("a: &b !!str \"x\n"), "a.yaml:1:13: " + why);
    EXPECT_EQ(error("a: {b: \"x}\n"), "a.yaml:1:8: " + why);
    EXPECT_EQ(error("a: !!str # why\n  \"x\nb: 1\n"), "a.yaml:2:3: " + why);
    EXPECT_EQ(error("a: &b # \"why\"\n  'x\nb: 1\n"), "a.yaml:2:3: " + why);
    EXPECT_EQ(error("a: !\"x\nb: 1\n"), "a.yaml:1:5: " + why);
    EXPECT_EQ(error("\xef\xbb\xbf\xef\xbb\xbf'a: 1\n"), "a.yaml:1:1: " + why);
    EXPECT_EQ(error("\xef\xbb\xbf'a: 1\n"), "a.yaml:1:1: " + why);
    for (const std::string closed : {"a: 'it''s'", "a: \"\\\"\" # \"", "a: it's", "a: ''", "- &b \"\"\n- *b\n",
                                     "a: |\n  \"x\n", "[!!str,x \"y]", "a: !!str # \"\n  x"})
        EXPECT_EQ(error(closed), "no error") << closed;
    EXPECT_THAT(error_of([] { sample().override_value("mode", "'live"); }),
                HasSubstr("--set mode='live: YAML syntax: "));
    EXPECT_THAT(error_of([] { sample().override_value("mode", "'live\n"); }), HasSubstr("this quoted value"));
}

TEST(Yaml, RejectsInvalidUtf8AndControlCharacters) {
    EXPECT_EQ(error_of([] { Node::parse("a: é\nb: caf\xe9\n", "a.yaml"); }),
              "a.yaml:2:1: YAML syntax: this line is not valid UTF-8");
    EXPECT_THAT(error_of([] {
                    Node::parse(std::string("\xff\xfe"
                                            "a\0:\0",
                                            6),
                                "a.yaml");
                }),
                HasSubstr("a.yaml:1:"));
    EXPECT_THAT(error_of([] { sample().override_value("mode", "\xe9"); }), HasSubstr("not valid UTF-8"));
    EXPECT_EQ(error_of([] { Node::parse(std::string("a: 1\nb: x\0y", 11), "a.yaml"); }),
              "a.yaml:2:5: YAML syntax: control characters are not allowed in YAML");
    EXPECT_THAT(error_of([] { Node::parse(std::string("a\0:\0 \0'\0", 8), "a.yaml"); }), HasSubstr("a.yaml:1:2"));
}

TEST(Yaml, PathsBelowTheHomeFolderAreExpandedOnRequest) {
    Node root = Node::parse("a: ~/x/../y\nb: ~user/x\nc: x~/y", "/lab/a.yaml");
    EXPECT_EQ(root.require("a").input_path(), "/lab/~/y") << "content";
    root.expand_home("/home/u");
    EXPECT_EQ(root.require("a").input_path(), "/home/u/y");
    EXPECT_EQ(root.require("a").output_path(), "/home/u/y");
    EXPECT_EQ(root.require("b").input_path(), "/lab/~user/x");
    EXPECT_EQ(root.require("c").input_path(), "/lab/x~/y");
}

TEST(Yaml, RejectsPathsThatAreNotUtf8) {
    EXPECT_THAT(error_of([] { Node::parse("a: b.png", "caf\xe9/lab.yaml").require("a").input_path(); }),
                HasSubstr("/b.png' is not valid UTF-8; rename"));
    Node node = Node::parse("a: b", "a.yaml");
    node.override_text("a", "caf\xe9", "--output");
    EXPECT_THAT(error_of([&] { node.require("a").output_path(); }), HasSubstr("--output: a: the path"));
}

TEST(Yaml, RejectsASecondDocumentOnTheCommandLine) {
    EXPECT_THAT(error_of([] { sample().override_value("mode", "live\n---\nlockstep"); }),
                HasSubstr("a second document starts here"));
}

TEST(Yaml, TruncatesLongValuesInMessages) {
    const std::string error =
        error_of([] { Node::parse("a: " + std::string(3'000'000, 'x'), "a.yaml").require("a").real(); });
    EXPECT_LT(error.size(), 300u);
    EXPECT_THAT(error, HasSubstr("must be a number, but is 'xxx"));
}

TEST(Yaml, ReportsWhyAFileCantBeRead) {
    EXPECT_EQ(error_of([] { Node::load("/no/such.yaml"); }),
              "/no/such.yaml: cannot be read: No such file or directory");
    EXPECT_EQ(error_of([] { Node::load("/tmp"); }), "/tmp: is a folder, not a YAML file");
    EXPECT_EQ(error_of([] { Node::load("/proc/self/mem"); }), "/proc/self/mem: cannot be read: Input/output error");
    EXPECT_THAT(error_of([] { Node::load("caf\xe9/lab.yaml"); }), HasSubstr("path is not valid UTF-8; rename"));
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
              "--set: raytracer.options.samples: must be 8 to 16, but is 4");
    EXPECT_THAT(error_of([&] { node.override_value("mode.x", "1"); }), HasSubstr("the parent of 'x' is a scalar"));
    EXPECT_THAT(error_of([&] { node.override_value("outputs[7].path", "1"); }),
                HasSubstr("not a valid index; the number of elements in the list is 1"));
}

TEST(Yaml, ErrorsNameTheOverridingOption) {
    Node node = Node::parse("outputs: [{path: a}]\n", "lab.yaml");
    node.override_value("outputs", "[{path: b, fps: 3}]", "--output");
    node.override_text("outputs[0].path", "c: [d]", "--path");
    const Node output = node.require("outputs").items()[0];
    EXPECT_EQ(output.require("path").text(), "c: [d]");
    EXPECT_EQ(error_of([&] { output.require("path").integer(); }),
              "--path: outputs[0].path: must be a whole number, but is 'c: [d]'");
    EXPECT_EQ(error_of([&] { output.require("fps").integer(4, 5); }),
              "--output: outputs[0].fps: must be 4 to 5, but is 3");
}

TEST(Yaml, ResolvesPathsRelativeToTheirFile) {
    const Node node = Node::parse("mesh: ../meshes/a.obj\n", "/data/scenes/x.yaml");
    EXPECT_EQ(node.require("mesh").input_path(), "/data/meshes/a.obj");
}

TEST(Yaml, ResolvesDotDotAfterALinkLikeTheKernel) {
    const arhost::test::ScratchFolder scratch;
    const std::filesystem::path folder = std::filesystem::canonical(scratch.path());
    std::filesystem::create_directories(folder / "data/new/inner");
    std::filesystem::create_directory_symlink("data/new/inner", folder / "link");
    const Node node =
        Node::parse("a: link/../x.obj\nb: ./link/x.obj\nc: link/../../none/../x.obj\n", (folder / "x.yaml").string());
    EXPECT_EQ(node.require("a").input_path(), folder / "data/new/x.obj");
    EXPECT_EQ(node.require("b").input_path(), folder / "link/x.obj");
    EXPECT_EQ(node.require("c").input_path(), folder / "data/x.obj");
    const Node output = Node::parse("a: " + (folder / "link/../x.mp4").string() + "\nb: x.mp4", "a.yaml");
    EXPECT_EQ(output.require("a").output_path(), folder / "data/new/x.mp4");
    EXPECT_EQ(output.require("b").output_path(), std::filesystem::current_path() / "x.mp4");
}

TEST(Yaml, KeepsPathsAbsoluteAfterABrokenLink) {
    const arhost::test::ScratchFolder scratch;
    std::filesystem::create_symlink("loop", scratch.path() / "loop");
    const Node node = Node::parse("a: loop/../x.obj\n", (scratch.path() / "x.yaml").string());
    EXPECT_EQ(node.require("a").input_path(), scratch.path() / "x.obj");
}

TEST(Yaml, RejectsNumbersThatUnderflow) {
    const Node node = Node::parse("a: 1e-999\nb: -0." + std::string(400, '0') + "1\nc: 1e-300\n", "a.yaml");
    EXPECT_EQ(error_of([&] { node.require("a").real(); }), "a.yaml:1:4: a: must not be so close to 0, but is 1e-999");
    EXPECT_EQ(error_of([&] { node.require("a").real(0.01, 1e6); }),
              "a.yaml:1:4: a: must not be so close to 0, 0.01 to 1e+06, but is 1e-999");
    EXPECT_THAT(error_of([&] { node.require("b").real(); }), HasSubstr("must not be so close to 0, but is -0.0"));
    EXPECT_EQ(node.require("c").real(), 1e-300);
}

TEST(Yaml, RejectsNumbersThatAreNotFinite) {
    const Node node = Node::parse("a: .nan\nb: 1e999\nc: inf\nd: +2.5\ne: -.Inf\nf: .5\ng: .info\n", "a.yaml");
    EXPECT_EQ(error_of([&] { node.require("a").real(); }), "a.yaml:1:4: a: must be a finite number, but is .nan");
    EXPECT_EQ(error_of([&] { node.require("a").real(0, 10'000); }),
              "a.yaml:1:4: a: must be a finite number, 0 to 10000, but is .nan");
    EXPECT_EQ(error_of([&] { node.require("c").real(0); }),
              "a.yaml:3:4: c: must be a finite number, at least 0, but is inf");
    for (const char *key : {"b", "e"})
        EXPECT_THAT(error_of([&] { node.require(key).real(); }), HasSubstr("must be a finite number, but is "))
            << key;
    EXPECT_EQ(error_of([&] { node.require("g").real(); }), "a.yaml:7:4: g: must be a number, but is '.info'");
    EXPECT_EQ(node.require("d").real(), 2.5);
    EXPECT_EQ(node.require("f").real(), 0.5);
}

TEST(Yaml, RejectsNulCharacters) {
    const Node node = Node::parse(R"({a: "x\0y"})", "a.yaml");
    EXPECT_EQ(error_of([&] { node.require("a").text(); }), "a.yaml:1:5: a: must not contain a NUL character");
}

TEST(Yaml, AssigningANodeDoesNotModifyTheDocument) {
    const Node root = sample();
    Node node = root.require("mode");
    node = root.require("tracker").require("side_mm");
    EXPECT_EQ(node.text(), "-3");
    EXPECT_EQ(root.require("mode").text(), "lockstep");
}
