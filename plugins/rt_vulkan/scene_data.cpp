// SPDX-License-Identifier: Apache-2.0
#include "scene_data.hpp"

#include "raytracer_common/scene_geometry.hpp"

#include <arhost/shading/scalar.hpp>
#include <arhost/shading/srgb8.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

namespace rt_vulkan {
namespace {

using arhost::Failure;
using arhost::raytracer_common::bytes;
using arhost::raytracer_common::elements;
using arhost::raytracer_common::image_of;
using arhost::raytracer_common::is_identity;
using arhost::raytracer_common::is_specular;
using arhost::raytracer_common::LightSources;
using arhost::raytracer_common::object_extent;
using arhost::raytracer_common::PlacedObject;
using arhost::raytracer_common::quantized_alpha;
using arhost::raytracer_common::source_rows;
using arhost::raytracer_common::transform_box;

// A BVH is rebuilt if its SAH cost divided by its cost after the last build exceeds this value. Above it, a rebuild
// saves more tracing time than it costs.
constexpr double max_degradation = 1.3;
constexpr std::uint32_t max_leaf_size = 4;

template <std::size_t count> void copy(const float (&from)[count], float (&to)[count]) {
    std::copy_n(from, count, to);
}

Material material_of(const arhost_material &from, bool is_path) {
    Material to{};
    to.model = static_cast<std::uint32_t>(from.model);
    copy(from.ambient, to.ambient);
    copy(from.diffuse, to.diffuse);
    copy(from.specular, to.specular);
    copy(from.reflectivity, to.reflectivity);
    copy(from.emission, to.emission);
    copy(from.refraction, to.refraction);
    copy(from.extinction, to.extinction);
    copy(from.shadow_attenuation, to.shadow_attenuation);
    copy(from.cutoff_colour, to.cutoff_colour);
    to.colour_texture = from.colour_texture;
    to.exponent = from.exponent;
    to.alpha_cutoff = from.blends && !is_path ? 0.5f : from.alpha_cutoff; // the Whitted integrator does not blend
    to.metallic = from.metallic;
    to.roughness = from.roughness;
    to.index = from.index;
    to.fresnel_exponent = from.fresnel_exponent;
    to.fresnel_minimum = from.fresnel_minimum;
    to.fresnel_maximum = from.fresnel_maximum;
    to.importance_cutoff = from.importance_cutoff;
    to.reflection_depth = from.reflection_depth;
    to.refraction_depth = from.refraction_depth;
    to.metallic_roughness_texture = from.metallic_roughness_texture;
    to.normal_texture = from.normal_texture;
    to.emission_texture = from.emission_texture;
    to.occlusion_texture = from.occlusion_texture;
    to.opacity = from.opacity;
    to.normal_scale = from.normal_scale;
    to.occlusion_strength = from.occlusion_strength;
    to.specular_weight = from.specular_weight;
    to.specular_texture = from.specular_texture;
    to.specular_colour_texture = from.specular_colour_texture;
    to.transmission_texture = from.transmission_texture;
    to.thin_walled = from.thin_walled;
    to.transmission = from.transmission;
    to.clearcoat = from.clearcoat;
    to.clearcoat_roughness = from.clearcoat_roughness;
    to.clearcoat_normal_scale = from.clearcoat_normal_scale;
    to.clearcoat_texture = from.clearcoat_texture;
    to.clearcoat_roughness_texture = from.clearcoat_roughness_texture;
    to.clearcoat_normal_texture = from.clearcoat_normal_texture;
    copy(from.sheen, to.sheen);
    to.sheen_roughness = from.sheen_roughness;
    to.sheen_texture = from.sheen_texture;
    to.sheen_roughness_texture = from.sheen_roughness_texture;
    to.anisotropy = from.anisotropy;
    copy(from.anisotropy_direction, to.anisotropy_direction);
    to.anisotropy_texture = from.anisotropy_texture;
    to.iridescence = from.iridescence;
    to.iridescence_index = from.iridescence_index;
    copy(from.iridescence_thickness_nm, to.iridescence_thickness_nm);
    to.iridescence_texture = from.iridescence_texture;
    to.iridescence_thickness_texture = from.iridescence_thickness_texture;
    if (from.model == ARHOST_MATERIAL_METALLIC_ROUGHNESS) // the reflectance of non-metals at normal incidence
        for (float &channel : to.specular)
            channel *= arhost::shading::normal_reflectance(from.index);
    return to;
}

Light light_of(const arhost_light &from) {
    Light to{};
    to.type = static_cast<std::uint32_t>(from.type);
    to.falloff = static_cast<std::uint32_t>(from.falloff);
    copy(from.position, to.position);
    copy(from.direction, to.direction);
    copy(from.intensity, to.intensity);
    copy(from.axis_u, to.axis_u);
    copy(from.axis_v, to.axis_v);
    to.radius = from.radius;
    to.cosine_inner = from.cosine_inner;
    to.cosine_outer = from.cosine_outer;
    return to;
}

// Returns the bounding box, in world space, of a box in object space. Adds a margin for the rounding errors of rays
// that are transformed to object space.
Box in_world(const Box &local, const float *m) {
    Box world;
    float extent[3];
    object_extent(local.low, local.high, m, extent);
    double low[3], high[3];
    transform_box(local.low, local.high, m, low, high);
    for (int row = 0; row < 3; ++row) {
        const double margin = 2e-6 * (std::abs(double{m[9 + row]}) + extent[row]);
        world.low[row] = static_cast<float>(low[row] - margin);
        world.high[row] = static_cast<float>(high[row] + margin);
    }
    return world;
}

Bytes bytes_of(const auto &vector) {
    return std::as_bytes(std::span(vector));
}

// Returns a BVH without nodes, with the primitives in the geometry's order, which acceleration structures use.
Bvh unordered(std::size_t count) {
    Bvh bvh;
    bvh.order.resize(count);
    std::iota(bvh.order.begin(), bvh.order.end(), 0u);
    return bvh;
}

} // namespace

SceneData::SceneData(const arhost_raytracer_setup &setup, bool has_bvhs, const arhost::Host &host)
    : arena_(*setup.scene), has_bvhs_(has_bvhs), host_(host) {
    const arhost_scene &arena = arena_;
    for (const arhost_material &material : elements<arhost_material>(arena, arena.materials))
        materials_.push_back(material_of(material, arena.integrator == ARHOST_INTEGRATOR_PATH));
    for (const arhost_light &light : elements<arhost_light>(arena, arena.lights)) {
        lights_.push_back(light_of(light));
        has_area_lights_ |= light.type == ARHOST_LIGHT_RECTANGLE || light.type == ARHOST_LIGHT_SPHERE ||
                            (light.type == ARHOST_LIGHT_SPOT && light.radius > 0);
    }
    add_textures();
    add_tables();
    if (arena.integrator == ARHOST_INTEGRATOR_PATH)
        add_path_textures(setup);

    check_cancelled();
    const auto geometries = elements<arhost_geometry>(arena, arena.geometries);
    const auto objects = elements<arhost_object>(arena, arena.objects);
    for (const arhost_object &object : objects)
        anything_moves_ |= object.moves || object.deforms;
    if (has_bvhs)
        nodes_.resize(std::max<std::size_t>(1, 2 * objects.size())); // space for the top-level BVH
    for (const arhost_object &object : objects)
        if (object.deforms)
            add_normals(mesh_of(object.geometry, true), geometries[object.geometry]);
    moving_nodes_ = nodes_.size();
    moving_primitives_ = primitives_.size();
    moving_attributes_ = attributes_.size();
    for (auto &[geometry, mesh] : meshes_) {
        add_texcoords(mesh, geometries[geometry]);
        add_tangents(mesh, geometries[geometry]);
        add_colours(mesh, geometries[geometry]);
    }
    for (const arhost_object &object : objects) {
        if (!meshes_.contains(object.geometry)) {
            check_cancelled();
            Mesh &mesh = mesh_of(object.geometry, false);
            add_normals(mesh, geometries[object.geometry]);
            add_texcoords(mesh, geometries[object.geometry]);
            add_tangents(mesh, geometries[object.geometry]);
            add_colours(mesh, geometries[object.geometry]);
        }
        add_object(object, meshes_.at(object.geometry));
    }
    build_top_level();
    if (arena.integrator == ARHOST_INTEGRATOR_PATH)
        add_light_sources();
}

void SceneData::check_cancelled() const {
    if (host_.cancelled())
        throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled while preparing the scene");
    host_.progress(-1, "preparing the scene");
}

std::vector<Box> boxes_of(const arhost_scene &arena, const arhost_geometry &geometry, Points points) {
    std::vector<Box> boxes;
    if (geometry.type == ARHOST_GEOMETRY_SPHERES) {
        boxes.reserve(geometry.positions.count);
        for (std::uint32_t i = 0; i < geometry.positions.count; ++i) {
            float sphere[4];
            std::memcpy(sphere, points.first + std::size_t{points.stride} * i, sizeof sphere);
            Box box;
            for (int axis = 0; axis < 3; ++axis) {
                const float margin = 1e-6f * (std::abs(sphere[axis]) + sphere[3]);
                box.low[axis] = sphere[axis] - sphere[3] - margin;
                box.high[axis] = sphere[axis] + sphere[3] + margin;
            }
            boxes.push_back(box);
        }
        return boxes;
    }
    boxes.reserve(geometry.indices.count);
    const std::byte *corners = bytes(arena) + geometry.indices.offset;
    for (std::uint32_t i = 0; i < geometry.indices.count; ++i, corners += geometry.indices.stride) {
        std::uint32_t corner[3];
        std::memcpy(corner, corners, sizeof corner);
        Box box = empty_box();
        for (const std::uint32_t vertex : corner) {
            float position[3];
            std::memcpy(position, points.first + std::size_t{points.stride} * vertex, sizeof position);
            include(box, position);
        }
        boxes.push_back(box);
    }
    return boxes;
}

SceneData::Mesh &SceneData::mesh_of(std::uint32_t number, bool deforms) {
    const arhost_geometry &geometry = elements<arhost_geometry>(arena_, arena_.geometries)[number];
    const Points points{bytes(arena_) + geometry.positions.offset, geometry.positions.stride};
    const std::vector<Box> boxes = boxes_of(arena_, geometry, points);
    Mesh &mesh = meshes_[number];
    mesh.first_primitive = static_cast<std::uint32_t>(primitives_.size());
    mesh.root = has_bvhs_ ? static_cast<std::uint32_t>(nodes_.size()) : mesh.first_primitive;
    mesh.first_index = static_cast<std::uint32_t>(indices_.size());
    mesh.first_normal = mesh.first_texcoord = mesh.first_tangent = mesh.first_colour = ARHOST_NONE;
    mesh.local = empty_box();
    mesh.is_empty = boxes.empty();
    if (boxes.empty())
        return mesh;
    for (const Box &box : boxes)
        include(mesh.local, box);
    if (has_bvhs_) {
        mesh.bvh = build_bvh(boxes, max_leaf_size, max_mesh_depth, [this] { check_cancelled(); });
        mesh.built_cost = sah_cost(mesh.bvh);
        nodes_.resize(nodes_.size() + (deforms ? 2 * boxes.size() : mesh.bvh.nodes.size()));
    } else {
        mesh.bvh = unordered(boxes.size());
    }
    primitives_.resize(primitives_.size() + boxes.size());
    write_bvh(mesh, geometry, points);
    if (!deforms)
        mesh.bvh = {};
    const std::byte *corners = bytes(arena_) + geometry.indices.offset;
    for (std::uint32_t i = 0; i < geometry.indices.count; ++i, corners += geometry.indices.stride) {
        std::uint32_t corner[3];
        std::memcpy(corner, corners, sizeof corner);
        indices_.insert(indices_.end(), corner, corner + 3);
    }
    return mesh;
}

// Appends a buffer of elements of `size` floats to the attributes. Returns the index of the first float, or
// ARHOST_NONE if the buffer is absent.
template <std::size_t size> std::uint32_t SceneData::add_attribute(const arhost_buffer &buffer) {
    if (buffer.count == 0)
        return ARHOST_NONE;
    const auto first = static_cast<std::uint32_t>(attributes_.size());
    for (std::uint32_t i = 0; i < buffer.count; ++i) {
        float element[size];
        std::memcpy(element, bytes(arena_) + buffer.offset + std::size_t{buffer.stride} * i, sizeof element);
        attributes_.insert(attributes_.end(), element, element + size);
    }
    return first;
}

void SceneData::add_normals(Mesh &mesh, const arhost_geometry &geometry) {
    mesh.first_normal = add_attribute<3>(geometry.normals);
}

void SceneData::add_texcoords(Mesh &mesh, const arhost_geometry &geometry) {
    mesh.first_texcoord = add_attribute<2>(geometry.texcoords);
}

void SceneData::add_tangents(Mesh &mesh, const arhost_geometry &geometry) {
    mesh.first_tangent = add_attribute<4>(geometry.tangents);
}

void SceneData::add_colours(Mesh &mesh, const arhost_geometry &geometry) {
    if (geometry.colours.count == 0)
        return;
    mesh.first_colour = static_cast<std::uint32_t>(indices_.size());
    for (std::uint32_t i = 0; i < geometry.colours.count; ++i) {
        std::uint32_t words[2];
        std::memcpy(words, bytes(arena_) + geometry.colours.offset + std::size_t{geometry.colours.stride} * i,
                    sizeof words);
        indices_.insert(indices_.end(), words, words + 2);
    }
}

// Writes a mesh's nodes, and its primitives in the order of the leaves.
void SceneData::write_bvh(const Mesh &mesh, const arhost_geometry &geometry, Points points) {
    for (std::size_t i = 0; i < mesh.bvh.nodes.size(); ++i) {
        Node node = mesh.bvh.nodes[i];
        node.first += node.count ? mesh.first_primitive : mesh.root;
        nodes_[mesh.root + i] = node;
    }
    const auto position = [&](std::uint32_t vertex) {
        std::array<float, 3> p;
        std::memcpy(p.data(), points.first + std::size_t{points.stride} * vertex, sizeof p);
        return p;
    };
    for (std::size_t i = 0; i < mesh.bvh.order.size(); ++i) {
        const std::uint32_t number = mesh.bvh.order[i];
        Primitive primitive{};
        primitive.number = number;
        if (geometry.type == ARHOST_GEOMETRY_SPHERES) {
            std::memcpy(primitive.corner, points.first + std::size_t{points.stride} * number, 12);
            std::memcpy(primitive.edge_1, points.first + std::size_t{points.stride} * number + 12, 4);
        } else {
            std::uint32_t corner[3];
            std::memcpy(corner,
                        bytes(arena_) + geometry.indices.offset + std::size_t{geometry.indices.stride} * number,
                        sizeof corner);
            const auto a = position(corner[0]), b = position(corner[1]), c = position(corner[2]);
            for (std::size_t axis = 0; axis < 3; ++axis) {
                primitive.corner[axis] = a[axis];
                primitive.edge_1[axis] = a[axis] - b[axis];
                primitive.edge_2[axis] = c[axis] - a[axis];
            }
        }
        primitives_[mesh.first_primitive + i] = primitive;
    }
}

std::uint32_t SceneData::mask_of(const arhost_object &object) const {
    switch (object.role) {
    case ARHOST_ROLE_CATCHER:
        return catcher_mask;
    case ARHOST_ROLE_OCCLUDER:
        return occluder_mask;
    default:
        return elements<arhost_material>(arena_, arena_.materials)[object.material].model == ARHOST_MATERIAL_GLASS
                   ? glass_mask
                   : opaque_mask;
    }
}

void SceneData::add_object(const arhost_object &from, const Mesh &mesh) {
    const arhost_material &material = elements<arhost_material>(arena_, arena_.materials)[from.material];
    const arhost_geometry &geometry = elements<arhost_geometry>(arena_, arena_.geometries)[from.geometry];
    const bool is_glass = material.model == ARHOST_MATERIAL_GLASS;
    Object object{};
    object.material = from.material;
    object.role = static_cast<std::uint32_t>(from.role);
    object.mask = mask_of(from);
    object.root = mesh.root;
    object.first_index = mesh.first_index;
    object.first_normal = mesh.first_normal;
    object.first_texcoord = mesh.first_texcoord;
    object.first_tangent = mesh.first_tangent;
    object.first_colour = mesh.first_colour;
    object.vertex_count = geometry.positions.count;
    if (geometry.type == ARHOST_GEOMETRY_SPHERES)
        object.flags |= is_spheres;
    const bool is_path = arena_.integrator == ARHOST_INTEGRATOR_PATH,
               is_mesh = geometry.type == ARHOST_GEOMETRY_TRIANGLES;
    if (is_mesh && !is_glass && material.model != ARHOST_MATERIAL_MIRROR) {
        if (materials_[from.material].alpha_cutoff > 0)
            object.flags |= rt_vulkan::has_holes;
        if (material.blends && is_path)
            object.flags |= rt_vulkan::blends;
    }
    if (is_mesh && from.hides_back_faces)
        object.flags |= hides_back_faces;
    if (from.moves || !is_identity(from.world_from_object))
        object.flags |= has_transform;
    set_transform(object, mesh, from.world_from_object);
    has_glass_ |= is_glass || (is_path && material.transmission > 0);
    has_coat_ |= is_path && material.clearcoat > 0;
    has_sheen_ |= is_path && std::max({material.sheen[0], material.sheen[1], material.sheen[2]}) > 0;
    is_anisotropic_ |= is_path && material.anisotropy > 0;
    has_film_ |= is_path && material.iridescence > 0;
    blends_ |= (object.flags & rt_vulkan::blends) != 0;
    has_specular_ |= from.role == ARHOST_ROLE_VIRTUAL && (is_specular(material) || material.blends);
    has_catchers_ |= from.role == ARHOST_ROLE_CATCHER;
    has_gloss_ |= from.role == ARHOST_ROLE_CATCHER && material.model == ARHOST_MATERIAL_METALLIC_ROUGHNESS;
    has_several_real_ |= from.role != ARHOST_ROLE_VIRTUAL && has_real_;
    has_real_ |= from.role != ARHOST_ROLE_VIRTUAL;
    has_holes_ |= (object.flags & rejects_hits) != 0;
    objects_.push_back(object);
    solid_objects_ += !mesh.is_empty;
    std::copy_n(from.world_from_object, 12, transforms_.emplace_back().begin());
}

void SceneData::set_transform(Object &object, const Mesh &mesh, const float *m) {
    object_extent(mesh.local.low, mesh.local.high, m, object.extent);
    const arhost::raytracer_common::Cofactors cofactors(m);
    float normal_transform[9];
    cofactors.write_normal_transform(normal_transform);
    for (int i = 0; i < 3; ++i) {
        std::copy_n(m + std::ptrdiff_t{3} * i, 3, object.transform[i]);
        std::copy_n(normal_transform + std::ptrdiff_t{3} * i, 3, object.normal_transform[i]);
        double translation = 0;
        for (int j = 0; j < 3; ++j) {
            const double inverse = cofactors.values[3 * i + j] / cofactors.determinant;
            object.object_from_world[j][i] = static_cast<float>(inverse);
            translation -= inverse * m[9 + j];
        }
        object.object_from_world[3][i] = static_cast<float>(translation);
    }
}

void SceneData::build_top_level() {
    if (!has_bvhs_)
        return;
    std::vector<Box> boxes;
    std::vector<std::uint32_t> numbers;
    const auto from = elements<arhost_object>(arena_, arena_.objects);
    for (std::uint32_t i = 0; i < from.size(); ++i) {
        const Mesh &mesh = meshes_.at(from[i].geometry);
        if (mesh.is_empty)
            continue;
        boxes.push_back(objects_[i].flags & has_transform ? in_world(mesh.local, transforms_[i].data()) : mesh.local);
        numbers.push_back(i);
    }
    if (boxes.empty())
        return;
    if (boxes.size() > std::size_t{1} << max_top_depth)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "the scene has more than " +
                                                           std::to_string(1 << max_top_depth) +
                                                           " objects; merge some of them, or use rt_embree");
    const Bvh bvh = build_bvh(boxes, 1, max_top_depth, [this] { check_cancelled(); });
    for (std::size_t i = 0; i < bvh.nodes.size(); ++i) {
        nodes_[i] = bvh.nodes[i];
        if (nodes_[i].count)
            nodes_[i].first = numbers[bvh.order[nodes_[i].first]];
    }
}

