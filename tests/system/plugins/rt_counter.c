/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A ray tracer in plain C. Draws a square of 16 px in the top left corner. The colour of the square is the frame
 * number, which is derived from the camera's distance: R and G are its low and high byte. If it has state, the square
 * shows how many images it has rendered before instead, which it counts in the first 8 bytes. With the option
 * writes_later, the plugin also writes to the previous image, which the ABI forbids.
 */
#include "misbehave.h"

#include <arhost/arhost.h>

#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#ifndef ID /* rt_history is the same plugin with state by default */
#define ID "rt_counter"
#define STATE_SIZE "0"
#endif

struct arhost_instance {
    const arhost_host *host;
    int64_t crash_at, crash_after, hang_at, hang_until, error_at, error_after, error, answer;
    int64_t images; /* rendered so far */
    double delay_ms;
    int64_t delay_from, delay_until, reports_progress, writes_later, device_time_ns;
    uint64_t state_size;
    uint8_t *last; /* previous image */
};

static arhost_status create(const arhost_host *host, const arhost_option *options, uint32_t option_count,
                            arhost_instance **instance) {
    arhost_instance *self = calloc(1, sizeof *self);
    if (!self)
        return ARHOST_STATUS_ERROR_OUT_OF_MEMORY;
    self->host = host;
    misbehave_install();
    self->crash_at = arhost_find_option(options, option_count, "crash_at")->integer;
    self->crash_after = arhost_find_option(options, option_count, "crash_after")->integer;
    self->hang_at = arhost_find_option(options, option_count, "hang_at")->integer;
    self->hang_until = arhost_find_option(options, option_count, "hang_until")->integer;
    self->error_at = arhost_find_option(options, option_count, "error_at")->integer;
    self->error_after = arhost_find_option(options, option_count, "error_after")->integer;
    self->error = arhost_find_option(options, option_count, "error")->integer;
    self->answer = arhost_find_option(options, option_count, "answer")->integer;
    self->delay_ms = arhost_find_option(options, option_count, "delay_ms")->real;
    self->delay_from = arhost_find_option(options, option_count, "delay_from")->integer;
    self->delay_until = arhost_find_option(options, option_count, "delay_until")->integer;
    self->reports_progress = arhost_find_option(options, option_count, "reports_progress")->integer;
    self->writes_later = arhost_find_option(options, option_count, "writes_later")->integer;
    self->device_time_ns = arhost_find_option(options, option_count, "device_time_ns")->integer;
    self->state_size = (uint64_t)arhost_find_option(options, option_count, "state_size")->integer;
    if (arhost_find_option(options, option_count, "reject")->integer) {
        host->log(host, ARHOST_SEVERITY_ERROR, "rejected, as the option 'reject' requests");
        free(self);
        return ARHOST_STATUS_ERROR_CONFIGURATION;
    }
    if (arhost_find_option(options, option_count, "crash_in_create")->integer) {
        signal(SIGSEGV, SIG_DFL);
        raise(SIGSEGV);
    }
    *instance = self;
    return ARHOST_STATUS_OK;
}

static void destroy(arhost_instance *self) {
    free(self);
}
static const void *get_extension(const char *id) {
    return (void)id, (const void *)0;
}

static arhost_status start(arhost_instance *self, const arhost_raytracer_setup *setup) {
    (void)self;
    return setup->scene->magic == ARHOST_SCENE_MAGIC ? ARHOST_STATUS_OK : ARHOST_STATUS_ERROR_INVALID_ARGUMENT;
}

/* Waits as the option delay_ms requests. Returns whether the host has cancelled the call. */
static int wait_or_cancel(const arhost_instance *self) {
    double left_ms = self->delay_ms;
    while (left_ms > 0 && !self->host->cancelled(self->host)) {
        const double step_ms = left_ms < 50 ? left_ms : 50;
        const struct timespec time = {0, (long)(step_ms * 1e6)};
        nanosleep(&time, NULL);
        left_ms -= step_ms;
        if (self->reports_progress)
            self->host->progress(self->host, -1, "waiting");
    }
    return left_ms > 0;
}

static uint64_t state_size(arhost_instance *self) {
    return self->state_size;
}

/* Returns the number of images that were rendered before. */
static uint64_t count(const arhost_render_request *request) {
    uint64_t before = 0, after;
    if (request->state_before)
        memcpy(&before, request->state_before, sizeof before);
    after = before + 1;
    memset(request->state_after, 0xa5, request->state_size);
    memcpy(request->state_after, &after, sizeof after);
    return before;
}

