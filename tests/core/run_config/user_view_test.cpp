// SPDX-License-Identifier: Apache-2.0
#include "plugin_under_test.hpp"
#include "run_config/user_view.hpp"

#include <gmock/gmock.h>

#include <fstream>
#include <sys/stat.h>
#include <unistd.h>

using namespace arhost::run_config;
using namespace arhost::yaml;
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
    template <class Check> std::string error(const Check &check, const std::string &path) const {
        try {
            check(Node::parse("{path: '" + (folder / path).string() + "'}", "run.yaml").require("path"));
        } catch (const Error &error) {
            return error.what();
        }
        return "";
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
        EXPECT_EQ(error(expect_readable, path), "") << path;
}

TEST_F(UserView, ReportsMissingInputs) {
    EXPECT_EQ(error(expect_readable, "vidoe.mp4"), "run.yaml:1:8: path: there is no file '" +
                                                       (folder / "vidoe.mp4").string() +
                                                       "'; did you mean 'video.mp4'?");
    EXPECT_THAT(error(expect_readable, "none/video.mp4"),
                HasSubstr(", as there is no folder '" + (folder / "none").string() + "'"));
    EXPECT_THAT(error(expect_readable, "g-%04d.png"),
                HasSubstr("no file matches '" + (folder / "g-%04d.png").string() +
                          "'; its folder has 3 entries, such as '100%.png'"));
    EXPECT_THAT(error(expect_readable, "f-%x.png"), HasSubstr("and it is not a valid pattern: "));
}

TEST_F(UserView, ReportsInputsWithoutPermission) {
    fs::create_directory(folder / "locked");
    std::ofstream(folder / "secret.mp4") << "x";
    ::chmod((folder / "secret.mp4").c_str(), 0);
    ::chmod((folder / "locked").c_str(), 0);
    as_user([&] {
        EXPECT_THAT(error(expect_readable, "secret.mp4"), HasSubstr("secret.mp4' cannot be read: Permission denied"));
        EXPECT_THAT(error(expect_readable, "locked/a.mp4"),
                    HasSubstr("locked/a.mp4' cannot be accessed: Permission denied"));
    });
    ::chmod((folder / "locked").c_str(), 0755);
}

TEST_F(UserView, AcceptsWritableOutputsAndCreatesNothing) {
    for (const char *path : {"video.mp4", "new.mp4", "a/b/c.mp4"})
        EXPECT_EQ(error(expect_writable, path), "") << path;
    EXPECT_FALSE(fs::exists(folder / "a"));
    EXPECT_FALSE(fs::exists(folder / "new.mp4"));
    EXPECT_EQ(error(expect_writable, "/dev/null"), "");
}

TEST_F(UserView, ReportsOutputsWithoutPermission) {
    fs::create_directory(folder / "out");
    std::ofstream(folder / "out/old.mp4") << "x";
    ::chmod((folder / "out").c_str(), 0555);
    ::chmod((folder / "out/old.mp4").c_str(), 0444);
    as_user([&] {
        const std::string where = (folder / "out").string() + "': Permission denied; choose another path";
        EXPECT_THAT(error(expect_writable, "out/a.mp4"), HasSubstr("no file can be created in the folder '" + where));
        EXPECT_THAT(error(expect_writable, "out/a/b.mp4"), HasSubstr(where));
        EXPECT_THAT(error(expect_writable, "out/old.mp4"),
                    HasSubstr("old.mp4' cannot be written: Permission denied"));
    });
    EXPECT_THAT(error(expect_writable, "video.mp4/a.mp4"), HasSubstr("video.mp4' is a file, not a folder"));
    ::chmod((folder / "out").c_str(), 0755);
}
