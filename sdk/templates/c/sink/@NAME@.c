/* @NAME@: a sink for arhost. Writes each frame as an image: <path>000000.ppm, … */
#include <arhost/arhost.h>

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { PATH_SIZE = 4096 };

struct arhost_instance {
    const arhost_host *host;
    char path[PATH_SIZE]; /* absolute */
    uint8_t *row;
};

/* Logs errno for a file. */
static arhost_status io_error(const arhost_instance *self, const char *file) {
    char text[PATH_SIZE + 256];
    snprintf(text, sizeof text, "cannot write %s: %s", file, strerror(errno));
    self->host->log(self->host, ARHOST_SEVERITY_ERROR, text);
    return ARHOST_STATUS_ERROR_IO;
}

static arhost_status start(arhost_instance *self, const arhost_sink_setup *setup) {
    char temporary[PATH_SIZE + 8];
    FILE *file;
    char *slash = strrchr(self->path, '/');
    *slash = 0;
    mkdir(self->path, 0777); /* may exist already */
    *slash = '/';
    /* Report an unwritable path now, but leave existing files unchanged until the first frame: another component may
     * still reject the run. */
    snprintf(temporary, sizeof temporary, "%s.part", self->path);
    file = fopen(temporary, "wb");
    if (!file)
        return io_error(self, temporary);
    fclose(file);
    remove(temporary);
    self->row = malloc(3 * (size_t)setup->width);
    if (!self->row) {
        self->host->log(self->host, ARHOST_SEVERITY_ERROR, "out of memory");
        return ARHOST_STATUS_ERROR_OUT_OF_MEMORY;
    }
    return ARHOST_STATUS_OK;
}

static arhost_status write_frame(arhost_instance *self, const arhost_output *output) {
    char name[PATH_SIZE + 32], temporary[PATH_SIZE + 8];
    uint32_t column, row;
    FILE *file;
    int complete;
    snprintf(name, sizeof name, "%s%06llu.ppm", self->path, (unsigned long long)output->record->sequence);
    snprintf(temporary, sizeof temporary, "%s.part", self->path);

    /* FILL IN: your output. output->record has the frame's pose, time and more. */
    file = fopen(temporary, "wb");
    if (!file)
        return io_error(self, temporary);
    fprintf(file, "P6\n%u %u\n255\n", output->width, output->height);
    for (row = 0; row < output->height; ++row) {
        const uint8_t *bgr = output->bgr + (size_t)row * output->stride;
        for (column = 0; column < output->width; ++column) {
            self->row[3 * column + 0] = bgr[3 * column + 2];
            self->row[3 * column + 1] = bgr[3 * column + 1];
            self->row[3 * column + 2] = bgr[3 * column + 0];
        }
        fwrite(self->row, 3, output->width, file);
    }
    complete = !ferror(file);
    if (fclose(file) != 0 || !complete ||
        rename(temporary, name) != 0) /* atomic: only complete files get the final name */
        return io_error(self, name);
    return ARHOST_STATUS_OK; /* from here on the frame must survive a kill of the process */
}

static arhost_status stop(arhost_instance *self) {
    free(self->row);
    self->row = NULL;
    return ARHOST_STATUS_OK; /* all files are complete */
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
    snprintf(self->path, sizeof self->path, "%s", arhost_find_option(options, option_count, "path")->text);
    *instance = self;
    return ARHOST_STATUS_OK;
}

static void destroy(arhost_instance *self) {
    free(self->row);
    free(self);
}

static const void *get_extension(const char *id) {
    (void)id;
    return NULL;
}

/* ---- description ---- */

/* arhost validates the configuration against these before it calls create. */
static const arhost_option_descriptor options[] = {
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_OUTPUT_PATH, "path", NULL, 0, 0, NULL,
     "Prefix of the file names; a number and .ppm are appended."},
};
static const arhost_sink functions = {.struct_size = sizeof functions, .start = start, .write = write_frame, .stop = stop};
static const arhost_descriptor descriptor = {
    .struct_size = sizeof descriptor,
    .kind = ARHOST_KIND_SINK,
    .id = "org.example.@NAME@", /* FILL IN: your domain in reverse order; ends with the file name */
    .name = "@NAME@",
    .version = "0.1.0",
    .vendor = "unknown", /* FILL IN: your name */
    .licence = "NONE",   /* FILL IN: SPDX identifier, e.g. "Apache-2.0" */
    .description = "Writes each frame as an image (PPM).",
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
