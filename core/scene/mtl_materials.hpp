// SPDX-License-Identifier: Apache-2.0
//
// The materials of an OBJ file as materials of the arena. Private to core/scene.
#pragma once

#include "scene/mtl.hpp"
#include "scene/referred_files.hpp"
#include "scene/textures.hpp"

#include <filesystem>
#include <map>
#include <set>
#include <span>
#include <string>

namespace arhost::scene {

// Converts materials to metallic-roughness, glass, or unlit (illum 0):
// - Roughness: Pr, or from Ns, the exponent of Blinn-Phong: alpha² = 2/(Ns + 2) (Walter et al., Microfacet Models
//   for Refraction, EGSR 2007, section 5.2), and roughness² = alpha.
// - Reflectance at normal incidence: 0.08 Ks, as Blender writes it, so that Ks = 0.5 is a refractive index of 1.5.
// With
//   illum 3, 5 or 8, which reflect the surroundings in proportion to Ks, it is Ks.
// - Glass: illum 6 and 7; d < 1 with Tf or with illum 4 or 9, if there is no map_d. Maya writes illum 4 and Tf for
//   opaque materials. Other materials with d < 1 or map_d blend.
class MtlMaterials {
public:
    // Reads the MTL files of the OBJ file `obj`. These and their images must be below its folder or one of `reads`,
    // which have no links. Throws MeshError.
    MtlMaterials(ArenaBuilder &builder, Textures &textures, const std::filesystem::path &obj,
                 const MaterialUses &uses, std::span<const std::filesystem::path> reads, const Reporter &reporter);

    // Adds a material to the arena; returns its index. Throws MeshError.
    std::uint32_t add(const MaterialUses::Name &name);
    std::uint32_t add_default(); // white, as faces without `usemtl` are

private:
    struct Material {
        MtlMaterial content;
        std::filesystem::path folder; // of the MTL file
    };

    void read_library(const std::string &names, const Reporter &reporter);
    arhost_material converted(const Material &material);
    void read_textures(const Material &material, arhost_material &to);
    std::uint32_t texture_of(const Material &material, const std::optional<MtlTexture> &texture, bool is_colour);
    // Returns the texture with the channels that `combine` makes of both images; absent ones are white.
    template <class Combine>
    std::uint32_t combined(const Material &material, const std::optional<MtlTexture> &a,
                           const std::optional<MtlTexture> &b, const char *kind, arhost_texel_format format,
                           const Combine &combine);
    std::filesystem::path file_of(const Material &material, const MtlTexture &texture) const;

    ArenaBuilder &builder_;
    Textures &textures_;
    std::filesystem::path obj_;
    ReferredFiles files_;
    std::set<std::filesystem::path> read_; // MTL files
    std::map<std::string, Material> materials_;
};

} // namespace arhost::scene
