// SPDX-License-Identifier: Apache-2.0
#include "scene/scene_loader.hpp"

#include "scene/box.hpp"
#include "scene/default_light.hpp"
#include "scene/gltf/gltf.hpp"
#include "scene/material_textures.hpp"
#include "scene/mesh_file.hpp"
#include "scene/mesh_loader.hpp"
#include "scene/mtl_materials.hpp"
#include "scene/shapes.hpp"
#include "scene/srgb.hpp"
#include "scene/stand_in.hpp"
#include "scene/textures.hpp"

#include <arhost/tracker.h>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>

namespace arhost::scene {
namespace {

using yaml::Node;

glm::dvec3 vector_of(const Node &node) {
    const std::vector<double> values = node.reals(3);
    return {values[0], values[1], values[2]};
}

// Reads three components: a list of three numbers, or one number for all three.
glm::dvec3 number_or_vector(const Node &node) {
    return node.is_sequence() ? vector_of(node) : glm::dvec3(node.real());
}

glm::dvec3 position_of(const Node &node) {
    const glm::dvec3 position = vector_of(node);
    if (glm::any(glm::greaterThan(glm::abs(position), glm::dvec3(coordinate_limit_mm))))
        node.fail("must be within 1e9 mm");
    return position;
}

double length_of(const Node &node) {
    const double length = node.real(0, coordinate_limit_mm);
    if (static_cast<float>(length) <= 0)
        node.fail("must be greater than 0");
    return length;
}

// Reads a colour: "#rrggbb" in sRGB, or a number or a list of three numbers in linear light.
glm::vec3 colour_of(const Node &node, double maximum = 1) {
    const std::string requirement = "must be '#rrggbb' (sRGB), a number or a list of three (linear light, 0 to " +
                                    std::string(maximum == 1 ? "1)" : "1e6)");
    if (node.is_null())
        node.fail(requirement + ", but is empty; '#' starts a comment, so write '#rrggbb' in quotes");
    if (!node.is_scalar() && !node.is_sequence())
        node.fail(requirement);
    if (node.is_scalar() && std::isalpha(static_cast<unsigned char>(node.text()[0])))
        node.fail(requirement + ", but is '" + node.text() + "'");
    glm::dvec3 colour;
    if (node.is_scalar() && node.text().starts_with('#')) {
        const std::string text = node.text();
        unsigned value = 0;
        const auto [end, error] = std::from_chars(text.data() + 1, text.data() + text.size(), value, 16);
        if (text.size() != 7 || error != std::errc() || end != text.data() + 7)
            node.fail(requirement + ", but is '" + text + "'");
        for (int i = 0; i < 3; ++i)
            colour[i] = linear_from_srgb((value >> (16 - 8 * i) & 0xff) / 255.0);
    } else {
        colour = number_or_vector(node);
    }
    for (int i = 0; i < 3; ++i)
        if (colour[i] < 0 || colour[i] > maximum)
            node.fail(requirement);
    return colour;
}

glm::vec3 colour_or(const Node &parent, std::string_view key, const glm::vec3 &fallback) {
    const auto node = parent.find(key);
    return node ? colour_of(*node) : fallback;
}

void set(float (&to)[3], const glm::vec3 &from) {
    for (int i = 0; i < 3; ++i)
        to[i] = from[i];
}

constexpr double light_limit = 1e6;
constexpr std::uint32_t default_path_depth =
    8; // later bounces add less than a code to the rooms of tools/bench truth

// Version 2 changed the defaults: scenes of version 1 keep their pictures.
arhost_integrator integrator_of(const Node &root) {
    const Node version_node = root.require("version");
    const std::int64_t version = version_node.integer();
    if (version != 1 && version != 2)
        version_node.fail("must be 1 or 2");
    const auto node = root.find("integrator");
    if (!node)
        return version == 1 ? ARHOST_INTEGRATOR_WHITTED : ARHOST_INTEGRATOR_PATH;
    if (version == 1)
        node->fail("needs 'version: 2'");
    return node->choice({"path", "whitted"}) == "path" ? ARHOST_INTEGRATOR_PATH : ARHOST_INTEGRATOR_WHITTED;
}

Settings settings_of(const Node &root) {
    Settings settings;
    settings.integrator = integrator_of(root);
    if (settings.integrator == ARHOST_INTEGRATOR_PATH) {
        for (const char *key : {"ambient", "shadow_alpha", "coloured_shadows"})
            if (const auto node = root.find(key))
                node->fail("only applies to 'integrator: whitted'; the path integrator computes this light");
        settings.max_depth = default_path_depth;
        settings.ambient = settings.background = glm::vec3(0);
    }
    settings.axes = root.require("axes").choice({"z-up", "y-up"}) == "z-up" ? ARHOST_AXES_Z_UP : ARHOST_AXES_Y_UP;
    if (const auto node = root.find("max_depth"))
        settings.max_depth = static_cast<std::uint32_t>(node->integer(0, max_depth_limit));
    if (const auto node = root.find("ambient"))
        settings.ambient = colour_of(*node, light_limit);
    else if (root.find("environment")) // an environment replaces the ambient light
        settings.ambient = glm::vec3(0);
    if (const auto node = root.find("background"))
        settings.background = colour_of(*node, light_limit);
    if (const auto node = root.find("coloured_shadows"))
        settings.coloured_shadows = node->boolean();
    if (const auto node = root.find("shadow_alpha")) {
        node->allow_keys({"opaque", "translucent"});
        if (const auto alpha = node->find("opaque"))
            settings.shadow_alpha_opaque = static_cast<float>(alpha->real(0, 1));
        if (const auto alpha = node->find("translucent"))
            settings.shadow_alpha_translucent = static_cast<float>(alpha->real(0, 1));
    }
    return settings;
}

std::uint32_t depth_or(const Node &parent, std::string_view key, std::uint32_t fallback) {
    const auto node = parent.find(key);
    return node ? static_cast<std::uint32_t>(node->integer(0, max_depth_limit)) : fallback;
}

float real_or(const Node &parent, std::string_view key, double low, double high, float fallback) {
    const auto node = parent.find(key);
    return node ? static_cast<float>(node->real(low, high)) : fallback;
}

// Reads the absorption coefficients per mm: either directly, or from the colour that white light has after it has
// travelled a given distance.
glm::vec3 extinction_of(const Node &glass) {
    const auto extinction = glass.find("extinction");
    const auto attenuation = glass.find("attenuation");
    if (extinction && attenuation)
        attenuation->fail("cannot be combined with 'extinction'; remove one of them");
    if (extinction)
        return colour_of(*extinction, light_limit);
    if (!attenuation)
        return glm::vec3(0);
    attenuation->allow_keys({"colour", "distance_mm"});
    const Node colour_node = attenuation->require("colour");
    const glm::vec3 remaining = colour_of(colour_node);
    const double distance_mm = attenuation->require("distance_mm").real(1e-3, coordinate_limit_mm);
    glm::vec3 per_mm;
    for (int i = 0; i < 3; ++i) {
        if (remaining[i] < 1e-6f)
            colour_node.fail("must be greater than 0: glass of finite thickness is never fully black");
        per_mm[i] = static_cast<float>(-std::log(static_cast<double>(remaining[i])) / distance_mm);
    }
    return per_mm;
}

arhost_material glass_of(const Node &node) {
    node.allow_keys({"model", "index", "roughness", "fresnel", "reflection", "refraction", "extinction",
                     "attenuation", "shadow_attenuation", "cutoff_colour", "importance_cutoff", "reflection_depth",
                     "refraction_depth"});
    arhost_material glass = make_material(ARHOST_MATERIAL_GLASS);
    glass.index = real_or(node, "index", 1, 4, glass.index);
    glass.roughness = real_or(node, "roughness", 0, 1, glass.roughness);
    const float normal_incidence = (glass.index - 1) / (glass.index + 1);
    glass.fresnel_minimum = normal_incidence * normal_incidence;
    if (const auto fresnel = node.find("fresnel")) {
        fresnel->allow_keys({"exponent", "minimum", "maximum"});
        glass.fresnel_exponent = real_or(*fresnel, "exponent", 0.01, 100, glass.fresnel_exponent);
        glass.fresnel_minimum = real_or(*fresnel, "minimum", 0, 1, glass.fresnel_minimum);
        glass.fresnel_maximum = real_or(*fresnel, "maximum", glass.fresnel_minimum, 1, glass.fresnel_maximum);
    }
    set(glass.reflectivity, colour_or(node, "reflection", glm::vec3(1)));
    const glm::vec3 refraction = colour_or(node, "refraction", glm::vec3(1));
    set(glass.refraction, refraction);
    set(glass.extinction, extinction_of(node));
    set(glass.shadow_attenuation, colour_or(node, "shadow_attenuation", default_shadow_attenuation * refraction));
    set(glass.cutoff_colour, colour_or(node, "cutoff_colour", glm::vec3(0)));
    glass.importance_cutoff = real_or(node, "importance_cutoff", 0, 1, glass.importance_cutoff);
    glass.reflection_depth = depth_or(node, "reflection_depth", glass.reflection_depth);
    glass.refraction_depth = depth_or(node, "refraction_depth", glass.refraction_depth);
    return glass;
}

glm::dvec3 up_of(arhost_axes axes) {
    return axes == ARHOST_AXES_Z_UP ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0);
}

// Reads a texture: a file name, or a map of file name, wrap mode and encoding. Returns ARHOST_NONE if `key` is
// absent.
std::uint32_t texture_or_none(const Node &material, std::string_view key, bool is_colour, Textures &textures) {
    const auto node = material.find(key);
    if (!node)
        return ARHOST_NONE;
    TextureUse use{is_colour};
    Node image = *node;
    if (node->is_map()) {
        node->allow_keys({"image", "wrap", "encoding"});
        image = node->require("image");
        if (const auto wrap = node->find("wrap")) {
            const std::string text = wrap->choice({"repeat", "clamp", "mirror"});
            use.lookup.wrap_u = use.lookup.wrap_v = text == "repeat"  ? ARHOST_WRAP_REPEAT
                                                    : text == "clamp" ? ARHOST_WRAP_CLAMP
                                                                      : ARHOST_WRAP_MIRROR;
        }
        if (const auto encoding = node->find("encoding"))
            use.is_colour = encoding->choice({"srgb", "linear"}) == "srgb";
    }
    try {
        return textures.add(image.input_path(), use);
    } catch (const ImageError &error) {
        image.fail(error.what());
    }
}

// To rotate the environment to the left, directions are rotated to the right before the lookup.
glm::mat3 environment_from_world(arhost_axes axes, double rotation_degrees) {
    const Transform y_up = axes == ARHOST_AXES_Z_UP ? Transform::rotation({1, 0, 0}, -90) : Transform();
    return glm::mat3(glm::dmat3((y_up * Transform::rotation(up_of(axes), -rotation_degrees)).matrix()));
}

Environment environment_of(const Node &node, arhost_axes axes, Textures &textures) {
    if (!node.is_map())
        node.fail("must be a map with the key 'image'");
    node.allow_keys({"image", "intensity", "rotate_degrees"});
    const float intensity = real_or(node, "intensity", 0, light_limit, 1);
    const auto rotation = node.find("rotate_degrees");
    const Node image = node.require("image");
    Environment environment;
    try {
        environment = textures.add_environment(image.input_path());
    } catch (const ImageError &error) {
        image.fail(error.what());
    }
    environment.intensity = intensity;
    environment.environment_from_world = environment_from_world(axes, rotation ? rotation->real() : 0);
    return environment;
}

// The light of scenes that describe none.
Environment default_environment(arhost_axes axes, Textures &textures) {
    Environment environment = textures.add_environment("default light", default_light());
    environment.environment_from_world = environment_from_world(axes, 0);
    environment.follows_video = true;
    return environment;
}

arhost_material material_of(const Node &node, Textures &textures) {
    if (!node.is_map())
        node.fail("must be a map with the key 'model'");
    const std::string model =
        node.require("model").choice({"diffuse", "specular", "mirror", "metal", "glass", "metallic-roughness"});
    if (model == "glass")
        return glass_of(node);
    if (model == "mirror") {
        node.allow_keys({"model", "reflectivity"});
        arhost_material mirror = make_material(ARHOST_MATERIAL_MIRROR);
        set(mirror.reflectivity, colour_or(node, "reflectivity", glm::vec3(1)));
        return mirror;
    }
    if (model == "metallic-roughness") {
        node.allow_keys({"model", "colour", "metallic", "roughness", "emission", "texture", "alpha_cutoff",
                         "metallic_roughness_texture", "normal_texture", "emission_texture"});
        arhost_material material = make_material(ARHOST_MATERIAL_METALLIC_ROUGHNESS);
        material.colour_texture = texture_or_none(node, "texture", true, textures);
        material.alpha_cutoff = real_or(node, "alpha_cutoff", 0, 1, 0);
        material.metallic_roughness_texture = texture_or_none(node, "metallic_roughness_texture", false, textures);
        material.normal_texture = texture_or_none(node, "normal_texture", false, textures);
        material.emission_texture = texture_or_none(node, "emission_texture", true, textures);
        if (material.emission_texture != ARHOST_NONE) // `emission` is a factor of the texture; default 1
            set(material.emission, glm::vec3(1));
        const glm::vec3 colour = colour_or(node, "colour", glm::vec3(1));
        set(material.diffuse, colour);
        set(material.ambient, colour);
        material.metallic = real_or(node, "metallic", 0, 1, material.metallic);
        material.roughness = real_or(node, "roughness", 0, 1, material.roughness);
        if (const auto emission = node.find("emission"))
            set(material.emission, colour_of(*emission, light_limit));
        return material;
    }
    // Check the keys before loading textures, which takes longer.
    if (model == "diffuse")
        node.allow_keys({"model", "ambient", "diffuse", "texture", "alpha_cutoff"});
    else if (model == "specular")
        node.allow_keys({"model", "ambient", "diffuse", "specular", "exponent", "texture", "alpha_cutoff"});
    else
        node.allow_keys(
            {"model", "ambient", "diffuse", "specular", "exponent", "reflectivity", "texture", "alpha_cutoff"});
    arhost_material material = make_material(model == "diffuse"    ? ARHOST_MATERIAL_DIFFUSE
                                             : model == "specular" ? ARHOST_MATERIAL_SPECULAR
                                                                   : ARHOST_MATERIAL_METAL);
    material.colour_texture = texture_or_none(node, "texture", true, textures);
    material.alpha_cutoff = real_or(node, "alpha_cutoff", 0, 1, 0);
    const glm::vec3 diffuse = material.colour_texture == ARHOST_NONE ? colour_of(node.require("diffuse"))
                                                                     : colour_or(node, "diffuse", glm::vec3(1));
    set(material.diffuse, diffuse);
    set(material.ambient, colour_or(node, "ambient", diffuse));
    if (model == "diffuse")
        return material;
    set(material.specular, colour_of(node.require("specular")));
    material.exponent = static_cast<float>(node.require("exponent").real(1, 1e6));
    if (model == "specular")
        return material;
    set(material.reflectivity, colour_of(node.require("reflectivity")));
    return material;
}

glm::dvec3 direction_of(const Node &node) {
    const glm::dvec3 direction = vector_of(node);
    const double length = glm::length(direction);
    if (!(length > 1e-9 && length < 1e9))
        node.fail("must have a length between 1e-9 and 1e9");
    return direction / length;
}

// Sets the half-side vectors of a rectangle light that points along `direction`. The first one is horizontal.
void set_sides(arhost_light &light, const glm::dvec3 &direction, const glm::dvec3 &up, const Node &size_node) {
    const std::vector<double> size = size_node.is_sequence() ? size_node.reals(2) : std::vector(2, size_node.real());
    for (const double side : size)
        if (!(side >= 1e-3 && side <= coordinate_limit_mm))
            size_node.fail("each side must be 0.001 to 1e9 mm");
    glm::dvec3 u = glm::cross(up, direction);
    u = glm::length(u) > 1e-6 ? glm::normalize(u) : glm::dvec3(1, 0, 0);
    set(light.axis_u, u * (size[0] / 2));
    set(light.axis_v, glm::cross(direction, u) * (size[1] / 2));
}

arhost_light light_of(const Node &node, arhost_axes axes) {
    if (!node.is_map())
        node.fail("must be a map with the key 'intensity'");
    const auto type_node = node.find("type");
    const std::string type =
        type_node ? type_node->choice({"point", "directional", "spot", "rectangle", "sphere"}) : "point";
    arhost_light light = make_light(type == "point"         ? ARHOST_LIGHT_POINT
                                    : type == "directional" ? ARHOST_LIGHT_DIRECTIONAL
                                    : type == "spot"        ? ARHOST_LIGHT_SPOT
                                    : type == "rectangle"   ? ARHOST_LIGHT_RECTANGLE
                                                            : ARHOST_LIGHT_SPHERE);
    const Node intensity_node = node.require("intensity");
    const glm::dvec3 intensity = number_or_vector(intensity_node);
    for (int i = 0; i < 3; ++i)
        if (intensity[i] < 0 || intensity[i] > 1e12)
            intensity_node.fail("must be 0 to 1e12");
    set(light.intensity, intensity);
    if (type == "directional") {
        node.allow_keys({"type", "direction", "intensity"});
        set(light.direction, direction_of(node.require("direction")));
        return light;
    }
    set(light.position, position_of(node.require("position")));
    if (const auto falloff = node.find("falloff"))
        light.falloff = falloff->choice({"none", "inverse-square"}) == "none" ? ARHOST_FALLOFF_NONE
                                                                              : ARHOST_FALLOFF_INVERSE_SQUARE;
    if (type == "point") {
        node.allow_keys({"type", "position", "intensity", "falloff"});
    } else if (type == "sphere") {
        node.allow_keys({"type", "position", "intensity", "falloff", "radius"});
        light.radius = static_cast<float>(length_of(node.require("radius")));
    } else if (type == "spot") {
        node.allow_keys(
            {"type", "position", "intensity", "falloff", "direction", "inner_degrees", "outer_degrees", "radius"});
        light.radius = real_or(node, "radius", 0, coordinate_limit_mm, 0);
        set(light.direction, direction_of(node.require("direction")));
        const double outer = node.require("outer_degrees").real(0, 180);
        const auto inner = node.find("inner_degrees");
        light.cosine_outer = static_cast<float>(std::cos(outer * std::numbers::pi / 180));
        light.cosine_inner =
            static_cast<float>(std::cos((inner ? inner->real(0, outer) : outer) * std::numbers::pi / 180));
    } else {
        node.allow_keys({"type", "position", "intensity", "falloff", "direction", "size"});
        const glm::dvec3 direction = direction_of(node.require("direction"));
        set(light.direction, direction);
        set_sides(light, direction, up_of(axes), node.require("size"));
    }
    return light;
}

Transform step_of(const Node &node) {
    node.allow_keys({"translate", "scale", "rotate"});
    if (node.entries().size() != 1)
        node.fail("each step of a transform must have exactly one of the keys translate, scale and rotate");
    if (const auto by = node.find("translate"))
        return Transform::translation(position_of(*by));
    if (const auto by = node.find("scale")) {
        const glm::dvec3 factors = number_or_vector(*by);
        for (int i = 0; i < 3; ++i)
            if (!(std::abs(factors[i]) >= 1e-9 && std::abs(factors[i]) <= 1e9))
                by->fail("the absolute value of each factor must be 1e-9 to 1e9; negative factors mirror");
        return Transform::scaling(factors);
    }
    const Node rotate = node.require("rotate");
    rotate.allow_keys({"axis", "degrees"});
    return Transform::rotation(direction_of(rotate.require("axis")), rotate.require("degrees").real());
}

Transform transform_of(const Node &object) {
    Transform world_from_object;
    if (const auto steps = object.find("transform"))
        for (const Node &step : steps->items())
            world_from_object = step_of(step) * world_from_object;
    return world_from_object;
}

// Keyframe motion of an object: one node, and one channel for each property (translation, rotation, scale) that at
// least one key sets.
struct KeyframeMotion {
    MotionNode node;
    std::vector<Channel> channels;
};

KeyframeMotion keyframe_motion_of(const Node &node, bool is_sphere) {
    node.allow_keys({"keys"});
    const Node keys_node = node.require("keys");
    const std::vector<Node> keys = keys_node.items();
    if (keys.size() < 2)
        keys_node.fail("needs at least two keys");
    KeyframeMotion motion;
    motion.node.animated = true;
    const auto channel = [&](const char *property, arhost_channel_target target, const auto &read) {
        if (std::ranges::none_of(keys, [&](const Node &key) { return key.find(property).has_value(); }))
            return;
        Channel channel;
        channel.target = target;
        for (const Node &key : keys) {
            channel.times.push_back(static_cast<float>(key.require("at_s").real()));
            read(key.find(property), channel.values);
        }
        motion.channels.push_back(std::move(channel));
    };
    float previous_s = -1;
    for (const Node &key : keys) {
        key.allow_keys({"at_s", "translate", "rotate", "scale"});
        const Node at = key.require("at_s");
        const auto time = static_cast<float>(at.real(0, duration_limit_s));
        if (!(time > previous_s))
            at.fail("must be later than the previous key");
        previous_s = time;
    }
    channel("translate", ARHOST_CHANNEL_TRANSLATION, [](const auto &node, std::vector<float> &values) {
        const glm::dvec3 by = node ? position_of(*node) : glm::dvec3(0);
        values.insert(values.end(), {float(by.x), float(by.y), float(by.z)});
    });
    bool is_first = true;
    glm::dvec3 axis(0, 0, 1);
    double previous_degrees = 0;
    channel("rotate", ARHOST_CHANNEL_ROTATION, [&](const auto &node, std::vector<float> &values) {
        const glm::dvec3 previous_axis = axis;
        double degrees = 0;
        if (node) {
            node->allow_keys({"axis", "degrees"});
            axis = direction_of(node->require("axis"));
            degrees = node->require("degrees").real(-1e6, 1e6);
        }
        // Interpolation between rotations about different axes always takes the shorter direction, so only rotations
        // about the same axis need a check.
        const bool same_axis = previous_degrees == 0 || degrees == 0 || glm::length(axis - previous_axis) < 1e-9;
        const double angle = std::abs(degrees - previous_degrees);
        if (!is_first && same_axis && angle >= 180)
            (node ? *node : keys_node)
                .fail("the object rotates by " + std::to_string(std::lround(angle)) +
                      " degrees between this key and the previous one; it must be less than 180, so add a key in "
                      "between");
        is_first = false;
        previous_degrees = degrees;
        const double half = std::fmod(degrees, 720) * std::numbers::pi / 360;
        const glm::dvec3 part = axis * std::sin(half);
        values.insert(values.end(), {float(part.x), float(part.y), float(part.z), float(std::cos(half))});
    });
    channel("scale", ARHOST_CHANNEL_SCALE, [&](const auto &node, std::vector<float> &values) {
        const glm::dvec3 by = node ? number_or_vector(*node) : glm::dvec3(1);
        for (int i = 0; i < 3; ++i)
            if (!(by[i] >= 1e-6 && by[i] <= 1e6))
                node->fail("each factor must be 1e-6 to 1e6");
        if (is_sphere && (by.x != by.y || by.x != by.z))
            node->fail("scales a sphere non-uniformly, which is not supported; use the same factor for all axes");
        values.insert(values.end(), {float(by.x), float(by.y), float(by.z)});
    });
    if (motion.channels.empty())
        keys_node.fail("must set at least one of translate, rotate and scale");
    return motion;
}

glm::dvec3 centre_of(const Node &shape) {
    const auto centre = shape.find("centre");
    return centre ? position_of(*centre) : glm::dvec3(0);
}

// Reads the side lengths of a box, in mm.
glm::dvec3 size_of(const Node &node) {
    const glm::dvec3 size = number_or_vector(node);
    for (int i = 0; i < 3; ++i)
        if (!(size[i] >= 1e-6 && size[i] <= coordinate_limit_mm))
            node.fail("each side must be 1e-6 to 1e9 mm");
    return size;
}

TriangleMesh cuboid_of(const Node &shape, arhost_axes axes) {
    shape.allow_keys({"size", "centre"});
    return cuboid(centre_of(shape), up_of(axes), size_of(shape.require("size")));
}

TriangleMesh plane_of(const Node &shape, arhost_axes axes) {
    shape.allow_keys({"size", "centre", "normal"});
    const Node size_node = shape.require("size");
    const std::vector<double> size = size_node.is_sequence() ? size_node.reals(2) : std::vector(2, size_node.real());
    for (const double side : size)
        if (!(side >= 1e-6 && side <= coordinate_limit_mm))
            size_node.fail("each side must be 1e-6 to 1e9 mm");
    const glm::dvec3 up = up_of(axes);
    glm::dvec3 normal = up;
    if (const auto node = shape.find("normal"))
        normal = direction_of(*node);
    return rectangle(centre_of(shape), normal, up, {size[0], size[1]});
}

glm::vec4 sphere_of(const Node &object, const Node &shape, const Transform &world_from_object) {
    shape.allow_keys({"centre", "radius"});
    const auto scale = world_from_object.uniform_scale();
    if (!scale)
        object.require("transform")
            .fail("scales a sphere non-uniformly, which is not supported; use the same factor for all axes");
    const double radius = length_of(shape.require("radius")) * *scale;
    return {glm::vec3(world_from_object(centre_of(shape))), static_cast<float>(radius)};
}

template <class Points> void check_extent(const Node &shape, const Points &points) {
    for (const auto &point : points)
        for (int i = 0; i < Points::value_type::length(); ++i)
            if (!(std::abs(point[i]) <= coordinate_limit_mm))
                shape.fail("extends beyond 1e9 mm after its transform");
}

std::string extent_of(const Box &box) {
    const glm::vec3 size = box.max - box.min;
    char text[96];
    std::snprintf(text, sizeof text, "%.4g x %.4g x %.4g mm", size.x, size.y, size.z);
    return text;
}

// Reads the size and triangle count of the stand-in from the scene file, and creates its mesh.
TriangleMesh stand_in_of(const Node &node, const MeshOptions &options) {
    node.allow_keys({"faces", "size"});
    const std::int64_t faces = node.require("faces").integer(stand_in_faces_minimum, stand_in_faces_maximum);
    TriangleMesh mesh = stand_in(static_cast<std::uint32_t>(faces), size_of(node.require("size")));
    if (options.smooth.value_or(true))
        mesh.normals = smooth_normals(mesh);
    return mesh;
}

Fit fit_of(const Node &object) {
    Fit fit;
    const auto unit = object.find("unit"), size = object.find("fit_mm"), place = object.find("place");
    if (unit && size)
        size->fail("cannot be combined with 'unit'; remove one of them");
    if (unit) {
        const std::string text = unit->choice({"mm", "cm", "m", "in"});
        fit.mm_per_unit = text == "mm" ? 1 : text == "cm" ? 10 : text == "m" ? 1000 : 25.4;
    }
    if (size)
        fit.largest_side_mm = size->real(1e-3, coordinate_limit_mm);
    if (place)
        fit.place =
            place->choice({"on_ground", "centred"}) == "centred" ? Fit::Place::centred : Fit::Place::on_ground;
    return fit;
}

// Returns the mesh without materials if the object has its own.
MeshWithMaterials mesh_of(const Node &object, const Node &path, const glm::dvec3 &up,
                          const Transform &world_from_object, const LoadCallbacks &callbacks) {
    MeshOptions options;
    if (const auto smooth = object.find("smooth"))
        options.smooth = smooth->boolean();
    const auto stand_in = object.find("stand_in");
    std::error_code unknown;
    const bool missing = stand_in && !std::filesystem::exists(path.input_path(), unknown) && !unknown;
    if (missing && callbacks.warning)
        callbacks.warning(path.input_path().string() +
                          " is missing; a stand-in with the triangle count set in the scene is drawn instead; "
                          "tools/get-models downloads the available meshes");
    try {
        MeshWithMaterials loaded;
        if (missing)
            loaded.mesh = stand_in_of(*stand_in, options);
        else if (object.find("material"))
            loaded.mesh = load_mesh(path.input_path(), options, callbacks);
        else
            loaded = load_mesh_with_materials(path.input_path(), options, callbacks);
        TriangleMesh &mesh = loaded.mesh;
        const auto box = [&] { return box_of(std::span<const glm::vec3>(mesh.positions)); };
        const Fit fit = fit_of(object);
        (world_from_object * fit.transform(fit.needs_box() ? box() : Box(), up)).apply(mesh);
        check_extent(path, mesh.positions);
        if (std::ranges::any_of(mesh.texcoords, [](const glm::vec2 &t) {
                return std::abs(t.x) > coordinate_limit_mm || std::abs(t.y) > coordinate_limit_mm;
            }))
            path.fail("has texture coordinates beyond 1e9");
        const Box placed = box();
        if (callbacks.info)
            callbacks.info(path.input_path().string() + (missing ? " (stand-in): " : ": ") +
                           std::to_string(mesh.triangles.size()) + " triangles, " +
                           std::to_string(mesh.positions.size()) + " vertices, " + extent_of(placed));
        const auto role = object.find("role");
        if (!role && !object.find("on") && !object.find("motion") && callbacks.warning)
            if (const std::string warning = placement_warning(placed, up); !warning.empty())
                callbacks.warning(path.input_path().string() + ": " + warning);
        return loaded;
    } catch (const MeshError &error) {
        path.fail(error.what());
    }
}

class SceneLoader {
public:
    SceneLoader(const Node &root, const LoadCallbacks &callbacks, const std::vector<std::filesystem::path> &readable)
        : root_(root), callbacks_(callbacks), textures_(builder_, callbacks) {
        std::error_code ignored;
        for (const std::filesystem::path &path : readable)
            readable_.push_back(std::filesystem::weakly_canonical(path, ignored));
    }

