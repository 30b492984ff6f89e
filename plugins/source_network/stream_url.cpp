// SPDX-License-Identifier: Apache-2.0
#include "stream_url.hpp"

#include <arhost-cpp/plugin.hpp>
#include <arhost-cpp/url.hpp>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstdint>
#include <string_view>

namespace arhost {
namespace {

// `url`: without its scheme. Libav ends the authority at the first slash, even if that belongs to a password.
bool has_valid_port(std::string_view url) {
    std::string_view host = url.substr(0, url.find_first_of("/?#"));
    host.remove_prefix(host.rfind('@') + 1); // npos + 1 is 0
    const std::size_t colon = host.rfind(':');
    if (colon == std::string_view::npos || host.ends_with(']'))
        return true;
    std::uint16_t port = 0;
    const char *const end = host.data() + host.size();
    const auto [last, error] = std::from_chars(host.data() + colon + 1, end, port);
    return error == std::errc() && last == end && port > 0;
}

} // namespace

void check_url(const std::string &url) {
    constexpr std::size_t max_length = 2000; // far below the maximum line length of LibavLog
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
    const bool is_plain = std::ranges::all_of(url, [](unsigned char c) {
        return std::isprint(c) && url_delimiters.find(char(c)) == std::string_view::npos;
    });
    if (!is_plain)
        throw rejection("contains a blank, quote, bracket, control or non-ASCII character; write it as %20, %27 …");
    if (url.find_first_of("/?#", scheme->size()) == scheme->size() || url.size() == scheme->size())
        throw rejection("names no host");
    if (!has_valid_port(std::string_view(url).substr(scheme->size())))
        throw rejection("the port must be a number from 1 to 65535; write a slash in a password as %2F");
}

std::string without_credentials(const std::string &text) {
    return without_url_credentials(text, "?…");
}

} // namespace arhost
