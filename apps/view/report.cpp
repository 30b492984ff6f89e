// SPDX-License-Identifier: Apache-2.0
#include "view/report.hpp"

#include "base/text.hpp"
#include "scene/material_textures.hpp"
#include "view/bounds.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

namespace arhost::view {
namespace {

constexpr std::size_t longest_name = 60, most_rows = 24; // of a list

// Rows of a list below a common heading.
class Lines {
public:
    void add(const std::string &heading, const std::string &text) {
        text_ += fmt::format("  {:<11} {}\n", heading == heading_ ? "" : heading, text);
        heading_ = heading;
    }
    // Adds a row for each element, up to a limit.
    template <class List, class ToText> void add_all(const std::string &heading, const List &list, ToText to_text) {
        for (std::size_t i = 0; i < std::min(list.size(), most_rows); ++i)
            add(heading, to_text(i));
        if (list.size() > most_rows)
            add(heading, fmt::format("… and {} more", list.size() - most_rows));
    }
    const std::string &text() const { return text_; }

private:
    std::string heading_, text_;
};

std::string name_or(const std::string &name, const std::string &fallback) {
    return name.empty() ? fallback : base::printable(name, longest_name);
}

std::string bytes_text(std::uint64_t bytes) {
    return bytes < 10'000       ? fmt::format("{} bytes", bytes)
           : bytes < 10'000'000 ? fmt::format("{:.0f} KB", static_cast<double>(bytes) / 1e3)
                                : fmt::format("{:.0f} MB", static_cast<double>(bytes) / 1e6);
}

std::string format_of(const std::string &file) {
    std::filesystem::path path(file);
    const std::string compressed = path.extension() == ".gz" ? ", compressed" : "";
    std::string extension = compressed.empty() ? path.extension() : path.stem().extension();
    std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
    for (const auto &[known, name] :
         {std::pair(".glb", "glTF, binary"), {".gltf", "glTF"}, {".obj", "OBJ"}, {".ply", "PLY"}, {".stl", "STL"}})
        if (extension == known)
            return name + compressed;
    return "scene";
}

std::string length_text(float mm) {
    return std::abs(mm) < 1000 ? fmt::format("{:.4g}", mm) : fmt::format("{:.0f}", mm);
}

std::string box_text(const scene::Box &box) {
    const auto joined = [](const glm::vec3 &v, const char *separator) {
        return length_text(v.x) + separator + length_text(v.y) + separator + length_text(v.z);
    };
    return joined(box.max - box.min, " × ") + " mm, from (" + joined(box.min, ", ") + ") to (" +
           joined(box.max, ", ") + ")";
}

const char *model_name(arhost_material_model model) {
    switch (model) {
    case ARHOST_MATERIAL_DIFFUSE:
        return "diffuse";
    case ARHOST_MATERIAL_SPECULAR:
        return "specular";
    case ARHOST_MATERIAL_MIRROR:
        return "mirror";
    case ARHOST_MATERIAL_METAL:
        return "metal";
    case ARHOST_MATERIAL_GLASS:
        return "glass";
    case ARHOST_MATERIAL_UNLIT:
        return "unlit";
    default:
        return "metallic-roughness";
    }
}

bool is_above_zero(const float (&colour)[3]) {
    return std::ranges::any_of(colour, [](float c) { return c > 0; });
}

std::string material_text(const arhost_scene &scene, const arhost_material &material) {
    std::string text = model_name(material.model);
    const auto add = [&](bool applies, const std::string &what) {
        if (applies)
            text += ", " + what;
    };
    const bool is_rough = material.model == ARHOST_MATERIAL_METALLIC_ROUGHNESS;
    add(is_rough, fmt::format("metallic {:.2g}, roughness {:.2g}", material.metallic, material.roughness));
    add(is_rough && material.transmission > 0,
        fmt::format("transmission {:.2g} ({})", material.transmission,
                    material.thin_walled ? "thin wall" : fmt::format("volume, index {:.3g}", material.index)));
    add(is_rough && material.clearcoat > 0, fmt::format("clear coat {:.2g}", material.clearcoat));
    add(is_rough && is_above_zero(material.sheen), fmt::format("sheen, roughness {:.2g}", material.sheen_roughness));
    add(is_rough && material.anisotropy > 0, fmt::format("anisotropy {:.2g}", material.anisotropy));
    add(is_rough && material.iridescence > 0, fmt::format("iridescence {:.2g}", material.iridescence));
    add(material.model == ARHOST_MATERIAL_GLASS, fmt::format("index {:.3g}", material.index));
    add(material.blends != 0, "blended");
    add(material.alpha_cutoff > 0, fmt::format("cut out below {:.2g}", material.alpha_cutoff));
    add(is_above_zero(material.emission), "emissive");
    const auto textures = elements<arhost_texture>(scene, scene.textures);
    const auto images = elements<arhost_texel_image>(scene, scene.images);
    const auto texture = [&](std::uint32_t index, const char *what) {
        if (index != ARHOST_NONE)
            text += fmt::format(", {} {}×{}", what, images[textures[index].image].width,
                                images[textures[index].image].height);
    };
    texture(material.colour_texture, "colour");
    texture(material.normal_texture, "normals");
    texture(material.metallic_roughness_texture, "metallic/roughness");
    texture(material.emission_texture, "emission");
    const auto all = scene::textures_of(material);
    const auto count = std::ranges::count_if(all, [](std::uint32_t index) { return index != ARHOST_NONE; });
    const auto shown =
        std::ranges::count_if(std::array{material.colour_texture, material.normal_texture,
                                         material.metallic_roughness_texture, material.emission_texture},
                              [](std::uint32_t index) { return index != ARHOST_NONE; });
    add(count > shown, base::count_of(static_cast<std::uint64_t>(count - shown), "other texture"));
    return text;
}

std::string meshes_text(const arhost_scene &scene) {
    std::uint64_t triangles = 0, drawn = 0, vertices = 0, spheres = 0;
    const auto geometries = elements<arhost_geometry>(scene, scene.geometries);
    for (const arhost_geometry &geometry : geometries) {
        const bool is_mesh = geometry.type == ARHOST_GEOMETRY_TRIANGLES;
        triangles += geometry.indices.count;
        (is_mesh ? vertices : spheres) += geometry.positions.count;
    }
    for (const arhost_object &object : elements<arhost_object>(scene, scene.objects))
        drawn += geometries[object.geometry].indices.count;
    std::string text = fmt::format("{}: {}, {}", scene.geometries.count, base::count_of(triangles, "triangle"),
                                   vertices == 1 ? "1 vertex" : fmt::format("{} vertices", vertices));
    if (spheres > 0)
        text += ", " + base::count_of(spheres, "sphere");
    if (scene.objects.count > scene.geometries.count)
        text += fmt::format("; {} instances with {} triangles", scene.objects.count, drawn);
    return text;
}

std::string light_text(const arhost_scene &scene) {
    const std::string lamps = scene.lights.count > 0 ? base::count_of(scene.lights.count, "lamp") : "";
    if (scene.environment.texture == ARHOST_NONE)
        return lamps.empty() ? "background" : lamps;
    const std::string environment = scene.environment.follows_video ? "default light" : "environment";
    return lamps.empty() ? environment : lamps + ", " + environment;
}

} // namespace

std::string to_text(const Report &report, const arhost_scene &scene, const scene::Contents &contents) {
    Lines lines;
    if (contents.nodes > 0)
        lines.add("nodes", std::to_string(contents.nodes));
    lines.add("meshes", meshes_text(scene));
    lines.add("box", is_empty(report.at_rest) ? "empty" : box_text(report.at_rest));
    if (!is_empty(report.over_animation))
        lines.add("box", box_text(report.over_animation) + ", over the animation");
    lines.add_all("animations", contents.animations, [&](std::size_t i) {
        const auto &[name, duration_s] = contents.animations[i];
        const bool is_shown =
            report.animation == name || report.animation == std::to_string(i) || report.animation == "all";
        return fmt::format("{} {}, {:.4g} s{}", i, name_or(name, "(no name)"), duration_s, is_shown ? ", shown" : "");
    });
    lines.add_all("variants", contents.variants,
                  [&](std::size_t i) { return name_or(contents.variants[i], "(no name)"); });
    const auto materials = elements<arhost_material>(scene, scene.materials);
    lines.add_all("materials", materials, [&](std::size_t i) {
        const std::string name = i < contents.materials.size() ? contents.materials[i] : "";
        return name_or(name, "(no name)") + ": " + material_text(scene, materials[i]);
    });
    std::uint64_t texels = 0, images = 0;
    for (const arhost_texel_image &image : elements<arhost_texel_image>(scene, scene.images)) {
        if (image.format != ARHOST_TEXEL_RGBA32F) // else it lights the scene
            images += 1;
        texels += std::uint64_t{image.texels.count} * image.texels.stride;
    }
    lines.add("memory",
              bytes_text(scene.byte_size) + (images == 0 ? ""
                                                         : ", of which textures take " + bytes_text(texels) + " in " +
                                                               base::count_of(images, "image")));
    lines.add("light", light_text(scene));
    lines.add_all("notes", report.messages, [&](std::size_t i) {
        const std::string &message = report.messages[i], name = report.file + ": ";
        return base::printable(message.starts_with(name) ? message.substr(name.size()) : message);
    });
    return base::printable(report.file) + ": " + format_of(report.file) + ", " + bytes_text(report.file_size) + "\n" +
           lines.text();
}

} // namespace arhost::view
