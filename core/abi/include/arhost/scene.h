/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/scene.h: the scene as one flat, position-independent block of memory, the arena.
 *
 * The loader writes the arena. The host validates every offset, index and number in it once and makes it read-only;
 * ray tracers read it in place. Offsets are in bytes from the start of the arena and are multiples of 64. At least 16
 * readable bytes follow every buffer of vertices and attributes. Little-endian.
 *
 * World coordinates are right-handed, in millimetres. All numbers are finite. Coordinates have absolute values of at
 * most 1e9, or 4e9 once transformed to world coordinates. Scenes may have any extent, so choose tolerances relative
 * to the extent.
 */
#ifndef ARHOST_SCENE_H
#define ARHOST_SCENE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ARHOST_SCENE_MAGIC 0x435354534f485241ull /* "ARHOSTSC" */
#define ARHOST_SCENE_VERSION 6u
#define ARHOST_NONE 0xffffffffu

/* An array in the arena: `count` elements, `stride` bytes apart. If `count` is 0, the array is absent. */
typedef struct arhost_buffer {
    uint64_t offset;
    uint32_t count;
    uint32_t stride;
} arhost_buffer;

typedef int32_t arhost_axes;
enum {
    ARHOST_AXES_Z_UP = 1, /* x right, y back, z up: the axes of the marker */
    ARHOST_AXES_Y_UP = 2  /* x right, y up, z front */
};

typedef int32_t arhost_geometry_type;
enum {
    ARHOST_GEOMETRY_TRIANGLES = 1, /* positions and indices, optionally normals and texcoords */
    ARHOST_GEOMETRY_SPHERES = 2    /* positions only */
};

typedef struct arhost_geometry {
    arhost_geometry_type type;
    uint32_t reserved;
    arhost_buffer positions; /* triangles: 3 floats per vertex; spheres: 4 floats each, centre and radius. In object
                                space, mm; a skinned mesh is in its bind pose */
    arhost_buffer normals;   /* 3 floats per vertex, unit length, for smooth shading; absent: flat shading. Smooth
                                facets do not shadow themselves where the interpolated normal faces the light */
    /* Texture coordinates: 2 floats per vertex; (0, 0): top left corner of the image, (1, 1): bottom right. There may
     * be several sets: first the coordinates of all vertices in set 0, then those in set 1, … */
    arhost_buffer texcoords;
    /* 4 floats per vertex: the unit direction in which u increases, and ±1 = w: v increases along −w · (normal ×
     * direction). All 0: there is no such direction. Absent, and if the mesh deforms: each triangle has the
     * directions that its texture coordinates give. */
    arhost_buffer tangents;
    arhost_buffer colours; /* 4 uint16 per vertex, 0 to 65535 for 0 to 1: linear RGB, which multiplies `ambient` and
                              `diffuse` of the material, and opacity, which multiplies its `opacity` */
    arhost_buffer indices; /* 3 uint32 per triangle, each < positions.count */
    /* Present only in deforming triangle meshes. The worker evaluates these buffers (arhost/motion.h). */
    arhost_buffer joints;  /* 4 uint16 per vertex: indices into the skin's joints; if a vertex has more than 4,
                              more sets follow, as those of texcoords do */
    arhost_buffer weights; /* 4 floats per vertex and set, 0 to 1; the sum of all of a vertex is 1 */
    arhost_buffer morph_positions; /* displacements, 3 floats per vertex and morph target: first those of all vertices
                                      for target 0, then for target 1, … */
    arhost_buffer morph_normals;   /* changes of the normals, in the same order; may be absent */
} arhost_geometry;

/* ---- textures ---- */

typedef int32_t arhost_texel_format;
enum {
    ARHOST_TEXEL_SRGB8 = 1,  /* R, G, B, A bytes; sRGB-encoded colour, linear alpha */
    ARHOST_TEXEL_RGBA8 = 2,  /* R, G, B, A bytes, linear: data rather than colour */
    ARHOST_TEXEL_RGBA32F = 3 /* 4 floats, linear light, 0 to 1e6 */
};

