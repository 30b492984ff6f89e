/* SPDX-License-Identifier: Apache-2.0 */
/* A plugin that can only list devices (arhost/devices.h). Macros: LIST is the function that lists them, ID the
 * plugin's id. */
#define _GNU_SOURCE
#include <arhost/arhost.h>

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static void report(arhost_take_device take, void *context, uint32_t index, const char *name, const char *abilities) {
    arhost_device device;
    memset(&device, 0, sizeof device);
    device.struct_size = sizeof device;
    device.index = index;
    device.kind = ARHOST_DEVICE_INTEGRATED_GPU;
    device.state = ARHOST_DEVICE_STATE_USABLE;
    device.name = name;
    device.abilities = abilities;
    take(context, &device);
}

static inline arhost_status list_crash(const arhost_host *host, arhost_take_device take, void *context) {
    (void)host;
    report(take, context, 0, "The last one", NULL);
    signal(SIGSEGV, SIG_DFL);
    raise(SIGSEGV);
    return ARHOST_STATUS_OK;
}
static inline arhost_status list_hang(const arhost_host *host, arhost_take_device take, void *context) {
    (void)host, (void)take, (void)context;
    for (;;)
        pause();
    return ARHOST_STATUS_OK;
}
static inline arhost_status list_fail(const arhost_host *host, arhost_take_device take, void *context) {
    (void)take, (void)context;
    host->log(host, ARHOST_SEVERITY_ERROR, "the driver is too old");
    return ARHOST_STATUS_ERROR_UNSUPPORTED;
}
static inline arhost_status list_broken(const arhost_host *host, arhost_take_device take, void *context) {
    (void)host;
    report(take, context, 0, NULL, NULL);
    return ARHOST_STATUS_OK;
}
/* Lists 10,000 devices with texts of 1 MiB. The texts consist of quotation marks, which JSON must escape. */
static inline arhost_status list_many(const arhost_host *host, arhost_take_device take, void *context) {
    const size_t size = 1 << 20;
    char *text = malloc(size + 1);
    uint32_t i;
    (void)host;
    if (!text)
        return ARHOST_STATUS_ERROR_OUT_OF_MEMORY;
    memset(text, '"', size);
    text[size] = '\0';
    for (i = 0; i < 10000; ++i)
        report(take, context, i, text, text);
    free(text);
    return ARHOST_STATUS_OK;
}
static inline arhost_status list_none(const arhost_host *host, arhost_take_device take, void *context) {
    return (void)host, (void)take, (void)context, ARHOST_STATUS_OK;
}
/* Reports whether it has a shader cache (allowed with a GPU) and sockets (not allowed without the network). */
static inline arhost_status list_gpu(const arhost_host *host, arhost_take_device take, void *context) {
    const char *cache = getenv("XDG_CACHE_HOME"), *end = cache ? strrchr(cache, '/') : NULL;
    (void)host;
    report(take, context, 0, end && !strcmp(end, "/" ID) ? "with its shaders" : "without its shaders",
           socket(AF_INET, SOCK_STREAM, 0) < 0 ? "no network" : "the network");
    return ARHOST_STATUS_OK;
}
/* Lists cameras and displays in every state. /dev/full and /dev/null stand for nodes of cameras. */
static inline arhost_status list_cameras(const arhost_host *host, arhost_take_device take, void *context) {
    static const double rates[] = {30, 30000. / 1001, 7.5}, ends[] = {60, 1};
    static const arhost_device_size sizes[] = {{sizeof(arhost_device_size), 640, 480, 3, 0, 0, rates},
                                               {sizeof(arhost_device_size), 1280, 720, 1, 0, 0, rates}};
    static const arhost_device_size range[] = {{sizeof(arhost_device_size), 32, 24, 2, 1, 0, ends},
                                               {sizeof(arhost_device_size), 4096, 3072, 0, 0, 0, NULL}};
    static const arhost_device_format formats[] = {{sizeof(arhost_device_format), 2, 0, 0, "yuyv", sizes},
                                                   {sizeof(arhost_device_format), 2, 1, 0, "grey", range},
                                                   {sizeof(arhost_device_format), 0, 0, 0, "mjpeg", NULL}};
    static const arhost_device_control controls[] = {
        {sizeof(arhost_device_control), ARHOST_DEVICE_CONTROL_INTEGER, 1, 0, "gain", -16, 16, 4, 0, 8},
        {sizeof(arhost_device_control), ARHOST_DEVICE_CONTROL_BOOLEAN, 0, 0, "mute", 0, 1, 1, 1, 0},
        {sizeof(arhost_device_control), ARHOST_DEVICE_CONTROL_BUTTON, 0, 0, "reset", 0, 0, 0, 0, 0}};
    arhost_device device;
    (void)host;
    memset(&device, 0, sizeof device);
    device.struct_size = sizeof device;
    device.kind = ARHOST_DEVICE_CAMERA;
    device.state = ARHOST_DEVICE_STATE_USABLE;
    device.is_default = 1;
    device.name = "Eye";
    device.path = "/dev/video-eye";
    device.serial = "0042";
    device.format_count = 3;
    device.formats = formats;
    device.control_count = 3;
    device.controls = controls;
    take(context, &device);

    memset(&device, 0, sizeof device);
    device.struct_size = sizeof device;
    device.kind = ARHOST_DEVICE_CAMERA;
    device.index = 1;
    device.state = ARHOST_DEVICE_STATE_BUSY;
    device.name = "Taken";
    device.path = "/dev/full";
    take(context, &device);
    device.index = 2;
    device.state = ARHOST_DEVICE_STATE_FORBIDDEN;
    device.name = "Private";
    device.path = "/dev/null";
    take(context, &device);
    device.index = 3;
    device.state = ARHOST_DEVICE_STATE_UNUSABLE;
    device.name = "Broken";
    device.path = NULL;
    device.problem = "no lens";
    take(context, &device);

    device.kind = ARHOST_DEVICE_DISPLAY;
    device.index = 4;
    device.state = ARHOST_DEVICE_STATE_USABLE;
    device.name = "Screen";
    device.problem = NULL;
    device.width = 1920;
    device.height = 1080;
    device.rate = 59.94;
    take(context, &device);
    return ARHOST_STATUS_OK;
}

