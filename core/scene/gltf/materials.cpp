// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/materials.hpp"

#include <algorithm>
#include <cmath>

namespace arhost::scene {
namespace {

constexpr float largest_number = coordinate_limit_mm;

template <std::size_t count> void copy(const std::array<float, count> &from, float *to) {
    std::ranges::copy(from, to);
}

arhost_wrap wrap_of(int mode) {
    return mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE     ? ARHOST_WRAP_CLAMP
           : mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? ARHOST_WRAP_MIRROR
                                                           : ARHOST_WRAP_REPEAT;
}

// KHR_texture_transform. Angles turn counter-clockwise in an image whose v axis points down.
glm::mat3x2 image_from_texcoord(const JsonNode &transform) {
    const auto offset = transform.numbers_or<2>("offset", {0, 0}, -largest_number, largest_number);
    const auto scale = transform.numbers_or<2>("scale", {1, 1}, -largest_number, largest_number);
    const float angle = transform.number_or("rotation", 0, -largest_number, largest_number);
    const float c = std::cos(angle), s = std::sin(angle);
    return {{c * scale[0], -s * scale[0]}, {s * scale[1], c * scale[1]}, {offset[0], offset[1]}};
}

} // namespace

const GltfMaterials::Material &GltfMaterials::at(int index) {
    const auto found = known_.find(index);
    if (found != known_.end())
        return found->second;
    static const nlohmann::json default_material = nlohmann::json::object();
    if (index < 0)
        return known_[index] = read(JsonNode(default_material, "", name_));
    accessors_.at(content_.model.materials, index, "material"); // checks the index
    const std::string path = "materials[" + std::to_string(index) + "]";
    return known_[index] = read(JsonNode(content_.json["materials"][static_cast<std::size_t>(index)], path, name_));
}

GltfMaterials::Material GltfMaterials::read(const JsonNode &node) {
    arhost_material material = make_material(ARHOST_MATERIAL_METALLIC_ROUGHNESS);
    static const nlohmann::json no_properties = nlohmann::json::object();
    const JsonNode pbr = node.find("pbrMetallicRoughness").value_or(JsonNode(no_properties, "", name_));
    const auto base_colour = pbr.numbers_or<4>("baseColorFactor", {1, 1, 1, 1}, 0, 1);
    std::copy_n(base_colour.begin(), 3, material.ambient);
    std::copy_n(base_colour.begin(), 3, material.diffuse);
    material.metallic = pbr.number_or("metallicFactor", 1, 0, 1);
    material.roughness = pbr.number_or("roughnessFactor", 1, 0, 1);
    material.colour_texture = texture_of(pbr, "baseColorTexture", true);
    read_opacity(node, base_colour[3], material);
    if (node.extension("KHR_materials_unlit")) {
        material.model = ARHOST_MATERIAL_UNLIT;
        return {builder_.add_material(material, node.text_or("name", "")), node.boolean_or("doubleSided", false)};
    }
    material.metallic_roughness_texture = texture_of(pbr, "metallicRoughnessTexture", false);
    if (const auto texture = node.find("normalTexture")) {
        material.normal_texture = texture_of(node, "normalTexture", false);
        material.normal_scale = texture->number_or("scale", 1, -largest_number, largest_number);
    }
    if (const auto texture = node.find("occlusionTexture")) {
        material.occlusion_texture = texture_of(node, "occlusionTexture", false);
        material.occlusion_strength = texture->number_or("strength", 1, 0, 1);
    }
    copy(node.numbers_or<3>("emissiveFactor", {0, 0, 0}, 0, radiance_limit), material.emission);
    if (const auto emission = node.extension("KHR_materials_emissive_strength"))
        for (float &radiance : material.emission)
            radiance =
                std::min(radiance * emission->number_or("emissiveStrength", 1, 0, radiance_limit), radiance_limit);
    material.emission_texture = texture_of(node, "emissiveTexture", true);
    read_specular(node, material);
    read_transmission(node, material);
    read_clearcoat(node, material);
    read_sheen(node, material);
    read_anisotropy(node, material);
    read_iridescence(node, material);
    const bool is_volume = material.transmission > 0 && material.thin_walled == 0; // its back faces end it
    return {builder_.add_material(material, node.text_or("name", "")),
            node.boolean_or("doubleSided", false) || is_volume};
}

void GltfMaterials::read_opacity(const JsonNode &node, float factor, arhost_material &material) const {
    const std::string mode = node.text_or("alphaMode", "OPAQUE");
    if (mode == "OPAQUE")
        return;
    if (mode == "BLEND") {
        material.opacity = factor;
        material.blends = 1;
        return;
    }
    const auto mode_node = node.find("alphaMode");
    if (mode != "MASK")
        mode_node->fail("must be OPAQUE, MASK or BLEND");
    material.opacity = factor;
    material.alpha_cutoff = node.number_or("alphaCutoff", 0.5f, 0, largest_number);
    if (material.alpha_cutoff > 1) { // cuts out every point
        material.opacity = 0;
        material.alpha_cutoff = 1;
    }
}

void GltfMaterials::read_specular(const JsonNode &node, arhost_material &material) {
    constexpr float of_default_index = 0.04f;
    float scale = 1;
    if (const auto extension = node.extension("KHR_materials_ior")) {
        const float index = extension->number_or("ior", 1.5f, 0, largest_number);
        if (index > 0 && index < 1)
            extension->find("ior")->fail("must be 0, or 1 or greater");
        const float reflected = (index - 1) / (index + 1);
        if (index >= 1 && index <= 4) // the range of arhost_material::index
            material.index = index;
        else // 0 stands for an infinite index
            scale = reflected * reflected / of_default_index;
    }
    if (const auto specular = node.extension("KHR_materials_specular")) {
        material.specular_weight = specular->number_or("specularFactor", 1, 0, 1);
        material.specular_texture = texture_of(*specular, "specularTexture", false);
        copy(specular->numbers_or<3>("specularColorFactor", {1, 1, 1}, 0, radiance_limit / 100), material.specular);
        material.specular_colour_texture = texture_of(*specular, "specularColorTexture", true);
    }
    for (float &channel : material.specular)
        channel *= scale;
}

void GltfMaterials::read_transmission(const JsonNode &node, arhost_material &material) {
    const auto transmission = node.extension("KHR_materials_transmission");
    if (!transmission)
        return;
    material.transmission = transmission->number_or("transmissionFactor", 0, 0, 1);
    material.transmission_texture = texture_of(*transmission, "transmissionTexture", false);
    material.thin_walled = 1;
    const auto volume = node.extension("KHR_materials_volume");
    if (!volume || volume->number_or("thicknessFactor", 0, 0, largest_number) == 0)
        return;
    material.thin_walled = 0; // the mesh is the volume; its thickness is not used
    const auto colour = volume->numbers_or<3>("attenuationColor", {1, 1, 1}, 0, 1);
    if (const auto distance = volume->find("attenuationDistance"))
        for (std::size_t i = 0; i < 3; ++i) {
            const double least = 1e-6; // a colour of 0 would be opaque
            const double length = std::max(double{distance->number(0, largest_number)}, least);
            material.extinction[i] = static_cast<float>(
                std::clamp(-std::log(std::max(double{colour[i]}, least)) / length, 0.0, double{extinction_limit}));
        }
}

void GltfMaterials::scale_volumes(double scale) {
    for (const auto &[index, material] : known_)
        for (float &extinction : builder_.material(material.index).extinction)
            extinction = static_cast<float>(std::min(extinction / scale, double{extinction_limit}));
}

void GltfMaterials::read_clearcoat(const JsonNode &node, arhost_material &material) {
    const auto clearcoat = node.extension("KHR_materials_clearcoat");
    if (!clearcoat)
        return;
    material.clearcoat = clearcoat->number_or("clearcoatFactor", 0, 0, 1);
    material.clearcoat_texture = texture_of(*clearcoat, "clearcoatTexture", false);
    material.clearcoat_roughness = clearcoat->number_or("clearcoatRoughnessFactor", 0, 0, 1);
    material.clearcoat_roughness_texture = texture_of(*clearcoat, "clearcoatRoughnessTexture", false);
    if (const auto texture = clearcoat->find("clearcoatNormalTexture")) {
        material.clearcoat_normal_texture = texture_of(*clearcoat, "clearcoatNormalTexture", false);
        material.clearcoat_normal_scale = texture->number_or("scale", 1, -largest_number, largest_number);
    }
}

void GltfMaterials::read_sheen(const JsonNode &node, arhost_material &material) {
    const auto sheen = node.extension("KHR_materials_sheen");
    if (!sheen)
        return;
    copy(sheen->numbers_or<3>("sheenColorFactor", {0, 0, 0}, 0, 1), material.sheen);
    material.sheen_texture = texture_of(*sheen, "sheenColorTexture", true);
    material.sheen_roughness = sheen->number_or("sheenRoughnessFactor", 0, 0, 1);
    // Alpha is linear in colours, too; often, one image has both.
    material.sheen_roughness_texture = texture_of(*sheen, "sheenRoughnessTexture", true);
}

void GltfMaterials::read_anisotropy(const JsonNode &node, arhost_material &material) {
    const auto anisotropy = node.extension("KHR_materials_anisotropy");
    if (!anisotropy)
        return;
    material.anisotropy = anisotropy->number_or("anisotropyStrength", 0, 0, 1);
    const float angle = anisotropy->number_or("anisotropyRotation", 0, -largest_number, largest_number);
    copy(std::array{std::cos(angle), std::sin(angle)}, material.anisotropy_direction);
    material.anisotropy_texture = texture_of(*anisotropy, "anisotropyTexture", false);
}

void GltfMaterials::read_iridescence(const JsonNode &node, arhost_material &material) {
    const auto iridescence = node.extension("KHR_materials_iridescence");
    if (!iridescence)
        return;
    material.iridescence = iridescence->number_or("iridescenceFactor", 0, 0, 1);
    material.iridescence_texture = texture_of(*iridescence, "iridescenceTexture", false);
    material.iridescence_index = iridescence->number_or("iridescenceIor", 1.3f, 1, 4);
    const auto thickness = [&](const char *key, float fallback) {
        return iridescence->number_or(key, fallback, 0, film_thickness_limit_nm);
    };
    copy(std::array{thickness("iridescenceThicknessMinimum", 100), thickness("iridescenceThicknessMaximum", 400)},
         material.iridescence_thickness_nm);
    material.iridescence_thickness_texture = texture_of(*iridescence, "iridescenceThicknessTexture", false);
}

std::uint32_t GltfMaterials::texture_of(const JsonNode &parent, const char *key, bool is_colour) {
    const auto info = parent.find(key);
    if (!info)
        return ARHOST_NONE;
    const auto index = info->find("index");
    if (!index)
        info->fail("needs the index of a texture");
    const tinygltf::Texture &texture = accessors_.at(content_.model.textures, index->index(), "texture");
    const JsonNode texture_node(content_.json["textures"][static_cast<std::size_t>(index->index())],
                                "textures[" + std::to_string(index->index()) + "]", name_);
    if (texture.source < 0)
        texture_node.fail(texture_node.extension(ktx2_extension) ? ktx2_conversion : "has no image");
    const tinygltf::Image &image = accessors_.at(content_.model.images, texture.source, "image");
    if (image.image.empty())
        info->fail("the image '" + printable(image.uri.substr(0, 100)) + "' cannot be read");
    TextureUse use{is_colour};
    auto texcoord = info->find("texCoord");
    if (const auto transform = info->extension("KHR_texture_transform")) {
        use.lookup.image_from_texcoord = image_from_texcoord(*transform);
        if (const auto other = transform->find("texCoord"))
            texcoord = other;
    }
    if (texcoord) {
        constexpr int most_sets = 16; // limits the memory of a mesh
        if (texcoord->index() >= most_sets)
            texcoord->fail("must be 0 to " + std::to_string(most_sets - 1));
        use.lookup.texcoord_set = static_cast<std::uint32_t>(texcoord->index());
    }
    if (texture.sampler >= 0) {
        const tinygltf::Sampler &sampler = accessors_.at(content_.model.samplers, texture.sampler, "sampler");
        use.lookup.wrap_u = wrap_of(sampler.wrapS);
        use.lookup.wrap_v = wrap_of(sampler.wrapT);
        if (sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST)
            use.lookup.filter = ARHOST_TEXEL_FILTER_NEAREST;
    }
    return textures_.add(file_, use, image.image, "#image " + std::to_string(texture.source));
}

} // namespace arhost::scene
