/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/scene.h: the scene as one flat, position-independent block of memory, the arena.
 *
 * The loader writes it, the host checks it (every offset, index and number, once) and seals it; ray
 * tracers read it in place. All offsets count bytes from the arena's start and are multiples of 64.
 * After every buffer of vertices and attributes there are at least 16 more readable bytes.
 * World: right-handed, millimetres. Numbers are finite. Little-endian.
 */
#ifndef ARHOST_SCENE_H
#define ARHOST_SCENE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ARHOST_SCENE_MAGIC 0x435354534f485241ull /* "ARHOSTSC" */
#define ARHOST_SCENE_VERSION 1u
#define ARHOST_NONE 0xffffffffu

/* `count` elements, each `stride` bytes from the one before; count 0: absent. */
typedef struct arhost_buffer {
    uint64_t offset;
    uint32_t count;
    uint32_t stride;
} arhost_buffer;

typedef int32_t arhost_axes;
enum { ARHOST_Z_UP = 1 /* x right, y back, z up: the marker's own */, ARHOST_Y_UP = 2 /* x right, y up, z front */ };

typedef int32_t arhost_geometry_type;
enum {
    ARHOST_TRIANGLES = 1, /* positions FLOAT3, normals FLOAT3 or absent, texcoords FLOAT2 or absent,
                             indices 3×uint32 */
    ARHOST_SPHERES = 2    /* positions FLOAT4: centre and radius; nothing else */
};

typedef struct arhost_geometry {
    arhost_geometry_type type;
    uint32_t reserved;
    arhost_buffer positions; /* stride 12 (FLOAT3) or 16 (FLOAT4) */
    arhost_buffer normals;   /* one a vertex, unit length: smooth shading; absent: flat */
    arhost_buffer texcoords;
    arhost_buffer indices; /* stride 12; each < positions.count */
} arhost_geometry;

typedef int32_t arhost_material_model;
enum {
    ARHOST_DIFFUSE = 1,  /* Lambert */
    ARHOST_SPECULAR = 2, /* Lambert + Phong */
    ARHOST_MIRROR = 3    /* perfect reflection times `reflectivity` */
};

/* Colours are linear light, 0 to 1, Rec. 709 primaries. */
typedef struct arhost_material {
    arhost_material_model model;
    uint32_t reserved;
    float ambient[3];      /* Ka: times the scene's ambient light */
    float diffuse[3];      /* Kd */
    float specular[3];     /* Ks */
    float exponent;        /* Phong's, >= 1 */
    float reflectivity[3]; /* Kr */
    uint32_t reserved_2;
} arhost_material;

typedef int32_t arhost_role;
enum {
    ARHOST_VIRTUAL = 1, /* alpha 255 */
    ARHOST_CATCHER = 2, /* stands for real geometry: alpha only where shadowed */
    ARHOST_OCCLUDER = 3 /* stands for real geometry: hides what is behind it, alpha 0 */
};

typedef struct arhost_object {
    uint32_t geometry, material; /* indices */
    arhost_role role;
    uint32_t name; /* byte offset into `names`, of a NUL-terminated string */
    /* Column-major 3×4: the columns are x, y, z axes and the origin. Invertible. The identity where
     * the loader has put a static object's vertices into the world already. */
    float world_from_object[12];
} arhost_object;

typedef int32_t arhost_light_type;
enum {
    ARHOST_POINT_LIGHT = 1 /* at `position` */
};
typedef int32_t arhost_falloff;
enum {
    ARHOST_FALLOFF_NONE = 1,          /* irradiance = intensity · cosθ at any distance */
    ARHOST_FALLOFF_INVERSE_SQUARE = 2 /* irradiance = intensity · cosθ / d², d in mm */
};

typedef struct arhost_light {
    arhost_light_type type;
    arhost_falloff falloff;
    float position[3]; /* mm */
    float intensity[3];
} arhost_light;

/* The arena's first bytes. */
typedef struct arhost_scene {
    uint64_t magic;
    uint32_t version;
    uint32_t struct_size;
    uint64_t byte_size; /* of the arena, the header and the last buffer's 16 spare bytes included */
    arhost_axes axes;
    uint32_t max_depth;  /* bounces after the primary ray */
    float ambient[3];    /* light from everywhere */
    float background[3]; /* seen by reflected and refracted rays that hit nothing; primary rays: alpha 0 */
    float bounds_min[3], bounds_max[3];                  /* of all objects, world */
    float shadow_alpha_opaque, shadow_alpha_translucent; /* on catchers: 0.6 and 0.3 */
    arhost_buffer geometries;                            /* arhost_geometry, stride sizeof */
    arhost_buffer materials;                             /* arhost_material */
    arhost_buffer objects;                               /* arhost_object; may be 0 */
    arhost_buffer lights;                                /* arhost_light */
    arhost_buffer names;                                 /* bytes, stride 1 */
} arhost_scene;

#ifdef __cplusplus
}
#endif
#endif