typedef struct arhost_texel_image {
    arhost_texel_format format;
    uint32_t width, height; /* texels, 1 to 16384 */
    uint32_t name;          /* byte offset into `names` of a NUL-terminated string */
    uint32_t level_count;   /* 1, or more: smaller versions of the image follow it, for surfaces that are far away.
                               Level k has max(width >> k, 1) · max(height >> k, 1) texels, each the mean, in linear
                               light, of those that it covers in level k − 1 */
    uint32_t reserved;      /* 0 */
    arhost_buffer texels;   /* of all levels; top row first; stride 4 or 16 */
} arhost_texel_image;

typedef int32_t arhost_wrap;
enum { ARHOST_WRAP_REPEAT = 1, ARHOST_WRAP_CLAMP = 2, ARHOST_WRAP_MIRROR = 3 };
typedef int32_t arhost_texel_filter;
enum { ARHOST_TEXEL_FILTER_LINEAR = 1, ARHOST_TEXEL_FILTER_NEAREST = 2 };

/* How a material reads an image. The centre of texel (i, j) is at u = (i + ½)/width, v = (j + ½)/height. LINEAR
 * interpolates bilinearly; sRGB texels are linearised before interpolation. Ray tracers may interpolate between the
 * two levels whose texels are about as large as the area that a ray from the eye covers. */
typedef struct arhost_texture {
    uint32_t image; /* index */
    arhost_wrap wrap_u, wrap_v;
    arhost_texel_filter filter;
    uint32_t texcoord_set;        /* of the geometry */
    float image_from_texcoord[6]; /* column-major 2×3: (u, v) = columns 0 and 1 · texture coordinates + column 2 */
} arhost_texture;

/* ---- materials ---- */

typedef int32_t arhost_material_model;
enum {
    ARHOST_MATERIAL_DIFFUSE = 1,  /* Lambert */
    ARHOST_MATERIAL_SPECULAR = 2, /* Lambert + Phong */
    ARHOST_MATERIAL_MIRROR = 3,   /* perfect reflection · `reflectivity` */
    ARHOST_MATERIAL_METAL = 4,    /* Lambert + Phong + perfect reflection · Schlick's Fresnel term with
                                     F0 = `reflectivity` */
    ARHOST_MATERIAL_GLASS = 5,    /* refraction and reflection weighted by a Fresnel term, absorption inside */
    ARHOST_MATERIAL_METALLIC_ROUGHNESS = 6, /* as in glTF 2.0: GGX specular over Lambert diffuse */
    ARHOST_MATERIAL_UNLIT = 7               /* has the radiance `diffuse` in each direction, under any light */
};

/* Colours are linear light, 0 to 1, Rec. 709 primaries. A texture field is an index or ARHOST_NONE. The value of the
 * texture multiplies the corresponding constant of the material. On a geometry without texcoords, the factor is 1. A
 * model ignores fields that do not apply to it: mirror and glass have no diffuse colour and no emission. */
