// SPDX-License-Identifier: Apache-2.0
#include "scene/arena_builder.hpp"

#include "scene/box.hpp"
#include "scene/material_textures.hpp"
#include "scene/motion.hpp"

#include <arhost/tracker.h>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>

namespace arhost::scene {
namespace {

// Tolerance for rounding errors in lengths, sums of weights, and bounds.
constexpr float tolerance = 1e-3f;

struct Invalid {
    std::string text;
};

[[noreturn]] void fail(const std::string &text) {
    throw Invalid{text};
}

std::string number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%g", value);
    return text;
}

// Returns false for NaN, because all comparisons with NaN are false.
bool within(float value, float low, float high) {
    return value >= low && value <= high;
}

void check_floats(std::span<const float> values, float low, float high, const std::string &what) {
    for (const float value : values)
        if (!within(value, low, high))
            fail(what + " is " + number(value) + ", outside " + number(low) + " to " + number(high));
}

// Returns whether all absolute values are within coordinate_limit_mm. With the sign bit cleared, floats have the same
// order as their bit patterns read as integers, and infinity and NaN are the largest. The integer comparison
// vectorizes, so only memory bandwidth limits the loop.
bool all_within_limit(std::span<const float> values) {
    const std::int32_t limit = std::bit_cast<std::int32_t>(coordinate_limit_mm);
    std::int32_t outside = 0;
    for (const float value : values)
        outside |= (std::bit_cast<std::int32_t>(value) & 0x7fffffff) > limit;
    return !outside;
}

// Returns whether all values are 0 to 1e6, with the same method: the sign bit makes negative floats larger than all
// positive ones when read as unsigned integers.
bool all_radiances(std::span<const float> values) {
    std::uint32_t highest = 0;
    for (const float value : values)
        highest = std::max(highest, std::bit_cast<std::uint32_t>(value));
    return highest <= std::bit_cast<std::uint32_t>(radiance_limit);
}

bool is_unit(std::span<const float> vector) {
    float squared = 0;
    for (const float value : vector)
        squared += value * value;
    return std::abs(squared - 1) <= 2 * tolerance;
}

template <class T> std::span<const float> floats_of(std::span<const T> values) {
    return {reinterpret_cast<const float *>(values.data()), values.size() * sizeof(T) / sizeof(float)};
}

class Checker {
public:
    explicit Checker(std::span<const std::byte> arena) : arena_(arena) {}

    void run() {
        check_header();
        geometries_ = view<arhost_geometry>(scene_->geometries, "the table of geometries");
        images_ = view<arhost_texel_image>(scene_->images, "the table of images");
        textures_ = view<arhost_texture>(scene_->textures, "the table of textures");
        materials_ = view<arhost_material>(scene_->materials, "the table of materials");
        objects_ = view<arhost_object>(scene_->objects, "the table of objects");
        lights_ = view<arhost_light>(scene_->lights, "the table of lights");
        nodes_ = view<arhost_node>(scene_->nodes, "the table of nodes");
        channels_ = view<arhost_channel>(scene_->channels, "the table of channels");
        skins_ = view<arhost_skin>(scene_->skins, "the table of skins");
        names_ = view<char>(scene_->names, "the table of names");
        anchors_ = view<arhost_anchor>(scene_->anchors, "the table of anchors");
        check_names();
        for_each(Table::nodes, nodes_.size(), [&](std::size_t i) { check_node(i); });
        for_each(Table::anchors, anchors_.size(), [&](std::size_t i) { check_anchor(i); });
        for_each(Table::channels, channels_.size(), [&](std::size_t i) { check_channel(i); });
        for_each(Table::skins, skins_.size(), [&](std::size_t i) { check_skin(i); });
        for_each(Table::materials, materials_.size(), [&](std::size_t i) { check_material(i); });
        for_each(Table::objects, objects_.size(), [&](std::size_t i) { check_object(i); });
        find_deformers();
        for_each(Table::geometries, geometries_.size(), [&](std::size_t i) { check_deformer(i); });
        for_each(Table::textures, textures_.size(), [&](std::size_t i) { check_texture(i); });
        for_each(Table::images, images_.size(), [&](std::size_t i) { check_image(i); });
        check_environment();
        for_each(Table::lights, lights_.size(), [&](std::size_t i) { check_light(i); });
        std::vector<Box> boxes;
        for_each(Table::geometries, geometries_.size(), [&](std::size_t i) { boxes.push_back(check_geometry(i)); });
        for_each(Table::objects, objects_.size(), [&](std::size_t i) { check_extent(i, boxes); });
        check_bounds();
        for_each(Table::objects, objects_.size(), [&](std::size_t i) { check_in_bounds(i, boxes); });
    }

    // The element that was being checked when the exception was thrown.
    Table table() const { return table_; }
    std::size_t index() const { return index_; }

private:
    template <class Check> void for_each(Table table, std::size_t count, const Check &check) {
        table_ = table;
        for (index_ = 0; index_ < count; ++index_)
            check(index_);
        table_ = Table::scene;
        index_ = 0;
    }

