// SPDX-License-Identifier: Apache-2.0
#include "host/world.hpp"

#include "host/frame.hpp"

#include <glm/gtc/matrix_inverse.hpp>
#include <glm/gtc/type_ptr.hpp>

#include <algorithm>

namespace arhost::host {
namespace {

// Returns a product of two rigid transforms. Its rotation is orthonormal in spite of rounding errors.
glm::dmat4 product(const glm::dmat4 &a, const glm::dmat4 &b) {
    glm::dmat4 m = a * b;
    const glm::dvec3 x = glm::normalize(glm::dvec3(m[0]));
    const glm::dvec3 z = glm::normalize(glm::cross(x, glm::dvec3(m[1])));
    m[0] = glm::dvec4(x, 0);
    m[1] = glm::dvec4(glm::cross(z, x), 0);
    m[2] = glm::dvec4(z, 0);
    return m;
}

} // namespace

std::optional<std::array<double, 16>> World::locate(const std::string &first, std::span<const arhost_target> targets,
                                                    std::uint64_t frame, std::uint64_t grace_frames) {
    std::array<double, 16> world;
    if (const auto own = std::ranges::find_if(
            targets, [&](const auto &target) { return is_visible(target) && target.name == first; });
        own != targets.end()) {
        substitute_.clear();
        for (const arhost_target &target : targets)
            if (&target != &*own && target.state == ARHOST_TARGET_DETECTED && own->state == ARHOST_TARGET_DETECTED)
                relations_[target.name] = {
                    product(glm::affineInverse(glm::make_mat4(target.mt)), glm::make_mat4(own->mt)), frame};
        std::ranges::copy(own->mt, world.begin());
        return world;
    }
    const auto is_known = [&](const arhost_target &target) {
        const auto relation = relations_.find(target.name);
        return is_visible(target) && relation != relations_.end() && frame - relation->second.frame <= grace_frames;
    };
    auto other = std::ranges::find_if(
        targets, [&](const auto &target) { return is_known(target) && target.name == substitute_; });
    if (other == targets.end())
        other = std::ranges::find_if(targets, is_known);
    if (other == targets.end())
        return {};
    substitute_ = other->name;
    const glm::dmat4 mt = product(glm::make_mat4(other->mt), relations_.at(substitute_).target_from_world);
    std::copy_n(glm::value_ptr(mt), 16, world.begin());
    return world;
}

} // namespace arhost::host
