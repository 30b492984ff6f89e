/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/devices.h: the extension "arhost.devices/1", which lists the devices that a plugin can run on.
 *
 * `arhost plugins --devices` prints the list for users. The user selects a device with one of the plugin's options,
 * whose help text describes the syntax.
 *
 * plugin.get_extension(ARHOST_DEVICES_EXTENSION) returns a pointer to arhost_devices, or NULL if the plugin offers no
 * choice of devices.
 */
#ifndef ARHOST_DEVICES_H
#define ARHOST_DEVICES_H

#include "plugin.h"

#ifdef __cplusplus
extern "C" {
#endif

#define ARHOST_DEVICES_EXTENSION "arhost.devices/1"

/* The host displays an unknown kind as ARHOST_DEVICE_OTHER. */
typedef int32_t arhost_device_kind;
enum {
    ARHOST_DEVICE_DISCRETE_GPU = 1,
    ARHOST_DEVICE_INTEGRATED_GPU = 2,
    ARHOST_DEVICE_VIRTUAL_GPU = 3, /* a GPU share in a virtual machine */
    ARHOST_DEVICE_CPU = 4,         /* including software drivers that run on the CPU */
    ARHOST_DEVICE_OTHER = 5
};

/* One device. The host displays at most 256 bytes of each string. */
typedef struct arhost_device {
    uint32_t struct_size;
    uint32_t index; /* position in this list; if the option of the plugin takes a number, it is this one */
    arhost_device_kind kind;
    int32_t is_default;    /* non-zero: used if the user selects no device; at most one device is the default */
    const char *name;      /* display name reported by the driver; not NULL */
    const char *uuid;      /* stable across restarts and, if reported by the driver, across programs:
                            * "d4a1e1ba-0b5f-…"; NULL: none */
    const char *abilities; /* features supported on this device: "paths: pipeline, query, plain"; NULL: unspecified */
} arhost_device;

/* [worker] Host callback that receives one device. The device and its strings need to be valid only during the call.
 * `context`: as passed to `list`. */
typedef void (*arhost_take_device)(void *context, const arhost_device *device);

/* Static storage: valid as long as the library is loaded. */
typedef struct arhost_devices {
    uint32_t struct_size;

    /* [worker, negotiated or later] Calls `take` once per device, in order of `index`. Releases everything that it
     * opened before it returns. The host may call `list` repeatedly and keeps only the first 64 devices. `list` may
     * take seconds while drivers load; the timeout of the host is about 20 s. Returns ARHOST_STATUS_OK without
     * calling `take` if there is no device or driver. If the devices cannot be enumerated, logs the reason with
     * ARHOST_SEVERITY_ERROR and returns any error. */
    arhost_status (*list)(const arhost_host *host, arhost_take_device take, void *context);
} arhost_devices;

#ifdef __cplusplus
}
#endif
#endif
