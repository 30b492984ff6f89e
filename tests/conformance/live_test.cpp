// SPDX-License-Identifier: Apache-2.0
//
// `conform: true` in a run of the real arhost.
#include "arhost_run.hpp"

#include <arhost/sink.h>
#include <directories.hpp>
#include <gmock/gmock.h>

#include <algorithm>
#include <set>

namespace arhost::test {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr const char *lens =
    "{width: 320, height: 240, fx: 300, distortion: {model: brown, coefficients: [-0.2, 0.05, "
    "0.001, -0.002]}}";

constexpr const char *scene = R"(version: 1
axes: z-up
materials: {grey: {model: diffuse, diffuse: 0.5}}
lights: [{position: [100, -100, 300], intensity: 1, falloff: none}]
objects:
  - {name: paper, plane: {size: 300}, material: grey, role: catcher}
  - {name: ball, sphere: {centre: [0, 0, 10], radius: 10}, material: grey}
)";
// From 0.5 m, the ball covers every pixel.
constexpr const char *scene_of_one_big_ball = R"(version: 1
axes: z-up
materials: {grey: {model: diffuse, diffuse: 0.5}}
objects: [{sphere: {centre: [0, 0, 0], radius: 300}, material: grey}]
)";

// Sections of the configuration. Tests replace some of them.
struct Parts {
    std::string source = "{plugin: source_synthetic, fps: 30, options: {frames: 40}, conform: true}";
    std::string camera = "{width: 320, height: 240, fx: 300}";
    std::string tracker =
        "{plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}], conform: true}";
    std::string raytracer = "{plugin: rt_embree, scene: scene.yaml, conform: true}"; // "": none
    std::string output = "{plugin: sink_null}";
    std::string more = "mode: lockstep\n";
    std::string scene = test::scene;

    std::string text() const {
        return "version: 1\nsource: " + source + "\ncamera: " + camera + "\n" +
               (tracker.empty() ? "" : "tracker: " + tracker + "\n") +
               (raytracer.empty() ? "" : "raytracer: " + raytracer + "\n") + "outputs: [" + output +
               "]\nstats: stats.json\n" + more;
    }
};

// The suite's wrong plugin with this defect, with read access to the shipped plugin that it wraps.
std::string wrong(const std::string &kind, const std::string &defect, const std::string &more) {
    return "{plugin: ./" + kind + "_" + defect + ".so, conform: true, reads: [" + arhost::test::plugin_directory() +
           "], " + more + "}";
}
Parts with_raytracer(const std::string &defect) {
    Parts parts;
    parts.raytracer = wrong("rt", defect, "scene: scene.yaml");
    return parts;
}
Parts with_tracker(const std::string &defect) {
    Parts parts;
    parts.tracker = wrong("tracker", defect, "targets: [{marker: 0, family: tag36h11, side_mm: 80}]");
    parts.raytracer.clear();
    return parts;
}
// The test plugins that encode frame numbers in pixels and read them.
Parts with_counters(const std::string &source_options, const std::string &tracker_options,
                    const std::string &raytracer_options) {
    Parts parts;
    parts.source = "{plugin: source_counter, options: {frames: 40, width: 320, height: 240, " + source_options +
                   "}, conform: true}";
    parts.tracker = "{plugin: tracker_counter, options: {" + tracker_options +
                    "}, targets: [{marker: 3, family: tag36h11, side_mm: 80}, "
                    "{marker: 5, family: tag36h11, side_mm: 40}], conform: true}";
    parts.raytracer = "{plugin: rt_counter, options: {" + raytracer_options + "}, scene: scene.yaml, conform: true}";
    parts.scene = scene_of_one_big_ball;
    return parts;
}

class LiveRun : public ArhostRun {
public:
    explicit LiveRun(const Parts &parts) : ArhostRun(parts.text()) {
        write("scene.yaml", parts.scene);
        for (const auto &[kind, file] : {std::pair("rt", "wrong"), std::pair("tracker", "wrong_tracker"),
                                         std::pair("body", "wrong_body"), std::pair("source", "wrong_source")}) {
            const std::string text = parts.text(), begin = std::string("./") + kind + "_";
            if (const std::size_t at = text.find(begin); at != std::string::npos)
                std::filesystem::create_symlink(arhost::test::wrong_plugin_directory() + "/" + file + ".so",
                                                path(text.substr(at, text.find(',', at) - at)));
        }
    }
    std::set<std::string> checks(bool violated) const {
        std::set<std::string> names;
        const nlohmann::json report = stats();
        for (const auto &[name, entry] : report.at("conformance").items())
            if ((entry["violations"] > 0) == violated)
                names.insert(name);
        return names;
    }
};

