// SPDX-License-Identifier: Apache-2.0
//
// Tests of the sinks that append to a text file for each frame. A test program instantiates the suite LogSink.
#pragma once

#include "sink_under_test.hpp"
#include "tracked_record.hpp"

#include <gmock/gmock.h>

#include <ostream>

namespace arhost::test {

struct LogSinkCase {
    const char *name, *plugin;
    TrackedRecord (*record)(std::uint64_t sequence);
    std::map<std::string, std::string> options{};

    friend void PrintTo(const LogSinkCase &sink, std::ostream *out) { *out << sink.name; }
};

class LogSink : public testing::TestWithParam<LogSinkCase> {
protected:
    std::filesystem::path file() const { return folder_.path() / "log.txt"; }
    std::map<std::string, std::string> options(const std::filesystem::path &path) const {
        std::map<std::string, std::string> options = GetParam().options;
        options["path"] = path;
        return options;
    }
    SinkUnderTest sink() const { return SinkUnderTest(GetParam().plugin, options(file())); }
    static void write(SinkUnderTest &sink, std::uint64_t first, std::uint64_t end) {
        const Picture picture(8, 8, 0);
        for (; first < end; ++first)
            ASSERT_EQ(sink.write(picture, GetParam().record(first)), ARHOST_STATUS_OK) << sink.log();
    }
    // Returns the file that an uninterrupted run writes for the frames [0, end).
    std::string uninterrupted(std::uint64_t end) const {
        const auto path = folder_.path() / "whole.txt";
        SinkUnderTest whole(GetParam().plugin, options(path));
        EXPECT_EQ(whole.start(8, 8), ARHOST_STATUS_OK);
        write(whole, 0, end);
        EXPECT_EQ(whole.stop(), ARHOST_STATUS_OK);
        return read_text(path);
    }

    ScratchFolder folder_;
};

TEST_P(LogSink, TheFileHasOneMoreWholeLineAfterEachFrame) {
    SinkUnderTest s = sink();
    ASSERT_EQ(s.start(8, 8), ARHOST_STATUS_OK);
    write(s, 0, 1);
    const auto first_lines = std::ranges::count(read_text(file()), '\n'); // 2 with a header
    for (int i = 1; i < 20; ++i) {
        write(s, static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(i) + 1);
        const std::string text = read_text(file());
        EXPECT_EQ(text.back(), '\n');
        EXPECT_EQ(std::ranges::count(text, '\n'), first_lines + i);
    }
    EXPECT_EQ(read_text(file()), uninterrupted(20));
}

TEST_P(LogSink, AFreshRunReplacesAnOlderFileAtItsFirstFrame) {
    std::ofstream(file()) << "something else\n";
    SinkUnderTest s = sink();
    ASSERT_EQ(s.start(8, 8), ARHOST_STATUS_OK);
    EXPECT_EQ(read_text(file()), "something else\n")
        << "start must not change the file, because the run may still fail to start";
    write(s, 0, 2);
    EXPECT_EQ(s.stop(), ARHOST_STATUS_OK);
    EXPECT_EQ(read_text(file()), uninterrupted(2));
    EXPECT_EQ(s.log(), "");
}

TEST_P(LogSink, ARestartKeepsEarlierLinesAndReplacesTheRest) {
    for (const std::uint64_t restart : {1, 4, 5, 9, 10}) {
        {
            SinkUnderTest killed = sink();
            ASSERT_EQ(killed.start(8, 8), ARHOST_STATUS_OK);
            write(killed, 0, 10);
        }
        SinkUnderTest s = sink();
        ASSERT_EQ(s.start(8, 8, restart), ARHOST_STATUS_OK);
        write(s, restart, 12);
        ASSERT_EQ(s.stop(), ARHOST_STATUS_OK);
        EXPECT_EQ(read_text(file()), uninterrupted(12)) << "restarted at " << restart;
        EXPECT_EQ(s.log(), "");
    }
}

TEST_P(LogSink, APartialLineIsRemovedAfterAKill) {
    const std::string whole = uninterrupted(3), two = uninterrupted(2);
    for (std::size_t size = two.size(); size < whole.size(); size += 7)
        for (const std::uint64_t restart : {2, 3}) { // 3: the host considers frame 2 written
            std::ofstream(file(), std::ios::binary | std::ios::trunc) << whole.substr(0, size);
            SinkUnderTest s = sink();
            ASSERT_EQ(s.start(8, 8, restart), ARHOST_STATUS_OK);
            EXPECT_EQ(read_text(file()), two) << "cut at " << size;
            write(s, 2, 3);
            EXPECT_EQ(read_text(file()), whole) << "cut at " << size;
        }
}

TEST_P(LogSink, SurvivesAKillAtAnyMoment) {
    std::uint64_t next = 0;
    for (const std::uint64_t frames : {1, 40, 3, 200})
        next = write_until_killed(GetParam().plugin, options(file()), 8, 8, next, frames, GetParam().record);
    SinkUnderTest s = sink();
    ASSERT_EQ(s.start(8, 8, next), ARHOST_STATUS_OK);
    write(s, next, next + 5);
    ASSERT_EQ(s.stop(), ARHOST_STATUS_OK);
    EXPECT_EQ(read_text(file()), uninterrupted(next + 5));
}

TEST_P(LogSink, ARestartWithoutTheOldFileGivesAWarning) {
    SinkUnderTest s = sink();
    ASSERT_EQ(s.start(8, 8, 5), ARHOST_STATUS_OK);
    EXPECT_THAT(s.log(), testing::HasSubstr("4 '" + file().string() + "' has no frame before 5"));
}

TEST_P(LogSink, AFullDiskLeavesWholeLinesAndAMessage) {
    SinkUnderTest s = sink();
    ASSERT_EQ(s.start(8, 8), ARHOST_STATUS_OK);
    write(s, 0, 2);
    const std::string before = read_text(file());
    {
        const FileSizeLimit limit(before.size() + 20); // only a part of the next line fits
        EXPECT_EQ(s.write(Picture(8, 8, 0), GetParam().record(2)), ARHOST_STATUS_ERROR_IO);
    }
    EXPECT_EQ(read_text(file()), before);
    EXPECT_THAT(s.log(), testing::HasSubstr("5 cannot write '" + file().string() + "': File too large"));
    write(s, 2, 4); // continues when the disk has free space again
    EXPECT_EQ(read_text(file()), uninterrupted(4));
}

TEST_P(LogSink, AnUnwritableFolderIsAConfigurationErrorThatNamesThePath) {
    const UnwritableFolder locked(folder_.path() / "locked");
    SinkUnderTest s(GetParam().plugin, options(folder_.path() / "locked/log.txt"));
    EXPECT_EQ(s.start(8, 8), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(s.log(), testing::HasSubstr("locked/log.txt"));
}

TEST_P(LogSink, CreatesMissingFoldersAtTheFirstFrame) {
    const auto path = folder_.path() / "a/b/log.txt";
    SinkUnderTest s(GetParam().plugin, options(path));
    EXPECT_EQ(s.start(8, 8), ARHOST_STATUS_OK);
    EXPECT_FALSE(std::filesystem::exists(path)) << "the log must not be created before the first frame";
    write(s, 0, 1);
    EXPECT_TRUE(std::filesystem::exists(path));
}

} // namespace arhost::test
