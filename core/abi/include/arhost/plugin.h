/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/plugin.h: how a plugin is found, asked for its version, described, made and destroyed.
 *
 * A plugin is a shared object that exports one data symbol, `arhost_entry`. It is opened by
 * `arhost-worker`, one process a plugin, never by the host itself.
 *
 * Call order (docs/abi.md draws it):
 *   arhost_entry.negotiate -> plugin.create -> the kind's start -> its per-frame function, again and
 *   again -> the kind's stop -> plugin.destroy -> the process ends.
 * After a start that failed, or without one, destroy comes without stop. A ray tracer may be started again
 * after its stop; the others are started once.
 *
 * Rules that hold for every function of this ABI unless its comment says otherwise:
 * - Thread: [worker] is the one thread of arhost-worker that calls the plugin. A plugin may start
 *   threads of its own; it joins them in `destroy`. Only functions marked [any] may be called there.
 * - Ownership: a pointer passed in a call belongs to the caller and is valid until that call returns.
 *   Nothing is allocated on one side and freed on the other.
 * - Structs begin with `struct_size`, the size in bytes that their writer knew. A reader never touches
 *   a field that lies past it. In an array behind a pointer, step by the first element's `struct_size`; where
 *   elements have none (arhost/motion.h, arhost/scene.h) by their sizeof, as they never grow.
 * - Strings are UTF-8 and end with NUL. A pointer that may be NULL says so.
 * - No exception and no longjmp leaves a function.
 */
#ifndef ARHOST_PLUGIN_H
#define ARHOST_PLUGIN_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

/* 0 is the draft: loader and plugin must agree on it exactly. docs/abi.md lists what 1 will promise. */
#define ARHOST_ABI_VERSION 0u

#if defined(__GNUC__)
#define ARHOST_EXPORT __attribute__((visibility("default")))
#else
#define ARHOST_EXPORT
#endif

/* Results. Success is positive, failure negative; 0 is never valid, so a forgotten return is caught. */
typedef int32_t arhost_status;
enum {
    ARHOST_STATUS_OK = 1,
    ARHOST_STATUS_END = 2, /* no failure, but no more: a source has no further frame, a sink's window was closed */
    ARHOST_STATUS_END_TRUNCATED = 3, /* a source's input ends before its time; what could be read was given */

    ARHOST_STATUS_ERROR_INVALID_ARGUMENT = -1, /* the caller broke this ABI's contract */
    ARHOST_STATUS_ERROR_CONFIGURATION = -2,    /* options, scene or calibration cannot work; not tried again */
    ARHOST_STATUS_ERROR_UNSUPPORTED = -3,      /* valid, but this plugin or machine can't do it; not tried again */
    ARHOST_STATUS_ERROR_IO = -4,               /* file, device or disk */
    ARHOST_STATUS_ERROR_OUT_OF_MEMORY = -5,
    ARHOST_STATUS_ERROR_DEVICE_LOST = -6, /* camera unplugged, GPU reset: a restart may help */
    ARHOST_STATUS_ERROR_CANCELLED = -7,   /* returned because host->cancelled said so */
    ARHOST_STATUS_ERROR_INTERNAL = -8     /* a defect of the plugin, an exception that it caught, say */
};

typedef int32_t arhost_kind;
enum {
    ARHOST_KIND_SOURCE = 1,    /* arhost/source.h    */
    ARHOST_KIND_TRACKER = 2,   /* arhost/tracker.h   */
    ARHOST_KIND_RAYTRACER = 3, /* arhost/raytracer.h */
    ARHOST_KIND_SINK = 4       /* arhost/sink.h      */
};

typedef int32_t arhost_severity;
enum {
    ARHOST_SEVERITY_DEBUG = 1,
    ARHOST_SEVERITY_INFO = 2,
    ARHOST_SEVERITY_WARNING = 3,
    ARHOST_SEVERITY_ERROR = 4,
    ARHOST_SEVERITY_HOST_MISBEHAVING = 5,  /* the plugin saw the host break this contract */
    ARHOST_SEVERITY_PLUGIN_MISBEHAVING = 6 /* the worker saw the plugin break it */
};

/* What the plugin may ask of its host. Lives as long as the process. All functions are [any], none is NULL. */
typedef struct arhost_host {
    uint32_t struct_size;
    uint32_t abi_version; /* the version that negotiate chose */
    const char *name;     /* "arhost" */
    const char *version;  /* of the host, "0.1.0" */
    void *context;        /* the host's own */

    /* [any] One message, without a line end. Never blocks: where the host is behind, it is dropped. */
    void (*log)(const struct arhost_host *host, arhost_severity severity, const char *text);

    /* [any] Tells that long work goes on, which also holds off the start-up deadline: call it at least
     * every few seconds in create and start. `fraction` is 0 to 1, or negative where it is not known. */
    void (*progress)(const struct arhost_host *host, double fraction, const char *what);

    /* [any] Non-zero once the host wants the running call to return soon (ARHOST_STATUS_ERROR_CANCELLED).
     * One atomic load: ask in every loop that can take longer than 100 ms. */
    int32_t (*cancelled)(const struct arhost_host *host);

    /* [any] A host extension by id and revision ("arhost.host.something/1"), or NULL: a plugin does without. */
    const void *(*get_extension)(const struct arhost_host *host, const char *id);
} arhost_host;

/* Options: typed key/values from the YAML `options:` map. */
typedef int32_t arhost_option_type;
enum {
    ARHOST_OPTION_BOOL = 1,       /* arhost_option.integer, 0 or 1 */
    ARHOST_OPTION_INTEGER = 2,    /* arhost_option.integer */
    ARHOST_OPTION_REAL = 3,       /* arhost_option.real */
    ARHOST_OPTION_TEXT = 4,       /* arhost_option.text */
    ARHOST_OPTION_INPUT_PATH = 5, /* arhost_option.text, made absolute against the configuration's folder */
    ARHOST_OPTION_OUTPUT_PATH = 6 /* arhost_option.text, made absolute against the working directory */
};

