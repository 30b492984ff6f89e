/* @NAME@: a source for arhost. Produces a moving gradient. */
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
    int64_t start_ns; /* CLOCK_MONOTONIC at frame 0; used if paced */
};

static int64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static arhost_status start(arhost_instance *self, const arhost_source_setup *setup,
                           arhost_source_properties *properties) {
    /* FILL IN: open the device or file. */
    self->fps = setup->fps > 0 ? setup->fps : 30;
    self->paced = setup->paced;
    self->start_ns = now_ns() - (int64_t)(1e9 * (double)setup->first_sequence / self->fps);
    properties->frame_count = self->frames;
    properties->format.pixel_format = ARHOST_PIXEL_FORMAT_RGB8;
    properties->format.width = self->width;
    properties->format.height = self->height;
    properties->format.fps = self->fps;
    if (!arhost_frame_layout(&properties->format)) {
        self->host->log(self->host, ARHOST_SEVERITY_ERROR, "invalid width or height");
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

    info->clock = ARHOST_CLOCK_MEDIA; /* for a camera: ARHOST_CLOCK_MONOTONIC, at the time of exposure */
    info->capture_ns = (int64_t)(1e9 * (double)n / self->fps);
    while (self->paced && now_ns() < self->start_ns + info->capture_ns) {
        const struct timespec two_ms = {0, 2000000};
        if (self->host->cancelled(self->host)) /* poll this in every wait */
            return ARHOST_STATUS_ERROR_CANCELLED;
        nanosleep(&two_ms, NULL);
    }

    /* FILL IN: your pixels. arhost computes the grey plane for trackers from them. */
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
    /* arhost passes every option declared below. */
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

/* ---- description ---- */

/* arhost validates the configuration against these before it calls create. */
static const arhost_option_descriptor options[] = {
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "width", "640", 1, 4096, NULL, "Image width in px."},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "height", "360", 1, 4096, NULL, "Image height in px."},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "frames", "60", 0, 1e9, NULL,
     "Number of frames; 0: endless."},
};
static const arhost_source functions = {.struct_size = sizeof functions, .start = start, .read = read, .stop = stop};
static const arhost_descriptor descriptor = {
    .struct_size = sizeof descriptor,
    .kind = ARHOST_KIND_SOURCE,
    .id = "org.example.@NAME@", /* FILL IN: your domain in reverse order; ends with the file name */
    .name = "@NAME@",
    .version = "0.1.0",
    .vendor = "unknown", /* FILL IN: your name */
    .licence = "NONE",   /* FILL IN: SPDX identifier, e.g. "Apache-2.0" */
    .description = "Moving gradient.",
    .capabilities = ARHOST_SOURCE_CAPABILITY_SEEK, /* frame n is the same wherever reading starts */
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
