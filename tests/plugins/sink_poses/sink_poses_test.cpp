// SPDX-License-Identifier: Apache-2.0
#include "sink_under_test.hpp"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <cstdio>
#include <limits>
#include <numbers>
#include <sstream>

using namespace arhost::test;
using Json = nlohmann::ordered_json;
using testing::ElementsAre;
using testing::HasSubstr;

namespace {

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

// Returns the record of a frame with two markers, a camera and the true pose. Its numbers differ per frame and need
// many decimal digits, to test that the sink does not round them.
arhost_record full_record(std::uint64_t sequence) {
    arhost_record record = make_record(sequence);
    const double seed = 1.0 / (3.0 + static_cast<double>(sequence));
    record.overlay = ARHOST_OVERLAY_RENDERED;
    record.has_camera = record.has_truth = 1;
    record.truth_id = 7;
    record.marker_count = 2;
    for (int i = 0; i < 16; ++i) {
        record.true_mt[i] = seed * i;
        for (int m = 0; m < 2; ++m)
            record.markers[m].mt[i] = std::numbers::pi * seed * (i - 5) * (m ? 1e-17 : 1);
        record.markers[1].mt_alternative[i] = -seed - i;
    }
    for (int m = 0; m < 2; ++m) {
        arhost_marker &marker = record.markers[m];
        marker.struct_size = sizeof marker;
        marker.id = m == 0 ? 0 : -3;
        std::snprintf(marker.family, sizeof marker.family, "%s", m == 0 ? "tag36h11" : "DICT_6X6_250");
        marker.state = m == 0 ? ARHOST_MARKER_DETECTED : ARHOST_MARKER_PREDICTED;
        marker.age_frames = m == 0 ? 0 : 4;
        for (int c = 0; c < 4; ++c) {
            marker.corners_px[c][0] = 100 + seed * c;
            marker.corners_px[c][1] = 200 - seed * c;
        }
        marker.reprojection_px = seed / 7;
        marker.ambiguity = 0.25;
    }
    for (int i = 0; i < 3; ++i) {
        record.camera.eye[i] = 1e3 * seed * i;
        record.camera.look_at[i] = -seed;
        record.camera.up[i] = i == 1;
    }
    return record;
}

std::vector<std::string> lines_of(const std::filesystem::path &file) {
    std::istringstream text(read_text(file));
    std::vector<std::string> lines;
    for (std::string line; std::getline(text, line);)
        lines.push_back(line);
    return lines;
}

std::vector<std::string> keys_of(const Json &json) {
    std::vector<std::string> keys;
    for (const auto &item : json.items())
        keys.push_back(item.key());
    return keys;
}

// Converts a C array, which may be nested, to a JSON array.
template <class Array> Json array(const Array &values) {
    Json json = Json::array();
    for (const auto &value : values) {
        if constexpr (std::is_array_v<std::remove_cvref_t<decltype(value)>>)
            json.push_back(array(value));
        else
            json.push_back(value);
    }
    return json;
}

class SinkPoses : public testing::Test {
protected:
    std::filesystem::path log() const { return folder_.path() / "log.jsonl"; }
    SinkUnderTest sink() const { return SinkUnderTest("sink_poses", {{"path", log().string()}}); }
    // Returns the log that an uninterrupted run writes for the frames [0, end).
    std::string uninterrupted(std::uint64_t end) const {
        const auto path = folder_.path() / "whole.jsonl";
        SinkUnderTest whole("sink_poses", {{"path", path.string()}});
        EXPECT_EQ(whole.start(8, 8), ARHOST_STATUS_OK);
        write(whole, 0, end);
        EXPECT_EQ(whole.stop(), ARHOST_STATUS_OK);
        return read_text(path);
    }
    static void write(SinkUnderTest &sink, std::uint64_t first, std::uint64_t end) {
        const Picture picture(8, 8, 0);
        for (; first < end; ++first)
            ASSERT_EQ(sink.write(picture, full_record(first)), ARHOST_STATUS_OK) << sink.log();
    }
    // Returns the line that the sink writes for one record.
    std::string line_of(const arhost_record &record) const {
        SinkUnderTest s = sink();
        EXPECT_EQ(s.start(8, 8), ARHOST_STATUS_OK);
        EXPECT_EQ(s.write(Picture(8, 8, 0), record), ARHOST_STATUS_OK);
        EXPECT_EQ(s.stop(), ARHOST_STATUS_OK);
        const auto lines = lines_of(log());
        EXPECT_EQ(lines.size(), 1u);
        return lines.at(0);
    }

