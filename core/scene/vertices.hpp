// SPDX-License-Identifier: Apache-2.0
//
// Helpers for the vertices of meshes. Private to core/scene.
#pragma once

#include <arhost/scene.h>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace arhost::scene {

// Returns, for each vertex, the index of the first vertex with an equal key. key_of(vertex) returns the key, an array
// of floats, in which −0 equals 0. Uses a hash table with open addressing.
template <class KeyOf> std::vector<std::uint32_t> first_equal_vertices(std::size_t count, const KeyOf &key_of) {
    std::vector<std::uint32_t> table(std::bit_ceil(count * 2), ARHOST_NONE), first(count);
    for (std::uint32_t i = 0; i < count; ++i) {
        const auto key = key_of(i);
        std::uint64_t hash = 0;
        for (const float number : key)
            hash = (hash ^ std::bit_cast<std::uint32_t>(number + 0.f)) * 0x9e3779b97f4a7c15u; // −0 becomes 0
        hash ^= hash >> 32;
        std::size_t slot = hash & (table.size() - 1);
        while (table[slot] != ARHOST_NONE && key_of(table[slot]) != key)
            slot = (slot + 1) & (table.size() - 1);
        if (table[slot] == ARHOST_NONE)
            table[slot] = i;
        first[i] = table[slot];
    }
    return first;
}

// Returns the unit vector along `a`; 0 if there is none. In double precision, because squared lengths in tiny meshes
// underflow in floats.
inline glm::dvec3 unit_or_0(const glm::dvec3 &a) {
    const double length = glm::length(a);
    return length > 0 && std::isfinite(length) ? a / length : glm::dvec3(0);
}

} // namespace arhost::scene
