// SPDX-License-Identifier: Apache-2.0
#include "view/bounds.hpp"

#include "scene/motion.hpp"

#include <algorithm>
#include <vector>

namespace arhost::view {
namespace {

using scene::Box;

Box box_of(const arhost_scene &scene, const arhost_geometry &geometry) {
    return geometry.type == ARHOST_GEOMETRY_SPHERES ? scene::box_of(elements<glm::vec4>(scene, geometry.positions))
                                                    : scene::box_of(elements<glm::vec3>(scene, geometry.positions));
}

// The boxes of the objects in their own coordinates, and what the scene has of motion.
class Sampler {
public:
    explicit Sampler(const arhost_scene &scene)
        : scene_(scene), objects_(elements<arhost_object>(scene, scene.objects)), evaluator_(scene) {
        const auto geometries = elements<arhost_geometry>(scene, scene.geometries);
        boxes_.reserve(geometries.size());
        for (const arhost_geometry &geometry : geometries)
            boxes_.push_back(box_of(scene, geometry));
    }

    Box at(double time_s) {
        Box box;
        for (const arhost_object &object : objects_)
            if (!object.moves && !object.deforms)
                include(box, object, object.world_from_object, boxes_[object.geometry]);
        const arhost_motion motion = evaluator_.at(time_s);
        for (const arhost_moved_object &moved : std::span(motion.moved, motion.moved_count))
            include(box, objects_[moved.object], moved.world_from_object, boxes_[objects_[moved.object].geometry]);
        for (const arhost_deformed_geometry &each : std::span(motion.deformed, motion.deformed_count)) {
            const arhost_object &object = objects_[each.object];
            const auto *positions = reinterpret_cast<const glm::vec3 *>(each.positions);
            include(box, object, object.world_from_object, scene::box_of(std::span(positions, each.vertex_count)));
        }
        return box;
    }

private:
    static void include(Box &box, const arhost_object &object, const float *world_from_object, const Box &own) {
        if (object.role == ARHOST_ROLE_VIRTUAL)
            box.include(scene::transformed(world_from_object, own));
    }

    const arhost_scene &scene_;
    std::span<const arhost_object> objects_;
    scene::MotionEvaluator evaluator_;
    std::vector<Box> boxes_; // of the geometries
};

} // namespace

Box box_at_start(const arhost_scene &scene) {
    return Sampler(scene).at(0);
}

Box box_over_animation(const arhost_scene &scene) {
    constexpr double step_s = 1.0 / 30;
    constexpr int most_steps = 300;
    Sampler sampler(scene);
    Box box = sampler.at(0);
    if (!(scene.duration_s > 0))
        return box;
    const int steps = std::clamp(static_cast<int>(scene.duration_s / step_s), 8, most_steps);
    for (int i = 1; i < steps; ++i)
        box.include(sampler.at(scene.duration_s * i / steps));
    box.include(sampler.at(scene.duration_s * (1 - 1e-6))); // at the end itself, animations begin again
    return box;
}

} // namespace arhost::view