void SceneData::update(const arhost_motion &motion) {
    const auto from = elements<arhost_object>(arena_, arena_.objects);
    for (std::uint32_t i = 0; i < motion.moved_count; ++i) {
        const arhost_moved_object &moved = motion.moved[i];
        set_transform(objects_[moved.object], meshes_.at(from[moved.object].geometry), moved.world_from_object);
        std::copy_n(moved.world_from_object, 12, transforms_[moved.object].begin());
        objects_[moved.object].mask = moved.is_visible ? mask_of(from[moved.object]) : 0;
    }
    for (std::uint32_t i = 0; i < motion.deformed_count; ++i) {
        deform(motion.deformed[i]);
        objects_[motion.deformed[i].object].mask =
            motion.deformed[i].is_visible ? mask_of(from[motion.deformed[i].object]) : 0;
    }
    build_top_level();
    if (!light_sources_)
        return;
    for (std::uint32_t i = 0; i < motion.moved_count; ++i)
        placed_[motion.moved[i].object].is_visible = motion.moved[i].is_visible != 0;
    for (std::uint32_t i = 0; i < motion.deformed_count; ++i) {
        PlacedObject &placed = placed_[motion.deformed[i].object];
        placed.positions = motion.deformed[i].positions;
        placed.is_visible = motion.deformed[i].is_visible != 0;
    }
    place_lights();
}

