/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/motion.h: the animated state of a scene at the time of one image.
 *
 * Part of each render request if the scene's duration_s is above 0. The worker evaluates it from the scene's nodes,
 * channels and skins, so ray tracers need not. All of it is valid only during the call. The array elements have no
 * struct_size and never grow: step by sizeof.
 */
#ifndef ARHOST_MOTION_H
#define ARHOST_MOTION_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The transform of an object with `moves` set. One entry for each such object, in the scene's order. */
typedef struct arhost_moved_object {
    uint32_t object;
    float world_from_object[12]; /* column-major 3×4, invertible; mm */
} arhost_moved_object;

/* The vertices of an object with `deforms` set. One entry for each such object, in the scene's order. Skinned
 * vertices are in world coordinates: their world_from_object is the identity. */
typedef struct arhost_deformed_geometry {
    uint32_t object;
    uint32_t vertex_count;  /* equals that of the geometry in the arena */
    const float *positions; /* 3 floats each; at least 16 readable bytes follow the last */
    const float *normals;   /* 3 floats each, unit length; NULL if the geometry has none */
} arhost_deformed_geometry;

typedef struct arhost_motion {
    uint32_t struct_size;
    uint32_t moved_count;
    const arhost_moved_object *moved;
    const arhost_deformed_geometry *deformed;
    uint32_t deformed_count;
    uint32_t reserved; /* 0 */
} arhost_motion;

#ifdef __cplusplus
}
#endif
#endif
