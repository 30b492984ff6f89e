/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/scene.h: the scene as one flat, position-independent block of memory, the arena.
 *
 * The loader writes it, the host checks it (every offset, index and number, once) and seals it; ray
 * tracers read it in place. All offsets count bytes from the arena's start and are multiples of 64.
 * After every buffer of vertices and attributes there are at least 16 more readable bytes.
 * World: right-handed, millimetres. Numbers are finite, coordinates within 1e9, in the world 4e9. A scene may be of
 * any size: what is too near or too small is judged by the scene's own. Little-endian.
 */
#ifndef ARHOST_SCENE_H
#define ARHOST_SCENE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ARHOST_SCENE_MAGIC 0x435354534f485241ull /* "ARHOSTSC" */
#define ARHOST_SCENE_VERSION 2u
#define ARHOST_NONE 0xffffffffu

/* `count` elements, each `stride` bytes from the one before; count 0: absent. */
typedef struct arhost_buffer {
    uint64_t offset;
    uint32_t count;
    uint32_t stride;
} arhost_buffer;

typedef int32_t arhost_axes;
enum {
    ARHOST_AXES_Z_UP = 1 /* x right, y back, z up: the marker's own */,
    ARHOST_AXES_Y_UP = 2 /* x right, y up, z front */
};

typedef int32_t arhost_geometry_type;
enum {
    ARHOST_GEOMETRY_TRIANGLES = 1, /* positions FLOAT3, normals FLOAT3 or absent, texcoords FLOAT2 or absent,
                             indices 3×uint32 */
    ARHOST_GEOMETRY_SPHERES = 2    /* positions FLOAT4: centre and radius; nothing else */
};

typedef struct arhost_geometry {
    arhost_geometry_type type;
    uint32_t reserved;
    arhost_buffer positions; /* stride 12 (FLOAT3) or 16 (FLOAT4); of a skinned mesh: as its skin takes them */
    arhost_buffer normals;   /* one a vertex, unit length: smooth shading; absent: flat */
    arhost_buffer texcoords; /* one a vertex; (0, 0) is a texture's left top corner, (1, 1) its right bottom one */
    arhost_buffer indices;   /* stride 12; each < positions.count */
    /* Of triangles that deform; else absent. Ray tracers need not look at them: arhost/motion.h. */
    arhost_buffer joints;          /* a vertex: 4×uint16, places in the skin's list; stride 8 */
    arhost_buffer weights;         /* a vertex: 4 floats, 0 to 1, sum 1; stride 16 */
    arhost_buffer morph_positions; /* FLOAT3 displacements, vertices of target 0, of target 1, …; stride 12 */
    arhost_buffer morph_normals;   /* likewise, or absent */
} arhost_geometry;

/* ---- textures ---- */

typedef int32_t arhost_texel_format;
enum {
    ARHOST_TEXEL_SRGB8 = 1,  /* R, G, B, A bytes; colour sRGB-encoded, alpha linear */
    ARHOST_TEXEL_RGBA8 = 2,  /* R, G, B, A bytes, linear: numbers rather than colours */
    ARHOST_TEXEL_RGBA32F = 3 /* four floats, linear light, 0 to 1e6 */
};
typedef int32_t arhost_wrap;
enum { ARHOST_WRAP_REPEAT = 1, ARHOST_WRAP_CLAMP = 2, ARHOST_WRAP_MIRROR = 3 };

/* Sampled bilinearly; texel (i, j) has its centre at u = (i + ½)/width, v = (j + ½)/height. Bytes are
 * linearised before they are mixed. */
typedef struct arhost_texture {
    arhost_texel_format format;
    uint32_t width, height; /* 1 to 16384 */
    arhost_wrap wrap_u, wrap_v;
    uint32_t name;        /* byte offset into `names` */
    arhost_buffer texels; /* width·height of them, first row at the top; stride 4 or 16 */
} arhost_texture;

/* ---- materials ---- */

typedef int32_t arhost_material_model;
enum {
    ARHOST_MATERIAL_DIFFUSE = 1,           /* Lambert */
    ARHOST_MATERIAL_SPECULAR = 2,          /* Lambert + Phong */
    ARHOST_MATERIAL_MIRROR = 3,            /* perfect reflection times `reflectivity` */
    ARHOST_MATERIAL_METAL = 4,             /* Lambert + Phong + perfect reflection times Schlick's Fresnel term of
                                     `reflectivity` */
    ARHOST_MATERIAL_GLASS = 5,             /* refraction and reflection by a Fresnel term, absorption inside */
    ARHOST_MATERIAL_METALLIC_ROUGHNESS = 6 /* glTF 2.0's: GGX over Lambert */
};