static const char *const needs[] = {"gpu", "network", NULL};
static const arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                             ARHOST_KIND_SINK,
                                             "org.arhost.test." ID,
                                             "Lister",
                                             "0.1.0",
                                             "arhost",
                                             "Apache-2.0",
                                             "Lists devices, for tests.",
                                             0,
                                             0,
                                             NULL,
                                             needs};

static arhost_status create(const arhost_host *host, const arhost_option *options, uint32_t option_count,
                            arhost_instance **instance) {
    return (void)host, (void)options, (void)option_count, (void)instance, ARHOST_STATUS_ERROR_UNSUPPORTED;
}
static void destroy(arhost_instance *self) {
    (void)self;
}
static const void *get_extension(const char *id) {
    static const arhost_devices devices = {sizeof(arhost_devices), 0, LIST};
    return strcmp(id, ARHOST_DEVICES_EXTENSION) == 0 ? &devices : NULL;
}
static arhost_status start(arhost_instance *self, const arhost_sink_setup *setup) {
    return (void)self, (void)setup, ARHOST_STATUS_ERROR_UNSUPPORTED;
}
static arhost_status write_frame(arhost_instance *self, const arhost_output *output) {
    return (void)self, (void)output, ARHOST_STATUS_ERROR_UNSUPPORTED;
}
static arhost_status stop(arhost_instance *self) {
    return (void)self, ARHOST_STATUS_OK;
}
static const arhost_sink functions = {sizeof(arhost_sink), 0, start, write_frame, NULL, stop, NULL};
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
