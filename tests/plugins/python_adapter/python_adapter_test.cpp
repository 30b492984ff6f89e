// SPDX-License-Identifier: Apache-2.0
//
// Runs Python scripts in the real arhost. Checks the data that the scripts receive and how their errors are reported.
#include "arhost_run.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <cstdlib>

using namespace arhost::test;
using testing::HasSubstr;
using testing::Not;

namespace {

class PythonAdapter : public testing::Test {
protected:
    void SetUp() override {
        if (std::system("/usr/bin/python3 -c 'import numpy' 2>/dev/null") != 0)
            GTEST_SKIP() << "python3-numpy is not installed";
    }
};

// Returns a configuration of the counting plugins for six frames, in which the line that starts with `prefix` is
// replaced with `replacement`.
std::string chain(const std::string &prefix, const std::string &replacement) {
    std::istringstream lines(counting({.source = "frames: 6"}));
    std::string result;
    for (std::string line; std::getline(lines, line);)
        result += line.starts_with(prefix) ? replacement + "\n" : line + "\n";
    return result;
}
const std::string tracker = chain("tracker:", "tracker: {plugin: tracker_python, options: {script: script.py}, "
                                              "targets: [{marker: 3, family: tag36h11, side_mm: 80}]}");
const std::string raytracer =
    chain("raytracer:", "raytracer: {plugin: rt_python, options: {script: script.py}, scene: scene.yaml}");
const char *const sink = "version: 1\nsource: {plugin: source_counter, options: {frames: 1000}}\n"
                         "outputs: [{plugin: sink_python, options: {script: script.py}}]\nstats: stats.json\n";

int run_script(ArhostRun &run, const std::string &script) {
    run.write("scene.yaml", small_scene);
    run.write("script.py", script);
    // Most scripts report no marker.
    return run.run({"--config", "run.yaml", "--verbose", "--allow-no-target"});
}

const char *const idle_tracker = "class T:\n"
                                 "    def __init__(self, host): pass\n"
                                 "    def start(self, setup): pass\n"
                                 "    def track(self, frame): return []\n";

} // namespace

TEST_F(PythonAdapter, TrackerSeesFramesAndReportsObservations) {
    ArhostRun run(tracker);
    EXPECT_EQ(run_script(run, R"(
import arhost, numpy as np
class Tracker:
    def __init__(self, host): self.host = host
    def start(self, setup):
        marker = setup.markers[0]
        assert [t.name for t in setup.targets] == ["tag36h11-3"] and setup.families == ["tag36h11"]
        assert (marker.id, marker.family, marker.target) == (3, 0, 0)
        assert marker.corners_mm.tolist() == [[-40, 40, 0], [40, 40, 0], [40, -40, 0], [-40, -40, 0]]
        self.lens, self.marker = setup.intrinsics, marker
        assert self.lens.width == setup.format.width
    def track(self, frame):
        pixels = frame.planes[0].reshape(-1)
        assert pixels[0] + 256 * int(pixels[1]) == frame.sequence
        assert frame.grey.shape == (frame.format.height, frame.format.width)
        try:
            frame.grey[0, 0] = 1
            return
        except ValueError: # input frames are read-only
            pass
        half = 40 / (500 + frame.sequence) * np.array([self.lens.fx, self.lens.fy])
        corners = [self.lens.cx, self.lens.cy] + half * [[-1, -1], [1, -1], [1, 1], [-1, 1]]
        yield arhost.Observation(self.marker.id, corners)
)"),
              0)
        << run.output();
    // rt_counter draws the frame number of the pose into the image; sink_counter compares it with the number of the
    // frame.
    EXPECT_EQ(run.stats()["frames"]["augmented"], 6);
    const auto lines = counted(run);
    ASSERT_EQ(lines.size(), 6u);
    for (std::size_t i = 0; i < lines.size(); ++i)
        EXPECT_EQ(lines[i].overlay, std::to_string(i));
    EXPECT_THAT(run.output(), Not(HasSubstr("warning: tracker")));
}

