// SPDX-License-Identifier: Apache-2.0
//
// Shared memory: anonymous memfds with one writer each. Seals prevent peers from resizing a memfd while others read
// it, and from mapping it writable after its only writer has mapped it.
//
// Life cycle of a memfd that a worker writes: the host creates it with a sealed size and sends it to the worker. The
// worker maps it writable and acknowledges. The host then seals it against further writers, and only after that
// passes it to readers. A memfd that the host itself writes is mapped and sealed as soon as it is created.
#pragma once

#include "base/unique_fd.hpp"

#include <cstddef>
#include <cstdint>
#include <span>

namespace arhost::ipc {

// A mapping of a whole memfd.
class Mapping {
public:
    Mapping() = default;
    Mapping(std::byte *address, std::size_t size) : address_(address), size_(size) {}
    ~Mapping();
    Mapping(Mapping &&other) noexcept
        : address_(std::exchange(other.address_, nullptr)), size_(std::exchange(other.size_, 0)) {}
    Mapping &operator=(Mapping &&other) noexcept {
        std::swap(address_, other.address_);
        std::swap(size_, other.size_);
        return *this;
    }

    std::span<std::byte> bytes() const { return {address_, size_}; }
    explicit operator bool() const { return address_ != nullptr; }
    // Returns the mapping as a T, which must not be larger than the mapping. T must be trivially copyable or consist
    // of atomics, because no constructor is called; new memory is zeroed.
    template <class T> T &as() const { return *reinterpret_cast<T *>(address_); }

private:
    std::byte *address_ = nullptr;
    std::size_t size_ = 0;
};

enum class Access { read_only, read_write };

class SharedMemory {
public:
    SharedMemory() = default;
    // Creates zeroed memory whose size is sealed. `name` appears in /proc for debugging.
    static SharedMemory create(const char *name, std::size_t size);
    // Takes over memory received from a peer. Throws if it is not a memfd or if the peer could still resize it.
    static SharedMemory adopt(base::UniqueFd fd);
    // Takes over memory that a peer has finished writing, and applies all seals. Throws if a writable mapping still
    // exists.
    static SharedMemory adopt_and_freeze(base::UniqueFd fd);

    Mapping map(Access access) const;
    // Forbids new writable mappings and write(2); existing mappings stay writable.
    void seal_future_writes() const;

    int fd() const { return fd_.get(); }
    std::size_t size() const { return size_; }
    explicit operator bool() const { return static_cast<bool>(fd_); }

private:
    SharedMemory(base::UniqueFd fd, std::size_t size) : fd_(std::move(fd)), size_(size) {}
    base::UniqueFd fd_;
    std::size_t size_ = 0;
};

// Slots of equal size in one memfd, aligned to 64 KiB so that no two share a page or cache line.
struct SlotLayout {
    std::uint64_t slot_size = 0; // usable bytes of each slot
    std::uint32_t count = 0;

    static constexpr std::uint64_t alignment = 64 * 1024;
    std::uint64_t stride() const { return (slot_size + alignment - 1) / alignment * alignment; }
    std::uint64_t byte_size() const { return stride() * count; }
    std::span<std::byte> slot(const Mapping &mapping, std::uint32_t index) const {
        return mapping.bytes().subspan(stride() * index, slot_size);
    }
};

} // namespace arhost::ipc
