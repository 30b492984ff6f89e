// SPDX-License-Identifier: Apache-2.0
//
// Scene files: docs/scenes.md describes them.
#pragma once

#include "scene/arena.hpp"
#include "scene/callbacks.hpp"
#include "scene/mesh.hpp"
#include "yaml/yaml.hpp"

#include <filesystem>

namespace arhost::scene {

// Reads a scene file and its meshes. What is wrong in either is thrown as a yaml::Error that names the
// scene's file, line, column and key; Cancelled is thrown once the callback asks for it.
ArenaBuilder load_scene(const std::filesystem::path &file, const LoadCallbacks &callbacks = {});
ArenaBuilder load_scene(const yaml::Node &root, const LoadCallbacks &callbacks = {});

} // namespace arhost::scene
