// SPDX-License-Identifier: Apache-2.0
#include "scene/capabilities.hpp"

#include "scene/material_textures.hpp"
#include "scene/motion.hpp"

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>

namespace arhost::scene {
namespace {

template <class T> std::span<const T> view(const arhost_scene &scene, const arhost_buffer &buffer) {
    return {reinterpret_cast<const T *>(reinterpret_cast<const std::byte *>(&scene) + buffer.offset), buffer.count};
}

std::uint64_t needed_for(const arhost_material &material, arhost_integrator integrator) {
    std::uint64_t needed = 0;
    switch (material.model) {
    case ARHOST_MATERIAL_SPECULAR:
    case ARHOST_MATERIAL_MIRROR:
    case ARHOST_MATERIAL_METAL:
        needed = ARHOST_RAYTRACER_CAPABILITY_REFLECTION;
        break;
    case ARHOST_MATERIAL_GLASS:
        needed = ARHOST_RAYTRACER_CAPABILITY_GLASS;
        if (material.roughness > 0 && integrator == ARHOST_INTEGRATOR_PATH)
            needed |= ARHOST_RAYTRACER_CAPABILITY_ROUGHNESS;
        break;
    case ARHOST_MATERIAL_METALLIC_ROUGHNESS:
        needed = ARHOST_RAYTRACER_CAPABILITY_ROUGHNESS;
        if (material.transmission > 0 && integrator == ARHOST_INTEGRATOR_PATH)
            needed |= ARHOST_RAYTRACER_CAPABILITY_GLASS;
        break;
    default:
        break;
    }
    if (std::ranges::any_of(textures_of(material), [](std::uint32_t texture) { return texture != ARHOST_NONE; }))
        needed |= ARHOST_RAYTRACER_CAPABILITY_TEXTURES;
    return needed;
}

// In the order of the bits.
constexpr std::pair<std::uint64_t, const char *> parts[] = {
    {ARHOST_RAYTRACER_CAPABILITY_REFLECTION, "reflecting materials"},
    {ARHOST_RAYTRACER_CAPABILITY_GLASS, "glass"},
    {ARHOST_RAYTRACER_CAPABILITY_ROUGHNESS, "rough materials"},
    {ARHOST_RAYTRACER_CAPABILITY_TEXTURES, "textures"},
    {ARHOST_RAYTRACER_CAPABILITY_AREA_LIGHTS, "area lights"},
    {ARHOST_RAYTRACER_CAPABILITY_ENVIRONMENT, "the environment map or the default light"},
    {ARHOST_RAYTRACER_CAPABILITY_MOTION, "motion"},
};

} // namespace

std::uint64_t needed_capabilities(const arhost_scene &scene) {
    std::uint64_t needed = 0, needed_for_occluders = 0;
    const auto materials = view<arhost_material>(scene, scene.materials);
    for (const arhost_object &object : view<arhost_object>(scene, scene.objects)) {
        (object.role == ARHOST_ROLE_OCCLUDER ? needed_for_occluders : needed) |=
            needed_for(materials[object.material], scene.integrator);
        if (is_moving(scene) && (object.moves || object.deforms))
            needed |= ARHOST_RAYTRACER_CAPABILITY_MOTION;
    }
    // Only mirrors, glass and rough surfaces show occluders.
    if (needed & (ARHOST_RAYTRACER_CAPABILITY_REFLECTION | ARHOST_RAYTRACER_CAPABILITY_GLASS |
                  ARHOST_RAYTRACER_CAPABILITY_ROUGHNESS))
        needed |= needed_for_occluders;
    for (const arhost_light &light : view<arhost_light>(scene, scene.lights))
        if (light.type == ARHOST_LIGHT_RECTANGLE || light.type == ARHOST_LIGHT_SPHERE)
            needed |= ARHOST_RAYTRACER_CAPABILITY_AREA_LIGHTS;
    if (scene.environment.texture != ARHOST_NONE)
        needed |= ARHOST_RAYTRACER_CAPABILITY_ENVIRONMENT;
    return needed;
}

std::uint64_t capabilities_of(const arhost_descriptor &descriptor, const arhost_raytracer &functions,
                              arhost_instance *instance) {
    constexpr std::size_t size = offsetof(arhost_raytracer, capabilities) + sizeof(arhost_raytracer::capabilities);
    return functions.struct_size < size || !functions.capabilities
               ? descriptor.capabilities
               : descriptor.capabilities & functions.capabilities(instance);
}

std::string missing_capabilities_text(const std::string &id, std::uint64_t missing) {
    std::string names;
    for (const auto &[bit, name] : parts)
        if (missing & bit)
            names.append(names.empty() ? "" : ", ").append(name);
    return names.empty() ? names
                         : id + " does not support parts of the scene: " + names +
                               ". The image will lack them; use another ray tracer or a simpler scene";
}

} // namespace arhost::scene
