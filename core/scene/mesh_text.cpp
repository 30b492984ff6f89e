// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh_text.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <new>

namespace arhost::scene {
namespace {

constexpr std::size_t chunk = 1 << 20; // between two looks at the watch

class File {
public:
    // O_NONBLOCK: a FIFO would otherwise be waited for until somebody writes to it.
    explicit File(const std::filesystem::path &path) : fd_(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {}
    ~File() {
        if (fd_ >= 0)
            close(fd_);
    }
    File(const File &) = delete;
    File &operator=(const File &) = delete;
    int fd() const { return fd_; }

private:
    int fd_;
};

[[noreturn]] void fail(const std::string &name, const std::string &message) {
    throw MeshError(name + ": " + message);
}

std::string mebibytes(std::uint64_t bytes) {
    return std::to_string(bytes >> 20) + " MiB";
}

Bytes read_whole(const std::string &name, std::uint64_t byte_limit, const Watch &watch) {
    watch.reads(name);
    const File file(name);
    struct stat status {};
    if (file.fd() < 0 || fstat(file.fd(), &status) != 0)
        fail(name, std::string("can't be read: ") + std::strerror(errno));
    if (!S_ISREG(status.st_mode))
        fail(name, S_ISDIR(status.st_mode) ? "is a folder, not a mesh file" : "is not a regular file");
    const auto size = static_cast<std::uint64_t>(status.st_size);
    if (size > byte_limit)
        fail(name, "has " + mebibytes(size) + "; " + mebibytes(byte_limit) + " is the most that is loaded");
    Bytes bytes;
    bytes.resize(size);
    std::size_t done = 0;
    while (done < size) {
        const ssize_t count = ::read(file.fd(), bytes.data() + done, std::min(chunk, size - done));
        if (count < 0 && errno == EINTR)
            continue;
        if (count < 0)
            fail(name, std::string("can't be read: ") + std::strerror(errno));
        if (count == 0)
            fail(name, "became shorter while it was read");
        done += static_cast<std::size_t>(count);
        watch.report(-1);
    }
    return bytes;
}

bool is_gzip(const char *data, std::size_t size) {
    return size >= 2 && static_cast<unsigned char>(data[0]) == 0x1f && static_cast<unsigned char>(data[1]) == 0x8b;
}

// A gzip file is a row of members (RFC 1952, 2.2), perhaps with zeros behind.
class Unzip {
public:
    Unzip(const std::string &name, Bytes &packed) : name_(name), packed_(packed) {
        if (inflateInit2(&stream_, 16 + MAX_WBITS) != Z_OK)
            throw std::bad_alloc();
    }
    ~Unzip() { inflateEnd(&stream_); }
    Unzip(const Unzip &) = delete;
    Unzip &operator=(const Unzip &) = delete;

    Bytes run(std::uint64_t byte_limit, const Watch &watch) {
        Bytes out;
        out.resize(first_guess(byte_limit));
        std::size_t made = 0, used = 0;
        while (true) {
            if (made == out.size()) {
                if (out.size() >= byte_limit)
                    fail(name_, "unpacks to more than " + mebibytes(byte_limit) + ", the most that is loaded");
                out.resize(std::min<std::uint64_t>(byte_limit, std::max(chunk, 2 * out.size())));
            }
            stream_.next_in = reinterpret_cast<Bytef *>(packed_.data() + used);
            stream_.avail_in = static_cast<uInt>(std::min(packed_.size() - used, 64 * chunk));
            stream_.next_out = reinterpret_cast<Bytef *>(out.data() + made);
            stream_.avail_out = static_cast<uInt>(std::min(out.size() - made, chunk));
            const uInt in = stream_.avail_in, room = stream_.avail_out;
            const int status = inflate(&stream_, Z_NO_FLUSH);
            used += in - stream_.avail_in;
            made += room - stream_.avail_out;
            if (status == Z_STREAM_END) {
                if (ends_at(used))
                    break;
                if (!is_gzip(packed_.data() + used, packed_.size() - used))
                    fail(name_, "the gzip data is damaged at byte " + std::to_string(used) + ": not a gzip member");
                inflateReset(&stream_);
            } else if (status == Z_MEM_ERROR) {
                throw std::bad_alloc();
            } else if (status == Z_BUF_ERROR || (status == Z_OK && used == packed_.size() && stream_.avail_out > 0)) {
                fail(name_, "the gzip data is cut short after byte " + std::to_string(used));
            } else if (status != Z_OK) {
                fail(name_, "the gzip data is damaged at byte " + std::to_string(used) +
                                (stream_.msg ? std::string(": ") + stream_.msg : ""));
            }
            watch.report(-1);
        }
        out.resize(made);
        return out;
    }

private:
    // The last four bytes tell the size modulo 2^32; deflate can't pack better than 1032 to 1.
    std::uint64_t first_guess(std::uint64_t byte_limit) const {
        std::uint64_t told = 0;
        for (std::size_t i = 0; i < 4 && packed_.size() >= 18; ++i)
            told |= std::uint64_t(static_cast<unsigned char>(packed_.data()[packed_.size() - 4 + i])) << (8 * i);
        return std::min({told + 64, std::uint64_t(packed_.size()) * 1032, byte_limit});
    }
    bool ends_at(std::size_t used) const {
        return std::all_of(packed_.data() + used, packed_.data() + packed_.size(), [](char c) { return c == 0; });
    }

    const std::string &name_;
    Bytes &packed_;
    z_stream stream_{};
};

} // namespace

void Bytes::resize(std::size_t size) {
    void *grown = std::realloc(bytes_.get(), std::max<std::size_t>(size, 1));
    if (!grown)
        throw std::bad_alloc();
    (void)bytes_.release();
    bytes_.reset(static_cast<char *>(grown));
    size_ = size;
}

MeshText MeshText::read(const std::filesystem::path &file, std::uint64_t byte_limit, const Watch &watch) {
    std::string name = file.string();
    Bytes bytes = read_whole(name, byte_limit, watch);
    if (is_gzip(bytes.data(), bytes.size()))
        bytes = Unzip(name, bytes).run(byte_limit, watch);
    return MeshText(std::move(name), std::move(bytes));
}

void MeshText::lone_carriage_returns_to_newlines() {
    if (view().find('\n') == std::string_view::npos)
        std::replace(bytes_->data(), bytes_->data() + bytes_->size(), '\r', '\n');
}

void MeshText::fail(const std::string &message) const {
    throw MeshError(name_ + ": " + message);
}

void MeshText::fail_line(const char *at, const std::string &message) const {
    throw MeshError(name_ + ":" + std::to_string(1 + std::count(begin(), std::min(at, end()), '\n')) + ": " +
                    message);
}

void MeshText::fail_byte(const char *at, const std::string &message) const {
    throw MeshError(name_ + ": byte " + std::to_string(at - begin()) + ": " + message);
}

std::string token_at(const char *p, const char *end) {
    constexpr std::size_t longest = 24;
    std::string token;
    for (; p < end && *p != '\n' && !is_blank(*p); ++p) {
        if (token.size() == longest)
            return token + "…";
        token += *p >= 0x20 && *p < 0x7f ? *p : '?';
    }
    return token;
}

} // namespace arhost::scene
