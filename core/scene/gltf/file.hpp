// SPDX-License-Identifier: Apache-2.0
//
// Reads glTF files, .gltf and .glb. Private to core/scene.
#pragma once

#include "scene/callbacks.hpp"
#include "scene/mesh_file.hpp"

#include <nlohmann/json.hpp>
#include <tiny_gltf.h>

#include <filesystem>
#include <span>
#include <string>

namespace arhost::scene {

struct GltfFile {
    tinygltf::Model model; // meshes are decompressed, images are still encoded
    nlohmann::json json;   // an object
};

// Reads a file and its buffers and images, which must be below its folder or one of `reads` (without links). Throws
// MeshError.
GltfFile read_gltf_file(const std::filesystem::path &file, std::span<const std::filesystem::path> reads,
                        const Reporter &reporter);

} // namespace arhost::scene