    ArenaBuilder load() {
        root_.allow_keys({"version", "integrator", "axes", "max_depth", "ambient", "background", "shadow_alpha",
                          "coloured_shadows", "environment", "materials", "lights", "objects", "reads"});
        if (const auto reads = root_.find("reads"))
            reads->fail("a scene grants nothing; list these files under 'reads' of the ray tracer, in the "
                        "configuration, and remove this key");
        builder_.settings = settings_of(root_);
        if (const auto environment = root_.find("environment")) {
            set_origin(*environment);
            builder_.environment = environment_of(*environment, builder_.settings.axes, textures_);
        } else if (builder_.settings.integrator == ARHOST_INTEGRATOR_PATH && !root_.find("background") &&
                   !root_.find("lights")) {
            builder_.environment = default_environment(builder_.settings.axes, textures_);
        }
        const Node materials = root_.require("materials");
        for (const auto &[name, node] : materials.entries()) {
            set_origin(node);
            if (!materials_.emplace(name, builder_.add_material(material_of(node, textures_), name)).second)
                node.fail("another material has the same name; rename or remove one of them");
        }
        if (const auto lights = root_.find("lights"))
            for (const Node &node : lights->items()) {
                set_origin(node);
                builder_.add_light(light_of(node, builder_.settings.axes));
            }
        const std::vector<Node> objects = root_.require("objects").items();
        for (std::size_t i = 0; i < objects.size(); ++i) {
            set_origin(objects[i]);
            add_object(objects[i], i, objects.size());
        }
        return std::move(builder_);
    }

private:
    void set_origin(const Node &node) { builder_.set_origin(node.where() + ": " + node.path()); }

