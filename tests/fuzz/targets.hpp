// SPDX-License-Identifier: Apache-2.0
//
// What reads bytes that arhost did not make. Each target takes any bytes and returns; it throws or crashes only
// where there is a defect. `tools/fuzz` runs them under libFuzzer, corpus_test.cpp on the inputs that are kept.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

namespace arhost::fuzz {

using Bytes = std::span<const std::uint8_t>;

struct Target {
    std::string_view name; // and of its folder in corpus/
    void (*run)(Bytes);
    unsigned tries; // by corpus_test.cpp: what takes some seconds
};

void run_configuration(Bytes); // YAML, and the options of the plugins in it
void run_calibration(Bytes);
void run_trajectory(Bytes);
void run_pattern(Bytes); // a NUL between the pattern and a file's name
void run_scene(Bytes);
void run_obj(Bytes);
void run_ply(Bytes);
void run_gltf(Bytes);  // .glb too
void run_arena(Bytes); // what the loader's process hands to the host
void run_ring(Bytes);  // what a worker writes into the memory that it shares with the host
void run_host(Bytes);  // the whole host: all that its workers send, write, and leave undone

inline constexpr Target targets[] = {
    {"configuration", run_configuration, 8000},
    {"calibration", run_calibration, 15000},
    {"trajectory", run_trajectory, 15000},
    {"pattern", run_pattern, 20000},
    {"scene", run_scene, 8000},
    {"obj", run_obj, 15000},
    {"ply", run_ply, 15000},
    {"gltf", run_gltf, 8000},
    {"arena", run_arena, 20000},
    {"ring", run_ring, 20000},
    {"host", run_host, 1000},
};

// A folder of this process's own, in memory where there is such a place.
const std::filesystem::path &scratch();
std::filesystem::path write_scratch(const std::filesystem::path &name, Bytes content);

} // namespace arhost::fuzz
