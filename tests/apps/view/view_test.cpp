// SPDX-License-Identifier: Apache-2.0
//
// Runs arhost-view without a display.
#include "plugin_under_test.hpp"
#include "waiting.hpp"

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sys/wait.h>
#include <unistd.h>

namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const std::string counter = arhost::test::test_plugin_directory() + "/rt_counter.so";

class View : public testing::Test {
protected:
    // A triangle whose node moves 1 m up in one animation and 2 m to the right in the other, with two variants.
    void SetUp() override {
        ::unsetenv("DISPLAY");
        ::unsetenv("WAYLAND_DISPLAY");
        const std::array<float, 9> corners{0, 0, 0, 1, 0, 0, 0, 1, 0};
        const std::array<float, 14> motion{0, 2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2, 0, 0};
        std::ofstream bin(folder() / "model.bin", std::ios::binary);
        bin.write(reinterpret_cast<const char *>(corners.data()), sizeof corners);
        bin.write(reinterpret_cast<const char *>(motion.data()), sizeof motion);
        std::ofstream(folder() / "model.gltf") << R"({"asset": {"version": "2.0"},
            "extensionsUsed": ["KHR_materials_variants", "EXT_unknown"],
            "extensions": {"KHR_materials_variants": {"variants": [{"name": "red"}, {"name": "blue"}]}},
            "buffers": [{"uri": "model.bin", "byteLength": 92}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 8},
                            {"buffer": 0, "byteOffset": 44, "byteLength": 24}, {"buffer": 0, "byteOffset": 68, "byteLength": 24}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
                          {"bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [2]},
                          {"bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3"},
                          {"bufferView": 3, "componentType": 5126, "count": 2, "type": "VEC3"}],
            "materials": [{"name": "paper", "doubleSided": true}, {"name": "lacquer", "doubleSided": true,
                          "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0, "extensions": {"KHR_materials_variants":
                       {"mappings": [{"material": 1, "variants": [0]}]}}}]}],
            "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0,
            "animations": [{"name": "up", "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
                            "samplers": [{"input": 1, "output": 2}]},
                           {"name": "right", "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
                            "samplers": [{"input": 1, "output": 3}]}]})";
    }
    const fs::path &folder() const { return scratch_.path(); }
    std::string model() const { return (folder() / "model.gltf").string(); }
    static std::string program() { return arhost::test::build_directory() + "/bin/arhost-view "; }
    static std::string scene(const std::string &name) {
        return arhost::test::source_directory() + "/config/scenes/" + name + ".yaml";
    }

    int status_of(const std::string &arguments) const {
        const int status =
            std::system((program() + arguments + " > " + (folder() / "output.txt").string() + " 2>&1").c_str());
        return WEXITSTATUS(status);
    }
    std::string printed() const { return read(folder() / "output.txt"); }

    // The bytes of a picture of a scene; empty if the program fails.
    std::string picture(const std::string &name, const std::string &options,
                        const std::string &samples = "--samples 1") const {
        const fs::path file = folder() / "picture.ppm";
        fs::remove(file);
        status_of(scene(name) + " --backdrop checkerboard --size 80x60 --output " + file.string() + " " + samples +
                  " " + options);
        return read(file);
    }
    cv::Mat picture_of(const std::string &file, const std::string &options) const {
        const std::string picture = folder() / "picture.png";
        EXPECT_EQ(status_of(file + " --size 80x60 --samples 1 -o " + picture + " " + options), 0) << printed();
        return cv::imread(picture, cv::IMREAD_UNCHANGED);
    }

private:
    static std::string read(const fs::path &file) {
        std::ifstream stream(file, std::ios::binary);
        return {std::istreambuf_iterator<char>(stream), {}};
    }

    arhost::test::ScratchFolder scratch_;
};

double difference(const cv::Mat &a, const cv::Mat &b) {
    return cv::norm(a, b, cv::NORM_INF);
}

} // namespace

TEST_F(View, PrintsWhatAFileContains) {
    ASSERT_EQ(status_of(model() + " --info"), 0) << printed();
    EXPECT_THAT(printed(), AllOf(HasSubstr("nodes       1\n"), HasSubstr("1: 1 triangle, 3 vertices\n"),
                                 HasSubstr("box         1000 × 1000 × 0 mm"),
                                 HasSubstr("to (1000, 2000, 0), over the animation\n"),
                                 HasSubstr("animations  0 up, 2 s, shown\n"), HasSubstr(" 1 right, 2 s\n"),
                                 HasSubstr("variants    red\n")));
}

