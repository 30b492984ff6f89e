/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/control.h: control while the video runs. Two extensions:
 *
 * - "arhost.host.control/1": a sink sends commands to the host, for example when the user presses a key or a button.
 * - "arhost.set_option/1": a plugin accepts new values of some of its options without a restart.
 *
 * A command is a JSON object (RFC 8259) with the member "command", the answer a JSON object with the member "ok":
 * true or false. If it is false, the member "error" explains why to the user. docs/control.md lists the commands and
 * their members. The host executes only commands that the configuration grants to the sink
 * (`control: [freeze, status]`); it answers others with an error.
 */
#ifndef ARHOST_CONTROL_H
#define ARHOST_CONTROL_H

#include "plugin.h"

#ifdef __cplusplus
extern "C" {
#endif

#define ARHOST_CONTROL_EXTENSION "arhost.host.control/1"

/* Plugin callback that receives the answer to a command. [worker] It is called between two calls of the plugin's
 * functions, in the state `started`. `answer`: a JSON object, valid only during the call. `context`: as passed to
 * `send`. */
typedef void (*arhost_take_answer)(void *context, const char *answer);

/* Returned by host->get_extension(host, ARHOST_CONTROL_EXTENSION) for a sink; NULL for plugins of other kinds. */
typedef struct arhost_control {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */

    /* [any] Sends a command, such as {"command": "freeze"}, and returns at once. Allowed in the state `started`.
     * `take` may be NULL. It is called once, unless the plugin is stopped before the answer arrives. Answers may
     * arrive in any order. A command that starts a component is answered when the component runs. Returns
     * ARHOST_STATUS_ERROR_INVALID_ARGUMENT if `command` is not a JSON object, is longer than ARHOST_MAX_COMMAND_SIZE
     * bytes, or is sent before `start` has returned. Returns ARHOST_STATUS_ERROR_OUT_OF_MEMORY if
     * ARHOST_MAX_PENDING_COMMANDS commands have no answer yet. Returns ARHOST_STATUS_ERROR_IO if the host cannot keep
     * up. If `send` returns an error, `take` is not called. */
    arhost_status (*send)(const arhost_host *host, const char *command, arhost_take_answer take, void *context);
} arhost_control;

enum { ARHOST_MAX_COMMAND_SIZE = 16384, ARHOST_MAX_PENDING_COMMANDS = 8 };

#define ARHOST_SET_OPTION_EXTENSION "arhost.set_option/1"

/* Returned by plugin.get_extension(ARHOST_SET_OPTION_EXTENSION). Static storage: valid as long as the library is
 * loaded. */
typedef struct arhost_set_option {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */

    /* The keys of the options that `set` accepts: a NULL-terminated list of keys of the descriptor's options. Options
     * that contain paths or addresses cannot be changed. */
    const char *const *keys;

    /* [worker, started] Changes an option between two frames. `option`: the new value, which the host has checked
     * against the option's declaration; valid only during the call. On failure, logs the reason with
     * ARHOST_SEVERITY_ERROR and keeps the old value. A restarted instance receives the new value in `create`. */
    arhost_status (*set)(arhost_instance *instance, const arhost_option *option);
} arhost_set_option;

#ifdef __cplusplus
}
#endif
#endif
