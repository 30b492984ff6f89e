// SPDX-License-Identifier: Apache-2.0
//
// Where virtual objects can affect the picture: in the windows of their bounds, and where they can change the light
// of a catcher. All other blocks of pixels show the video.
#pragma once
#include "path_catcher.inl"

ARHOST_INLINE float bounding_radius_of(const arhost_light &lamp) {
    if (lamp.type != ARHOST_LIGHT_RECTANGLE)
        return lamp.radius;
    float squared = 0;
    for (int i = 0; i < 3; ++i)
        squared += lamp.axis_u[i] * lamp.axis_u[i] + lamp.axis_v[i] * lamp.axis_v[i];
    return __builtin_sqrtf(squared);
}

// The cone from a point that touches a sphere.
struct TangentCone {
    Vec3 axis;
    Float sine, cosine; // of the half angle
};

// Returns the lanes in which the cone from a point may meet a lamp that is a rectangle. `margin`: mm, around the
// lamp.
ARHOST_INLINE Bool meets_rectangle(const arhost_light &lamp, Vec3 point, const TangentCone &cone, Float margin) {
    const Vec3 normal = splat(lamp.direction), to_lamp = splat(lamp.position) - point;
    const Float incidence = -dot(cone.axis, normal); // cosine
    // The cone meets the plane of the lamp in an ellipse around a point of the axis. Its farthest point from there:
    // law of sines.
    const Float steepest =
        incidence * cone.cosine - sqrt(max(Float(1.0f) - incidence * incidence, Float(0.0f))) * cone.sine;
    const Float along = -dot(to_lamp, normal) / max(incidence, Float(1e-6f));
    const Float radius = abs(along) * cone.sine / max(steepest, Float(1e-6f)) + margin;
    const Vec3 in_plane = cone.axis * along - to_lamp;
    const auto beyond = [&](const float *axis) __attribute__((always_inline)) {
        const float half = __builtin_sqrtf(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
        return max(abs(dot(in_plane, splat(axis))) * Float(1 / half) - Float(half), Float(0.0f));
    };
    const Float u = beyond(lamp.axis_u), v = beyond(lamp.axis_v);
    return (Float(0.05f) >= steepest) | (radius * radius >= u * u + v * v);
}

// Objects whose form factors have a smaller sum change the light of a catcher by about a code or less, unless they
// emit light.
constexpr float least_visible_form_factor = 1.0f / 256;

// Returns the lanes in which virtual objects can visibly change the light of a real surface within `reach` mm of a
// point.
ARHOST_INLINE Bool may_change(const Frame &frame, const Surface &s, Float reach) {
    const PathScene &path = frame.path;
    const Scene &scene = frame.scene;
    Bool changes = bool_of(false);
    Float form_factors(0.0f);
    const auto cone_to = [&](Vec3 centre, Float radius) __attribute__((always_inline)) {
        const Vec3 to_centre = centre - s.position;
        const Float distance = max(length(to_centre), Float(1e-6f));
        const Float sine = min((radius + reach) / distance, Float(1.0f));
        return TangentCone{to_centre * (Float(1.0f) / distance), sine, sqrt(Float(1.0f) - sine * sine)};
    };
    for (std::int32_t i = 0; i < path.sphere_count; ++i) {
        const float *sphere = path.spheres + 4 * i;
        const TangentCone object = cone_to(splat(sphere), Float(sphere[3]));
        const Float height = min(max(dot(object.axis, s.normal) + object.sine, Float(0.0f)), Float(1.0f));
        form_factors = form_factors + object.sine * object.sine * height;
        changes = changes | (object.sine >= Float(1.0f));
        for (std::uint32_t lamp = 0; lamp < scene.light_count; ++lamp) {
            const arhost_light &light = scene.lights[lamp];
            TangentCone shining{-splat(light.direction), Float(0.0f), Float(1.0f)};
            if (light.type != ARHOST_LIGHT_DIRECTIONAL)
                shining = cone_to(splat(light.position), Float(bounding_radius_of(light)));
            const Float overlap = object.cosine * shining.cosine - object.sine * shining.sine;
            // Within the sphere, the lamp may be in any direction.
            Bool hides = (dot(object.axis, shining.axis) >= overlap - Float(1e-4f)) | (shining.sine >= Float(1.0f));
            if (light.type == ARHOST_LIGHT_RECTANGLE && any(hides))
                hides = hides & meets_rectangle(light, s.position, object, reach);
            changes = changes | hides;
        }
    }
    // A part of an environment may be much brighter than the mean.
    Float brightness(1.0f);
    if (scene.environment.image) {
        const Vec3 d = transform(scene.environment.environment_from_world, s.normal);
        const Vec3 mean =
            sample_texture(scene.linear_of_srgb8, path.irradiance, equirectangular_u(d), equirectangular_v(d)).colour;
        brightness = max(Float(path.brightest_texel) / max(luminance(mean), Float(1e-6f)), brightness);
    }
    return changes | (form_factors * brightness >= Float(least_visible_form_factor));
}

// Finds the blocks of a tile that show only the wide catcher, unchanged. `unchanged`: one element per block. Returns
// whether all do.
ARHOST_FUNCTION bool find_unchanged(const Frame &frame, const Tile &tile, const Scratch &scratch, bool *unchanged) {
    const Scene &scene = frame.scene;
    const Rectangle &all = tile.pixels;
    const float *rays = frame.rays.blocks + tile.first_block * frame.rays.block_size();
    alignas(64) float towards[3][tile_pixels / lanes];
    int count = 0;
    for_each_block(all, [&](int number, int, int, int width, int height) {
        const float *of_block = rays + number * frame.rays.block_size();
        const Bool inside = inside_block(width, height);
        const Vec3 in_camera = direction_in_camera(frame, of_block, 0, 0);
        const bool busy =
            any(in_windows(scratch.windows, in_camera, inside)) || any(inside & ~(in_camera.x == in_camera.x));
        // The middle of the block.
        const Vec3 direction =
            transform(frame.camera.world_from_camera, direction_in_camera(frame, of_block, 0.5f, 0.5f));
        alignas(64) float values[lanes];
        const Float rows[] = {direction.x, direction.y, direction.z};
        constexpr int middle = block + 1; // the pixel to the left of and above the middle
        for (int i = 0; i < 3; ++i) {
            store(values, rows[i]);
            towards[i][number] = values[middle];
        }
        unchanged[number] = !busy;
        count = number + 1;
    });
    bool all_unchanged = true;
    for (int first = 0; first < count; first += lanes) {
        unsigned candidates = 0;
        for (int i = 0; i < lanes && first + i < count; ++i)
            candidates |= unsigned{unchanged[first + i]} << i;
        if (candidates == 0) {
            all_unchanged = false;
            continue;
        }
        const Bool active = ((Int(static_cast<int>(candidates)) >> lane_numbers()) & Int(1)) == Int(1);
        const Vec3 direction{load(towards[0] + first), load(towards[1] + first), load(towards[2] + first)};
        RTCRayHit16 hits;
        set_ray(hits.ray, splat(frame.camera.eye), direction, Float(far_away), Int(catcher_mask));
        Bool result = trace(scene, scene.catchers, make_query(Coherence::coherent, true), hits, active);
        result = result & (object_number(scene, hits.hit) == Int(frame.path.wide_catcher));
        if (any(result)) {
            const Surface s = surface_at(scene, hits, result);
            const Float facing = abs(dot(normalize(direction), s.geometric_normal));
            // Half the diagonal of a block, and as much again for perspective and lens.
            const Float reach =
                s.distance * Float(1.414f * block * frame.denoising->pixel_angle) / max(facing, Float(1e-3f));
            result = result & (facing > Float(0.1f)) & ~may_change(frame, s, reach);
            if (frame.path.photons.level_count > 0 && any(result))
                result = result & ~is_near_photons(frame.path.photons, s.position, reach);
        }
        const unsigned bits = mask_of(result.lane);
        for (int i = 0; i < lanes && first + i < count; ++i) {
            unchanged[first + i] = ((bits >> i) & 1) != 0;
            all_unchanged = all_unchanged && unchanged[first + i];
        }
    }
    return all_unchanged;
}
