// SPDX-License-Identifier: Apache-2.0
//
// A FIFO or standard output. No call blocks in the kernel. While the reading program is missing or does not read, the
// functions report progress to the host. Once the host cancels the call, they throw Failure
// (ARHOST_STATUS_ERROR_CANCELLED).
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <cstdint>
#include <span>
#include <string>

namespace arhost::pipe {

class PipeStream {
public:
    enum class Content { text, binary }; // only text is written to a terminal
    // `path`: the path of an existing FIFO, or "-" for standard output.
    PipeStream(const Host &host, std::string path, Content content)
        : host_(host), path_(std::move(path)), content_(content) {}
    ~PipeStream() { close(); }
    PipeStream(const PipeStream &) = delete;
    PipeStream &operator=(const PipeStream &) = delete;

    bool is_standard_output() const { return path_ == "-"; }
    std::string name() const { return is_standard_output() ? "standard output" : "'" + path_ + "'"; }

    // Throws Failure if the path is not a FIFO or cannot be written. Does not open the FIFO, because closing it again
    // would end the stream of a waiting reader.
    void check() const;

    bool is_open() const { return fd_ >= 0; }
    // Waits for a reader. If an earlier stream may still be in the FIFO (`after_another` is set, or bytes are
    // unread), first waits until the reader of that stream has seen its end.
    void open(bool after_another);
    // Waits until all bytes are written. Returns false if the reader has closed the stream.
    bool write(std::span<const std::uint8_t> bytes);
    void close();

private:
    void open_standard_output();
    void wait_for_end_of_earlier_stream();
    void wait(const char *what) const;

    Host host_;
    std::string path_;
    Content content_;
    int fd_ = -1;
};

} // namespace arhost::pipe
