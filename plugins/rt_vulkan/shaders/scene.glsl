// SPDX-License-Identifier: Apache-2.0
//
// The buffers and constants of the shaders. Buffers have the same layout as in layout.hpp. Offsets are in elements, not
// bytes.

const uint NONE = 0xffffffffu;
#define INFINITY uintBitsToFloat(0x7f800000u)

// The values of these constants are defined in arhost/scene.h.
const uint DIFFUSE = 1u, SPECULAR = 2u, MIRROR = 3u, METAL = 4u, GLASS = 5u, METALLIC_ROUGHNESS = 6u,
           UNLIT = 7u;
const uint VIRTUAL = 1u, CATCHER = 2u, OCCLUDER = 3u;
const uint DIRECTIONAL_LIGHT = 2u, SPOT_LIGHT = 3u, RECTANGLE_LIGHT = 4u, SPHERE_LIGHT = 5u;
const uint FALLOFF_INVERSE_SQUARE = 2u;
const uint BROWN_DISTORTION = 2u, FISHEYE_DISTORTION = 3u; // arhost/camera.h
const uint TEXEL_SRGB8 = 1u, TEXEL_RGBA8 = 2u, TEXEL_RGBA32F = 3u;
const uint WRAP_CLAMP = 2u, WRAP_MIRROR = 3u;

// Bits of Object.mask and Ray.mask. A ray can hit an object only if their masks have a common bit.
const uint OPAQUE_MASK = 1u, GLASS_MASK = 2u, CATCHER_MASK = 4u, OCCLUDER_MASK = 8u, ALL_MASKS = 15u;
// Bit of Ray.mask: the ray comes from the eye, and only mirrors and glass have scattered it.
const uint OF_EYE = 16u;
// Bits of Object.flags.
const uint HAS_TRANSFORM = 1u, IS_SPHERES = 2u, HAS_HOLES = 4u, HIDES_BACK_FACES = 8u, BLENDS = 16u;

layout(constant_id = 0) const int stack_capacity = 1; // maximum number of pending rays per pixel
layout(constant_id = 1) const bool has_glass = true;
layout(constant_id = 2) const bool has_catchers = true;
layout(constant_id = 3) const bool has_holes = true; // whether any object rejects hits (layout.hpp)
layout(constant_id = 4) const uint ray_dimensions = 2u;
layout(constant_id = 5) const bool has_textures = true; // whether the scene has textures
layout(constant_id = 6) const bool has_area_lights = true;
layout(constant_id = 7) const bool may_have_video = true; // whether any image has a video
layout(constant_id = 8) const bool has_gloss = true; // path integrator: whether a catcher may mirror virtual objects
layout(constant_id = 9) const bool has_photons = true;    // whether any image has caustics of lamps
layout(constant_id = 10) const bool may_denoise = true;   // path integrator: whether any image is denoised
// Path integrator: whether any material has a clear coat, fibres, anisotropy, a thin film.
layout(constant_id = 11) const bool has_coat = true;
layout(constant_id = 12) const bool has_sheen = true;
layout(constant_id = 13) const bool is_anisotropic = true;
layout(constant_id = 14) const bool has_film = true;

struct Object {
    mat4x3 object_from_world;
    mat3 transform, normal_transform; // object to world, for directions and for normals
    uint material, role, mask, flags;
    uint root; // the root node of its mesh's BVH; without software BVHs, the mesh's first primitive
    uint first_index, first_normal, first_texcoord; // NONE if absent
    vec3 extent;                                    // result of object_extent() (raytracer_common/scene_geometry.hpp)
    // Light samples of the path integrator: their expected number per unit of the emissive mesh's area (1/mm²), or on a
    // ball; 0 if the object is not sampled as a light source.
    float emitter_density;
    uint first_colour, vertex_count, first_tangent, unused; // first_colour: in `indices`; NONE if absent
};

