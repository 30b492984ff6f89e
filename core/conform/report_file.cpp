// SPDX-License-Identifier: Apache-2.0
#include "conform/report_file.hpp"

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <unistd.h>

namespace arhost::conform {

namespace fs = std::filesystem;

ReportFile::ReportFile(const std::string &file) : file_(file) {
    if (file.empty())
        return;
    std::error_code ignored;
    const fs::file_status status = fs::status(file_, ignored);
    if (fs::is_directory(status))
        throw std::runtime_error("can't write " + file + ": it is a folder");
    if ((fs::exists(status) && !fs::is_regular_file(status)) || file.starts_with("/dev/")) {
        stream_.reset(std::fopen(file_.c_str(), "a"));
    } else {
        if (fs::is_regular_file(status))
            file_ = fs::canonical(file_); // a link stays one
        const std::string beside = file_.string() + "." + std::to_string(::getpid()) + ".tmp";
        stream_.reset(std::fopen(beside.c_str(), "wx"));
        if (!stream_ && errno == EEXIST)
            throw std::runtime_error("can't write " + file + ": another report is written there");
        temporary_ = stream_ ? beside : "";
    }
    if (!stream_)
        refuse();
}

ReportFile::~ReportFile() {
    std::error_code ignored;
    if (!temporary_.empty())
        fs::remove(temporary_, ignored);
}

void ReportFile::write(const std::string &text) {
    if (!stream_)
        return;
    const bool whole = std::fwrite(text.data(), 1, text.size(), stream_.get()) == text.size();
    if (std::fclose(stream_.release()) != 0 || !whole)
        refuse();
    if (!temporary_.empty() && ::rename(temporary_.c_str(), file_.c_str()) != 0)
        refuse();
    temporary_.clear();
}

void ReportFile::refuse() const {
    throw std::runtime_error("can't write " + file_.string() + ": " + std::strerror(errno));
}

} // namespace arhost::conform
