// SPDX-License-Identifier: Apache-2.0
//
// The capabilities that a scene needs of a ray tracer (arhost_raytracer_capabilities).
#pragma once

#include <arhost/raytracer.h>

#include <cstdint>
#include <string>

namespace arhost::scene {

// Returns the bits of ARHOST_RAYTRACER_CAPABILITY_EVERY_SCENE that `scene` needs. The scene must be valid
// (`validate`). Only the materials of virtual objects and catchers count: occluders are invisible.
std::uint64_t needed_capabilities(const arhost_scene &scene);

// Returns the capabilities of a ray tracer's instance: those of the descriptor, or fewer.
std::uint64_t capabilities_of(const arhost_descriptor &descriptor, const arhost_raytracer &functions,
                              arhost_instance *instance);

// Returns a warning that the ray tracer `id` lacks the capabilities `missing`, or "" if `missing` has no bit of
// ARHOST_RAYTRACER_CAPABILITY_EVERY_SCENE.
std::string missing_capabilities_text(const std::string &id, std::uint64_t missing);

} // namespace arhost::scene
