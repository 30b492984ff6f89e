// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh_file.hpp"

#include "scene/mesh.hpp"

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

constexpr std::size_t chunk = 1 << 20; // bytes read between two progress reports

class File {
public:
    // O_NONBLOCK: opening a FIFO would otherwise block until it has a writer.
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

Bytes read_whole(const std::string &name, std::uint64_t byte_limit, const Reporter &reporter) {
    reporter.reads(name);
    const File file(name);
    struct stat status {};
    if (file.fd() < 0 || fstat(file.fd(), &status) != 0)
        fail(name, std::string("cannot be read: ") + std::strerror(errno));
    if (!S_ISREG(status.st_mode))
        fail(name, S_ISDIR(status.st_mode) ? "is a folder, not a mesh file" : "is not a regular file");
    const auto size = static_cast<std::uint64_t>(status.st_size);
    if (size > byte_limit)
        fail(name, "is " + mebibytes(size) + " large; the limit is " + mebibytes(byte_limit));
    Bytes bytes;
    bytes.resize(size);
    std::size_t done = 0;
    while (done < size) {
        const ssize_t count = ::read(file.fd(), bytes.data() + done, std::min(chunk, size - done));
        if (count < 0 && errno == EINTR)
            continue;
        if (count < 0)
            fail(name, std::string("cannot be read: ") + std::strerror(errno));
        if (count == 0)
            fail(name, "became shorter while it was being read");
        done += static_cast<std::size_t>(count);
        reporter.report(-1);
    }
    return bytes;
}

bool is_gzip(const char *data, std::size_t size) {
    return size >= 2 && static_cast<unsigned char>(data[0]) == 0x1f && static_cast<unsigned char>(data[1]) == 0x8b;
}

// A gzip file is a sequence of members (RFC 1952, 2.2), possibly followed by zero padding.
class GzipReader {
public:
    GzipReader(const std::string &name, Bytes &compressed) : name_(name), compressed_(compressed) {
        if (inflateInit2(&stream_, 16 + MAX_WBITS) != Z_OK)
            throw std::bad_alloc();
    }
    ~GzipReader() { inflateEnd(&stream_); }
    GzipReader(const GzipReader &) = delete;
    GzipReader &operator=(const GzipReader &) = delete;

    Bytes run(std::uint64_t file_limit, const Reporter &reporter) {
        const std::uint64_t expanded_limit = expansion_limit(compressed_.size());
        const std::uint64_t byte_limit = std::min(file_limit, expanded_limit);
        Bytes out;
        out.resize(estimated_size(byte_limit));
        std::size_t written = 0, consumed = 0;
        while (true) {
            if (written == out.size()) {
                if (out.size() >= byte_limit)
                    fail(name_, "its decompressed content exceeds the limit of " + mebibytes(byte_limit) +
                                    (byte_limit == expanded_limit
                                         ? " for a file of this size; meshes do not compress so well: decompress it "
                                           "with gunzip if it is genuine"
                                         : ""));
                out.resize(std::min<std::uint64_t>(byte_limit, std::max(chunk, 2 * out.size())));
            }
            stream_.next_in = reinterpret_cast<Bytef *>(compressed_.data() + consumed);
            stream_.avail_in = static_cast<uInt>(std::min(compressed_.size() - consumed, 64 * chunk));
            stream_.next_out = reinterpret_cast<Bytef *>(out.data() + written);
            stream_.avail_out = static_cast<uInt>(std::min(out.size() - written, chunk));
            const uInt input = stream_.avail_in, output = stream_.avail_out;
            const int status = inflate(&stream_, Z_NO_FLUSH);
            consumed += input - stream_.avail_in;
            written += output - stream_.avail_out;
            if (status == Z_STREAM_END) {
                if (ends_at(consumed))
                    break;
                if (!is_gzip(compressed_.data() + consumed, compressed_.size() - consumed))
                    fail(name_, "the gzip data is corrupt at byte " + std::to_string(consumed) +
                                    ": a gzip header is expected here");
                inflateReset(&stream_);
            } else if (status == Z_MEM_ERROR) {
                throw std::bad_alloc();
            } else if (status == Z_BUF_ERROR ||
                       (status == Z_OK && consumed == compressed_.size() && stream_.avail_out > 0)) {
                fail(name_, "the gzip data is truncated after byte " + std::to_string(consumed));
            } else if (status != Z_OK) {
                fail(name_, "the gzip data is corrupt at byte " + std::to_string(consumed) +
                                (stream_.msg ? std::string(": ") + stream_.msg : ""));
            }
            reporter.report(-1);
        }
        out.resize(written);
        return out;
    }

private:
    // Estimates the decompressed size from the gzip trailer, which has the size modulo 2^32. The trailer may be
    // wrong, so the estimate is limited to deflate's highest compression ratio, 1032:1.
    std::uint64_t estimated_size(std::uint64_t byte_limit) const {
        std::uint64_t stated = 0;
        for (std::size_t i = 0; i < 4 && compressed_.size() >= 18; ++i)
            stated |= std::uint64_t(static_cast<unsigned char>(compressed_.data()[compressed_.size() - 4 + i]))
                      << (8 * i);
        return std::min({stated + 64, std::uint64_t(compressed_.size()) * 1032, byte_limit});
    }
    bool ends_at(std::size_t consumed) const {
        return std::all_of(compressed_.data() + consumed, compressed_.data() + compressed_.size(),
                           [](char c) { return c == 0; });
    }

    const std::string &name_;
    Bytes &compressed_;
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

MeshFile MeshFile::read(const std::filesystem::path &file, std::uint64_t byte_limit, const Reporter &reporter) {
    std::string name = file.string();
    Bytes bytes = read_whole(name, byte_limit, reporter);
    if (is_gzip(bytes.data(), bytes.size()))
        bytes = GzipReader(name, bytes).run(byte_limit, reporter);
    return MeshFile(std::move(name), std::move(bytes));
}

void MeshFile::normalize_line_ends() {
    if (view().find('\n') == std::string_view::npos)
        std::replace(bytes_->data(), bytes_->data() + bytes_->size(), '\r', '\n');
}

void MeshFile::fail(const std::string &message) const {
    throw MeshError(name_ + ": " + message);
}

void MeshFile::fail_line(const char *at, const std::string &message) const {
    throw MeshError(name_ + ":" + std::to_string(1 + std::count(begin(), std::min(at, end()), '\n')) + ": " +
                    message);
}

void MeshFile::fail_byte(const char *at, const std::string &message) const {
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

std::string printable(std::string text) {
    for (char &c : text)
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
            c = '?';
    return text.substr(0, 200);
}

} // namespace arhost::scene
