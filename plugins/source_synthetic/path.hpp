// SPDX-License-Identifier: Apache-2.0
//
// Where the camera is: closed paths around the sheet.
#pragma once

#include <array>

namespace arhost::synthetic {

enum class PathKind { orbit, still, approach };

// Marker-to-camera as arhost_marker.mt: column-major, GL eye space.
using Mt = std::array<double, 16>;

// `turn`: the share of the period that has gone, 0 to 1. `reach`: 1 for the default lens; the camera is so
// many times as far away. `unit_mm`: scales the whole; 1 for a marker of 80 mm.
Mt pose_on_path(PathKind kind, double turn, double reach, double unit_mm);

} // namespace arhost::synthetic
