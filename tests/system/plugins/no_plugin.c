/* SPDX-License-Identifier: Apache-2.0 */
/* A library that has nothing to do with arhost. */
int answer(void);
__attribute__((visibility("default"))) int answer(void) {
    return 42;
}
