/* SPDX-License-Identifier: Apache-2.0 */
/* A plugin whose arhost_entry has a struct_size that is too small. */
#include <arhost/arhost.h>

ARHOST_EXPORT const arhost_entry_point arhost_entry = {4, 0, 0};