    void check_header() {
        if (reinterpret_cast<std::uintptr_t>(arena_.data()) % arena_alignment != 0)
            fail("its memory is not aligned to 64 bytes");
        if (arena_.size() < sizeof(arhost_scene))
            fail("it is shorter than the header");
        scene_ = reinterpret_cast<const arhost_scene *>(arena_.data());
        if (scene_->magic != ARHOST_SCENE_MAGIC)
            fail("it does not begin with the magic number of scenes");
        if (scene_->version != ARHOST_SCENE_VERSION)
            fail("its version is " + std::to_string(scene_->version) + ", not " +
                 std::to_string(ARHOST_SCENE_VERSION));
        if (scene_->struct_size != sizeof(arhost_scene))
            fail("the struct_size of its header is wrong");
        if (scene_->byte_size < sizeof(arhost_scene) || scene_->byte_size > arena_.size())
            fail("its header states " + std::to_string(scene_->byte_size) + " bytes, but the arena has " +
                 std::to_string(arena_.size()));
        arena_ = arena_.first(scene_->byte_size);
        unused_bytes_ = scene_->byte_size - sizeof(arhost_scene);
        if (scene_->axes != ARHOST_AXES_Z_UP && scene_->axes != ARHOST_AXES_Y_UP)
            fail("its value of 'axes' is unknown");
        if (scene_->integrator != ARHOST_INTEGRATOR_WHITTED && scene_->integrator != ARHOST_INTEGRATOR_PATH)
            fail("its value of 'integrator' is unknown");
        if (scene_->max_depth > max_depth_limit)
            fail("max_depth is " + std::to_string(scene_->max_depth) + ", more than " +
                 std::to_string(max_depth_limit));
        check_floats(scene_->ambient, 0, coordinate_limit_mm, "the ambient light");
        check_floats(scene_->background, 0, coordinate_limit_mm, "the background");
        check_floats({&scene_->duration_s, 1}, 0, duration_limit_s, "duration_s");
        check_floats({&scene_->shadow_alpha_opaque, 1}, 0, 1, "shadow_alpha_opaque");
        check_floats({&scene_->shadow_alpha_translucent, 1}, 0, 1, "shadow_alpha_translucent");
    }

    // Checks that the buffer and its spare bytes are inside the arena, and returns its elements. The total size of
    // all buffers must not exceed the size of the arena; otherwise, a small arena could refer to one large buffer a
    // million times, and checking it would take very long.
    template <class T> std::span<const T> view(const arhost_buffer &buffer, const std::string &what) {
        if (buffer.count == 0) {
            if (buffer.offset != 0 || buffer.stride != 0)
                fail(what + " is absent, but its offset or stride is not 0");
            return {};
        }
        if (buffer.stride != sizeof(T))
            fail(what + " has a stride of " + std::to_string(buffer.stride) + " bytes, not " +
                 std::to_string(sizeof(T)));
        if (buffer.offset % arena_alignment != 0)
            fail(what + " is not aligned to 64 bytes");
        if (buffer.offset < sizeof(arhost_scene))
            fail(what + " overlaps the header");
        const std::uint64_t needed = std::uint64_t(buffer.count) * sizeof(T) + arena_spare_bytes; // < 2^32 · 2^7
        if (buffer.offset > arena_.size() || needed > arena_.size() - buffer.offset)
            fail(what + " extends past the end of the scene");
        if (needed > unused_bytes_)
            fail(what + " overlaps other buffers");
        unused_bytes_ -= needed;
        return {reinterpret_cast<const T *>(arena_.data() + buffer.offset), buffer.count};
    }

    void check_names() {
        if (!names_.empty() && names_.back() != '\0')
            fail("the last name has no terminating zero");
        for (const char c : names_)
            if (c != '\0' && (static_cast<unsigned char>(c) < 0x20 || c == 0x7f))
                fail("a name contains a control character");
    }

    std::string name_of(std::size_t object) const {
        constexpr std::size_t shown = 64; // names may be gigabytes long
        const char *name = names_.data() + objects_[object].name;
        return "object " + std::to_string(object) + " '" + std::string(name, strnlen(name, shown)) + "'";
    }

