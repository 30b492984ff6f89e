// SPDX-License-Identifier: Apache-2.0
//
// Light sources that path tracing samples: lamps, emissive surfaces and the environment.
#pragma once

#include "raytracer_common/source_record.hpp"

#include <arhost/motion.h>
#include <arhost/scene.h>
#include <arhost/shading/scalar.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace arhost::raytracer_common {

// Where an object is, and the shape of a deforming one.
class VideoImage;

struct PlacedObject {
    const float *world_from_object; // column-major 3×4
    const float *positions;         // of the vertices; NULL: those of the arena
    std::uint32_t position_stride;  // bytes; ignored if `positions` is NULL
    bool is_visible;
};

// The light samples of an emissive object, for the weights of scattered rays that hit it.
struct Emitter {
    float density = 0;     // chance of a light sample per mm² of the mesh, or that of the ball; 0: it is not sampled
    float ball_radius = 0; // world space, mm; 0: a mesh
};

// Whether a material reflects or refracts light without scattering it.
bool is_specular(const arhost_material &material);

class LightSources {
public:
    explicit LightSources(const arhost_scene &arena);

    // Finds the emissive surfaces of objects that have moved. One element per object of the scene.
    void place(std::span<const PlacedObject> objects);

    std::span<const float> records() const { return records_; } // source_rows floats each
    std::span<const float> cumulative() const { return cumulative_; }
    std::span<const float> lamp_chances() const { return lamp_chances_; }
    float environment_chance() const { return environment_chance_; }
    // The change of a catcher's light is relative to at least this irradiance / π, so that a catcher in the dark does
    // not flicker. In a scene without light from the room, where only virtual objects emit, the video tells how
    // bright the room is, if it reflects 35 % of its light. 0: neither lamps, environment, sampled emissive surfaces
    // nor a video give light. `video`: NULL if it is unknown.
    float least_irradiance(const VideoImage *video) const;
    // Irradiance / π, about, of a real surface that lamps hardly reach.
    float faintest_light() const { return std::max(environment_radiance_, light_ / 16); }
    // Whether the penumbras of a lamp, or of the environment's brightest part, may be narrower than about a tenth of
    // the height of the objects that cast them.
    bool casts_sharp_shadows() const { return has_sharp_lamp_ || has_sharp_environment_; }
    std::span<const Emitter> emitters() const { return emitters_; } // one per object
    // Spheres that contain the visible virtual objects, at most max_spheres.
    static constexpr std::size_t max_spheres = 16;
    std::span<const std::array<float, 4>> spheres() const { return spheres_; } // centre and radius, mm
    // Like spheres(), but of the objects that reflect or refract light without scattering it.
    std::span<const std::array<float, 4>> specular_spheres() const { return specular_spheres_; }

private:
    std::vector<std::array<float, 4>> bounds_of(std::span<const PlacedObject> objects, bool only_specular) const;
    float *add_record(float type);
    void add_emitter(std::uint32_t object, const PlacedObject &placed);
    void choose(const std::vector<std::uint32_t> &object_of, shading::Vec3 middle, double extent);
    std::size_t lamp_count() const { return arena_.lights.count; }

    const arhost_scene &arena_;
    float environment_radiance_ = 0; // mean over all directions
    std::vector<float> records_, cumulative_, lamp_chances_;
    std::vector<Emitter> emitters_;
    float environment_chance_ = 0;
    // Light in the middle of the virtual objects, of all sources, and of lamps and environment only: irradiance / π
    // at perpendicular incidence.
    float light_ = 0, light_of_room_ = 0;
    bool has_sharp_lamp_ = false, has_sharp_environment_ = false;
    std::vector<std::array<float, 4>> spheres_, specular_spheres_;
};

// The irradiance of the environment's texels before they are scaled (environment_scale()), divided by π, of surfaces
// that face each direction: RGBA floats in equirectangular projection, in the axes of the environment. Empty without
// an environment.
inline constexpr std::uint32_t irradiance_width = 64, irradiance_height = 32;
std::vector<float> environment_irradiance(const arhost_scene &arena);
// The largest luminance of the environment's texels before they are scaled; 0 without an environment.
float brightest_texel(const arhost_scene &arena);

} // namespace arhost::raytracer_common