typedef struct arhost_material {
    arhost_material_model model;
    uint32_t colour_texture; /* multiplies ambient and diffuse; its alpha multiplies `opacity` */
    float ambient[3];        /* Ka; multiplies the scene's ambient light */
    float diffuse[3];        /* Kd; metallic-roughness: base colour */
    float specular[3];       /* Ks, 0 to 1; metallic-roughness: see there, 0 to 1e6 */
    float exponent;          /* Phong exponent, >= 1 */
    float reflectivity[3];   /* Kr; glass: tint of reflected light */
    float emission[3];       /* emitted radiance, 0 to 1e6 */
    /* The opacity of a surface point is `opacity` · alpha of colour_texture · opacity of the vertex colour. */
    float opacity;      /* 0 to 1 */
    float alpha_cutoff; /* points of a lower opacity are cut out; 0: none */
    uint32_t blends; /* non-zero: light passes points in proportion to 1 − their opacity, without refraction, and the
                        points reflect and emit light in proportion to their opacity. With ARHOST_INTEGRATOR_WHITTED,
                        points of an opacity below ½ are cut out instead. Zero: points that are not cut out are
                        opaque */

    /* Metallic-roughness. Glass uses `roughness`, too. The reflectance of non-metals at normal incidence is
     * min(((index − 1)/(index + 1))² · `specular` · specular_colour_texture, 1) · w, and at grazing incidence w,
     * where w = specular_weight · alpha of specular_texture (KHR_materials_ior, KHR_materials_specular). */
    float metallic, roughness;           /* 0 to 1 */
    uint32_t metallic_roughness_texture; /* G: roughness, B: metallic */
    uint32_t normal_texture; /* tangent-space normal = 2 · texel − 1: R along +u, G along −v, B outwards */
    uint32_t emission_texture;
    float normal_scale;         /* multiplies R and G of the tangent-space normal */
    uint32_t occlusion_texture; /* ambient light is multiplied by 1 + occlusion_strength · (R − 1) */
    float occlusion_strength;   /* 0 to 1 */
    float specular_weight;      /* 0 to 1 */
    uint32_t specular_texture, specular_colour_texture;
    /* Metallic-roughness with ARHOST_INTEGRATOR_PATH: the share `transmission` · R of transmission_texture · (1 −
     * metallic) of the diffuse light is refracted instead, by microfacets of the same roughness, and tinted by the
     * diffuse colour: by its square root at each surface of a solid, by itself at a thin wall. A solid refracts by
     * `index` and absorbs by `extinction`. A thin wall does neither. Its reflection follows from `index` alone,
     * without the fields of specular light and the clear coat (KHR_materials_transmission, KHR_materials_volume). */
    float transmission; /* 0 to 1 */
    uint32_t transmission_texture;
    uint32_t thin_walled;
    /* Metallic-roughness with ARHOST_INTEGRATOR_PATH: a dielectric layer of index 1.5 above the surface, with the
     * share `clearcoat` · R of clearcoat_texture, the roughness clearcoat_roughness · G of its texture, and normals
     * of its own (KHR_materials_clearcoat). */
    float clearcoat, clearcoat_roughness; /* 0 to 1 */
    uint32_t clearcoat_texture, clearcoat_roughness_texture;
    uint32_t clearcoat_normal_texture; /* ARHOST_NONE: the normals of the vertices */
    float clearcoat_normal_scale;
    /* Metallic-roughness with ARHOST_INTEGRATOR_PATH: fibres above the surface, as of cloth, which reflect light of
     * this colour at grazing angles. `sheen` is multiplied by the colour of sheen_texture, `sheen_roughness` by the
     * alpha of its texture; roughnesses below 0.2 count as 0.2. The distribution of their normals is Charlie's
     * (KHR_materials_sheen). The light that they do not reflect reaches the surface. */
    float sheen[3], sheen_roughness; /* 0 to 1 */
    uint32_t sheen_texture, sheen_roughness_texture;
    /* Metallic-roughness with ARHOST_INTEGRATOR_PATH: the alpha of GGX is roughness² across a direction, and
     * roughness² + anisotropy² · (1 − roughness²) along it. The direction is anisotropy_direction, in units of the
     * tangents (the axes of normal_texture). With a texture, its direction (2 · R − 1, 2 · G − 1) is turned by
     * anisotropy_direction, and B multiplies `anisotropy` (KHR_materials_anisotropy). */
    float anisotropy;              /* 0 to 1 */
    float anisotropy_direction[2]; /* cosine and sine of an angle */
    uint32_t anisotropy_texture;
    /* Metallic-roughness with ARHOST_INTEGRATOR_PATH: a thin film, of the refractive index `iridescence_index`, on
     * the share `iridescence` · R of iridescence_texture of the surface. Its thickness is between the two values, at
     * G of iridescence_thickness_texture; the second one without this texture (KHR_materials_iridescence). */
    float iridescence;                 /* 0 to 1 */
    float iridescence_index;           /* 1 to 4 */
    float iridescence_thickness_nm[2]; /* 0 to 1e5 */
    uint32_t iridescence_texture, iridescence_thickness_texture;

    /* Glass. Its reflectance is clamp(minimum + (1 − minimum)(1 − c)^exponent, minimum, maximum), or 1 at total
     * internal reflection. c is the cosine of the angle between the normal and the ray on the outside of the glass,
     * which is either the incident or the refracted ray. With ARHOST_INTEGRATOR_PATH, the reflectance is Fresnel's,
     * and glass with a `roughness` above 0 scatters light at microfacets: GGX with alpha = roughness² and Smith's
     * separable masking. */
    float index;                            /* refractive index relative to the outside, 1 to 4 */
    float fresnel_exponent;                 /* 0.01 to 100 */
    float fresnel_minimum, fresnel_maximum; /* 0 to 1 */
    float refraction[3];                    /* tint of refracted light */
    float extinction[3];         /* 1/mm, >= 0; transmittance is exp(−extinction · path length inside) */
    float shadow_attenuation[3]; /* transmittance of each surface for shadow rays at normal incidence, 0 to 1;
                                    `extinction` applies in addition */
    float cutoff_colour[3];      /* radiance assumed for rays that are not traced because of importance_cutoff */
    float importance_cutoff;     /* rays that would contribute less than this are not traced; 0 to 1 */
    uint32_t reflection_depth, refraction_depth; /* reflected and refracted rays are traced only from hits whose
                                                    depth is lower than this */
} arhost_material;

