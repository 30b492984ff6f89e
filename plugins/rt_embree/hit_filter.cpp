// SPDX-License-Identifier: Apache-2.0
#include "hit_filter.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace rt_embree {
namespace {

std::int32_t wrapped(std::int32_t i, std::int32_t size, arhost_wrap wrap) {
    if (wrap == ARHOST_WRAP_CLAMP)
        return std::clamp(i, 0, size - 1);
    const std::int32_t period = wrap == ARHOST_WRAP_MIRROR ? 2 * size : size;
    const std::int32_t within = (i % period + period) % period;
    return within < size ? within : period - 1 - within;
}

float alpha_of_texel(const Texture &texture, std::int32_t x, std::int32_t y) {
    const std::size_t at = 4 * (std::size_t(y) * std::size_t(texture.width) + std::size_t(x)) + 3;
    return texture.format == ARHOST_TEXEL_RGBA32F
               ? static_cast<const float *>(texture.texels)[at]
               : static_cast<float>(static_cast<const std::uint8_t *>(texture.texels)[at]) / 255;
}

// Converts a texture coordinate to texels. First reduces it to an equivalent coordinate near 0, so that the texel
// index fits an int.
float in_texels(float t, std::int32_t size, arhost_wrap wrap) {
    const float reduced = wrap == ARHOST_WRAP_CLAMP ? std::clamp(t, -1.0f, 2.0f) : t - 2 * std::floor(t / 2);
    return reduced * static_cast<float>(size) - 0.5f;
}

// Samples the texture's alpha with bilinear filtering, like sample_texture() in raytracer_common/packets/texture.inl.
float sampled_alpha(const Texture &texture, float u, float v) {
    const float x = in_texels(u, texture.width, texture.wrap_u), y = in_texels(v, texture.height, texture.wrap_v);
    if (texture.is_nearest)
        return alpha_of_texel(
            texture, wrapped(static_cast<std::int32_t>(std::floor(x + 0.5f)), texture.width, texture.wrap_u),
            wrapped(static_cast<std::int32_t>(std::floor(y + 0.5f)), texture.height, texture.wrap_v));
    const float left = std::floor(x), top = std::floor(y);
    const auto at = [&](int right, int low) {
        return alpha_of_texel(texture,
                              wrapped(static_cast<std::int32_t>(left) + right, texture.width, texture.wrap_u),
                              wrapped(static_cast<std::int32_t>(top) + low, texture.height, texture.wrap_v));
    };
    return std::lerp(std::lerp(at(0, 0), at(1, 0), x - left), std::lerp(at(0, 1), at(1, 1), x - left), y - top);
}

float opacity_at(const HitFilter &filter, unsigned triangle, float u, float v) {
    const int *corners = filter.indices + std::size_t{triangle} * (filter.index_stride / 4);
    const float weight[3] = {1 - u - v, u, v};
    float opacity = filter.opacity;
    if (filter.colours) {
        float mean = 0;
        for (int i = 0; i < 3; ++i) {
            const std::size_t at = std::size_t(corners[i]) * (filter.colour_stride / 2) + 3;
            mean += weight[i] * static_cast<float>(filter.colours[at]);
        }
        opacity *= mean * (1.0f / 65535);
    }
    if (!filter.colour)
        return opacity;
    float s = 0, t = 0;
    for (int i = 0; i < 3; ++i) {
        const float *at = filter.texcoords + std::size_t(corners[i]) * (filter.texcoord_stride / 4);
        s += weight[i] * at[0];
        t += weight[i] * at[1];
    }
    const float *m = filter.colour->image_from_texcoord;
    return opacity * sampled_alpha(*filter.colour, m[0] * s + m[2] * t + m[4], m[1] * s + m[3] * t + m[5]);
}

// Returns a number from 0 to 1 that depends on a ray, a triangle and the frame only.
float random_of(const RTCFilterFunctionNArguments &arguments, unsigned i) {
    const unsigned count = arguments.N;
    std::uint32_t hash = query_of(arguments).random_seed;
    for (const std::uint32_t bits : {std::bit_cast<std::uint32_t>(RTCRayN_org_x(arguments.ray, count, i)),
                                     std::bit_cast<std::uint32_t>(RTCRayN_org_y(arguments.ray, count, i)),
                                     std::bit_cast<std::uint32_t>(RTCRayN_org_z(arguments.ray, count, i)),
                                     std::bit_cast<std::uint32_t>(RTCRayN_dir_x(arguments.ray, count, i)),
                                     std::bit_cast<std::uint32_t>(RTCRayN_dir_y(arguments.ray, count, i)),
                                     std::bit_cast<std::uint32_t>(RTCRayN_dir_z(arguments.ray, count, i)),
                                     RTCHitN_primID(arguments.hit, count, i)}) { // MurmurHash3's finalizer
        hash = (hash ^ bits) * 0x85ebca6bu;
        hash = (hash ^ hash >> 13) * 0xc2b2ae35u;
        hash ^= hash >> 16;
    }
    return static_cast<float>(hash >> 8) * 0x1p-24f;
}

bool is_back_face(const RTCFilterFunctionNArguments &arguments, unsigned i) {
    const unsigned count = arguments.N;
    return RTCHitN_Ng_x(arguments.hit, count, i) * RTCRayN_dir_x(arguments.ray, count, i) +
               RTCHitN_Ng_y(arguments.hit, count, i) * RTCRayN_dir_y(arguments.ray, count, i) +
               RTCHitN_Ng_z(arguments.hit, count, i) * RTCRayN_dir_z(arguments.ray, count, i) >=
           0;
}

bool is_rejected(const HitFilter &filter, const RTCFilterFunctionNArguments &arguments, unsigned i) {
    const unsigned count = arguments.N;
    const bool of_eye = (RTCRayN_flags(arguments.ray, count, i) & ray_of_eye) != 0;
    const bool culls =
        (filter.is_catcher && query_of(arguments).cull_catcher_back_faces) || (filter.hides_back_faces && of_eye);
    if (culls && is_back_face(arguments, i))
        return true;
    if (!filter.tests_opacity())
        return false;
    const float opacity = opacity_at(filter, RTCHitN_primID(arguments.hit, count, i),
                                     RTCHitN_u(arguments.hit, count, i), RTCHitN_v(arguments.hit, count, i));
    if (opacity < filter.alpha_cutoff)
        return true;
    return filter.blends && opacity < (of_eye ? least_opacity : random_of(arguments, i));
}

void on_hit(const RTCFilterFunctionNArguments *arguments) {
    const auto &filter = *static_cast<const HitFilter *>(arguments->geometryUserPtr);
    for (unsigned i = 0; i < arguments->N; ++i)
        if (arguments->valid[i] && is_rejected(filter, *arguments, i))
            arguments->valid[i] = 0;
}

} // namespace

