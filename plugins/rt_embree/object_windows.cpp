// SPDX-License-Identifier: Apache-2.0
#include "object_windows.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace rt_embree {
namespace {

using arhost::raytracer_common::Pose;
using Vec3d = arhost::shading::Vec3T<double>;

// Returns the bounding rectangle of a box projected onto the plane z = 1; empty if the whole box is behind the
// camera.
Window window_of(const Box &box, const Pose &pose) {
    const double infinity = std::numeric_limits<double>::infinity();
    Window window{infinity, infinity, -infinity, -infinity, false};
    int behind = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3d p = Vec3d{corner & 1 ? box.max[0] : box.min[0], corner & 2 ? box.max[1] : box.min[1],
                              corner & 4 ? box.max[2] : box.min[2]} -
                        pose.eye;
        const double z = dot(p, pose.forward);
        if (!(z > 1e-6 * (std::abs(dot(p, pose.right)) + std::abs(dot(p, pose.down))))) {
            ++behind;
            continue;
        }
        const double x = dot(p, pose.right) / z, y = dot(p, pose.down) / z;
        // The margin exceeds the error of single-precision ray directions and origins.
        const double margin = 1e-5 * (1 + std::abs(x) + std::abs(y)) + 1e-6 * length(pose.eye) / z;
        window.x0 = std::min(window.x0, x - margin);
        window.y0 = std::min(window.y0, y - margin);
        window.x1 = std::max(window.x1, x + margin);
        window.y1 = std::max(window.y1, y + margin);
    }
    window.unbounded = behind > 0 && behind < 8;
    return window;
}

bool is_flat(const Box &box) {
    double thinnest = std::numeric_limits<double>::infinity(), widest = 0;
    for (int i = 0; i < 3; ++i) {
        thinnest = std::min(thinnest, box.max[i] - box.min[i]);
        widest = std::max(widest, box.max[i] - box.min[i]);
    }
    return thinnest >= 0 && thinnest <= 1e-6 * widest;
}

double width_of(const Box &box) {
    double squared = 0;
    for (int i = 0; i < 3; ++i)
        squared += (box.max[i] - box.min[i]) * (box.max[i] - box.min[i]);
    return std::sqrt(squared);
}

void select(const std::vector<Window> &from, const Window &tile, Windows &to) {
    for (const Window &window : from) {
        if (to.count < 0 || !window.intersects(tile))
            continue;
        if (window.unbounded) {
            to.count = -1;
            continue;
        }
        // Single precision may not make a window smaller.
        const auto below = [](double a) { return std::nextafter(static_cast<float>(a), -1e30f); };
        const auto above = [](double a) { return std::nextafter(static_cast<float>(a), 1e30f); };
        const std::array<float, 4> bounds{below(window.x0), below(window.y0), above(window.x1), above(window.y1)};
        if (to.count < Windows::most) {
            std::ranges::copy(bounds, to.bounds[to.count++]);
            continue;
        }
        float *last = to.bounds[Windows::most - 1];
        for (std::size_t i = 0; i < 4; ++i)
            last[i] = i < 2 ? std::min(last[i], bounds[i]) : std::max(last[i], bounds[i]);
    }
}

} // namespace

ObjectWindows::ObjectWindows(const EmbreeScene &scene, const Pose &pose, bool has_plane)
    : has_plane_(has_plane), has_occluders_(scene.view().has_occluders) {
    const std::vector<Box> &boxes = scene.visible_boxes();
    const auto role = [&](std::size_t object) { return scene.view().objects[object].role; };
    double widest = 0;
    for (std::size_t i = 0; i < boxes.size(); ++i)
        if (role(i) == ARHOST_ROLE_CATCHER && is_flat(boxes[i]) && width_of(boxes[i]) > widest) {
            widest = width_of(boxes[i]);
            wide_catcher_ = static_cast<std::int32_t>(i);
            wide_ = window_of(boxes[i], pose);
        }
    for (std::size_t i = 0; i < boxes.size(); ++i)
        if (role(i) == ARHOST_ROLE_VIRTUAL)
            virtual_.push_back(window_of(boxes[i], pose));
        else if (role(i) == ARHOST_ROLE_CATCHER && static_cast<std::int32_t>(i) != wide_catcher_)
            catchers_.push_back(window_of(boxes[i], pose));
}

bool ObjectWindows::may_affect(const Window &tile) const {
    const auto meets = [&](const Window &window) { return window.intersects(tile); };
    return (wide_catcher_ >= 0 && meets(wide_)) || std::ranges::any_of(virtual_, meets) ||
           std::ranges::any_of(catchers_, meets);
}

void ObjectWindows::select(const Window &tile, Scratch &scratch) const {
    scratch.windows.count = has_plane_ ? 0 : -1;
    rt_embree::select(virtual_, tile, scratch.windows);
    scratch.virtual_windows = scratch.windows;
    if (has_occluders_)
        scratch.virtual_windows.count = -1;
    rt_embree::select(catchers_, tile, scratch.windows);
}

} // namespace rt_embree
