/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/raytracer.h: renders the overlay that the host composites over the video.
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
    uint32_t width, height;    /* size of the images, px; with ARHOST_CAPABILITY_SCALED_IMAGES, the maximum size (see
                                  arhost_image) */
    uint32_t reserved;         /* 0 */
    const arhost_scene *scene; /* read-only, valid until `stop`; validated by the host */
    const arhost_intrinsics *intrinsics; /* the same in every request, except with ARHOST_CAPABILITY_SCALED_IMAGES;
                                            precompute ray tables here */
} arhost_raytracer_setup;

typedef struct arhost_render_request {
    uint32_t struct_size;
    uint32_t max_samples; /* limit of the samples per pixel of this image, which the host sets in order to keep the
                             frame rate; 0: no limit. See `full_samples` of arhost_render_info */
    uint64_t sequence;    /* number of the video frame; use it to seed random numbers */
    double time_s;        /* scene time, s */
    arhost_camera camera;
    const arhost_motion *motion; /* NULL if no object moves or deforms */
} arhost_render_request;

/* The image to write: R, G, B, A bytes, straight (not premultiplied) alpha, sRGB-encoded, top row first. Alpha is
 * exactly 0 where the primary ray hits nothing (the colour is then ignored) and 255 on virtual objects. Samples of a
 * pixel are averaged in linear light and then encoded. Samples brighter than white count in full, up to a bound of at
 * least 100 times white. Samples of virtual objects and samples of shadows are averaged separately; the two averages
 * are blended in sRGB, weighted by their shares of the alpha. Near clip: 1e-4 × scene extent. Write every pixel and
 * nothing else. `rgba` is aligned to a 4,096-byte page and its last page is fully mapped, so a GPU can import the
 * memory; leave the bytes after the last row unchanged. Between `start` and `stop`, the pointer `rgba` has at most 8
 * different values. */
typedef struct arhost_image {
    uint32_t struct_size;
    uint32_t stride; /* bytes per row, a multiple of 64 */
    uint32_t width, height;
    uint8_t *rgba;
} arhost_image;

/* Optional results of `render`. The worker sets all fields except struct_size to 0; leave fields that do not apply at
 * 0. */
typedef struct arhost_render_info {
    uint32_t struct_size;
    int32_t has_region; /* non-zero: the following four fields are set; 0: the region is the whole image */
    /* Region, px. Outside it, alpha must be 0; the host skips these pixels. Width 0: the whole image is empty. */
    uint32_t region_x, region_y, region_width, region_height;
    uint64_t device_time_ns; /* device (GPU) time from the image's first command to its last; 0: not measured */
    uint32_t full_samples;   /* samples per pixel that an image without a limit would take, whatever the limit of this
                                one and even if it is empty; without samples accumulated from earlier images. An image
                                with a limit takes the smaller of this number and max_samples. It may change only with
                                an option. 0: this ray tracer ignores max_samples */
    uint32_t reserved;       /* leave 0 */
} arhost_render_info;

typedef struct arhost_raytracer {
    uint32_t struct_size;

    /* [worker, created] Builds acceleration structures and compiles shaders, and reports progress meanwhile. May be
     * called again after `stop`, with another scene and image size. */
    arhost_status (*start)(arhost_instance *instance, const arhost_raytracer_setup *setup);

    /* [worker, started] Renders one image. Equal requests must give identical bytes, with any number of threads,
     * unless an option of the plugin, off by default, says otherwise. */
    arhost_status (*render)(arhost_instance *instance, const arhost_render_request *request,
                            const arhost_image *image, arhost_render_info *info);

    /* [worker, started] Called once after each successful `start`. */
    void (*stop)(arhost_instance *instance);

    /* [worker, created] Optional: may be NULL. Returns the capabilities of this instance, if they depend on its
     * options: the descriptor's capabilities, of which it may clear only bits of ARHOST_CAPABILITY_EVERY_SCENE. */
    uint32_t (*capabilities)(arhost_instance *instance);
} arhost_raytracer;

#ifdef __cplusplus
}
#endif
#endif