TEST_F(PythonAdapter, TheRecordNamesTargetsAndTheirObservations) {
    ArhostRun run("version: 1\ncamera: {width: 64, height: 48, fx: 60}\nsource: {plugin: source_python, options: "
                  "{script: script.py}}\n"
                  "tracker: {plugin: tracker_python, options: {script: script.py}, "
                  "targets: [{name: cup, marker: 7, family: tag25h9, side_mm: 80}, {marker: 3, family: tag36h11, "
                  "side_mm: 80}]}\n"
                  "outputs: [{plugin: sink_python, path: out.txt, options: {script: script.py}}]\n");
    EXPECT_EQ(run_script(run, R"(
import arhost
class Source:
    def __init__(self, host): pass
    def start(self, setup): return {"width": 64, "height": 48, "fps": 25, "transfer": arhost.TRANSFER_LINEAR}
    def read(self, buffer): return None if buffer.sequence > 2 else 40_000_000 * buffer.sequence
class Tracker:
    def __init__(self, host): pass
    def start(self, setup):
        assert setup.families == ["tag25h9", "tag36h11"]
        assert setup.format.transfer == arhost.TRANSFER_LINEAR
    def track(self, frame):
        x = frame.sequence
        yield arhost.Observation(3, [[20, 15], [40, 15], [40, 35], [20, 35]], 1, 2, 0.5, 0.25, 1e-9)
        yield arhost.Observation(9, [[x, 1], [x + 2, 1], [x + 2, 3], [x, 3]], 0) # no target lists it
class Sink:
    def __init__(self, host): pass
    def start(self, setup): self.file = open(setup.path, "w")
    def write(self, output):
        r = output.record
        assert r.families == ["tag25h9", "tag36h11"] and r.has_truth == 0 and r.truth_target == ""
        print(r.sequence, [(t.name, round(t.mt[14]), t.state == arhost.TARGET_DETECTED, t.first_observation,
                            t.observation_count, t.covariance.shape) for t in r.targets], file=self.file)
        print([(o.id, o.family, o.hamming, o.decision_margin, o.corner_sigma_px, o.false_positive_rate, o.corners_px[0].tolist()) for o in r.observations],
              file=self.file)
        self.kept = r # a copy: no warning
    def stop(self): self.file.close()
)"),
              0)
        << run.output();
    std::string expected;
    for (int i = 0; i < 3; ++i)
        expected += std::to_string(i) +
                    " [('tag36h11-3', -240, True, 0, 1, (36,))]\n[(3, 1, 2, 0.5, 0.25, 1e-09, [20.0, 15.0]), (9, 0, "
                    "0, 0.0, 0.0, 0.0, [" +
                    std::to_string(i) + ".0, 1.0])]\n";
    EXPECT_EQ(run.read("out.txt"), expected);
    EXPECT_THAT(run.output(), Not(HasSubstr("kept an array")));
}

TEST_F(PythonAdapter, ObservationsBeyondTheCapacityAreIgnoredAndReportedOnce) {
    ArhostRun run(tracker);
    EXPECT_EQ(run_script(run, R"(
import arhost
class Tracker:
    def __init__(self, host): pass
    def start(self, setup): pass
    def track(self, frame):
        for i in range(arhost.MAX_OBSERVATIONS + 1):
            yield arhost.Observation(1000 + i, [[0, 0], [9, 0], [9, 9], [0, 9]])
)"),
              0)
        << run.output();
    const std::string warning = "'track' reported more than 1024 observations; the others are ignored";
    EXPECT_THAT(run.output(), HasSubstr(warning));
    EXPECT_EQ(run.output().find(warning), run.output().rfind(warning));
    EXPECT_EQ(counted(run).size(), 6u);
}

TEST_F(PythonAdapter, TheStateOfATrackerSurvivesItsProcess) {
    ArhostRun run(tracker);
    EXPECT_EQ(run_script(run, R"(
import arhost, os
class Tracker:
    def __init__(self, host): self.first = None
    def start(self, setup): pass
    def state_size(self): return 8
    def track(self, frame):
        if self.first is None: self.first = frame.sequence
        if self.first == 0 and frame.sequence == 3: os._exit(1)
        count = 0 if frame.state_before is None else int(frame.state_before.view("u8")[0])
        assert count == frame.sequence and (frame.state_before is None) == (frame.sequence == 0)
        assert frame.state_before is None or not frame.state_before.flags.writeable
        frame.state_after.view("u8")[0] = count + 1
        frame.candidate_count = 4
        return [arhost.Observation(3, [[20, 15], [40, 15], [40, 35], [20, 35]])]
)"),
              0)
        << run.output();
    EXPECT_EQ(run.stats()["frames"]["tracked"], 6);
    EXPECT_EQ(run.stats()["search"]["candidates"], 24);
    EXPECT_THAT(run.output(), HasSubstr("exited with status 1"));
}

TEST_F(PythonAdapter, AnInvalidSizeOfTheStateIsAConfigurationError) {
    for (const std::string size : {"-1", "8.5", "'8'", "16777217"}) {
        ArhostRun run(tracker);
        EXPECT_EQ(run_script(run, std::string(idle_tracker) + "    def state_size(self): return " + size + "\n"), 2);
        EXPECT_THAT(run.output(),
                    HasSubstr("'state_size' returned " + size + "; it must be an integer from 0 to 16777216"));
    }
}

