// SPDX-License-Identifier: Apache-2.0
//
// Applies edits of the configuration's file, of the targets' files and of the scene's files while the video runs
// (`--watch`): exchanges the tracker, the ray tracer and the scene that they change.
#pragma once

#include "host/assembly.hpp"
#include "host/file_watch.hpp"

namespace arhost::host {

class Edits {
public:
    // `read` parses the configuration again and throws yaml::Error.
    Edits(RunParts &parts, Assembly &assembly, std::function<run_config::Configuration()> read);

    // The names in `files` may come from the scene loader, which is not trusted: only their folders are opened.
    void watch(const FileWatch::Files &files);
    // Applies the edits of watched files that have not been applied yet. While a tracker, ray tracer or scene is
    // being swapped, does nothing: a later call applies them, so the newest edit takes effect last.
    void apply();
    void on_swapped(const Assembly::Exchanged &exchanged);

private:
    void read_configuration(const run_config::Configuration &previous);
    void apply(const run_config::Configuration &edited, const run_config::Configuration &previous, bool scene_changed,
               bool print_changed);

    RunParts &parts_;
    Assembly &assembly_;
    const std::function<run_config::Configuration()> read_;
    FileWatch file_watch_;
    FileWatch::Files edited_; // edited files whose edits are not applied yet
    // A failed edit is tried again together with the next edit.
    struct RaytracerEdit {
        Raytracer::Configuration raytracer;
        run_config::Scene scene;
    };
    bool tracker_edit_failed_ = false;
    std::optional<RaytracerEdit> failed_raytracer_edit_;
};

} // namespace arhost::host