    ScratchFolder folder_;
};

} // namespace

TEST_F(SinkPoses, WritesAFrameWithoutMarkersAsDocumented) {
    EXPECT_EQ(
        line_of(make_record(3)),
        R"({"frame": 3, "capture_ns": 99999999, "clock": "media", "overlay": "none", "markers": [], "camera": null})");
}

TEST_F(SinkPoses, WritesTheDocumentedKeysInTheirOrder) {
    const Json line = Json::parse(line_of(full_record(0)));
    EXPECT_THAT(keys_of(line), ElementsAre("frame", "capture_ns", "clock", "overlay", "markers", "camera", "truth"));
    EXPECT_THAT(keys_of(line["markers"][0]), ElementsAre("family", "id", "state", "age_frames", "corners_px", "mt",
                                                         "reprojection_px", "ambiguity"));
    EXPECT_THAT(keys_of(line["markers"][1]), ElementsAre("family", "id", "state", "age_frames", "corners_px", "mt",
                                                         "mt_alternative", "reprojection_px", "ambiguity"));
    EXPECT_THAT(keys_of(line["camera"]), ElementsAre("eye", "look_at", "up"));
    EXPECT_THAT(keys_of(line["truth"]), ElementsAre("id", "mt"));
}

TEST_F(SinkPoses, EveryNumberReadsBackAsTheSameDouble) {
    const arhost_record record = full_record(4);
    const Json line = Json::parse(line_of(record));
    for (std::size_t m = 0; m < 2; ++m) {
        const arhost_marker &marker = record.markers[m];
        EXPECT_EQ(line["markers"][m]["id"], marker.id);
        EXPECT_EQ(line["markers"][m]["family"], marker.family);
        EXPECT_EQ(line["markers"][m]["age_frames"], marker.age_frames);
        EXPECT_EQ(line["markers"][m]["mt"], array(marker.mt));
        EXPECT_EQ(line["markers"][m]["corners_px"], array(marker.corners_px));
        EXPECT_EQ(line["markers"][m]["reprojection_px"], marker.reprojection_px);
        EXPECT_EQ(line["markers"][m]["ambiguity"], marker.ambiguity);
    }
    EXPECT_EQ(line["markers"][0]["state"], "detected");
    EXPECT_EQ(line["markers"][1]["state"], "predicted");
    EXPECT_EQ(line["markers"][1]["mt_alternative"], array(record.markers[1].mt_alternative));
    EXPECT_EQ(line["camera"]["eye"], array(record.camera.eye));
    EXPECT_EQ(line["camera"]["look_at"], array(record.camera.look_at));
    EXPECT_EQ(line["camera"]["up"], array(record.camera.up));
    EXPECT_EQ(line["truth"]["id"], 7);
    EXPECT_EQ(line["truth"]["mt"], array(record.true_mt));
    EXPECT_EQ(line["overlay"], "rendered");
}

TEST_F(SinkPoses, NamesClockOverlayAndState) {
    arhost_record record = full_record(0);
    record.clock = ARHOST_CLOCK_MONOTONIC;
    record.overlay = ARHOST_OVERLAY_HELD;
    record.markers[0].state = ARHOST_MARKER_LOST;
    const Json line = Json::parse(line_of(record));
    EXPECT_EQ(line["clock"], "monotonic");
    EXPECT_EQ(line["overlay"], "held");
    EXPECT_EQ(line["markers"][0]["state"], "lost");
}

TEST_F(SinkPoses, NonFiniteNumbersAreNull) {
    arhost_record record = full_record(0);
    record.markers[0].mt[3] = nan_value;
    record.markers[0].reprojection_px = infinity;
    record.markers[0].corners_px[2][1] = -infinity;
    record.camera.up[0] = nan_value;
    record.true_mt[0] = nan_value;
    const std::string text = line_of(record);
    EXPECT_THAT(text, Not(HasSubstr("nan")));
    EXPECT_THAT(text, Not(HasSubstr("inf")));
    const Json line = Json::parse(text);
    EXPECT_TRUE(line["markers"][0]["mt"][3].is_null());
    EXPECT_TRUE(line["markers"][0]["reprojection_px"].is_null());
    EXPECT_TRUE(line["markers"][0]["corners_px"][2][1].is_null());
    EXPECT_TRUE(line["camera"]["up"][0].is_null());
    EXPECT_TRUE(line["truth"]["mt"][0].is_null());
}

