// SPDX-License-Identifier: Apache-2.0
//
// Evaluates the motion of a scene at a given time. The result has the form in which arhost/motion.h passes it to ray
// tracers.
#pragma once

#include <arhost/motion.h>
#include <arhost/scene.h>

#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace arhost::scene {

// Whether objects may move or deform. Ray tracers then get an arhost_motion.
inline bool is_moving(const arhost_scene &scene) {
    return scene.duration_s > 0 || scene.anchors.count > 0;
}

// Visibility and pose of an anchor in a frame.
struct Anchored {
    bool is_visible = false;
    glm::dmat4 world_from_anchor{1}; // not used if it is not visible
};

// The scene must be valid (`validate`) and outlive the evaluator. Not thread-safe.
class MotionEvaluator {
public:
    explicit MotionEvaluator(const arhost_scene &scene);

    // Returns the motion at `time_s`. Before 0 s, animations that play once show their first values. `anchors`: one
    // element for each anchor of the scene. If it is empty, the anchors are at the origin of the world. The result is
    // valid until the next call.
    arhost_motion at(double time_s, std::span<const Anchored> anchors = {});

private:
    struct Pose {
        glm::vec3 translation{0};
        glm::quat rotation{1, 0, 0, 0};
        glm::vec3 scale{1};
        std::vector<float> morph_weights;
    };
    struct Deformed {
        std::vector<float> positions,
            normals; // three floats per vertex, followed by the spare floats of arhost/motion.h
    };

    template <class T> std::span<const T> view(const arhost_buffer &buffer) const {
        return {reinterpret_cast<const T *>(reinterpret_cast<const std::byte *>(&scene_) + buffer.offset),
                buffer.count};
    }
    void evaluate_nodes(double time_s, std::span<const Anchored> anchors);
    bool is_visible(const arhost_object &object) const;
    void apply(const arhost_channel &channel, double time_s);
    void deform(const arhost_object &object, Deformed &into) const;
    void skin(const arhost_geometry &geometry, const arhost_skin &skin, Deformed &into) const;

    const arhost_scene &scene_;
    std::vector<Pose> poses_; // local pose of each node
    std::vector<glm::dmat4> world_from_node_;
    std::vector<bool> node_is_visible_;
    std::vector<arhost_moved_object> moved_;
    std::vector<Deformed> buffers_;
    std::vector<arhost_deformed_geometry> deformed_;
};

} // namespace arhost::scene