    void add_object(const Node &node, std::size_t index, std::size_t count) {
        node.allow_keys({"name",   "mesh",   "gltf",      "animation", "loop",     "speed", "variant",
                         "lights", "smooth", "stand_in",  "sphere",    "cuboid",   "plane", "unit",
                         "fit_mm", "place",  "transform", "motion",    "material", "role",  "on"});
        const std::string shape_key = shape_key_of(node);
        const Node shape = node.require(shape_key);
        for (const char *key : {"smooth", "stand_in"})
            if (const auto of_mesh = node.find(key); of_mesh && shape_key != "mesh")
                of_mesh->fail("is only allowed with 'mesh'");
        for (const char *key : {"unit", "fit_mm", "place"})
            if (const auto of_model = node.find(key); of_model && shape_key != "gltf" && shape_key != "mesh")
                of_model->fail("is only allowed with 'gltf' and 'mesh'");
        for (const char *key : {"variant", "loop", "speed", "lights"})
            if (const auto of_gltf = node.find(key); of_gltf && shape_key != "gltf")
                of_gltf->fail("is only allowed with 'gltf'");
        if (const auto animation = node.find("animation"); animation && shape_key != "gltf")
            animation->fail("is only allowed with 'gltf'; use 'motion' for other objects");
        const std::string name = name_of(node, shape_key + " " + std::to_string(index));
        const bool may_have_materials = shape_key == "gltf" || shape_key == "mesh";
        const auto material_node = may_have_materials ? node.find("material") : node.require("material");
        std::optional<std::uint32_t> material;
        if (material_node)
            material = material_index(*material_node);
        const arhost_role role = role_of(node);
        const Transform world_from_object = transform_of(node);
        const std::uint32_t motion_node = add_motion(node, shape_key == "sphere", anchor_of(node));

        LoadCallbacks part = callbacks_; // converts the progress of this object to that of the whole scene
        if (callbacks_.progress)
            part.progress = [&](double fraction, const std::string &what) {
                callbacks_.progress(
                    (static_cast<double>(index) + std::max(fraction, 0.0)) / static_cast<double>(count), what);
            };
        if (shape_key == "gltf") {
            // glTF is y-up by definition.
            const Transform to_scene_axes =
                builder_.settings.axes == ARHOST_AXES_Z_UP ? Transform::rotation({1, 0, 0}, 90) : Transform();
            add_gltf_file(node, shape,
                          {.name = name,
                           .axes_from_gltf = to_scene_axes,
                           .fit = fit_of(node),
                           .placed = world_from_object,
                           .node = motion_node,
                           .role = role,
                           .material = material,
                           .reads = readable_},
                          part);
        } else {
            const Motion motion{motion_node != ARHOST_NONE, false, motion_node, ARHOST_NONE};
            if (material) {
                const std::uint32_t geometry =
                    add_geometry(node, shape_key, shape, world_from_object, *material, part);
                builder_.add_object(name, geometry, *material, role, glm::mat4x3(1), motion);
            } else {
                add_parts(name, shape, mesh_of(node, shape, up_of(builder_.settings.axes), world_from_object, part),
                          role, motion, part);
            }
        }
        Reporter(part, name).report(1);
    }

