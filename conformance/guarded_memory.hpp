// SPDX-License-Identifier: Apache-2.0
//
// Memory between inaccessible pages, so that an access out of bounds crashes.
#pragma once

#include <cstddef>

namespace arhost::conformance {

class GuardedMemory {
public:
    // Ends exactly at a page's end; begins up to a page behind the page before it.
    explicit GuardedMemory(std::size_t size);
    ~GuardedMemory();
    GuardedMemory(const GuardedMemory &) = delete;
    GuardedMemory &operator=(const GuardedMemory &) = delete;
    std::byte *data() const { return data_; }
    void seal();   // makes it read-only
    void unseal(); // makes it writable again

private:
    std::byte *pages_, *data_;
    std::size_t byte_size_; // of all pages
};

} // namespace arhost::conformance
