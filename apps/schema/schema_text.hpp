// SPDX-License-Identifier: Apache-2.0
//
// The table of all configuration keys, as text.
#pragma once

#include <string>

namespace arhost::schema {

std::string as_markdown();    // the table in docs/config.md
std::string as_json_schema(); // the contents of docs/arhost.schema.json

} // namespace arhost::schema
