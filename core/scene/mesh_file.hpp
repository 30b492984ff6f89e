// SPDX-License-Identifier: Apache-2.0
//
// The content of a mesh file in memory, and functions that parse it. Private to core/scene.
#pragma once

#include "scene/callbacks.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace arhost::scene {

// Returns how many bytes `compressed_bytes` may expand to: 100 times as many, or 16 MiB if that is more. Compression
// reduces meshes to between a third and a tenth, and a file of only zeros to a thousandth.
constexpr std::uint64_t expansion_limit(std::uint64_t compressed_bytes) {
    return std::max<std::uint64_t>(16 << 20, 100 * compressed_bytes);
}

// Growable buffer that leaves new bytes uninitialized.
class Bytes {
public:
    void resize(std::size_t size);
    char *data() { return bytes_.get(); }
    std::size_t size() const { return size_; }

private:
    struct Free {
        void operator()(char *p) const { std::free(p); }
    };
    std::unique_ptr<char, Free> bytes_;
    std::size_t size_ = 0;
};

// The content of a file, after gzip decompression if it is compressed.
class MeshFile {
public:
    // Throws MeshError, also if the file or its decompressed content has more than `byte_limit` bytes, or if the
    // content exceeds the expansion limit.
    static MeshFile read(const std::filesystem::path &file, std::uint64_t byte_limit, const Reporter &reporter);

    const char *begin() const { return bytes_.get()->data(); }
    const char *end() const { return bytes_.get()->data() + bytes_.get()->size(); }
    std::string_view view() const { return {begin(), bytes_->size()}; }
    const std::string &name() const { return name_; }
    void normalize_line_ends(); // converts CR line ends (classic Mac OS) to LF

    // Each function throws a MeshError that names the file. fail_line also names the line that contains `at`;
    // fail_byte names the byte offset of `at`.
    [[noreturn]] void fail(const std::string &message) const;
    [[noreturn]] void fail_line(const char *at, const std::string &message) const;
    [[noreturn]] void fail_byte(const char *at, const std::string &message) const;

private:
    MeshFile(std::string name, Bytes bytes)
        : name_(std::move(name)), bytes_(std::make_unique<Bytes>(std::move(bytes))) {}
    std::string name_;
    std::unique_ptr<Bytes> bytes_;
};

inline bool is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}

inline void skip_blanks(const char *&p, const char *end) {
    while (p < end && is_blank(*p))
        ++p;
}

// Moves p past the end of the line.
inline void skip_line(const char *&p, const char *end) {
    const void *newline = p < end ? std::char_traits<char>::find(p, end - p, '\n') : nullptr;
    p = newline ? static_cast<const char *>(newline) + 1 : end;
}

// Returns the text from p to the end of the line, without blanks around it.
inline std::string_view rest_of_line(const char *p, const char *end) {
    skip_blanks(p, end);
    const char *stop = std::find(p, end, '\n');
    while (stop > p && is_blank(stop[-1]))
        --stop;
    return {p, static_cast<std::size_t>(stop - p)};
}

// Returns the token at p for error messages: shortened, and with '?' for each character that is not printable ASCII.
std::string token_at(const char *p, const char *end);

// Returns at most 200 bytes of `text` for messages and names, with '?' for control characters.
std::string printable(std::string text);

// Parses the number at p and moves p past it. Returns false if there is no number.
inline bool read_number(const char *&p, const char *end, float &value) {
    const char *begin = p < end && *p == '+' ? p + 1 : p;
    const auto [stop, error] = std::from_chars(begin, end, value);
    if (error == std::errc::invalid_argument)
        return false;
    if (error == std::errc::result_out_of_range) // underflow gives 0, overflow infinity
        value = std::strtof(std::string(begin, stop).c_str(), nullptr);
    p = stop;
    return true;
}

inline bool read_integer(const char *&p, const char *end, std::int64_t &value) {
    const auto [stop, error] = std::from_chars(p < end && *p == '+' ? p + 1 : p, end, value);
    if (error != std::errc())
        return false;
    p = stop;
    return true;
}

} // namespace arhost::scene
