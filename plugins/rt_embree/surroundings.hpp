// SPDX-License-Identifier: Apache-2.0
//
// The memory of the video, in the state that the host keeps.
#pragma once

#include "embree_scene.hpp"
#include "raytracer_common/denoiser/denoiser.hpp"

#include <cstdint>

namespace rt_embree {

std::uint64_t surroundings_state_size(); // bytes

// Returns the memory of the surroundings in a state. `slots.after` must not be NULL. `flat_catcher`: index of a
// catcher whose box is flat along a world axis, or −1.
Surroundings surroundings_in(const StateSlots &slots, const EmbreeScene &scene, std::int32_t flat_catcher,
                             const Camera &camera);

} // namespace rt_embree
