/* SPDX-License-Identifier: Apache-2.0 */
/* A library, and (with USER) a library in another folder that is linked with it. */
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
