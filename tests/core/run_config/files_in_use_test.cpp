// SPDX-License-Identifier: Apache-2.0
#include "errors.hpp"
#include "plugin_under_test.hpp"
#include "run_config/files_in_use.hpp"

#include <gmock/gmock.h>

#include <fstream>

using namespace arhost::run_config;
using namespace arhost::yaml;
using arhost::test::error_of;
using testing::AllOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

namespace {

struct FilesInUseTest : testing::Test {
    fs::path file(const std::string &name) const {
        fs::create_directories((folder / name).parent_path());
        std::ofstream(folder / name) << "x";
        return folder / name;
    }
    // Returns the error for an output with this path in a run that reads `input`.
    std::string refusal(const std::string &input, const std::string &output) const {
        FilesInUse files;
        files.read_numbered(folder / input);
        return error_of([&] { files.write(node(output)); });
    }
    Node node(const std::string &path) const {
        return Node::parse("{path: '" + (folder / path).string() + "'}", "run.yaml").require("path");
    }
    arhost::test::ScratchFolder scratch;
    const fs::path folder = fs::canonical(scratch.path());
};

} // namespace

TEST_F(FilesInUseTest, RecognisesAFileByName) {
    file("a.yaml");
    EXPECT_EQ(refusal("a.yaml", "./a.yaml"), "run.yaml:1:8: path: '" + (folder / "./a.yaml").string() +
                                                 "' is a file that this run reads; choose another path");
    EXPECT_EQ(refusal("a.yaml", "b.yaml"), "no error");
    EXPECT_NE(refusal("none.yaml", "none.yaml"), "no error");
}

TEST_F(FilesInUseTest, RecognisesAFileThroughLinks) {
    fs::create_symlink(file("a.yaml"), folder / "soft.yaml");
    fs::create_hard_link(folder / "a.yaml", folder / "hard.yaml");
    EXPECT_NE(refusal("a.yaml", "soft.yaml"), "no error");
    EXPECT_NE(refusal("soft.yaml", "a.yaml"), "no error");
    EXPECT_THAT(refusal("a.yaml", "hard.yaml"), AllOf(HasSubstr("hard.yaml' is a file that this run reads ("),
                                                      HasSubstr((folder / "a.yaml").string())));
}

TEST_F(FilesInUseTest, RecognisesAFileViaDotDotAfterALink) {
    file("there/inner/x");
    file("there/a.yaml");
    fs::create_directory_symlink("there/inner", folder / "link");
    EXPECT_NE(refusal("there/a.yaml", "link/../a.yaml"), "no error");
    file("a.yaml");
    EXPECT_EQ(refusal("a.yaml", "link/../a.yaml"), "no error");
}

TEST_F(FilesInUseTest, RecognisesTheFilesOfAPattern) {
    file("f-0001.png");
    EXPECT_THAT(refusal("f-%04d.png", "f-00%02d.png"), HasSubstr("(" + (folder / "f-0001.png").string() + ")"));
    EXPECT_NE(refusal("f-%04d.png", "f-0001.png"), "no error");
    EXPECT_NE(refusal("f-0001.png", "f-%04d.png"), "no error");
    fs::create_hard_link(folder / "f-0001.png", folder / "g-7.png");
    EXPECT_NE(refusal("f-%04d.png", "g-%d.png"), "no error");
    // Names that the pattern does not match, and names of files that do not exist yet.
    for (const char *other : {"f-%d.png", "f-%03d.png", "f-%05d.png", "f-000%%1.png", "f-%04d.jpg", "f-%x.png",
                              "f-0002.png", "f_%04d.png", "g-8.png", "f.%04d.png"})
        EXPECT_EQ(refusal("f-%04d.png", other), "no error") << other;
    file("f-%.png");
    EXPECT_NE(refusal("f-%.png", "f-%.png"), "no error");
    file("f-0.png");
    EXPECT_NE(refusal("f-0.png", "f-%01d.png"), "no error");
    EXPECT_EQ(refusal("f-0.png", "f-0%d.png"), "no error") << "the pattern needs at least one more digit";
    file("100%f-12345.png");
    EXPECT_NE(refusal("100%f-12345.png", "100%%f-%04d.png"), "no error")
        << "numbers may have more digits than the minimum";
}

TEST_F(FilesInUseTest, ExpandsPatternsOnlyWhereTheyAreExpected) {
    file("f-0001.png");
    FilesInUse files;
    files.read(folder / "f-%04d.png");
    EXPECT_EQ(error_of([&] { files.write(node("f-0001.png")); }), "no error");
    EXPECT_NE(error_of([&] { files.write(node("f-%04d.png")); }), "no error");
}

TEST_F(FilesInUseTest, AcceptsOnlyOneNumberInAPattern) {
    file("f-00010002.png");
    EXPECT_EQ(refusal("f-%04d%04d.png", "f-00010002.png"), "no error");
    std::string numbers;
    for (int i = 0; i < 100; ++i)
        numbers += "%d";
    file(std::string(200, '1') + ".png");
    EXPECT_EQ(refusal("other.png", numbers + ".jpg"), "no error") << "and the comparison must be fast";
}

