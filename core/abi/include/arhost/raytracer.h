/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/raytracer.h: makes the image that is laid over the video.
 */
#ifndef ARHOST_RAYTRACER_H
#define ARHOST_RAYTRACER_H

#include "camera.h"
#include "motion.h"
#include "plugin.h"
#include "scene.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct arhost_raytracer_setup {
    uint32_t struct_size;
    uint32_t width, height;              /* px, of the images to make */
    uint32_t reserved;                   /* 0 */
    const arhost_scene *scene;           /* read-only, valid until stop; checked by the host */
    const arhost_intrinsics *intrinsics; /* those that every request will bear: build ray tables now */
} arhost_raytracer_setup;

typedef struct arhost_render_request {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */
    uint64_t sequence; /* of the video frame; the seed of anything random */
    double time_s;     /* scene time */
    arhost_camera camera;
    const arhost_motion *motion; /* NULL where the scene's duration_s is 0 */
} arhost_render_request;

/* The image to write. RGBA8: R, G, B, A bytes; straight (not premultiplied) alpha; sRGB-encoded; first row at the
 * top. Alpha is exactly 0 where no ray hit (colour is ignored there) and 255 on virtual objects. Drawn is what is
 * 1e-4 of the scene's extent before the eye, or farther. Every pixel must be written, and no byte outside them.
 * `rgba` begins a page of 4096 bytes, and its last page is mapped whole, so that a GPU can import the memory; what
 * lies there behind the last row stays untouched. From start to stop the same few addresses (8 at most) come again
 * and again. */
typedef struct arhost_image {
    uint32_t struct_size;
    uint32_t stride; /* bytes a row, a multiple of 64 */
    uint32_t width, height;
    uint8_t *rgba;
} arhost_image;

/* What `render` tells of the image. Comes zeroed but for struct_size, which stands for "all of it". */
typedef struct arhost_render_info {
    uint32_t struct_size;
    int32_t has_region; /* non-zero: the region below is set */
    /* A rectangle outside of which every alpha is 0: the host need not look there. Empty: width 0. */
    uint32_t region_x, region_y, region_width, region_height;
    uint64_t device_time_ns; /* by the device's own clock, of a GPU say, from the image's first command to its last;
                                0: not told */
} arhost_render_info;

typedef struct arhost_raytracer {
    uint32_t struct_size;

    /* [worker] After create, and again after a stop, then with another scene and size: builds acceleration
     * structures, compiles shaders; reports progress. */
    arhost_status (*start)(arhost_instance *instance, const arhost_raytracer_setup *setup);

    /* [worker] Traces one image. The same request gives the same bytes, on any number of threads. */
    arhost_status (*render)(arhost_instance *instance, const arhost_render_request *request,
                            const arhost_image *image, arhost_render_info *info);

    /* [worker] Once after each start that succeeded, before the next or destroy. */
    void (*stop)(arhost_instance *instance);
} arhost_raytracer;

#ifdef __cplusplus
}
#endif
#endif
