// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>

namespace arhost::fuzz {

// The fuzzer's bytes, consumed from the front. After the end, all values are 0.
class Input {
public:
    explicit Input(std::span<const std::uint8_t> bytes) : remaining_(bytes) {}

    bool empty() const { return remaining_.empty(); }
    std::span<const std::uint8_t> take(std::size_t limit) {
        const auto taken = remaining_.first(std::min(limit, remaining_.size()));
        remaining_ = remaining_.subspan(taken.size());
        return taken;
    }
    template <class T = std::uint8_t> T number() {
        static_assert(std::is_trivially_copyable_v<T>);
        T value{};
        const auto bytes = take(sizeof value);
        std::copy(bytes.begin(), bytes.end(), reinterpret_cast<std::uint8_t *>(&value));
        return value;
    }
    std::string text(std::size_t limit) {
        const auto bytes = take(limit);
        return {bytes.begin(), bytes.end()};
    }

    // Overwrites some ranges of valid data; the rest still passes validation. Does nothing if no input is left.
    void corrupt(std::span<std::byte> valid) {
        for (unsigned ranges = number(); ranges > 0 && !valid.empty() && !empty(); --ranges) {
            const std::size_t at = number<std::uint16_t>() % valid.size();
            const auto bytes = take(1 + number() % 8);
            std::memcpy(valid.data() + at, bytes.data(), std::min(bytes.size(), valid.size() - at));
        }
    }

private:
    std::span<const std::uint8_t> remaining_;
};

} // namespace arhost::fuzz
