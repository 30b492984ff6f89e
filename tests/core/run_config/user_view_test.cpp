// SPDX-License-Identifier: Apache-2.0
#include "errors.hpp"
#include "plugin_under_test.hpp"
#include "run_config/user_view.hpp"

#include <gmock/gmock.h>

#include <cstdlib>
#include <fstream>
#include <sys/stat.h>
#include <unistd.h>

using namespace arhost::run_config;
using namespace arhost::yaml;
using arhost::test::error_of;
using testing::HasSubstr;
namespace fs = std::filesystem;

namespace {

struct UserView : testing::Test {
    UserView() {
        ::chmod(folder.c_str(), 0755); // for the tests that give up root
        std::ofstream(folder / "video.mp4") << "x";
        std::ofstream(folder / "f-0001.png") << "x";
        std::ofstream(folder / "100%.png") << "x";
    }
    Node node(const std::string &path) const {
        return Node::parse("{path: '" + (folder / path).string() + "'}", "run.yaml").require("path");
    }
    std::string input_error(const std::string &path) const {
        arhost::sandbox::Policy policy;
        arhost::sandbox::allow_read_files(policy, folder / path);
        return error_of([&] { expect_readable(node(path), policy); });
    }
    std::string output_error(const std::string &path) const {
        return error_of([&] { expect_writable(node(path)); });
    }
    // Runs `call` with the permissions of an ordinary user.
    template <class Call> static void as_user(const Call &call) {
        const bool was_root = ::geteuid() == 0;
        ASSERT_TRUE(!was_root || ::setresuid(65534, 65534, 0) == 0);
        call();
        ASSERT_TRUE(!was_root || ::setresuid(0, 0, 0) == 0);
    }
    arhost::test::ScratchFolder scratch;
    const fs::path folder = fs::canonical(scratch.path());
};

} // namespace

TEST_F(UserView, AcceptsReadableInputs) {
    for (const char *path : {"video.mp4", "f-%04d.png", "100%.png", "."})
        EXPECT_EQ(input_error(path), "no error") << path;
}

TEST_F(UserView, ReportsMissingInputs) {
    EXPECT_EQ(input_error("vidoe.mp4"), "run.yaml:1:8: path: there is no file '" + (folder / "vidoe.mp4").string() +
                                            "'; did you mean 'video.mp4'?");
    EXPECT_THAT(input_error("none/video.mp4"),
                HasSubstr(", as there is no folder '" + (folder / "none").string() + "'"));
    EXPECT_THAT(input_error("g-%04d.png"), HasSubstr("no file matches '" + (folder / "g-%04d.png").string() +
                                                     "'; its folder has 3 entries, such as '100%.png'"));
    EXPECT_THAT(input_error("f-%x.png"), HasSubstr("and it is not a valid pattern: "));
}

// The sandbox does not show a folder that contains the whole home to a plugin.
TEST_F(UserView, ReportsNumberedFilesInTheHomeFolder) {
    const char *home = std::getenv("HOME");
    const std::string usual = home ? home : "/";
    ::setenv("HOME", folder.c_str(), 1);
    EXPECT_THAT(input_error("f-%04d.png"),
                HasSubstr("run.yaml:1:8: path: the sandbox hides the folder '" + folder.string() +
                          "' from the plugin, because it contains your whole home; move the files to a folder"));
    EXPECT_THAT(input_error("g-%04d.png"), HasSubstr("no file matches"));
    EXPECT_EQ(input_error("f-0001.png"), "no error");
    arhost::sandbox::Policy policy;
    policy.mode = arhost::sandbox::Mode::none;
    EXPECT_EQ(error_of([&] { expect_readable(node("f-%04d.png"), policy); }), "no error");
    ::setenv("HOME", usual.c_str(), 1);
}

TEST_F(UserView, ReportsInputsWithoutPermission) {
    fs::create_directory(folder / "locked");
    std::ofstream(folder / "secret.mp4") << "x";
    ::chmod((folder / "secret.mp4").c_str(), 0);
    ::chmod((folder / "locked").c_str(), 0);
    as_user([&] {
        EXPECT_THAT(input_error("secret.mp4"), HasSubstr("secret.mp4' cannot be read: Permission denied"));
        EXPECT_THAT(input_error("locked/a.mp4"), HasSubstr("locked/a.mp4' cannot be accessed: Permission denied"));
    });
    ::chmod((folder / "locked").c_str(), 0755);
}

TEST_F(UserView, AcceptsWritableOutputsAndCreatesNothing) {
    for (const char *path : {"video.mp4", "new.mp4", "a/b/c.mp4"})
        EXPECT_EQ(output_error(path), "no error") << path;
    EXPECT_FALSE(fs::exists(folder / "a"));
    EXPECT_FALSE(fs::exists(folder / "new.mp4"));
    EXPECT_EQ(output_error("/dev/null"), "no error");
}

TEST_F(UserView, ReportsOutputsWithoutPermission) {
    fs::create_directory(folder / "out");
    std::ofstream(folder / "out/old.mp4") << "x";
    ::chmod((folder / "out").c_str(), 0555);
    ::chmod((folder / "out/old.mp4").c_str(), 0444);
    as_user([&] {
        const std::string where = (folder / "out").string() + "': Permission denied; choose another path";
        EXPECT_THAT(output_error("out/a.mp4"), HasSubstr("no file can be created in the folder '" + where));
        EXPECT_THAT(output_error("out/a/b.mp4"), HasSubstr(where));
        EXPECT_THAT(output_error("out/old.mp4"), HasSubstr("old.mp4' cannot be written: Permission denied"));
    });
    EXPECT_THAT(output_error("video.mp4/a.mp4"), HasSubstr("video.mp4' is a file, not a folder"));
    ::chmod((folder / "out").c_str(), 0755);
}
