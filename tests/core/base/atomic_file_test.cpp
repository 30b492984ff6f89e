// SPDX-License-Identifier: Apache-2.0
#include "base/atomic_file.hpp"
#include "errors.hpp"
#include "plugin_under_test.hpp"

#include <gmock/gmock.h>

#include <fcntl.h>
#include <fstream>
#include <sstream>
#include <sys/stat.h>

using namespace arhost::base;
using testing::HasSubstr;
namespace fs = std::filesystem;

namespace {

struct AtomicFileTest : testing::Test {
    static std::string read(const fs::path &file) {
        std::ostringstream text;
        text << std::ifstream(file).rdbuf();
        return text.str();
    }
    std::size_t count() const {
        return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
    }
    template <class Call> static std::string error_of(const Call &call) {
        return arhost::test::error_of<std::runtime_error>(call);
    }
    arhost::test::ScratchFolder scratch;
    const fs::path folder = scratch.path(), file = folder / "file";
};

} // namespace

TEST_F(AtomicFileTest, ReplacesTheFileAndKeepsItsPermissions) {
    std::ofstream(file) << "before";
    ::chmod(file.c_str(), 0640);
    AtomicFile output(file);
    EXPECT_EQ(read(file), "before");
    output.write(std::string(100'000, 'x'));
    EXPECT_EQ(read(file), std::string(100'000, 'x'));
    EXPECT_EQ(fs::status(file).permissions(), fs::perms(0640));
    EXPECT_EQ(count(), 1u);
}

TEST_F(AtomicFileTest, LeavesNoTemporaryFileIfNothingIsWritten) {
    { const AtomicFile output(file); }
    EXPECT_EQ(count(), 0u);
}

TEST_F(AtomicFileTest, WritesToTheTargetOfALink) {
    fs::create_symlink("file", folder / "link");
    AtomicFile(folder / "link").write("x");
    EXPECT_TRUE(fs::is_symlink(folder / "link"));
    EXPECT_EQ(read(file), "x");
}

TEST_F(AtomicFileTest, WritesDirectlyToAPipe) {
    ASSERT_EQ(::mkfifo(file.c_str(), 0600), 0);
    const UniqueFd reader(::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
    AtomicFile(file).write("x");
    char byte = 0;
    EXPECT_EQ(::read(reader.get(), &byte, 1), 1);
    EXPECT_TRUE(fs::is_fifo(file));
}

TEST_F(AtomicFileTest, ReportsWhyAFileCannotBeWritten) {
    EXPECT_THAT(error_of([&] { AtomicFile output(folder / "none/file"); }), HasSubstr("none/file: No such file"));
    EXPECT_THAT(error_of([&] { AtomicFile output(folder); }), HasSubstr("it is a folder"));
    fs::create_symlink("circle", folder / "circle");
    EXPECT_THAT(error_of([&] { AtomicFile output(folder / "circle"); }), HasSubstr("circle: Too many levels"));
    EXPECT_EQ(error_of([&] { AtomicFile("/dev/full").write("x"); }),
              "cannot write /dev/full: No space left on device");
    EXPECT_EQ(error_of([&] { AtomicFile("").write("x"); }), "no error") << "an empty path";
}
