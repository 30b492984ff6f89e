// SPDX-License-Identifier: Apache-2.0
//
// Limits of the values in an arena.
#pragma once

#include <cstddef>
#include <cstdint>

namespace arhost::scene {

// Largest absolute coordinate. Within this limit, the arithmetic of ray tracers cannot overflow.
inline constexpr float coordinate_limit_mm = 1e9f;
inline constexpr std::size_t arena_alignment = 64;   // of each buffer, per arhost/scene.h
inline constexpr std::size_t arena_spare_bytes = 16; // after each buffer, per arhost/scene.h
inline constexpr std::uint32_t max_depth_limit = 100;
inline constexpr std::uint32_t texture_side_limit = 16384;
inline constexpr float film_thickness_limit_nm = 1e5f;
inline constexpr std::uint64_t image_bytes_limit = std::uint64_t(8) << 30; // of all images of a scene
inline constexpr float radiance_limit = 1e6f;                              // for texels and emission
inline constexpr float extinction_limit = 1e6f;                            // 1/mm
inline constexpr float duration_limit_s = 1e6f; // at this time, floats have a resolution of 1/16 s

} // namespace arhost::scene
