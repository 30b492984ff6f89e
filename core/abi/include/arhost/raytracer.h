/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/raytracer.h: renders the overlay that the host composites over the video.
 */
#ifndef ARHOST_RAYTRACER_H
#define ARHOST_RAYTRACER_H

#include "camera.h"
#include "frame.h"
#include "motion.h"
#include "plugin.h"
#include "scene.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Bits of arhost_descriptor.capabilities. */
typedef uint64_t arhost_raytracer_capabilities;
/* Applies the lens distortion of arhost_intrinsics. */
#define ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION 0x1ull
/* Renders images of any size up to that in arhost_raytracer_setup. In each call of `render`, arhost_image contains
 * the size. The intrinsics for this size are those that arhost_scaled_intrinsics returns. */
#define ARHOST_RAYTRACER_CAPABILITY_SCALED_IMAGES 0x2ull
/* Can write images of ARHOST_IMAGE_FORM_LINEAR. */
#define ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES 0x4ull
/* Reads arhost_render_request.video. */
#define ARHOST_RAYTRACER_CAPABILITY_VIDEO 0x8ull
/* Writes arhost_image.depth_mm. */
#define ARHOST_RAYTRACER_CAPABILITY_DEPTH 0x10ull
/* Reserved: reads arhost_render_request.estimate. */
#define ARHOST_RAYTRACER_CAPABILITY_ESTIMATE 0x20ull
/* The features of a scene that the ray tracer renders, in addition to diffuse materials and point, directional and
 * spot lights. It should also accept scenes with other features: it shades other materials as diffuse, ignores
 * textures and the environment, ignores area lights or treats them as point lights, and leaves moving objects where
 * they are at time 0. The worker then warns the user. If an incomplete image is useless, `start` may reject the scene
 * with ARHOST_STATUS_ERROR_UNSUPPORTED. */
#define ARHOST_RAYTRACER_CAPABILITY_REFLECTION 0x100ull   /* the materials SPECULAR, MIRROR and METAL */
#define ARHOST_RAYTRACER_CAPABILITY_GLASS 0x200ull        /* GLASS, and METALLIC_ROUGHNESS with transmission */
#define ARHOST_RAYTRACER_CAPABILITY_ROUGHNESS 0x400ull    /* METALLIC_ROUGHNESS, and rough GLASS */
#define ARHOST_RAYTRACER_CAPABILITY_TEXTURES 0x800ull     /* textures of materials */
#define ARHOST_RAYTRACER_CAPABILITY_AREA_LIGHTS 0x1000ull /* rectangles and spheres */
#define ARHOST_RAYTRACER_CAPABILITY_ENVIRONMENT 0x2000ull /* the environment map */
#define ARHOST_RAYTRACER_CAPABILITY_MOTION 0x4000ull      /* arhost_motion */
#define ARHOST_RAYTRACER_CAPABILITY_EVERY_SCENE 0x7f00ull /* all bits from REFLECTION to MOTION */

/* The meaning of the pixels of an image. */
typedef int32_t arhost_image_form;
enum {
    ARHOST_IMAGE_FORM_STRAIGHT = 1, /* arhost_image.rgba: colour and alpha, 8 bits each */
    /* arhost_image.linear: added light and transmittance, both per channel. Only with
     * ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES */
    ARHOST_IMAGE_FORM_LINEAR = 2
};

/* The space in which the host blends a straight image with the video. Linear images always add linear light. */
typedef int32_t arhost_compositing;
enum {
    ARHOST_COMPOSITING_SRGB = 1,  /* sRGB codes */
    ARHOST_COMPOSITING_LINEAR = 2 /* linear light: an alpha of 0.3 removes 30 % of the video's light */
};

