/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/plugin.h: discovery, version negotiation, description and lifetime of a plugin.
 *
 * A plugin is a shared object that exports one data symbol, `arhost_entry`. Each plugin is loaded by its own
 * `arhost-worker` process; the host itself never loads a plugin.
 *
 * States of a plugin, and the calls that change them:
 *
 *            negotiate               create              start
 *   loaded ────────────▶ negotiated ──────────▶ created ──────────▶ started
 *                                   ◀──────────         ◀──────────
 *                                     destroy              stop
 *
 * A call that fails leaves the state unchanged, so after a failed `start` the worker calls `destroy` without
 * `stop`. In the state `started` the worker calls the per-frame function of the plugin's kind. A ray tracer may be
 * started again after `stop`; a plugin of any other kind is started only once. The worker process exits after
 * `destroy`.
 *
 * The comment of each function begins with a tag: the thread that may call it and the state that it requires.
 *   [worker, STATE]  on the worker's main thread, which makes all calls into the plugin
 *   [worker]         on the same thread; the comment describes when
 *   [any]            on any thread, in any state
 *
 * Rules for every function, unless its comment says otherwise:
 * - Threads: a plugin may create threads and must join them no later than in `destroy`. These threads may call only
 *   functions tagged [any].
 * - Ownership: a pointer passed in a call belongs to the caller and is valid until the call returns. Memory is never
 *   allocated on one side and freed on the other.
 * - Each struct begins with `struct_size`: the size of the struct in bytes, as known to the side that fills it in.
 *   Never access a field beyond this size. The stride of an array is the `struct_size` of its first
 *   element. Elements without a `struct_size` (arhost/motion.h, arhost/scene.h) never grow, so their stride is
 *   sizeof(element).
 * - Strings are UTF-8 and NUL-terminated. Pointers are not NULL unless documented otherwise.
 * - No function throws an exception or exits by longjmp.
 */
#ifndef ARHOST_PLUGIN_H
#define ARHOST_PLUGIN_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Version 0 is the draft: loader and plugin must have exactly the same version. docs/abi.md lists the guarantees of
 * version 1. */
#define ARHOST_ABI_VERSION 0u

#if defined(__GNUC__)
#define ARHOST_EXPORT __attribute__((visibility("default")))
#else
#define ARHOST_EXPORT
#endif

/* Positive values mean success, negative values failure. 0 is invalid, so a forgotten return value is detected. */
typedef int32_t arhost_status;
enum {
    ARHOST_STATUS_OK = 1,
    ARHOST_STATUS_END = 2, /* success; a source has no more frames, or the user closed the receiver of a sink */
    ARHOST_STATUS_END_TRUNCATED = 3, /* the source's input is truncated; all readable frames were delivered */

    ARHOST_STATUS_ERROR_INVALID_ARGUMENT = -1, /* contract violation by the caller */
    ARHOST_STATUS_ERROR_CONFIGURATION = -2,    /* unusable options, scene or calibration; not retried */
    ARHOST_STATUS_ERROR_UNSUPPORTED = -3,      /* valid, but unsupported by this plugin or machine; not retried */
    ARHOST_STATUS_ERROR_IO = -4,               /* file or device error */
    ARHOST_STATUS_ERROR_OUT_OF_MEMORY = -5,
    ARHOST_STATUS_ERROR_DEVICE_LOST = -6, /* camera unplugged, GPU reset; a restart may help */
    ARHOST_STATUS_ERROR_CANCELLED = -7,   /* the call returned early because host->cancelled returned non-zero */
    ARHOST_STATUS_ERROR_INTERNAL = -8     /* a defect of the plugin, such as an unexpected exception */
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
    /* A tracker logs what it sees instead of the targets, such as "other markers were in view: tag25h9 7". The host
     * adds this text to its warning that targets were never seen. Other plugins: same as ARHOST_SEVERITY_INFO */
    ARHOST_SEVERITY_HINT = 3,
    ARHOST_SEVERITY_WARNING = 4,
    ARHOST_SEVERITY_ERROR = 5,
    ARHOST_SEVERITY_HOST_MISBEHAVING = 6,  /* logged by a plugin: contract violation by the host */
    ARHOST_SEVERITY_PLUGIN_MISBEHAVING = 7 /* logged by the worker: contract violation by the plugin */
};