HitFilter hit_filter_of(const Object &object, bool hides_back_faces, const Texture *textures) {
    HitFilter filter;
    filter.is_catcher = object.role == ARHOST_ROLE_CATCHER;
    filter.hides_back_faces = hides_back_faces;
    const arhost_material &material = *object.material;
    if (material.model == ARHOST_MATERIAL_MIRROR || material.model == ARHOST_MATERIAL_GLASS || !object.indices)
        return filter;
    filter.blends = object.blends;
    filter.alpha_cutoff = material.blends && !object.blends ? 0.5f : material.alpha_cutoff;
    if (!filter.tests_opacity())
        return filter;
    filter.opacity = material.opacity;
    filter.indices = object.indices;
    filter.index_stride = object.index_stride;
    filter.colours = reinterpret_cast<const std::uint16_t *>(object.colours);
    filter.colour_stride = object.colour_stride;
    if (material.colour_texture != ARHOST_NONE && object.texcoords) {
        filter.colour = &textures[material.colour_texture];
        filter.texcoord_stride = object.texcoord_stride;
        filter.texcoords = object.texcoords + std::size_t{filter.colour->texcoord_set} * object.vertex_count *
                                                  (object.texcoord_stride / 4);
    }
    return filter;
}

void set_hit_filter(RTCGeometry geometry, const HitFilter &filter) {
    rtcSetGeometryUserData(geometry, const_cast<HitFilter *>(&filter));
    rtcSetGeometryIntersectFilterFunction(geometry, on_hit);
    if (filter.tests_opacity())
        rtcSetGeometryOccludedFilterFunction(geometry, on_hit);
}

} // namespace rt_embree
