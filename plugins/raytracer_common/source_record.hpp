// SPDX-License-Identifier: Apache-2.0
//
// The record of a light source that path tracing samples; plain data, for kernels and shaders.
#pragma once

namespace arhost::raytracer_common {

// A light source is a record of `source_rows` floats: an arhost_light, an emissive triangle (`position`, and its
// edges `axis_u` and `axis_v`), an emissive ball, or the environment.
enum SourceRow : int {
    type_row,    // an arhost_light_type, or a SourceType
    falloff_row, // 1: inverse-square, 0: none
    position_row,
    direction_row = position_row + 3,
    intensity_row = direction_row + 3, // of an emissive surface: its radiance
    axis_u_row = intensity_row + 3,
    axis_v_row = axis_u_row + 3,
    radius_row = axis_v_row + 3,
    cosine_inner_row,
    cosine_outer_row,
    chance_row, // probability that a light sample chooses this source
    area_row,   // mm²
    source_rows
};
enum SourceType : int { triangle_source = 16, ball_source, environment_source };

} // namespace arhost::raytracer_common
