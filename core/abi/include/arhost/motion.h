/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/motion.h: the animated state of a scene at the time of one image.
 *
 * Each render request contains an arhost_motion if an object of the scene moves or deforms. The worker computes it
 * from the scene's nodes, channels, skins and anchors, so ray tracers need not do this. The struct and its arrays are
 * valid only during the call. Array elements have no struct_size and never grow, so they are sizeof(element) bytes
 * apart.
 */
#ifndef ARHOST_MOTION_H
#define ARHOST_MOTION_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The transform of an object whose `moves` is set. There is one entry for each such object, in the order of the
 * scene's objects. */
typedef struct arhost_moved_object {
    uint32_t object;     /* index of the object in the scene */
    uint32_t is_visible; /* 0: all rays must ignore the object, because the target that it is attached to is lost */
    float world_from_object[12]; /* column-major 3×4, invertible; mm */
} arhost_moved_object;

/* The vertices of an object whose `deforms` is set. There is one entry for each such object, in the order of the
 * scene's objects. Vertices of skinned objects are in world coordinates; the world_from_object of these objects is
 * the identity. */
typedef struct arhost_deformed_geometry {
    uint32_t object;        /* index of the object in the scene */
    uint32_t is_visible;    /* as in arhost_moved_object */
    uint32_t vertex_count;  /* same as in the arena, positions.count of the geometry */
    uint32_t reserved;      /* 0 */
    const float *positions; /* 3 floats per vertex; at least 16 readable bytes follow the last one */
    const float *normals;   /* 3 floats per vertex, unit length; NULL if the geometry has no normals */
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