    // Returns the node that follows the object's target, or ARHOST_NONE if the object belongs to the world.
    std::uint32_t anchor_of(const Node &object) {
        const auto target = object.find("on");
        if (!target)
            return ARHOST_NONE;
        const std::string name = target->text();
        if (name.size() >= ARHOST_MAX_NAME)
            target->fail("must be the name of a target, of up to " + std::to_string(ARHOST_MAX_NAME - 1) +
                         " characters");
        const auto [anchor, is_new] = anchors_.try_emplace(name, ARHOST_NONE);
        if (is_new) {
            set_origin(*target);
            anchor->second = builder_.add_anchor(name);
            set_origin(object);
        }
        return anchor->second;
    }

    // Adds a node and channels for the object's `motion`. Returns the index of the node, or `parent` if the object
    // has no `motion`.
    std::uint32_t add_motion(const Node &object, bool is_sphere, std::uint32_t parent) {
        const auto motion = object.find("motion");
        if (!motion)
            return parent;
        KeyframeMotion keyframes = keyframe_motion_of(*motion, is_sphere);
        keyframes.node.parent = parent;
        const std::uint32_t node = builder_.add_node(std::move(keyframes.node));
        for (Channel &channel : keyframes.channels) {
            channel.node = node;
            builder_.settings.duration_s = std::max(builder_.settings.duration_s, channel.times.back());
            builder_.add_channel(std::move(channel));
        }
        return node;
    }

