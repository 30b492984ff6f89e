// SPDX-License-Identifier: Apache-2.0
//
// The integrator: from 16 primary rays, a block of 4×4 pixels, to their colours and alphas. Included by
// kernel_<isa>.cpp, which defines ARHOST_ISA.
#include "kernel.hpp"
#include "packet.hpp"

namespace rt_embree::ARHOST_ISA {
namespace {

constexpr int block = 4; // px a side
constexpr float far_away = __builtin_inff();
constexpr int no_hit = static_cast<int>(RTC_INVALID_GEOMETRY_ID);

ARHOST_INLINE Vec3 splat(const float *xyz) {
    return {Float(xyz[0]), Float(xyz[1]), Float(xyz[2])};
}

// A vector that has been taken through a column-major 3×3 matrix.
ARHOST_INLINE Vec3 transform(const float *m, Vec3 a) {
    return splat(m) * a.x + splat(m + 3) * a.y + splat(m + 6) * a.z;
}

ARHOST_INLINE Vec3 normalize(Vec3 a) {
    return a * (Float(1.0f) / sqrt(dot(a, a)));
}

ARHOST_INLINE Float largest(Vec3 a) {
    return max(max(max(a.x, -a.x), max(a.y, -a.y)), max(a.z, -a.z));
}

template <class Ray> ARHOST_INLINE void set_ray(Ray &ray, Vec3 origin, Vec3 direction, Float end, Int mask) {
    store(ray.org_x, origin.x);
    store(ray.org_y, origin.y);
    store(ray.org_z, origin.z);
    store(ray.tnear, Float(0.0f));
    store(ray.dir_x, direction.x);
    store(ray.dir_y, direction.y);
    store(ray.dir_z, direction.z);
    store(ray.time, Float(0.0f));
    store(ray.tfar, end);
    store(ray.mask, mask);
    store(ray.flags, Int(0));
}

// The closest hits of the active lanes. Returns which of them hit.
ARHOST_INLINE Bool trace(const Scene &scene, Query query, RTCRayHit16 &rays, Bool active) {
    alignas(64) int valid[lanes];
    store(valid, active);
    store(rays.hit.geomID, Int(no_hit));
    store(rays.hit.instID[0], Int(no_hit));
    intersect16(valid, scene.root, scene.packet_width, query, rays);
    return active & (load(rays.hit.geomID) != Int(no_hit));
}

ARHOST_INLINE Int object_number(const RTCHit16 &hit) {
    const Int instance = load(hit.instID[0]);
    return select(instance != Int(no_hit), instance, load(hit.geomID));
}

// Calls use(object, lanes) for each object that lanes of `active` have hit: mostly one or two a packet.
template <class Use>
ARHOST_INLINE void for_each_object(const Scene &scene, const RTCHit16 &hit, Bool active, Use use) {
    const Int numbers = object_number(hit);
    alignas(64) int number_of[lanes];
    store(number_of, numbers);
    for (unsigned left = mask_of(active.lane); left;) {
        const int number = number_of[__builtin_ctz(left)];
        const Bool here = active & (numbers == Int(number));
        left &= ~mask_of(here.lane);
        use(scene.objects[number], here);
    }
}

// Where rays have hit, all that shading needs. Both normals have length 1 and face the ray's origin.
struct Surface {
    Vec3 position;
    Vec3 geometric_normal, normal; // of the facet, and interpolated over it
    Float offset;                  // mm; how far above the facet secondary rays start
    Vec3 ambient, diffuse, specular, reflectivity;
    Float exponent;
    Bool is_mirror, is_real; // real: a catcher or occluder
    bool any_specular;
};

// The vertices' normals, interpolated at the hits, in the object's axes.
ARHOST_INLINE Vec3 interpolated_normal(const Object &object, const RTCHit16 &hit, Bool here) {
    // Lanes elsewhere read triangle 0. Strides are multiples of 4 bytes (arhost/scene.h).
    const Int corner = select(here, load(hit.primID), Int(0)) * Int(static_cast<int>(object.index_stride / 4));
    const auto normal = [&](int number) __attribute__((always_inline)) {
        const Int at = gather(object.indices + number, corner) * Int(static_cast<int>(object.normal_stride / 4));
        return Vec3{gather(object.normals, at), gather(object.normals + 1, at), gather(object.normals + 2, at)};
    };
    const Float u = load(hit.u), v = load(hit.v);
    return normal(0) * (Float(1.0f) - u - v) + normal(1) * u + normal(2) * v;
}

ARHOST_INLINE Surface surface_at(const Scene &scene, const RTCRayHit16 &rays, Bool active) {
    const RTCHit16 &hit = rays.hit;
    const Vec3 direction{load(rays.ray.dir_x), load(rays.ray.dir_y), load(rays.ray.dir_z)};
    const Vec3 origin{load(rays.ray.org_x), load(rays.ray.org_y), load(rays.ray.org_z)};
    const Vec3 facet{load(hit.Ng_x), load(hit.Ng_y), load(hit.Ng_z)};
    const Vec3 step = direction * load(rays.ray.tfar);

    Surface s{};
    s.position = origin + step;
    // A hit is as exact as the floats that it was computed from: 2^-24 of their size, a few times.
    s.offset = (largest(s.position) + largest(step)) * Float(0x1p-19f);
    s.geometric_normal = facet;
    s.normal = facet;
    for_each_object(scene, hit, active, [&](const Object &object, Bool here) {
        Vec3 geometric = facet;
        Vec3 normal = object.normals ? interpolated_normal(object, hit, here) : facet;
        if (object.has_transform) {
            geometric = transform(object.normal_transform, geometric);
            normal = transform(object.normal_transform, normal);
        }
        s.geometric_normal = select(here, geometric, s.geometric_normal);
        s.normal = select(here, normal, s.normal);
        const arhost_material &material = object.material;
        s.ambient = select(here, splat(material.ambient), s.ambient);
        s.diffuse = select(here, splat(material.diffuse), s.diffuse);
        if (material.model == ARHOST_SPECULAR) {
            s.specular = select(here, splat(material.specular), s.specular);
            s.exponent = select(here, Float(material.exponent), s.exponent);
            s.any_specular = true;
        }
        if (material.model == ARHOST_MIRROR) {
            s.reflectivity = select(here, splat(material.reflectivity), s.reflectivity);
            s.is_mirror = s.is_mirror | here;
        }
        if (object.role != ARHOST_VIRTUAL)
            s.is_real = s.is_real | here;
    });

    s.geometric_normal = normalize(s.geometric_normal);
    s.geometric_normal =
        select(dot(s.geometric_normal, direction) > Float(0.0f), -s.geometric_normal, s.geometric_normal);
    // Vertex normals that cancel out leave the facet's.
    s.normal = select(dot(s.normal, s.normal) > Float(1e-12f), normalize(s.normal), s.geometric_normal);
    s.normal = select(dot(s.normal, s.geometric_normal) < Float(0.0f), -s.normal, s.normal);
    return s;
}

// A light as one lane's surface point sees it.
struct Incidence {
    Vec3 direction;   // to the light, length 1
    Float cosine;     // 0 where the light is behind the surface
    Float irradiance; // per unit of intensity, at cosine 1
};

ARHOST_INLINE Incidence incidence(const arhost_light &light, const Surface &s) {
    const Vec3 to_light = splat(light.position) - s.position;
    const Float distance_squared = dot(to_light, to_light);
    Incidence in;
    in.direction = to_light * (Float(1.0f) / sqrt(distance_squared));
    in.cosine =
        select(dot(s.geometric_normal, in.direction) > Float(0.0f), lambert(s.normal, in.direction), Float(0.0f));
    in.irradiance = point_light_falloff(bool_of(light.falloff == ARHOST_FALLOFF_INVERSE_SQUARE), distance_squared);
    return in;
}

// Which of the lanes see the light. Real surfaces cast no shadow on each other: that one is in the video.
ARHOST_INLINE Bool unshadowed(const Scene &scene, const arhost_light &light, const Surface &s, Bool active) {
    RTCRay16 rays;
    const Vec3 origin = s.position + s.geometric_normal * s.offset;
    const Int hidden_by = select(s.is_real, Int(virtual_mask), Int(all_masks));
    set_ray(rays, origin, splat(light.position) - origin, Float(1.0f), hidden_by);
    alignas(64) int valid[lanes];
    store(valid, active);
    // Embree 3.13.5 hangs in coherent occlusion queries through instances with AVX-512.
    Query query = make_query(scene.has_instances ? Coherence::incoherent : Coherence::coherent);
    occluded16(valid, scene.root, scene.packet_width, query, rays);
    return active & (load(rays.tfar) >= Float(0.0f)); // −∞ where something was hit
}

// Light that surfaces other than mirrors send back along the rays.
ARHOST_INLINE Vec3 direct_light(const Scene &scene, const Surface &s, Vec3 to_eye, Bool active) {
    Vec3 sum = s.ambient * splat(scene.ambient);
    for (std::uint32_t i = 0; i < scene.light_count; ++i) {
        const arhost_light &light = scene.lights[i];
        const Incidence in = incidence(light, s);
        Bool lit = active & (in.cosine > Float(0.0f));
        if (!any(lit))
            continue;
        lit = unshadowed(scene, light, s, lit);
        if (!any(lit))
            continue;
        Vec3 reflected = s.diffuse * in.cosine;
        if (s.any_specular)
            reflected = reflected + s.specular * phong(s.normal, in.direction, to_eye, s.exponent);
        sum = sum + reflected * splat(light.intensity) * select(lit, in.irradiance, Float(0.0f));
    }
    return sum;
}

// The colour of the virtual objects that primary rays have hit, mirrors followed.
ARHOST_INLINE Vec3 radiance(const Scene &scene, RTCRayHit16 &rays, Bool active) {
    const Vec3 black{Float(0.0f), Float(0.0f), Float(0.0f)};
    Vec3 sum = black, throughput{Float(1.0f), Float(1.0f), Float(1.0f)};
    for (std::uint32_t depth = 0;; ++depth) {
        const Surface s = surface_at(scene, rays, active);
        const Vec3 direction = normalize({load(rays.ray.dir_x), load(rays.ray.dir_y), load(rays.ray.dir_z)});
        const Bool mirrors = active & s.is_mirror, others = active & ~s.is_mirror;
        if (any(others))
            sum = sum + select(others, throughput * direct_light(scene, s, -direction, others), black);
        if (depth == scene.max_depth || !any(mirrors))
            return sum;

        // An interpolated normal may send the ray into the facet: then the facet's own reflects.
        Vec3 reflected = mirror_direction(direction, s.normal);
        reflected = select(dot(reflected, s.geometric_normal) > Float(0.0f), reflected,
                           mirror_direction(direction, s.geometric_normal));
        throughput = throughput * s.reflectivity;
        set_ray(rays.ray, s.position + s.geometric_normal * s.offset, reflected, Float(far_away), Int(all_masks));
        active = trace(scene, make_query(Coherence::incoherent), rays, mirrors);
        sum = sum + select(mirrors & ~active, throughput * splat(scene.background), black);
        if (!any(active))
            return sum;
    }
}

// The alpha of catchers: how much of the light that they would receive is hidden by virtual objects.
ARHOST_INLINE Float caught_shadow(const Scene &scene, const RTCRayHit16 &rays, Bool active) {
    const Surface s = surface_at(scene, rays, active);
    Float irradiance = 0.0f, weighted = 0.0f;
    for (std::uint32_t i = 0; i < scene.light_count; ++i) {
        const arhost_light &light = scene.lights[i];
        const Incidence in = incidence(light, s);
        const Bool facing = active & (in.cosine > Float(0.0f));
        if (!any(facing))
            continue;
        const float power = light.intensity[0] + light.intensity[1] + light.intensity[2];
        const Float weight = select(facing, in.cosine * in.irradiance * Float(power), Float(0.0f));
        const Bool hidden = facing & ~unshadowed(scene, light, s, facing);
        irradiance = irradiance + weight;
        weighted = weighted + weight * shadow_alpha(hidden, bool_of(false), Float(scene.shadow_alpha_opaque), 0.0f);
    }
    return select(active, mean_shadow_alpha(weighted, irradiance), Float(0.0f));
}

struct Colour {
    Vec3 linear; // straight; black where not lit
    Float alpha;
    Bool is_lit; // not black for being a shadow, or nothing
};

// What a virtual object behind a catcher looks like does not depend on the catcher; an occluder in front
// of anything hides it.
ARHOST_INLINE Colour primary(const Scene &scene, Vec3 eye, Vec3 direction, Bool active) {
    RTCRayHit16 rays;
    set_ray(rays.ray, eye, direction, Float(far_away), Int(virtual_mask | occluder_mask));
    const Bool hit = trace(scene, make_query(Coherence::coherent), rays, active);
    Bool occluded = bool_of(false);
    if (scene.has_occluders)
        for_each_object(scene, rays.hit, hit, [&](const Object &object, Bool here) {
            if (object.role == ARHOST_OCCLUDER)
                occluded = occluded | here;
        });
    const Bool is_virtual = hit & ~occluded, rest = active & ~is_virtual;

    Colour colour{};
    colour.is_lit = is_virtual;
    if (scene.has_catchers && any(rest)) {
        RTCRayHit16 onwards;
        set_ray(onwards.ray, eye, direction, select(hit, load(rays.ray.tfar), Float(far_away)), Int(catcher_mask));
        const Bool caught = trace(scene, make_query(Coherence::coherent, true), onwards, rest);
        if (any(caught))
            colour.alpha = caught_shadow(scene, onwards, caught);
    }
    if (any(is_virtual)) {
        colour.linear = radiance(scene, rays, is_virtual);
        colour.alpha = select(is_virtual, Float(1.0f), colour.alpha);
    }
    return colour;
}

// A block's directions, or one of their slopes.
ARHOST_INLINE Vec3 load_rays(const float *arrays, std::int32_t dimensions, float z) {
    return {load(arrays), load(arrays + lanes), dimensions == 3 ? load(arrays + 2 * lanes) : Float(z)};
}

ARHOST_INLINE Int srgb8(const arhost::shading::Srgb8Table &table, Float linear) {
    using Table = arhost::shading::Srgb8Table;
    const Int bits = bits_of(min(max(linear, Float(Table::smallest)), Float(1.0f)));
    const Int cell = gather(table.cells, (bits - Int(Table::first_bits)) >> Int(Table::shift));
    const Bool above = (bits & Int(Table::low_mask)) >= (cell & Int(Table::threshold_mask));
    return (cell >> Int(Table::code_shift)) + select(above, Int(1), Int(0));
}

ARHOST_INLINE Int rgba8(Int r, Int g, Int b, Int a) {
    return r | (g << Int(8)) | (b << Int(16)) | (a << Int(24));
}

// One block's pixels.
ARHOST_INLINE Int render_block(const Frame &frame, const float *rays, Bool inside) {
    const Scene &scene = frame.scene;
    const Vec3 eye = splat(frame.camera.eye);
    const std::int32_t dimensions = frame.rays.dimensions, step = lanes * dimensions;
    const Vec3 centre = transform(frame.camera.world_from_camera, load_rays(rays, dimensions, 1));
    if (!frame.rays.has_slopes) {
        const Colour colour = primary(scene, eye, centre, inside & (centre.x == centre.x));
        const Int alpha = to_int(code_8bit(colour.alpha));
        if (!any(colour.is_lit))
            return alpha << Int(24);
        const auto &table = *scene.srgb8;
        return rgba8(srgb8(table, colour.linear.x), srgb8(table, colour.linear.y), srgb8(table, colour.linear.z),
                     alpha);
    }
    const Vec3 along_row = transform(frame.camera.world_from_camera, load_rays(rays + step, dimensions, 0));
    const Vec3 along_column = transform(frame.camera.world_from_camera, load_rays(rays + 2 * step, dimensions, 0));
    Vec3 sum{Float(0.0f), Float(0.0f), Float(0.0f)};
    Float alpha = 0.0f;
    for (std::int32_t i = 0; i < frame.sample_count; ++i) {
        const Sample &sample = frame.samples[i];
        const Vec3 direction = centre + along_row * Float(sample.x) + along_column * Float(sample.y);
        const Colour colour = primary(scene, eye, direction, inside & (direction.x == direction.x));
        const Vec3 encoded{srgb_encode(colour.linear.x), srgb_encode(colour.linear.y), srgb_encode(colour.linear.z)};
        sum = sum + encoded * colour.alpha;
        alpha = alpha + colour.alpha;
    }
    // Premultiplied means, then straight: the sums' common divisor cancels out.
    const Float share = Float(1.0f) / max(alpha, Float(1e-6f));
    const auto code = [](Float value) { return to_int(code_8bit(value)); };
    return rgba8(code(sum.x * share), code(sum.y * share), code(sum.z * share),
                 code(alpha * Float(1.0f / static_cast<float>(frame.sample_count))));
}

ARHOST_INLINE void write_block(const Frame &frame, int x, int y, int width, int height, Int pixels) {
    const auto *from = reinterpret_cast<const std::uint8_t *>(&pixels);
    for (int row = 0; row < height; ++row) {
        std::uint8_t *to = frame.rgba + std::size_t{frame.stride} * (y + row) + std::size_t{4} * x;
        if (width == block)
            __builtin_memcpy(to, from + 4 * block * row, 4 * block);
        else
            __builtin_memcpy(to, from + 4 * block * row, 4 * width);
    }
}

} // namespace

Rectangle render_tile(const Frame &frame, const Tile &tile) {
    alignas(64) const int lane[lanes] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    const Int column = load(lane) & Int(3), row = load(lane) >> Int(2);
    const Rectangle &all = tile.pixels;
    Rectangle drawn{all.x1, all.y1, all.x0, all.y0};
    const std::int32_t block_size = frame.rays.block_size();
    const float *rays = frame.rays.blocks + tile.first_block * block_size;
    for (int y = all.y0; y < all.y1; y += block)
        for (int x = all.x0; x < all.x1; x += block, rays += block_size) {
            const int width = all.x1 - x < block ? all.x1 - x : block;
            const int height = all.y1 - y < block ? all.y1 - y : block;
            const Int pixels = render_block(frame, rays, (column < Int(width)) & (row < Int(height)));
            write_block(frame, x, y, width, height, pixels);
            if (any((pixels >> Int(24)) != Int(0))) { // lanes outside have alpha 0
                drawn.x0 = x < drawn.x0 ? x : drawn.x0;
                drawn.y0 = y < drawn.y0 ? y : drawn.y0;
                drawn.x1 = x + width > drawn.x1 ? x + width : drawn.x1;
                drawn.y1 = y + height > drawn.y1 ? y + height : drawn.y1;
            }
        }
    return drawn;
}

} // namespace rt_embree::ARHOST_ISA
