// SPDX-License-Identifier: Apache-2.0
//
// Fuzz targets for all code that reads untrusted bytes. Each target must accept any bytes and return; an exception or
// a crash is a bug. `tools/fuzz` runs the targets under libFuzzer, and corpus_test.cpp runs them on the corpus.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

namespace arhost::fuzz {

using Bytes = std::span<const std::uint8_t>;

struct Target {
    std::string_view name; // also the name of its folder in corpus/
    void (*run)(Bytes);
    unsigned tries; // number of mutations in corpus_test.cpp, which take some seconds
};

void run_configuration(Bytes); // YAML, including plugin options
void run_calibration(Bytes);
void run_trajectory(Bytes);
void run_map(Bytes);         // of markers
void run_session(Bytes);     // session.json, a NUL, configuration.yaml, a NUL, frames.jsonl
void run_session_log(Bytes); // a log as the worker that has read it passes it to the host
void run_patt(Bytes);        // a pattern of ARToolKit
void run_pattern(Bytes);     // input: a pattern, a NUL, a file name
void run_scene(Bytes);
void run_obj(Bytes);
void run_mtl(Bytes);
void run_ply(Bytes);
void run_stl(Bytes);
void run_gltf(Bytes);    // including .glb
void run_draco(Bytes);   // the compressed mesh in a glTF file
void run_meshopt(Bytes); // mode, filter, stride and count of a compressed buffer view, then its bytes
void run_webp(Bytes);
void run_arena(Bytes);           // the output of the scene loader process
void run_ring(Bytes);            // shared memory that a worker writes
void run_host(Bytes);            // the whole host with misbehaving workers
void run_uvc_descriptors(Bytes); // of a USB camera
void run_uvc_payloads(Bytes);    // and its clock
void run_uvc_frames(Bytes);      // Motion-JPEG
void run_web(Bytes);             // requests to sink_web

inline constexpr Target targets[] = {
    {"configuration", run_configuration, 8000},
    {"calibration", run_calibration, 15000},
    {"trajectory", run_trajectory, 15000},
    {"map", run_map, 8000},
    {"session", run_session, 8000},
    {"session_log", run_session_log, 8000},
    {"patt", run_patt, 15000},
    {"pattern", run_pattern, 20000},
    {"scene", run_scene, 8000},
    {"obj", run_obj, 15000},
    {"mtl", run_mtl, 2000},
    {"ply", run_ply, 15000},
    {"stl", run_stl, 15000},
    {"gltf", run_gltf, 8000},
    {"draco", run_draco, 4000},
    {"meshopt", run_meshopt, 4000},
    {"webp", run_webp, 8000},
    {"arena", run_arena, 20000},
    {"ring", run_ring, 20000},
    {"host", run_host, 1000},
    {"uvc_descriptors", run_uvc_descriptors, 20000},
    {"uvc_payloads", run_uvc_payloads, 20000},
    {"uvc_frames", run_uvc_frames, 20000},
    {"web", run_web, 4000},
};

// Returns the scratch folder of this process. It is in /dev/shm if available.
const std::filesystem::path &scratch();
std::filesystem::path write_scratch(const std::filesystem::path &name, Bytes content);

} // namespace arhost::fuzz