/* ---- objects ---- */

typedef int32_t arhost_role;
enum {
    ARHOST_ROLE_VIRTUAL = 1, /* virtual object: alpha 255 */
    ARHOST_ROLE_CATCHER = 2, /* shadow catcher, a proxy for real geometry: alpha is above 0 only where it is
                                shadowed. Visible to secondary rays; primary rays pass through its back faces */
    ARHOST_ROLE_OCCLUDER = 3 /* proxy for real geometry that hides virtual objects behind it: alpha 0. Visible to
                                secondary rays */
};

typedef struct arhost_object {
    uint32_t geometry, material; /* indices */
    arhost_role role;
    uint32_t name; /* byte offset into `names` of a NUL-terminated string */
    /* Column-major 3×4, invertible: the columns are the x, y and z axes and the origin, mm. The identity for a static
     * object whose vertices the loader has transformed to world coordinates. For a moving object, the transform at
     * time 0. */
    float world_from_object[12];
    uint32_t moves;      /* non-zero: each request contains the transform of the object (arhost/motion.h) */
    uint32_t deforms;    /* non-zero: each request contains the vertices of the object (arhost/motion.h); no other
                            object shares its geometry */
    uint32_t node, skin; /* indices or ARHOST_NONE; used by the worker to animate the object */
    uint32_t hides_back_faces; /* non-zero: the eye does not see back faces, also not in mirrors and through glass.
                                  They block and reflect other light */
    uint32_t reserved;         /* 0 */
} arhost_object;

/* ---- animation: evaluated by the worker (arhost/motion.h); ray tracers may ignore it ---- */

/* A node of the transform hierarchy. */
typedef struct arhost_node {
    uint32_t parent;                             /* index lower than that of this node; ARHOST_NONE: the world */
    uint32_t animated;                           /* 0: use parent_from_node; otherwise use translation,
                                                    rotation and scale */
    float parent_from_node[12];                  /* column-major 3×4 */
    float translation[3], rotation[4], scale[3]; /* mm; unit quaternion (x, y, z, w); scale factors */
    arhost_buffer morph_weights;                 /* floats, one per morph target of this node's geometry */
} arhost_node;

