/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/devices.h: the extension "arhost.devices/1", by which a plugin tells what devices it could run on. It is for
 * people who choose one: `arhost plugins --devices` shows it. Which option of the plugin takes the choice, and how,
 * that option's help says.
 *
 * plugin.get_extension(ARHOST_DEVICES_EXTENSION) gives an arhost_devices, or NULL where the plugin has nothing to
 * choose from.
 */
#ifndef ARHOST_DEVICES_H
#define ARHOST_DEVICES_H

#include "plugin.h"

#ifdef __cplusplus
extern "C" {
#endif

#define ARHOST_DEVICES_EXTENSION "arhost.devices/1"

/* A host shows a kind that it does not know as ARHOST_DEVICE_OTHER. */
typedef int32_t arhost_device_kind;
enum {
    ARHOST_DEVICE_DISCRETE_GPU = 1,
    ARHOST_DEVICE_INTEGRATED_GPU = 2,
    ARHOST_DEVICE_VIRTUAL_GPU = 3, /* a share of one, in a virtual machine */
    ARHOST_DEVICE_CPU = 4,         /* by a driver that computes on the processor too */
    ARHOST_DEVICE_OTHER = 5
};

/* One device. Texts are UTF-8; a host shows 256 bytes of each. */
typedef struct arhost_device {
    uint32_t struct_size;
    uint32_t index; /* its number in this list, as the plugin's option counts where it takes one */
    arhost_device_kind kind;
    int32_t is_default;    /* non-zero: taken where no other is chosen; of one at most */
    const char *name;      /* for people, as its driver calls it; not NULL */
    const char *uuid;      /* the same after a restart and, where drivers give one, in other programs:
                            * "d4a1e1ba-0b5f-…"; NULL: it has none */
    const char *abilities; /* what the plugin can do there: "paths: pipeline, query, plain"; NULL: nothing to tell */
} arhost_device;

/* [worker] The host's: takes one device, which need not outlive the call. `context` is what `list` was given. */
typedef void (*arhost_take_device)(void *context, const arhost_device *device);

/* Static, as long as the library lives. */
typedef struct arhost_devices {
    uint32_t struct_size;

    /* [worker] From negotiate on, without an instance, as often as the host likes. Calls `take` once for each device,
     * in the order of `index`, and closes what it opened for that before it returns. It may take seconds, until
     * drivers are loaded; a host waits some twenty, and takes the first 64 devices. ARHOST_STATUS_OK without a device
     * where there is none, or no driver. Any error where it can't tell, after the reason has been logged with
     * ARHOST_SEVERITY_ERROR. */
    arhost_status (*list)(const arhost_host *host, arhost_take_device take, void *context);
} arhost_devices;

#ifdef __cplusplus
}
#endif
#endif
