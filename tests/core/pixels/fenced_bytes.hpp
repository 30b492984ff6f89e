// SPDX-License-Identifier: Apache-2.0
//
// A buffer between two inaccessible guard pages. Accesses outside the buffer crash the test.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <stdexcept>

namespace arhost::test {

class FencedBytes {
public:
    enum Side { at_front, at_back }; // the end of the buffer that is adjacent to a guard page

    FencedBytes(std::size_t size, Side side) : size_(size) {
        const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
        const std::size_t inner = (size + page - 1) / page * page;
        mapped_ = inner + 2 * page;
        base_ = static_cast<std::uint8_t *>(
            mmap(nullptr, mapped_, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0));
        if (base_ == MAP_FAILED || mprotect(base_ + page, inner, PROT_READ | PROT_WRITE) != 0)
            throw std::runtime_error("mmap");
        data_ = base_ + page + (side == at_front ? 0 : inner - size);
    }
    ~FencedBytes() { munmap(base_, mapped_); }
    FencedBytes(const FencedBytes &) = delete;
    FencedBytes &operator=(const FencedBytes &) = delete;

    std::uint8_t *data() const { return data_; }
    std::size_t size() const { return size_; }

private:
    std::size_t size_, mapped_;
    std::uint8_t *base_, *data_;
};

} // namespace arhost::test