void SceneData::deform(const arhost_deformed_geometry &deformed) {
    const arhost_object &object = elements<arhost_object>(arena_, arena_.objects)[deformed.object];
    const arhost_geometry &geometry = elements<arhost_geometry>(arena_, arena_.geometries)[object.geometry];
    Mesh &mesh = meshes_.at(object.geometry);
    if (mesh.is_empty)
        return;
    const Points points{reinterpret_cast<const std::byte *>(deformed.positions), 3 * sizeof(float)};
    mesh.local = empty_box();
    for (std::uint32_t i = 0; i < deformed.vertex_count; ++i)
        include(mesh.local, deformed.positions + std::size_t{3} * i);
    object_extent(mesh.local.low, mesh.local.high, transforms_[deformed.object].data(),
                  objects_[deformed.object].extent);
    if (has_bvhs_)
        refit_bvh(mesh, boxes_of(arena_, geometry, points));
    write_bvh(mesh, geometry, points);
    if (mesh.first_normal != ARHOST_NONE && deformed.normals)
        std::copy_n(deformed.normals, std::size_t{3} * geometry.normals.count,
                    attributes_.begin() + mesh.first_normal);
}

void SceneData::refit_bvh(Mesh &mesh, std::span<const Box> boxes) {
    refit(mesh.bvh, boxes);
    if (sah_cost(mesh.bvh) > max_degradation * mesh.built_cost) {
        mesh.bvh = build_bvh(boxes, max_leaf_size, max_mesh_depth, [this] { check_cancelled(); });
        mesh.built_cost = sah_cost(mesh.bvh);
        ++rebuilds_;
    }
}

