/* @NAME@: a sink for arhost. It writes each frame as a picture, <path>000000.ppm and so on. */
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

/* Tells the user what went wrong with a file. */
static arhost_status complain(const arhost_instance *self, const char *file) {
    char text[PATH_SIZE + 256];
    snprintf(text, sizeof text, "can't write %s: %s", file, strerror(errno));
    self->host->log(self->host, ARHOST_SEVERITY_ERROR, text);
    return ARHOST_STATUS_ERROR_IO;
}

static arhost_status start(arhost_instance *self, const arhost_sink_setup *setup) {
    char part[PATH_SIZE + 8];
    FILE *file;
    char *slash = strrchr(self->path, '/');
    *slash = 0;
    mkdir(self->path, 0777); /* there already, most times */
    *slash = '/';
    /* Where nothing can be written this tells so now. It leaves what is there as it is until the first frame:
     * another component may yet refuse the run. */
    snprintf(part, sizeof part, "%s.part", self->path);
    file = fopen(part, "wb");
    if (!file)
        return complain(self, part);
    fclose(file);
    remove(part);
    self->row = malloc(3 * (size_t)setup->width);
    if (!self->row) {
        self->host->log(self->host, ARHOST_SEVERITY_ERROR, "out of memory");
        return ARHOST_STATUS_ERROR_OUT_OF_MEMORY;
    }
    return ARHOST_STATUS_OK;
}

static arhost_status write_frame(arhost_instance *self, const arhost_output *output) {
    char name[PATH_SIZE + 32], part[PATH_SIZE + 8];
    uint32_t column, row;
    FILE *file;
    int whole;
    snprintf(name, sizeof name, "%s%06llu.ppm", self->path, (unsigned long long)output->record->sequence);
    snprintf(part, sizeof part, "%s.part", self->path);

    /* FILL IN: what becomes of a frame. output->record tells its pose, its time and how its overlay arose. */
    file = fopen(part, "wb");
    if (!file)
        return complain(self, part);
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
    whole = !ferror(file);
    if (fclose(file) != 0 || !whole || rename(part, name) != 0) /* under its own name only when it is whole */
        return complain(self, name);
    return ARHOST_STATUS_OK; /* the frame must now survive the death of this process */
}

static arhost_status stop(arhost_instance *self) {
    free(self->row);
    self->row = NULL;
    return ARHOST_STATUS_OK; /* all files are whole */
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

/* ---- what it is ---- */

/* arhost checks the configuration against these before create sees a value. */
static const arhost_option_descriptor options[] = {
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_OUTPUT_PATH, "path", NULL, 0, 0, NULL,
     "What the pictures' names begin with; a number and .ppm follow."},
};
static const arhost_sink functions = {sizeof functions, start, write_frame, NULL, stop};
static const arhost_descriptor descriptor = {
    .struct_size = sizeof descriptor,
    .kind = ARHOST_KIND_SINK,
    .id = "@NAME@", /* the file's name */
    .name = "@NAME@",
    .version = "0.1.0",
    .vendor = "unknown", /* FILL IN: you */
    .licence = "NONE",   /* FILL IN: SPDX, "Apache-2.0" */
    .description = "Writes each frame as a picture (PPM).",
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
