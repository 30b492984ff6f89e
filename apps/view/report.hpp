// SPDX-License-Identifier: Apache-2.0
//
// Describes the contents of a file to the user.
#pragma once

#include "scene/arena_builder.hpp"
#include "scene/box.hpp"

#include <string>
#include <vector>

namespace arhost::view {

struct Report {
    std::string file;                   // name, as the user wrote it
    std::uint64_t file_size = 0;        // bytes
    scene::Box at_rest, over_animation; // the latter is empty if nothing is animated
    std::string animation;              // that is shown; "": none
    std::vector<std::string> messages;
};

// Returns lines of text. The scene must be valid.
std::string to_text(const Report &report, const arhost_scene &scene, const scene::Contents &contents);

} // namespace arhost::view