/* Colours are linear light, 0 to 1, Rec. 709 primaries. Textures are indices or ARHOST_NONE; what a
 * texture gives is multiplied with the number beside it; on a geometry without texcoords it counts as 1.
 * Fields that a model does not name are ignored: mirror and glass have neither colour nor emission. */
typedef struct arhost_material {
    arhost_material_model model;
    uint32_t colour_texture; /* of ambient and diffuse; its alpha against alpha_cutoff */
    float ambient[3];        /* Ka: times the scene's ambient light */
    float diffuse[3];        /* Kd; metallic-roughness: the base colour */
    float specular[3];       /* Ks */
    float exponent;          /* Phong's, >= 1 */
    float reflectivity[3];   /* Kr; glass: colour of what is reflected */
    float emission[3];       /* given off, 0 to 1e6 */
    float alpha_cutoff;      /* where the colour's alpha is below it there is nothing; 0: no holes */

    /* Metallic-roughness. */
    float metallic, roughness;           /* 0 to 1 */
    uint32_t metallic_roughness_texture; /* G: roughness, B: metallic */
    uint32_t normal_texture;             /* tangent space: R along u, G against v, B out; each 2t − 1 */
    uint32_t emission_texture;

    /* Glass. Its reflectance at an angle of cosine c (on the outside, c of the refracted ray) is
     * clamp(minimum + (1 − minimum)(1 − c)^exponent, minimum, maximum), 1 at total reflection. */
    float index;                                 /* of refraction against what is outside, 1 to 4 */
    float fresnel_exponent;                      /* 0.01 to 100 */
    float fresnel_minimum, fresnel_maximum;      /* 0 to 1 */
    float refraction[3];                         /* colour of what is refracted */
    float extinction[3];                         /* per mm, >= 0: light loses exp(−extinction · way inside) */
    float shadow_attenuation[3];                 /* of light that passes a surface at a right angle */
    float cutoff_colour[3];                      /* stands for a ray that is not followed any more */
    float importance_cutoff;                     /* a ray that would add less of itself is not followed; 0 to 1 */
    uint32_t reflection_depth, refraction_depth; /* such rays start only from a depth below */
} arhost_material;

/* ---- objects ---- */

typedef int32_t arhost_role;
enum {
    ARHOST_ROLE_VIRTUAL = 1, /* alpha 255 */
    ARHOST_ROLE_CATCHER = 2, /* stands for real geometry: alpha only where shadowed; seen by secondary rays.
                           Primary rays pass through the sides that face away. */
    ARHOST_ROLE_OCCLUDER = 3 /* stands for real geometry: hides what is behind it, alpha 0 */
};

typedef struct arhost_object {
    uint32_t geometry, material; /* indices */
    arhost_role role;
    uint32_t name; /* byte offset into `names`, of a NUL-terminated string */
    /* Column-major 3×4: the columns are x, y, z axes and the origin. Invertible. The identity where
     * the loader has put a static object's vertices into the world already. Of an object that moves: at
     * time 0. */
    float world_from_object[12];
    uint32_t moves;      /* non-zero: its place comes with each request (arhost/motion.h) */
    uint32_t deforms;    /* non-zero: so do its geometry's vertices; no other object has that geometry */
    uint32_t node, skin; /* for arhost/motion.h; ARHOST_NONE */
} arhost_object;

/* ---- what moves: evaluated for the ray tracer by its worker, for whom it may be opaque ---- */

/* A place in a tree of places. */
typedef struct arhost_node {
    uint32_t parent;            /* an index below its own, or ARHOST_NONE: the world */
    uint32_t animated;          /* non-zero: translation, rotation and scale are valid, and stand for: */
    float parent_from_node[12]; /* column-major 3×4 */
    float translation[3], rotation[4] /* a unit quaternion x, y, z, w */, scale[3];
    arhost_buffer morph_weights; /* floats: of the targets of the geometry at this node */
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
    ARHOST_INTERPOLATION_LINEAR = 2, /* rotations: spherically */
    ARHOST_INTERPOLATION_CUBIC = 3   /* a key: in-tangent, value, out-tangent, as in glTF 2.0, appendix C */
};

