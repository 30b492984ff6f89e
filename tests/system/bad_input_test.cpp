// SPDX-License-Identifier: Apache-2.0
//
// Tests that bad input results in a message that names the position and the fix, exit status 2, and no output file.
#include "arhost_run.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <sys/stat.h>

using namespace arhost::test;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

namespace {

const std::string good = counting({.source = "frames: 5"});

std::string replaced(std::string text, const std::string &from, const std::string &to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
}

// Returns a configuration that takes more than half a second to parse.
std::string big_scene() {
    std::string text = "version: 1\nnumbers: [0";
    for (int i = 0; i < 300'000; ++i)
        text += ", 0";
    return text + "]\n";
}

struct Case {
    const char *name;
    std::string yaml;
    std::vector<std::string> expected; // texts that the error message must contain
    std::string scene = small_scene;
};

const std::vector<Case> cases = {
    {"Syntax", "version: 1\nsource: [plugin\n", {"run.yaml:", "YAML syntax"}},
    {"UnknownKey",
     replaced(good, "deadline_ms", "deadlinems"),
     {"run.yaml:4:104: ", "tracker.deadlinems", "did you mean 'deadline_ms'"}},
    {"ConformOfAnOutput",
     replaced(good, "path: counted.txt", "path: counted.txt, conform: true"),
     {"run.yaml:6:", "outputs[0].conform: is not available for outputs", "arhost conform PLUGIN.so"}},
    {"DuplicateKey", good + "mode: live\n", {"run.yaml:8:", "mode", "duplicate key"}},
    {"WrongType",
     replaced(good, "side_mm: 80", "side_mm: wide"),
     {"run.yaml:4:", "tracker.targets[0].side_mm", "must be a number, but is 'wide'"}},
    {"MissingVideo",
     replaced(good, "source_counter,", "source_file, path: f-001.png,"),
     {"run.yaml:3:", "source.path: there is no file '", "did you mean 'f-0001.png'?"}},
    {"WildcardAsVideo",
     replaced(good, "source_counter,", "source_file, path: \"f-*.png\","),
     {"run.yaml:3:", "source.path: there is no file '", "numbered files as %d, or as %04d"}},
    {"InstalledScene",
     replaced(good, "scene.yaml", "dmo"),
     {"run.yaml:5:", "raytracer.scene: there is no scene file '", "did you mean 'demo'?"}},
    {"ColourByName",
     good,
     {"scene.yaml:3:", "must be '#rrggbb' (sRGB), a number or a list of three", "but is 'red'"},
     replaced(small_scene, "diffuse: 0.5", "diffuse: red")},
    {"FolderFarFromAnyOther",
     replaced(good, "path: counted.txt", "path: /nonexist/x/counted.txt"),
     {"run.yaml:6:", "outputs[0].path: there is no folder '/nonexist'; create it, or choose another path"}},
    {"SceneBeyondTheLimits",
     good,
     {"scene.yaml:5:3: objects[1]: object 1 'cuboid 1' extends beyond 4e+09 mm"},
     replaced(
         small_scene, "material: m}]",
         "material: m},\n  {cuboid: {size: 1e9}, material: m, motion: {keys: [{at_s: 0, scale: 1e3}, {at_s: 1}]}}]")},
    {"MarkerTwice",
     replaced(good, "[{marker: 3,", "[{name: cup, marker: 3, family: tag36h11, side_mm: 60}, {marker: 3,"),
     {"run.yaml:4:", "the marker tag36h11-3 also belongs to the target 'cup'"}},
    {"UnknownFamily",
     replaced(replaced(good, "tracker_counter", "tracker_aruco"), "family: tag36h11", "family: tag36h12"),
     {"run.yaml:4:", "tracker.targets[0].family: unknown dictionary 'tag36h12': tracker_aruco has tag36h11, "}},
    {"IdBeyondItsFamily",
     replaced(replaced(good, "tracker_counter", "tracker_aruco"), "[{marker: 3,",
              "[{name: cup, marker: 3, family: tag36h11, side_mm: 60}, {ids: 580-590,"),
     {"run.yaml:4:", "tracker.targets[1].ids: target 'tag36h11-587': marker id 587 is not in tag36h11, whose ids are "
                     "0 to 586"}},
    {"FamilyOfAMultiMarkerFile",
     replaced(replaced(good, "tracker_counter", "tracker_aruco"), "marker: 3, family: tag36h11, side_mm: 80",
              "name: board, map: marker.dat, family: tag36h12"),
     {"run.yaml:4:", "tracker.targets[0].family: unknown dictionary 'tag36h12': tracker_aruco has tag36h11, "}},
    {"FamilyOfAnotherTracker", // the message also quotes 'image', the family of the first target
     replaced(replaced(good, "tracker_counter", "tracker_image"), "[{marker: 3,",
              "[{name: cover, image: f-0001.png, width_mm: 60}, {marker: 3,"),
     {"run.yaml:4:",
      "tracker.targets[1].family: unknown family 'tag36h11': tracker_image finds targets with an 'image'"}},
    {"MarkersInsteadOfTargets",
     replaced(good, "targets: [{marker: 3, family: tag36h11,", "markers: [{id: 3,"),
     {"run.yaml:4:", "write: targets: [{marker: 3, family: tag36h11, side_mm: 80}]"}},
    {"TrajectoryWithoutUser",
     "version: 1\ntrajectory: path.txt\noutputs: [{plugin: sink_counter, path: counted.txt}]\n",
     {"run.yaml:2:13", "trajectory", "needs a 'source'", "or a 'raytracer'"}},
    {"NoVersion", replaced(good, "version: 1\n", ""), {"run.yaml:1:", "'version' is missing"}},
    {"WrongVersion", replaced(good, "version: 1\n", "version: 2\n"), {"run.yaml:1:10", "must be 1"}},
    {"WrongMode", replaced(good, "lockstep", "lockstp"), {"run.yaml:2:7", "did you mean 'lockstep'"}},
    {"UnknownPlugin",
     replaced(good, "tracker_counter", "tracker_conter"),
     {"run.yaml:4:", "there is no plugin 'tracker_conter'", "did you mean 'tracker_counter'"}},
    {"PluginOfWrongKind",
     replaced(good, "tracker_counter", "rt_counter"),
     {"run.yaml:4:", "'rt_counter' is a raytracer, not a tracker"}},
    {"UnknownOption",
     replaced(good, "frames: 5", "frame: 5"),
     {"run.yaml:3:", "source.options.frame", "did you mean 'frames'"}},
    {"OptionOfWrongType",
     replaced(good, "frames: 5", "frames: many"),
     {"run.yaml:3:", "source.options.frames", "whole number"}},
    {"OptionOutOfRange",
     replaced(good, "frames: 5", "width: 0"),
     {"run.yaml:3:", "source.options.width", "must be 1 to 4096, but is 0"}},
    {"OptionMissing", replaced(good, ", path: counted.txt", ""), {"run.yaml:6:", "sink_counter needs 'path'"}},
    {"PluginRejectsOptions",
     replaced(good, "scene.yaml, options: {", "scene.yaml, options: {reject: true"),
     {"run.yaml:5:", "raytracer", "rejected, as the option 'reject' requests"}},
    {"NoPlugin", replaced(good, "rt_counter", "no_plugin"), {"no_plugin.so", "exports no symbol 'arhost_entry'"}},
    {"AbiVersion", replaced(good, "rt_counter", "broken_version"), {"broken_version.so", "chose ABI version 77"}},
    {"AbiAnswer", replaced(good, "rt_counter", "broken_answer"), {"broken_answer.so", "returned no arhost_plugin"}},
    {"AbiShort", replaced(good, "rt_counter", "broken_short"), {"broken_short.so", "its arhost_entry is too small"}},
    {"CrashOnLoad",
     replaced(good, "rt_counter", "broken_constructor"),
     {"broken_constructor.so", "signal 11", "while its library was loaded"}},
    {"MissingPluginFile", replaced(good, "rt_counter", "./run.yaml.so"), {"run.yaml:5:", "there is no plugin"}},
    {"PluginIsATextFile",
     replaced(good, "rt_counter", "./text.so"),
     {"run.yaml:5:", "text.so", "invalid ELF header"}},
    {"PluginIsTruncated", replaced(good, "rt_counter", "./cut.so"), {"run.yaml:5:", "cut.so", "too short"}},
    {"PluginWithUndefinedSymbol",
     replaced(good, "rt_counter", "broken_undefined"),
     {"run.yaml:5:", "broken_undefined.so", "undefined symbol: arhost_test_nowhere"}},
    {"NoSceneFile",
     replaced(good, "scene.yaml", "scne.yaml"),
     {"run.yaml:5:", "there is no scene file '", "; did you mean 'scene.yaml'?"}},
    {"OpenQuotation",
     replaced(good, "plugin: rt_counter", "plugin: \"rt_counter"),
     {"run.yaml:5:", "this quoted value is not terminated"}},
    {"TimelineOverAnOutput", good + "timeline: ./counted.txt\n", {"run.yaml:", "timeline", "choose another path"}},
    {"TwoDocuments", good + "---\nmode: live\n", {"a second document starts here; the file must contain only one"}},
    {"SceneSyntax", good, {"scene.yaml:", "YAML syntax"}, "version: 1\nobjects: ["},
    {"SceneWithMissingMesh",
     good,
     {"scene.yaml:4:", "none.obj"},
     replaced(small_scene, "sphere: {centre: [0, 0, 10], radius: 10}", "mesh: none.obj")},
    {"SceneWithNanVertex",
     good,
     {"scene.yaml:4:", "nan.obj", ":2"},
     replaced(small_scene, "sphere: {centre: [0, 0, 10], radius: 10}", "mesh: nan.obj")},
    {"SceneWithIndexOutOfRange",
     good,
     {"scene.yaml:4:", "index.obj", ":4"},
     replaced(small_scene, "sphere: {centre: [0, 0, 10], radius: 10}", "mesh: index.obj")},
    {"SceneWithoutTriangles",
     good,
     {"scene.yaml:4:", "empty.obj", "no triangles"},
     replaced(small_scene, "sphere: {centre: [0, 0, 10], radius: 10}", "mesh: empty.obj")},
    {"CalibrationForAnotherSize",
     good + "camera: {width: 640, height: 480, fx: 600}\n",
     {"run.yaml:8:", "640", "480", "64", "48"}},
    {"CalibrationMissing",
     good + "camera: {file: none.yaml}\n",
     {"run.yaml:8:", "camera.file", "none.yaml does not exist"}},
    {"TwoOutputsToOneFile",
     replaced(good, "path: counted.txt}", "path: counted.txt}, {plugin: sink_counter, path: ./counted.txt}"),
     {"run.yaml:6:", "another output already writes './counted.txt'"}},
    {"TwoOutputsToOneFileByAnOption",
     replaced(good, "path: counted.txt}", "path: counted.txt}, {plugin: sink_counter, options: {path: counted.txt}}"),
     {"run.yaml:6:", "another output already writes 'counted.txt'"}},
    {"StatisticsOverTheScene",
     good.substr(0, good.find("stats:")) + "stats: ./scene.yaml\n",
     {"run.yaml:7:8: stats: './scene.yaml' is a file that this run reads; choose another path"}},
    {"TimelineOverTheConfiguration",
     good + "timeline: run.yaml\n",
     {"run.yaml:8:11: timeline: 'run.yaml' is a file that this run reads"}},
    {"TimelineOverTheStatistics",
     good + "timeline: stats.json\n",
     {"run.yaml:8:11: timeline: another output already writes 'stats.json'"}},
    {"TimelineIsAFolder", good + "timeline: .\n", {"run.yaml:8:11: timeline: '.' is not a regular file"}},
    {"TimelineIsAFifo", good + "timeline: fifo.obj\n", {"run.yaml:8:11: timeline: 'fifo.obj' is not a regular file"}},
    {"TimelineWithTooLongAName", good + "timeline: " + std::string(300, 'a') + "\n", {"run.yaml:8:11: timeline: "}},
    {"OutputOverTheScene",
     replaced(good, "path: counted.txt", "path: linked.yaml"),
     {"run.yaml:6:", "'linked.yaml' is a file that this run reads"}},
    {"OutputOverAFileThatTheTrackerReads",
     replaced(counting({.source = "frames: 5", .tracker = "file: path.txt"}), "path: counted.txt", "path: path.txt"),
     {"run.yaml:6:", "'path.txt' is a file that this run reads"}},
    {"OutputOverAPlugin",
     replaced(replaced(good, "rt_counter", "./text.so"), "path: counted.txt", "path: text.so"),
     {"run.yaml:6:", "outputs[0].path: 'text.so' is a file that this run reads"}},
    {"OutputOverTheSceneByAHardLink",
     replaced(good, "path: counted.txt", "path: hard.yaml"),
     {"run.yaml:6:", "outputs[0].path: 'hard.yaml' is a file that this run reads (", "/scene.yaml)"}},
    {"OutputOverTheSourcesFrames",
     replaced(replaced(good, "source_counter,", "source_file, path: f-%04d.png,"), "path: counted.txt",
              "path: f-00%02d.png"),
     {"run.yaml:6:", "outputs[0].path: 'f-00%02d.png' is a file that this run reads (", "/f-0001.png)"}},
    {"StatisticsOverAFrameOfTheSource",
     replaced(good, "source_counter,", "source_file, path: f-%04d.png,").append("timeline: f-0001.png\n"),
     {"run.yaml:8:11: timeline: 'f-0001.png' is a file that this run reads"}},
    {"OutputOverItsOwnInput",
     replaced(good, "path: counted.txt", "path: path.txt, options: {script: path.txt}"),
     {"run.yaml:6:", "outputs[0].path: 'path.txt' is a file that this run reads"}},
    {"OutputOverAMeshOfTheScene",
     replaced(good, "path: counted.txt", "path: mesh.obj"),
     {"run.yaml:6:", "outputs[0].path: 'mesh.obj' is a file that this run reads"},
     replaced(small_scene, "sphere: {centre: [0, 0, 10], radius: 10}", "mesh: mesh.obj")},
    {"TimelineOverAMeshOfTheScene",
     good + "timeline: mesh.obj\n",
     {"run.yaml:8:11: timeline: 'mesh.obj' is a file that this run reads"},
     replaced(small_scene, "sphere: {centre: [0, 0, 10], radius: 10}", "mesh: mesh.obj")},
    {"TimelineOverAMeshOfTheSceneByAHardLink",
     good + "timeline: hard.obj\n",
     {"run.yaml:8:11: timeline: 'hard.obj' is a file that this run reads (", "/mesh.obj)"},
     replaced(small_scene, "sphere: {centre: [0, 0, 10], radius: 10}", "mesh: mesh.obj")},
    {"FpsIsNotANumber",
     replaced(good, "source_counter,", "source_counter, fps: .nan,"),
     {"run.yaml:3:", "source.fps: must be a finite number, 0 to 10000, but is .nan"}},
    {"FpsTooSmall",
     replaced(good, "source_counter,", "source_counter, fps: 1e-300,"),
     {"run.yaml:3:", "source.fps: must be 0 (the source's own rate) or 1e-06 to 10000, but is 1e-300"}},
    {"SceneIsAFifo", replaced(good, "scene.yaml", "fifo.obj"), {"run.yaml:5:", "there is no scene file"}},
    {"MeshIsAFifo",
     good,
     {"scene.yaml:4:", "fifo.obj", "is not a regular file"},
     replaced(small_scene, "sphere: {centre: [0, 0, 10], radius: 10}", "mesh: fifo.obj")},
    {"CalibrationIsAFifo", good + "camera: {file: fifo.obj}\n", {"fifo.obj", "not a regular file"}},
    {"SceneLoadsTooSlowly",
     replaced(good, "scene.yaml,", "scene.yaml, start_deadline_ms: 20,"),
     {"scene.yaml: the scene loader failed: made no progress for 20 ms", "raytracer.start_deadline_ms"},
     big_scene()},
    {"ZeroAxis",
     good + "coordinates: {ar: 1, rt: 2, rotations: [{degrees: 90, axis: [0, 0, 0]}]}\n",
     {"run.yaml:8:", "coordinates.rotations[0].axis"}},
};

void PrintTo(const Case &c, std::ostream *stream) {
    *stream << c.name;
}

class BadInput : public testing::TestWithParam<Case> {};

} // namespace

TEST_P(BadInput, IsReportedWithPositionAndFix) {
    ArhostRun run(GetParam().yaml);
    run.write("scene.yaml", GetParam().scene);
    run.write("nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n");
    run.write("index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    run.write("empty.obj", "v 0 0 0\n");
    run.write("path.txt", "0 0 9 0 0 8 0 1 0\n");
    run.write("text.so", "This is no shared object, whatever its name says, and it is longer than an ELF header.\n");
    run.write("cut.so", "\177ELF");
    run.write("f-0001.png", "x");
    run.write("marker.dat", "1\n0\n40\n1 0 0 0\n0 1 0 0\n0 0 1 0\n");
    run.write("mesh.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    std::filesystem::create_symlink("scene.yaml", run.path("linked.yaml"));
    std::filesystem::create_hard_link(run.path("scene.yaml"), run.path("hard.yaml"));
    std::filesystem::create_hard_link(run.path("mesh.obj"), run.path("hard.obj"));
    ASSERT_EQ(::mkfifo(run.path("fifo.obj").c_str(), 0600), 0);
    EXPECT_EQ(run.run(), 2) << run.output();
    const std::string output = run.output();
    for (const std::string &part : GetParam().expected)
        EXPECT_THAT(output, HasSubstr(part));
    EXPECT_THAT(output, Not(HasSubstr("terminate called")));
    EXPECT_THAT(output, Not(HasSubstr("what():")));
    EXPECT_FALSE(run.exists("counted.txt")) << "partial output";
    EXPECT_FALSE(run.exists("stats.json"));
}

INSTANTIATE_TEST_SUITE_P(Cases, BadInput, testing::ValuesIn(cases), [](const auto &info) { return info.param.name; });

TEST(Check, DetectsAnOutputOverAMeshOfTheScene) {
    ArhostRun run(replaced(good, "path: counted.txt", "path: mesh.obj"));
    run.write("scene.yaml", replaced(small_scene, "sphere: {centre: [0, 0, 10], radius: 10}", "mesh: mesh.obj"));
    run.write("mesh.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    run.expect({"check", "run.yaml"}, 2,
               {"run.yaml:6:40: outputs[0].path: 'mesh.obj' is a file that this run reads"});
}

TEST(Check, DoesNotTreatAMeshNameAsAPattern) {
    ArhostRun run(replaced(good, "path: counted.txt", "path: mesh-7.obj"));
    run.write("scene.yaml", replaced(small_scene, "sphere: {centre: [0, 0, 10], radius: 10}", "mesh: mesh-%d.obj"));
    for (const char *mesh : {"mesh-%d.obj", "mesh-7.obj"})
        run.write(mesh, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    EXPECT_EQ(run.run({"check", "run.yaml"}), 0) << run.output();
}

TEST(Check, FailsIfTheSceneLoadsTooSlowly) {
    ArhostRun run(good);
    run.write("scene.yaml", big_scene());
    run.expect({"check", "run.yaml", "--set", "raytracer.start_deadline_ms=20"}, 2,
               {"scene.yaml: the scene loader failed: made no progress for 20 ms"});
}

TEST(BadInput, LeavesNoFolder) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 5}}\nstats: out/b/stats.json\n"
                  "outputs: [{plugin: sink_video, path: out/a/film.mp4, options: {crf: 99}}]\n");
    run.expect(2, {"outputs[0].options.crf: must be "});
    EXPECT_FALSE(run.exists("out"));
}

