// SPDX-License-Identifier: Apache-2.0
// A test: a requirement of the ABI and a function that checks it. It runs in its own process and reports a violation
// by throwing.
#pragma once

#include "conformance/plugin_library.hpp"
#include "conformance/prints.hpp"
#include "conformance/verdict.hpp"

#include <arhost/plugin.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <random>
#include <span>
#include <string_view>
#include <vector>

namespace arhost::conformance {

// Input of a test.
struct Context {
    PluginLibrary &library;
    std::filesystem::path reference; // the ray tracer to compare images with
    std::mt19937_64 random;          // seeded the same for every test
    std::optional<Facts> facts{};
    std::string note{};        // measurements, reported if the test passes
    double timeout_factor = 1; // multiplies each time limit
    PrintFiles prints{};       // markers that the tracker detects; empty: the suite's own
    std::string family{};      // of these markers; empty: the tracker detects no markers
    std::string body{};        // that the tracker reports the pose of; empty: none

    double uniform(double low, double high) {
        // std::uniform_real_distribution differs between standard libraries.
        return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
    }
};

struct Test {
    const char *name;        // "raytracer.miss-alpha"; "abi.load" for plugins of every kind
    const char *requirement; // one sentence about the plugin
    const char *needs;       // a test that must pass for this one to be meaningful, or ""
    std::chrono::milliseconds deadline;
    void (*run)(Context &);
    bool forks = false; // the test forks, so the sandbox allows it

    arhost_kind kind() const { // from the name; 0: every kind
        constexpr std::string_view prefixes[] = {"abi", "source", "tracker", "raytracer", "sink"};
        static_assert(ARHOST_KIND_SOURCE == 1 && ARHOST_KIND_SINK == 4);
        const std::string_view prefix(name, std::strchr(name, '.') - name);
        return static_cast<arhost_kind>(std::ranges::find(prefixes, prefix) - prefixes);
    }
};

using namespace std::chrono_literals;

// In order of execution: a test comes after the one that it needs.
std::span<const Test> abi_tests();
std::span<const Test> raytracer_alpha_tests();
std::span<const Test> raytracer_camera_tests();
std::span<const Test> raytracer_image_tests();
std::span<const Test> raytracer_life_tests();
std::span<const Test> raytracer_light_tests();
std::span<const Test> raytracer_linear_tests();
std::span<const Test> raytracer_scene_tests();
std::span<const Test> raytracer_video_tests();
std::span<const Test> tracker_body_tests();
std::span<const Test> tracker_image_tests();
std::span<const Test> tracker_life_tests();
std::span<const Test> tracker_corner_tests();
std::span<const Test> source_tests();
std::span<const Test> sink_tests();

// Run by tests in additional processes; not listed.
std::span<const Test> helper_tests();

inline std::vector<Test> all_tests() {
    std::vector<Test> all;
    for (const auto part :
         {abi_tests(), raytracer_life_tests(), raytracer_alpha_tests(), raytracer_camera_tests(),
          raytracer_light_tests(), raytracer_scene_tests(), raytracer_image_tests(), raytracer_linear_tests(),
          raytracer_video_tests(), tracker_life_tests(), tracker_corner_tests(), tracker_image_tests(),
          tracker_body_tests(), source_tests(), sink_tests()})
        all.insert(all.end(), part.begin(), part.end());
    return all;
}

} // namespace arhost::conformance
