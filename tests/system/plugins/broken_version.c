/* SPDX-License-Identifier: Apache-2.0 */
/* A plugin that selects an ABI version that the host did not offer. */
#include <arhost/arhost.h>

static arhost_status negotiate(const arhost_offer *offer, arhost_answer *answer) {
    (void)offer;
    answer->abi_version = 77;
    return ARHOST_STATUS_OK;
}
ARHOST_EXPORT const arhost_entry_point arhost_entry = {sizeof(arhost_entry_point), 0, negotiate};