TEST_F(PythonAdapter, AnInvalidCountOfCandidatesIsAnError) {
    for (const std::string count : {"-2", "'many'", "2147483648"}) {
        ArhostRun run(tracker);
        EXPECT_EQ(run_script(run, "class T:\n    def __init__(self, host): pass\n    def start(self, setup): pass\n"
                                  "    def track(self, frame): frame.candidate_count = " +
                                      count + "\n"),
                  1);
        EXPECT_THAT(run.output(),
                    HasSubstr("'frame.candidate_count' is " + count + "; it must be an integer from -1"));
    }
}

TEST_F(PythonAdapter, WarnsIfATrackerKeepsItsState) {
    for (const std::string array : {"before", "after"}) {
        ArhostRun run(tracker);
        EXPECT_EQ(run_script(run, "class T:\n    kept = []\n    def __init__(self, host): pass\n"
                                  "    def start(self, setup): pass\n    def state_size(self): return 8\n"
                                  "    def track(self, frame):\n        frame.state_after[:] = 1\n"
                                  "        self.kept.append(frame.state_" +
                                      array + ")\n"),
                  0);
        EXPECT_THAT(run.output(), HasSubstr("'track' kept an array whose memory is no longer valid"));
    }
}

TEST_F(PythonAdapter, RayTracerReadsTheSceneAndWritesTheImage) {
    ArhostRun run(raytracer);
    EXPECT_EQ(run_script(run, R"(
import arhost
class Tracer:
    def __init__(self, host): pass
    def start(self, setup):
        scene = setup.scene
        assert scene.axes == arhost.AXES_Z_UP and len(scene.objects) == 1 and scene.objects[0]["role"] == arhost.ROLE_VIRTUAL
        sphere = scene.elements(scene.geometries[0]["positions"], "4f4")
        assert sphere.tolist() == [[0, 0, 10, 10]], sphere
        assert scene.bounds_max.tolist() == [10, 10, 20] and scene.materials[0]["diffuse"].tolist() == [0.5] * 3
    def render(self, request, image):
        number = round(request.camera.eye[2] - 500)
        assert number == request.sequence and len(request.moved) == 0 and request.deformed == []
        image[...] = 0
        image[:16, :16] = number, 0, 170, 255
        return 0, 0, 16, 16
)"),
              0)
        << run.output();
    EXPECT_EQ(run.stats()["frames"]["augmented"], 6);
    const auto lines = counted(run);
    ASSERT_EQ(lines.size(), 6u);
    for (std::size_t i = 0; i < lines.size(); ++i)
        EXPECT_EQ(lines[i].overlay, std::to_string(i));
}

TEST_F(PythonAdapter, TheStateOfARayTracerSurvivesItsProcess) {
    ArhostRun run(raytracer);
    EXPECT_EQ(run_script(run, R"(
import os
class Tracer:
    def __init__(self, host): self.first = None
    def start(self, setup): self.pixels = setup.width * setup.height
    def state_size(self): return 8 * self.pixels
    def render(self, request, image):
        if self.first is None: self.first = request.sequence
        if self.first == 0 and request.sequence == 3: os._exit(1)
        count = 0 if request.state_before is None else int(request.state_before.view("u8")[-1])
        assert count == request.sequence and (request.state_before is None) == (request.sequence == 0)
        assert request.state_before is None or not request.state_before.flags.writeable
        request.state_after.view("u8")[...] = count + 1
        image[...] = 0
)"),
              0)
        << run.output();
    EXPECT_EQ(run.stats()["frames"]["augmented"], 6);
}