typedef int32_t arhost_channel_target;
enum {
    ARHOST_CHANNEL_TRANSLATION = 1,
    ARHOST_CHANNEL_ROTATION = 2,
    ARHOST_CHANNEL_SCALE = 3,
    ARHOST_CHANNEL_MORPH_WEIGHTS = 4
};
typedef int32_t arhost_interpolation;
enum {
    ARHOST_INTERPOLATION_STEP = 1,
    ARHOST_INTERPOLATION_LINEAR = 2, /* spherical (slerp) for rotations */
    ARHOST_INTERPOLATION_CUBIC = 3   /* each key has in-tangent, value, out-tangent, as in glTF 2.0, appendix C */
};

/* Animates one property of a node. */
typedef struct arhost_channel {
    uint32_t node;
    arhost_channel_target target;
    arhost_interpolation interpolation;
    float period_s;       /* the values repeat with this period; 0: they play once, and the last one stays */
    arhost_buffer times;  /* floats, one per key: time in s, ascending */
    arhost_buffer values; /* floats, per key: 3 (translation, scale), 4 (rotation) or one per morph weight;
                              three times as many for CUBIC */
} arhost_channel;

typedef struct arhost_skin {
    arhost_buffer joints;         /* uint32: node indices */
    arhost_buffer node_from_mesh; /* inverse bind matrices, one per joint: column-major 3×4 floats, stride 48 */
} arhost_skin;

/* A node that follows a target of the tracker: the pose of the node in the world is that of the target. Ray tracers
 * may ignore anchors, because arhost_motion contains the resulting transforms. */
typedef struct arhost_anchor {
    uint32_t node;   /* without a parent, not animated */
    uint32_t target; /* byte offset into `names` of a NUL-terminated string: the name of the target */
} arhost_anchor;

/* ---- lights ---- */

typedef int32_t arhost_light_type;
enum {
    ARHOST_LIGHT_POINT = 1,       /* at `position` */
    ARHOST_LIGHT_DIRECTIONAL = 2, /* at infinity, shining along `direction` */
    ARHOST_LIGHT_SPOT = 3,        /* at `position`, shining along `direction` in a cone */
    ARHOST_LIGHT_RECTANGLE = 4,   /* centred at `position`, corners at ±axis_u ±axis_v; emits on the side of
                                     `direction`, with a cosine falloff */
    ARHOST_LIGHT_SPHERE = 5       /* centred at `position`, of `radius` */
};
typedef int32_t arhost_falloff;
enum {
    ARHOST_FALLOFF_NONE = 1,          /* irradiance = intensity · cosθ at any distance */
    ARHOST_FALLOFF_INVERSE_SQUARE = 2 /* irradiance = intensity · cosθ / d², d in mm */
};

/* An area light illuminates like the mean of point lights with this `intensity` that are distributed uniformly over
 * its area (for a sphere: over its visible disc). A very small area light therefore equals a point light. Secondary
 * rays see an area light as a transparent surface of this area: only the front of a rectangle, or the disc of a
 * sphere. For INVERSE_SQUARE, the radiance of this surface is π · intensity / area. For NONE, this value is
 * multiplied by the square of the distance from the ray's origin. */
typedef struct arhost_light {
    arhost_light_type type;
    arhost_falloff falloff;     /* NONE for directional lights */
    float position[3];          /* mm */
    float direction[3];         /* unit length, pointing away from the light */
    float intensity[3];         /* linear RGB; see arhost_falloff */
    float axis_u[3], axis_v[3]; /* mm; half sides, perpendicular to each other and to `direction` */
    float radius;               /* mm; of a sphere, or of the sphere that a spot light shines from (0: a point) */
    /* Cosines of the half angles of a spot light: full intensity inside the inner cone, 0 outside the outer cone,
     * smooth in between; cosine_inner >= cosine_outer. */
    float cosine_inner, cosine_outer;
} arhost_light;

/* Environment map in equirectangular projection: a unit direction (x, y, z) in environment coordinates, y up, maps to
 * u = ½ + atan2(x, −z)/2π, v = acos(y)/π. */