void expect_violations(const Parts &parts, const std::set<std::string> &checks) {
    SCOPED_TRACE(parts.text());
    LiveRun run(parts);
    // Violations are reported, and the run continues. The wrong corners are those of no target.
    ASSERT_EQ(run.run({"--config", "run.yaml", "--allow-no-target"}), 0) << run.output();
    EXPECT_EQ(run.checks(true), checks) << run.output();
    for (const std::string &check : checks) {
        const std::string component = check.substr(0, check.find('.'));
        EXPECT_THAT(run.output(),
                    HasSubstr("warning: " + component + ": violates the contract: " + check + ": frame "));
        EXPECT_THAT(run.output(), HasSubstr(check + ": contract violated in "));
    }
}

const std::set<std::string> source_checks = {"source.clock", "source.capture-time", "source.rate",
                                             "source.frame-stays"};
const std::set<std::string> all_checks = {
    "source.clock",    "source.capture-time", "source.rate",      "source.frame-stays", "tracker.corners",
    "tracker.repeats", "tracker.covariance",  "raytracer.region", "raytracer.place",    "raytracer.image-stays"};

void expect_no_violations(const Parts &parts, const std::set<std::string> &checks = all_checks) {
    SCOPED_TRACE(parts.text());
    LiveRun run(parts);
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_EQ(run.checks(false), checks) << run.output();
    EXPECT_EQ(run.checks(true), std::set<std::string>()) << run.output();
}

// ---- Mode lockstep ----

TEST(LiveConformance, FindsNoViolationInShippedPlugins) {
    LiveRun run((Parts()));
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("conform: 10 of 10 contract checks passed"));
    const auto stats = run.stats();
    for (const std::string &check : all_checks) {
        EXPECT_EQ(stats["conformance"][check]["checked"], 40) << check;
        EXPECT_EQ(stats["conformance"][check]["violations"], 0) << check;
    }
}

TEST(LiveConformance, ReportsSourceViolations) {
    Parts writes_later = with_counters("writes_later: true", "", "");
    writes_later.tracker.clear();
    writes_later.raytracer.clear();
    writes_later.output =
        "{plugin: sink_counter, path: counted.txt, options: {delay_ms: 10}}"; // frames wait in the queue
    expect_violations(writes_later, {"source.frame-stays"});
    expect_violations(with_counters("ahead_ms: 300", "", ""), {"source.capture-time"});
    for (const auto &[defect, check] :
         {std::pair("changes_clocks", "source.clock"), std::pair("negative_media_time", "source.capture-time"),
          std::pair("times_jump", "source.rate"), std::pair("times_in_microseconds", "source.rate")}) {
        Parts parts;
        parts.source = wrong("source", defect, "fps: 50");
        parts.camera = "{width: 62, height: 46, fx: 70}";
        parts.tracker.clear();
        parts.raytracer.clear();
        expect_violations(parts, {check});
    }
}

TEST(LiveConformance, ReportsTrackerViolations) {
    expect_violations(with_tracker("corners_counter_clockwise"), {"tracker.corners"});
    expect_violations(with_tracker("each_marker_twice"), {"tracker.repeats"});
    Parts body;
    body.tracker = wrong("body", "asymmetric_covariance", "targets: [{name: head, body: head}]");
    body.raytracer.clear();
    expect_violations(body, {"tracker.covariance"});
}

TEST(LiveConformance, ReportsRayTracerViolations) {
    expect_violations(with_raytracer("opaque_background"), {"raytracer.place", "raytracer.region"});
    expect_violations(with_raytracer("region_too_narrow"), {"raytracer.region"});
    Parts writes_later = with_counters("", "", "writes_later: true");
    writes_later.output =
        "{plugin: sink_counter, path: counted.txt, options: {delay_ms: 10}}"; // images wait in the queue
    expect_violations(writes_later, {"raytracer.image-stays"});
}

