// SPDX-License-Identifier: Apache-2.0
#include "hit_filter.hpp"

#include <algorithm>
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
    const float left = std::floor(x), top = std::floor(y);
    const auto at = [&](int right, int low) {
        return alpha_of_texel(texture,
                              wrapped(static_cast<std::int32_t>(left) + right, texture.width, texture.wrap_u),
                              wrapped(static_cast<std::int32_t>(top) + low, texture.height, texture.wrap_v));
    };
    return std::lerp(std::lerp(at(0, 0), at(1, 0), x - left), std::lerp(at(0, 1), at(1, 1), x - left), y - top);
}

bool is_cut_out(const HitFilter &filter, unsigned triangle, float u, float v) {
    const int *corners = filter.indices + std::size_t{triangle} * (filter.index_stride / 4);
    const float weight[3] = {1 - u - v, u, v};
    float s = 0, t = 0;
    for (int i = 0; i < 3; ++i) {
        const float *at = filter.texcoords + std::size_t(corners[i]) * (filter.texcoord_stride / 4);
        s += weight[i] * at[0];
        t += weight[i] * at[1];
    }
    return sampled_alpha(*filter.colour, s, t) < filter.alpha_cutoff;
}

void reject_cut_out(const HitFilter &filter, const RTCFilterFunctionNArguments *arguments) {
    const unsigned count = arguments->N;
    for (unsigned i = 0; i < count; ++i)
        if (arguments->valid[i] &&
            is_cut_out(filter, RTCHitN_primID(arguments->hit, count, i), RTCHitN_u(arguments->hit, count, i),
                       RTCHitN_v(arguments->hit, count, i)))
            arguments->valid[i] = 0;
}

void reject_back_faces(const RTCFilterFunctionNArguments *arguments) {
    const unsigned count = arguments->N;
    for (unsigned i = 0; i < count; ++i) {
        const float along = RTCHitN_Ng_x(arguments->hit, count, i) * RTCRayN_dir_x(arguments->ray, count, i) +
                            RTCHitN_Ng_y(arguments->hit, count, i) * RTCRayN_dir_y(arguments->ray, count, i) +
                            RTCHitN_Ng_z(arguments->hit, count, i) * RTCRayN_dir_z(arguments->ray, count, i);
        if (along >= 0)
            arguments->valid[i] = 0;
    }
}

void on_hit(const RTCFilterFunctionNArguments *arguments) {
    const auto &filter = *static_cast<const HitFilter *>(arguments->geometryUserPtr);
    if (filter.is_catcher && query_of(*arguments).cull_catcher_back_faces)
        reject_back_faces(arguments);
    if (filter.alpha_cutoff > 0)
        reject_cut_out(filter, arguments);
}

} // namespace

HitFilter hit_filter_of(const Object &object, const Texture *textures) {
    HitFilter filter;
    filter.is_catcher = object.role == ARHOST_ROLE_CATCHER;
    const arhost_material &material = *object.material;
    const bool has_colour = material.model != ARHOST_MATERIAL_MIRROR && material.model != ARHOST_MATERIAL_GLASS;
    if (has_colour && material.alpha_cutoff > 0 && material.colour_texture != ARHOST_NONE && object.texcoords) {
        filter.alpha_cutoff = material.alpha_cutoff;
        filter.colour = &textures[material.colour_texture];
        filter.indices = object.indices;
        filter.texcoords = object.texcoords;
        filter.index_stride = object.index_stride;
        filter.texcoord_stride = object.texcoord_stride;
    }
    return filter;
}

void set_hit_filter(RTCGeometry geometry, const HitFilter &filter) {
    rtcSetGeometryUserData(geometry, const_cast<HitFilter *>(&filter));
    rtcSetGeometryIntersectFilterFunction(geometry, on_hit);
    if (filter.alpha_cutoff > 0)
        rtcSetGeometryOccludedFilterFunction(geometry, on_hit);
}

} // namespace rt_embree