    void add_gltf_file(const Node &object, const Node &path, GltfPlacement placement,
                       const LoadCallbacks &callbacks) {
        const auto animation = object.find("animation");
        if (animation && animation->is_sequence())
            for (const Node &one : animation->items())
                placement.animations.push_back(one.text());
        else if (animation)
            placement.animations = {animation->text()};
        for (const char *key : {"loop", "speed"})
            if (const auto of_animation = object.find(key); of_animation && !animation)
                of_animation->fail("is only allowed with 'animation'");
        if (const auto loop = object.find("loop"))
            placement.loops = loop->boolean();
        placement.speed = real_or(object, "speed", 0.001, 1000, 1);
        if (const auto lights = object.find("lights"))
            placement.has_lights = lights->boolean();
        const auto variant = object.find("variant");
        if (variant)
            placement.variant = variant->text();
        try {
            const float duration = add_gltf(builder_, textures_, path.input_path(), placement, callbacks);
            builder_.settings.duration_s = std::max(builder_.settings.duration_s, duration);
        } catch (const AnimationError &error) {
            animation->fail(error.what());
        } catch (const VariantError &error) {
            variant->fail(error.what());
        } catch (const MeshError &error) {
            path.fail(error.what());
        } catch (const ImageError &error) {
            path.fail(error.what());
        }
    }

