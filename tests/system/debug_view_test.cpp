// SPDX-License-Identifier: Apache-2.0
//
// The debug view of whole runs: what is drawn into the outputs, and what is counted.
#include "arhost_run.hpp"

#include <gmock/gmock.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

using namespace arhost::test;
using testing::HasSubstr;
using testing::Not;
using Json = nlohmann::json;

namespace {

constexpr int width = 640, height = 480, frames = 12, occluded = 6;
constexpr double focal_length_px = 600, side_mm = 80;
const cv::Vec3b yellow(60, 210, 255), grey(170, 170, 170), pink(220, 120, 255);

// Renders a marker. A photo slides over it, and hides it from frame `occluded` on.
std::string configuration(const std::string &marker, const std::string &outputs) {
    return "version: 1\nsource: {plugin: source_synthetic, options: {path: still, noise: 0, frames: " +
           std::to_string(frames) + ", occlude_from: 9, occlude_to: 100}}\n" +
           "camera: {width: 640, height: 480, fx: 600, fy: 600}\n"
           "tracker: {plugin: tracker_aruco, targets: [{marker: " +
           marker + ", family: tag36h11, side_mm: 80}]}\noutputs: [" + outputs + "]\nstats: stats.json\n";
}
const std::string images = "{plugin: sink_images, path: \"images/%02d.png\"}";
const std::string poses = "{plugin: sink_poses, path: poses.jsonl}";

std::vector<Json> records_of(const ArhostRun &run, const std::string &file = "poses.jsonl") {
    std::istringstream lines(run.read(file));
    std::vector<Json> records;
    for (std::string line; std::getline(lines, line);)
        records.push_back(Json::parse(line));
    return records;
}

cv::Mat image_of(const ArhostRun &run, int frame, const std::string &folder = "images") {
    char name[16];
    std::snprintf(name, sizeof name, "/%02d.png", frame);
    return cv::imread(run.path(folder + name).string(), cv::IMREAD_COLOR);
}

// The pixels of the marker's corners, from the true pose.
std::vector<cv::Point2d> true_corners_px(const Json &record) {
    const auto mt = record["truth"]["mt"].get<std::array<double, 16>>();
    std::vector<cv::Point2d> corners;
    for (const auto &[x, y] : {std::pair{-1, 1}, {1, 1}, {1, -1}, {-1, -1}}) {
        const auto coordinate = [&](std::size_t row) {
            return side_mm / 2 * (x * mt[row] + y * mt[4 + row]) + mt[12 + row];
        };
        corners.emplace_back((width - 1) / 2.0 - focal_length_px * coordinate(0) / coordinate(2),
                             (height - 1) / 2.0 + focal_length_px * coordinate(1) / coordinate(2));
    }
    return corners;
}

// Returns how many of 9 places on each edge have this colour within one pixel.
int count_on_outline(const cv::Mat &image, const std::vector<cv::Point2d> &corners, const cv::Vec3b &colour,
                     double tolerance = 110) {
    int count = 0;
    for (std::size_t i = 0; i < 4; ++i)
        for (int step = 1; step <= 9; ++step) {
            const cv::Point2d p = corners[i] + (corners[(i + 1) % 4] - corners[i]) * (step / 10.0);
            double nearest = 1000;
            for (int y = -1; y <= 1; ++y)
                for (int x = -1; x <= 1; ++x)
                    nearest = std::min(nearest, cv::norm(image.at<cv::Vec3b>(cvRound(p.y) + y, cvRound(p.x) + x),
                                                         colour, cv::NORM_L2));
            count += nearest < tolerance;
        }
    return count;
}
constexpr int whole_outline = 36;

// Returns how many pixels below the marker are bluer than in the plain image: those of the border of the place where
// it is expected.
int count_cyan(const cv::Mat &drawn, const cv::Mat &plain, const std::vector<cv::Point2d> &corners) {
    const double lowest = std::ranges::max_element(corners, {}, &cv::Point2d::y)->y;
    int count = 0;
    for (int y = cvRound(lowest) + 3; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const auto blueness = [&](const cv::Mat &image) {
                const cv::Vec3b pixel = image.at<cv::Vec3b>(y, x);
                return pixel[0] - pixel[2];
            };
            count += blueness(drawn) > blueness(plain) + 60;
        }
    return count;
}

} // namespace

TEST(DebugView, DrawsMarkersWhereTheyAreIntoEveryOutput) {
    const std::string outputs = images + ", {plugin: sink_video, path: video.mkv, options: {crf: 0}}, " + poses;
    ArhostRun plain(configuration("0", outputs)), debug(configuration("0", outputs));
    ASSERT_EQ(plain.run(), 0) << plain.output();
    ASSERT_EQ(debug.run({"run.yaml", "--debug-view"}), 0) << debug.output();
    EXPECT_THAT(debug.messages(), Not(HasSubstr("warning"))) << debug.messages();
    EXPECT_TRUE(debug.read("poses.jsonl") == plain.read("poses.jsonl"));
    const std::vector<Json> records = records_of(debug);
    ASSERT_EQ(records.size(), std::size_t{frames});
    const std::vector<cv::Point2d> corners = true_corners_px(records[0]);
    cv::VideoCapture video(debug.path("video.mkv").string());
    for (int frame = 0; frame <= occluded; ++frame) {
        const cv::Mat drawn = image_of(debug, frame), without = image_of(plain, frame);
        ASSERT_EQ(drawn.size(), without.size());
        const bool is_seen = frame < occluded;
        EXPECT_EQ(count_on_outline(drawn, corners, is_seen ? yellow : grey), whole_outline) << frame;
        if (is_seen) {
            EXPECT_EQ(count_on_outline(without, corners, yellow), 0) << frame;
        }
        EXPECT_EQ(count_cyan(drawn, without, corners) > 30, frame > 0)
            << frame << ": no marker is expected in the first frame";
        cv::Mat of_video;
        ASSERT_TRUE(video.read(of_video));
        EXPECT_GE(count_on_outline(of_video, corners, is_seen ? yellow : grey, 180), 30) << frame;
    }
}