void SceneData::add_textures() {
    std::vector<std::uint32_t> first_texels; // of the images, in 32-bit words
    std::size_t words = 0;
    for (const arhost_texel_image &image : elements<arhost_texel_image>(arena_, arena_.images)) {
        first_texels.push_back(static_cast<std::uint32_t>(words));
        const std::size_t size = std::size_t{image.texels.stride} * image.texels.count;
        texels_.emplace_back(bytes(arena_) + image.texels.offset, size);
        words += size / 4;
    }
    for (const arhost_texture &from : elements<arhost_texture>(arena_, arena_.textures)) {
        const arhost_texel_image &image = image_of(arena_, from);
        Texture to{};
        to.format = static_cast<std::uint32_t>(image.format);
        to.first_texel = first_texels[from.image];
        to.wrap_u = static_cast<std::uint32_t>(from.wrap_u);
        to.wrap_v = static_cast<std::uint32_t>(from.wrap_v);
        to.width = static_cast<std::int32_t>(image.width);
        to.height = static_cast<std::int32_t>(image.height);
        to.is_nearest = from.filter == ARHOST_TEXEL_FILTER_NEAREST;
        to.texcoord_set = from.texcoord_set;
        to.level_count = image.level_count;
        copy(from.image_from_texcoord, to.image_from_texcoord);
        textures_.push_back(to);
    }
}

