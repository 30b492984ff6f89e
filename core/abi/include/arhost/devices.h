/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/devices.h: the extension "arhost.devices/2", which lists the devices that a plugin can run on: cameras,
 * GPUs, displays.
 *
 * `arhost devices` prints the list for users. The user selects a device with one of the plugin's options, whose help
 * text describes the syntax.
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

#define ARHOST_DEVICES_EXTENSION "arhost.devices/2"

/* The host ignores list elements beyond these limits, and displays at most 256 bytes of each string. The whole list
 * may have at most 4 MiB as JSON. */
enum {
    ARHOST_MAX_DEVICES = 64,
    ARHOST_MAX_DEVICE_FORMATS = 128,  /* per device */
    ARHOST_MAX_DEVICE_SIZES = 64,     /* per format */
    ARHOST_MAX_DEVICE_RATES = 64,     /* per size */
    ARHOST_MAX_DEVICE_CONTROLS = 256, /* per device */
};

/* The host displays an unknown kind as ARHOST_DEVICE_OTHER. */
typedef int32_t arhost_device_kind;
enum {
    ARHOST_DEVICE_DISCRETE_GPU = 1,
    ARHOST_DEVICE_INTEGRATED_GPU = 2,
    ARHOST_DEVICE_VIRTUAL_GPU = 3, /* a GPU share in a virtual machine */
    ARHOST_DEVICE_CPU = 4,         /* including software drivers that run on the CPU */
    ARHOST_DEVICE_OTHER = 5,
    ARHOST_DEVICE_CAMERA = 6,
    ARHOST_DEVICE_DISPLAY = 7
};

/* Whether the plugin can open the device now. */
typedef int32_t arhost_device_state;
enum {
    ARHOST_DEVICE_STATE_USABLE = 1,
    ARHOST_DEVICE_STATE_BUSY = 2,      /* another program uses the node `path`; the host finds out which one */
    ARHOST_DEVICE_STATE_FORBIDDEN = 3, /* this user may not open the node `path`; the host finds out who may */
    ARHOST_DEVICE_STATE_UNUSABLE = 4   /* `problem` contains the reason */
};

/* A picture size of a camera, or one end of a range of sizes. */
typedef struct arhost_device_size {
    uint32_t struct_size;
    uint32_t width, height; /* px; at least 1 */
    uint32_t rate_count;    /* 0: unknown */
    int32_t is_rate_range;  /* non-zero: `rates` contains the two ends of a range */
    uint32_t reserved;      /* 0 */
    const double *rates;    /* [rate_count] frames per second, finite and above 0, highest first */
} arhost_device_size;

/* A pixel format that a camera offers and the plugin can capture. */
typedef struct arhost_device_format {
    uint32_t struct_size;
    uint32_t size_count;             /* 0: unknown */
    int32_t is_size_range;           /* non-zero: `sizes` contains the smallest and the largest size of a range */
    uint32_t reserved;               /* 0 */
    const char *pixel_format;        /* the value for the plugin's option, "yuyv"; not empty */
    const arhost_device_size *sizes; /* [size_count] */
} arhost_device_format;

typedef int32_t arhost_device_control_type;
enum {
    ARHOST_DEVICE_CONTROL_INTEGER = 1,
    ARHOST_DEVICE_CONTROL_BOOLEAN = 2, /* 0 or 1 */
    ARHOST_DEVICE_CONTROL_MENU = 3,    /* numbers of menu entries; some numbers in the range may have no entry */
    ARHOST_DEVICE_CONTROL_BITMASK = 4,
    ARHOST_DEVICE_CONTROL_BUTTON = 5 /* triggers an action; has no value */
};

/* A setting of a camera, such as its gain, in units of the camera. */
typedef struct arhost_device_control {
    uint32_t struct_size;
    arhost_device_control_type type;
    int32_t has_value;     /* 0: `value` cannot be read */
    uint32_t reserved;     /* 0 */
    const char *name;      /* the name in the plugin's options, "white_balance_temperature"; not empty */
    int64_t minimum;       /* at most `maximum` */
    int64_t maximum;       /* bitmask: all bits that may be set */
    int64_t step;          /* at least 0. 0: no steps */
    int64_t default_value; /* some cameras report a value outside the range */
    int64_t value;         /* current value */
} arhost_device_control;

/* One device. Strings may be NULL, except where stated. Unset fields are 0. */
typedef struct arhost_device {
    uint32_t struct_size;
    uint32_t index; /* position in this list; options that select a device by number use this number */
    arhost_device_kind kind;
    arhost_device_state state;
    int32_t is_default; /* non-zero: used if the user selects no device; at most one device is the default */
    uint32_t format_count, control_count; /* cameras */
    uint32_t width, height;               /* displays: resolution in px; 0: unknown */
    uint32_t reserved;                    /* 0 */
    double rate;                          /* displays: refreshes per second; 0: unknown */
    const char *name;                     /* display name reported by the driver; neither NULL nor empty */
    const char *path;                     /* the device node, "/dev/video0"; not NULL if BUSY or FORBIDDEN */
    const char *serial;    /* identifies the device across restarts and, if reported by the driver, across programs:
                            * the serial number of a camera, the UUID of a GPU */
    const char *abilities; /* features supported on this device: "paths: pipeline, query, plain" */
    const char *problem;   /* why the device is UNUSABLE; NULL in other states */
    const arhost_device_format *formats;   /* [format_count] */
    const arhost_device_control *controls; /* [control_count] */
} arhost_device;

/* [worker] Host callback that receives one device. The device, and everything that it refers to, needs to be valid
 * only during the call. `context`: as passed to `list`. */
typedef void (*arhost_take_device)(void *context, const arhost_device *device);

/* Static storage: valid as long as the library is loaded. */
typedef struct arhost_devices {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */

    /* [worker, negotiated or created] Calls `take` once per device, in order of `index`. Also lists devices that
     * exist but cannot be opened. Must not change settings of a device, nor take a device away from another program.
     * Releases everything that it opened before it returns. The host may call `list` repeatedly. `list` may take
     * seconds while drivers load; the timeout of the host is about 20 s. Returns ARHOST_STATUS_OK without calling
     * `take` if there is no device or driver. If the devices cannot be enumerated, logs the reason with
     * ARHOST_SEVERITY_ERROR and returns any error. */
    arhost_status (*list)(const arhost_host *host, arhost_take_device take, void *context);
} arhost_devices;

#ifdef __cplusplus
}
#endif
#endif
