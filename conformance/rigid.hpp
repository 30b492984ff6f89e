// SPDX-License-Identifier: Apache-2.0
// Checks a matrix of a pose.
#pragma once

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <cmath>
#include <string>

namespace arhost::conformance {

// Returns why a column-major 4×4 matrix is not a rigid transform, as a predicate ("is not finite"); empty if it is.
inline std::string not_rigid(const double *m, double tolerance) {
    if (!std::all_of(m, m + 16, [](double value) { return std::isfinite(value); }))
        return "is not finite";
    if (m[3] != 0 || m[7] != 0 || m[11] != 0 || m[15] != 1)
        return fmt::format("has the last row ({}, {}, {}, {}); expected (0, 0, 0, 1)", m[3], m[7], m[11], m[15]);
    const glm::dvec3 axis[] = {{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j <= i; ++j)
            if (const double off = glm::dot(axis[i], axis[j]) - (i == j ? 1 : 0); !(std::abs(off) <= tolerance))
                return fmt::format("has a rotation that deviates from orthonormality by {:.3g}; the limit is {}",
                                   std::abs(off), tolerance);
    if (glm::dot(glm::cross(axis[0], axis[1]), axis[2]) < 0)
        return "mirrors: its determinant is −1";
    return "";
}

} // namespace arhost::conformance
