// SPDX-License-Identifier: Apache-2.0
//
// Loads scene files; docs/scenes.md describes the format.
#pragma once

#include "scene/arena_builder.hpp"
#include "scene/callbacks.hpp"
#include "yaml/yaml.hpp"

#include <filesystem>

namespace arhost::scene {

// Reads a scene file and its meshes. Throws yaml::Error for errors in the scene file or a mesh; its message names the
// scene file, line, column and key. Throws Cancelled if the callback requests it.
ArenaBuilder load_scene(const std::filesystem::path &file, const LoadCallbacks &callbacks = {});
ArenaBuilder load_scene(const yaml::Node &root, const LoadCallbacks &callbacks = {});

} // namespace arhost::scene
