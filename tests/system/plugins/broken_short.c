/* SPDX-License-Identifier: Apache-2.0 */
/* Its arhost_entry is shorter than the struct. */
#include <arhost/arhost.h>

ARHOST_EXPORT const arhost_entry_point arhost_entry = {4, 0};