// The message is the user's view, and the run neither retries nor repeats it.
TEST(BadInput, OfAnUnwritableFolderIsReportedOnce) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 5}}\n"
                  "outputs: [{plugin: sink_video, path: out/film.mp4}]\n");
    std::filesystem::create_directory(run.path("out"));
    ::chmod(run.path("").c_str(), 0755);
    ::chmod(run.path("out").c_str(), 0555);
    run.start({"run.yaml"}, [] {
        if (::geteuid() == 0 && (::setgid(65534) != 0 || ::setuid(65534) != 0))
            ::_exit(126);
    });
    EXPECT_EQ(run.wait(), 2);
    ::chmod(run.path("out").c_str(), 0755);
    EXPECT_THAT(run.messages(),
                testing::MatchesRegex("error: arhost: run.yaml:3:38: outputs.0..path: no file can be "
                                      "created in the folder '.*/out': Permission denied; choose another "
                                      "path\n"));
}

TEST(BadInput, OfAPluginIsReportedOnce) {
    ArhostRun run(replaced(good, "scene.yaml, options: {", "scene.yaml, options: {reject: true"));
    run.write("scene.yaml", small_scene);
    EXPECT_EQ(run.run(), 2);
    const std::string reason = "rejected, as the option 'reject' requests\n", output = run.output();
    EXPECT_THAT(output, HasSubstr("error: arhost: run.yaml:5:12: raytracer: " + reason));
    EXPECT_EQ(output.find(reason), output.rfind(reason)) << output;
}

