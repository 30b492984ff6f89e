// SPDX-License-Identifier: Apache-2.0
//
// Memory between inaccessible pages, so that out-of-bounds accesses crash.
#pragma once

#include <cstddef>

namespace arhost::conformance {

class GuardedMemory {
public:
    // The end is exact: the byte after it is inaccessible. Up to a page before the start may be accessible.
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
