// SPDX-License-Identifier: Apache-2.0
//
// Decodes primitives with KHR_draco_mesh_compression. Private to core/scene.
#pragma once

#include "scene/gltf/compression.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace draco {
class Mesh;
}

namespace arhost::scene {

class DracoMesh {
public:
    // `node`: what has the compressed bytes, for messages. Throws MeshError.
    DracoMesh(std::span<const unsigned char> bytes, const JsonNode &node, ExpansionBudget &budget);
    ~DracoMesh();

    struct Attribute {
        int component_type, type; // TINYGLTF_COMPONENT_TYPE_…, TINYGLTF_TYPE_…
        std::vector<unsigned char> values;
    };
    std::size_t vertex_count() const;
    Attribute attribute(std::uint32_t id, const JsonNode &node) const; // throws MeshError
    std::vector<unsigned char> triangles() const;                      // three uint32_t each

private:
    std::unique_ptr<draco::Mesh> mesh_;
};

} // namespace arhost::scene