typedef struct arhost_raytracer_setup {
    uint32_t struct_size;
    uint32_t width, height;    /* size of the images, px; with ARHOST_RAYTRACER_CAPABILITY_SCALED_IMAGES, the maximum
                                  size (see arhost_image) */
    arhost_image_form form;    /* of every image until `stop` */
    const arhost_scene *scene; /* read-only, valid until `stop`; validated by the host */
    const arhost_intrinsics *intrinsics; /* the same in every request, except with
                                            ARHOST_RAYTRACER_CAPABILITY_SCALED_IMAGES; precompute ray tables here */
    arhost_compositing compositing;
    uint32_t reserved;                       /* 0 */
    const arhost_frame_format *video_format; /* of every arhost_render_request.video; NULL: there is no video */
} arhost_raytracer_setup;

typedef struct arhost_render_request {
    uint32_t struct_size;
    uint32_t max_samples; /* limit of the samples per pixel of this image, which the host sets in order to keep the
                             frame rate; 0: no limit. See `full_samples` of arhost_render_info */
    uint64_t sequence;    /* number of the video frame; use it to seed random numbers */
    double time_s;        /* scene time, s */
    arhost_camera camera;
    const arhost_motion *motion; /* NULL if no object moves or deforms */
    /* The frame under the overlay, without virtual objects, for mirrors, glass and the light that real surfaces
     * reflect. Its codes are sRGB (`transfer` of its format), its intrinsics those of the setup. Only with
     * ARHOST_RAYTRACER_CAPABILITY_VIDEO; else NULL. Also NULL if the worker warps the image
     * (ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION)
     */
    const arhost_frame *video;
    /* Memory of the ray tracer that survives the end of the worker process, because the host keeps it: accumulated
     * samples, for example. Both pointers are aligned to 4,096 bytes; both are NULL if `state_size` is 0.
     * `state_before`, read-only: the `state_after` of the last accepted call, even if another worker process made
     * that call. NULL in the first image after a start with another scene or size of the setup (store the size of the
     * image in the state if it may be scaled), and after a swap to another ray tracer, a fallback, or a restart with
     * another version or another state_size. `state_after`: its initial content is undefined; write it completely.
     * The host discards it if the call fails, and may discard it even if the call succeeds. */
    const void *state_before;
    void *state_after;
    uint64_t state_size; /* bytes of each; 0 if both are NULL */
    /* Reserved for what is known of the room: light, depth and exposure. NULL without
     * ARHOST_RAYTRACER_CAPABILITY_ESTIMATE, and in this version always. */
    const void *estimate;
    /* Side of the squares of pixels of each of which only one needs to be shaded, in turn from image to image: 2 if
     * the host lowers the quality in order to keep the frame rate; 0 or 1: all pixels. Edges keep their resolution;
     * other pixels are filled from the shaded ones. See `coarsest_shading_px` of arhost_render_info */
    uint32_t shading_px;
    uint32_t reserved; /* 0 */
} arhost_render_request;

/* The image to write, top row first. Write every pixel and nothing else; leave the bytes after the last row
 * unchanged. The pixels are aligned to a 4,096-byte page and their last page is fully mapped, so a GPU can import the
 * memory. Between `start` and `stop`, the pointer has at most 8 different values. Near clip: 1e-4 × scene extent.
 *
 * ARHOST_IMAGE_FORM_STRAIGHT: R, G, B, A bytes, straight (not premultiplied) alpha, sRGB-encoded. Alpha is exactly 0
 * where the primary ray hits nothing (the colour is then ignored) and 255 on virtual objects. Samples of a pixel are
 * averaged in linear light and then encoded. Samples brighter than white count in full, up to a bound of at least 100
 * times white. Samples of virtual objects and samples of shadows are averaged separately; the two averages are
 * blended in sRGB, weighted by their shares of the alpha.
 * With ARHOST_INTEGRATOR_PATH, alpha is the mean share of the video's light that a linear image would remove
 * (ARHOST_COMPOSITING_LINEAR), or the alpha that removes this share from mid-grey video (ARHOST_COMPOSITING_SRGB).
 * Light that is added on real surfaces is lost.
 *
 * ARHOST_IMAGE_FORM_LINEAR: eight half-precision floats (IEEE 754 binary16) per pixel: added light R, G, B, 0, then
 * transmittance R, G, B, 0. The host shows added + transmittance · video in each channel, where the video is linear
 * light from 0 to 1. A pixel that virtual objects do not affect is exactly (0, 0, 0, 0; 1, 1, 1, 0). On virtual
 * objects, the transmittance is 0, at their edges the share of the pixel that they leave free. On a catcher, it is
 * the light that arrives with the virtual objects divided by the light that arrives without them; it exceeds 1 where
 * they reflect light onto the catcher. All values are finite and not negative.
 *
 * depth_mm: for each pixel, the distance in mm along the camera's optical axis, like arhost_frame.depth_mm, from the
 * camera to the nearest virtual object that the pixel shows; infinity where it shows none, also on catchers and
 * shadows. */