    void check_object(std::size_t i) {
        const arhost_object &object = objects_[i];
        if (object.name >= names_.size())
            fail("the name of object " + std::to_string(i) + " is outside the table of names");
        const auto in_table = [&](std::uint32_t index, std::size_t count, const char *what) {
            if (index >= count)
                fail(name_of(i) + " refers to " + what + " " + std::to_string(index) + ", but the scene has only " +
                     std::to_string(count));
        };
        in_table(object.geometry, geometries_.size(), "geometry");
        in_table(object.material, materials_.size(), "material");
        const arhost_geometry &geometry = geometries_[object.geometry];
        for (const std::uint32_t texture : textures_of(materials_[object.material]))
            if (texture != ARHOST_NONE &&
                textures_[texture].texcoord_set >= geometry.texcoords.count / std::max(geometry.positions.count, 1u))
                fail(name_of(i) + " has a material with a texture of texcoord set " +
                     std::to_string(textures_[texture].texcoord_set) + ", but its geometry has no such set");
        if (object.reserved != 0)
            fail(name_of(i) + ": a reserved field is not 0");
        if (object.role < ARHOST_ROLE_VIRTUAL || object.role > ARHOST_ROLE_OCCLUDER)
            fail(name_of(i) + " has an unknown role");
        const float *m = object.world_from_object;
        check_floats(object.world_from_object, -coordinate_limit_mm, coordinate_limit_mm,
                     name_of(i) + ": an element of world_from_object");
        const glm::dvec3 x(m[0], m[1], m[2]), y(m[3], m[4], m[5]), z(m[6], m[7], m[8]);
        const double size = glm::length(x) * glm::length(y) * glm::length(z);
        if (!(std::abs(glm::dot(glm::cross(x, y), z)) > 1e-9 * size))
            fail(name_of(i) + ": world_from_object cannot be inverted");
        if (!object.moves && !object.deforms) {
            if (object.node != ARHOST_NONE || object.skin != ARHOST_NONE)
                fail(name_of(i) + " has a node or a skin, but neither moves nor deforms");
            return;
        }
        if (!is_moving(*scene_))
            fail(name_of(i) + " moves or deforms, but the scene has no anchors and its duration_s is 0");
        if (object.node != ARHOST_NONE || object.moves)
            in_table(object.node, nodes_.size(), "node");
        if (object.skin != ARHOST_NONE)
            in_table(object.skin, skins_.size(), "skin");
        if (object.skin != ARHOST_NONE && (object.moves || !object.deforms || !is_identity(object.world_from_object)))
            fail(name_of(i) + " has a skin; it must therefore set deforms, not moves, and its world_from_object must "
                              "be the identity");
        if (object.deforms && geometries_[object.geometry].type != ARHOST_GEOMETRY_TRIANGLES)
            fail(name_of(i) + " deforms, but its geometry is not a triangle mesh");
    }

    static bool is_identity(const float (&m)[12]) {
        for (int i = 0; i < 12; ++i)
            if (m[i] != (i == 0 || i == 4 || i == 8))
                return false;
        return true;
    }

    // Finds the object that deforms each geometry.
    void find_deformers() {
        deformers_.assign(geometries_.size(), ARHOST_NONE);
        uses_.assign(geometries_.size(), 0);
        for (std::uint32_t i = 0; i < objects_.size(); ++i) {
            ++uses_[objects_[i].geometry];
            if (objects_[i].deforms)
                deformers_[objects_[i].geometry] = i;
        }
    }

    // No other object may use a deforming geometry.
    void check_deformer(std::size_t i) const {
        if (deformers_[i] != ARHOST_NONE && uses_[i] > 1)
            fail(name_of(deformers_[i]) + " deforms geometry " + std::to_string(i) +
                 ", which another object uses too");
    }

    void check_texture(std::size_t i) {
        const arhost_texture &texture = textures_[i];
        const std::string what = "texture " + std::to_string(i) + ": ";
        if (texture.image >= images_.size())
            fail(what + "it refers to image " + std::to_string(texture.image) + ", but the scene has only " +
                 std::to_string(images_.size()));
        for (const arhost_wrap wrap : {texture.wrap_u, texture.wrap_v})
            if (wrap < ARHOST_WRAP_REPEAT || wrap > ARHOST_WRAP_MIRROR)
                fail(what + "its wrap mode is unknown");
        if (texture.filter < ARHOST_TEXEL_FILTER_LINEAR || texture.filter > ARHOST_TEXEL_FILTER_NEAREST)
            fail(what + "its filter is unknown");
        check_floats(texture.image_from_texcoord, -coordinate_limit_mm, coordinate_limit_mm,
                     what + "image_from_texcoord");
    }

    void check_image(std::size_t i) {
        const arhost_texel_image &image = images_[i];
        const std::string what = "image " + std::to_string(i) + ": ";
        if (image.format < ARHOST_TEXEL_SRGB8 || image.format > ARHOST_TEXEL_RGBA32F)
            fail(what + "its format is unknown");
        if (image.name >= names_.size())
            fail(what + "its name is outside the table of names");
        if (image.width - 1 >= texture_side_limit || image.height - 1 >= texture_side_limit)
            fail(what + "it has " + std::to_string(image.width) + " x " + std::to_string(image.height) +
                 " texels; each side must have 1 to " + std::to_string(texture_side_limit));
        if (image.reserved != 0)
            fail(what + "a reserved field is not 0");
        if (const auto most = static_cast<std::uint32_t>(std::bit_width(std::max(image.width, image.height)));
            image.level_count - 1 >= most)
            fail(what + "it has " + std::to_string(image.level_count) + " levels; it must have 1 to " +
                 std::to_string(most));
        if (image.texels.count != texel_count(image.width, image.height, image.level_count))
            fail(what + "it has " + std::to_string(image.texels.count) + " texels for " +
                 std::to_string(image.width) + " x " + std::to_string(image.height) + " in " +
                 std::to_string(image.level_count) + " levels");
        if (image.format != ARHOST_TEXEL_RGBA32F) {
            view<std::uint32_t>(image.texels, what + "the buffer of texels");
        } else if (const auto texels = floats_of(view<glm::vec4>(image.texels, what + "the buffer of texels"));
                   !all_radiances(texels)) {
            for (std::size_t t = 0; t < texels.size(); ++t)
                if (!all_radiances(texels.subspan(t, 1)))
                    fail(what + "texel " + std::to_string(t / 4) + " has the invalid value " + number(texels[t]));
        }
    }

