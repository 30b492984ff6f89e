/* SPDX-License-Identifier: Apache-2.0 */
/* A plugin that negotiates successfully but does not return a descriptor. */
#include <arhost/arhost.h>

static arhost_status negotiate(const arhost_offer *offer, arhost_answer *answer) {
    answer->abi_version = offer->newest_abi_version;
    return ARHOST_STATUS_OK;
}
ARHOST_EXPORT const arhost_entry_point arhost_entry = {sizeof(arhost_entry_point), 0, negotiate};
