// SPDX-License-Identifier: Apache-2.0
//
// Checks that repeated starts and stops with alternating scenes do not leak. `tools/bench gpu` does the same with
// 10,000 images.
#include "long_run.hpp"
#include "two_tracers.hpp"

#include <gtest/gtest.h>

namespace arhost::test {
namespace {

const std::vector<std::filesystem::path> scenes{ARHOST_SOURCE_DIRECTORY "/config/scenes/demo.yaml",
                                                ARHOST_SOURCE_DIRECTORY "/config/scenes/moving.yaml"};
constexpr int changes = 10, images = 10;

TEST(LongRun, DoesNotLeak) {
    ARHOST_REQUIRE_VULKAN();
    const LongRun run = long_run(scenes, changes, images, {});
    const LongRun::State &middle = run.states[changes / 2], &last = run.states.back();
    EXPECT_EQ(last.files, middle.files);
    // The plugin is started four times between the two measurements. A leak of 1 MiB per start exceeds the tolerance
    // of 3 MiB.
    EXPECT_LE(last.memory_mib, middle.memory_mib + 3);
}

TEST(LongRun, HasNoValidationMessages) {
    ARHOST_REQUIRE_VULKAN();
    PluginUnderTest plugin("rt_vulkan");
    if (plugin.create({{"validate", "true"}}) != ARHOST_STATUS_OK)
        GTEST_SKIP() << plugin.log();
    const LongRun run = long_run(scenes, changes, images, {{"validate", "true"}});
    EXPECT_EQ(run.validation_messages(), 0u) << run.log;
}

} // namespace
} // namespace arhost::test
