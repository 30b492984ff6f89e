/* @NAME@: a source for arhost. It gives a gradient that moves. */
#define _POSIX_C_SOURCE 200809L
#include <arhost/arhost.h>

#include <stdlib.h>
#include <time.h>

struct arhost_instance {
    const arhost_host *host;
    uint32_t width, height;
    uint64_t frames; /* 0: endless */
    double fps;
    int paced;
    int64_t began_ns; /* CLOCK_MONOTONIC at frame 0, where paced */
};

static int64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static arhost_status start(arhost_instance *self, const arhost_source_setup *setup,
                           arhost_source_properties *properties) {
    /* FILL IN: open the device or the file. */
    self->fps = setup->fps > 0 ? setup->fps : 30;
    self->paced = setup->paced;
    self->began_ns = now_ns() - (int64_t)(1e9 * (double)setup->first_sequence / self->fps);
    properties->frame_count = self->frames;
    properties->format.pixel_format = ARHOST_PIXEL_FORMAT_RGB8;
    properties->format.width = self->width;
    properties->format.height = self->height;
    properties->format.fps = self->fps;
    if (!arhost_frame_layout(&properties->format)) {
        self->host->log(self->host, ARHOST_SEVERITY_ERROR, "width and height are none that a frame can have");
        return ARHOST_STATUS_ERROR_CONFIGURATION;
    }
    return ARHOST_STATUS_OK;
}

static arhost_status read(arhost_instance *self, const arhost_frame_buffer *buffer, arhost_frame_info *info) {
    const arhost_frame_format *format = buffer->format;
    const uint64_t n = buffer->sequence;
    uint32_t column, row;
    if (self->frames > 0 && n >= self->frames)
        return ARHOST_STATUS_END;

    info->clock = ARHOST_CLOCK_MEDIA; /* of a camera: ARHOST_CLOCK_MONOTONIC, when the picture was taken */
    info->capture_ns = (int64_t)(1e9 * (double)n / self->fps);
    while (self->paced && now_ns() < self->began_ns + info->capture_ns) {
        const struct timespec moment = {0, 2000000};
        if (self->host->cancelled(self->host)) /* whatever waits asks this */
            return ARHOST_STATUS_ERROR_CANCELLED;
        nanosleep(&moment, NULL);
    }

    /* FILL IN: your pixels. The grey plane that trackers see is made of them by arhost. */
    for (row = 0; row < format->height; ++row) {
        uint8_t *rgb = buffer->plane[0] + (size_t)row * format->stride[0];
        for (column = 0; column < format->width; ++column) {
            *rgb++ = (uint8_t)(column + 4 * n);
            *rgb++ = (uint8_t)row;
            *rgb++ = 128;
        }
    }
    return ARHOST_STATUS_OK;
}

static void stop(arhost_instance *self) {
    (void)self;
}

static arhost_status create(const arhost_host *host, const arhost_option *options, uint32_t option_count,
                            arhost_instance **instance) {
    arhost_instance *self = calloc(1, sizeof *self);
    if (!self) {
        host->log(host, ARHOST_SEVERITY_ERROR, "out of memory");
        return ARHOST_STATUS_ERROR_OUT_OF_MEMORY;
    }
    self->host = host;
    /* Every option that is declared below is there. */
    self->width = (uint32_t)arhost_find_option(options, option_count, "width")->integer;
    self->height = (uint32_t)arhost_find_option(options, option_count, "height")->integer;
    self->frames = (uint64_t)arhost_find_option(options, option_count, "frames")->integer;
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

/* ---- what it is ---- */

/* arhost checks the configuration against these before create sees a value. */
static const arhost_option_descriptor options[] = {
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "width", "640", 1, 4096, NULL, "Image width in px."},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "height", "360", 1, 4096, NULL, "Image height in px."},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "frames", "60", 0, 1e9, NULL,
     "Ends after so many; 0: endless."},
};
static const arhost_source functions = {sizeof functions, start, read, stop};
static const arhost_descriptor descriptor = {
    .struct_size = sizeof descriptor,
    .kind = ARHOST_KIND_SOURCE,
    .id = "@NAME@", /* the file's name */
    .name = "@NAME@",
    .version = "0.1.0",
    .vendor = "unknown", /* FILL IN: you */
    .licence = "NONE",   /* FILL IN: SPDX, "Apache-2.0" */
    .description = "A gradient that moves.",
    .capabilities = ARHOST_CAPABILITY_SEEK, /* frame n is the same, whatever was read before */
    .option_count = sizeof options / sizeof *options,
    .options = options,
};
static const arhost_plugin plugin = {sizeof plugin, &descriptor, &functions, create, destroy, get_extension};

static arhost_status negotiate(const arhost_offer *offer, arhost_answer *answer) {
    const uint32_t spoken = ARHOST_ABI_VERSION;
    if (offer->struct_size < sizeof *offer || answer->struct_size < sizeof *answer)
        return ARHOST_STATUS_ERROR_UNSUPPORTED; /* of a version before this one */
    if (spoken < offer->oldest_abi_version || spoken > offer->newest_abi_version)
        return ARHOST_STATUS_ERROR_UNSUPPORTED;
    answer->abi_version = spoken;
    answer->plugin = &plugin;
    return ARHOST_STATUS_OK;
}

ARHOST_EXPORT const arhost_entry_point arhost_entry = {sizeof arhost_entry, negotiate};
