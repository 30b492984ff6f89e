/* SPDX-License-Identifier: Apache-2.0 */
/* Without USER: a library. With USER: a library in another folder that links to the first one. */
int elsewhere(void);
#ifdef USER
int uses_elsewhere(void);
int uses_elsewhere(void) {
    return elsewhere();
}
#else
int elsewhere(void) {
    return 1;
}
#endif