TEST(LiveConformance, IsOffByDefault) {
    ArhostRun run(
        "version: 1\nsource: {plugin: source_synthetic, options: {frames: 2}}\noutputs: [{plugin: sink_null}]\n"
        "stats: stats.json\n");
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_FALSE(run.stats().contains("conformance"));
    EXPECT_THAT(run.output(), Not(HasSubstr("conform")));
}

// ---- Lens, mode live, lost markers, restarts ----

TEST(LiveConformance, ChecksThePlaceWithLensDistortion) {
    Parts parts;
    parts.camera = lens;
    expect_no_violations(parts, all_checks);
}

TEST(LiveConformance, ChecksImagesThatTheWorkerWarpsToTheLens) {
    Parts parts = with_counters("", "", "");
    parts.camera = lens;
    parts.tracker =
        "{plugin: tracker_counter, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}"; // ignores the lens
    std::set<std::string> checks = source_checks;
    checks.merge(std::set<std::string>{"raytracer.region", "raytracer.place", "raytracer.image-stays"});
    expect_no_violations(parts, checks);
    parts.scene = scene; // its ball is not where rt_counter draws
    expect_violations(parts, {"raytracer.place"});
}

TEST(LiveConformance, ReportsTheSameInModeLive) {
    Parts parts;
    parts.more = "mode: live\n";
    expect_no_violations(parts);
    parts = with_raytracer("opaque_background");
    parts.more = "mode: live\n";
    expect_violations(parts, {"raytracer.place", "raytracer.region"});
    parts = with_tracker("corners_counter_clockwise");
    parts.more = "mode: live\n";
    expect_violations(parts, {"tracker.corners"});
}

TEST(LiveConformance, AcceptsAHeldPose) {
    Parts parts;
    parts.source =
        "{plugin: source_synthetic, options: {frames: 30, occlude_from: 10, occlude_to: 20}, conform: true}";
    parts.tracker = "{plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}], hold_frames: 5, "
                    "conform: true}";
    parts.output = "{plugin: sink_poses, path: poses.jsonl}";
    LiveRun run(parts);
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_THAT(run.read("poses.jsonl"), HasSubstr("\"held\""));
    EXPECT_EQ(run.checks(false), all_checks) << run.output();
}

class LiveConformanceAfterARestart : public testing::TestWithParam<const char *> {};

TEST_P(LiveConformanceAfterARestart, ContinuesChecking) {
    Parts parts;
    parts.source =
        "{plugin: source_synthetic, fps: 30, options: {frames: 100000}, conform: true}"; // longer than the test
    parts.output = "{plugin: sink_counter, path: counted.txt, options: {delay_ms: 20}}";
    parts.more = std::string("mode: ") + GetParam() + "\n";
    LiveRun run(parts);
    run.start();
    const auto augmented = [&] {
        const auto lines = counted(run);
        return static_cast<std::size_t>(
            std::ranges::count_if(lines, [](const auto &l) { return l.kind != ARHOST_OVERLAY_NONE; }));
    };
    std::size_t shown = 0; // with an overlay
    const auto wait_for_more = [&](std::size_t frames) {
        shown += frames;
        EXPECT_TRUE(run.eventually([&] { return augmented() >= shown; })) << run.output();
    };
    for (const char *plugin : {"source_synthetic", "tracker_aruco", "rt_embree"}) {
        wait_for_more(12);
        const pid_t worker = run.worker(plugin);
        ASSERT_GT(worker, 0) << plugin << run.output();
        ::kill(worker, SIGKILL);
    }
    const std::size_t before = shown;
    wait_for_more(30);
    ::kill(run.pid(), SIGINT);
    ASSERT_EQ(run.wait(), 130) << run.output();
    const nlohmann::json stats = run.stats();
    for (const char *component : {"source", "tracker", "raytracer"})
        EXPECT_EQ(stats["restarts"][component], 1) << component;
    for (const auto &[name, entry] : stats["conformance"].items())
        EXPECT_GT(entry["checked"], before) << name;
    EXPECT_EQ(run.checks(false), all_checks) << run.output();
    EXPECT_EQ(run.checks(true), std::set<std::string>()) << run.output();
}

INSTANTIATE_TEST_SUITE_P(Modes, LiveConformanceAfterARestart, testing::Values("lockstep", "live"),
                         [](const auto &info) { return std::string(info.param); });

} // namespace
} // namespace arhost::test
