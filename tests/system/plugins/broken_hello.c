/* SPDX-License-Identifier: Apache-2.0 */
/* A library that sends the first message of its worker itself, with another id, while it is being loaded. */
#include "misbehave.h"

__attribute__((constructor)) static void say_hello(void) {
    static const char text[] =
        "{\"type\": \"hello\", \"sandbox\": \"\", \"descriptor\": {\"kind\": 1, \"id\": \"" ID "\", "
        "\"name\": \"\", \"version\": \"\", \"vendor\": \"\", \"licence\": \"\", "
        "\"description\": \"\", \"capabilities\": 0, \"options\": [], \"needs\": [], "
        "\"changeable\": []}}";
    misbehave_send(text, sizeof text - 1, 0);
    for (;;)
        pause();
}
