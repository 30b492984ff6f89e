// SPDX-License-Identifier: Apache-2.0
//
// Files that are embedded in the plugin.
#pragma once

#include <string_view>

namespace arhost::web {

std::string_view page_html(); // has placeholders: {{name}}
std::string_view openapi_json();

} // namespace arhost::web
