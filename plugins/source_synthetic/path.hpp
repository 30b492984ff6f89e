// SPDX-License-Identifier: Apache-2.0
//
// Closed camera paths around the sheet.
#pragma once

#include <array>

namespace arhost::synthetic {

enum class PathKind { orbit, still, approach };

// Marker-to-camera as arhost_target.mt: column-major, GL eye space.
using Mt = std::array<double, 16>;

// Returns the pose at a point of the path. `phase` is the elapsed fraction of the period, 0 to 1. `distance_scale` is
// the camera distance relative to that for the default lens. `unit_mm` is the scale of the whole scene: 1 for a
// marker of 80 mm.
Mt pose_on_path(PathKind kind, double phase, double distance_scale, double unit_mm);

} // namespace arhost::synthetic