/* The host's callbacks. Valid until the process ends; no function is NULL. */
typedef struct arhost_host {
    uint32_t struct_size;
    uint32_t abi_version; /* the negotiated version */
    const char *name;     /* "arhost" */
    const char *version;  /* version of the host, such as "0.1.0" */
    void *context;        /* private to the host */

    /* [any] Logs one message, without a trailing newline. Never blocks: drops the message if the host cannot
     * keep up. */
    void (*log)(const struct arhost_host *host, arhost_severity severity, const char *text);

    /* [any] Reports progress and restarts the deadline of the running call. Call it at least every few seconds in a
     * function that takes long or waits. The host limits each call to 30 times its deadline, whatever it reports,
     * except `read` of a source, which may wait for a frame, and `write` of a sink, which may wait for the receiver
     * of its frames. `fraction`: the completed fraction, 0 to 1, or negative if unknown. `what`: describes the
     * current step to the user. */
    void (*progress)(const struct arhost_host *host, double fraction, const char *what);

    /* [any] Returns non-zero if the running call must return soon, with ARHOST_STATUS_ERROR_CANCELLED. Costs one
     * atomic load; poll it in every loop that can take longer than 100 ms. */
    int32_t (*cancelled)(const struct arhost_host *host);

    /* [any] Returns the host extension with this id and revision ("arhost.host.something/1"), or NULL if the host
     * does not support it. A plugin must also work without the extension. */
    const void *(*get_extension)(const struct arhost_host *host, const char *id);
} arhost_host;

/* Types of the values in a component's `options:` map (YAML). */
typedef int32_t arhost_option_type;
enum {
    ARHOST_OPTION_BOOL = 1,       /* arhost_option.integer, 0 or 1 */
    ARHOST_OPTION_INTEGER = 2,    /* arhost_option.integer */
    ARHOST_OPTION_REAL = 3,       /* arhost_option.real */
    ARHOST_OPTION_TEXT = 4,       /* arhost_option.text */
    ARHOST_OPTION_INPUT_PATH = 5, /* arhost_option.text; absolute, resolved against the configuration's folder */
    /* arhost_option.text; absolute, resolved against the working directory; or "-", see
     * ARHOST_SINK_CAPABILITY_STANDARD_OUTPUT */
    ARHOST_OPTION_OUTPUT_PATH = 6,
    /* arhost_option.integer: the descriptor of a listening, non-blocking stream socket; -1: none. The worker owns the
     * descriptor, which stays open until the process ends. The host opens the socket, so the plugin needs no
     * permission to open sockets. The host keeps the socket open while the worker restarts. arhost_option.text: the
     * address: "127.0.0.1:8080", "[::1]:8080", or the absolute path of a Unix socket. In the configuration, a plain
     * name stands for the Unix socket $XDG_RUNTIME_DIR/arhost/NAME.sock, and "" for no socket */
    ARHOST_OPTION_LISTEN = 7
};

/* Declares an option. Before `create` is called, the host checks the configuration against the declarations, and
 * reports unknown keys, wrong types and values out of range with their line in the YAML file. */
typedef struct arhost_option_descriptor {
    uint32_t struct_size;
    arhost_option_type type;
    const char *key;            /* key in the `options:` map */
    const char *default_value;  /* in YAML syntax; NULL: the option is required */
    double minimum, maximum;    /* inclusive range of an INTEGER or REAL; both 0: unbounded */
    const char *const *choices; /* for TEXT: NULL-terminated list of the valid values; NULL: any text is valid */
    const char *help;           /* one sentence, including the unit */
} arhost_option_descriptor;

/* An option's value. `create` receives every declared option in the descriptor's order, with the configured or the
 * default value. A newer host may append options; ignore unknown keys. */
typedef struct arhost_option {
    uint32_t struct_size;
    arhost_option_type type;
    const char *key;
    int64_t integer;
    double real;
    const char *text; /* never NULL, also for types other than TEXT */
} arhost_option;

/* Returns the option with this key among those passed to `create`, or NULL if there is none. */
static inline const arhost_option *arhost_find_option(const arhost_option *options, uint32_t option_count,
                                                      const char *key) {
    const char *at = (const char *)options;
    uint32_t i;
    for (i = 0; i < option_count; ++i, at += options->struct_size)
        if (!strcmp(((const arhost_option *)at)->key, key))
            return (const arhost_option *)at;
    return NULL; /* NOLINT(modernize-use-nullptr): C has no nullptr */
}

