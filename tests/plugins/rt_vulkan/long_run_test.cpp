// SPDX-License-Identifier: Apache-2.0
//
// Checks that repeated starts and stops with alternating scenes do not leak. `tools/bench gpu` does the same with
// 10,000 images.
#include "long_run.hpp"
#include "two_tracers.hpp"

#include <directories.hpp>
#include <gtest/gtest.h>

namespace arhost::test {
namespace {

const std::vector<std::filesystem::path> scenes{arhost::test::source_directory() + "/config/scenes/demo.yaml",
                                                arhost::test::source_directory() + "/config/scenes/moving.yaml"};

struct Length {
    int changes, images; // scene changes; images per scene
};
class LongRuns : public testing::TestWithParam<Length> {
protected:
    static LongRun run(const Options &options) {
        return long_run(scenes, GetParam().changes, GetParam().images, options);
    }
};
constexpr auto name_of = [](const auto &info) { return std::to_string(info.param.changes) + "Changes"; };
INSTANTIATE_TEST_SUITE_P(Sample, LongRuns, testing::Values(Length{10, 2}), name_of);
INSTANTIATE_TEST_SUITE_P(Exhaustive, LongRuns, testing::Values(Length{50, 40}), name_of);

TEST_P(LongRuns, DoNotLeak) {
    ARHOST_REQUIRE_VULKAN();
    const LongRun measured = run({});
    const LongRun::State &middle = measured.states[measured.states.size() / 2], &last = measured.states.back();
    EXPECT_EQ(last.files, middle.files);
    // The plugin is started at least four times between the two measurements. A leak of 1 MiB per start exceeds the
    // tolerance of 3 MiB.
    EXPECT_LE(last.memory_mib, middle.memory_mib + 3);
}

TEST_P(LongRuns, HaveNoValidationMessages) {
    ARHOST_REQUIRE_VULKAN();
    PluginUnderTest plugin("rt_vulkan");
    if (plugin.create({{"validate", "true"}}) != ARHOST_STATUS_OK)
        GTEST_SKIP() << plugin.log();
    const LongRun validated = run({{"validate", "true"}});
    EXPECT_EQ(validated.validation_messages(), 0u) << validated.log;
}

} // namespace
} // namespace arhost::test
