/* SPDX-License-Identifier: Apache-2.0 */
/* A library, and (with USER) what is linked with it and lies in another folder. */
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
