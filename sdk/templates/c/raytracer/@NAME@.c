/* @NAME@: a ray tracer for arhost. It draws one sphere that fills the scene's bounds. */
#include <arhost/arhost.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

struct arhost_instance {
    const arhost_host *host;
    double colour[3]; /* linear light */
    double centre[3], radius;
};

/* ---- vectors ---- */

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
static void cross(double out[3], const double a[3], const double b[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}
static void normalise(double a[3]) {
    const double length = sqrt(dot(a, a));
    int i;
    for (i = 0; i < 3; ++i)
        a[i] /= length;
}

/* ---- the image ---- */

/* The distance along a ray of unit direction to the sphere, or negative where it misses. */
static double hit(const arhost_instance *self, const double origin[3], const double direction[3]) {
    double from_centre[3], b, discriminant;
    int i;
    for (i = 0; i < 3; ++i)
        from_centre[i] = origin[i] - self->centre[i];
    b = dot(from_centre, direction);
    discriminant = b * b - dot(from_centre, from_centre) + self->radius * self->radius;
    return discriminant < 0 ? -1 : -b - sqrt(discriminant);
}

static uint8_t srgb_byte(double linear) {
    const double encoded = linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1 / 2.4) - 0.055;
    return (uint8_t)(255 * fmin(fmax(encoded, 0), 1) + 0.5);
}

static arhost_status render(arhost_instance *self, const arhost_render_request *request, const arhost_image *image,
                            arhost_render_info *info) {
    const arhost_camera *camera = &request->camera;
    const arhost_intrinsics *lens = &camera->intrinsics;
    double right[3], up[3], back[3];
    uint32_t column, row;
    int i;
    (void)info; /* it could tell a region outside of which every alpha is 0 */
    for (i = 0; i < 3; ++i)
        back[i] = camera->eye[i] - camera->look_at[i];
    normalise(back);
    cross(right, camera->up, back);
    normalise(right);
    cross(up, back, right);

    for (row = 0; row < image->height; ++row) {
        uint8_t *pixel = image->rgba + (size_t)row * image->stride;
        if (self->host->cancelled(self->host)) /* arhost wants to end: rows must not keep it waiting */
            return ARHOST_ERROR_CANCELLED;
        for (column = 0; column < image->width; ++column, pixel += 4) {
            /* Pixel centres are at integers, rows run downwards, the camera looks along -back. */
            const double x = (column - lens->cx) / lens->fx, y = (row - lens->cy) / lens->fy;
            double direction[3], distance, light = 0;
            for (i = 0; i < 3; ++i)
                direction[i] = x * right[i] - y * up[i] - back[i];
            normalise(direction);
            distance = hit(self, camera->eye, direction);
            if (distance <= 0) {
                memset(pixel, 0, 4); /* alpha exactly 0: the video shows */
                continue;
            }
            /* FILL IN: your shading. This is a lamp at the camera. */
            for (i = 0; i < 3; ++i)
                light -= direction[i] * (camera->eye[i] + distance * direction[i] - self->centre[i]) / self->radius;
            for (i = 0; i < 3; ++i)
                pixel[i] = srgb_byte(self->colour[i] * (0.1 + 0.9 * light));
            pixel[3] = 255; /* were it less, the colour would still not be multiplied by it */
        }
    }
    return ARHOST_OK;
}

/* ---- start and end ---- */

static arhost_status start(arhost_instance *self, const arhost_raytracer_setup *setup) {
    /* FILL IN: read setup->scene->objects and geometries (arhost/scene.h), build what makes rays fast. */
    const arhost_scene *scene = setup->scene;
    int i;
    self->radius = INFINITY;
    for (i = 0; i < 3; ++i) {
        self->centre[i] = (scene->bounds_min[i] + scene->bounds_max[i]) / 2;
        self->radius = fmin(self->radius, (scene->bounds_max[i] - scene->bounds_min[i]) / 2);
    }
    return ARHOST_OK;
}

static void stop(arhost_instance *self) {
    (void)self;
}

static arhost_status create(const arhost_host *host, const arhost_option *options, uint32_t option_count,
                            arhost_instance **instance) {
    arhost_instance *self = calloc(1, sizeof *self);
    if (!self)
        return ARHOST_ERROR_OUT_OF_MEMORY;
    self->host = host;
    /* Every option that is declared below is there. */
    self->colour[0] = arhost_find_option(options, option_count, "red")->real;
    self->colour[1] = arhost_find_option(options, option_count, "green")->real;
    self->colour[2] = arhost_find_option(options, option_count, "blue")->real;
    *instance = self;
    return ARHOST_OK;
}

static void destroy(arhost_instance *self) {
    free(self);
}

static const void *get_extension(const char *id) {
    (void)id;
    return NULL;
}

/* ---- what it is ---- */

/* arhost checks the configuration against these before create sees a value. */
static const arhost_option_descriptor options[] = {
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_REAL, "red", "0.8", 0, 1, NULL, "Share of red light reflected."},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_REAL, "green", "0.3", 0, 1, NULL, "Likewise green."},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_REAL, "blue", "0.1", 0, 1, NULL, "Likewise blue."},
};
static const arhost_raytracer functions = {sizeof functions, start, render, stop};
static const arhost_descriptor descriptor = {
    .struct_size = sizeof descriptor,
    .kind = ARHOST_KIND_RAYTRACER,
    .id = "@NAME@", /* the file's name */
    .name = "@NAME@",
    .version = "0.1.0",
    .vendor = "unknown", /* FILL IN: you */
    .licence = "NONE",   /* FILL IN: SPDX, "Apache-2.0" */
    .description = "Draws a sphere.",
    .option_count = sizeof options / sizeof *options,
    .options = options,
};
static const arhost_plugin plugin = {sizeof plugin, &descriptor, &functions, create, destroy, get_extension};

static arhost_status negotiate(const arhost_offer *offer, arhost_answer *answer) {
    const uint32_t spoken = ARHOST_ABI_VERSION;
    if (offer->struct_size < sizeof *offer || answer->struct_size < sizeof *answer)
        return ARHOST_ERROR_UNSUPPORTED; /* of a version before this one */
    if (spoken < offer->oldest_abi_version || spoken > offer->newest_abi_version)
        return ARHOST_ERROR_UNSUPPORTED;
    answer->abi_version = spoken;
    answer->plugin = &plugin;
    return ARHOST_OK;
}

ARHOST_EXPORT const arhost_entry_point arhost_entry = {sizeof arhost_entry, negotiate};