TEST(BadInput, DoesNotOverwriteArhostItself) {
    for (const char *file : {"/bin/arhost-worker", "/lib/arhost/plugins/sink_window.so"}) {
        ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 5}}\n"
                      "outputs: [{plugin: sink_poses, path: " +
                      arhost::test::build_directory() + std::string(file) + "}]\n");
        run.expect(2, {"run.yaml:3:38: outputs[0].path: '", "' belongs to arhost; choose another path"});
    }
}

TEST(BadInput, KeepsTheOutputsOfAnEarlierRun) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 5}}\n"
                  "outputs:\n- {plugin: sink_poses, path: poses.jsonl}\n- {plugin: sink_images, path: last.png}\n"
                  "- {plugin: sink_video, path: video.mp4}\n- {plugin: sink_video, path: video.avi}\n");
    for (const char *name : {"poses.jsonl", "last.png", "video.mp4"})
        run.write(name, "old");
    run.expect(2, {"video.avi"});
    for (const char *name : {"poses.jsonl", "last.png", "video.mp4"})
        EXPECT_EQ(run.read(name), "old") << name;
    for (const auto &entry : std::filesystem::directory_iterator(run.path("")))
        EXPECT_NE(entry.path().filename().string()[0], '.') << entry.path() << " was left behind";
}