TEST_F(View, NamesWhatTheLoaderIgnoresOnce) {
    ASSERT_EQ(status_of(model() + " --info"), 0);
    const std::string text = printed();
    EXPECT_THAT(text, HasSubstr("notes       unsupported extensions are ignored: EXT_unknown\n"));
    EXPECT_THAT(text, AllOf(Not(HasSubstr("available for")), Not(HasSubstr("fit_mm"))));
}

TEST_F(View, ShowsTheModelOnItsGroundFromTheFront) {
    const cv::Mat shown = picture_of(model(), "--transparent --set samples=16");
    ASSERT_EQ(shown.channels(), 4);
    EXPECT_EQ(shown.at<cv::Vec4b>(40, 30)[3], 255) << "the triangle";
    EXPECT_EQ(shown.at<cv::Vec4b>(2, 40)[3], 0) << "above it";
    int shadow = 0;
    for (int x = 0; x < shown.cols; ++x)
        shadow += shown.at<cv::Vec4b>(shown.rows - 3, x)[3] > 0 && shown.at<cv::Vec4b>(shown.rows - 3, x)[3] < 200;
    EXPECT_GT(shadow, 5) << "on the ground";
}

TEST_F(View, ChoosesTheAnimationAndTheVariant) {
    const std::string view = "--eye 0,1000,6000 --look-at 0,1000,0 ";
    const cv::Mat rest = picture_of(model(), view + "--animation none --time 1");
    const cv::Mat up = picture_of(model(), view + "--time 1"),
                  right = picture_of(model(), view + "--time 1 --animation right");
    EXPECT_GT(difference(rest, up), 30);
    EXPECT_GT(difference(up, right), 30);
    EXPECT_EQ(difference(up, picture_of(model(), view + "--time 1 --animation up")), 0) << "the first is the default";
    EXPECT_GT(difference(rest, picture_of(model(), view + "--animation none --variant red")), 30);
    EXPECT_EQ(status_of(model() + " --info --animation jump"), 2);
    EXPECT_THAT(printed(), HasSubstr("model.gltf: has no animation 'jump'; available: 0 'up', 1 'right'"));
    EXPECT_EQ(status_of(model() + " --info --variant green"), 2);
    EXPECT_THAT(printed(), HasSubstr("has no variant 'green'; available: 'red', 'blue'"));
}

TEST_F(View, WritesAFilmOfOneTurn) {
    const std::string film = folder() / "turn.mp4";
    ASSERT_EQ(status_of(model() + " --size 80x60 --seconds 1 --fps 8 --animation none -o " + film), 0) << printed();
    cv::VideoCapture video(film);
    std::vector<cv::Mat> frames;
    for (cv::Mat frame; video.read(frame);)
        frames.push_back(frame.clone());
    ASSERT_EQ(frames.size(), 8u);
    EXPECT_EQ(frames[0].size(), cv::Size(80, 60));
    EXPECT_GT(difference(frames[0], frames[2]), 50) << "the camera has turned";
}

TEST_F(View, AnInterruptedFilmLeavesNothing) {
    const pid_t pid = ::fork();
    if (pid == 0) {
        const std::string film = folder() / "turn.mp4", file = program().substr(0, program().size() - 1);
        ::execl(file.c_str(), file.c_str(), model().c_str(), "--seconds", "600", "-o", film.c_str(), nullptr);
        ::_exit(127);
    }
    const auto is_partial = [](const fs::directory_entry &entry) {
        return entry.path().filename().string().starts_with(".turn.mp4");
    };
    const auto is_writing = [&] {
        return std::any_of(fs::directory_iterator(folder()), fs::directory_iterator(), is_partial);
    };
    EXPECT_TRUE(arhost::test::eventually(is_writing));
    ::kill(pid, SIGINT);
    int status = 0;
    ::waitpid(pid, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGINT) << status;
    EXPECT_FALSE(is_writing());
    EXPECT_FALSE(fs::exists(folder() / "turn.mp4"));
}