    void check_environment() {
        const arhost_environment &environment = scene_->environment;
        const auto rows = view<float>(environment.rows, "the environment's rows");
        const auto columns = view<float>(environment.columns, "the environment's columns");
        if (environment.texture == ARHOST_NONE) {
            if (!rows.empty() || !columns.empty())
                fail("there is no environment, but it has rows or columns");
            return;
        }
        if (environment.texture >= textures_.size())
            fail("the environment refers to texture " + std::to_string(environment.texture) +
                 ", but the scene has only " + std::to_string(textures_.size()));
        const arhost_texel_image &image = images_[textures_[environment.texture].image];
        if (image.format != ARHOST_TEXEL_RGBA32F)
            fail("the environment's image is not RGBA32F");
        check_floats({&environment.intensity, 1}, 0, radiance_limit, "the environment's intensity");
        const float *m = environment.environment_from_world;
        check_floats(environment.environment_from_world, -1 - tolerance, 1 + tolerance,
                     "an element of environment_from_world");
        const glm::vec3 x(m[0], m[1], m[2]), y(m[3], m[4], m[5]), z(m[6], m[7], m[8]);
        if (!(glm::length(glm::cross(x, y) - z) <= tolerance && glm::length(glm::cross(y, z) - x) <= tolerance &&
              glm::length(glm::cross(z, x) - y) <= tolerance && is_unit({m, 3})))
            fail("environment_from_world is not a rotation");
        if (rows.size() != image.height || columns.size() != image.texels.count)
            fail("the environment has " + std::to_string(rows.size()) + " rows and " +
                 std::to_string(columns.size()) + " columns for a texture of " + std::to_string(image.width) + " x " +
                 std::to_string(image.height));
        check_cumulative(rows, "the environment's rows");
        for (std::size_t row = 0; row < rows.size(); ++row)
            check_cumulative(columns.subspan(row * image.width, image.width), "the environment's columns");
    }

    static void check_cumulative(std::span<const float> sums, const char *what) {
        bool ascending = sums.front() >= 0;
        for (std::size_t i = 1; i < sums.size(); ++i)
            ascending &= sums[i] >= sums[i - 1];
        if (!ascending)
            fail(std::string(what) + " are not cumulative sums");
        if (!within(sums.back(), 1 - tolerance, 1 + tolerance))
            fail(std::string(what) + " end at " + number(sums.back()) + ", not at 1");
    }

    void check_node(std::size_t i) {
        const arhost_node &node = nodes_[i];
        const std::string what = "node " + std::to_string(i) + ": ";
        if (node.parent != ARHOST_NONE && node.parent >= i)
            fail(what + "its parent " + std::to_string(node.parent) + " does not precede it");
        check_floats(node.parent_from_node, -coordinate_limit_mm, coordinate_limit_mm, what + "parent_from_node");
        check_floats(node.translation, -coordinate_limit_mm, coordinate_limit_mm, what + "translation");
        check_floats(node.rotation, -1 - tolerance, 1 + tolerance, what + "rotation");
        check_floats(node.scale, -coordinate_limit_mm, coordinate_limit_mm, what + "scale");
        if (node.animated && !is_unit(node.rotation))
            fail(what + "its rotation is not of length 1");
        check_floats(view<float>(node.morph_weights, what + "the buffer of morph_weights"), -coordinate_limit_mm,
                     coordinate_limit_mm, what + "a morph weight");
    }

    void check_anchor(std::size_t i) {
        const arhost_anchor &anchor = anchors_[i];
        const std::string what = "anchor " + std::to_string(i) + ": ";
        if (anchors_.size() > ARHOST_MAX_TARGETS)
            fail("there are " + std::to_string(anchors_.size()) + " anchors; the limit is " +
                 std::to_string(int{ARHOST_MAX_TARGETS}));
        if (anchor.node >= nodes_.size())
            fail(what + "it refers to node " + std::to_string(anchor.node) + ", but the scene has only " +
                 std::to_string(nodes_.size()));
        if (nodes_[anchor.node].parent != ARHOST_NONE || nodes_[anchor.node].animated)
            fail(what + "its node has a parent or is animated");
        if (i > 0 && anchor.node <= anchors_[i - 1].node)
            fail(what + "its node does not follow that of the previous anchor");
        if (anchor.target >= names_.size())
            fail(what + "its name is outside the table of names");
        if (strnlen(names_.data() + anchor.target, ARHOST_MAX_NAME) == ARHOST_MAX_NAME)
            fail(what + "its name has more than " + std::to_string(ARHOST_MAX_NAME - 1) + " characters");
    }

