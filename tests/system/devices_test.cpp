// SPDX-License-Identifier: Apache-2.0
//
// `arhost devices` with test plugins, which list cameras, GPUs and displays, or fail.
#include "arhost_run.hpp"
#include "device_schema.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>

using arhost::test::ArhostRun;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

namespace {

const std::vector<std::string> working = {"devices", "lister_cameras", "source_counter", "tracker_counter"};

std::vector<std::string> operator+(std::vector<std::string> list, const std::string &element) {
    list.push_back(element);
    return list;
}

// Opens /dev/full, which stands for the node of a camera that is in use.
struct Holder {
    int fd = ::open("/dev/full", O_WRONLY | O_CLOEXEC);
    std::string text = "in use by " + std::string(program_invocation_short_name).substr(0, 15) + " (process " +
                       std::to_string(::getpid()) + ")";
    ~Holder() { ::close(fd); }
};

} // namespace

TEST(Devices, AreListedAsText) {
    const Holder holder;
    ArhostRun run;
    EXPECT_EQ(run.run(working), 0) << run.output();
    const std::string output = run.messages();
    EXPECT_THAT(output,
                StartsWith("camera /dev/video-eye: Eye, serial number 0042 [lister_cameras]\n"
                           "    yuyv    640×480 7.5–30 fps, 1280×720 30 fps\n"
                           "    grey    32×24 1–60 fps to 4096×3072\n"
                           "    mjpeg\n"
                           "    gain                            integer -16 to 16 in steps of 4, default 0, now 8\n"
                           "    mute                            boolean 0 to 1, default 1\n"
                           "    reset                           button\n"
                           "camera /dev/full: Taken [lister_cameras]\n"
                           "    cannot be used: in use by "));
    EXPECT_THAT(output, HasSubstr(holder.text.substr(std::strlen("in use by "))));
    EXPECT_THAT(output, HasSubstr("camera /dev/null: Private [lister_cameras]\n    cannot be used: "));
    EXPECT_THAT(output, HasSubstr("camera: Broken [lister_cameras]\n    cannot be used: no lens\n"
                                  "GPU 0: Abacus  [2J3000 (discrete GPU, 0d15c0de-0000) [source_counter]\n"
                                  "    counts: up, down\n"
                                  "GPU 1: Ten fingers (CPU), the default [source_counter]\n"
                                  "display: Screen, 1920×1080, 59.94 Hz [lister_cameras]\n"));
    EXPECT_THAT(output, Not(HasSubstr("tracker_counter"))) << "it lists no devices";
}

TEST(Devices, AreListedAsJsonOfTheSchema) {
    const Holder holder;
    ArhostRun run;
    EXPECT_EQ(run.run(working + "--json"), 0) << run.output();
    const auto json = nlohmann::json::parse(run.messages());
    ASSERT_EQ(json["cameras"].size(), 4u);
    const auto &eye = json["cameras"][0];
    EXPECT_EQ(eye["plugin"], "lister_cameras");
    EXPECT_EQ(eye["path"], "/dev/video-eye");
    EXPECT_EQ(eye["serial"], "0042");
    EXPECT_EQ(eye["problem"], nullptr);
    EXPECT_EQ(eye["formats"][0]["pixel_format"], "yuyv");
    EXPECT_EQ(eye["formats"][0]["sizes"][0]["width"], 640);
    EXPECT_EQ(eye["formats"][0]["sizes"][0]["rates"], nlohmann::json({30.0, 30000. / 1001, 7.5}));
    EXPECT_EQ(eye["formats"][1]["is_size_range"], true);
    EXPECT_EQ(eye["controls"][0], nlohmann::json({{"name", "gain"},
                                                  {"type", "integer"},
                                                  {"minimum", -16},
                                                  {"maximum", 16},
                                                  {"step", 4},
                                                  {"default", 0},
                                                  {"value", 8}}));
    EXPECT_EQ(eye["controls"][1]["value"], nullptr);
    EXPECT_THAT(json["cameras"][1]["problem"].get<std::string>(),
                HasSubstr(holder.text.substr(std::strlen("in use by "))));
    EXPECT_EQ(json["cameras"][3]["path"], nullptr);
    EXPECT_EQ(json["cameras"][3]["problem"], "no lens");
    EXPECT_EQ(json["gpus"].size(), 2u);
    EXPECT_EQ(json["gpus"][0]["kind"], "discrete GPU");
    EXPECT_EQ(json["displays"][0]["rate"], 59.94);
    EXPECT_EQ(json["problems"].size(), 0u);
    if (!arhost::test::can_validate())
        GTEST_SKIP() << "the schema is not checked: Debian's package python3-jsonschema is not installed";
    EXPECT_EQ(arhost::test::schema_violation(json), "");
}

