// SPDX-License-Identifier: Apache-2.0
//
// Compressed meshes in glTF files: KHR_draco_mesh_compression and EXT_meshopt_compression. tinygltf loads the
// compressed bytes as the content of buffer views; decompress() replaces them. Private to core/scene.
#pragma once

#include "scene/gltf/file.hpp"
#include "scene/gltf/json_node.hpp"

#include <cstdint>
#include <string>

namespace arhost::scene {

// Limits what the compressed meshes of a file may expand to, in total.
class ExpansionBudget {
public:
    explicit ExpansionBudget(std::uint64_t bytes) : limit_(bytes), left_(bytes) {}
    // Call it before allocating. Throws MeshError with the path of `node` if nothing is left.
    void take(std::uint64_t bytes, const JsonNode &node);

private:
    std::uint64_t limit_, left_;
};

// Returns the JSON of a file as tinygltf can load it: compressed buffer views have their compressed bytes, buffers
// for readers without decoders are empty, textures have the image that arhost prefers, and the primitives of Draco
// have no indices yet. Throws MeshError. `name`: of the file.
nlohmann::json plain_json(const nlohmann::json &json, const std::string &name);

// Decodes all compressed buffer views and primitives of a file that was loaded with plain_json(file.json). Throws
// MeshError.
void decompress(GltfFile &file, const std::string &name, const Reporter &reporter);

} // namespace arhost::scene
