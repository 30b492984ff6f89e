// SPDX-License-Identifier: Apache-2.0
//
// A file that a report is written to: tried before the run, and whole after it or as it was before.
#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

namespace arhost::conform {

class ReportFile {
public:
    // "": none is wanted. Throws std::runtime_error where it can't be written.
    explicit ReportFile(const std::string &file);
    ~ReportFile(); // removes what has not become whole
    ReportFile(const ReportFile &) = delete;
    ReportFile &operator=(const ReportFile &) = delete;

    void write(const std::string &text); // once; throws likewise

private:
    struct Close {
        void operator()(std::FILE *stream) const { std::fclose(stream); }
    };
    [[noreturn]] void refuse() const;

    std::filesystem::path file_, temporary_; // beside it; none for a pipe or a device
    std::unique_ptr<std::FILE, Close> stream_;
};

} // namespace arhost::conform
