// SPDX-License-Identifier: Apache-2.0
#include "base/whole_file.hpp"
#include "plugin_under_test.hpp"

#include <gmock/gmock.h>

#include <csignal>
#include <fcntl.h>
#include <fstream>
#include <sstream>
#include <sys/stat.h>
#include <sys/wait.h>
#include <thread>

using namespace arhost::base;
using testing::HasSubstr;
namespace fs = std::filesystem;

namespace {

struct WholeFileTest : testing::Test {
    static std::string read(const fs::path &file) {
        std::ostringstream text;
        text << std::ifstream(file).rdbuf();
        return text.str();
    }
    std::size_t count() const {
        return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
    }
    template <class Call> static std::string error_of(const Call &call) {
        try {
            call();
        } catch (const std::runtime_error &error) {
            return error.what();
        }
        return "";
    }
    arhost::test::ScratchFolder scratch;
    const fs::path folder = scratch.path(), file = folder / "file";
};

} // namespace

TEST_F(WholeFileTest, ReplacesTheFileOnceItIsWhole) {
    std::ofstream(file) << "before";
    ::chmod(file.c_str(), 0640);
    WholeFile whole(file);
    EXPECT_EQ(read(file), "before");
    whole.write(std::string(100'000, 'x'));
    EXPECT_EQ(read(file), std::string(100'000, 'x'));
    EXPECT_EQ(fs::status(file).permissions(), fs::perms(0640));
    EXPECT_EQ(count(), 1u);
}

TEST_F(WholeFileTest, LeavesAllAsItWasWhereNothingIsWritten) {
    { const WholeFile whole(file); }
    EXPECT_EQ(count(), 0u);
}

TEST_F(WholeFileTest, LeavesALinkALink) {
    fs::create_symlink("file", folder / "link");
    WholeFile(folder / "link").write("x");
    EXPECT_TRUE(fs::is_symlink(folder / "link"));
    EXPECT_EQ(read(file), "x");
}

TEST_F(WholeFileTest, LeavesNothingBehindWhereItsProcessIsKilled) {
    const pid_t writer = ::fork();
    if (writer == 0) {
        const WholeFile whole(file);
        ::raise(SIGKILL);
    }
    ::waitpid(writer, nullptr, 0);
    const UniqueFd nameless(::open(folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0600));
    if (!nameless)
        GTEST_SKIP() << "the file system makes no file without a name";
    EXPECT_EQ(count(), 0u);
}

TEST_F(WholeFileTest, TakesNoOthersFileForItsOwn) {
    std::ofstream(folder / "file.0.tmp") << "other";
    WholeFile(file).write("x");
    EXPECT_EQ(read(folder / "file.0.tmp"), "other");
    EXPECT_EQ(read(file), "x");
}

TEST_F(WholeFileTest, WaitsForThePipesReader) {
    ASSERT_EQ(::mkfifo(file.c_str(), 0600), 0);
    std::string text;
    std::jthread reader([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        text = read(file);
    });
    WholeFile(file).write(std::string(100'000, 'x'));
    reader.join();
    EXPECT_EQ(text, std::string(100'000, 'x'));
}

TEST_F(WholeFileTest, WritesToAPipeThatIsOpen) {
    ASSERT_EQ(::mkfifo(file.c_str(), 0600), 0);
    const UniqueFd reader(::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
    WholeFile(file).write("x");
    char byte = 0;
    EXPECT_EQ(::read(reader.get(), &byte, 1), 1);
    EXPECT_TRUE(fs::is_fifo(file));
}

TEST_F(WholeFileTest, SaysWhyItCantBeWritten) {
    EXPECT_THAT(error_of([&] { WholeFile whole(folder / "none/file"); }), HasSubstr("none/file: No such file"));
    EXPECT_THAT(error_of([&] { WholeFile whole(folder); }), HasSubstr("it is a folder"));
    fs::create_symlink("circle", folder / "circle");
    EXPECT_THAT(error_of([&] { WholeFile whole(folder / "circle"); }), HasSubstr("circle: Too many levels"));
    EXPECT_EQ(error_of([&] { WholeFile("/dev/full").write("x"); }), "can't write /dev/full: No space left on device");
    EXPECT_EQ(error_of([&] { WholeFile("").write("x"); }), "") << "none is wanted";
}
