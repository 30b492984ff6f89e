/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/motion.h: where the moving things of a scene are in one image.
 *
 * Comes with a render request whenever the scene's duration_s is above 0. Its worker evaluates it from the
 * scene's nodes, channels and skins, so that every ray tracer moves alike. All of it is valid during the
 * call only. The elements of its arrays have no struct_size and never grow: step by sizeof.
 */
#ifndef ARHOST_MOTION_H
#define ARHOST_MOTION_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Objects whose `moves` is set, each, in the scene's order. */
typedef struct arhost_moved_object {
    uint32_t object;
    float world_from_object[12]; /* column-major 3×4, invertible */
} arhost_moved_object;

/* Geometries of the objects whose `deforms` is set, each, in the scene's order. Skinned vertices are in the
 * world, that is, world_from_object is the identity. */
typedef struct arhost_deformed_geometry {
    uint32_t object;
    uint32_t vertex_count;  /* that of the geometry in the arena */
    const float *positions; /* FLOAT3, at least 16 readable bytes behind the last */
    const float *normals;   /* FLOAT3, unit length; NULL where the geometry has none */
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