TEST_F(View, AMeshWithoutMaterialsIsShownInGreyAndAnStlFileUpright) {
    std::ofstream(folder() / "tiny.obj") << "v 0 0 0\nv 1e-6 0 0\nv 0 1e-6 0\nf 1 2 3\n";
    const cv::Mat tiny = picture_of((folder() / "tiny.obj").string(), "");
    EXPECT_THAT(printed(), HasSubstr("has no materials; shown with a plain one"));
    std::ofstream(folder() / "huge.obj") << "v 0 0 0\nv 1e6 0 0\nv 0 1e6 0\nf 1 2 3\n";
    EXPECT_LT(cv::norm(tiny, picture_of((folder() / "huge.obj").string(), ""), cv::NORM_L1) / (80 * 60 * 3), 3)
        << "at any size";
    std::ofstream(folder() / "flat.stl")
        << "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\n"
           "endloop\nendfacet\nendsolid\n";
    EXPECT_LT(cv::norm(tiny, picture_of((folder() / "flat.stl").string(), ""), cv::NORM_L1) / (80 * 60 * 3), 3)
        << "z is up";
}

TEST_F(View, RejectsWhatIsNoModel) {
    std::ofstream(folder() / "empty.glb");
    for (const auto &[file, reason] :
         {std::pair<std::string, std::string>{folder().string(), "is a folder; name a model"},
          {(folder() / "missing.glb").string(), "there is no such file"},
          {(folder() / "empty.glb").string(), "cannot be loaded as glTF 2.0"}}) {
        EXPECT_EQ(status_of(file + " --info"), 2);
        EXPECT_THAT(printed(), HasSubstr(reason));
    }
    EXPECT_EQ(status_of(scene("demo") + " --info --environment sky.hdr"), 2);
    EXPECT_THAT(printed(), HasSubstr("--environment: a scene file has its own light"));
}

TEST_F(View, WithoutADisplayNamesTheOptionForFiles) {
    EXPECT_EQ(status_of(model()), 2);
    EXPECT_THAT(printed(), AllOf(HasSubstr("DISPLAY"), HasSubstr("--output FILE.png")));
    EXPECT_EQ(status_of(model() + " -o turn.gif"), 2);
    EXPECT_THAT(printed(), HasSubstr("turn.gif: the file's name must end in"));
}

TEST_F(View, ShowsMovingObjectsAtTheGivenTime) {
    const std::string early = picture("moving", "--time 1"), late = picture("moving", "--time 2.5");
    ASSERT_FALSE(early.empty()) << printed();
    EXPECT_NE(early, late);
    EXPECT_EQ(picture("moving", "--time 8.5"), late) << "a loop takes 6 s";
    EXPECT_EQ(picture("moving", ""), picture("moving", "--time 0"));
}

TEST_F(View, RejectsAnOutputThatIsASceneInput) {
    const fs::path scene = folder() / "wood.yaml";
    std::ofstream(scene) << "version: 1\n";
    fs::create_hard_link(scene, folder() / "link.png");
    EXPECT_EQ(status_of(scene.string() + " --output " + (folder() / "link.png").string()), 2);
    EXPECT_THAT(printed(), HasSubstr("link.png: the scene reads this file; choose another"));
    EXPECT_EQ(fs::file_size(scene), 11u);
}

TEST_F(View, ReportsUsageErrorsInOneLineWithoutTerminalControls) {
    EXPECT_EQ(status_of("a.yaml --output a.png '--no\x1b[2Jsuch'"), 2);
    EXPECT_THAT(printed(), AllOf(HasSubstr("--no [2Jsuch"), Not(HasSubstr("\x1b"))));
    EXPECT_EQ(status_of("'no\x1b[2Jsuch.yaml' --output " + (folder() / "a.png").string()), 2);
    EXPECT_THAT(printed(), AllOf(HasSubstr("no [2Jsuch.yaml"), Not(HasSubstr("\x1b"))));
    EXPECT_FALSE(fs::exists(folder() / "a.png"));
    EXPECT_EQ(status_of("--help"), 0);
    EXPECT_THAT(printed(), AllOf(HasSubstr("--eye X,Y,Z"), HasSubstr("--size WIDTHxHEIGHT")));
}

