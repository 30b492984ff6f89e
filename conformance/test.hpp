// SPDX-License-Identifier: Apache-2.0
//
// A test: one sentence that a plugin must keep, and a function that tries it. It runs in a process of its
// own and says what is wrong by throwing.
#pragma once

#include "conformance/picture.hpp"
#include "conformance/plugin_library.hpp"
#include "conformance/prints.hpp"
#include "conformance/verdict.hpp"

#include <arhost/plugin.h>

#include <chrono>
#include <filesystem>
#include <random>
#include <span>
#include <stdexcept>
#include <vector>

namespace arhost::conformance {

// The plugin is wrong: a sentence with numbers, and the images that show it. Any other std::exception is an
// error of the suite.
class Failure : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
    Failure with(std::string label, const Picture &picture) && {
        pictures.emplace_back(std::move(label), picture);
        return std::move(*this);
    }
    Failure at(unsigned x, unsigned y) && {
        wrong_pixel = {x, y};
        return std::move(*this);
    }
    std::vector<std::pair<std::string, Picture>> pictures;
    std::optional<std::array<unsigned, 2>> wrong_pixel;
};
struct Skip : std::runtime_error {
    using std::runtime_error::runtime_error;
};
struct Warning : std::runtime_error {
    using std::runtime_error::runtime_error;
};

// What a test is given.
struct Context {
    PluginLibrary &library;
    std::filesystem::path reference;       // the ray tracer to compare with
    std::mt19937_64 random;                // of the seed, the same for every test
    ipc::Json facts = ipc::Json::object(); // of abi.load: what the plugin tells of itself
    std::string note{};                    // beside a pass: what was measured
    double timeout_factor = 1;             // times what a test allows
    PrintFiles prints{};                   // of the markers that a tracker finds; none: the suite's own

    double uniform(double low, double high) {
        // std::uniform_real_distribution differs between libraries.
        return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
    }
};

struct Test {
    const char *name;    // "raytracer.miss-alpha"
    const char *promise; // what a plugin that passes does
    arhost_kind kind;    // 0: any
    const char *needs;   // the test without whose passing this one would say nothing; "": none
    std::chrono::milliseconds deadline;
    void (*run)(Context &);
    bool forks = false; // the suite itself, so the sandbox lets the plugin too
};

using namespace std::chrono_literals;

// In the order that they run in: what a test needs stands before it.
std::span<const Test> abi_tests();
std::span<const Test> raytracer_alpha_tests();
std::span<const Test> raytracer_camera_tests();
std::span<const Test> raytracer_image_tests();
std::span<const Test> raytracer_life_tests();
std::span<const Test> raytracer_light_tests();
std::span<const Test> raytracer_scene_tests();
std::span<const Test> tracker_image_tests();
std::span<const Test> tracker_life_tests();
std::span<const Test> tracker_pose_tests();
std::span<const Test> source_tests();
std::span<const Test> sink_tests();

// What some of the tests run in a further process; none of the suite's own.
std::span<const Test> helper_tests();

inline std::vector<Test> all_tests() {
    std::vector<Test> all;
    for (const auto part :
         {abi_tests(), raytracer_life_tests(), raytracer_alpha_tests(), raytracer_camera_tests(),
          raytracer_light_tests(), raytracer_scene_tests(), raytracer_image_tests(), tracker_life_tests(),
          tracker_pose_tests(), tracker_image_tests(), source_tests(), sink_tests()})
        all.insert(all.end(), part.begin(), part.end());
    return all;
}

} // namespace arhost::conformance
