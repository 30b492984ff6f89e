// SPDX-License-Identifier: Apache-2.0
//
// Decodes buffer views with EXT_meshopt_compression. Private to core/scene.
#pragma once

#include "scene/gltf/compression.hpp"

#include <span>
#include <vector>

namespace arhost::scene {

// `extension`: the extension object of the view. Throws MeshError.
std::vector<unsigned char> decode_meshopt(std::span<const unsigned char> bytes, const JsonNode &extension,
                                          ExpansionBudget &budget);

} // namespace arhost::scene