TEST(BadCommandLine, IsRejected) {
    ArhostRun run(good);
    run.write("scene.yaml", small_scene);
    struct {
        std::vector<std::string> arguments;
        const char *expected;
    } const lines[] = {
        {{"--config", "none.yaml"}, "none.yaml: cannot be read: No such file or directory"},
        {{"--config", "."}, "is a folder"},
        {{"--config", "two\nlines\033[2J"}, "error: two lines [2J: cannot be read"},
        {{"--config", "run.yaml", "--set", "mode"}, "key.path=value"},
        {{"--config", "run.yaml", "--set", "mode=fast"}, "--set: mode: 'fast' is not one of lockstep, live"},
        {{"--config", "run.yaml", "--set", "nonsense=1"}, "nonsense: unknown key"},
        {{"--config", "run.yaml", "--ar", "1", "--rt", "2", "--g1", "90"}, "axis"},
        {{"--config", "run.yaml", "--x1", "1"}, "need --g1"},
        {{"--config", "run.yaml", "--set", "outputs.0.plugin=x"}, "--set: outputs[0].plugin: there is no plugin"},
        {{"--config", "run.yaml", "--g2", "90", "--z2", "1"}, "--g2 sets the second rotation and needs --g1"},
        {{"--config", "run.yaml", "--frames", "-3"}, "frames: must be 0 to 1000000000000000, but is -3"},
        {{"run", "none.yaml"}, "none.yaml: cannot be read: No such file or directory"},
        {{"--config", "run.yaml", "--no\033[2J"}, "not expected: --no [2J"},
        {{"--config", "run.yaml", "--set", "outputs.0.path=caf\xe9.txt"}, "not valid UTF-8"}};
    for (const auto &line : lines) {
        run.expect(line.arguments, 2, {line.expected});
    }
}

