/* @NAME@: a tracker for arhost. Treats the bright pixels as one white square that faces the camera: their centroid is
 * the centre of the square, and their number is its area. arhost computes the pose from the corners. */
#include <arhost/arhost.h>

#include <math.h>
#include <stdlib.h>

struct arhost_instance {
    const arhost_host *host;
    int64_t threshold;
    arhost_marker_config marker; /* the first configured marker; this tracker does not look for others */
};

static arhost_status start(arhost_instance *self, const arhost_tracker_setup *setup) {
    self->marker = setup->markers[0];
    return ARHOST_STATUS_OK;
}

static arhost_status track(arhost_instance *self, const arhost_track_request *request, arhost_tracker_result *result) {
    const arhost_frame *frame = request->frame;
    const arhost_frame_format *format = frame->format;
    double area = 0, sum_x = 0, sum_y = 0, half;
    arhost_observation *seen = &result->observations[0];
    uint32_t column, row;
    int i;

    /* FILL IN: your detector. */
    for (row = 0; row < format->height; ++row) {
        const uint8_t *grey = frame->grey + (size_t)row * format->grey_stride;
        for (column = 0; column < format->width; ++column)
            if (grey[column] >= self->threshold) {
                area += 1;
                sum_x += column;
                sum_y += row;
            }
    }
    if (area < 100)
        return ARHOST_STATUS_OK; /* no marker in this frame: not an error */
    half = sqrt(area) / 2;

    result->observation_count = 1; /* at most ARHOST_MAX_OBSERVATIONS */
    seen->id = self->marker.id;
    seen->family = self->marker.family;
    seen->hamming = 0;
    seen->decision_margin = 0;
    seen->corner_sigma_px = 0;
    seen->false_positive_rate = 0;
    for (i = 0; i < 4; ++i) { /* top left, top right, bottom right, bottom left on the upright print */
        seen->corners_px[i][0] = sum_x / area + (i == 1 || i == 2 ? half : -half);
        seen->corners_px[i][1] = sum_y / area + (i >= 2 ? half : -half);
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
    self->threshold = arhost_find_option(options, option_count, "threshold")->integer;
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
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "threshold", "200", 1, 255, NULL,
     "Minimum grey level of a bright pixel."},
};
static const arhost_tracker functions = {.struct_size = sizeof functions, .start = start, .track = track, .stop = stop};
static const arhost_descriptor descriptor = {
    .struct_size = sizeof descriptor,
    .kind = ARHOST_KIND_TRACKER,
    .id = "org.example.@NAME@", /* FILL IN: your domain in reverse order; ends with the file name */
    .name = "@NAME@",
    .version = "0.1.0",
    .vendor = "unknown", /* FILL IN: your name */
    .licence = "NONE",   /* FILL IN: SPDX identifier, e.g. "Apache-2.0" */
    .description = "Detects a bright patch as the marker.",
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
