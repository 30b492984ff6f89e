// SPDX-License-Identifier: Apache-2.0
#include "sink_common/files.hpp"

#include "failure_of.hpp"
#include "sink_under_test.hpp"

#include <gmock/gmock.h>

#include <fcntl.h>
#include <filesystem>
#include <fstream>

using namespace arhost;
using namespace arhost::files;
using arhost::test::failure_of;
using testing::ElementsAre;
using testing::HasSubstr;

namespace {

std::vector<std::uint8_t> bytes_of(const std::string &text) {
    return {text.begin(), text.end()};
}

} // namespace

TEST(Files, ReplaceIsAtomicAndLeavesNoTemporaryFile) {
    const test::ScratchFolder folder;
    const auto target = folder.path() / "a.txt", scratch = hidden_sibling(target, ".partial");
    EXPECT_EQ(scratch.filename(), ".a.txt.partial");
    replace_file(target, scratch, bytes_of("first, and long"));
    replace_file(target, scratch, bytes_of("second"));
    EXPECT_EQ(test::read_text(target), "second");
    EXPECT_THAT(test::names_in(folder.path()), ElementsAre("a.txt"));
}

TEST(Files, ReplaceKeepsTheOldFileIfTheDiskIsFull) {
    const test::ScratchFolder folder;
    const auto target = folder.path() / "a.txt", scratch = hidden_sibling(target, ".partial");
    replace_file(target, scratch, bytes_of("old"));
    const auto [status, message] = failure_of([&] {
        const test::FileSizeLimit limit(1000);
        replace_file(target, scratch, std::vector<std::uint8_t>(2000));
    });
    EXPECT_EQ(status, ARHOST_STATUS_ERROR_IO);
    EXPECT_THAT(message, HasSubstr("File too large"));
    EXPECT_EQ(test::read_text(target), "old");
    EXPECT_THAT(test::names_in(folder.path()), ElementsAre("a.txt"));
}

TEST(Files, ReplaceOfAFolderFailsAndNamesIt) {
    const test::ScratchFolder folder;
    const auto target = folder.path() / "sub";
    std::filesystem::create_directory(target);
    const auto [status, message] =
        failure_of([&] { replace_file(target, hidden_sibling(target, ".partial"), bytes_of("x")); });
    EXPECT_EQ(status, ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(message, HasSubstr(target.string()));
}

TEST(Files, ParentFoldersAreCreated) {
    const test::ScratchFolder folder;
    make_parent_folders(folder.path() / "a/b/c.txt");
    EXPECT_TRUE(std::filesystem::is_directory(folder.path() / "a/b"));
    make_parent_folders("c.txt"); // a file in the working directory needs no folder
}

TEST(Files, AFileInPlaceOfAFolderIsNamed) {
    const test::ScratchFolder folder;
    std::ofstream(folder.path() / "a") << "x";
    const auto [status, message] = failure_of([&] { make_parent_folders(folder.path() / "a/b/c.txt"); });
    EXPECT_EQ(status, ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(message, HasSubstr((folder.path() / "a/b").string()));
}

TEST(Files, AnUnwritableFolderIsNamed) {
    const test::ScratchFolder folder;
    const test::UnwritableFolder locked(folder.path() / "locked");
    const auto [status, message] = failure_of([&] { File(folder.path() / "locked/a", O_WRONLY | O_CREAT); });
    EXPECT_EQ(status, ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(message, HasSubstr("locked/a"));
    EXPECT_THAT(message, HasSubstr("writable path"));
}

TEST(Files, APipeIsRejectedWithoutBlocking) {
    const test::ScratchFolder folder;
    ASSERT_EQ(mkfifo((folder.path() / "pipe").c_str(), 0666), 0);
    const auto [status, message] = failure_of([&] { File(folder.path() / "pipe", O_RDWR); });
    EXPECT_EQ(status, ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(message, HasSubstr("not a regular file"));
}

TEST(Files, ReadingPastTheEndIsAnError) {
    const test::ScratchFolder folder;
    File file(folder.path() / "a", O_RDWR | O_CREAT);
    file.append(bytes_of("abc"));
    std::vector<std::uint8_t> four(4);
    EXPECT_EQ(failure_of([&] { file.read_at(0, four); }).first, ARHOST_STATUS_ERROR_IO);
    file.write_at(3, bytes_of("d"));
    file.read_at(0, four);
    EXPECT_EQ(four, bytes_of("abcd"));
    file.truncate(2);
    EXPECT_EQ(file.size(), 2u);
}

TEST(Files, RemovingAMissingFileSucceeds) {
    const test::ScratchFolder folder;
    remove_file(folder.path() / "nothing");
    const auto [status, message] = failure_of([&] { remove_file(folder.path()); });
    EXPECT_EQ(status, ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(message, HasSubstr("cannot delete"));
}

TEST(Files, CheckRejectsNonRegularFiles) {
    EXPECT_THROW(check_can_write("/dev/full"), arhost::Failure);
    EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST(Files, CheckChangesNothing) {
    const test::ScratchFolder folder;
    const auto file = folder.path() / "log.txt", link = folder.path() / "link.txt",
               target = folder.path() / "far.txt";
    check_can_write(file);
    EXPECT_FALSE(std::filesystem::exists(file));
    std::ofstream(file) << "old";
    check_can_write(file);
    EXPECT_EQ(std::filesystem::file_size(file), 3u);
    std::filesystem::create_symlink("far.txt", link); // now points to a missing file
    check_can_write(link);
    EXPECT_TRUE(std::filesystem::is_symlink(link));
    EXPECT_FALSE(std::filesystem::exists(target));
    EXPECT_EQ(failure_of([&] { check_can_write(folder.path()); }).first, ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_EQ(failure_of([&] { check_can_write(folder.path() / "none/log.txt"); }).first,
              ARHOST_STATUS_ERROR_CONFIGURATION);
}