    // Adds one object for each material of an OBJ file.
    void add_parts(const std::string &name, const Node &path, const MeshWithMaterials &loaded, arhost_role role,
                   const Motion &motion, const LoadCallbacks &callbacks) {
        const MaterialUses &uses = loaded.uses;
        if (uses.libraries.empty())
            path.fail("has no materials; add the key 'material' to the object");
        std::vector<std::size_t> parts(loaded.mesh.triangles.size(), uses.names.size());
        for (std::size_t i = 0; i < uses.runs.size(); ++i)
            std::fill(parts.begin() + static_cast<std::ptrdiff_t>(uses.runs[i].first_triangle),
                      i + 1 < uses.runs.size()
                          ? parts.begin() + static_cast<std::ptrdiff_t>(uses.runs[i + 1].first_triangle)
                          : parts.end(),
                      uses.runs[i].name);
        try {
            const std::filesystem::path file = path.input_path();
            MtlMaterials materials(builder_, textures_, file, uses, readable_,
                                   Reporter(callbacks, file.filename().string()));
            std::vector<TriangleMesh> meshes = split(loaded.mesh, parts, uses.names.size() + 1);
            for (std::size_t i = 0; i < meshes.size(); ++i) {
                if (meshes[i].triangles.empty())
                    continue;
                const bool is_named = i < uses.names.size();
                const std::uint32_t material = is_named ? materials.add(uses.names[i]) : materials.add_default();
                check_texcoords(path, material, !meshes[i].texcoords.empty());
                builder_.add_object(is_named ? name + "/" + printable(uses.names[i].text) : name,
                                    builder_.add_triangles(std::move(meshes[i])), material, role, glm::mat4x3(1),
                                    motion);
            }
        } catch (const MeshError &error) {
            path.fail(error.what());
        }
    }

