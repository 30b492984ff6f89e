// SPDX-License-Identifier: Apache-2.0
#include "ipc/memory.hpp"

#include <fcntl.h>
#include <linux/memfd.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#ifndef F_SEAL_FUTURE_WRITE
#define F_SEAL_FUTURE_WRITE 0x0010
#endif

namespace arhost::ipc {
namespace {

std::size_t size_of(const base::UniqueFd &fd) {
    struct stat status {};
    if (::fstat(fd.get(), &status) != 0)
        base::throw_errno("fstat of shared memory");
    return static_cast<std::size_t>(status.st_size);
}

void add_seals(const base::UniqueFd &fd, int seals) {
    if (::fcntl(fd.get(), F_ADD_SEALS, seals) != 0)
        base::throw_errno("sealing shared memory");
}

} // namespace

Mapping::~Mapping() {
    if (address_)
        ::munmap(address_, size_);
}

SharedMemory SharedMemory::create(const char *name, std::size_t size) {
    base::UniqueFd fd = base::checked(::memfd_create(name, MFD_CLOEXEC | MFD_ALLOW_SEALING), "memfd_create");
    if (::ftruncate(fd.get(), static_cast<off_t>(size)) != 0)
        base::throw_errno("ftruncate of shared memory");
    add_seals(fd, F_SEAL_GROW | F_SEAL_SHRINK);
    return SharedMemory(std::move(fd), size);
}

SharedMemory SharedMemory::adopt(base::UniqueFd fd) {
    const int seals = ::fcntl(fd.get(), F_GET_SEALS);
    if (seals < 0)
        base::throw_errno("the received shared memory is not a memfd");
    if ((seals & (F_SEAL_GROW | F_SEAL_SHRINK)) != (F_SEAL_GROW | F_SEAL_SHRINK))
        throw std::runtime_error("the size of the received shared memory is not sealed");
    const std::size_t size = size_of(fd);
    return SharedMemory(std::move(fd), size);
}

SharedMemory SharedMemory::adopt_and_freeze(base::UniqueFd fd) {
    add_seals(fd, F_SEAL_GROW | F_SEAL_SHRINK | F_SEAL_WRITE | F_SEAL_SEAL);
    const std::size_t size = size_of(fd);
    return SharedMemory(std::move(fd), size);
}

Mapping SharedMemory::map(Access access) const {
    const int protection = access == Access::read_write ? PROT_READ | PROT_WRITE : PROT_READ;
    // Before version 6.7, Linux rejects shared mappings of a write-sealed memfd even if they are read-only. A private
    // mapping shows the same pages, because they can no longer be written.
    const bool frozen = (::fcntl(fd_.get(), F_GET_SEALS) & F_SEAL_WRITE) != 0;
    const int sharing = frozen && access == Access::read_only ? MAP_PRIVATE : MAP_SHARED;
    void *address = ::mmap(nullptr, size_, protection, sharing, fd_.get(), 0);
    if (address == MAP_FAILED)
        base::throw_errno("mmap of shared memory");
    return Mapping(static_cast<std::byte *>(address), size_);
}

void SharedMemory::seal_future_writes() const {
    add_seals(fd_, F_SEAL_FUTURE_WRITE | F_SEAL_SEAL);
}

} // namespace arhost::ipc