TEST_F(FilesInUseTest, AcceptsPatternsInMissingFolders) {
    EXPECT_EQ(refusal("none/f-%04d.png", "f-0001.png"), "no error");
    EXPECT_NE(refusal("none/f-%04d.png", "none/f-%04d.png"), "no error");
}

TEST_F(FilesInUseTest, RecognisesFilesOfOtherOutputs) {
    FilesInUse files;
    files.write(node("a.mp4"));
    EXPECT_THAT(error_of([&] { files.write(node("./a.mp4")); }), HasSubstr("another output already writes '"));
    file("f-0001.png");
    fs::create_hard_link(folder / "f-0001.png", folder / "f-0002.png");
    EXPECT_EQ(error_of([&] { files.write(node("f-%04d.png")); }), "no error")
        << "one output may write a file under two names";
}

TEST_F(FilesInUseTest, RecognisesOutputsThatCanCollideBeforeTheirFilesExist) {
    const auto collide = [&](const std::string &one, const std::string &other) {
        const std::string error = error_of([&] { expect_distinct({{node(one), true}, {node(other), true}}); });
        EXPECT_THAT(error, testing::AnyOf("no error", HasSubstr("can write a file of the same name")));
        return error != "no error";
    };
    EXPECT_TRUE(collide("f%d.png", "f1%d.png"));
    EXPECT_TRUE(collide("f1%d.png", "f%d.png"));
    EXPECT_TRUE(collide("f%03d.png", "./f%04d.png")) << "both write f1000.png";
    EXPECT_TRUE(collide("f%d.png", "f%d2.png"));
    EXPECT_TRUE(collide("f%d.png", "f3.png"));
    EXPECT_TRUE(collide("f3.png", "f%d.png"));
    EXPECT_FALSE(collide("f%d.png", "g%d.png"));
    EXPECT_FALSE(collide("f%d.png", "f-%d.png"));
    EXPECT_FALSE(collide("f%d.png", "f%d.jpg"));
    EXPECT_FALSE(collide("f%d.png", "f.png"));
    EXPECT_FALSE(collide("f%d.png", "there/f%d.png"));
    fs::create_directory(folder / "there");
    fs::create_directory_symlink("there", folder / "link");
    EXPECT_TRUE(collide("link/f%d.png", "there/f7.png"));
    fs::create_symlink("f-0001.png", folder / "to_none.json");
    EXPECT_TRUE(collide("f-%04d.png", "to_none.json"));
}

TEST_F(FilesInUseTest, TakesANameAsAPatternOnlyIfThePluginWritesNumberedFiles) {
    for (const bool exist : {false, true}) {
        if (exist)
            file("p-1.jsonl");
        FilesInUse files;
        files.write(node("p-%d.jsonl"));
        EXPECT_EQ(error_of([&] { files.write(node("p-1.jsonl")); }), "no error");
        EXPECT_THAT(error_of([&] { files.write(node("./p-1.jsonl")); }),
                    HasSubstr("another output already writes '"));
        const auto error = [&](bool first, bool second) {
            return error_of([&] { expect_distinct({{node("p-%d.jsonl"), first}, {node("p-1.jsonl"), second}}); });
        };
        EXPECT_EQ(error(false, false), "no error");
        EXPECT_EQ(error(false, true), "no error");
        EXPECT_THAT(error(true, false), HasSubstr("p-%d.jsonl', can write a file of the same name as '"));
    }
    fs::create_hard_link(folder / "p-1.jsonl", folder / "other.txt");
    EXPECT_NE(error_of([&] {
                  expect_distinct({{node("p-%d.jsonl"), true}, {node("other.txt"), false}});
              }),
              "no error");
}

TEST_F(FilesInUseTest, RejectsAnOutputThatIsReadLater) {
    file("wood.png");
    FilesInUse files;
    files.write(node("wood.png"));
    files.write(node("new.png"));
    const auto error_about = [&](const std::string &name) {
        return error_of([&] { files.check_read(arhost::base::identity_of(folder / name)); });
    };
    EXPECT_EQ(error_about("stone.png"), "no error");
    const std::string refused =
        "run.yaml:1:8: path: '" + (folder / "wood.png").string() + "' is a file that this run";
    EXPECT_THAT(error_about("wood.png"), HasSubstr(refused));
    fs::create_hard_link(folder / "wood.png", folder / "hard.png");
    EXPECT_THAT(error_about("hard.png"), AllOf(HasSubstr(refused), HasSubstr("/hard.png)")));
    file("new.png");
    EXPECT_NE(error_about("new.png"), "no error") << "created after write()";
}

TEST_F(FilesInUseTest, DoesNotAccessFilesThatAreReadLater) {
    file("f-0001.png");
    file("wood.png");
    FilesInUse files;
    files.write(node("wood.png"));
    files.write(node("f-%04d.png"));
    for (const char *other : {"link.png", "w%dod.png", "f-%d.png", "./wood.png"})
        EXPECT_EQ(error_of([&] { files.check_read({folder / other, "0:0"}); }), "no error") << other;
}
