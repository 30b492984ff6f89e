// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "noise.hpp"
#include "surface.hpp"

namespace arhost::synthetic {

// A table top of plain-sawn oak boards under varnish, and the room's floor beyond its edge.
class Wood {
public:
    explicit Wood(std::uint64_t seed) : seed_(seed), noise_(seed) {}
    Surface at(Point p, float texel) const;

private:
    std::uint64_t seed_;
    Noise noise_;
    Placement boards_{{0, 0}, -9};
};

} // namespace arhost::synthetic