// A schema that accepts everything would not notice a wrong output.
TEST(Devices, TheSchemaRejectsOtherJson) {
    if (!arhost::test::can_validate())
        GTEST_SKIP() << "Debian's package python3-jsonschema is not installed";
    nlohmann::json json = {{"cameras", nlohmann::json::array()},
                           {"gpus", nlohmann::json::array()},
                           {"displays", nlohmann::json::array()},
                           {"problems", nlohmann::json::array()}};
    EXPECT_EQ(arhost::test::schema_violation(json), "");
    json["displays"].push_back(
        {{"plugin", "p"}, {"name", "n"}, {"width", 0}, {"height", 1}, {"rate", 60}, {"problem", nullptr}});
    EXPECT_THAT(arhost::test::schema_violation(json), HasSubstr("0 is less than the minimum of 1"));
    json["displays"][0]["width"] = 1;
    EXPECT_EQ(arhost::test::schema_violation(json), "");
    json["displays"][0].erase("problem");
    EXPECT_THAT(arhost::test::schema_violation(json), HasSubstr("'problem' is a required property"));
}

TEST(Devices, OfAllPluginsAreListedDespitePluginsThatFail) {
    ArhostRun run;
    // Shader caches are written to the scratch folder.
    run.start({"devices", "--json"}, [&] { ::setenv("XDG_CACHE_HOME", run.path("cache").c_str(), 1); });
    EXPECT_EQ(run.wait(), 1) << "some test plugins are broken";
    const std::string output = run.messages();
    const auto json = nlohmann::json::parse(output.substr(output.find("{\n")), nullptr, false);
    ASSERT_FALSE(json.is_discarded()) << output;
    std::map<std::string, std::string> problems;
    for (const auto &problem : json["problems"])
        problems[problem["plugin"]] = problem["problem"];
    EXPECT_EQ(problems["lister_fail"], "cannot list its devices: the driver is too old");
    EXPECT_EQ(problems["lister_broken"], "cannot list its devices: it reported a device without a name");
    EXPECT_THAT(problems["lister_crash"], AllOf(StartsWith("cannot list its devices: killed by signal 11 "),
                                                testing::EndsWith(" while it listed its devices")));
    EXPECT_THAT(problems["lister_hang"], StartsWith("cannot list its devices: did not respond within 20 s; "));
    EXPECT_THAT(problems["no_plugin"], StartsWith("cannot be used: "));
    EXPECT_EQ(problems["lister_many"], "lists 9936 more devices");
    EXPECT_FALSE(problems.contains("lister_none"));
    std::map<std::string, int> gpus;
    for (const auto &gpu : json["gpus"])
        ++gpus[gpu["plugin"]];
    EXPECT_EQ(gpus["lister_many"], 64);
    EXPECT_EQ(gpus["source_counter"], 2);
    EXPECT_EQ(json["cameras"].size(),
              4u + static_cast<std::size_t>(std::ranges::count_if(
                       json["cameras"], [](const auto &c) { return c["plugin"] == "source_v4l2"; })));
    if (arhost::test::can_validate()) {
        EXPECT_EQ(arhost::test::schema_violation(json), "");
    }
}

TEST(Devices, TheAbsenceOfEachKindIsStated) {
    ArhostRun run;
    EXPECT_EQ(run.run({"devices", "lister_none"}), 0) << run.output();
    EXPECT_EQ(run.messages(), "no display: use sink_video or sink_images instead\n") << "the plugin is a sink";
    if (std::filesystem::exists("/dev/video0"))
        GTEST_SKIP() << "this machine has a camera";
    EXPECT_EQ(run.run({"devices", "source_v4l2"}), 0) << run.output();
    EXPECT_EQ(run.messages(), "no camera: connect one, or use source_synthetic or source_file instead\n");
}

TEST(Devices, AMissingDisplayHasAReason) {
    ArhostRun run;
    run.start({"devices", "--json", "sink_window"}, [] { ::unsetenv("DISPLAY"); });
    EXPECT_EQ(run.wait(), 0) << run.output();
    const auto json = nlohmann::json::parse(run.messages());
    ASSERT_EQ(json["displays"].size(), 1u);
    EXPECT_THAT(json["displays"][0]["problem"].get<std::string>(), HasSubstr("DISPLAY"));
    EXPECT_EQ(json["displays"][0]["width"], nullptr);
}

TEST(Devices, OfAnUnknownPluginAreAnInvalidCommandLine) {
    ArhostRun run;
    run.expect({"devices", "source_v5l2"}, 2, {"there is no plugin 'source_v5l2'; did you mean 'source_v4l2'?"});
}

// The scratch folder is not the configuration's folder.
TEST(Lab, SaysOnceWhatToUseWithoutACamera) {
    if (std::filesystem::exists("/dev/video0"))
        GTEST_SKIP() << "this machine has a camera";
    const std::string lab = arhost::test::source_directory() + "/config/lab.yaml";
    for (const std::vector<std::string> &arguments : {std::vector{lab}, std::vector<std::string>{"check", lab}}) {
        ArhostRun run;
        EXPECT_EQ(run.run(arguments), 2);
        const std::string text = run.messages();
        EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
        EXPECT_THAT(text, HasSubstr("source: device: '/dev/video0' does not exist; "));
        EXPECT_THAT(text, testing::AnyOf(HasSubstr("available: /dev/video"),
                                         HasSubstr("connect a camera, or use 'source_synthetic' or 'source_file'")));
    }
    ArhostRun run;
    EXPECT_EQ(run.run({"check", "--no-open", lab}), 0) << run.output();
}