typedef struct arhost_environment {
    uint32_t texture;                /* index, of an RGBA32F image; ARHOST_NONE: no environment */
    float intensity;                 /* multiplies the texels */
    float environment_from_world[9]; /* rotation, column-major 3×3 */
    /* Non-zero: the texels are also multiplied by the mean colour of the video under the overlay, in linear light and
     * with half its saturation: (mean + Y) / 2 in each channel, where Y = 0.2126 R + 0.7152 G + 0.0722 B of the mean.
     * Without video, they are multiplied by 0.18 (mid grey). */
    uint32_t follows_video;
    /* CDFs (floats, the last of each CDF is 1) for importance sampling with a density proportional to
     * luminance · sin(πv), where the luminance is the mean of the interpolated texture over a texel. */
    arhost_buffer rows;    /* marginal CDF: one value per row of the texture */
    arhost_buffer columns; /* conditional CDFs: for each row, one value per column */
} arhost_environment;

/* How light is transported. Ray tracers that know only one way use it for every scene. */
typedef int32_t arhost_integrator;
enum {
    /* Direct light, mirrors and glass, and a constant ambient light. Shadows on catchers have the alphas of
     * `shadow_alpha_opaque` and `shadow_alpha_translucent`. */
    ARHOST_INTEGRATOR_WHITTED = 1,
    /* All paths of at most `max_depth` bounces: light that surfaces reflect onto each other, emissive surfaces as
     * light sources. `background` is the radiance of an environment of one colour. Ignores `ambient` and the
     * constants of shadows. Catchers show the change of their light (ARHOST_IMAGE_FORM_LINEAR). */
    ARHOST_INTEGRATOR_PATH = 2
};

/* The header at the start of the arena. */
typedef struct arhost_scene {
    uint64_t magic;   /* ARHOST_SCENE_MAGIC */
    uint32_t version; /* ARHOST_SCENE_VERSION */
    uint32_t struct_size;
    uint64_t byte_size; /* size of the arena, including this header and the 16 bytes after the last buffer */
    arhost_axes axes;
    uint32_t max_depth;  /* maximum number of bounces after the primary ray */
    float ambient[3];    /* ambient light, linear RGB */
    float background[3]; /* radiance of secondary rays that hit nothing, if there is no environment; primary rays
                            that hit nothing give alpha 0 */
    float bounds_min[3], bounds_max[3]; /* world bounding box of all objects at time 0; animation may exceed it */
    /* Alpha of catchers where a light is fully hidden; defaults 0.6 and 0.3. If opaque and translucent objects hide
     * the fractions o and t of the light, alpha is 1 − 2·encode(g·L), at least 0, with L = 1 − o·(1 − l(opaque)) −
     * t·(1 − l(translucent)) and l(alpha) = decode(0.5·(1 − alpha))/g, where encode and decode are those of sRGB and
     * g = decode(0.5): over mid-grey, the overlay hides the right share of the linear light. */
    float shadow_alpha_opaque, shadow_alpha_translucent;
    uint32_t coloured_shadows; /* non-zero: glass casts coloured shadows on catchers */
    float duration_s;          /* > 0: there is animation; the longest time that one of its parts takes, s */
    arhost_integrator integrator;
    uint32_t reserved; /* 0 */
    arhost_environment environment;
    arhost_buffer geometries; /* arhost_geometry, stride sizeof */
    arhost_buffer images;     /* arhost_texel_image */
    arhost_buffer textures;   /* arhost_texture */
    arhost_buffer materials;  /* arhost_material */
    arhost_buffer objects;    /* arhost_object; may be absent */
    arhost_buffer lights;     /* arhost_light */
    arhost_buffer nodes;      /* arhost_node */
    arhost_buffer channels;   /* arhost_channel */
    arhost_buffer skins;      /* arhost_skin */
    arhost_buffer names;      /* bytes of NUL-terminated strings */
    arhost_buffer anchors;    /* arhost_anchor, by increasing node */
} arhost_scene;

#ifdef __cplusplus
}
#endif
#endif
