// SPDX-License-Identifier: Apache-2.0
//
// A file that grows by lines and is whole at every moment: each goes out in one write(2), so that a reader
// after a crash sees whole lines. After a restart it is the same bytes as without one.
#pragma once

#include "sink_common/files.hpp"

#include <functional>
#include <optional>
#include <string_view>

namespace arhost::files {

class LineFile {
public:
    LineFile(const Host &host, std::filesystem::path path) : host_(host), path_(std::move(path)) {}

    // As arhost_sink_setup.first_sequence has it. On a fresh start an older file stays as it is until the
    // first line comes, since the run may yet be refused. After a restart the file is cut back to the lines
    // that `keep` says yes to, in order, up to the first that it refuses.
    void start(std::uint64_t first_sequence, const std::function<bool(std::string_view line)> &keep);

    bool empty() const { return end_ == 0; } // no line stands in it yet
    // One or more whole lines with their ends. Where the disk is full none of them stays.
    void append(std::string_view lines);

private:
    void open();

    Host host_;
    std::filesystem::path path_;
    std::optional<File> file_;
    std::uint64_t end_ = 0; // of the last whole line
};

} // namespace arhost::files
