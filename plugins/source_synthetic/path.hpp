// SPDX-License-Identifier: Apache-2.0
//
// Closed camera paths around the sheet.
#pragma once

#include <array>

namespace arhost::synthetic {

enum class PathKind { orbit, still, approach };

// Marker-to-camera as arhost_marker.mt: column-major, GL eye space.
using Mt = std::array<double, 16>;

// `phase`: elapsed fraction of the period, 0 to 1. `distance_scale`: camera distance relative to the default lens.
// `unit_mm`: scale of the whole scene; 1 for a marker of 80 mm.
Mt pose_on_path(PathKind kind, double phase, double distance_scale, double unit_mm);

} // namespace arhost::synthetic
