// SPDX-License-Identifier: Apache-2.0
//
// Loads a model or a scene in a sandboxed worker, as `arhost` does.
#pragma once

#include "ipc/memory.hpp"
#include "ipc/reactor.hpp"
#include "scene/arena_builder.hpp"
#include "supervise/launcher.hpp"
#include "supervise/process.hpp"

#include <arhost/scene.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace arhost::view {

// The animation and the variant of a glTF file.
struct Selection {
    std::string animation; // name, index, or "all"; "": none
    std::string variant;   // "": none
    bool operator==(const Selection &) const = default;
};

struct Content {
    ipc::Mapping arena; // read-only and valid
    scene::Contents contents;
    std::vector<std::string> messages; // of the loader, without those that the report repeats
    const arhost_scene &scene() const { return arena.as<const arhost_scene>(); }
};

class Loader {
public:
    struct Options {
        std::filesystem::path file;        // .yaml: a scene; else a model
        std::filesystem::path environment; // image that lights a model; empty: the default light
        std::filesystem::path output;      // must not be a file that the scene reads; may be empty
        std::optional<bool> is_z_up{};     // whether z is up in an OBJ, PLY or STL file; absent: only in STL files
    };
    // Throws base::InvalidInput if the file is not one that can be viewed.
    explicit Loader(Options options);

    bool is_model() const { return is_model_; }
    bool is_gltf() const { return is_gltf_; }

    // Throws base::InvalidInput, or base::Interrupted. The first call starts the launcher; further ones may come from
    // another thread, one at a time.
    Content load(const Selection &selection = {});

private:
    // Returns the scene file that shows the model; `has_material`: whether it replaces the model's materials.
    std::string scene_text(const Selection &selection, bool has_material) const;
    Content load_text(const std::string &text);
    void check_reads(const std::filesystem::path &path, const std::string &node) const;
    std::string readable(std::string text) const;

    Options options_;
    std::string absolute_; // path of the file
    bool is_model_, is_gltf_ = false;
    supervise::Launcher launcher_;
    ipc::Reactor reactor_;
    std::vector<std::string> messages_; // of the worker
    supervise::Context context_;
};

} // namespace arhost::view
