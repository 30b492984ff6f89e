// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace arhost {

// Throws Failure unless `url` is a well-formed URL of a supported protocol. The message does not contain the URL.
void check_url(const std::string &url);

// Removes user names, passwords, queries and fragments from all URLs in a text, as a query may contain a password
// too: "Opening 'http://user:secret@camera/a?token=1'" becomes "Opening 'http://camera/a?…'".
std::string without_credentials(const std::string &text);

} // namespace arhost