TEST_F(PythonAdapter, SourceAndSinkExchangeFrames) {
    ArhostRun run(
        "version: 1\nsource: {plugin: source_python, options: {script: script.py, class: Source, "
        "arguments: '{\"frames\": 3}'}}\n"
        "outputs: [{plugin: sink_python, path: out.txt, options: {script: script.py}}]\nstats: stats.json\n");
    EXPECT_EQ(run_script(run, R"(
import arhost
class Source:
    def __init__(self, host, frames): self.frames = frames
    def start(self, setup): return {"width": 66, "height": 34, "pixel_format": arhost.PIXEL_FORMAT_NV12, "fps": 25}
    def read(self, buffer):
        if buffer.sequence >= self.frames: return None
        y, uv = buffer.planes
        y[...], uv[...] = 16 + 20 * buffer.sequence, 128
        return 40_000_000 * buffer.sequence
class Sink:
    def __init__(self, host): pass
    def start(self, setup): self.file = open(setup.path, "w")
    def write(self, output):
        r = output.record
        print(r.sequence, r.capture_ns // 1000000, r.overlay, output.bgr.shape, output.bgr[0, 0], file=self.file)
    def stop(self): self.file.close()
)"),
              0)
        << run.output();
    EXPECT_EQ(run.read("out.txt"), "0 0 3 (34, 66, 3) [0 0 0]\n"
                                   "1 40 3 (34, 66, 3) [23 23 23]\n"
                                   "2 80 3 (34, 66, 3) [47 47 47]\n");
}

TEST_F(PythonAdapter, ASinkEndsTheRunByReturningFalse) {
    ArhostRun run(sink);
    EXPECT_EQ(run_script(run, R"(
class Sink:
    def __init__(self, host): pass
    def start(self, setup): pass
    def write(self, output): return output.record.sequence < 2
)"),
              0)
        << run.output();
    EXPECT_LT(run.stats()["frames"]["in"], 1000);
}

// The recipe of the README.
TEST_F(PythonAdapter, UsesThePackagesOfAVirtualEnvironment) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 3}}\n"
                  "outputs: [{plugin: sink_python, reads: [.venv], options: {script: script.py, "
                  "interpreter: .venv/bin/python}}]\nstats: stats.json\n");
    const std::string venv = run.path(".venv").string();
    ASSERT_EQ(std::system(("/usr/bin/python3 -m venv --without-pip --system-site-packages " + venv).c_str()), 0);
    for (const auto &entry : std::filesystem::directory_iterator(run.path(".venv/lib"))) // python3.11
        run.write(entry.path() / "site-packages/only_in_venv.py", "answer = 42\n");
    EXPECT_EQ(run_script(run, "import only_in_venv\n"
                              "class Sink:\n"
                              "    def __init__(self, host): host.info(f'answer {only_in_venv.answer}')\n"
                              "    def start(self, setup): pass\n"
                              "    def write(self, output): pass\n"),
              0)
        << run.output();
    EXPECT_THAT(run.output(), HasSubstr("answer 42"));
}

TEST_F(PythonAdapter, AnInterpreterThatIsNoPythonIsRejected) {
    for (const char *interpreter : {"/bin/true", "script.py"}) {
        ArhostRun run(chain("tracker:", std::string("tracker: {plugin: tracker_python, options: {script: script.py, "
                                                    "interpreter: ") +
                                            interpreter +
                                            "}, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}"));
        EXPECT_EQ(run_script(run, idle_tracker), 2) << run.output();
        EXPECT_THAT(run.output(), HasSubstr("the option 'interpreter' names '"));
        EXPECT_THAT(run.output(), HasSubstr("which is not a readable program of CPython"));
    }
}

TEST_F(PythonAdapter, PrintedLinesAreLoggedAndAFloodOfThemDelaysNoFrame) {
    for (const std::string end : {"\\n", ""}) {
        ArhostRun run(tracker);
        run.write("scene.yaml", small_scene);
        run.write("script.py", "class T:\n"
                               "    def __init__(self, host): print('made', 1, end='!\\n')\n"
                               "    def start(self, setup): pass\n"
                               "    def track(self, frame):\n"
                               "        for i in range(20000): print(i, 'x' * 1000, end='" +
                                   end +
                                   "')\n"
                                   "        return []\n");
        EXPECT_EQ(run.run({"--config", "run.yaml", "--allow-no-target"}), 0) << run.output(); // without --verbose
        const std::string output = run.output(), warning = "it logs more than 200 lines";
        EXPECT_THAT(output, HasSubstr("tracker: made 1!\n"));
        EXPECT_THAT(output, HasSubstr("warning: tracker: " + warning));
        EXPECT_EQ(output.find(warning), output.rfind(warning));
        EXPECT_EQ(run.stats()["restarts"]["tracker"], 0);
    }
}

TEST_F(PythonAdapter, PrintedLinesOfAnyLengthAreLoggedInParts) {
    ArhostRun run(tracker);
    EXPECT_EQ(run_script(run, "print(''.join(f'é{i:04}' for i in range(1000)) + 'end')\n"
                              "print(''.join(f'{i:05}' for i in range(1000)), end='')\n" +
                                  std::string(idle_tracker)),
              0)
        << run.output();
    for (const char *part : {"tracker: é0000é0001", "\ninfo: tracker: é0200", "é0999\n", "tracker: end\n",
                             "\ninfo: tracker: 00200", "00999\n"})
        EXPECT_THAT(run.output(), HasSubstr(part));
}

