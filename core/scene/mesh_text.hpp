// SPDX-License-Identifier: Apache-2.0
//
// A mesh file's content in memory, and the reading of numbers out of it. Private to core/scene.
#pragma once

#include "scene/mesh.hpp"

#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <memory>
#include <string>
#include <string_view>

namespace arhost::scene {

// Bytes that grow without being zeroed or copied first.
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

// Tells that the work goes on, and asks whether it should.
class Watch {
public:
    Watch(const LoadCallbacks &callbacks, std::string what) : callbacks_(callbacks), what_(std::move(what)) {}
    void report(double fraction) const {
        if (callbacks_.progress)
            callbacks_.progress(fraction, what_);
        if (callbacks_.cancelled && callbacks_.cancelled())
            throw Cancelled();
    }
    void info(const std::string &text) const {
        if (callbacks_.info)
            callbacks_.info(text);
    }
    void reads(const std::filesystem::path &file) const {
        if (callbacks_.reads)
            callbacks_.reads(file);
    }

private:
    const LoadCallbacks &callbacks_;
    std::string what_;
};

// A file's content, unpacked.
class MeshText {
public:
    static MeshText read(const std::filesystem::path &file, std::uint64_t byte_limit, const Watch &watch);

    const char *begin() const { return bytes_.get()->data(); }
    const char *end() const { return bytes_.get()->data() + bytes_.get()->size(); }
    std::string_view view() const { return {begin(), bytes_->size()}; }
    const std::string &name() const { return name_; }
    void lone_carriage_returns_to_newlines();

    [[noreturn]] void fail(const std::string &message) const;                      // about the file
    [[noreturn]] void fail_line(const char *at, const std::string &message) const; // about the line at `at`
    [[noreturn]] void fail_byte(const char *at, const std::string &message) const; // about a binary file

private:
    MeshText(std::string name, Bytes bytes)
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

// Past the end of the line.
inline void skip_line(const char *&p, const char *end) {
    const void *newline = p < end ? std::char_traits<char>::find(p, end - p, '\n') : nullptr;
    p = newline ? static_cast<const char *>(newline) + 1 : end;
}

// Up to the next blank or line end, shortened and without control characters, for messages.
std::string token_at(const char *p, const char *end);

// Reads the number at p and moves p behind it; false where there is none.
inline bool read_number(const char *&p, const char *end, float &value) {
    const char *begin = p < end && *p == '+' ? p + 1 : p;
    const auto [stop, error] = std::from_chars(begin, end, value);
    if (error == std::errc::invalid_argument)
        return false;
    if (error == std::errc::result_out_of_range) // too small for a float counts as 0, too large as infinite
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

// Makes normals as MeshOptions::smooth says, each of unit length.
void settle_normals(TriangleMesh &mesh, std::optional<bool> smooth);

TriangleMesh parse_obj(MeshText &text, const Watch &watch);
TriangleMesh parse_ply(MeshText &text, const Watch &watch);

} // namespace arhost::scene
