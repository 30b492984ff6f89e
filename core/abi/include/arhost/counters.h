/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/counters.h: the extension "arhost.counters/1", by which a plugin counts events, such as lost frames by
 * cause. If the worker restarts, the host continues the counts. The host shows them in the status, in the statistics
 * and at the end of a run.
 */
#ifndef ARHOST_COUNTERS_H
#define ARHOST_COUNTERS_H

#include "plugin.h"

#ifdef __cplusplus
extern "C" {
#endif

#define ARHOST_COUNTERS_EXTENSION "arhost.counters/1"

enum { ARHOST_MAX_COUNTERS = 32, ARHOST_MAX_COUNTER_NAME = 63 };

/* Receives a counter. `name`: 1 to ARHOST_MAX_COUNTER_NAME characters of a-z, 0-9 and _; valid only during the call.
 * `value`: the number of events since the start of this instance; it never decreases. */
typedef void (*arhost_take_counter)(void *context, const char *name, uint64_t value);

/* Returned by plugin.get_extension(ARHOST_COUNTERS_EXTENSION). Static storage: valid as long as the library is
 * loaded. */
typedef struct arhost_counters {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */

    /* [worker, started] Passes each counter to `take`, including those that are 0. Every call must pass the same
     * names, at most ARHOST_MAX_COUNTERS. The worker calls `list` between two frames a few times per second, after
     * each frame that fails, and before `stop`. */
    void (*list)(arhost_instance *instance, arhost_take_counter take, void *context);
} arhost_counters;

#ifdef __cplusplus
}
#endif
#endif