typedef struct arhost_image {
    uint32_t struct_size;
    uint32_t stride; /* bytes per row, a multiple of 64 */
    uint32_t width, height;
    uint8_t *rgba;    /* NULL unless the form is ARHOST_IMAGE_FORM_STRAIGHT */
    uint16_t *linear; /* NULL unless the form is ARHOST_IMAGE_FORM_LINEAR */
    /* NULL without ARHOST_RAYTRACER_CAPABILITY_DEPTH, and if nobody needs the depth, as in this version always.
     * Element x of row y is at y · width + x. */
    float *depth_mm;
} arhost_image;

/* Optional results of `render`. The worker sets all fields except struct_size to 0; leave fields that do not apply at
 * 0. */
typedef struct arhost_render_info {
    uint32_t struct_size;
    int32_t has_region; /* non-zero: the following four fields are set; 0: the region is the whole image */
    /* Region, px. Outside it, virtual objects affect no pixel; the host skips these pixels. Width 0: the whole image
     * is empty. */
    uint32_t region_x, region_y, region_width, region_height;
    uint64_t device_time_ns; /* device (GPU) time from the image's first command to its last; 0: not measured */
    uint32_t full_samples;   /* samples per pixel that an image without a limit would take, whatever the limit of this
                                one and even if it is empty; without samples accumulated from earlier images. An image
                                with a limit takes the smaller of this number and max_samples. It may change only with
                                an option. 0: this ray tracer ignores max_samples */
    uint32_t coarsest_shading_px; /* largest useful `shading_px` of a request, whatever that of this one and even if
                                     the image is empty. It may change only with an option. 0: this ray tracer
                                     ignores shading_px */
} arhost_render_info;

typedef struct arhost_raytracer {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */

    /* [worker, created] Builds acceleration structures and compiles shaders, and reports progress meanwhile. May be
     * called again after `stop`, with another scene and image size. */
    arhost_status (*start)(arhost_instance *instance, const arhost_raytracer_setup *setup);

    /* [worker, started] Renders one image. Equal requests, including equal bytes of state_before, must give identical
     * bytes of the image and of state_after, with any number of threads, unless an option of the plugin, off by
     * default, says otherwise. Frames may be missing or repeated. */
    arhost_status (*render)(arhost_instance *instance, const arhost_render_request *request,
                            const arhost_image *image, arhost_render_info *info);

    /* [worker, started] Called once after each successful `start`. */
    void (*stop)(arhost_instance *instance);

    /* [worker, created] Optional: may be NULL. Returns the capabilities of this instance, if they depend on its
     * options: the descriptor's, of which it may clear bits of …_EVERY_SCENE, …_LINEAR_IMAGES and …_VIDEO. */
    arhost_raytracer_capabilities (*capabilities)(arhost_instance *instance);

    /* [worker, started] Optional; NULL: no memory. Called once after each successful `start`. Returns the size in
     * bytes of the memory that the ray tracer needs from image to image (arhost_render_request.state_before) for
     * images of the setup's size. Three states and three images must fit into the memory that the worker may use. */
    uint64_t (*state_size)(arhost_instance *instance);
} arhost_raytracer;

#ifdef __cplusplus
}
#endif
#endif