/* Declares an option. The host checks the configuration against it before the plugin sees a value, so
 * that a wrong key, type or range is reported with the line in the YAML. */
typedef struct arhost_option_descriptor {
    uint32_t struct_size;
    arhost_option_type type;
    const char *key;            /* not NULL */
    const char *default_value;  /* as it would stand in the YAML; NULL: the option must be given */
    double minimum, maximum;    /* of INTEGER and REAL, inclusive; both 0: unbounded */
    const char *const *choices; /* of TEXT: NULL-terminated list, or NULL: any */
    const char *help;           /* one sentence, with the unit */
} arhost_option_descriptor;

/* A value. Every declared option is passed to `create`, in the descriptor's order: the configured value
 * or the default. A newer host may pass others behind them, which a plugin passes over. */
typedef struct arhost_option {
    uint32_t struct_size;
    arhost_option_type type;
    const char *key;
    int64_t integer;
    double real;
    const char *text; /* never NULL */
} arhost_option;

/* The value of an option among those that `create` is given; NULL where none has this key. */
static inline const arhost_option *arhost_find_option(const arhost_option *options, uint32_t option_count,
                                                      const char *key) {
    const char *at = (const char *)options;
    uint32_t i;
    for (i = 0; i < option_count; ++i, at += options->struct_size)
        if (!strcmp(((const arhost_option *)at)->key, key))
            return (const arhost_option *)at;
    return NULL; /* NOLINT(modernize-use-nullptr): C has none */
}

/* What a plugin can do beyond its kind's minimum: descriptor.capabilities. */
enum {
    ARHOST_CAPABILITY_SEEK = 1 << 0,            /* source: start at any sequence number gives the same frames */
    ARHOST_CAPABILITY_LIVE = 1 << 1,            /* source: a camera; frames that are not read in time are gone */
    ARHOST_CAPABILITY_LENS_DISTORTION = 1 << 2, /* raytracer: applies the distortion of arhost_intrinsics */
    ARHOST_CAPABILITY_REALTIME_SINK = 1 << 4    /* sink: wants the newest frame rather than every frame */
};

/* Static, lives as long as the library. A host takes 4,096 bytes of a text, and of all as JSON 127 KiB. */
typedef struct arhost_descriptor {
    uint32_t struct_size;
    arhost_kind kind;
    const char *id;      /* equals the file's name without ".so": "rt_embree" */
    const char *name;    /* for people: "Embree ray tracer" */
    const char *version; /* of the plugin, "1.2.0" */
    const char *vendor;
    const char *licence;     /* SPDX */
    const char *description; /* one sentence */
    uint32_t capabilities;   /* ARHOST_CAPABILITY_SEEK | … */
    uint32_t option_count;
    const arhost_option_descriptor *options; /* option_count of them; NULL where there are none */
    /* NULL-terminated list of what the sandbox must allow, or NULL: "video" (/dev/video*), "usb", "gpu",
     * "display" (X or Wayland, and the GPU), "network", "processes" (of its own: fork and exec). It is the
     * configuration that allows (`allow: [video]`); where it does not, the plugin is refused before create. */
    const char *const *needs;
} arhost_descriptor;

/* One made plugin; what is in it is the plugin's own affair. */
typedef struct arhost_instance arhost_instance;

/* Static, with all that it points to: the same whenever negotiate is asked. No function is NULL, here or among
 * the kind's, unless its comment says so: a plugin that lacks one is refused. */
typedef struct arhost_plugin {
    uint32_t struct_size;
    const arhost_descriptor *descriptor;

    /* The kind's functions: arhost_source, arhost_tracker, arhost_raytracer or arhost_sink. */
    const void *functions;

    /* [worker] Makes an instance. On success *instance is not NULL. On failure the reason has been
     * logged with ARHOST_SEVERITY_ERROR, in words that name the option to mend, and *instance stays NULL.
     * `host` outlives the instance; `options` do not outlive the call. */
    arhost_status (*create)(const arhost_host *host, const arhost_option *options, uint32_t option_count,
                            arhost_instance **instance);

    /* [worker] Ends the instance's threads and frees all. Called once, after the kind's stop. */
    void (*destroy)(arhost_instance *instance);

    /* [worker] The plugin's functions for an extension by id and revision, or NULL. May be called
     * from negotiate on, without an instance. The answer is static. */
    const void *(*get_extension)(const char *id);
} arhost_plugin;

/* What the loader offers, and what the plugin answers. */
typedef struct arhost_offer {
    uint32_t struct_size;
    uint32_t oldest_abi_version; /* inclusive range of what the loader speaks */
    uint32_t newest_abi_version;
} arhost_offer;

typedef struct arhost_answer {
    uint32_t struct_size; /* set by the loader */
    uint32_t abi_version; /* set by the plugin: the newest that both speak */
    const arhost_plugin *plugin;
} arhost_answer;

typedef struct arhost_entry_point {
    uint32_t struct_size;
    /* [worker] ARHOST_STATUS_OK with a version inside the offer and a plugin, or ARHOST_STATUS_ERROR_UNSUPPORTED.
     * A success with a NULL plugin or a version outside the offer is refused. */
    arhost_status (*negotiate)(const arhost_offer *offer, arhost_answer *answer);
} arhost_entry_point;

/* The one exported symbol. */
extern ARHOST_EXPORT const arhost_entry_point arhost_entry;

#ifdef __cplusplus
}
#endif
#endif
