// SPDX-License-Identifier: Apache-2.0
//
// The materials of a glTF file. Private to core/scene.
#pragma once

#include "scene/gltf/accessors.hpp"
#include "scene/gltf/json_node.hpp"
#include "scene/textures.hpp"

#include <filesystem>
#include <map>
#include <string>

namespace arhost::scene {

// arhost decodes no KTX2 images. Users can convert them with this command.
inline constexpr const char *ktx2_extension = "KHR_texture_basisu";
inline constexpr const char *ktx2_conversion =
    "convert its KTX2 images to PNG with KTX-Software: npx @gltf-transform/cli ktxdecompress MODEL.glb PNG.glb";

class GltfMaterials {
public:
    // The arguments must outlive this object. `name`: of the file, for messages.
    GltfMaterials(ArenaBuilder &builder, Textures &textures, const std::filesystem::path &file,
                  const std::string &name, const GltfFile &content, const Accessors &accessors)
        : builder_(builder), textures_(textures), file_(file), name_(name), content_(content), accessors_(accessors) {
    }

    struct Material {
        std::uint32_t index; // in the arena
        bool is_double_sided;
    };
    // Returns a material of the file, or for −1 the default material. Adds it to the arena at the first call.
    const Material &at(int index);

    // Adapts volumes to a scale of the file's lengths. Call it once, after the last call of at().
    void scale_volumes(double scale);

private:
    Material read(const JsonNode &node);
    void read_opacity(const JsonNode &node, float factor, arhost_material &material) const;
    void read_specular(const JsonNode &node, arhost_material &material);
    void read_transmission(const JsonNode &node, arhost_material &material);
    void read_clearcoat(const JsonNode &node, arhost_material &material);
    void read_sheen(const JsonNode &node, arhost_material &material);
    void read_anisotropy(const JsonNode &node, arhost_material &material);
    void read_iridescence(const JsonNode &node, arhost_material &material);
    // Returns ARHOST_NONE if `parent` has no such texture.
    std::uint32_t texture_of(const JsonNode &parent, const char *key, bool is_colour);

    ArenaBuilder &builder_;
    Textures &textures_;
    const std::filesystem::path &file_;
    const std::string &name_;
    const GltfFile &content_;
    const Accessors &accessors_;
    std::map<int, Material> known_; // key: index in the file
};

} // namespace arhost::scene
