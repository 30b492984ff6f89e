// SPDX-License-Identifier: Apache-2.0
//
// Mutates corpus inputs by a few random changes. The same seed gives the same inputs.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string_view>
#include <utility>
#include <vector>

namespace arhost::fuzz {

class Mutator {
public:
    using Content = std::vector<std::uint8_t>;

    Mutator(std::vector<Content> corpus, std::uint32_t seed) : corpus_(std::move(corpus)), random_(seed) {}

    Content next() {
        Content content = pick();
        for (std::size_t changes = 1 + below(5); changes > 0; --changes)
            change(content);
        constexpr std::size_t size_limit = 1 << 16;
        content.resize(std::min(content.size(), size_limit));
        return content;
    }

private:
    std::size_t below(std::size_t end) {
        return random_() % end;
    } // not a std distribution: their results differ between standard libraries
    const Content &pick() { return corpus_[below(corpus_.size())]; }

    void change(Content &content) {
        // Choose a range, which may be empty.
        const auto at = static_cast<std::ptrdiff_t>(below(content.size() + 1));
        const auto begin = content.begin() + at;
        const auto length = static_cast<std::ptrdiff_t>(
            std::min<std::size_t>(content.size() - static_cast<std::size_t>(at), below(below(4) == 0 ? 256 : 9)));
        const Content range(begin, begin + length);
        switch (below(8)) {
        case 0:
            if (length > 0)
                *begin ^= static_cast<std::uint8_t>(1u << below(8));
            break;
        case 1:
            std::generate_n(begin, length, [&] { return static_cast<std::uint8_t>(random_()); });
            break;
        case 2:
            content.erase(begin, begin + length);
            break;
        case 3: // copy the range to its own end or elsewhere
            content.insert(content.begin() + static_cast<std::ptrdiff_t>(below(content.size() + 1)), range.begin(),
                           range.end());
            break;
        case 4:
            std::fill_n(begin, length, static_cast<std::uint8_t>(random_()));
            break;
        case 5: { // replace the tail with the tail of another input
            const Content &other = pick();
            content.erase(begin, content.end());
            content.insert(content.end(),
                           other.begin() + static_cast<std::ptrdiff_t>(
                                               std::min(other.size(), static_cast<std::size_t>(at) + below(9))),
                           other.end());
            break;
        }
        case 6: { // write a boundary value of an integer type
            const std::uint64_t power = std::uint64_t{1} << below(64);
            const std::uint64_t number = power - below(2);
            for (std::ptrdiff_t i = 0; i < std::min<std::ptrdiff_t>(length, 8); ++i)
                begin[i] = static_cast<std::uint8_t>(number >> (8 * i));
            break;
        }
        case 7: {
            constexpr std::array<std::string_view, 10> words = {
                "-1", "0", "1e999", "nan", "4294967295", "\\n", "\"", ": ", "2147483648", "18446744073709551616"};
            const std::string_view word = words[below(words.size())];
            content.insert(content.erase(begin, begin + length), word.begin(), word.end());
        }
        }
    }

    std::vector<Content> corpus_;
    std::mt19937 random_;
};

} // namespace arhost::fuzz