struct Material {
    vec3 ambient;
    uint model;
    vec3 diffuse;
    uint colour_texture;
    vec3 specular;
    float exponent;
    vec3 reflectivity;
    float alpha_cutoff;
    vec3 emission;
    float metallic;
    vec3 refraction;
    float roughness;
    vec3 extinction;
    float index;
    vec3 shadow_attenuation;
    float fresnel_exponent;
    vec3 cutoff_colour;
    float importance_cutoff;
    float fresnel_minimum, fresnel_maximum;
    uint reflection_depth, refraction_depth;
    uint metallic_roughness_texture, normal_texture, emission_texture, occlusion_texture;
    float opacity, normal_scale, occlusion_strength, specular_weight;
    uint specular_texture, specular_colour_texture, transmission_texture, thin_walled;
    float transmission, clearcoat, clearcoat_roughness, clearcoat_normal_scale;
    uint clearcoat_texture, clearcoat_roughness_texture, clearcoat_normal_texture, unused;
    vec3 sheen;
    float sheen_roughness;
    uint sheen_texture, sheen_roughness_texture, anisotropy_texture, iridescence_texture;
    vec2 anisotropy_direction;
    float anisotropy, iridescence;
    vec2 iridescence_thickness_nm;
    float iridescence_index;
    uint iridescence_thickness_texture;
};

struct Light {
    vec3 position;
    uint type;
    vec3 direction;
    uint falloff;
    vec3 intensity;
    float radius;
    vec3 axis_u;
    float cosine_inner;
    vec3 axis_v;
    float cosine_outer;
};

struct Texture {
    uint format, first_texel, wrap_u, wrap_v; // first_texel: in 32-bit words
    int width, height;
    uint is_nearest, texcoord_set;
    vec2 image_from_texcoord[3];
    uint level_count, unused;
};

// A node of a BVH. Inner nodes have count 0; their children are the nodes `first` and first + 1. A leaf contains
// `count` primitives starting at `first`; a leaf of the top-level BVH contains one object.
struct Node {
    vec3 low;
    uint first;
    vec3 high;
    uint count;
};

// A triangle or sphere. For a triangle abc: corner = a, edge_1 = a - b, edge_2 = c - a. For a sphere: corner = centre,
// edge_1.x = radius.
struct Primitive {
    vec3 corner;
    uint number; // index in its geometry
    vec3 edge_1;
    float unused;
    vec3 edge_2;
    float unused_2;
};

// A grid into which photons are sorted (raytracer_common/photon_map.hpp). The first two members are indices into
// `photon_words`.
struct PhotonGrid {
    uint first_number, first_start;
    uint bucket_mask; // number of buckets − 1
    float radius;
};

layout(std140, set = 0, binding = 0) uniform FrameBlock {
    vec3 eye;
    uint object_count;
    mat3 world_from_camera;
    uint width, height, sample_count, first_sample;
    uint light_samples, light_count, max_depth, single_path;
    vec3 ambient;
    uint coloured_shadows;
    vec3 background;
    uint accumulates;
    vec3 environment_intensity; // multiplies the texels
    uint environment_texture;
    mat3 environment_from_world;
    uint environment_rows, environment_columns; // indices into `tables`
    float shadow_alpha_opaque, shadow_alpha_translucent;
    uint has_slopes;
    // With denoising:
    uint denoises;
    uint seen_moves;   // whether what curved mirrors and glass show may move over them
    float pixel_angle; // width of a pixel in the middle of the image, in units of its distance
    vec4 samples[256]; // x, y: offset from the pixel's centre in px, −½ to ½

    // The path integrator.
    vec4 spheres[16]; // centre and radius of spheres that contain all virtual objects, mm
    uint sphere_count, source_count;
    uint first_source, first_cumulative; // indices into `tables`
    float environment_chance;            // that a light sample chooses the environment or background
    float max_radiance;                  // bound of each sample
    uint irradiance_texture; // irradiance of the environment's texels, divided by π, of surfaces that face a direction
    uint first_random;       // offset into the random sequences
    uint is_linear, has_several_real; // has_several_real: several catchers or occluders
    // The video under the overlay, undistorted coordinates to pixels as in arhost/camera.h.
    uint has_video, video_texture;
    vec2 focal_length, principal_point;
    vec4 lens[3]; // the distortion's coefficients
    uint distortion;
    float max_radius_squared; // of (x/z, y/z) in the picture; the lens model is not valid beyond
    float least_irradiance;   // bound of a catcher's light without virtual objects; 0: catchers do not change
    uint blends_codes;        // whether straight images are blended in sRGB
    // Photons.
    vec3 photon_low;         // corner of cell (0, 0, 0) of all grids, mm
    uint photon_level_count; // 0: no photon has arrived
    PhotonGrid photon_grids[6];
    vec4 targets[16]; // centre and radius of spheres that contain all mirrors and glass, mm
    uint target_count;
    uint first_target, first_target_chance; // indices into `tables`: cumulative and other chances (PhotonTargets)
    float scene_extent;                     // mm: length of the diagonal of the scene's bounds
    uint photon_count, first_photon;        // of this frame; offset into the random sequence
    uint shown_parts;                       // of the change of a catcher's light: bits of path_catcher.glsl
    float ray_angle; // width of a sample from the eye, in units of its distance; 0: textures are not filtered
}
frame;

