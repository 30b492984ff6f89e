// SPDX-License-Identifier: Apache-2.0
#include "sink_common/pattern.hpp"

#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <charconv>
#include <utility>

namespace arhost::files {

FramePattern::FramePattern(std::filesystem::path folder, std::string before, std::size_t width, std::string after)
    : folder_(std::move(folder)), before_(std::move(before)), after_(std::move(after)), width_(width) {}

std::optional<FramePattern> FramePattern::parse(const std::filesystem::path &path) {
    const std::string text = path.filename().string();
    if (text.find('%') == std::string::npos)
        return std::nullopt;
    const auto refuse = [&](const std::string &what) {
        return Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                       "path: '" + text + "' " + what +
                           "; write the frame's number as one %d or, filled up with "
                           "zeros, one %05d, and a plain '%' as %%");
    };
    std::string parts[2]; // before and after the number
    std::size_t width = 0;
    bool numbered = false;
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] != '%') {
            parts[numbered] += text[i];
            continue;
        }
        if (++i < text.size() && text[i] == '%') {
            parts[numbered] += '%';
            continue;
        }
        const std::size_t digits = i;
        i = std::min(text.find_first_not_of("0123456789", i), text.size());
        if (i == text.size() || text[i] != 'd' || (i > digits && text[digits] != '0') || i == digits + 1)
            throw refuse("has a '%' that is no number");
        if (std::exchange(numbered, true))
            throw refuse("has more than one number");
        std::from_chars(text.data() + digits, text.data() + i, width);
        if (i - digits > 4 || width > 20) // a 64-bit number has at most 20 digits
            throw refuse("asks for more than 20 digits");
    }
    if (!numbered)
        throw refuse("has no number");
    return FramePattern(path.parent_path(), parts[0], width, parts[1]);
}

std::string FramePattern::name(std::uint64_t number) const {
    const std::string digits = std::to_string(number);
    return before_ + std::string(width_ - std::min(width_, digits.size()), '0') + digits + after_;
}

std::filesystem::path FramePattern::file(std::uint64_t number) const {
    return folder_ / name(number);
}

bool FramePattern::matches(const std::string &candidate) const {
    if (candidate.size() <= before_.size() + after_.size())
        return false;
    const char *first = candidate.data() + before_.size(),
               *last = candidate.data() + candidate.size() - after_.size();
    std::uint64_t number = 0;
    const auto [end, error] = std::from_chars(first, last, number);
    return error == std::errc() && end == last && name(number) == candidate;
}

} // namespace arhost::files