TEST(DebugView, MarkersThatNoTargetListsArePink) {
    ArhostRun run(configuration("5", images + ", " + poses));
    ASSERT_EQ(run.run({"run.yaml", "--debug-view", "--allow-no-target"}), 0) << run.output();
    const std::vector<Json> records = records_of(run);
    EXPECT_EQ(count_on_outline(image_of(run, 1), true_corners_px(records[1]), pink), whole_outline);
    EXPECT_EQ(records[1]["search"]["unlisted"], 1);
    EXPECT_EQ(run.stats()["search"]["unlisted"], occluded);
}

TEST(DebugView, TheStatisticsHaveTheTotalsOfThePoseLog) {
    ArhostRun run(configuration("0", poses));
    ASSERT_EQ(run.run(), 0) << run.output();
    Json totals = {{"frames", 0},   {"everywhere", 0}, {"observations", 0}, {"unlisted", 0},
                   {"expected", 0}, {"missed", 0},     {"candidates", 0}};
    for (const Json &record : records_of(run)) {
        const Json &search = record["search"];
        totals["frames"] = totals["frames"].get<int>() + 1;
        totals["everywhere"] = totals["everywhere"].get<int>() + search["everywhere"].get<bool>();
        for (const char *key : {"observations", "unlisted", "expected", "missed", "candidates"})
            totals[key] = totals[key].get<int>() + search[key].get<int>();
    }
    EXPECT_EQ(run.stats()["search"], totals);
    EXPECT_EQ(totals["observations"], occluded);
    EXPECT_EQ(totals["expected"], occluded) << "in the frames after one with the marker";
    EXPECT_EQ(totals["missed"], 1);
    EXPECT_GE(totals["candidates"], totals["observations"]);
    EXPECT_EQ(totals["everywhere"], frames - occluded) << "the first one, and those without an expected marker";
}

TEST(DebugView, IsAnOptionOfTheOutputs) {
    ArhostRun run(configuration(
        "0", images + ", {plugin: sink_images, path: \"debug/%02d.png\", options: {debug_view: true}}, " + poses));
    ASSERT_EQ(run.run(), 0) << run.output();
    const auto corners = true_corners_px(records_of(run)[1]);
    EXPECT_EQ(count_on_outline(image_of(run, 1), corners, yellow), 0);
    EXPECT_EQ(count_on_outline(image_of(run, 1, "debug"), corners, yellow), whole_outline);
}

TEST(DebugView, DoesNotChangeOtherContents) {
    const std::string overlay = "{plugin: sink_images, path: \"images/%02d.png\", options: {content: overlay}}";
    ArhostRun plain(configuration("0", overlay)), debug(configuration("0", overlay));
    ASSERT_EQ(plain.run(), 0) << plain.output();
    ASSERT_EQ(debug.run({"run.yaml", "--debug-view"}), 0) << debug.output();
    EXPECT_TRUE(debug.read("images/01.png") == plain.read("images/01.png"));
}

TEST(DebugView, WarnsIfNoOutputCanDrawIt) {
    ArhostRun run(configuration("0", poses));
    ASSERT_EQ(run.run({"run.yaml", "--debug-view"}), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("--debug-view has no effect, because no output can draw it"));
}

TEST(DebugView, OfAReplayHasTheRecordedMarkersAndNumbers) {
    ArhostRun run(configuration("0", "{plugin: sink_session, path: take}, " + images + ", " + poses));
    ASSERT_EQ(run.run(), 0) << run.output();
    const auto replay = [&](const std::string &folder, std::vector<std::string> more) {
        const std::vector<std::string> all = {"replay",
                                              "take",
                                              "--debug-view",
                                              "--stats",
                                              "replayed.json",
                                              "--set",
                                              "outputs=[{plugin: sink_images, path: \"" + folder +
                                                  "/%02d.png\"}, {plugin: sink_poses, path: replayed.jsonl}]"};
        more.insert(more.begin(), all.begin(), all.end());
        ASSERT_EQ(run.run(more), 0) << run.output();
        EXPECT_TRUE(run.read("replayed.jsonl") == run.read("poses.jsonl"));
        EXPECT_EQ(Json::parse(run.read("replayed.json"))["search"], run.stats()["search"]);
    };
    const auto corners = true_corners_px(records_of(run)[1]);
    replay("repeated", {});
    EXPECT_EQ(count_on_outline(image_of(run, 1, "repeated"), corners, yellow), whole_outline);
    EXPECT_EQ(count_cyan(image_of(run, 1, "repeated"), image_of(run, 1), corners), 0) << "the tracker does not run";
    replay("tracked", {"--set", "tracker.deadline_ms=60000"});
    EXPECT_GT(count_cyan(image_of(run, 1, "tracked"), image_of(run, 1), corners), 30);
}
