// SPDX-License-Identifier: Apache-2.0
//
// A file that is written once: tried before the work that it tells of, and whole after it or as it was before.
#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

namespace arhost::ring {

class WholeFile {
public:
    // "": none is wanted. What is not a regular file (a pipe, a device), and a file that is this process's standard
    // output or error, is written to and not replaced. Throws std::runtime_error where it can't be written.
    explicit WholeFile(const std::filesystem::path &file);
    ~WholeFile(); // removes what has not become whole
    WholeFile(const WholeFile &) = delete;
    WholeFile &operator=(const WholeFile &) = delete;

    void write(const std::string &text); // once; throws likewise

private:
    struct Close {
        void operator()(std::FILE *stream) const { std::fclose(stream); }
    };
    [[noreturn]] void refuse() const;

    std::filesystem::path file_, temporary_; // beside it; none for what is not replaced
    std::unique_ptr<std::FILE, Close> stream_;
};

} // namespace arhost::ring
