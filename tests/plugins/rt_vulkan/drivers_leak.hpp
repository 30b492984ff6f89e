// SPDX-License-Identifier: Apache-2.0
//
// For a program's one file that is to look for no leaks: Mesa's drivers leak, and have been unloaded when that is
// told, so that no suppression can name them.
#pragma once

#if defined(__SANITIZE_ADDRESS__)
extern "C" __attribute__((visibility("default"))) const char *__asan_default_options() {
    return "detect_leaks=0";
}
#endif
