// SPDX-License-Identifier: Apache-2.0
//
// Bounding boxes.
#pragma once

#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <array>
#include <limits>
#include <span>

namespace arhost::scene {

struct Box {
    glm::vec3 min{std::numeric_limits<float>::max()}, max{-std::numeric_limits<float>::max()};

    void include(const glm::vec3 &point) {
        for (int i = 0; i < 3; ++i) {
            min[i] = point[i] < min[i] ? point[i] : min[i];
            max[i] = point[i] > max[i] ? point[i] : max[i];
        }
    }
    void include(const Box &box) {
        include(box.min);
        include(box.max);
    }
};

// Keeps twelve independent minima and maxima, over blocks of four points, so the compiler can vectorize the loop.
// With a single running minimum, each iteration would have to wait for the previous one.
inline Box box_of(std::span<const glm::vec3> points) {
    constexpr std::size_t lanes = 12;
    std::array<float, lanes> low, high;
    low.fill(Box{}.min.x);
    high.fill(Box{}.max.x);
    std::size_t i = 0;
    for (; i + 4 <= points.size(); i += 4) {
        const float *values = &points[i].x;
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            low[lane] = values[lane] < low[lane] ? values[lane] : low[lane];
            high[lane] = values[lane] > high[lane] ? values[lane] : high[lane];
        }
    }
    Box box;
    for (std::size_t lane = 0; lane < lanes; lane += 3) {
        box.min = glm::min(box.min, glm::vec3(low[lane], low[lane + 1], low[lane + 2]));
        box.max = glm::max(box.max, glm::vec3(high[lane], high[lane + 1], high[lane + 2]));
    }
    for (; i < points.size(); ++i)
        box.include(points[i]);
    return box;
}

inline Box box_of(std::span<const glm::vec4> spheres) {
    Box box;
    for (const glm::vec4 &sphere : spheres) {
        box.include(glm::vec3(sphere) - sphere.w);
        box.include(glm::vec3(sphere) + sphere.w);
    }
    return box;
}

// Returns the bounding box of the eight transformed corners of `box`. It is exact for the identity; with a rotation,
// it may be larger than the bounding box of the transformed content.
inline Box transformed(const float *world_from_object, const Box &box) {
    const float *m = world_from_object;
    Box world;
    for (int corner = 0; corner < 8; ++corner) {
        const glm::vec3 p(corner & 1 ? box.max.x : box.min.x, corner & 2 ? box.max.y : box.min.y,
                          corner & 4 ? box.max.z : box.min.z);
        world.include(glm::vec3(m[0] * p.x + m[3] * p.y + m[6] * p.z + m[9],
                                m[1] * p.x + m[4] * p.y + m[7] * p.z + m[10],
                                m[2] * p.x + m[5] * p.y + m[8] * p.z + m[11]));
    }
    return world;
}

} // namespace arhost::scene
