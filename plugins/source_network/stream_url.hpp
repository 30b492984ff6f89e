// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace arhost {

// Throws Failure unless `url` is a well-formed URL of a supported protocol. The message does not contain the URL.
void check_url(const std::string &url);

// Removes user names, passwords, queries and fragments from all URLs in a text. Queries are removed because they may
// contain passwords. "Opening 'http://user:secret@camera/a?token=1'" becomes "Opening 'http://camera/a?…'".
std::string without_credentials(const std::string &text);

} // namespace arhost