    void check_channel(std::size_t i) {
        const arhost_channel &channel = channels_[i];
        const std::string what = "channel " + std::to_string(i) + ": ";
        if (channel.node >= nodes_.size())
            fail(what + "it refers to node " + std::to_string(channel.node) + ", but the scene has only " +
                 std::to_string(nodes_.size()));
        if (channel.target < ARHOST_CHANNEL_TRANSLATION || channel.target > ARHOST_CHANNEL_MORPH_WEIGHTS)
            fail(what + "its target is unknown");
        if (channel.interpolation < ARHOST_INTERPOLATION_STEP || channel.interpolation > ARHOST_INTERPOLATION_CUBIC)
            fail(what + "its interpolation is unknown");
        check_floats({&channel.period_s, 1}, 0, duration_limit_s, what + "period_s");
        const bool weights = channel.target == ARHOST_CHANNEL_MORPH_WEIGHTS;
        if (!weights && !nodes_[channel.node].animated)
            fail(what + "its node is not animated");
        const auto times = view<float>(channel.times, what + "the buffer of times");
        const auto values = view<float>(channel.values, what + "the buffer of values");
        if (times.empty())
            fail(what + "it has no keys");
        check_floats(times, 0, duration_limit_s, what + "a time");
        for (std::size_t t = 1; t < times.size(); ++t)
            if (!(times[t] > times[t - 1]))
                fail(what + "its times are not strictly increasing");
        const std::uint64_t width = weights ? nodes_[channel.node].morph_weights.count
                                    : channel.target == ARHOST_CHANNEL_ROTATION ? 4
                                                                                : 3;
        const bool cubic = channel.interpolation == ARHOST_INTERPOLATION_CUBIC;
        if (width == 0 || values.size() != times.size() * width * (cubic ? 3 : 1))
            fail(what + "it has " + std::to_string(values.size()) + " values for " + std::to_string(times.size()) +
                 " keys with " + std::to_string(width) + " components each");
        check_floats(values, -coordinate_limit_mm, coordinate_limit_mm, what + "a value");
        if (channel.target == ARHOST_CHANNEL_ROTATION)
            for (std::size_t key = 0; key < times.size(); ++key)
                if (!is_unit(values.subspan(cubic ? key * 12 + 4 : key * 4, 4)))
                    fail(what + "the rotation of key " + std::to_string(key) + " is not of length 1");
    }

    void check_skin(std::size_t i) {
        const std::string what = "skin " + std::to_string(i) + ": ";
        const auto joints = view<std::uint32_t>(skins_[i].joints, what + "the buffer of joints");
        const auto matrices = view<glm::mat4x3>(skins_[i].node_from_mesh, what + "the buffer of node_from_mesh");
        if (joints.empty() || matrices.size() != joints.size())
            fail(what + "it has " + std::to_string(joints.size()) + " joints and " + std::to_string(matrices.size()) +
                 " matrices");
        for (const std::uint32_t joint : joints)
            if (joint >= nodes_.size())
                fail(what + "it refers to node " + std::to_string(joint) + ", but the scene has only " +
                     std::to_string(nodes_.size()));
        check_floats(floats_of(matrices), -coordinate_limit_mm, coordinate_limit_mm, what + "node_from_mesh");
    }

    void check_material(std::size_t i) {
        const arhost_material &material = materials_[i];
        const std::string what = "material " + std::to_string(i) + ": ";
        if (material.model < ARHOST_MATERIAL_DIFFUSE || material.model > ARHOST_MATERIAL_UNLIT)
            fail(what + "its model is unknown");
        for (const std::uint32_t texture : textures_of(material))
            if (texture != ARHOST_NONE && texture >= textures_.size())
                fail(what + "it refers to texture " + std::to_string(texture) + ", but the scene has only " +
                     std::to_string(textures_.size()));
        check_floats(material.ambient, 0, 1, what + "ambient");
        check_floats(material.diffuse, 0, 1, what + "diffuse");
        const bool is_rough = material.model == ARHOST_MATERIAL_METALLIC_ROUGHNESS;
        check_floats(material.specular, 0, is_rough ? radiance_limit : 1, what + "specular");
        check_floats(material.reflectivity, 0, 1, what + "reflectivity");
        check_floats({&material.exponent, 1}, 1, coordinate_limit_mm, what + "exponent");
        check_floats(material.emission, 0, radiance_limit, what + "emission");
        check_floats({&material.opacity, 1}, 0, 1, what + "opacity");
        check_floats({&material.alpha_cutoff, 1}, 0, 1, what + "alpha_cutoff");
        check_floats({&material.normal_scale, 1}, -coordinate_limit_mm, coordinate_limit_mm, what + "normal_scale");
        check_floats({&material.occlusion_strength, 1}, 0, 1, what + "occlusion_strength");
        check_floats({&material.specular_weight, 1}, 0, 1, what + "specular_weight");
        check_floats({&material.transmission, 1}, 0, 1, what + "transmission");
        check_floats({&material.clearcoat, 1}, 0, 1, what + "clearcoat");
        check_floats({&material.clearcoat_roughness, 1}, 0, 1, what + "clearcoat_roughness");
        check_floats({&material.clearcoat_normal_scale, 1}, -coordinate_limit_mm, coordinate_limit_mm,
                     what + "clearcoat_normal_scale");
        check_floats(material.sheen, 0, 1, what + "sheen");
        check_floats({&material.sheen_roughness, 1}, 0, 1, what + "sheen_roughness");
        check_floats({&material.anisotropy, 1}, 0, 1, what + "anisotropy");
        if (!is_unit(material.anisotropy_direction))
            fail(what + "its anisotropy_direction is not of length 1");
        check_floats({&material.iridescence, 1}, 0, 1, what + "iridescence");
        check_floats({&material.iridescence_index, 1}, 1, 4, what + "iridescence_index");
        check_floats(material.iridescence_thickness_nm, 0, film_thickness_limit_nm, what + "iridescence_thickness");
        check_floats({&material.metallic, 1}, 0, 1, what + "metallic");
        check_floats({&material.roughness, 1}, 0, 1, what + "roughness");
        check_floats({&material.index, 1}, 1, 4, what + "index");
        check_floats({&material.fresnel_exponent, 1}, 0.01f, 100, what + "fresnel_exponent");
        check_floats({&material.fresnel_minimum, 1}, 0, 1, what + "fresnel_minimum");
        check_floats({&material.fresnel_maximum, 1}, material.fresnel_minimum, 1, what + "fresnel_maximum");
        check_floats(material.refraction, 0, 1, what + "refraction");
        check_floats(material.extinction, 0, extinction_limit, what + "extinction");
        check_floats(material.shadow_attenuation, 0, 1, what + "shadow_attenuation");
        check_floats(material.cutoff_colour, 0, 1, what + "cutoff_colour");
        check_floats({&material.importance_cutoff, 1}, 0, 1, what + "importance_cutoff");
    }

