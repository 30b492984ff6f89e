// SPDX-License-Identifier: Apache-2.0
#include "view/ground.hpp"

#include "scene/arena_limits.hpp"
#include "view/bounds.hpp"

#include <algorithm>
#include <cstring>

namespace arhost::view {
namespace {

// Copies a scene into a larger arena and appends buffers.
class Appender {
public:
    Appender(const arhost_scene &scene, std::size_t appended_size)
        : arena_(aligned(scene.byte_size) + appended_size), end_(aligned(scene.byte_size)) {
        std::memset(arena_.bytes().data(), 0, arena_.bytes().size());
        std::memcpy(arena_.bytes().data(), &scene, scene.byte_size);
        header().byte_size = arena_.bytes().size();
    }

    static std::size_t aligned(std::size_t size) {
        return (size + scene::arena_spare_bytes + scene::arena_alignment - 1) / scene::arena_alignment *
               scene::arena_alignment;
    }

    arhost_scene &header() { return *reinterpret_cast<arhost_scene *>(arena_.bytes().data()); }

    template <class T> arhost_buffer append(std::span<const T> values) {
        const arhost_buffer buffer{end_, static_cast<std::uint32_t>(values.size()), sizeof(T)};
        std::memcpy(arena_.bytes().data() + end_, values.data(), values.size_bytes());
        end_ += aligned(values.size_bytes());
        return buffer;
    }
    // Replaces an array by a longer one; returns the index of the new element.
    template <class T> std::uint32_t add(arhost_buffer &table, const T &element) {
        const auto old = elements<T>(header(), table);
        std::vector<T> longer(old.begin(), old.end());
        longer.push_back(element);
        table = append(std::span<const T>(longer));
        return table.count - 1;
    }

    scene::Arena take() { return std::move(arena_); }

private:
    scene::Arena arena_;
    std::size_t end_;
};

} // namespace

scene::Arena with_ground(const arhost_scene &scene, const scene::Box &box) {
    const int up = scene.axes == ARHOST_AXES_Z_UP ? 2 : 1, across = 0, along = 3 - up;
    const glm::vec3 size = box.max - box.min;
    const float largest = std::max({size.x, size.y, size.z, 1e-6f});
    glm::vec3 middle = (box.min + box.max) * 0.5f;
    middle[up] = box.min[up] - 1e-4f * largest; // else it flickers with a flat bottom
    const float half = 8 * largest;
    std::array<glm::vec3, 4> corners;
    for (std::size_t i = 0; i < 4; ++i) { // counter-clockwise, seen from above
        corners[i] = middle;
        corners[i][across] += i == 1 || i == 2 ? half : -half;
        corners[i][along] += (i >= 2) == (up == 2) ? half : -half;
        corners[i] = glm::clamp(corners[i], -scene::coordinate_limit_mm, scene::coordinate_limit_mm);
    }
    constexpr std::array<glm::uvec3, 2> triangles{{{0, 1, 2}, {0, 2, 3}}};
    const std::size_t appended_size = Appender::aligned((scene.geometries.count + 1) * sizeof(arhost_geometry)) +
                                      Appender::aligned((scene.materials.count + 1) * sizeof(arhost_material)) +
                                      Appender::aligned((scene.objects.count + 1) * sizeof(arhost_object)) +
                                      Appender::aligned(sizeof corners) + Appender::aligned(sizeof triangles);
    Appender appender(scene, appended_size);
    arhost_scene &header = appender.header();

    arhost_geometry geometry{};
    geometry.type = ARHOST_GEOMETRY_TRIANGLES;
    geometry.positions = appender.append(std::span<const glm::vec3>(corners));
    geometry.indices = appender.append(std::span<const glm::uvec3>(triangles));
    arhost_material material = scene::make_material(ARHOST_MATERIAL_DIFFUSE);
    std::ranges::fill(material.diffuse, 0.5f);
    arhost_object object{};
    object.geometry = appender.add(header.geometries, geometry);
    object.material = appender.add(header.materials, material);
    object.role = ARHOST_ROLE_CATCHER;
    object.name = header.names.count - 1; // the NUL of the last name: an empty name
    for (int i = 0; i < 3; ++i)
        object.world_from_object[4 * i] = 1;
    object.node = object.skin = ARHOST_NONE;
    appender.add(header.objects, object);
    for (int i = 0; i < 3; ++i) {
        header.bounds_min[i] = std::min({header.bounds_min[i], corners[0][i], corners[2][i]});
        header.bounds_max[i] = std::max({header.bounds_max[i], corners[0][i], corners[2][i]});
    }
    return appender.take();
}

} // namespace arhost::view