TEST(StandardOutput, ThatCannotBeWrittenIsReportedOnce) {
    ArhostRun run(good);
    run.write("scene.yaml", small_scene);
    struct {
        std::vector<std::string> arguments;
        int status;
    } const commands[] = {{{"schema"}, 1},
                          {{"plugins"}, 1},
                          {{"check", "run.yaml", "--set", "outputs.0.path=out/counted.txt"}, 1},
                          {{"help"}, 1},
                          {{"marker", "--help"}, 2}};
    for (const auto &command : commands)
        for (void (*prepare)() :
             {+[] { ::dup2(::open("/dev/full", O_WRONLY), STDOUT_FILENO); }, +[] { ::close(STDOUT_FILENO); }}) {
            run.start(command.arguments, prepare);
            EXPECT_EQ(run.wait(), command.status) << command.arguments.front();
            EXPECT_EQ(run.messages(), "error: cannot write to standard output\n") << command.arguments.front();
        }
}

TEST(StandardOutput, ThatIsABrokenPipeEndsACommandQuietly) {
    ArhostRun run;
    for (const std::vector<std::string> &arguments : {std::vector<std::string>{"schema"}, {"marker", "--help"}}) {
        run.start(arguments, [] {
            int ends[2];
            if (::pipe(ends) != 0)
                ::_exit(126);
            ::dup2(ends[1], STDOUT_FILENO);
            ::close(ends[0]);
        });
        EXPECT_EQ(run.wait(), 128 + SIGPIPE);
        EXPECT_EQ(run.output(), "");
    }
}

TEST(PluginIds, AreUniqueInARun) {
    ArhostRun run(replaced(good, "outputs: [", "outputs: [{plugin: other/sink_counter.so, path: other.txt}, "));
    run.write("scene.yaml", small_scene);
    std::filesystem::create_directories(run.path("other"));
    std::filesystem::copy_file(test_plugin_directory() + "/sink_counter.so", run.path("other/sink_counter.so"));
    run.expect(2, {"have the same id 'org.arhost.test.sink_counter'; use one of them, or change the id of one"});
}
