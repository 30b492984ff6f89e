// SPDX-License-Identifier: Apache-2.0
//
// The contents of the shaders' buffers, with the same layout as in shaders/scene.glsl: std140 for Frame, std430 for
// all others. Offsets are in elements, not bytes.
#pragma once

#include "raytracer_common/light_sources.hpp"
#include "raytracer_common/photon_map.hpp"

#include <arhost/camera.h>
#include <arhost/scene.h>

#include <cstdint>

namespace rt_vulkan {

enum RoleMask : std::uint32_t { opaque_mask = 1, glass_mask = 2, catcher_mask = 4, occluder_mask = 8 };
enum ObjectFlag : std::uint32_t {
    has_transform = 1,
    is_spheres = 2,
    has_holes = 4,        // an alpha cutoff
    hides_back_faces = 8, // from the eye
    blends = 16,
    rejects_hits = has_holes | hides_back_faces | blends
};

struct Object {
    float object_from_world[4][4]; // columns
    float transform[3][4], normal_transform[3][4];
    std::uint32_t material, role, mask, flags;
    std::uint32_t root; // the root node of its mesh's BVH; without software BVHs, the mesh's first primitive
    std::uint32_t first_index, first_normal, first_texcoord;
    float extent[3], emitter_density;
    std::uint32_t first_colour, vertex_count, first_tangent, unused; // first_colour: in the buffer of indices
};

struct Material {
    float ambient[3];
    std::uint32_t model;
    float diffuse[3];
    std::uint32_t colour_texture;
    float specular[3];
    float exponent;
    float reflectivity[3];
    float alpha_cutoff;
    float emission[3];
    float metallic;
    float refraction[3];
    float roughness;
    float extinction[3];
    float index;
    float shadow_attenuation[3];
    float fresnel_exponent;
    float cutoff_colour[3];
    float importance_cutoff;
    float fresnel_minimum, fresnel_maximum;
    std::uint32_t reflection_depth, refraction_depth;
    std::uint32_t metallic_roughness_texture, normal_texture, emission_texture, occlusion_texture;
    float opacity, normal_scale, occlusion_strength, specular_weight;
    std::uint32_t specular_texture, specular_colour_texture, transmission_texture, thin_walled;
    float transmission, clearcoat, clearcoat_roughness, clearcoat_normal_scale;
    std::uint32_t clearcoat_texture, clearcoat_roughness_texture, clearcoat_normal_texture, unused;
    float sheen[3], sheen_roughness;
    std::uint32_t sheen_texture, sheen_roughness_texture, anisotropy_texture, iridescence_texture;
    float anisotropy_direction[2], anisotropy, iridescence;
    float iridescence_thickness_nm[2], iridescence_index;
    std::uint32_t iridescence_thickness_texture;
};

struct Light {
    float position[3];
    std::uint32_t type;
    float direction[3];
    std::uint32_t falloff;
    float intensity[3];
    float radius;
    float axis_u[3];
    float cosine_inner;
    float axis_v[3];
    float cosine_outer;
};

struct Texture {
    std::uint32_t format, first_texel, wrap_u, wrap_v; // first_texel: in 32-bit words
    std::int32_t width, height;
    std::uint32_t is_nearest, texcoord_set;
    float image_from_texcoord[6];
    std::uint32_t level_count, unused;
};

struct Node {
    float low[3];
    std::uint32_t first;
    float high[3];
    std::uint32_t
        count; // number of primitives or objects; 0 for an inner node: its children are nodes `first` and first + 1
};

struct Primitive {
    float corner[3];
    std::uint32_t number;
    float edge_1[3], unused;
    float edge_2[3], unused_2;
};

struct Sums {
    float light[3], coverage, hidden[3], irradiance, covered[3], caught, matt[3], unused;
};

inline constexpr std::uint32_t max_samples = 256; // per pixel and frame
inline constexpr std::uint32_t photons_per_row = 1024;

// A grid of raytracer_common/photon_map.hpp. The first two members are indices into the buffer of photons, which
// contains nine floats for each photon, and then the numbers and starts of the grids.
struct PhotonGrid {
    std::uint32_t first_number, first_start;
    std::uint32_t bucket_mask; // number of buckets − 1
    float radius;              // mm
};

struct Frame {
    float eye[3];
    std::uint32_t object_count;
    float world_from_camera[3][4]; // three columns
    std::uint32_t width, height, sample_count, first_sample;
    std::uint32_t light_samples, light_count, max_depth, single_path;
    float ambient[3];
    std::uint32_t coloured_shadows;
    float background[3];
    std::uint32_t accumulates;
    float environment_intensity[3];
    std::uint32_t environment_texture;
    float environment_from_world[3][4];
    std::uint32_t environment_rows, environment_columns;
    float shadow_alpha_opaque, shadow_alpha_translucent;
    std::uint32_t has_slopes, denoises, seen_moves;
    float pixel_angle;
    float samples[max_samples][4];
    // The path integrator.
    float spheres[arhost::raytracer_common::LightSources::max_spheres][4];
    std::uint32_t sphere_count, source_count, first_source, first_cumulative;
    float environment_chance, max_radiance;
    std::uint32_t irradiance_texture, first_random;
    std::uint32_t is_linear, has_several_real, has_video, video_texture;
    float focal_length[2], principal_point[2];
    float lens[12]; // all but the tilt, which is 0
    std::uint32_t distortion;
    float max_radius_squared, least_irradiance;
    std::uint32_t blends_codes;
    // Photons.
    float photon_low[3];
    std::uint32_t photon_level_count;
    PhotonGrid photon_grids[arhost::raytracer_common::PhotonMap::max_levels];
    float targets[arhost::raytracer_common::LightSources::max_spheres][4];
    std::uint32_t target_count, first_target, first_target_chance;
    float scene_extent;
    std::uint32_t photon_count, first_photon, shown_parts;
    float ray_angle;
};

static_assert(sizeof(Object) == 224 && sizeof(Material) == 304 && sizeof(Light) == 80 && sizeof(Texture) == 64 &&
              sizeof(Node) == 32 && sizeof(Primitive) == 48 && sizeof(Sums) == 64 &&
              sizeof(Frame) == 1008 + 16 * max_samples);

// The bindings of the descriptor set, from 0.
enum Binding : std::uint32_t {
    frame_binding,
    objects_binding,
    materials_binding,
    lights_binding,
    nodes_binding,
    primitives_binding,
    indices_binding,
    attributes_binding,
    textures_binding,
    texels_binding,
    tables_binding,
    rays_binding,
    history_binding,
    image_binding,
    drawn_binding,
    photons_binding,
    binding_count,                    // number of buffers
    top_level_binding = binding_count // the acceleration structure, on hardware paths
};

// The specialization constants of the shaders, in the order of their constant_ids.
struct Specialization {
    std::int32_t stack_capacity;
    std::uint32_t has_glass, has_catchers, has_holes; // 0 or 1
    std::uint32_t ray_dimensions, has_textures, has_area_lights, may_have_video, has_gloss, has_photons, may_denoise,
        has_coat, has_sheen, is_anisotropic, has_film;
};

} // namespace rt_vulkan
