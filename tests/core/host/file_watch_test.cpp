// SPDX-License-Identifier: Apache-2.0
#include "host/file_watch.hpp"

#include "plugin_under_test.hpp"

#include <gmock/gmock.h>

#include <fstream>
#include <system_error>

using namespace arhost;
using host::FileWatch;
using testing::ElementsAre;

namespace {

class FileWatchTest : public testing::Test {
protected:
    std::filesystem::path path(const std::string &name) const { return folder.path() / name; }
    void write(const std::string &name) const { std::ofstream(path(name)) << "text"; }
    const FileWatch::Files &next_report() {
        const std::size_t count = reports.size();
        while (reports.size() == count)
            reactor.run_once();
        return reports.back();
    }

    test::ScratchFolder folder;
    ipc::Reactor reactor;
    std::vector<FileWatch::Files> reports;
    FileWatch watch{reactor, [this](const FileWatch::Files &files) { reports.push_back(files); }};
};

} // namespace

TEST_F(FileWatchTest, ReportsWrittenAndReplacedFilesTogether) {
    write("written");
    write("replaced");
    watch.add({path("written"), path("replaced"), path("untouched")});
    write("written");
    write("new");
    std::filesystem::rename(path("new"), path("replaced"));
    EXPECT_THAT(next_report(), ElementsAre(path("replaced"), path("written")));
}

TEST_F(FileWatchTest, ReportsAFileThatDidNotExist) {
    watch.add({path("later")});
    write("later");
    EXPECT_THAT(next_report(), ElementsAre(path("later")));
}

TEST_F(FileWatchTest, ReportsAllFilesAfterAFolderWasReplaced) {
    std::filesystem::create_directory(path("a"));
    std::filesystem::create_directory(path("b"));
    write("a/file");
    write("b/file");
    watch.add({path("a/file")});
    std::filesystem::rename(path("a"), path("old"));
    std::filesystem::rename(path("b"), path("a"));
    EXPECT_THAT(next_report(), ElementsAre(path("a/file")));
    write("a/file");
    EXPECT_THAT(next_report(), ElementsAre(path("a/file"))) << "the new folder is watched";
    std::filesystem::remove_all(path("a"));
    EXPECT_THAT(next_report(), ElementsAre(path("a/file")));
}

TEST_F(FileWatchTest, PathsThatCannotExistDoNotPreventTheOthers) {
    write("file");
    watch.add({path("a/../file"), path("file/below"), path(std::string(300, 'n') + "/x"), path("z")});
    write("z");
    EXPECT_THAT(next_report(), ElementsAre(path("z")));
}

TEST_F(FileWatchTest, DoesNotReportOtherFilesOfTheFolder) {
    watch.add({path("watched")});
    write("other");
    write("watched");
    EXPECT_THAT(next_report(), ElementsAre(path("watched")));
}

TEST_F(FileWatchTest, ReportsEachChange) {
    watch.add({path("first")});
    write("first");
    EXPECT_THAT(next_report(), ElementsAre(path("first")));
    watch.add({path("first"), path("second")});
    write("second");
    EXPECT_THAT(next_report(), ElementsAre(path("second")));
}

TEST_F(FileWatchTest, IgnoresFoldersThatDoNotExist) {
    watch.add({path("missing/file"), path("present")});
    write("present");
    EXPECT_THAT(next_report(), ElementsAre(path("present")));
}
