/* @NAME@: a ray tracer for arhost. This file is the plugin: it turns cameras into rays and samples into images.
 * tracer.h traces the rays. */
#include "tracer.h"

#include <stdlib.h>
#include <string.h>

struct arhost_instance {
    const arhost_host *host;
    int side; /* rays per pixel: side × side */
    double shadow_alpha_opaque, shadow_alpha_translucent;
    tracer *tracer;
};

/* ---- the camera ---- */

/* Pixel centres are at integer coordinates, rows go downwards, the camera looks along -back. */
typedef struct view {
    const arhost_intrinsics *lens;
    vec eye, right, up, back; /* axes: unit length */
} view;

/* Returns 0 if up is parallel to the viewing direction, or if a number is not finite. */
static int init_view(view *v, const arhost_camera *camera) {
    const vec up = {camera->up[0], camera->up[1], camera->up[2]};
    const vec look_at = {camera->look_at[0], camera->look_at[1], camera->look_at[2]};
    vec back, right;
    v->lens = &camera->intrinsics;
    v->eye = (vec){camera->eye[0], camera->eye[1], camera->eye[2]};
    back = subtract(v->eye, look_at);
    right = cross(up, back);
    if (!(length(right) > 1e-9 * length(up) * length(back)))
        return 0;
    v->back = normalised(back);
    v->right = normalised(right);
    v->up = cross(v->back, v->right);
    return 1;
}

static ray ray_through(const view *v, double column, double row) {
    const double x = (column - v->lens->cx) / v->lens->fx, y = (row - v->lens->cy) / v->lens->fy;
    const vec ahead = subtract(subtract(scale(x, v->right), scale(y, v->up)), v->back);
    return (ray){v->eye, normalised(ahead), INFINITY};
}

/* ---- the image ---- */

static uint8_t to_byte(double value) {
    return (uint8_t)(255 * fmin(fmax(value, 0), 1) + 0.5);
}
static double srgb(double linear) {
    const double bounded = fmin(fmax(linear, 0), 1);
    return bounded <= 0.0031308 ? 12.92 * bounded : 1.055 * pow(bounded, 1 / 2.4) - 0.055;
}
static double linear_light(double srgb) {
    return srgb <= 0.04045 ? srgb / 12.92 : pow((srgb + 0.055) / 1.055, 2.4);
}

/* Returns the alpha of a shadow. The host composites in sRGB, but a shadow hides a share of the linear light. Alpha is
 * therefore exact only for mid-grey video (sRGB value 0.5). `opaque`, `translucent`: the shares of the light that
 * opaque and translucent objects hide. */
static double shadow_alpha(const arhost_instance *self, double opaque, double translucent) {
    const double grey = linear_light(0.5);
    const double hidden = opaque * (grey - linear_light(0.5 * (1 - self->shadow_alpha_opaque))) +
                          translucent * (grey - linear_light(0.5 * (1 - self->shadow_alpha_translucent)));
    return 1 - 2 * srgb(grey - hidden);
}

/* Averages a grid of rays in linear light. Objects and shadows are averaged separately and then blended by their shares
 * of the alpha. Alpha is straight: the colour is not multiplied by alpha. */
static void write_pixel(uint8_t *pixel, const arhost_instance *self, const view *v, double column, double row) {
    const int side = self->side;
    vec colour = {0, 0, 0};
    double opaque = 0, translucent = 0, others, coverage, alpha, share;
    int i, hits = 0;
    for (i = 0; i < side * side; ++i) {
        const double right = (i % side + 0.5) / side - 0.5, down = (i / side + 0.5) / side - 0.5;
        const sample s = tracer_trace(self->tracer, ray_through(v, column + right, row + down));
        hits += s.is_virtual;
        colour = add(colour, s.colour);
        opaque += s.opaque;
        translucent += s.translucent;
    }
    others = fmax(side * side - hits, 1);
    coverage = (double)hits / (side * side);
    alpha = coverage + (1 - coverage) * shadow_alpha(self, opaque / others, translucent / others);
    share = alpha > 0 ? coverage / alpha : 0; /* shadows are black */
    colour = scale(1 / fmax(hits, 1), colour);
    pixel[0] = to_byte(share * srgb(colour.x));
    pixel[1] = to_byte(share * srgb(colour.y));
    pixel[2] = to_byte(share * srgb(colour.z));
    pixel[3] = to_byte(alpha);
}

