// SPDX-License-Identifier: Apache-2.0
//
// arhost-cpp/numbered_name.hpp: numbered file names, such as "frame_%05d.png". Sources that read numbered files and
// sinks that write them share this parser, so a source can read every name that a sink writes.
#pragma once

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

namespace arhost {

class NumberedName {
public:
    // `name` is a pattern without folders. It contains exactly one conversion: %d, or %0Nd, which pads the number
    // with leading zeros to N digits (N: 1 to 20). "%%" is a percent sign. Throws std::invalid_argument with a
    // message that quotes `name` and describes valid patterns. The pattern is never passed to printf.
    explicit NumberedName(std::string_view name) {
        bool has_number = false;
        for (std::size_t i = 0; i < name.size();) {
            std::string &part = has_number ? suffix_ : prefix_;
            if (name[i] != '%') {
                part += name[i++];
                continue;
            }
            if (name.substr(i, 2) == "%%") {
                part += '%';
                i += 2;
                continue;
            }
            const std::size_t end = std::min(name.find_first_not_of("0123456789", i + 1), name.size() - 1);
            const std::string_view conversion = name.substr(i, end - i + 1);
            const std::string_view width = conversion.substr(1, conversion.size() - 1 - (conversion.size() > 1));
            if (!conversion.ends_with('d') || (!width.empty() && !parse_width(width)))
                throw error(name,
                            std::string("'").append(conversion).append("' is not %d or %0Nd with N from 1 to 20"));
            if (has_number)
                throw error(name, std::string("there is a second number, '").append(conversion) + "'");
            has_number = true;
            i = end + 1;
        }
        if (!has_number)
            throw error(name, "there is no %d");
    }

    std::string name(std::uint64_t number) const {
        const std::string digits = std::to_string(number);
        return prefix_ + std::string(min_digits_ - std::min(min_digits_, digits.size()), '0') + digits + suffix_;
    }

    // Returns the number in `candidate`, or nullopt if this pattern cannot produce that name.
    std::optional<std::uint64_t> number(std::string_view candidate) const {
        if (candidate.size() <= prefix_.size() + suffix_.size() || !candidate.starts_with(prefix_))
            return std::nullopt;
        const char *begin = candidate.data() + prefix_.size();
        const char *end = candidate.data() + candidate.size() - suffix_.size();
        std::uint64_t number = 0;
        const auto [stop, error] = std::from_chars(begin, end, number);
        // The comparison rejects a wrong number of leading zeros and a wrong suffix.
        if (error != std::errc() || stop != end || name(number) != candidate)
            return std::nullopt;
        return number;
    }

    const std::string &prefix() const { return prefix_; }
    const std::string &suffix() const { return suffix_; }

private:
    bool parse_width(std::string_view width) {
        const auto [stop, error] = std::from_chars(width.data(), width.data() + width.size(), min_digits_);
        constexpr std::size_t max_digits = 20; // digits of the largest 64-bit number
        return width.front() == '0' && error == std::errc() && min_digits_ >= 1 && min_digits_ <= max_digits;
    }

    static std::invalid_argument error(std::string_view name, const std::string &reason) {
        return std::invalid_argument(std::string("'").append(name) + "': " + reason +
                                     "; write the frame number as %d or, with leading zeros, as %05d, and a percent "
                                     "sign as %%");
    }

    std::string prefix_, suffix_;
    std::size_t min_digits_ = 1;
};

} // namespace arhost
