// SPDX-License-Identifier: Apache-2.0
//
// The files that a mesh file from someone else may refer to. Private to core/scene.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace arhost::scene {

class ReferredFiles {
public:
    // Allows the folder of `file`, and `reads`: files and folders without links.
    ReferredFiles(const std::filesystem::path &file, std::span<const std::filesystem::path> reads);

    // Returns `file` without links, or "" if it does not exist. Throws MeshError if it is not allowed.
    std::filesystem::path resolve(const std::filesystem::path &file) const;

private:
    std::string name_; // of the mesh file, for messages
    std::vector<std::filesystem::path> readable_;
};

} // namespace arhost::scene