TEST_F(PythonAdapter, ARaytracerCanObeyTheLimitsOfSamplesAndShading) {
    ArhostRun run("version: 1\nmode: live\nsource: {plugin: source_counter, fps: 30, options: {frames: 60}}\n"
                  "tracker: {plugin: tracker_counter, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n"
                  "raytracer: {plugin: rt_python, options: {script: script.py}, scene: scene.yaml}\n"
                  "live: {target_fps: 10000, min_samples: 2, max_latency_ms: 60000}\noutputs: [{plugin: sink_null}]\n"
                  "stats: stats.json\n");
    // An image takes longer than the 0.1 ms of target_fps on any machine.
    EXPECT_EQ(run_script(run, "import time\n"
                              "class R:\n"
                              "    def __init__(self, host): self.host, self.seen = host, set()\n"
                              "    def start(self, setup): pass\n"
                              "    def render(self, request, image):\n"
                              "        time.sleep(0.002)\n"
                              "        request.full_samples, request.coarsest_shading_px = 8, 2\n"
                              "        image[...] = 0\n"
                              "        limits = request.max_samples, request.shading_px\n"
                              "        if limits not in self.seen:\n"
                              "            self.seen.add(limits)\n"
                              "            self.host.info(f'limits {limits}')\n"),
              0)
        << run.output();
    for (const char *limits : {"limits (0, 1)\n", "limits (8, 1)\n", "limits (2, 2)\n"})
        EXPECT_THAT(run.output(), HasSubstr(limits));
    EXPECT_EQ(run.stats()["quality"]["samples"], 2);
    EXPECT_EQ(run.stats()["quality"]["shading_px"], 2);
}

TEST_F(PythonAdapter, StandardOutputAcceptsBytesAndHasADescriptor) {
    ArhostRun run(tracker);
    EXPECT_EQ(run_script(run, std::string("import faulthandler, os, sys\n"
                                          "sys.stdout.buffer.write(b'from the buffer\\n')\n"
                                          "os.write(sys.stdout.fileno(), b'from the descriptor\\n')\n"
                                          "faulthandler.enable(sys.stdout)\n") +
                                  idle_tracker),
              0)
        << run.output();
    for (const char *line : {"from the buffer", "from the descriptor"})
        EXPECT_THAT(run.output(), HasSubstr(std::string("tracker: ") + line + "\n"));
}

TEST_F(PythonAdapter, ThreadsOfTheScriptMayOutliveTheInstance) {
    ArhostRun run(tracker); // only for its folder
    run.write("script.py", "import sys, threading, time\n"
                           "class S:\n"
                           "    def __init__(self, host, path):\n"
                           "        def watch():\n"
                           "            while not host.cancelled(): time.sleep(0.001)\n"
                           "            host.info('not logged')\n"
                           "            printed.write('not logged\\n')\n"
                           "            with open(path, 'w') as file: file.write(str(sys.stdout is sys.__stdout__))\n"
                           "        printed = sys.stdout\n"
                           "        threading.Thread(target=watch, daemon=True).start()\n"
                           "    def start(self, setup): pass\n"
                           "    def read(self, buffer): pass\n");
    PluginUnderTest plugin("source_python");
    ASSERT_EQ(plugin.create({{"script", run.path("script.py")},
                             {"arguments", "{\"path\": \"" + run.path("ended.txt").string() + "\"}"}}),
              ARHOST_STATUS_OK)
        << plugin.log();
    plugin.destroy();
    EXPECT_TRUE(eventually([&] { return run.read("ended.txt") == "True"; }));
    EXPECT_EQ(plugin.log(), "");
}

// The script writes files like tempfile, matplotlib, numba and torch.
TEST_F(PythonAdapter, LibrariesFindTheirFoldersForTemporaryFilesAndCaches) {
    ArhostRun run(tracker);
    EXPECT_EQ(run_script(run, R"(
import os, pathlib, tempfile
class T:
    def __init__(self, host):
        if not os.path.exists("/arhost-scratch"):
            host.info("no mount namespace")
            return
        with tempfile.NamedTemporaryFile("w+") as file, tempfile.TemporaryFile() as other:
            file.write("text")
        with tempfile.TemporaryDirectory() as folder:
            open(os.path.join(folder, "a"), "w").close()
        for variable in ("XDG_CACHE_HOME", "MPLCONFIGDIR", "NUMBA_CACHE_DIR"):
            cache = pathlib.Path(os.environ[variable]) / variable / "cache"
            cache.mkdir(parents=True)
            (cache / "new").write_text("text")
            os.replace(cache / "new", cache / "old")
        (pathlib.Path.home() / ".name").touch()
        host.info("all written")
    def start(self, setup): pass
    def track(self, frame): return []
)"),
              0)
        << run.output();
    EXPECT_THAT(run.output(), testing::AnyOf(HasSubstr("all written"), HasSubstr("no mount namespace")));
}