    void check_light(std::size_t i) {
        const arhost_light &light = lights_[i];
        const std::string what = "light " + std::to_string(i) + ": ";
        if (light.type < ARHOST_LIGHT_POINT || light.type > ARHOST_LIGHT_SPHERE)
            fail(what + "its type is unknown");
        if (light.falloff != ARHOST_FALLOFF_NONE && light.falloff != ARHOST_FALLOFF_INVERSE_SQUARE)
            fail(what + "its falloff is unknown");
        check_floats(light.position, -coordinate_limit_mm, coordinate_limit_mm, what + "position");
        check_floats(light.intensity, 0, std::numeric_limits<float>::max(), what + "intensity");
        const auto length_of = [](const float(&v)[3]) { return glm::length(glm::dvec3(v[0], v[1], v[2])); };
        check_floats(light.direction, -1 - tolerance, 1 + tolerance, what + "direction");
        if (light.type != ARHOST_LIGHT_POINT && light.type != ARHOST_LIGHT_SPHERE &&
            !within(static_cast<float>(length_of(light.direction)), 1 - tolerance, 1 + tolerance))
            fail(what + "its direction is not of length 1");
        check_floats(light.axis_u, -coordinate_limit_mm, coordinate_limit_mm, what + "axis_u");
        check_floats(light.axis_v, -coordinate_limit_mm, coordinate_limit_mm, what + "axis_v");
        check_floats({&light.radius, 1}, 0, coordinate_limit_mm, what + "radius");
        check_floats({&light.cosine_outer, 1}, -1, 1, what + "cosine_outer");
        check_floats({&light.cosine_inner, 1}, light.cosine_outer, 1, what + "cosine_inner");
        if (light.type == ARHOST_LIGHT_DIRECTIONAL && light.falloff != ARHOST_FALLOFF_NONE)
            fail(what + "a directional light cannot have a falloff");
    }

    // Returns the name of a geometry for messages: "geometry 3 (object 1 'bunny')".
    std::string geometry_name(std::size_t geometry) const {
        std::string text = "geometry " + std::to_string(geometry);
        for (std::size_t i = 0; i < objects_.size(); ++i)
            if (objects_[i].geometry == geometry)
                return text + " (" + name_of(i) + ")";
        return text;
    }

    Box check_geometry(std::size_t i) {
        const arhost_geometry &geometry = geometries_[i];
        try {
            if (geometry.reserved != 0)
                fail("a reserved field is not 0");
            switch (geometry.type) {
            case ARHOST_GEOMETRY_TRIANGLES:
                check_deformation(geometry, i);
                return check_triangles(geometry);
            case ARHOST_GEOMETRY_SPHERES:
                return check_spheres(geometry);
            default:
                fail("its type is unknown");
            }
        } catch (const Invalid &inner) {
            fail(geometry_name(i) + ": " + inner.text);
        }
    }