TEST_F(SinkPoses, AnInvalidFamilyNameDoesNotCorruptTheLine) {
    arhost_record record = full_record(0);
    std::memset(record.markers[0].family, 'x', sizeof record.markers[0].family); // without a terminating NUL
    std::memcpy(record.markers[0].family, "a\"\\\n\xff", 5);
    record.marker_count = 1;
    EXPECT_EQ(Json::parse(line_of(record))["markers"][0]["family"],
              "a\"\\??" + std::string(sizeof record.markers[0].family - 5, 'x'));
}

TEST_F(SinkPoses, TheMaximumNumberOfMarkersIsWritten) {
    arhost_record record = full_record(0);
    for (arhost_marker &marker : record.markers)
        marker = record.markers[0];
    record.marker_count = ARHOST_MAX_MARKERS;
    EXPECT_EQ(Json::parse(line_of(record))["markers"].size(), std::size_t{ARHOST_MAX_MARKERS});
}

TEST_F(SinkPoses, TheLogHasWholeLinesAfterEveryFrame) {
    SinkUnderTest s = sink();
    ASSERT_EQ(s.start(8, 8), ARHOST_STATUS_OK);
    for (std::uint64_t i = 0; i < 20; ++i) {
        write(s, i, i + 1);
        const std::string text = read_text(log());
        EXPECT_EQ(text.back(), '\n');
        const auto lines = lines_of(log());
        ASSERT_EQ(lines.size(), i + 1);
        EXPECT_EQ(Json::parse(lines.back())["frame"], i);
    }
}

TEST_F(SinkPoses, AFreshRunReplacesAnOlderLogAtItsFirstFrame) {
    std::ofstream(log()) << "something else\n";
    SinkUnderTest s = sink();
    ASSERT_EQ(s.start(8, 8), ARHOST_STATUS_OK);
    EXPECT_EQ(read_text(log()), "something else\n")
        << "start must not change the file, because the run may still fail to start";
    write(s, 0, 2);
    EXPECT_EQ(s.stop(), ARHOST_STATUS_OK);
    EXPECT_EQ(read_text(log()), uninterrupted(2));
    EXPECT_EQ(s.log(), "");
}

TEST_F(SinkPoses, ARestartKeepsEarlierLinesAndReplacesTheRest) {
    for (const std::uint64_t restart : {1, 5, 9, 10}) {
        {
            SinkUnderTest killed = sink();
            ASSERT_EQ(killed.start(8, 8), ARHOST_STATUS_OK);
            write(killed, 0, 10);
        }
        SinkUnderTest s = sink();
        ASSERT_EQ(s.start(8, 8, restart), ARHOST_STATUS_OK);
        write(s, restart, 12);
        ASSERT_EQ(s.stop(), ARHOST_STATUS_OK);
        EXPECT_EQ(read_text(log()), uninterrupted(12)) << "restarted at " << restart;
        EXPECT_EQ(s.log(), "");
    }
}

TEST_F(SinkPoses, APartialLineIsRemovedAfterAKill) {
    const std::string whole = uninterrupted(3);
    const std::size_t third = whole.find("{\"frame\": 2");
    for (std::size_t size = third + 1; size < whole.size(); size += 7) {
        std::ofstream(log(), std::ios::binary | std::ios::trunc) << whole.substr(0, size);
        SinkUnderTest s = sink();
        ASSERT_EQ(s.start(8, 8, 3), ARHOST_STATUS_OK); // although the host considers frame 2 written
        EXPECT_EQ(read_text(log()), whole.substr(0, third)) << "cut at " << size;
    }
}

TEST_F(SinkPoses, FramesDroppedInLiveModeStayDroppedAfterARestart) {
    const Picture picture(8, 8, 0);
    {
        SinkUnderTest killed = sink();
        ASSERT_EQ(killed.start(8, 8), ARHOST_STATUS_OK);
        for (const std::uint64_t i : {3, 8, 20})
            ASSERT_EQ(killed.write(picture, full_record(i)), ARHOST_STATUS_OK);
    }
    SinkUnderTest s = sink();
    ASSERT_EQ(s.start(8, 8, 15), ARHOST_STATUS_OK);
    ASSERT_EQ(s.write(picture, full_record(15)), ARHOST_STATUS_OK);
    const auto lines = lines_of(log());
    ASSERT_EQ(lines.size(), 3u);
    EXPECT_EQ(Json::parse(lines[0])["frame"], 3);
    EXPECT_EQ(Json::parse(lines[1])["frame"], 8);
    EXPECT_EQ(Json::parse(lines[2])["frame"], 15);
}