TEST_F(PythonAdapter, ThreadsOfAScriptRunBetweenItsCalls) {
    ArhostRun run(chain("tracker:", "tracker: {plugin: tracker_python, options: {script: script.py}, "
                                    "targets: [{marker: 3, family: tag36h11, side_mm: 80}]}") +
                  "\n");
    EXPECT_EQ(run_script(run, R"(
import threading
class Tracker:
    def __init__(self, host):
        self.done = threading.Event()
        self.host = host
    def start(self, setup): threading.Thread(target=lambda: (self.host.hint("from a thread"), self.done.set())).start()
    def track(self, frame): assert self.done.wait(20)
)"),
              0)
        << run.output();
    EXPECT_THAT(run.output(), HasSubstr("from a thread"));
}

TEST_F(PythonAdapter, AnExceptionSkipsItsFrameAndReportsItsLine) {
    for (const auto &[statement, message] :
         {std::pair{"1 / 0", "script.py:6: ZeroDivisionError: division by zero"},
          {"sys.exit(3)", "the script called sys.exit(3)"},
          {"raise KeyboardInterrupt", "script.py:6: KeyboardInterrupt"},
          {"return 1", "'track' must return a list of arhost.Observation, or None"},
          {"return [arhost.Observation(1, [2, 3])]",
           "script.py:6: ValueError: corners_px must be four corners (x, y)"},
          {"raise arhost.Failure('the lamp is off', arhost.STATUS_ERROR_IO)", "the lamp is off"}}) {
        ArhostRun run(tracker);
        EXPECT_EQ(run_script(run, std::string("import arhost, sys\nclass T:\n    def __init__(self, host): pass\n"
                                              "    def start(self, setup): pass\n    def track(self, frame):\n"
                                              "        if frame.sequence == 2: ") +
                                      statement + "\n        return []\n"),
                  1)
            << run.output(); // frame 2 has no overlay
        EXPECT_THAT(run.output(), HasSubstr(message));
        EXPECT_EQ(counted(run).size(), 6u) << message;
        EXPECT_EQ(run.stats()["restarts"].dump().find('1'), std::string::npos) << message;
    }
}

TEST_F(PythonAdapter, WarnsIfAScriptKeepsAnArray) {
    ArhostRun run(tracker);
    EXPECT_EQ(run_script(run, "class T:\n    def __init__(self, host): pass\n    def start(self, setup): pass\n"
                              "    def track(self, frame): self.last = frame.grey[10:20]\n"),
              0);
    EXPECT_THAT(run.output(), HasSubstr("'track' kept an array"));
}

// arhost reports them before the run, with the configuration line of the component, and does not retry.
TEST_F(PythonAdapter, UnusableScriptsAreConfigurationErrors) {
    const std::string two = std::string(idle_tracker) + "class U(T): pass\n";
    for (const auto &[script, message] :
         {std::pair<std::string, const char *>{")\n", "script.py:1: SyntaxError: unmatched ')'\n"},
          {"import no_such_module\n", "script.py:1: ModuleNotFoundError: No module named 'no_such_module'; if the "
                                      "module is next to the script, add "
                                      "'reads: ["},
          {"class T: pass\n", "has no classes with a method 'track'"},
          {two, "has 2 classes with a method 'track'; name one in the option 'class'"},
          {"class T:\n    def track(self): pass\n", "TypeError"}}) {
        ArhostRun run(tracker);
        EXPECT_EQ(run_script(run, script), 2) << run.output();
        EXPECT_THAT(run.output(), HasSubstr(message));
        EXPECT_THAT(run.output(), HasSubstr("run.yaml:4:"));
    }
    const auto with_options = [](const std::string &options) {
        return chain("tracker:", "tracker: {plugin: tracker_python, options: {" + options +
                                     "}, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}");
    };
    for (const auto &[options, message] :
         {std::pair{"script: none.py", "script: there is no file '"},
          {"script: script.py, arguments: '{'", "the option 'arguments' is not valid JSON"},
          {"script: script.py, arguments: '[1]'", "must be a JSON object"},
          {"script: script.py, class: U", "has no classes named 'U'"}}) {
        ArhostRun run(with_options(options));
        EXPECT_EQ(run_script(run, idle_tracker), 2) << run.output();
        EXPECT_THAT(run.output(), HasSubstr(message));
    }
}

TEST_F(PythonAdapter, ASourceMustReturnItsFormat) {
    for (const char *returned : {"None", "{'width': 8}"}) {
        ArhostRun run(chain("source:", "source: {plugin: source_python, options: {script: script.py}}"));
        EXPECT_EQ(run_script(run, "class S:\n    def __init__(self, host): pass\n    def start(self, setup):\n"
                                  "        return " +
                                      std::string(returned) + "\n    def read(self, buffer): return 1\n"),
                  2);
        EXPECT_THAT(run.output(), HasSubstr("script.py:3: start returned " + std::string(returned) +
                                            "; it must return a dict with 'width' and 'height'"));
        EXPECT_THAT(run.output(), Not(HasSubstr("restarting")));
    }
}

