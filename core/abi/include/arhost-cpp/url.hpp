// SPDX-License-Identifier: Apache-2.0
//
// Removes user names, passwords and queries from the URLs in texts that others may read.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>

namespace arhost {

// These characters end a URL in a text. RFC 3986 excludes them from URLs, except for the apostrophe.
inline constexpr std::string_view url_delimiters = " \t\r\n\"'<>";

// Returns the text without the names and passwords of its URLs, and with `query` in place of their queries and
// fragments.
inline std::string without_url_credentials(const std::string &text, std::string_view query) {
    std::string shown;
    for (std::size_t at = 0;;) {
        const std::size_t scheme = text.find("://", at);
        if (scheme == std::string::npos)
            return shown + text.substr(at);
        const std::size_t begin = scheme + 3, end = std::min(text.find_first_of(url_delimiters, begin), text.size());
        shown.append(text, at, begin - at);
        std::string_view url = std::string_view(text).substr(begin, end - begin);
        // The last @, even in the path: a password may contain an unescaped slash.
        if (const std::size_t user_end = url.rfind('@'); user_end != std::string_view::npos)
            url.remove_prefix(user_end + 1);
        const std::size_t query_begin = url.find_first_of("?#");
        shown.append(url.substr(0, query_begin));
        if (query_begin != std::string_view::npos)
            shown.append(query);
        at = end;
    }
}

} // namespace arhost