typedef struct arhost_channel {
    uint32_t node;
    arhost_channel_target target;
    arhost_interpolation interpolation;
    uint32_t reserved;
    arhost_buffer times;  /* s, floats, ascending */
    arhost_buffer values; /* floats: a key's 3, 4 or as many as morph weights; CUBIC: three times that */
} arhost_channel;

typedef struct arhost_skin {
    arhost_buffer joints;         /* uint32: nodes */
    arhost_buffer node_from_mesh; /* a joint: column-major 3×4 floats, "inverse bind matrix"; stride 48 */
} arhost_skin;

/* ---- lights ---- */

typedef int32_t arhost_light_type;
enum {
    ARHOST_LIGHT_POINT = 1,       /* at `position` */
    ARHOST_LIGHT_DIRECTIONAL = 2, /* from infinitely far, along `direction` */
    ARHOST_LIGHT_SPOT = 3,        /* at `position`, along `direction`, in a cone */
    ARHOST_LIGHT_RECTANGLE = 4,   /* about `position`, corners at ±axis_u ±axis_v, shining to the side of
                                     `direction` with the cosine to it */
    ARHOST_LIGHT_SPHERE = 5       /* about `position`, of `radius` */
};
typedef int32_t arhost_falloff;
enum {
    ARHOST_FALLOFF_NONE = 1,          /* irradiance = intensity · cosθ at any distance */
    ARHOST_FALLOFF_INVERSE_SQUARE = 2 /* irradiance = intensity · cosθ / d², d in mm */
};

/* The light of an extended one is the mean over points spread evenly over it (of a sphere: over the disc
 * that it shows), each a light of `intensity`; so a small one is like a point light. */
typedef struct arhost_light {
    arhost_light_type type;
    arhost_falloff falloff; /* directional: NONE */
    float position[3];      /* mm */
    float direction[3];     /* unit length, away from the light */
    float intensity[3];
    float axis_u[3], axis_v[3];       /* mm, half a side each, across each other and `direction` */
    float radius;                     /* mm */
    float cosine_inner, cosine_outer; /* of a spot's half angles: full light within, none without,
                                         smoothly between; inner >= outer */
} arhost_light;

/* Light from all round, by an image in equirectangular projection: a direction (x, y, z) of the
 * environment, y up, has u = ½ + atan2(x, −z)/2π, v = acos(y)/π. */
typedef struct arhost_environment {
    uint32_t texture;                /* RGBA32F; ARHOST_NONE: there is none */
    float intensity;                 /* times the texels */
    float environment_from_world[9]; /* a rotation, column-major */
    /* For choosing directions with a density as the light's, luminance times sin(πv): cumulative sums,
     * each ending with 1. Floats. */
    arhost_buffer rows;    /* height: over whole rows */
    arhost_buffer columns; /* height·width: along each row */
} arhost_environment;

/* The arena's first bytes. */
typedef struct arhost_scene {
    uint64_t magic;
    uint32_t version;
    uint32_t struct_size;
    uint64_t byte_size; /* of the arena, the header and the last buffer's 16 spare bytes included */
    arhost_axes axes;
    uint32_t max_depth;  /* bounces after the primary ray */
    float ambient[3];    /* light from everywhere */
    float background[3]; /* seen by secondary rays that hit nothing where there is no environment; primary
                            rays: alpha 0 */
    float bounds_min[3], bounds_max[3]; /* of all objects, world, at time 0; what moves or deforms may leave them */
    float shadow_alpha_opaque, shadow_alpha_translucent; /* on catchers: 0.6 and 0.3 */
    uint32_t coloured_shadows;                           /* non-zero: shadows of glass on catchers take its colour */
    float duration_s; /* of the motion, which then begins again; 0: nothing moves */
    arhost_environment environment;
    arhost_buffer geometries; /* arhost_geometry, stride sizeof */
    arhost_buffer textures;   /* arhost_texture */
    arhost_buffer materials;  /* arhost_material */
    arhost_buffer objects;    /* arhost_object; may be 0 */
    arhost_buffer lights;     /* arhost_light */
    arhost_buffer nodes;      /* arhost_node */
    arhost_buffer channels;   /* arhost_channel */
    arhost_buffer skins;      /* arhost_skin */
    arhost_buffer names;      /* bytes, stride 1 */
} arhost_scene;

#ifdef __cplusplus
}
#endif
#endif