    // A geometry must have joints if, and only if, its object has a skin; likewise morph targets.
    void check_deformation(const arhost_geometry &geometry, std::size_t i) {
        const std::uint64_t vertices = geometry.positions.count;
        const auto joints = view<glm::u16vec4>(geometry.joints, "the buffer of joints");
        const auto weights = view<glm::vec4>(geometry.weights, "the buffer of weights");
        const auto morph_positions = view<glm::vec3>(geometry.morph_positions, "the buffer of morph_positions");
        const auto morph_normals = view<glm::vec3>(geometry.morph_normals, "the buffer of morph_normals");
        const arhost_object *object = deformers_[i] == ARHOST_NONE ? nullptr : &objects_[deformers_[i]];
        const bool skinned = object && object->skin != ARHOST_NONE;
        if ((skinned ? joints.empty() || vertices == 0 || joints.size() % vertices != 0 : !joints.empty()) ||
            weights.size() != joints.size())
            fail("it has " + std::to_string(joints.size()) + " joints and " + std::to_string(weights.size()) +
                 " weights for " + std::to_string(vertices) + " vertices " + (skinned ? "with" : "without") +
                 " a skin");
        const std::uint64_t targets =
            object && object->node != ARHOST_NONE ? nodes_[object->node].morph_weights.count : 0;
        if (object && !skinned && targets == 0)
            fail("it deforms, but has neither a skin nor morph targets");
        if (morph_positions.size() != targets * vertices || (targets > 0 && !object->deforms))
            fail("it has " + std::to_string(morph_positions.size()) + " morph_positions for " +
                 std::to_string(targets) + " targets and " + std::to_string(vertices) + " vertices");
        if (!morph_normals.empty() && (morph_normals.size() != morph_positions.size() || geometry.normals.count == 0))
            fail("it has " + std::to_string(morph_normals.size()) + " morph_normals for " +
                 std::to_string(morph_positions.size()) + " morph_positions and " +
                 std::to_string(geometry.normals.count) + " normals; morph_normals need normals");
        if (object && geometry.tangents.count > 0)
            fail("it deforms, but has tangents");
        check_coordinates(floats_of(morph_positions), 3, "morph position");
        check_coordinates(floats_of(morph_normals), 3, "morph normal");
        if (!skinned)
            return;
        const std::uint32_t joint_count = skins_[object->skin].joints.count;
        for (std::size_t v = 0; v < joints.size(); ++v) {
            const glm::u16vec4 &j = joints[v];
            if (std::max({j.x, j.y, j.z, j.w}) >= joint_count)
                fail("vertex " + std::to_string(v % vertices) + " refers to joint " +
                     std::to_string(std::max({j.x, j.y, j.z, j.w})) + ", but the skin has only " +
                     std::to_string(joint_count) + " joints");
        }
        for (std::size_t v = 0; v < vertices; ++v) {
            float sum = 0, least = 0;
            for (std::size_t set = v; set < weights.size(); set += vertices) {
                const glm::vec4 &w = weights[set];
                sum += w.x + w.y + w.z + w.w;
                least = std::min({least, w.x, w.y, w.z, w.w});
            }
            if (!(least >= 0 && within(sum, 1 - tolerance, 1 + tolerance)))
                fail("vertex " + std::to_string(v) +
                     " has invalid joint weights; they must not be negative, and their sum must be 1");
        }
    }

    static void check_coordinates(std::span<const float> values, std::size_t components, const char *what) {
        if (all_within_limit(values))
            return;
        for (std::size_t i = 0; i < values.size(); ++i)
            if (!within(values[i], -coordinate_limit_mm, coordinate_limit_mm))
                fail(std::string(what) + " " + std::to_string(i / components) + " has the invalid coordinate " +
                     number(values[i]));
    }

    Box check_triangles(const arhost_geometry &geometry) {
        const auto positions = view<glm::vec3>(geometry.positions, "the buffer of positions");
        const auto normals = view<glm::vec3>(geometry.normals, "the buffer of normals");
        const auto texcoords = view<glm::vec2>(geometry.texcoords, "the buffer of texcoords");
        const auto triangles = view<glm::uvec3>(geometry.indices, "the buffer of indices");
        if (triangles.empty())
            fail("it has no triangles");
        if (!normals.empty() && normals.size() != positions.size())
            fail("it has " + std::to_string(normals.size()) + " normals for " + std::to_string(positions.size()) +
                 " vertices");
        if (!texcoords.empty() && (positions.empty() || texcoords.size() % positions.size() != 0))
            fail("it has " + std::to_string(texcoords.size()) + " texcoords for " + std::to_string(positions.size()) +
                 " vertices");
        const auto colours = view<glm::u16vec4>(geometry.colours, "the buffer of colours");
        if (!colours.empty() && colours.size() != positions.size())
            fail("it has " + std::to_string(colours.size()) + " colours for " + std::to_string(positions.size()) +
                 " vertices");
        check_coordinates(floats_of(positions), 3, "vertex");
        check_coordinates(floats_of(texcoords), 2, "texcoord");
        const auto tangents = view<glm::vec4>(geometry.tangents, "the buffer of tangents");
        if (!tangents.empty() && (tangents.size() != positions.size() || normals.empty()))
            fail("it has " + std::to_string(tangents.size()) + " tangents for " + std::to_string(positions.size()) +
                 " vertices and " + std::to_string(normals.size()) + " normals; tangents need normals");
        for (const glm::vec4 &t : tangents)
            if (t != glm::vec4(0) && (!is_unit({&t.x, 3}) || std::abs(t.w) != 1))
                fail("tangent " + std::to_string(&t - tangents.data()) + " is neither 0 nor a unit vector and ±1");
        check_normals(normals);
        check_indices(triangles, positions.size());
        return box_of(positions);
    }

    static void check_normals(std::span<const glm::vec3> normals) {
        const auto is_unit = [](const glm::vec3 &n) {
            return std::abs(n.x * n.x + n.y * n.y + n.z * n.z - 1) <= 2 * tolerance;
        };
        bool all = true;
        for (const glm::vec3 &normal : normals)
            all &= is_unit(normal);
        if (!all)
            fail("normal " +
                 std::to_string(std::find_if_not(normals.begin(), normals.end(), is_unit) - normals.begin()) +
                 " is not of unit length");
    }