    void check_texcoords(const Node &shape, std::uint32_t material_index, bool has_texcoords) const {
        const arhost_material &material = builder_.material(material_index);
        for (const std::uint32_t texture : textures_of(material))
            if (texture != ARHOST_NONE && !has_texcoords)
                shape.fail("has no texture coordinates, so its material cannot have textures; give it another "
                           "material, or a mesh with texture coordinates");
    }

    static std::string shape_key_of(const Node &node) {
        std::string found;
        for (const char *key : {"mesh", "gltf", "sphere", "cuboid", "plane"})
            if (const auto shape = node.find(key)) {
                if (!found.empty())
                    shape->fail("the object already has a " + found + "; split it into two objects");
                found = key;
            }
        if (found.empty())
            node.fail("needs one of mesh, gltf, sphere, cuboid and plane");
        return found;
    }

    static std::string name_of(const Node &node, const std::string &fallback) {
        const auto name = node.find("name");
        if (!name)
            return fallback;
        std::string text = name->text();
        if (std::ranges::any_of(text, [](unsigned char c) { return c < 0x20 || c == 0x7f; }))
            name->fail("must not contain control characters");
        return text;
    }

    std::uint32_t material_index(const Node &node) const {
        std::vector<std::string_view> names;
        for (const auto &[name, index] : materials_)
            names.push_back(name);
        return materials_.at(node.choice(names));
    }

