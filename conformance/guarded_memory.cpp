// SPDX-License-Identifier: Apache-2.0
#include "conformance/guarded_memory.hpp"

#include "base/unique_fd.hpp"

#include <sys/mman.h>
#include <unistd.h>

namespace arhost::conformance {
namespace {

std::size_t page_size() {
    return static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

} // namespace

GuardedMemory::GuardedMemory(std::size_t size) {
    const std::size_t page = page_size();
    byte_size_ = (size + page - 1) / page * page + 2 * page;
    void *address = ::mmap(nullptr, byte_size_, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (address == MAP_FAILED)
        base::throw_errno("mmap");
    pages_ = static_cast<std::byte *>(address);
    data_ = pages_ + byte_size_ - page - size;
    unseal();
}

GuardedMemory::~GuardedMemory() {
    ::munmap(pages_, byte_size_);
}

void GuardedMemory::seal() {
    ::mprotect(pages_ + page_size(), byte_size_ - 2 * page_size(), PROT_READ);
}
void GuardedMemory::unseal() {
    ::mprotect(pages_ + page_size(), byte_size_ - 2 * page_size(), PROT_READ | PROT_WRITE);
}

} // namespace arhost::conformance