// Adds the irradiance of the environment, and space for the video.
void SceneData::add_path_textures(const arhost_raytracer_setup &setup) {
    std::size_t size = 0; // bytes
    for (const Bytes &texels : texels_)
        size += texels.size();
    const auto add = [&](arhost_texel_format format, arhost_wrap wrap_u, std::uint32_t width, std::uint32_t height) {
        Texture to{};
        to.format = static_cast<std::uint32_t>(format);
        to.first_texel = static_cast<std::uint32_t>(size / 4);
        to.wrap_u = static_cast<std::uint32_t>(wrap_u);
        to.wrap_v = ARHOST_WRAP_CLAMP;
        to.width = static_cast<std::int32_t>(width);
        to.height = static_cast<std::int32_t>(height);
        to.level_count = 1;
        textures_.push_back(to);
        return static_cast<std::uint32_t>(textures_.size() - 1);
    };
    using namespace arhost::raytracer_common;
    irradiance_ = environment_irradiance(arena_);
    if (!irradiance_.empty()) {
        irradiance_texture_ = add(ARHOST_TEXEL_RGBA32F, ARHOST_WRAP_REPEAT, irradiance_width, irradiance_height);
        texels_.push_back(bytes_of(irradiance_));
        size += texels_.back().size();
    }
    if (setup.video_format) {
        video_texture_ = add(ARHOST_TEXEL_SRGB8, ARHOST_WRAP_CLAMP, setup.width, setup.height);
        video_offset_ = size;
        video_size_ = std::size_t{4} * setup.width * setup.height;
    }
}