TEST_F(PythonAdapter, ASourceMayWaitLongerThanItsDeadline) {
    const auto deadline = scaled(std::chrono::milliseconds(300));
    ArhostRun run(
        "version: 1\nmode: live\nsource: {plugin: source_python, deadline_ms: " + std::to_string(deadline.count()) +
        ", options: {script: "
        "script.py}}\noutputs: [{plugin: sink_counter, path: counted.txt}]\nstats: stats.json\n");
    EXPECT_EQ(run_script(run, "class S:\n    def __init__(self, host): self.host = host\n"
                              "    def start(self, setup): return {'width': 8, 'height': 8}\n"
                              "    def read(self, buffer):\n"
                              "        if buffer.sequence == 2 or not self.host.wait(" +
                                  std::to_string(3 * std::chrono::duration<double>(deadline).count()) +
                                  "): return None\n"
                                  "        return 40_000_000 * buffer.sequence\n"),
              0)
        << run.output();
    EXPECT_EQ(run.stats()["restarts"]["source"], 0);
}

TEST_F(PythonAdapter, NamesAWrongPythonhome) {
    ArhostRun run(tracker);
    run.write("scene.yaml", small_scene);
    run.write("script.py", idle_tracker);
    run.start({"run.yaml"}, [] { ::setenv("PYTHONHOME", "/nonexistent", 1); });
    EXPECT_EQ(run.wait(), 2);
    EXPECT_THAT(run.output(), HasSubstr("unset the environment variable PYTHONHOME, which is '/nonexistent'"));
}

TEST_F(PythonAdapter, TheRayTracersScriptDeclaresItsCapabilities) {
    for (const auto &[declaration, warns] :
         {std::pair{"pass", false},
          {"capabilities = arhost.RAYTRACER_CAPABILITY_MOTION", true},
          {"capabilities = arhost.RAYTRACER_CAPABILITY_GLASS | arhost.RAYTRACER_CAPABILITY_MOTION", false}}) {
        ArhostRun run(raytracer);
        run.write("script.py", std::string("import arhost\n"
                                           "class T:\n"
                                           "    ") +
                                   declaration +
                                   "\n"
                                   "    def __init__(self, host): pass\n"
                                   "    def start(self, setup): pass\n"
                                   "    def render(self, request, image): image[...] = 0\n");
        run.write("scene.yaml", "version: 1\naxes: z-up\nmaterials: {m: {model: glass}}\n"
                                "objects: [{sphere: {centre: [0, 0, 10], radius: 10}, material: m}]\n");
        EXPECT_EQ(run.run({"check", "run.yaml"}), 0) << run.output();
        run.run({"--config", "run.yaml", "--frames", "1"});
        const auto warning = HasSubstr("rt_python does not support parts of the scene: glass.");
        if (warns) {
            EXPECT_THAT(run.output(), warning) << declaration;
        } else {
            EXPECT_THAT(run.output(), Not(warning)) << declaration;
        }
    }
}

TEST_F(PythonAdapter, ARayTracersScriptWritesLinearImagesAndReadsTheVideo) {
    ArhostRun run(raytracer);
    std::string scene = small_scene;
    run.write("scene.yaml", scene.replace(scene.find('1'), 1, "2"));
    // The colour of the square is that of the video's first pixel, which is the number of the frame.
    run.write("script.py", R"(
import arhost, numpy as np
def light(code): return code / 255 / 12.92 if code <= 10 else ((code / 255 + 0.055) / 1.055) ** 2.4
class Tracer:
    capabilities = arhost.RAYTRACER_CAPABILITY_EVERY_SCENE | arhost.RAYTRACER_CAPABILITY_LINEAR_IMAGES | arhost.RAYTRACER_CAPABILITY_VIDEO
    def __init__(self, host): pass
    def start(self, setup):
        assert (setup.form, setup.compositing) == (arhost.IMAGE_FORM_LINEAR, arhost.COMPOSITING_LINEAR)
        assert setup.video_format.width == setup.width
    def render(self, request, image):
        assert image.shape == (48, 64, 8) and image.dtype == np.float16, image.shape
        b, g, r = (int(code) for code in request.video.planes[0][0, 0])
        image[...] = 0, 0, 0, 0, 1, 1, 1, 0
        image[:16, :16] = light(b), light(g), light(170), 0, 0, 0, 0, 0
)");
    ASSERT_EQ(run.run({"--config", "run.yaml", "--verbose"}), 0) << run.output();
    EXPECT_EQ(expect_all_frames(run, 6), std::set<std::uint64_t>{});
    EXPECT_THAT(run.output(), Not(HasSubstr("cannot write linear images")));
}

