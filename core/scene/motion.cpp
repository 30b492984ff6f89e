// SPDX-License-Identifier: Apache-2.0
#include "scene/motion.hpp"

#include "scene/arena_limits.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

namespace arhost::scene {
namespace {

constexpr std::size_t spare_floats = 4;
constexpr float min_scale = 1e-6f; // animations hide objects with a scale of 0, which has no inverse

glm::vec3 vector_of(const float *v) {
    return {v[0], v[1], v[2]};
}
glm::quat rotation_of(const float *v) { // x, y, z, w
    return {v[3], v[0], v[1], v[2]};
}

glm::dmat4 matrix_of(const float *m) {
    glm::dmat4 matrix(1);
    for (int column = 0; column < 4; ++column)
        for (int row = 0; row < 3; ++row)
            matrix[column][row] = m[3 * column + row];
    return matrix;
}

glm::dmat4 matrix_of(const glm::vec3 &translation, const glm::quat &rotation, const glm::vec3 &scale) {
    const glm::dmat3 linear = glm::mat3_cast(glm::dquat(rotation));
    glm::dmat4 matrix(1);
    for (int i = 0; i < 3; ++i) {
        const double factor = std::abs(scale[i]) < min_scale ? std::copysign(min_scale, scale[i]) : scale[i];
        matrix[i] = glm::dvec4(linear[i] * factor, 0);
    }
    matrix[3] = glm::dvec4(translation, 1);
    return matrix;
}

// Writes the matrix to `to`. If ray tracers could not use it, because it is nearly singular or because extreme values
// have multiplied along the node hierarchy, writes a matrix that shrinks the object to almost a point.
void write(const glm::dmat4 &matrix, float (&to)[12]) {
    std::array<float, 12> values;
    for (int column = 0; column < 4; ++column)
        for (int row = 0; row < 3; ++row)
            values[3 * column + row] = static_cast<float>(matrix[column][row]);
    const glm::dmat3 linear(matrix);
    const double size = glm::length(linear[0]) * glm::length(linear[1]) * glm::length(linear[2]);
    if (!std::ranges::all_of(values, [](float v) { return std::abs(v) <= coordinate_limit_mm; }) ||
        !(std::abs(glm::determinant(linear)) > 1e-9 * size)) {
        constexpr float tiny = 1e-9f;
        for (std::size_t i = 0; i < 9; ++i)
            values[i] = i % 4 == 0 ? tiny : 0;
        for (std::size_t i = 9; i < 12; ++i)
            if (!(std::abs(values[i]) <= coordinate_limit_mm))
                values[i] = 0;
    }
    std::ranges::copy(values, to);
}

// Clamps to ±coordinate_limit_mm. NaN becomes the limit.
void clamp_coordinates(std::vector<float> &values) {
    constexpr float limit = coordinate_limit_mm;
    for (float &v : values)
        v = v < limit ? (v > -limit ? v : -limit) : limit;
}

// The interval between two keyframes that contains a given time.
struct Interval {
    std::size_t before, after;
    float fraction; // position in the interval, 0 to 1
    float length_s;
};

Interval interval_of(std::span<const float> times, float time_s) {
    const std::size_t after = std::ranges::upper_bound(times, time_s) - times.begin();
    if (after == 0)
        return {0, 0, 0, 0};
    if (after == times.size())
        return {after - 1, after - 1, 0, 0};
    const float length = times[after] - times[after - 1];
    return {after - 1, after, (time_s - times[after - 1]) / length, length};
}

} // namespace

MotionEvaluator::MotionEvaluator(const arhost_scene &scene)
    : scene_(scene), poses_(scene.nodes.count), world_from_node_(scene.nodes.count),
      node_is_visible_(scene.nodes.count) {
    const auto nodes = view<arhost_node>(scene_.nodes);
    for (std::size_t i = 0; i < nodes.size(); ++i)
        poses_[i].morph_weights.resize(nodes[i].morph_weights.count);
    const auto objects = view<arhost_object>(scene_.objects);
    for (std::uint32_t i = 0; i < objects.size(); ++i) {
        if (objects[i].moves) {
            moved_.push_back({i, 1, {}});
            std::ranges::copy(objects[i].world_from_object, moved_.back().world_from_object);
        }
        if (objects[i].deforms) {
            const arhost_geometry &geometry = view<arhost_geometry>(scene_.geometries)[objects[i].geometry];
            const std::size_t floats = std::size_t(3) * geometry.positions.count + spare_floats;
            const bool has_normals = geometry.normals.count > 0;
            const Deformed &buffer = buffers_.emplace_back(
                Deformed{std::vector<float>(floats), std::vector<float>(has_normals ? floats : 0)});
            deformed_.push_back({i, 1, geometry.positions.count, 0, buffer.positions.data(),
                                 has_normals ? buffer.normals.data() : nullptr});
        }
    }
}

arhost_motion MotionEvaluator::at(double time_s, std::span<const Anchored> anchors) {
    evaluate_nodes(std::isfinite(time_s) ? time_s : 0, anchors);
    const auto objects = view<arhost_object>(scene_.objects);
    for (arhost_moved_object &moved : moved_) {
        moved.is_visible = is_visible(objects[moved.object]);
        write(world_from_node_[objects[moved.object].node], moved.world_from_object);
    }
    for (std::size_t i = 0; i < buffers_.size(); ++i) {
        deformed_[i].is_visible = is_visible(objects[deformed_[i].object]);
        deform(objects[deformed_[i].object], buffers_[i]);
    }
    return {sizeof(arhost_motion), static_cast<std::uint32_t>(moved_.size()),    moved_.data(),
            deformed_.data(),      static_cast<std::uint32_t>(deformed_.size()), 0};
}

// A skinned object is visible if its joints are. All of them belong to the same anchor.
bool MotionEvaluator::is_visible(const arhost_object &object) const {
    const std::uint32_t node = object.skin == ARHOST_NONE
                                   ? object.node
                                   : view<std::uint32_t>(view<arhost_skin>(scene_.skins)[object.skin].joints).front();
    return node == ARHOST_NONE || node_is_visible_[node];
}

void MotionEvaluator::evaluate_nodes(double time_s, std::span<const Anchored> anchors) {
    const auto nodes = view<arhost_node>(scene_.nodes);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        Pose &pose = poses_[i];
        pose.translation = vector_of(nodes[i].translation);
        pose.rotation = rotation_of(nodes[i].rotation);
        pose.scale = vector_of(nodes[i].scale);
        std::ranges::copy(view<float>(nodes[i].morph_weights), pose.morph_weights.begin());
    }
    for (const arhost_channel &channel : view<arhost_channel>(scene_.channels))
        apply(channel, time_s);
    const auto anchor_nodes = view<arhost_anchor>(scene_.anchors);
    for (std::size_t i = 0, anchor = 0; i < nodes.size(); ++i) { // parents precede their children
        const Pose &pose = poses_[i];
        const std::uint32_t parent = nodes[i].parent;
        const glm::dmat4 parent_from_node = nodes[i].animated ? matrix_of(pose.translation, pose.rotation, pose.scale)
                                                              : matrix_of(nodes[i].parent_from_node);
        world_from_node_[i] = parent == ARHOST_NONE ? parent_from_node : world_from_node_[parent] * parent_from_node;
        node_is_visible_[i] = parent == ARHOST_NONE || node_is_visible_[parent];
        if (anchor < std::min(anchor_nodes.size(), anchors.size()) &&
            anchor_nodes[anchor].node == i) { // anchors are in the order of nodes
            node_is_visible_[i] = anchors[anchor].is_visible;
            if (anchors[anchor].is_visible)
                world_from_node_[i] = anchors[anchor].world_from_anchor;
            ++anchor;
        }
    }
}