    static void check_indices(std::span<const glm::uvec3> triangles, std::size_t vertex_count) {
        std::uint32_t highest = 0;
        for (const std::uint32_t index : std::span(&triangles.front().x, triangles.size() * 3))
            highest = index > highest ? index : highest;
        if (highest < vertex_count)
            return;
        for (std::size_t i = 0; i < triangles.size(); ++i)
            if (const std::uint32_t index = std::max({triangles[i].x, triangles[i].y, triangles[i].z});
                index >= vertex_count)
                fail("triangle " + std::to_string(i) + " refers to vertex " + std::to_string(index) +
                     ", but the mesh has only " + std::to_string(vertex_count));
    }

    Box check_spheres(const arhost_geometry &geometry) {
        const auto spheres = view<glm::vec4>(geometry.positions, "the buffer of spheres");
        for (const arhost_buffer &other :
             {geometry.normals, geometry.texcoords, geometry.tangents, geometry.colours, geometry.indices,
              geometry.joints, geometry.weights, geometry.morph_positions, geometry.morph_normals})
            if (other.count != 0 || other.offset != 0 || other.stride != 0)
                fail("spheres cannot have normals, texcoords, tangents, colours, indices or deformation");
        if (spheres.empty())
            fail("it has no spheres");
        check_coordinates(floats_of(spheres), 4, "sphere");
        for (std::size_t i = 0; i < spheres.size(); ++i)
            if (!(spheres[i].w > 0))
                fail("sphere " + std::to_string(i) + " has the invalid radius " + number(spheres[i].w));
        return box_of(spheres);
    }

    Box box_of_object(std::size_t i, const std::vector<Box> &boxes) const {
        return transformed(objects_[i].world_from_object, boxes[objects_[i].geometry]);
    }

    // The bounding box of an object that deforms changes over time.
    void check_extent(std::size_t i, const std::vector<Box> &boxes) const {
        constexpr float limit = 4 * coordinate_limit_mm;
        const Box box = objects_[i].deforms ? Box{glm::vec3(0), glm::vec3(0)} : box_of_object(i, boxes);
        for (int axis = 0; axis < 3; ++axis)
            if (!within(box.min[axis], -limit, limit) || !within(box.max[axis], -limit, limit))
                fail(name_of(i) + " extends beyond " + number(limit) + " mm");
    }

    void check_bounds() const {
        check_floats(scene_->bounds_min, -4 * coordinate_limit_mm, 4 * coordinate_limit_mm, "bounds_min");
        check_floats(scene_->bounds_max, -4 * coordinate_limit_mm, 4 * coordinate_limit_mm, "bounds_max");
        for (int axis = 0; axis < 3; ++axis)
            if (scene_->bounds_min[axis] > scene_->bounds_max[axis])
                fail("bounds_min is above bounds_max");
    }

    void check_in_bounds(std::size_t i, const std::vector<Box> &boxes) const {
        if (objects_[i].deforms)
            return;
        const glm::vec3 low(scene_->bounds_min[0], scene_->bounds_min[1], scene_->bounds_min[2]);
        const glm::vec3 high(scene_->bounds_max[0], scene_->bounds_max[1], scene_->bounds_max[2]);
        const glm::vec3 margin = (high - low) * tolerance + glm::abs(low) * 1e-6f + glm::abs(high) * 1e-6f;
        const Box box = box_of_object(i, boxes);
        const glm::vec3 below = low - box.min - margin, above = box.max - high - margin;
        if (!(std::max({below.x, below.y, below.z, above.x, above.y, above.z}) <= 0))
            fail(name_of(i) + " is outside the scene's bounds");
    }

    std::span<const std::byte> arena_;
    const arhost_scene *scene_ = nullptr;
    std::uint64_t unused_bytes_ = 0; // bytes not used by any buffer yet
    std::span<const arhost_geometry> geometries_;
    std::span<const arhost_texel_image> images_;
    std::span<const arhost_texture> textures_;
    std::span<const arhost_material> materials_;
    std::span<const arhost_object> objects_;
    std::span<const arhost_light> lights_;
    std::span<const arhost_node> nodes_;
    std::span<const arhost_channel> channels_;
    std::span<const arhost_skin> skins_;
    std::span<const char> names_;
    std::span<const arhost_anchor> anchors_;
    std::vector<std::uint32_t> deformers_; // for each geometry: index of the object that deforms it, or ARHOST_NONE
    std::vector<std::uint32_t> uses_;      // for each geometry: number of objects that use it
    Table table_ = Table::scene;
    std::size_t index_ = 0;
};

} // namespace

std::optional<Fault> find_fault(std::span<const std::byte> arena) {
    Checker checker(arena);
    try {
        checker.run();
        return std::nullopt;
    } catch (const Invalid &found) {
        return Fault{found.text, checker.table(), checker.index()};
    }
}

std::string validate(std::span<const std::byte> arena) {
    const std::optional<Fault> fault = find_fault(arena);
    return fault ? fault->text : "";
}

} // namespace arhost::scene