static arhost_status render(arhost_instance *self, const arhost_render_request *request, const arhost_image *image,
                            arhost_render_info *info) {
    const int64_t number = (int64_t)(request->camera.eye[2] - 500.0 + 0.5);
    const uint64_t shown = request->state_size > 0 ? count(request) : (uint64_t)number;
    uint32_t x, y;
    if (number == self->crash_at || (self->crash_after >= 0 && self->images >= self->crash_after)) {
        signal(SIGSEGV, SIG_DFL);
        raise(SIGSEGV);
    }
    while (number == self->hang_at || (number > self->hang_at && number < self->hang_until))
        pause();
    if (misbehave_if_requested() || number == self->error_at ||
        (self->error_after >= 0 && self->images >= self->error_after))
        return (arhost_status)self->error;
    if (number >= self->delay_from && (self->delay_until < 0 || number < self->delay_until) && wait_or_cancel(self)) {
        self->host->log(self->host, ARHOST_SEVERITY_INFO, "cancelled while waiting");
        return ARHOST_STATUS_ERROR_CANCELLED;
    }
    for (y = 0; y < image->height; ++y)
        for (x = 0; x < image->width; ++x) {
            uint8_t *pixel = image->rgba + (size_t)y * image->stride + 4 * (size_t)x;
            pixel[0] = (uint8_t)shown;
            pixel[1] = (uint8_t)(shown >> 8);
            pixel[2] = 170;
            pixel[3] = x < 16 && y < 16 ? 255 : 0;
        }
    if (self->writes_later && self->last)
        memset(self->last, 0, (size_t)image->stride * image->height);
    self->last = image->rgba;
    ++self->images;
    info->has_region = 1;
    info->region_width = info->region_height = 16;
    info->device_time_ns = (uint64_t)self->device_time_ns;
    return (arhost_status)self->answer;
}

static void stop(arhost_instance *self) {
    (void)self;
}

static const arhost_option_descriptor options[] = {
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "crash_at", "-1", 0, 0, NULL, "Crashes at this frame"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "crash_after", "-1", 0, 0, NULL,
     "Crashes after this many images; -1: never"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "hang_until", "-1", 0, 0, NULL,
     "Also hangs at later frames before this one; -1: none"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "hang_at", "-1", 0, 0, NULL,
     "Never returns from this frame; -1: never"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "error_at", "-1", 0, 0, NULL,
     "Returns an error for this frame"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "error", "-8", 0, 0, NULL,
     "Status to return with error_at and error_after"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "error_after", "-1", 0, 0, NULL,
     "Returns an error after this many images; -1: never"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "answer", "1", 0, 0, NULL,
     "Status to return for each frame"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_REAL, "delay_ms", "0", 0, 600000, NULL,
     "Delay per frame, in ms"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "delay_from", "0", 0, 0, NULL,
     "First frame with the delay"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "delay_until", "-1", 0, 0, NULL,
     "First later frame without the delay; -1: none"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_BOOL, "reports_progress", "false", 0, 0, NULL,
     "Reports progress during the delay"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_BOOL, "writes_later", "false", 0, 0, NULL,
     "Also writes to the previous image"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "device_time_ns", "0", 0, 0, NULL,
     "Reported device time; negative values wrap to huge ones"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "state_size", STATE_SIZE, 0, 0, NULL,
     "Bytes of state: 0, or at least 8"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_BOOL, "reject", "false", 0, 0, NULL, "Fails in create"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_BOOL, "crash_in_create", "false", 0, 0, NULL,
     "Crashes in create"},
};
static const arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                             ARHOST_KIND_RAYTRACER,
                                             "org.arhost.test." ID,
                                             "Counter",
                                             "0.1.0",
                                             "arhost",
                                             "Apache-2.0",
                                             "Draws a frame's number, for tests.",
                                             0,
                                             sizeof options / sizeof *options,
                                             options,
                                             NULL};
static const arhost_raytracer functions = {sizeof(arhost_raytracer), 0, start, render, stop, NULL, state_size};
static const arhost_plugin plugin = {sizeof(arhost_plugin), 0, &descriptor, &functions, create, destroy,
                                     get_extension};

static arhost_status negotiate(const arhost_offer *offer, arhost_answer *answer) {
    const uint32_t spoken = ARHOST_ABI_VERSION;
    if (spoken < offer->oldest_abi_version || spoken > offer->newest_abi_version)
        return ARHOST_STATUS_ERROR_UNSUPPORTED;
    answer->abi_version = spoken;
    answer->plugin = &plugin;
    return ARHOST_STATUS_OK;
}

ARHOST_EXPORT const arhost_entry_point arhost_entry = {sizeof(arhost_entry_point), 0, negotiate};
