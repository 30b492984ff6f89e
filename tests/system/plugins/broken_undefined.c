/* SPDX-License-Identifier: Apache-2.0 */
/* A plugin with an undefined symbol. */
#include <arhost/arhost.h>

extern arhost_status arhost_test_nowhere(const arhost_offer *offer, arhost_answer *answer);

ARHOST_EXPORT const arhost_entry_point arhost_entry = {sizeof(arhost_entry_point), 0, arhost_test_nowhere};
