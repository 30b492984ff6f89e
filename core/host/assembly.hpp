// SPDX-License-Identifier: Apache-2.0
//
// The source, the tracker and the ray tracer of a run: starts them, and replaces the tracker, the ray tracer and the
// scene while the video runs.
#pragma once

#include "host/raytracer.hpp"
#include "host/source.hpp"
#include "host/tracker.hpp"

namespace arhost::host {

class Assembly {
public:
    // `watch_files` is called with the files of a scene that are read. Their names may come from the scene loader,
    // which is not trusted.
    using WatchFiles = std::function<void(const std::set<std::filesystem::path> &)>;
    Assembly(RunParts &parts, Sightings &sightings, WatchFiles watch_files);
    Assembly(const Assembly &) = delete;
    Assembly &operator=(const Assembly &) = delete;

    // Starts the source and loads the scene. Call advance() after each event, until it returns true: then the tracker
    // and the ray tracer run, too.
    void start();
    bool advance();
    FrameFlow::Intakes intakes() const;
    void end_input();    // has the same effect as the end of the source
    void cancel_calls(); // cancels calls of the tracker and the ray tracer, whose frames will not be shown
    void stop_loading();

    const Source &source() const { return source_; }
    Source &source() { return source_; }
    // Null before both run, or if the configuration has none.
    Tracker *tracker() const { return tracker_.get(); }
    Raytracer *raytracer() const { return raytracer_.get(); }
    std::vector<supervise::Component *> components() const; // including those that start or end

    // The configuration or, after edits, the last edited one. Swaps choose from it.
    const std::shared_ptr<const run_config::Configuration> &latest() const { return latest_; }
    void set_latest(std::shared_ptr<const run_config::Configuration> latest) { latest_ = std::move(latest); }
    // Returns a pointer to a part of the latest configuration, which keeps that configuration alive.
    template <class Part> std::shared_ptr<const Part> shared(const Part &part) const { return {latest_, &part}; }

    // ---- swaps: `done` is called when the new component has replaced the previous one, or has failed to ---------
    bool swaps_tracker() const { return next_tracker_ != nullptr; }
    bool swaps_raytracer() const { return next_raytracer_ || next_scene_loading_; }
    void swap_tracker(Tracker::Configuration configuration, const control::Done &done);
    void swap_raytracer(Raytracer::Configuration configuration, const control::Done &done);
    void swap_scene(const run_config::Scene &scene, const Raytracer::Configuration &raytracer,
                    const control::Done &done);
    // Replaces stages by their successors, once these run and the old stages have no frames.
    struct Exchanged {
        bool tracker = false, raytracer = false;
        explicit operator bool() const { return tracker || raytracer; }
    };
    Exchanged finish_swaps();
    bool has_retired() const { return !retired_.empty(); } // replaced components that have not ended yet
    void remove_ended();                                   // the replaced components that have ended

private:
    std::unique_ptr<SceneLoading> load(const run_config::Scene &scene,
                                       const run_config::RaytracerConfiguration &raytracer,
                                       const std::function<void(std::shared_ptr<LoadedScene>)> &on_loaded,
                                       const std::function<void(const std::string &reason)> &on_failed);
    const run_config::TrackerConfiguration *tracker_of_anchors() const;
    void start_next_raytracer(Raytracer::Configuration configuration, std::shared_ptr<LoadedScene> scene,
                              const control::Done &done);
    bool abandon_swap(const Stage &stage, const std::string &reason);
    template <class Kind> bool finish_swap(std::unique_ptr<Kind> &current, std::unique_ptr<Kind> &next);
    void retire(std::unique_ptr<Stage> stage);
    void warn_of_hidden_objects() const;

    RunParts &parts_;
    Sightings &sightings_;
    const WatchFiles watch_files_;
    std::shared_ptr<const run_config::Configuration> latest_;

    Source source_;
    std::unique_ptr<SceneLoading> scene_loading_, next_scene_loading_;
    std::shared_ptr<LoadedScene> scene_; // the first one
    std::unique_ptr<Tracker> tracker_, next_tracker_;
    std::unique_ptr<Raytracer> raytracer_, next_raytracer_;
    std::vector<std::unique_ptr<Stage>> retired_;
    bool has_started_stages_ = false;
    // A swap has changed the targets or the scene, and warn_of_hidden_objects has not been called since.
    bool anchors_unchecked_ = false;
};

} // namespace arhost::host
