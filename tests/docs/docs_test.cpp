// SPDX-License-Identifier: Apache-2.0
#include "arhost_run.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>
#include <opencv2/aruco.hpp>

#include <regex>

using namespace arhost::test;
namespace fs = std::filesystem;

namespace {

const fs::path root = arhost::test::source_directory();

std::vector<fs::path> documents() {
    std::vector<fs::path> found = {root / "README.md", root / "CONTRIBUTING.md", root / "CHANGELOG.md"};
    for (const char *folder : {"config", "docs", "plugins"})
        for (const auto &entry : fs::recursive_directory_iterator(root / folder))
            if (entry.path().extension() == ".md")
                found.push_back(entry.path());
    return found;
}

std::vector<std::string> yaml_blocks(const std::string &markdown) {
    std::vector<std::string> blocks;
    for (std::size_t at = 0; (at = markdown.find("```yaml\n", at)) != std::string::npos;) {
        at += 8;
        const std::size_t end = markdown.find("```", at);
        blocks.push_back(markdown.substr(at, end - at));
        at = end;
    }
    return blocks;
}

} // namespace

// Runs in an empty folder, because the configurations work from any folder.
TEST(Documentation, ConfigurationsWorkWithEitherTracker) {
    ArhostRun run;
    run.write("frames/color_image_0000.png", "x"); // the inputs that docs/config.md and docs/backend-guide.md name
    run.write("flat.py", "");
    run.write("scene.yaml", small_scene);
    std::vector<std::string> configurations;
    for (const fs::path &document : documents())
        for (const std::string &block : yaml_blocks(read_file(document)))
            if (block.find("\ntracker:") != std::string::npos) {
                configurations.push_back(document.filename().string() + ".yaml");
                run.write(configurations.back(), block);
            }
    EXPECT_THAT(configurations, testing::UnorderedElementsAre("README.md.yaml", "config.md.yaml", "control.md.yaml",
                                                              "backend-guide.md.yaml", "trajectories.md.yaml"));
    for (const auto &entry : fs::directory_iterator(root / "config"))
        if (entry.path().extension() == ".yaml")
            configurations.push_back(entry.path().string());
    for (const std::string &configuration : configurations)
        for (const std::string tracker : {"tracker_aruco", "tracker_apriltag"})
            EXPECT_EQ(run.run({"check", "--no-open", configuration, "--set", "tracker.plugin=" + tracker}), 0)
                << configuration << ": " << run.output();
}

TEST(Documentation, DemonstrationOpensAndIsDescribed) {
    ArhostRun run;
    const std::string demo = (root / "config/demo.yaml").string();
    EXPECT_EQ(run.run({"check", demo, "--set", "tracker.plugin=tracker_apriltag"}), 0) << run.output();
    for (const char *line : {"source: source_synthetic: 1280 x 720 px, 30 fps, 150 frames\n", "\ncamera: fx ",
                             "\ntracker: tracker_apriltag: 'tag36h11-0' (tag36h11 0)\n", "\nraytracer: rt_embree: /",
                             "\noutput: sink_video: /", "out/demo.mp4\n", "demo.yaml: OK\n"})
        EXPECT_THAT(run.output(), testing::HasSubstr(line));
    EXPECT_FALSE(run.exists("out"));
}

// Runs all commands in docs/trajectories.md in order, with only a few frames.
TEST(Documentation, ContainsWorkingRecordAndReplayCommands) {
    const std::string document = read_file(root / "docs/trajectories.md");
    ArhostRun run;
    run.write("record.yaml", yaml_blocks(document).at(0));
    const std::size_t begin = document.find("```sh\n") + 6;
    std::istringstream commands(document.substr(begin, document.find("```", begin) - begin));
    int tried = 0;
    for (std::string command; std::getline(commands, command);) {
        if (!command.starts_with("arhost "))
            continue;
        std::vector<std::string> arguments;
        const std::regex word(R"re("([^"]*)"|(\S+))re");
        for (std::sregex_iterator it(command.begin(), command.end(), word), end; it != end; ++it)
            arguments.push_back((*it)[1].matched ? (*it)[1] : (*it)[2]);
        arguments.erase(arguments.begin());
        arguments.insert(arguments.end(), {"--frames", "4"});
        EXPECT_EQ(run.run(arguments), 0) << command << "\n" << run.output();
        ++tried;
    }
    EXPECT_EQ(tried, 4);
    for (const char *file : {"out/run.trajectory.jsonl", "out/pure.json", "out/pure.mp4", "out/chain.json"})
        EXPECT_TRUE(run.exists(file)) << file;
}

TEST(Documentation, LinksToExistingFiles) {
    const std::regex link(R"(\]\(([^)#:]+)(#[^)]*)?\))");
    for (const fs::path &document : documents()) {
        const std::string text = read_file(document);
        for (std::sregex_iterator it(text.begin(), text.end(), link), end; it != end; ++it)
            EXPECT_TRUE(fs::exists(document.parent_path() / (*it)[1].str())) << document << ": " << (*it)[1];
    }
}

TEST(Documentation, NamesExistingCommands) {
    for (const char *command : {"tools/demo", "tools/test", "tools/bench", "tools/check-style", "tools/tidy",
                                "tools/setup", "tools/get-models", "tools/gallery", "tools/likeness"})
        EXPECT_EQ(::access((root / command).c_str(), X_OK), 0) << command;
}

// On a machine without a camera, config/lab.yaml must fail with a message that says how to proceed.
TEST(Documentation, LabConfigurationReportsAMissingCamera) {
    if (fs::exists("/dev/video0"))
        GTEST_SKIP() << "this machine has a camera";
    ArhostRun run;
    EXPECT_EQ(run.run({"--config", (root / "config/lab.yaml").string()}), 2);
    EXPECT_THAT(run.output(), testing::HasSubstr("/dev/video0"));
    EXPECT_THAT(run.output(), testing::HasSubstr("source_synthetic"));
}

TEST(Documentation, ShowsTheMarkerOfTheLabConfiguration) {
    cv::Mat expected;
    cv::aruco::drawMarker(cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11), 23, 8, expected);
    cv::Mat shown(8, 8, CV_8UC1, cv::Scalar(0));
    const std::string svg = read_file(root / "docs/images/marker-23.svg");
    const std::regex white(R"re(class="white" x="(\d)" y="(\d)")re");
    for (std::sregex_iterator it(svg.begin(), svg.end(), white), end; it != end; ++it)
        shown.at<std::uint8_t>(std::stoi((*it)[2]), std::stoi((*it)[1])) = 255;
    EXPECT_EQ(cv::norm(expected, shown, cv::NORM_L1), 0);
}
