/* SPDX-License-Identifier: Apache-2.0 */
/* A library that crashes in a constructor, while it is being loaded. */
#include <arhost/arhost.h>
#include <signal.h>

__attribute__((constructor)) static void die(void) {
    signal(SIGSEGV, SIG_DFL);
    raise(SIGSEGV);
}
ARHOST_EXPORT const arhost_entry_point arhost_entry = {sizeof(arhost_entry_point), 0, 0};