void MotionEvaluator::apply(const arhost_channel &channel, double time_s) {
    Pose &pose = poses_[channel.node];
    if (channel.period_s > 0) {
        time_s = std::fmod(time_s, channel.period_s);
        time_s += time_s < 0 ? channel.period_s : 0;
    }
    const Interval interval = interval_of(view<float>(channel.times), static_cast<float>(time_s));
    const std::size_t width = channel.target == ARHOST_CHANNEL_ROTATION        ? 4
                              : channel.target == ARHOST_CHANNEL_MORPH_WEIGHTS ? pose.morph_weights.size()
                                                                               : 3;
    const bool cubic = channel.interpolation == ARHOST_INTERPOLATION_CUBIC;
    const float t = channel.interpolation == ARHOST_INTERPOLATION_STEP ? 0 : interval.fraction;
    const float *values = view<float>(channel.values).data();
    // A cubic keyframe has an in-tangent, a value and an out-tangent; other keyframes have only a value.
    const auto part = [&](std::size_t key, std::size_t which) {
        return values + (cubic ? key * 3 + which : key) * width;
    };
    const float *a = part(interval.before, 1), *b = part(interval.after, 1);
    const float *out_tangent = part(interval.before, 2), *in_tangent = part(interval.after, 0);
    const auto interpolated = [&](std::size_t i) {
        if (!cubic || t == 0)
            return a[i] + (b[i] - a[i]) * t;
        const float t2 = t * t, t3 = t2 * t; // glTF 2.0, appendix C.5
        return (2 * t3 - 3 * t2 + 1) * a[i] + interval.length_s * (t3 - 2 * t2 + t) * out_tangent[i] +
               (3 * t2 - 2 * t3) * b[i] + interval.length_s * (t3 - t2) * in_tangent[i];
    };
    switch (channel.target) {
    case ARHOST_CHANNEL_TRANSLATION:
        pose.translation = {interpolated(0), interpolated(1), interpolated(2)};
        break;
    case ARHOST_CHANNEL_SCALE:
        pose.scale = {interpolated(0), interpolated(1), interpolated(2)};
        break;
    case ARHOST_CHANNEL_ROTATION:
        if (cubic) {
            const glm::quat sum(interpolated(3), interpolated(0), interpolated(1), interpolated(2));
            const float length = glm::length(sum);
            pose.rotation = length > 1e-6f && std::isfinite(length) ? sum / length : rotation_of(a);
        } else {
            pose.rotation = glm::normalize(glm::slerp(rotation_of(a), rotation_of(b), t)); // shortest path
        }
        break;
    default:
        for (std::size_t i = 0; i < width; ++i)
            pose.morph_weights[i] = interpolated(i);
    }
}