layout(push_constant) uniform Band {
    uint first_row;
}
band;

layout(std430, set = 0, binding = 1) readonly buffer Objects {
    Object objects[];
};
layout(std430, set = 0, binding = 2) readonly buffer Materials {
    Material materials[];
};
layout(std430, set = 0, binding = 3) readonly buffer Lights {
    Light lights[];
};
layout(std430, set = 0, binding = 4) readonly buffer Nodes {
    Node nodes[];
};
layout(std430, set = 0, binding = 5) readonly buffer Primitives {
    Primitive primitives[];
};
layout(std430, set = 0, binding = 6) readonly buffer Indices {
    uint indices[]; // of triangles, and colours of vertices: two words each, 16 bits per channel
};
layout(std430, set = 0, binding = 7) readonly buffer Attributes {
    float attributes[]; // vertex normals and texture coordinates
};
layout(std430, set = 0, binding = 8) readonly buffer Textures {
    Texture textures[];
};
layout(std430, set = 0, binding = 9) readonly buffer Texels {
    uint texels[];
};
layout(std430, set = 0, binding = 10) readonly buffer Tables {
    // sRGB encoding, sRGB decoding, the environment's cumulative sums, the light sources and their cumulative chances,
    // the chances of the targets of photons
    uint tables[];
};
layout(std430, set = 0, binding = 11) readonly buffer Rays {
    float rays[]; // result of make_ray_table() (view.hpp)
};
// Sums over the samples of a pixel.
struct Sums {
    vec3 light;       // linear radiance of the virtual objects
    float coverage;   // number of samples that hit a virtual object
    // The parts of `irradiance` that virtual objects hide. With coloured shadows, there is one part per colour channel.
    // Otherwise, the values are the part that opaque objects hide, the part that translucent objects hide, and 0.
    // Path integrator: the change of the catcher's light relative to its light without virtual objects.
    vec3 hidden;
    float irradiance; // irradiance of the catcher without shadows
    vec3 covered;     // path integrator: the light that the catcher mirrors only without virtual objects
    float caught;     // number of samples that hit a catcher
    vec3 matt;        // path integrator: the diffuse light of glossy catchers without virtual objects
};
layout(std430, set = 0, binding = 12) buffer History {
    Sums history[]; // sums of all earlier samples
};
layout(std430, set = 0, binding = 13) buffer Image {
    uint image_pixels[]; // with denoising: the planes of layers.glsl
};
layout(std430, set = 0, binding = 14) coherent buffer Drawn {
    int drawn_x0, drawn_y0, drawn_x1, drawn_y1; // bounding rectangle of the pixels with non-zero alpha
};

// Indices of the sRGB encoding and decoding tables in `tables`.
const uint FIRST_SRGB_CELL = 0u, FIRST_LIGHT_OF_CODE = 1665u;
