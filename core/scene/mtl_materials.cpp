// SPDX-License-Identifier: Apache-2.0
#include "scene/mtl_materials.hpp"

#include "scene/mesh.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/type_precision.hpp>
#include <glm/vec4.hpp>

#include <algorithm>
#include <cmath>

namespace arhost::scene {
namespace {

constexpr std::uint64_t mtl_size_limit = std::uint64_t(64) << 20;
constexpr float default_diffuse = 0.8f; // as in Blender

using Texel = glm::u8vec4;

void set(float (&to)[3], const glm::vec3 &from) {
    for (int i = 0; i < 3; ++i)
        to[i] = from[i];
}

float opacity_of(const MtlMaterial &mtl) { // some programs write a wrong Tr next to d
    return mtl.opacity.value_or(1 - mtl.transparency.value_or(0));
}

int model_of(const MtlMaterial &mtl) {
    constexpr float highlights = 2;
    return static_cast<int>(mtl.model.value_or(highlights));
}

bool is_pbr(const MtlMaterial &mtl) {
    return mtl.roughness || mtl.metallic || mtl.roughness_map || mtl.metallic_map;
}

bool is_glass(const MtlMaterial &mtl) {
    if (mtl.opacity_map)
        return false;
    const int model = model_of(mtl);
    return model == 6 || model == 7 || (opacity_of(mtl) < 1 && (mtl.transmission || model == 4 || model == 9));
}

arhost_material glass_of(const MtlMaterial &mtl) {
    arhost_material glass = make_material(ARHOST_MATERIAL_GLASS);
    glass.index = std::max(mtl.index.value_or(glass.index), 1.f);
    const float normal_incidence = (glass.index - 1) / (glass.index + 1);
    glass.fresnel_minimum = normal_incidence * normal_incidence;
    glass.roughness = mtl.roughness.value_or(0);
    glm::vec3 refraction(1);
    if (mtl.transmission)
        refraction = *mtl.transmission;
    else if (opacity_of(mtl) < 1)
        refraction = glm::mix(glm::vec3(1), mtl.diffuse.value_or(glm::vec3(default_diffuse)), opacity_of(mtl));
    set(glass.refraction, refraction);
    set(glass.shadow_attenuation, default_shadow_attenuation * refraction);
    return glass;
}

void set_highlights(const MtlMaterial &mtl, arhost_material &to) {
    to.metallic = mtl.metallic.value_or(mtl.metallic_map ? 1 : 0);
    const float alpha = std::sqrt(2 / (mtl.exponent.value_or(0) + 2));
    to.roughness = mtl.roughness.value_or(mtl.roughness_map ? 1 : std::sqrt(alpha));
    const int model = model_of(mtl);
    if (!is_pbr(mtl) && model < 2) {
        to.specular_weight = 0;
        return;
    }
    const glm::vec3 ks = mtl.specular.value_or(glm::vec3(is_pbr(mtl) || mtl.specular_map ? 0.5f : 0));
    const bool mirrors = !is_pbr(mtl) && (model == 3 || model == 5 || model == 8);
    to.specular_weight = std::min(2 * std::max({ks.r, ks.g, ks.b}), 1.f); // also at grazing incidence
    constexpr float of_default_index = 0.04f;
    if (to.specular_weight > 0)
        set(to.specular, ks / to.specular_weight * (mirrors ? 1 / of_default_index : 2));
}

// Calls `add`, and names the statement of `texture` in errors.
template <class Add> std::uint32_t added(const MtlTexture &texture, const Add &add) {
    try {
        return add();
    } catch (const ImageError &error) {
        throw MeshError(texture.where + ": " + error.what());
    }
}

Image bytes_of(const std::filesystem::path &file, Textures &textures) {
    if (file.empty()) {
        Image white{1, 1, false, Texels::of_size(sizeof(Texel))};
        std::ranges::fill(white.texels.span(), std::byte(255));
        return white;
    }
    Image image = textures.read(file);
    if (image.is_float)
        throw ImageError(file.string() + ": has floating-point texels; convert it to PNG or JPEG");
    return image;
}

std::span<Texel> texels_of(const Image &image) {
    return {reinterpret_cast<Texel *>(image.texels.bytes.get()), image.texels.size / sizeof(Texel)};
}

// map_Bump has heights by its definition, but many programs write normal maps, which are bluish.
bool is_normal_map(const Image &image) {
    double red = 0, blue = 0;
    for (const Texel &texel : texels_of(image)) {
        red += texel.r;
        blue += texel.b;
    }
    constexpr double least_difference = 32;
    return blue - red > least_difference * static_cast<double>(texels_of(image).size());
}

// A height difference of 1 between neighbours is a slope of 1.
TexelImage normals_of_heights(const Image &image, const Reporter &reporter) {
    const std::size_t width = image.width, height = image.height;
    const std::span<const Texel> heights = texels_of(image);
    TexelImage normals{ARHOST_TEXEL_RGBA8, image.width, image.height,
                       Texels::of_size(heights.size() * sizeof(Texel))};
    auto *to = reinterpret_cast<Texel *>(normals.texels.bytes.get());
    const auto at = [&](std::size_t x, std::size_t y) {
        return static_cast<float>(heights[y % height * width + x % width].g) / 255;
    };
    for (std::size_t y = 0; y < height; ++y) {
        reporter.report(static_cast<double>(y) / image.height);
        for (std::size_t x = 0; x < width; ++x) {
            const float right = (at(x + 1, y) - at(x + width - 1, y)) / 2,
                        down = (at(x, y + 1) - at(x, y + height - 1)) / 2;
            *to++ = Texel(glm::round(glm::vec4(127.5f + 127.5f * glm::normalize(glm::vec3(-right, down, 1)), 255)));
        }
    }
    return normals;
}

} // namespace

MtlMaterials::MtlMaterials(ArenaBuilder &builder, Textures &textures, const std::filesystem::path &obj,
                           const MaterialUses &uses, std::span<const std::filesystem::path> reads,
                           const Reporter &reporter)
    : builder_(builder), textures_(textures), obj_(obj), files_(obj, reads) {
    for (const std::string &names : uses.libraries)
        read_library(names, reporter);
}

// `names`: one file name, which may contain blanks, or several.
void MtlMaterials::read_library(const std::string &names, const Reporter &reporter) {
    const auto path_of = [&](std::string name) {
        std::ranges::replace(name, '\\', '/');
        return files_.resolve(obj_.parent_path() / name);
    };
    std::vector<std::filesystem::path> paths = {path_of(names)};
    if (paths[0].empty()) {
        paths.clear();
        for (const char *p = names.data(), *end = p + names.size(); p < end;) {
            const char *stop = std::find_if(p, end, is_blank);
            paths.push_back(path_of({p, stop}));
            if (paths.back().empty())
                throw MeshError(obj_.string() + ": the MTL file '" + printable(names) +
                                "' does not exist; move it there, or add the key 'material' to the object");
            p = std::find_if_not(stop, end, is_blank);
        }
    }
    for (const std::filesystem::path &path : paths) {
        if (!read_.insert(path).second)
            continue;
        MeshFile file = MeshFile::read(path, mtl_size_limit, reporter);
        for (auto &[name, content] : parse_mtl(file, reporter)) // that of the first file applies
            materials_.try_emplace(name, Material{std::move(content), path.parent_path()});
    }
}

std::uint32_t MtlMaterials::add(const MaterialUses::Name &name) {
    const auto found = materials_.find(name.text);
    if (found == materials_.end())
        throw MeshError(obj_.string() + ":" + std::to_string(name.line) + ": no MTL file defines the material '" +
                        printable(name.text) + "'; define it, or add the key 'material' to the object");
    return builder_.add_material(converted(found->second), name.text);
}

std::uint32_t MtlMaterials::add_default() {
    MtlMaterial white;
    white.diffuse = glm::vec3(1);
    return builder_.add_material(converted({white, {}}));
}

arhost_material MtlMaterials::converted(const Material &material) {
    const MtlMaterial &mtl = material.content;
    if (is_glass(mtl))
        return glass_of(mtl);
    const bool is_unlit = !is_pbr(mtl) && model_of(mtl) == 0;
    arhost_material to = make_material(is_unlit ? ARHOST_MATERIAL_UNLIT : ARHOST_MATERIAL_METALLIC_ROUGHNESS);
    const glm::vec3 diffuse = mtl.diffuse.value_or(glm::vec3(mtl.diffuse_map ? 1 : default_diffuse));
    set(to.diffuse, diffuse);
    set(to.ambient, diffuse);
    to.opacity = opacity_of(mtl);
    to.blends = to.opacity < 1 || mtl.opacity_map;
    set(to.emission, mtl.emission.value_or(glm::vec3(mtl.emission_map ? 1 : 0)));
    set_highlights(mtl, to);
    read_textures(material, to);
    return to;
}

void MtlMaterials::read_textures(const Material &material, arhost_material &to) {
    const MtlMaterial &mtl = material.content;
    if (mtl.opacity_map)
        to.colour_texture =
            combined(material, mtl.diffuse_map, mtl.opacity_map, "opacity", ARHOST_TEXEL_SRGB8,
                     [](std::span<const Texel> opacities) {
                         const bool has_alpha =
                             std::ranges::any_of(opacities, [](const Texel &texel) { return texel.a < 255; });
                         return [has_alpha](const Texel &colour, const Texel &opacity) {
                             return Texel(colour.r, colour.g, colour.b, has_alpha ? opacity.a : opacity.g);
                         };
                     });
    else
        to.colour_texture = texture_of(material, mtl.diffuse_map, true);
    if (mtl.roughness_map || mtl.metallic_map)
        to.metallic_roughness_texture =
            combined(material, mtl.roughness_map, mtl.metallic_map, "roughness and metallic", ARHOST_TEXEL_RGBA8,
                     [](std::span<const Texel>) {
                         return [](const Texel &roughness, const Texel &metallic) {
                             return Texel(255, roughness.g, metallic.b, 255);
                         };
                     });
    if (to.specular_weight > 0)
        to.specular_colour_texture = texture_of(material, mtl.specular_map, true);
    to.emission_texture = texture_of(material, mtl.emission_map, true);
    if (mtl.normal_map) {
        to.normal_texture = texture_of(material, mtl.normal_map, false);
        to.normal_scale = mtl.normal_map->multiplier;
    } else if (mtl.bump_map) {
        const std::filesystem::path file = file_of(material, *mtl.bump_map);
        const auto make = [&](const LoadCallbacks &callbacks) -> TexelImage {
            Image image = bytes_of(file, textures_);
            if (!is_normal_map(image))
                return normals_of_heights(image, Reporter(callbacks, file.filename().string()));
            return {ARHOST_TEXEL_RGBA8, image.width, image.height, std::move(image.texels)};
        };
        to.normal_texture =
            added(*mtl.bump_map, [&] { return textures_.add(file.string(), "bumps", mtl.bump_map->lookup, make); });
        to.normal_scale = mtl.bump_map->multiplier;
    }
}

std::uint32_t MtlMaterials::texture_of(const Material &material, const std::optional<MtlTexture> &texture,
                                       bool is_colour) {
    if (!texture)
        return ARHOST_NONE;
    const std::filesystem::path file = file_of(material, *texture);
    return added(*texture, [&] { return textures_.add(file, {is_colour, texture->lookup}); });
}

template <class Combine>
std::uint32_t MtlMaterials::combined(const Material &material, const std::optional<MtlTexture> &a,
                                     const std::optional<MtlTexture> &b, const char *kind, arhost_texel_format format,
                                     const Combine &combine) {
    const std::filesystem::path file_a = a ? file_of(material, *a) : "", file_b = b ? file_of(material, *b) : "";
    const auto make = [&](const LoadCallbacks &callbacks) -> TexelImage {
        const Image image_a = bytes_of(file_a, textures_), image_b = bytes_of(file_b, textures_);
        const std::span<const Texel> texels_a = texels_of(image_a), texels_b = texels_of(image_b);
        const auto channels = combine(texels_b);
        const std::uint32_t width = std::max(image_a.width, image_b.width),
                            height = std::max(image_a.height, image_b.height);
        constexpr std::size_t most_enlargement = 16;
        if (std::size_t(width) * height > most_enlargement * (texels_a.size() + texels_b.size()))
            throw ImageError(file_a.string() + " and " + file_b.string() +
                             ": differ too much in size to be combined; give them the same size");
        TexelImage to{format, width, height, Texels::of_size(std::size_t(width) * height * sizeof(Texel))};
        auto *out = reinterpret_cast<Texel *>(to.texels.bytes.get());
        const auto at = [&](std::span<const Texel> texels, const Image &image, std::size_t x, std::size_t y) {
            return texels[y * image.height / height * image.width + x * image.width / width];
        };
        const Reporter reporter(callbacks, (a ? file_a : file_b).filename().string());
        for (std::size_t y = 0; y < height; ++y) {
            reporter.report(static_cast<double>(y) / height);
            for (std::size_t x = 0; x < width; ++x)
                *out++ = channels(at(texels_a, image_a, x, y), at(texels_b, image_b, x, y));
        }
        return to;
    };
    const MtlTexture &texture = a ? *a : *b;
    return added(texture, [&] {
        return textures_.add(file_a.string() + " and " + file_b.string(), kind, texture.lookup, make);
    });
}

std::filesystem::path MtlMaterials::file_of(const Material &material, const MtlTexture &texture) const {
    std::filesystem::path file = files_.resolve(material.folder / texture.file);
    if (file.empty())
        throw MeshError(texture.where + ": '" + printable(texture.file) +
                        "' does not exist; write a path relative to this file");
    return file;
}

} // namespace arhost::scene