// Makes space for as many light sources as there can ever be, and adds those at the start.
void SceneData::add_light_sources() {
    const auto objects = elements<arhost_object>(arena_, arena_.objects);
    const auto materials = elements<arhost_material>(arena_, arena_.materials);
    const auto geometries = elements<arhost_geometry>(arena_, arena_.geometries);
    max_sources_ = arena_.lights.count + 1; // with the environment
    for (std::size_t i = 0; i < objects.size(); ++i) {
        const arhost_object &object = objects[i];
        const float *emission = materials[object.material].emission;
        const arhost_geometry &geometry = geometries[object.geometry];
        if (emission[0] + emission[1] + emission[2] > 0)
            max_sources_ += geometry.type == ARHOST_GEOMETRY_SPHERES ? 1 : geometry.indices.count;
        placed_.push_back({transforms_[i].data(), nullptr, 3 * sizeof(float), true});
    }
    first_source_ = static_cast<std::uint32_t>(tables_.size());
    max_targets_ = static_cast<std::uint32_t>(arena_.lights.count * LightSources::max_spheres);
    sources_.resize(std::size_t{max_sources_} * (source_rows + 1) + std::size_t{2} * max_targets_);
    light_sources_.emplace(arena_);
    place_lights();
}

void SceneData::place_lights() {
    light_sources_->place(placed_);
    const auto write = [](std::span<const float> from, std::uint32_t *to) {
        std::ranges::transform(from, to, [](float number) { return std::bit_cast<std::uint32_t>(number); });
    };
    const auto spheres = light_sources_->specular_spheres();
    photon_targets_.set(arena_, {spheres.begin(), spheres.end()});
    write(light_sources_->records(), sources_.data());
    std::uint32_t *const cumulative = sources_.data() + std::size_t{max_sources_} * source_rows;
    write(light_sources_->cumulative(), cumulative);
    write(photon_targets_.cumulative(), cumulative + max_sources_);
    write(photon_targets_.chances(), cumulative + max_sources_ + max_targets_);
    for (std::size_t i = 0; i < objects_.size(); ++i)
        objects_[i].emitter_density = light_sources_->emitters()[i].density;
}