TEST_F(View, RejectsInvalidTimesAndSampleCounts) {
    for (const char *option : {"--time -1", "--time soon", "--light-samples 0", "--samples 257"}) {
        EXPECT_EQ(picture("moving", option), "") << option;
        EXPECT_THAT(printed(), HasSubstr(std::string(option).substr(0, std::string(option).find(' '))));
    }
}

TEST_F(View, RunsAnyRayTracerByNameOrFile) {
    const std::string embree = picture("demo", "");
    ASSERT_FALSE(embree.empty()) << printed();
    EXPECT_EQ(picture("demo", "--raytracer " + arhost::test::plugin_directory() + "/rt_embree.so"), embree)
        << printed();

    // rt_counter draws a square in the corner whose colour encodes the camera distance; the rest is checkerboard.
    const std::string from_above = "--eye 0,0,513 --look-at 0,0,0 ";
    const std::string counted = picture("demo", from_above + "--raytracer " + counter, "");
    ASSERT_FALSE(counted.empty()) << printed();
    const std::string header = "P6\n80 60\n255\n";
    ASSERT_EQ(counted.size(), header.size() + 80 * 60 * 3);
    EXPECT_EQ(counted.substr(0, header.size() + 3), header + std::string("\x0d\x00\xaa", 3));
    EXPECT_EQ(counted.substr(counted.size() - 3), "\xb0\xb0\xb0");
    ::setenv("ARHOST_PLUGIN_PATH", arhost::test::test_plugin_directory().c_str(), 1);
    EXPECT_EQ(picture("demo", from_above + "--raytracer rt_counter", ""), counted) << printed();
    ::unsetenv("ARHOST_PLUGIN_PATH");
}

TEST_F(View, PassesOptionsToThePlugin) {
    const std::string one = picture("demo", ""), four = picture("demo", "", "--samples 4");
    ASSERT_FALSE(one.empty()) << printed();
    EXPECT_NE(four, one);
    EXPECT_EQ(picture("demo", "--set samples=4"), four) << "--set overrides --samples";
    EXPECT_EQ(picture("demo", "", ""), picture("demo", "", "--samples 16")) << "the default";
    EXPECT_NE(picture("moving", "--light-samples 1"), picture("moving", "--light-samples 4"));
    EXPECT_EQ(picture("moving", "--set light_samples=2"), picture("moving", "--light-samples 2"));
}

TEST_F(View, ReportsErrorsOfThePluginAndItsOptions) {
    const auto rejected = [&](const std::string &options, const std::string &samples = "") {
        EXPECT_EQ(picture("demo", options, samples), "") << options;
        return printed();
    };
    EXPECT_THAT(rejected("--raytracer rt_embre"),
                HasSubstr("--raytracer: there is no plugin 'rt_embre'; did you mean 'rt_embree'?"));
    EXPECT_THAT(rejected("--raytracer ./nowhere.so"), HasSubstr("--raytracer: there is no plugin '"));
    EXPECT_THAT(rejected("--raytracer sink_null"), HasSubstr("--raytracer: 'sink_null' is a sink, not a ray tracer"));
    EXPECT_THAT(rejected("--raytracer " + arhost::test::test_plugin_directory() + "/no_plugin.so"),
                HasSubstr("is not an arhost plugin"));
    EXPECT_THAT(rejected("--set sampels=4"), HasSubstr("--set: sampels: unknown key; did you mean 'samples'?"));
    EXPECT_THAT(rejected("--set samples=1000"), HasSubstr("--set: samples: "));
    EXPECT_THAT(rejected("--set samples"), HasSubstr("--set samples: the argument must be key=value"));
    EXPECT_THAT(rejected("--raytracer " + counter, "--samples 2"), HasSubstr("--samples: samples: unknown key"));
    // Expects the plugin's log message, then the failed call.
    EXPECT_THAT(
        rejected("--set reject=true --raytracer " + counter),
        HasSubstr("rejected, as the option 'reject' requests\nerror: rt_counter: create: configuration error"));
    EXPECT_THAT(rejected("--set error_at=13 --eye 0,0,513 --look-at 0,0,0 --raytracer " + counter),
                HasSubstr("rt_counter: render: internal error"));
}