    static arhost_role role_of(const Node &node) {
        const auto role = node.find("role");
        const std::string text = role ? role->choice({"virtual", "catcher", "occluder"}) : "virtual";
        return text == "virtual"   ? ARHOST_ROLE_VIRTUAL
               : text == "catcher" ? ARHOST_ROLE_CATCHER
                                   : ARHOST_ROLE_OCCLUDER;
    }

    std::uint32_t add_geometry(const Node &node, const std::string &key, const Node &shape,
                               const Transform &world_from_object, std::uint32_t material,
                               const LoadCallbacks &callbacks) {
        if (key == "mesh") {
            TriangleMesh mesh =
                mesh_of(node, shape, up_of(builder_.settings.axes), world_from_object, callbacks).mesh;
            check_texcoords(shape, material, !mesh.texcoords.empty());
            return builder_.add_triangles(std::move(mesh));
        }
        if (key == "sphere") {
            check_texcoords(shape, material, false);
            const Spheres spheres = {sphere_of(node, shape, world_from_object)};
            check_extent(shape, spheres);
            if (!(spheres[0].w > 0))
                shape.fail("its radius is 0 after its transform");
            return builder_.add_spheres(spheres);
        }
        TriangleMesh mesh =
            key == "cuboid" ? cuboid_of(shape, builder_.settings.axes) : plane_of(shape, builder_.settings.axes);
        world_from_object.apply(mesh);
        check_extent(shape, mesh.positions);
        return builder_.add_triangles(std::move(mesh));
    }

    const Node &root_;
    const LoadCallbacks &callbacks_;
    ArenaBuilder builder_;
    Textures textures_;
    std::map<std::string, std::uint32_t> materials_;
    std::map<std::string, std::uint32_t> anchors_; // nodes, by name of the target
    std::vector<std::filesystem::path> readable_;  // without links
};

} // namespace

ArenaBuilder load_scene(const yaml::Node &root, const LoadCallbacks &callbacks,
                        const std::vector<std::filesystem::path> &readable) {
    return SceneLoader(root, callbacks, readable).load();
}

ArenaBuilder load_scene(const std::filesystem::path &file, const LoadCallbacks &callbacks,
                        const std::vector<std::filesystem::path> &readable) {
    return load_scene(Node::load(file), callbacks, readable);
}

} // namespace arhost::scene