void SceneData::write_lights(Frame &frame) const {
    frame.sphere_count = static_cast<std::uint32_t>(light_sources_->spheres().size());
    for (std::size_t i = 0; i < frame.sphere_count; ++i)
        std::ranges::copy(light_sources_->spheres()[i], frame.spheres[i]);
    frame.source_count = static_cast<std::uint32_t>(light_sources_->cumulative().size());
    frame.first_source = first_source_;
    frame.first_cumulative = first_source_ + max_sources_ * source_rows;
    frame.environment_chance = light_sources_->environment_chance();
    frame.target_count = static_cast<std::uint32_t>(photon_targets_.spheres().size());
    for (std::size_t i = 0; i < frame.target_count; ++i)
        std::ranges::copy(photon_targets_.spheres()[i], frame.targets[i]);
    frame.first_target = frame.first_cumulative + max_sources_;
    frame.first_target_chance = frame.first_target + max_targets_;
}

// Fills `tables_` in the order that scene.glsl expects: sRGB encoding, sRGB decoding, environment.
void SceneData::add_tables() {
    const arhost::shading::Srgb8Table codes = arhost::shading::make_srgb8_table();
    tables_.assign(std::begin(codes.cells), std::end(codes.cells));
    const auto add = [&](float number) { tables_.push_back(std::bit_cast<std::uint32_t>(number)); };
    for (int code = 0; code < 256; ++code)
        add(static_cast<float>(arhost::shading::srgb_decode(code / 255.0)));
    if (arena_.environment.texture == ARHOST_NONE)
        return;
    environment_rows_ = static_cast<std::uint32_t>(tables_.size());
    for (const float sum : elements<float>(arena_, arena_.environment.rows))
        add(sum);
    environment_columns_ = static_cast<std::uint32_t>(tables_.size());
    for (const float sum : elements<float>(arena_, arena_.environment.columns))
        add(sum);
}