/* Describes the plugin. Static storage: valid as long as the library is loaded. Each string may have up to 4,096
 * bytes, the whole descriptor as JSON up to 127 KiB. */
typedef struct arhost_descriptor {
    uint32_t struct_size;
    arhost_kind kind;
    /* Unique among all vendors: a domain of the vendor in reverse order, then the file name without ".so", such as
     * "org.arhost.rt_embree". Three or more parts of a-z, A-Z, 0-9, '-' and '_', separated by dots. */
    const char *id;
    const char *name;    /* display name: "Embree ray tracer" */
    const char *version; /* version of the plugin, such as "1.2.0" */
    const char *vendor;
    const char *licence;     /* SPDX identifier */
    const char *description; /* one sentence */
    /* Optional abilities, as bits that the header of each kind defines: arhost_source_capabilities,
     * arhost_tracker_capabilities, arhost_raytracer_capabilities or arhost_sink_capabilities. */
    uint64_t capabilities;
    uint64_t option_count;
    const arhost_option_descriptor *options; /* option_count elements; may be NULL if there are none */
    /* Permissions that the plugin needs from the sandbox: a NULL-terminated list; NULL: none. "video" (/dev/video*),
     * "usb", "gpu", "display" (X or Wayland, and the GPU), "network", "listen" (accept connections on its sockets),
     * "processes" (fork, exec), "jit" (execute memory that it writes; part of "gpu" and "display"). The configuration
     * grants them (`allow: [video]`). The host rejects the plugin before `create` if one of its needs is missing. */
    const char *const *needs;
} arhost_descriptor;

/* An instance of a plugin; opaque to the host. */
typedef struct arhost_instance arhost_instance;

/* The entry points of a plugin. This struct and everything it points to is in static storage; every call of
 * `negotiate` returns the same pointer. The host rejects a plugin if a function in this struct or in `functions` is
 * NULL, unless the function is documented as optional. */
typedef struct arhost_plugin {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */
    const arhost_descriptor *descriptor;

    /* The function table of descriptor->kind: arhost_source, arhost_tracker, arhost_raytracer or arhost_sink. */
    const void *functions;

    /* [worker, negotiated] Creates an instance; on success *instance is not NULL. On failure, it logs the reason with
     * ARHOST_SEVERITY_ERROR, names the option to change, and leaves *instance NULL. `host` outlives the instance;
     * `options` are valid only during the call. */
    arhost_status (*create)(const arhost_host *host, const arhost_option *options, uint32_t option_count,
                            arhost_instance **instance);

    /* [worker, created] Joins the instance's threads and releases all its resources. Called once per instance. */
    void (*destroy)(arhost_instance *instance);

    /* [worker, negotiated or later] Returns the function table of the extension with this id and revision
     * ("arhost.devices/2"), in static storage, or NULL if the plugin does not support the extension. */
    const void *(*get_extension)(const char *id);
} arhost_plugin;

/* Version negotiation: the offer of the loader and the answer of the plugin. */
typedef struct arhost_offer {
    uint32_t struct_size;
    uint32_t oldest_abi_version; /* the range of versions that the loader supports, inclusive */
    uint32_t newest_abi_version;
} arhost_offer;

typedef struct arhost_answer {
    uint32_t struct_size; /* set by the loader */
    uint32_t abi_version; /* set by the plugin: the newest version that both support */
    const arhost_plugin *plugin;
} arhost_answer;

typedef struct arhost_entry_point {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */
    /* [worker, loaded] Returns ARHOST_STATUS_OK and sets answer->abi_version, within the offered range, and
     * answer->plugin; or returns ARHOST_STATUS_ERROR_UNSUPPORTED if the plugin supports no offered version. The
     * loader rejects a plugin that returns success with a NULL plugin or a version out of range. */
    arhost_status (*negotiate)(const arhost_offer *offer, arhost_answer *answer);
} arhost_entry_point;

/* The plugin's only exported symbol. */
extern ARHOST_EXPORT const arhost_entry_point arhost_entry;

#ifdef __cplusplus
}
#endif
#endif