TEST_F(SinkPoses, SurvivesAKillAtAnyMoment) {
    const std::map<std::string, std::string> options{{"path", log().string()}};
    std::uint64_t next = 0;
    for (const std::uint64_t frames : {1, 40, 3, 200})
        next = write_until_killed("sink_poses", options, 8, 8, next, frames, full_record);
    SinkUnderTest s = sink();
    ASSERT_EQ(s.start(8, 8, next), ARHOST_STATUS_OK);
    write(s, next, next + 5);
    ASSERT_EQ(s.stop(), ARHOST_STATUS_OK);
    EXPECT_EQ(read_text(log()), uninterrupted(next + 5));
}

TEST_F(SinkPoses, ARestartWithoutTheOldLogGivesAWarning) {
    SinkUnderTest s = sink();
    ASSERT_EQ(s.start(8, 8, 5), ARHOST_STATUS_OK);
    EXPECT_THAT(s.log(), HasSubstr("3 '" + log().string() + "' has no frame before 5"));
}

TEST_F(SinkPoses, CreatesMissingFolders) {
    SinkUnderTest s("sink_poses", {{"path", (folder_.path() / "a/b/log.jsonl").string()}});
    EXPECT_EQ(s.start(8, 8), ARHOST_STATUS_OK);
    EXPECT_FALSE(std::filesystem::exists(folder_.path() / "a/b/log.jsonl"))
        << "the log must not be created before the first frame";
    write(s, 0, 1);
    EXPECT_TRUE(std::filesystem::exists(folder_.path() / "a/b/log.jsonl"));
}

TEST_F(SinkPoses, AFullDiskLeavesWholeLinesAndAMessage) {
    SinkUnderTest s = sink();
    ASSERT_EQ(s.start(8, 8), ARHOST_STATUS_OK);
    write(s, 0, 2);
    const std::string before = read_text(log());
    {
        const FileSizeLimit limit(before.size() + 100); // only a part of the next line fits
        EXPECT_EQ(s.write(Picture(8, 8, 0), full_record(2)), ARHOST_STATUS_ERROR_IO);
    }
    EXPECT_EQ(read_text(log()), before);
    EXPECT_THAT(s.log(), HasSubstr("4 cannot write '" + log().string() + "': File too large"));
    write(s, 2, 4); // continues when the disk has free space again
    EXPECT_EQ(read_text(log()), uninterrupted(4));
}

TEST_F(SinkPoses, AnUnwritableFolderIsAConfigurationErrorThatNamesThePath) {
    const UnwritableFolder locked(folder_.path() / "locked");
    SinkUnderTest s("sink_poses", {{"path", (folder_.path() / "locked/log.jsonl").string()}});
    EXPECT_EQ(s.start(8, 8), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(s.log(), HasSubstr("locked/log.jsonl"));
}

TEST_F(SinkPoses, AFolderAsPathIsRejected) {
    SinkUnderTest s("sink_poses", {{"path", folder_.path().string()}});
    EXPECT_EQ(s.start(8, 8), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(s.log(), HasSubstr("add a file name"));
}

TEST_F(SinkPoses, TheReadmeExampleHasTheSameKeys) {
    const std::string readme =
        read_text(std::filesystem::path(ARHOST_SOURCE_DIRECTORY) / "plugins/sink_poses/README.md");
    const std::size_t begin = readme.find("```json\n") + 8;
    const Json example = Json::parse(readme.substr(begin, readme.find("```", begin) - begin));
    arhost_record record = full_record(0);
    record.has_truth = 0;
    record.marker_count = 1;
    const Json line = Json::parse(line_of(record));
    EXPECT_EQ(keys_of(example), keys_of(line));
    EXPECT_EQ(keys_of(example["markers"][0]), keys_of(line["markers"][0]));
    EXPECT_EQ(keys_of(example["camera"]), keys_of(line["camera"]));
}
