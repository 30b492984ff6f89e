/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A source of black frames that attempts one attack on the host during `start` or `stop`, or takes resources of the
 * machine at frame 5.
 */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <arhost/arhost.h>

#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { frame_of_attack = 5 };

struct arhost_instance {
    const arhost_host *host;
    char attack[32];
    int64_t frames;
};

static arhost_status create(const arhost_host *host, const arhost_option *options, uint32_t option_count,
                            arhost_instance **instance) {
    arhost_instance *self = calloc(1, sizeof *self);
    if (!self)
        return ARHOST_STATUS_ERROR_OUT_OF_MEMORY;
    self->host = host;
    snprintf(self->attack, sizeof self->attack, "%s", arhost_find_option(options, option_count, "attack")->text);
    self->frames = arhost_find_option(options, option_count, "frames")->integer;
    *instance = self;
    return ARHOST_STATUS_OK;
}
static void destroy(arhost_instance *self) {
    free(self);
}
static const void *get_extension(const char *id) {
    return (void)id, (const void *)0;
}

/* A lens whose rays the host cannot compute in reasonable time. */
static void report_lens(arhost_source_properties *properties) {
    arhost_intrinsics *lens = &properties->intrinsics;
    int i;
    properties->has_intrinsics = 1;
    properties->format.width = properties->format.height = 4096;
    lens->width = lens->height = 4096;
    lens->fx = lens->fy = 4096;
    lens->cx = lens->cy = 2047.5;
    lens->distortion = ARHOST_DISTORTION_BROWN;
    lens->coefficient_count = ARHOST_MAX_DISTORTION;
    for (i = 0; i < ARHOST_MAX_DISTORTION; ++i)
        lens->coefficients[i] = i < 12 ? 1e30 : 0; /* a tilted sensor is refused before the lens is examined */
}

static arhost_status start(arhost_instance *self, const arhost_source_setup *setup,
                           arhost_source_properties *properties) {
    (void)setup;
    properties->format.pixel_format = ARHOST_PIXEL_FORMAT_GREY8;
    properties->format.width = properties->format.height = 64;
    properties->format.fps = 30;
    if (!strcmp(self->attack, "lens"))
        report_lens(properties);
    if (!strcmp(self->attack, "long_error")) {
        static char reason[200 << 10];
        memset(reason, 'x', sizeof reason - 1);
        self->host->log(self->host, ARHOST_SEVERITY_ERROR, reason);
        return ARHOST_STATUS_ERROR_IO;
    }
    while (!strcmp(self->attack, "endless_start"))
        self->host->progress(self->host, 0.5, "still busy");
    return arhost_frame_layout(&properties->format) ? ARHOST_STATUS_OK : ARHOST_STATUS_ERROR_INTERNAL;
}
static void report(const arhost_instance *self, const char *what, long count) {
    char text[64];
    snprintf(text, sizeof text, "%s: %ld", what, count);
    self->host->log(self->host, ARHOST_SEVERITY_INFO, text);
}

/* Each page table of 4 KiB covers 2 MiB. Reading maps the shared page of zeros, so only the page tables need memory:
 * 117 MiB in each process, which RLIMIT_AS permits. */
static void take_page_tables(const arhost_instance *self) {
    const size_t covered = 2 << 20, count = 30000;
    long processes;
    for (processes = 0; processes < 4; ++processes) {
        const pid_t child = fork();
        volatile const char *bytes;
        size_t i;
        if (child > 0)
            continue;
        bytes = mmap(NULL, covered * count, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
        if (child < 0 || bytes == MAP_FAILED)
            break;
        madvise((void *)bytes, covered * count, MADV_NOHUGEPAGE);
        for (i = 0; i < count; ++i)
            (void)bytes[i * covered];
        for (;;)
            pause();
    }
    while (processes == 4) /* together they need more memory than the group has */
        pause();
    report(self, "page tables", processes);
}

static void *wait_forever(void *nothing) {
    for (;;)
        pause();
    return nothing;
}

static void take_threads(const arhost_instance *self) {
    pthread_attr_t small;
    pthread_t thread;
    long count = 0;
    pthread_attr_init(&small);
    pthread_attr_setstacksize(&small, 16384);
    while (count < 2000 && pthread_create(&thread, &small, wait_forever, NULL) == 0)
        ++count;
    report(self, "threads", count);
}

/* Starts processes that leave the session of the worker and ignore all signals but SIGKILL. */
static void leave_processes(const arhost_instance *self) {
    long count;
    int signal_number;
    for (count = 0; count < 3; ++count) {
        const pid_t child = fork();
        if (child < 0)
            break;
        if (child > 0)
            continue;
        setsid();
        for (signal_number = 1; signal_number < NSIG; ++signal_number)
            signal(signal_number, SIG_IGN);
        wait_forever(NULL);
    }
    report(self, "processes", count);
}

static arhost_status read_frame(arhost_instance *self, const arhost_frame_buffer *buffer, arhost_frame_info *info) {
    if (buffer->sequence >= (uint64_t)self->frames)
        return ARHOST_STATUS_END;
    if (buffer->sequence == frame_of_attack && !strcmp(self->attack, "page_tables"))
        take_page_tables(self);
    if (buffer->sequence == frame_of_attack && !strcmp(self->attack, "threads"))
        take_threads(self);
    if (buffer->sequence == frame_of_attack && !strcmp(self->attack, "processes"))
        leave_processes(self);
    memset(buffer->plane[0], 0, (size_t)buffer->format->stride[0] * buffer->format->height);
    info->clock = ARHOST_CLOCK_MEDIA;
    info->capture_ns = (int64_t)buffer->sequence * 33333333;
    return ARHOST_STATUS_OK;
}
static void stop(arhost_instance *self) {
    while (!strcmp(self->attack, "endless_stop"))
        self->host->progress(self->host, 0.5, "still busy");
}

static const arhost_option_descriptor options[] = {
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_TEXT, "attack", "none", 0, 0, NULL, "Name of the attack"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "frames", "10", 0, 0, NULL, "Number of frames"},
};
static const arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                             ARHOST_KIND_SOURCE,
                                             "org.arhost.test.hostile_source",
                                             "Hostile source",
                                             "0.1.0",
                                             "arhost",
                                             "Apache-2.0",
                                             "Attempts attacks on the host, for tests.",
                                             ARHOST_SOURCE_CAPABILITY_SEEK,
                                             sizeof options / sizeof *options,
                                             options,
                                             NULL};
static const arhost_source functions = {sizeof(arhost_source), 0, start, read_frame, stop};
static const arhost_plugin plugin = {sizeof(arhost_plugin), 0, &descriptor, &functions, create, destroy,
                                     get_extension};

static arhost_status negotiate(const arhost_offer *offer, arhost_answer *answer) {
    (void)offer;
    answer->abi_version = ARHOST_ABI_VERSION;
    answer->plugin = &plugin;
    return ARHOST_STATUS_OK;
}

ARHOST_EXPORT const arhost_entry_point arhost_entry = {sizeof(arhost_entry_point), 0, negotiate};
