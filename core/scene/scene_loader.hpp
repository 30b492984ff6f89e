// SPDX-License-Identifier: Apache-2.0
//
// Loads scene files; docs/scenes.md describes the format.
#pragma once

#include "scene/arena_builder.hpp"
#include "scene/callbacks.hpp"
#include "yaml/yaml.hpp"

#include <filesystem>
#include <vector>

namespace arhost::scene {

// Reads a scene file and its meshes. Throws yaml::Error for errors in the scene file or a mesh; its message names the
// scene file, line, column and key. Throws Cancelled if the callback requests it.
// `readable`: files and folders that glTF and OBJ files may refer to besides their own folder. A scene cannot grant
// them.
ArenaBuilder load_scene(const std::filesystem::path &file, const LoadCallbacks &callbacks = {},
                        const std::vector<std::filesystem::path> &readable = {});
ArenaBuilder load_scene(const yaml::Node &root, const LoadCallbacks &callbacks = {},
                        const std::vector<std::filesystem::path> &readable = {});

} // namespace arhost::scene
