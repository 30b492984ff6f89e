// SPDX-License-Identifier: Apache-2.0
#include "camera/trajectory.hpp"

#include "errors.hpp"
#include "plugin_under_test.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <fstream>
#include <sys/stat.h>

namespace arhost::camera {
namespace {

using test::error_of;
using testing::ElementsAre;
using testing::HasSubstr;

const std::string header =
    R"({"format": "arhost-trajectory", "version": 1, "unit": "mm", "clock": "media", "fps": 25, "camera": )"
    R"({"width": 640, "height": 480, "fx": 600.1, "fy": 601.2, "cx": 321.5, "cy": 238.25, "distortion": )"
    R"({"model": "brown", "coefficients": [0.1, -0.2, 0.001, 0.002, 0.03]}}})"
    "\n";

std::string line(int frame,
                 const std::string &view = R"("eye": [1, 2, 503], "look_at": [1, 2, 502], "up": [0, 1, 0])") {
    return "{\"frame\": " + std::to_string(frame) + ", \"capture_ns\": " + std::to_string(frame * 40'000'000) + ", " +
           view + "}\n";
}
const std::string lost = R"("eye": null, "look_at": null, "up": null)";
const std::string record = "1.5 -721.148 500.637 1.5 -720.282 500.138 0.0461728 0.497528 0.866218 \n";

class TrajectoryFile : public testing::Test {
protected:
    std::filesystem::path file() const { return folder_.path() / "run.trajectory"; }
    Trajectory read(const std::string &text) const {
        std::ofstream(file(), std::ios::binary | std::ios::trunc) << text;
        return read_trajectory(file());
    }
    // Returns the error message without the file name at its start.
    std::string error(const std::string &text) const {
        const std::string message = error_of([&] { read(text); });
        EXPECT_THAT(message, testing::StartsWith(file().string() + ":"));
        return message.substr(std::min(message.size(), file().string().size() + 1));
    }
    test::ScratchFolder folder_;
};
using Trajectories = TrajectoryFile;

} // namespace

TEST_F(Trajectories, ReadIntrinsicsTimesAndFramesWithoutACamera) {
    const Trajectory trajectory = read(header + line(0) + line(1, lost) + line(5));
    EXPECT_EQ(trajectory.clock, ARHOST_CLOCK_MEDIA);
    EXPECT_EQ(trajectory.fps, 25);
    EXPECT_EQ(trajectory.warning, "");
    ASSERT_TRUE(trajectory.intrinsics);
    EXPECT_EQ(trajectory.intrinsics->width, 640u);
    EXPECT_EQ(trajectory.intrinsics->fx, 600.1);
    EXPECT_EQ(trajectory.intrinsics->cy, 238.25);
    EXPECT_EQ(trajectory.intrinsics->distortion, ARHOST_DISTORTION_BROWN);
    EXPECT_EQ(trajectory.intrinsics->coefficients[1], -0.2);
    ASSERT_EQ(trajectory.frames.size(), 3u);
    EXPECT_EQ(trajectory.frames[2].frame, 5u);
    EXPECT_EQ(trajectory.frames[2].capture_ns, 200'000'000);
    EXPECT_FALSE(trajectory.frames[1].view);
    ASSERT_TRUE(trajectory.frames[2].view);
    EXPECT_THAT(trajectory.frames[2].view->eye_mm, ElementsAre(1, 2, 503));
    EXPECT_EQ(trajectory.end(), 6u);
}

TEST_F(Trajectories, FindAFrameByNumberOrTheNextOne) {
    const Trajectory trajectory = read(header + line(2) + line(3) + line(7));
    EXPECT_EQ(trajectory.at_or_after(0)->frame, 2u);
    EXPECT_EQ(trajectory.at_or_after(3)->frame, 3u);
    EXPECT_EQ(trajectory.at_or_after(4)->frame, 7u);
    EXPECT_EQ(trajectory.at_or_after(8), nullptr);
}

TEST_F(Trajectories, ConvertViewsToCameras) {
    const Trajectory trajectory = read(header + line(0));
    const arhost_camera camera = camera_of(*trajectory.frames[0].view, *trajectory.intrinsics);
    EXPECT_EQ(camera.struct_size, sizeof camera);
    EXPECT_THAT(camera.eye, ElementsAre(1, 2, 503));
    EXPECT_THAT(camera.look_at, ElementsAre(1, 2, 502));
    EXPECT_THAT(camera.up, ElementsAre(0, 1, 0));
    EXPECT_EQ(camera.intrinsics.fy, 601.2);
}

TEST_F(Trajectories, IgnoreATruncatedLastLine) {
    const std::string whole = header + line(0) + line(1), second = line(1);
    for (std::size_t cut = 1; cut + 1 < second.size(); ++cut) {
        const Trajectory trajectory = read(header + line(0) + second.substr(0, cut));
        EXPECT_EQ(trajectory.frames.size(), 1u) << cut;
        EXPECT_EQ(trajectory.warning, file().string() + ":3: the last line is truncated and was ignored");
    }
    const Trajectory without_final_line_end = read(whole.substr(0, whole.size() - 1));
    EXPECT_EQ(without_final_line_end.frames.size(), 2u);
    EXPECT_EQ(without_final_line_end.warning, "");
}

TEST_F(Trajectories, ErrorsNamePositionAndFix) {
    const auto replaced = [](std::string text, const std::string &from, const std::string &to) {
        EXPECT_NE(text.find(from), std::string::npos) << from;
        return text.replace(text.find(from), from.size(), to);
    };
    const struct {
        std::string text;
        std::vector<const char *> expected;
    } cases[] = {
        {"", {"contains no frames; record one with sink_trajectory"}},
        {header, {"contains no frames"}},
        {header.substr(0, 100), {"1:101: the first line is truncated"}},
        {replaced(header, "arhost-trajectory", "arhost-trajectroy") + line(0),
         {"1:12: format:", "did you mean 'arhost-trajectory'"}},
        {replaced(header, "\"version\": 1", "\"version\": 2") + line(0), {"1:44: version: must be 1"}},
        {replaced(header, "\"mm\"", "\"m\"") + line(0), {"unit: 'm' is not one of mm"}},
        {replaced(header, "\"fx\": 600.1", "\"fx\": -1") + line(0), {"1:", "camera.fx: the focal length must be"}},
        {replaced(header, "\"fx\": 600.1", "\"fx\": .nan") + line(0), {"camera.fx: must be a finite number"}},
        {replaced(header, ", -0.2, 0.001", "") + line(0), {"camera.distortion.coefficients"}},
        {header + "garbage\n" + line(1), {"2:1: is not valid JSON; delete the line"}},
        {header + line(0) + "{\"frame\": 1, nonsense\n" + line(2), {"3:15: is not valid JSON"}},
        {header + std::string("\0\0\0\n", 4), {"2:1: is not valid JSON"}},
        {header + "[1]\n", {"2:1: must be an object"}},
        {header + "\n" + line(0), {"2:1: is not valid JSON"}},
        {header + "{\"capture_ns\": 0}\n", {"2:1: the key 'frame' is missing"}},
        {header + line(0, "\"up\": [0, 1, 0]"), {"2:1: the key 'eye' is missing"}},
        {header + line(0, R"("eye": [1, 2, 3], "up": [0, 1, 0])"), {"2:1: the key 'look_at' is missing"}},
        {header + line(-1), {"2:2: frame: must be at least 0"}},
        {header + "{\"frame\": 1.5, \"eye\": null}\n", {"2:2: frame: must be a whole number, but is 1.5"}},
        {header + "{\"eye\": null, \"frame\": " + std::string(100'000, '[') + std::string(100'000, ']') + "}\n",
         {"frame: must be a whole number"}},
        {header + line(0, R"("eye": [1, 2, 2e9], "look_at": [0, 0, 0], "up": [0, 1, 0])"),
         {"eye: the coordinates of eye and look_at must be between -1e9 and 1e9 mm"}},
        {header + line(3) + line(3), {"3:2: frame: must be greater than the frame number of the previous line, 3"}},
        {header + line(3) + "{\"frame\": 4, \"capture_ns\": 5, \"eye\": null}\n",
         {"3:14: capture_ns: must not be less than the capture time in the previous line"}},
        {header + line(0, R"("eye": [1, 2], "look_at": [0, 0, 0], "up": [0, 1, 0])"),
         {"2:31: eye: must be three numbers, or null in a frame without a camera"}},
        {header + line(0, R"("eye": [1, 2, 3], "look_at": [0, 0, "a"], "up": [0, 1, 0])"),
         {"look_at: must be three"}},
        {header + line(0, R"("eye": [1, 2, NaN], "look_at": [0, 0, 0], "up": [0, 1, 0])"),
         {"2:", "is not valid JSON"}},
        {header + line(0, R"("eye": [1, 2, 1e999], "look_at": [0, 0, 0], "up": [0, 1, 0])"),
         {"2:", "is not valid JSON"}},
        {header + line(0, R"("eye": [1, 2, 3], "look_at": [1, 2, 3], "up": [0, 1, 0])"),
         {"eye: look_at must differ from eye"}},
        {header + line(0, R"("eye": [0, 0, 5], "look_at": [0, 0, 4], "up": [0, 0, 2])"), {"eye: up must not be 0"}},
    };
    for (const auto &c : cases)
        for (const char *part : c.expected)
            EXPECT_THAT(error(c.text), HasSubstr(part)) << c.text;
}

TEST_F(Trajectories, RejectPathsThatAreNotRegularFiles) {
    EXPECT_EQ(error_of([&] { read_trajectory(file()); }),
              file().string() + ": cannot be read: No such file or directory");
    EXPECT_THAT(error_of([&] { read_trajectory(folder_.path()); }), HasSubstr("is not a regular file"));
    ASSERT_EQ(::mkfifo(file().c_str(), 0600), 0);
    EXPECT_THAT(error_of([&] { read_trajectory(file()); }), HasSubstr("is not a regular file"));
}

TEST_F(Trajectories, DissertationFormatHasNoIntrinsicsAnd30FramesPerSecond) {
    const Trajectory trajectory = read(record + record + record);
    EXPECT_FALSE(trajectory.intrinsics);
    EXPECT_FALSE(trajectory.clock);
    EXPECT_EQ(trajectory.fps, 30);
    ASSERT_EQ(trajectory.frames.size(), 3u);
    EXPECT_EQ(trajectory.frames[2].frame, 2u);
    EXPECT_EQ(trajectory.frames[2].capture_ns, 66'666'667);
    EXPECT_THAT(trajectory.frames[1].view->eye_mm, ElementsAre(1.5, -721.148, 500.637));
    EXPECT_THAT(trajectory.frames[1].view->look_at_mm, ElementsAre(1.5, -720.282, 500.138));
    EXPECT_THAT(trajectory.frames[1].view->up, ElementsAre(0.0461728, 0.497528, 0.866218));
}

TEST_F(Trajectories, DissertationFormatAllowsEmptyLinesForFramesWithoutACamera) {
    const Trajectory trajectory = read("\n" + record + " \r\n" + record + "\n");
    ASSERT_EQ(trajectory.frames.size(), 5u);
    for (const std::size_t empty : {0, 2, 4})
        EXPECT_FALSE(trajectory.frames[empty].view) << empty;
    EXPECT_TRUE(trajectory.frames[3].view);
}

TEST_F(Trajectories, DissertationFormatIgnoresATruncatedLastLine) {
    for (std::size_t cut = 1; cut + 2 < record.size(); ++cut) {
        const Trajectory trajectory = read(record + record.substr(0, cut));
        EXPECT_EQ(trajectory.frames.size(), 1u) << record.substr(0, cut);
        EXPECT_EQ(trajectory.warning, file().string() + ":2: the last line is truncated and was ignored");
    }
    // A blank after the ninth number proves that the number is complete.
    const Trajectory whole = read(record + record.substr(0, record.size() - 1));
    EXPECT_EQ(whole.frames.size(), 2u);
    EXPECT_EQ(whole.warning, "");
}

TEST_F(Trajectories, DissertationFormatErrorsNamePositionAndFix) {
    EXPECT_THAT(error("what is this\n"), HasSubstr("1:1: 'what' is not a number; a line has nine"));
    EXPECT_THAT(error(record + "1 2 x 4 5 6 7 8 9\n"), HasSubstr("2:5: 'x' is not a number"));
    EXPECT_THAT(error(record + "1 2 nan 4 5 6 7 8 9\n"), HasSubstr("2:5: 'nan' is not a number"));
    EXPECT_THAT(error(record + "1 2 inf 4 5 6 7 8 9\n"), HasSubstr("2:5: 'inf' is not a number"));
    EXPECT_THAT(error(record + "1 2 1e999 4 5 6 7 8 9\n"), HasSubstr("2:5: '1e999' is not a number"));
    EXPECT_THAT(error("1 2 3\n" + record), HasSubstr("1:6: the line has 3 numbers; eye, look_at and up need nine"));
    EXPECT_THAT(error("1 2 3 4 5 6 7 8 9 10\n"), HasSubstr("1:19: the line has more than nine numbers"));
    EXPECT_THAT(error("1 2 3 1 2 3 7 8 9\n"), HasSubstr("1:1: look_at must differ"));
    EXPECT_THAT(error("0 0 3 0 0 2 0 0 9\n"), HasSubstr("1:1: up must not be 0"));
    EXPECT_THAT(error(std::string("\0\0", 2) + "\n"), HasSubstr("1:1: "));
    EXPECT_THAT(error("1 2 3"), HasSubstr("contains no frames"));
}

TEST_F(Trajectories, ReadTheExampleOfTheDocumentation) {
    std::ifstream stream(arhost::test::source_directory() + "/docs/trajectories.md");
    const std::string document{std::istreambuf_iterator<char>(stream), {}};
    const std::size_t begin = document.find("```json\n") + 8;
    const Trajectory trajectory = read(document.substr(begin, document.find("```", begin) - begin));
    ASSERT_EQ(trajectory.frames.size(), 2u);
    EXPECT_TRUE(trajectory.frames[0].view);
    EXPECT_FALSE(trajectory.frames[1].view);
}

TEST_F(Trajectories, ReadTheDissertationsSampleFiles) {
    ARHOST_REQUIRE_SHARED_DATA("seed-samples/camPose.txt");
    const struct {
        const char *file;
        std::size_t frames;
    } samples[] = {{"seed-samples/camPose.txt", 4289}, {"seed-samples/camPoseDragon.txt", 4377}};
    for (const auto &sample : samples) {
        const Trajectory trajectory = read_trajectory(test::shared_data(sample.file));
        EXPECT_EQ(trajectory.frames.size(), sample.frames) << sample.file;
        EXPECT_THAT(trajectory.warning, HasSubstr(":" + std::to_string(sample.frames + 1) +
                                                  ": the last line is truncated and was ignored"));
        EXPECT_TRUE(std::ranges::all_of(trajectory.frames, [](const auto &frame) { return frame.view.has_value(); }));
    }
}

} // namespace arhost::camera
