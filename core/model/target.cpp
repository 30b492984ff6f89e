// SPDX-License-Identifier: Apache-2.0
#include "model/target.hpp"

#include <algorithm>

namespace arhost::model {

std::vector<std::string> families_of(const std::vector<Target> &targets) {
    std::vector<std::string> families;
    for (const Target &target : targets)
        for (const TargetMarker &marker : target.markers)
            if (std::ranges::find(families, marker.family) == families.end())
                families.push_back(marker.family);
    return families;
}

} // namespace arhost::model