TEST_F(PythonAdapter, ARayTracersScriptWithoutLinearImagesGetsStraightOnesAndNoVideo) {
    ArhostRun run(raytracer);
    std::string scene = small_scene;
    run.write("scene.yaml", scene.replace(scene.find('1'), 1, "2"));
    run.write("script.py", R"(
import arhost, numpy as np
class Tracer:
    def __init__(self, host): self.frame = 0
    def start(self, setup):
        assert setup.form == arhost.IMAGE_FORM_STRAIGHT and setup.video_format is None
    def render(self, request, image):
        assert image.shape == (48, 64, 4) and image.dtype == np.uint8 and request.video is None
        image[...] = 0
        image[:16, :16] = request.sequence, 0, 170, 255
)");
    ASSERT_EQ(run.run({"--config", "run.yaml", "--verbose"}), 0) << run.output();
    EXPECT_EQ(expect_all_frames(run, 6), std::set<std::uint64_t>{});
    EXPECT_THAT(run.output(), HasSubstr("rt_python cannot write linear images"));
}

// Compares the classes of arhost.pyi with the objects that the methods of a script receive.
TEST_F(PythonAdapter, TheTypeStubDescribesTheObjectsOfTheMethods) {
    const std::string check = R"(
import ast, arhost
stub = ast.parse(open(")" + arhost::test::source_directory() +
                              R"(/sdk/templates/python/arhost.pyi").read())
declared = {c.name: {f.target.id for f in c.body if isinstance(f, ast.AnnAssign)}
            for c in stub.body if isinstance(c, ast.ClassDef)}
missing = [f.target.id for f in stub.body if isinstance(f, ast.AnnAssign) and not hasattr(arhost, f.target.id)]
assert not missing, missing
undeclared = {n for n in dir(arhost) if n.isupper()} - {f.target.id for f in stub.body if isinstance(f, ast.AnnAssign)}
assert not undeclared, undeclared
def check(name, value):
    names = set(value.dtype.names) if hasattr(value, "dtype") else {n for n in vars(value) if n[0] != "_"}
    assert names == declared[name], (name, names ^ declared[name])
class Source:
    def __init__(self, host): pass
    def start(self, setup):
        check("SourceSetup", setup)
        return {"width": 64, "height": 48, "fps": 25}
    def read(self, buffer):
        check("FrameBuffer", buffer), check("FrameFormat", buffer.format)
        return None if buffer.sequence > 1 else 40_000_000 * buffer.sequence
class Tracker:
    def __init__(self, host): pass
    def start(self, setup):
        check("TrackerSetup", setup), check("Intrinsics", setup.intrinsics), check("MarkerConfig", setup.markers[0])
        check("TargetConfig", setup.targets[0])
    def track(self, frame):
        check("Frame", frame), [check("ExpectedMarker", each) for each in frame.expected]
        return [arhost.Observation(3, [[20, 15], [40, 15], [40, 35], [20, 35]])]
class Tracer:
    def __init__(self, host): pass
    capabilities = arhost.RAYTRACER_CAPABILITY_EVERY_SCENE | arhost.RAYTRACER_CAPABILITY_VIDEO
    def start(self, setup):
        check("RaytracerSetup", setup), check("Scene", setup.scene), check("FrameFormat", setup.video_format)
    def render(self, request, image):
        check("RenderRequest", request), check("Camera", request.camera), check("Video", request.video)
class Sink:
    def __init__(self, host): pass
    def start(self, setup): check("SinkSetup", setup)
    def write(self, output):
        check("Output", output), check("Record", output.record), check("Camera", output.record.camera)
        check("Target", output.record.targets[0]), check("Observation", output.record.observations[0])
        for each in output.record.expected: check("ExpectedMarker", each)
        assert len(output.record.expected) == output.record.expected_count == output.record.sequence, "none in frame 0"
)";
    ArhostRun run("version: 1\nsandbox: none\ncamera: {width: 64, height: 48, fx: 60}\n"
                  "source: {plugin: source_python, options: {script: script.py}}\n"
                  "tracker: {plugin: tracker_python, options: {script: script.py}, targets: [{marker: 3, family: "
                  "tag36h11, side_mm: 80}]}\n"
                  "raytracer: {plugin: rt_python, options: {script: script.py}, scene: scene.yaml}\n"
                  "outputs: [{plugin: sink_python, options: {script: script.py}}]\nstats: stats.json\n");
    EXPECT_EQ(run_script(run, check), 0) << run.output();
    EXPECT_EQ(run.stats()["frames"]["augmented"], 2) << run.output();
}
