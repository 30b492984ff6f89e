// SPDX-License-Identifier: Apache-2.0
#include "surroundings.hpp"

#include <algorithm>
#include <cstring>

namespace rt_embree {
namespace {

// The state begins with this, followed by the rows of texels.
struct Header {
    std::uint32_t version;
    std::int32_t catcher, axes[2];
    float plane_mm, low[2], texel_mm[2], side;
    bool operator==(const Header &) const = default;
};
constexpr std::uint32_t version = 1;
constexpr std::size_t header_size = 64, plane_size = std::size_t{Surroundings::width} * Surroundings::height;
static_assert(sizeof(Header) <= header_size);

} // namespace

std::uint64_t surroundings_state_size() {
    return header_size + Surroundings::row_count * plane_size * sizeof(float);
}

Surroundings surroundings_in(const StateSlots &slots, const EmbreeScene &scene, std::int32_t flat_catcher,
                             const Camera &camera) {
    Surroundings surroundings{};
    Header header{version, flat_catcher, {}, 0, {}, {}, 0};
    if (flat_catcher >= 0) {
        const Box &box = scene.visible_boxes()[static_cast<std::size_t>(flat_catcher)];
        const auto width = [&](int axis) { return box.max[axis] - box.min[axis]; };
        const int normal = width(0) <= std::min(width(1), width(2)) ? 0 : width(1) <= width(2) ? 1 : 2;
        header.plane_mm = static_cast<float>(box.min[normal]);
        header.side = camera.eye[normal] > header.plane_mm ? 1.0f : -1.0f;
        for (int i = 0; i < 2; ++i) {
            const int axis = header.axes[i] = (normal + 1 + i) % 3;
            constexpr double most_mm = 2000; // farther away, texels are of little use
            const double side_mm = std::min<double>(width(axis), most_mm);
            header.low[i] = static_cast<float>((box.min[axis] + box.max[axis] - side_mm) / 2);
            header.texel_mm[i] =
                static_cast<float>(side_mm / (i == 0 ? Surroundings::width : Surroundings::plane_height));
        }
    }
    std::byte *const after = static_cast<std::byte *>(slots.after);
    const std::byte *before = static_cast<const std::byte *>(slots.before);
    Header earlier{};
    if (before)
        std::memcpy(&earlier, before, sizeof earlier);
    if (earlier.version != version)
        before = nullptr;
    surroundings.knows_plane = earlier == header;
    std::memset(after, 0, header_size);
    std::memcpy(after, &header, sizeof header);
    for (std::size_t i = 0; i < Surroundings::row_count; ++i) {
        const std::size_t offset = header_size + i * plane_size * sizeof(float);
        surroundings.before[i] = before ? reinterpret_cast<const float *>(before + offset) : nullptr;
        surroundings.after[i] = reinterpret_cast<float *>(after + offset);
    }
    surroundings.catcher = header.catcher;
    std::ranges::copy(header.axes, surroundings.axes);
    surroundings.plane_mm = header.plane_mm;
    surroundings.side = header.side;
    std::ranges::copy(header.low, surroundings.low);
    std::ranges::copy(header.texel_mm, surroundings.texel_mm);
    return surroundings;
}

} // namespace rt_embree