void MotionEvaluator::deform(const arhost_object &object, Deformed &into) const {
    const arhost_geometry &geometry = view<arhost_geometry>(scene_.geometries)[object.geometry];
    const auto morph = [&](const arhost_buffer &base, const arhost_buffer &targets, std::vector<float> &sums) {
        const std::size_t count = std::size_t(3) * base.count;
        if (count == 0)
            return;
        std::memcpy(sums.data(), view<float>(base).data(), count * sizeof(float));
        if (targets.count == 0)
            return;
        const float *displacements = view<float>(targets).data();
        for (const float weight : poses_[object.node].morph_weights) {
            if (weight != 0)
                for (std::size_t i = 0; i < count; ++i)
                    sums[i] += weight * displacements[i];
            displacements += count;
        }
    };
    morph(geometry.positions, geometry.morph_positions, into.positions);
    morph(geometry.normals, geometry.morph_normals, into.normals);
    if (object.skin != ARHOST_NONE)
        skin(geometry, view<arhost_skin>(scene_.skins)[object.skin], into);
    else
        for (std::size_t i = 0; i + spare_floats < into.normals.size(); i += 3) {
            const glm::vec3 normal = vector_of(&into.normals[i]);
            const float length = glm::length(normal);
            for (int k = 0; k < 3; ++k)
                into.normals[i + k] = length > 0 && std::isfinite(length) ? normal[k] / length : k == 2;
        }
    clamp_coordinates(into.positions);
}

// Linear blend skinning (glTF 2.0, 3.7.3.3). Normals are transformed by the cofactor matrix of the blended matrix. It
// equals the inverse transpose except for the factor 1/determinant, which normalization removes.
void MotionEvaluator::skin(const arhost_geometry &geometry, const arhost_skin &skin, Deformed &into) const {
    using Matrix = std::array<float, 12>;
    const auto joints = view<std::uint32_t>(skin.joints);
    const auto node_from_mesh = view<Matrix>(skin.node_from_mesh);
    std::vector<Matrix> world_from_mesh(joints.size());
    for (std::size_t i = 0; i < joints.size(); ++i) {
        const glm::dmat4 matrix = world_from_node_[joints[i]] * matrix_of(node_from_mesh[i].data());
        for (int k = 0; k < 12; ++k)
            world_from_mesh[i][k] = static_cast<float>(matrix[k / 3][k % 3]);
    }
    const auto vertex_joints = view<glm::u16vec4>(geometry.joints);
    const auto vertex_weights = view<glm::vec4>(geometry.weights);
    const std::size_t vertices = geometry.positions.count;
    for (std::size_t v = 0; v < vertices; ++v) {
        Matrix m{};
        for (std::size_t set = v; set < vertex_joints.size(); set += vertices)
            for (int j = 0; j < 4; ++j) {
                const float weight = vertex_weights[set][j];
                if (weight == 0)
                    continue;
                const Matrix &joint = world_from_mesh[vertex_joints[set][j]];
                for (int k = 0; k < 12; ++k)
                    m[k] += weight * joint[k];
            }
        float *p = &into.positions[3 * v];
        const glm::vec3 x(m[0], m[1], m[2]), y(m[3], m[4], m[5]), z(m[6], m[7], m[8]);
        const glm::vec3 world = x * p[0] + y * p[1] + z * p[2] + glm::vec3(m[9], m[10], m[11]);
        for (int k = 0; k < 3; ++k)
            p[k] = world[k];
        if (into.normals.empty())
            continue;
        float *n = &into.normals[3 * v];
        const glm::vec3 yz = glm::cross(y, z);
        const glm::vec3 normal = yz * n[0] + glm::cross(z, x) * n[1] + glm::cross(x, y) * n[2];
        // A mirroring matrix must not move the normal to the other side of the surface.
        const float length = std::copysign(glm::length(normal), glm::dot(x, yz));
        const bool usable = length != 0 && std::isfinite(length);
        for (int k = 0; k < 3; ++k)
            n[k] = usable ? normal[k] / length : k == 2;
    }
}

} // namespace arhost::scene
