// SPDX-License-Identifier: Apache-2.0
//
// Runs the suite on a shipped plugin in a given configuration.
#pragma once

#include "conform_run.hpp"

#include <directories.hpp>
#include <gtest/gtest.h>

namespace arhost::test {

struct OwnPlugin {
    std::string name, plugin;
    std::vector<std::string> settings;
    std::string allow = "";
};
inline std::ostream &operator<<(std::ostream &stream, const OwnPlugin &configuration) {
    return stream << configuration.name;
}

inline void expect_to_pass(const OwnPlugin &configuration) {
    // Input of source_file: 12 pictures and a video of them.
    ArhostRun run("version: 1\n"
                  "source: {plugin: source_synthetic, options: {width: 160, height: 120, frames: 12}}\n"
                  "outputs: [{plugin: sink_images, path: in/%02d.png}, {plugin: sink_video, path: in/a.mp4}]\n");
    if (configuration.plugin == "source_file") {
        ASSERT_EQ(run.run(), 0) << run.output();
    }
    std::vector<std::string> arguments = {
        "conform",          arhost::test::plugin_directory() + "/" + configuration.plugin + ".so",
        "--jobs",           "1",
        "--timeout-factor", "3",
        "--json",           "results.json"};
    for (const std::string &setting : configuration.settings)
        arguments.insert(arguments.end(), {"--set", setting});
    if (!configuration.allow.empty())
        arguments.insert(arguments.end(), {"--allow", configuration.allow});
    run.start(arguments);
    EXPECT_EQ(run.wait(std::chrono::minutes(3)), 0) << run.output();
    const nlohmann::json report = nlohmann::json::parse(run.read("results.json"));
    for (const nlohmann::json &result : report.at("results"))
        if (configuration.plugin == "sink_video" && result.at("test") == "sink.order") {
            EXPECT_EQ(result.at("verdict"), "pass") << result;
        }
    for (const nlohmann::json &result : report.at("results"))
        if (result.at("verdict") == "skip" && result.at("test").get<std::string>().ends_with(".start"))
            GTEST_SKIP() << result.at("message").get<std::string>();
}

} // namespace arhost::test
