// SPDX-License-Identifier: Apache-2.0
//
// Points and vectors on the desk. The unit is 1/80 of the marker's side: mm for a marker of 80 mm.
#pragma once

#include <arhost/shading/vec3.hpp>

#include <algorithm>
#include <cmath>

namespace arhost::synthetic {

using Vec3 = shading::Vec3T<float>;

struct Point {
    float x, y;
    friend Point operator+(Point a, Point b) { return {a.x + b.x, a.y + b.y}; }
    friend Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y}; }
    friend Point operator*(Point a, float s) { return {a.x * s, a.y * s}; }
    friend float dot(Point a, Point b) { return a.x * b.x + a.y * b.y; }
};

inline float mix(float a, float b, float weight) {
    return a + (b - a) * weight;
}
// Returns 0 at `from`, 1 at `to`, and smooth values in between. `from` may be larger than `to`.
inline float smoothstep(float from, float to, float x) {
    const float t = std::clamp((x - from) / (to - from), 0.0f, 1.0f);
    return t * t * (3 - 2 * t);
}

} // namespace arhost::synthetic
