// SPDX-License-Identifier: Apache-2.0
#include "url.hpp"

#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>

namespace arhost {

namespace {

// These characters end a URL in a text. RFC 3986 excludes them from URLs, except for the apostrophe.
constexpr std::string_view delimiters = " \t\r\n\"'<>";

} // namespace

void check_url(const std::string &url) {
    constexpr std::size_t max_length = 2000; // far below the length of a line in LibavLog
    const auto rejection = [](const std::string &why) {
        return Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "url: " + why);
    };
    constexpr std::array<std::string_view, 3> schemes = {"rtsp://", "http://", "https://"};
    const auto scheme =
        std::ranges::find_if(schemes, [&](std::string_view beginning) { return url.starts_with(beginning); });
    if (scheme == schemes.end())
        throw rejection("must begin with rtsp://, http:// or https:// (in lower case)");
    if (url.size() > max_length)
        throw rejection("is longer than " + std::to_string(max_length) + " characters");
    const bool is_plain = std::ranges::all_of(
        url, [](unsigned char c) { return std::isprint(c) && delimiters.find(char(c)) == std::string_view::npos; });
    if (!is_plain)
        throw rejection("contains a blank, quote, bracket, control or non-ASCII character; write it as %20, %27 …");
    if (url.find_first_of("/?#", scheme->size()) == scheme->size() || url.size() == scheme->size())
        throw rejection("names no host");
}

std::string without_credentials(const std::string &text) {
    std::string shown;
    for (std::size_t at = 0;;) {
        const std::size_t scheme = text.find("://", at);
        if (scheme == std::string::npos)
            return shown + text.substr(at);
        const std::size_t begin = scheme + 3, end = std::min(text.find_first_of(delimiters, begin), text.size());
        shown.append(text, at, begin - at);
        std::string_view url = std::string_view(text).substr(begin, end - begin);
        // The last @, even in the path: a password may contain an unescaped slash.
        if (const std::size_t user_end = url.rfind('@'); user_end != std::string_view::npos)
            url.remove_prefix(user_end + 1);
        const std::size_t query = url.find_first_of("?#");
        shown.append(url.substr(0, query));
        if (query != std::string_view::npos)
            shown += "?…";
        at = end;
    }
}

} // namespace arhost
