// SPDX-License-Identifier: Apache-2.0
//
// `conform: true` in a run of the real arhost.
#include "arhost_run.hpp"

#include <gmock/gmock.h>

#include <set>

namespace arhost::test {
namespace {

using testing::HasSubstr;

std::string configuration(const std::string &raytracer, const std::string &more = "") {
    return R"(version: 1
source: {plugin: source_synthetic, options: {frames: 40, width: 320, height: 240}, conform: true}
camera: {width: 320, height: 240, fx: 300}
tracker: {plugin: tracker_aruco, markers: [{id: 0, side_mm: 80}], conform: true}
raytracer: {plugin: )" +
           raytracer + R"(, scene: scene.yaml, conform: true, reads: [)" ARHOST_PLUGIN_DIRECTORY R"(]}
outputs: [{plugin: sink_null}]
stats: stats.json
)" + more;
}

constexpr const char *scene = R"(version: 1
axes: z-up
materials: {grey: {model: diffuse, diffuse: 0.5}}
lights: [{position: [100, -100, 300], intensity: 1, falloff: none}]
objects:
  - {name: paper, plane: {size: 300}, material: grey, role: catcher}
  - {name: ball, sphere: {centre: [0, 0, 10], radius: 10}, material: grey}
)";

// The same wrong ray tracer as the suite's own tests have.
void expect_broken(const std::string &defect, const std::set<std::string> &promises) {
    ArhostRun run(configuration("./rt_" + defect + ".so"));
    run.write("scene.yaml", scene);
    std::filesystem::create_symlink(ARHOST_WRONG_PLUGIN_DIRECTORY "/wrong.so", run.path("rt_" + defect + ".so"));
    ASSERT_EQ(run.run(), 0) << run.output(); // it tells, and the video goes on
    for (const std::string &promise : promises) {
        EXPECT_THAT(run.output(), HasSubstr("warning: raytracer: breaks the promise " + promise + ": frame "));
        EXPECT_THAT(run.output(), HasSubstr(promise + ": broken in "));
    }
    const auto conformance = run.stats()["conformance"];
    for (const auto &[name, entry] : conformance.items())
        EXPECT_EQ(entry["broken"] > 0, promises.contains(name)) << defect << ": " << name;
}

TEST(LiveConformance, FindsNothingWrongWithArhostsOwn) {
    ArhostRun run(configuration("rt_embree"));
    run.write("scene.yaml", scene);
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("conform: 7 of 7 promises kept"));
    const auto stats = run.stats();
    for (const char *promise : {"source.frame-stays", "tracker.order", "tracker.numbers", "tracker.pose",
                                "raytracer.region", "raytracer.place", "raytracer.image-stays"}) {
        EXPECT_EQ(stats["conformance"][promise]["looked"], 40) << promise;
        EXPECT_EQ(stats["conformance"][promise]["broken"], 0) << promise;
    }
}

TEST(LiveConformance, TellsOfARayTracerThatIsWrong) {
    expect_broken("opaque_background", {"raytracer.place", "raytracer.region"});
    expect_broken("small_region", {"raytracer.region"});
}

TEST(LiveConformance, IsOffUnlessAskedFor) {
    ArhostRun run(
        "version: 1\nsource: {plugin: source_synthetic, options: {frames: 2}}\noutputs: [{plugin: sink_null}]\n"
        "stats: stats.json\n");
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_FALSE(run.stats().contains("conformance"));
    EXPECT_THAT(run.output(), testing::Not(HasSubstr("conform")));
}

} // namespace
} // namespace arhost::test
