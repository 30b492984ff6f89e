// SPDX-License-Identifier: Apache-2.0
//
// Disables AddressSanitizer's leak checker; to be included in one source file of a program. Mesa's drivers leak
// memory. Suppressions cannot name these drivers, because they are already unloaded when the leaks are reported.
#pragma once

#if defined(__SANITIZE_ADDRESS__)
extern "C" __attribute__((visibility("default"))) const char *__asan_default_options() {
    return "detect_leaks=0";
}
#endif