std::vector<Bytes> SceneData::parts(Binding binding) const {
    switch (binding) {
    case objects_binding:
        return {bytes_of(objects_)};
    case materials_binding:
        return {bytes_of(materials_)};
    case lights_binding:
        return {bytes_of(lights_)};
    case nodes_binding:
        return {bytes_of(nodes_)};
    case primitives_binding:
        return {bytes_of(primitives_)};
    case indices_binding:
        return {bytes_of(indices_)};
    case attributes_binding:
        return {bytes_of(attributes_)};
    case textures_binding:
        return {bytes_of(textures_)};
    case texels_binding:
        return texels_;
    case tables_binding:
        return {bytes_of(tables_), bytes_of(sources_)};
    default:
        return {};
    }
}

Bytes SceneData::moving_part(Binding binding) const {
    if (!anything_moves_)
        return {};
    switch (binding) {
    case objects_binding:
        return bytes_of(objects_);
    case nodes_binding:
        return bytes_of(nodes_).first(moving_nodes_ * sizeof(Node));
    case primitives_binding:
        return bytes_of(primitives_).first(moving_primitives_ * sizeof(Primitive));
    case attributes_binding:
        return bytes_of(attributes_).first(moving_attributes_ * sizeof(float));
    case tables_binding:
        return bytes_of(sources_);
    default:
        return {};
    }
}

void SceneData::release_static_parts() {
    const auto keep = [](auto &vector, std::size_t count) {
        vector.resize(count);
        vector.shrink_to_fit();
    };
    keep(nodes_, moving_nodes_);
    keep(primitives_, moving_primitives_);
    keep(attributes_, moving_attributes_);
    keep(indices_, 0);
    keep(texels_, 0);
    keep(tables_, 0);
    keep(irradiance_, 0);
}

Frame SceneData::frame() const {
    Frame frame{};
    frame.object_count = solid_objects_;
    frame.light_count = static_cast<std::uint32_t>(lights_.size());
    frame.max_depth = arena_.max_depth;
    copy(arena_.ambient, frame.ambient);
    copy(arena_.background, frame.background);
    frame.coloured_shadows = arena_.coloured_shadows != 0;
    frame.shadow_alpha_opaque = quantized_alpha(arena_.shadow_alpha_opaque);
    frame.shadow_alpha_translucent = quantized_alpha(arena_.shadow_alpha_translucent);
    const arhost_environment &environment = arena_.environment;
    frame.environment_texture = environment.texture;
    if (environment.texture != ARHOST_NONE) {
        for (int column = 0; column < 3; ++column)
            std::copy_n(environment.environment_from_world + std::size_t{3} * column, 3,
                        frame.environment_from_world[column]);
        frame.environment_rows = environment_rows_;
        frame.environment_columns = environment_columns_;
    }
    frame.has_several_real = has_several_real_;
    frame.irradiance_texture = irradiance_texture_;
    frame.video_texture = video_texture_;
    frame.scene_extent = arhost::raytracer_common::scene_extent(arena_);
    if (light_sources_)
        write_lights(frame);
    return frame;
}

} // namespace rt_vulkan
