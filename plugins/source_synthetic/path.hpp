// SPDX-License-Identifier: Apache-2.0
//
// Closed camera paths around the sheet.
#pragma once

#include <array>

namespace arhost::synthetic {

enum class PathKind { orbit, still, approach };

// The transform from marker to camera in the format of arhost_target.mt: column-major, GL eye space.
using Mt = std::array<double, 16>;

// Returns the pose at a point of the path. `phase`: elapsed fraction of the period, 0 to 1. `distance_scale`: camera
// distance divided by the distance for the default lens. `unit_mm`: scale of the whole scene; 1 for a marker of 80
// mm.
Mt pose_on_path(PathKind kind, double phase, double distance_scale, double unit_mm);

} // namespace arhost::synthetic
