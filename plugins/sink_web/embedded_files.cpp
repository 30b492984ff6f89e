// SPDX-License-Identifier: Apache-2.0
#include "embedded_files.hpp"

asm(".section .rodata\n"
    "web_page: .incbin \"" PAGE_HTML "\"\n"
    "web_page_end:\n"
    "web_openapi: .incbin \"" OPENAPI_JSON "\"\n"
    "web_openapi_end:\n"
    ".previous");
extern "C" [[gnu::visibility("hidden")]] const char web_page[], web_page_end[], web_openapi[], web_openapi_end[];

namespace arhost::web {

std::string_view page_html() {
    return {web_page, web_page_end};
}

std::string_view openapi_json() {
    return {web_openapi, web_openapi_end};
}

} // namespace arhost::web
