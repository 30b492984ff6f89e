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

// The bytes that the fuzzer has thought of, taken from the front. Zeros once they are used up.
class Input {
public:
    explicit Input(std::span<const std::uint8_t> bytes) : left_(bytes) {}

    bool empty() const { return left_.empty(); }
    std::span<const std::uint8_t> take(std::size_t most) {
        const auto taken = left_.first(std::min(most, left_.size()));
        left_ = left_.subspan(taken.size());
        return taken;
    }
    template <class T = std::uint8_t> T number() {
        static_assert(std::is_trivially_copyable_v<T>);
        T value{};
        const auto bytes = take(sizeof value);
        std::copy(bytes.begin(), bytes.end(), reinterpret_cast<std::uint8_t *>(&value));
        return value;
    }
    std::string text(std::size_t most) {
        const auto bytes = take(most);
        return {bytes.begin(), bytes.end()};
    }

    // Overwrites some places of what is valid, so that the rest of it still passes the checks. No more input: none.
    void spoil(std::span<std::byte> valid) {
        for (unsigned places = number(); places > 0 && !valid.empty() && !empty(); --places) {
            const std::size_t at = number<std::uint16_t>() % valid.size();
            const auto bytes = take(1 + number() % 8);
            std::memcpy(valid.data() + at, bytes.data(), std::min(bytes.size(), valid.size() - at));
        }
    }

private:
    std::span<const std::uint8_t> left_;
};

} // namespace arhost::fuzz
