// SPDX-License-Identifier: Apache-2.0
//
// Disables leak checks; include in one file of a program. Mesa's drivers leak, and are unloaded when leaks are
// reported, so that suppressions cannot name them.
#pragma once

#if defined(__SANITIZE_ADDRESS__)
extern "C" __attribute__((visibility("default"))) const char *__asan_default_options() {
    return "detect_leaks=0";
}
#endif
