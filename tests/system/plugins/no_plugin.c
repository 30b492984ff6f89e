/* SPDX-License-Identifier: Apache-2.0 */
/* A library that is not a plugin. */
int answer(void);
__attribute__((visibility("default"))) int answer(void) {
    return 42;
}