static arhost_status render(arhost_instance *self, const arhost_render_request *request, const arhost_image *image,
                            arhost_render_info *info) {
    uint32_t column, row;
    view v;
    (void)info; /* optional: set a region outside of which every alpha is 0 */
    if (!init_view(&v, &request->camera)) {
        self->host->log(self->host, ARHOST_SEVERITY_ERROR,
                        "the camera's up vector is parallel to its viewing direction");
        return ARHOST_STATUS_ERROR_INVALID_ARGUMENT;
    }
    if (request->motion)
        tracer_update(self->tracer, request->motion);
    for (row = 0; row < image->height; ++row) {
        if (self->host->cancelled(self->host)) /* arhost wants this call to return soon */
            return ARHOST_STATUS_ERROR_CANCELLED;
        for (column = 0; column < image->width; ++column)
            write_pixel(image->rgba + (size_t)row * image->stride + 4 * (size_t)column, self, &v, column, row);
    }
    return ARHOST_STATUS_OK;
}

/* ---- start and end ---- */

static arhost_status start(arhost_instance *self, const arhost_raytracer_setup *setup) {
    self->shadow_alpha_opaque = setup->scene->shadow_alpha_opaque;
    self->shadow_alpha_translucent = setup->scene->shadow_alpha_translucent;
    self->tracer = tracer_new(setup->scene);
    if (!self->tracer) {
        self->host->log(self->host, ARHOST_SEVERITY_ERROR, "out of memory");
        return ARHOST_STATUS_ERROR_OUT_OF_MEMORY;
    }
    return ARHOST_STATUS_OK;
}

static void stop(arhost_instance *self) {
    tracer_free(self->tracer);
    self->tracer = NULL;
}

static arhost_status create(const arhost_host *host, const arhost_option *options, uint32_t option_count,
                            arhost_instance **instance) {
    arhost_instance *self = calloc(1, sizeof *self);
    if (!self) {
        host->log(host, ARHOST_SEVERITY_ERROR, "out of memory");
        return ARHOST_STATUS_ERROR_OUT_OF_MEMORY;
    }
    self->host = host;
    /* arhost passes every option declared below. */
    self->side = (int)sqrt((double)arhost_find_option(options, option_count, "samples")->integer);
    *instance = self;
    return ARHOST_STATUS_OK;
}

static void destroy(arhost_instance *self) {
    free(self);
}

static const void *get_extension(const char *id) {
    (void)id;
    return NULL;
}

/* ---- description ---- */

/* arhost validates the configuration against these before it calls create. */
static const arhost_option_descriptor options[] = {
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "samples", "1", 1, 64, NULL,
     "Rays per pixel, rounded down to a square number."},
};
static const arhost_raytracer functions = {.struct_size = sizeof functions, .start = start, .render = render, .stop = stop};
static const arhost_descriptor descriptor = {
    .struct_size = sizeof descriptor,
    .kind = ARHOST_KIND_RAYTRACER,
    .id = "org.example.@NAME@", /* FILL IN: your domain in reverse order; ends with the file name */
    .name = "@NAME@",
    .version = "0.1.0",
    .vendor = "unknown", /* FILL IN: your name */
    .licence = "NONE",   /* FILL IN: SPDX identifier, e.g. "Apache-2.0" */
    .description = "Brute-force ray tracer.",
    /* FILL IN: what you implement, such as ARHOST_RAYTRACER_CAPABILITY_TEXTURES or ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION. arhost warns
     * if a scene needs more. */
    .capabilities = ARHOST_RAYTRACER_CAPABILITY_REFLECTION | ARHOST_RAYTRACER_CAPABILITY_MOTION,
    .option_count = sizeof options / sizeof *options,
    .options = options,
};
static const arhost_plugin plugin = {sizeof plugin, 0, &descriptor, &functions, create, destroy, get_extension};

static arhost_status negotiate(const arhost_offer *offer, arhost_answer *answer) {
    const uint32_t version = ARHOST_ABI_VERSION;
    if (offer->struct_size < sizeof *offer || answer->struct_size < sizeof *answer)
        return ARHOST_STATUS_ERROR_UNSUPPORTED; /* an older layout of these structs */
    if (version < offer->oldest_abi_version || version > offer->newest_abi_version)
        return ARHOST_STATUS_ERROR_UNSUPPORTED;
    answer->abi_version = version;
    answer->plugin = &plugin;
    return ARHOST_STATUS_OK;
}

ARHOST_EXPORT const arhost_entry_point arhost_entry = {sizeof arhost_entry, 0, negotiate};
