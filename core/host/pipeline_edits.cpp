// SPDX-License-Identifier: Apache-2.0
//
// Applies edits of the configuration's file, of the targets' files and of the scene's files while the video runs
// (`--watch`).
#include "host/pipeline.hpp"

#include <spdlog/fmt/fmt.h>
#include <spdlog/fmt/ranges.h>

#include <algorithm>

namespace arhost::host {

namespace {

// The keys whose edits take effect while the video runs.
constexpr std::array<std::string_view, 5> applied_keys = {"tracker", "raytracer", "scenes", "alternatives",
                                                          "coordinates"};

// The keys that all components use. A part of an edit could not be applied without the edits of these.
constexpr std::array<std::string_view, 3> shared_keys = {"sandbox", "restart", "plugin_path"};

std::string content_of(const yaml::Node &root, std::string_view key) {
    const auto node = root.find(key);
    return node ? node->to_yaml() : "";
}

// Returns the keys whose edits take effect only in the next run.
std::vector<std::string> unapplied_edits(const run_config::Configuration &edited,
                                         const run_config::Configuration &previous) {
    std::set<std::string> keys;
    for (const auto *configuration : {&edited, &previous})
        for (const auto &[key, node] : configuration->node.entries())
            keys.insert(key);
    std::vector<std::string> unapplied;
    for (const std::string &key : keys) {
        const bool is_applied = std::ranges::find(applied_keys, key) != applied_keys.end() &&
                                edited.tracker.has_value() == previous.tracker.has_value() &&
                                edited.raytracer.has_value() == previous.raytracer.has_value();
        if (!is_applied && content_of(edited.node, key) != content_of(previous.node, key))
            unapplied.push_back(key);
    }
    return unapplied;
}

// Returns the file and the target of its symbolic links.
FileWatch::Files paths_to(const std::filesystem::path &file) {
    return {file, base::real_path(file)};
}

// The configuration's file, and the maps and prints of the targets.
FileWatch::Files configuration_files(const run_config::Configuration &configuration) {
    FileWatch::Files files = paths_to(std::filesystem::absolute(configuration.node.file()));
    if (configuration.tracker)
        for (const std::filesystem::path &map : configuration.tracker->map_files)
            files.merge(paths_to(map));
    return files;
}

// Whether the file of a pattern or picture was edited. The targets contain only its path.
bool has_edited_print(const run_config::TrackerConfiguration &tracker, const FileWatch::Files &edited) {
    for (const model::Target &target : tracker.targets)
        for (const model::TargetMarker &marker : target.markers)
            if (!marker.file.empty() &&
                std::ranges::any_of(paths_to(marker.file), [&](const auto &path) { return edited.contains(path); }))
                return true;
    return false;
}

} // namespace

void Pipeline::watch(std::function<run_config::Configuration()> read) {
    read_configuration_ = std::move(read);
    file_watch_.emplace(context_.reactor,
                        [this](const FileWatch::Files &files) { edited_files_.insert(files.begin(), files.end()); });
    watch_files(configuration_files(configuration_));
}

// `files` may be names from the scene loader, which is not trusted: only their folders are opened.
void Pipeline::watch_files(const FileWatch::Files &files) {
    if (!file_watch_)
        return;
    try {
        file_watch_->add(files);
    } catch (const std::system_error &error) {
        context_.log(ARHOST_SEVERITY_WARNING, "arhost", std::string(error.what()) + "; edits there have no effect");
    }
}

// Waits for the swaps in progress, so that the last edit is the one that stays.
void Pipeline::apply_edits() {
    if (edited_files_.empty() || next_tracker_ || raytracer_swap_in_progress())
        return;
    const FileWatch::Files files = std::exchange(edited_files_, {});
    const auto is_edited = [&](const std::filesystem::path &file) { return files.contains(file); };
    const std::shared_ptr<const run_config::Configuration> previous = latest_;
    if (std::ranges::any_of(configuration_files(*previous), is_edited)) {
        try {
            auto edited = std::make_shared<const run_config::Configuration>(read_configuration_());
            for (const std::string_view key : shared_keys)
                if (content_of(edited->node, key) != content_of(previous->node, key))
                    throw std::runtime_error("an edit of '" + std::string(key) + "' needs a new run");
            latest_ = std::move(edited);
            watch_files(configuration_files(*latest_));
        } catch (const std::exception &error) {
            context_.log(ARHOST_SEVERITY_WARNING, "arhost",
                         std::string(error.what()) + "; the run continues with the previous configuration");
        }
    }
    const bool scene_changed =
        raytracer_ && std::ranges::any_of(files, [&](const auto &each) {
            return each == raytracer_->scene->source.file || raytracer_->scene->files.contains(each);
        });
    const bool print_changed = latest_->tracker && has_edited_print(*latest_->tracker, files);
    try {
        apply(*latest_, *previous, scene_changed, print_changed);
    } catch (const std::exception &error) {
        context_.log(ARHOST_SEVERITY_WARNING, "arhost", std::string(error.what()) + "; the edit is not applied");
    }
}

void Pipeline::apply(const run_config::Configuration &edited, const run_config::Configuration &previous,
                     bool scene_changed, bool print_changed) {
    if (const auto keys = unapplied_edits(edited, previous); !keys.empty())
        context_.log(ARHOST_SEVERITY_WARNING, "arhost",
                     fmt::format("the edit of '{}' takes effect in the next run", fmt::join(keys, "', '")));
    const auto differs = [&](std::string_view key) {
        return content_of(edited.node, key) != content_of(previous.node, key);
    };
    // An edit that fails is tried again with the next one. The run logs the outcome of each.
    if (tracker_ && edited.tracker &&
        (differs("tracker") || edited.tracker->targets != previous.tracker->targets || print_changed ||
         std::exchange(tracker_edit_failed_, false)))
        start_next_tracker(shared(edited.trackers.front()),
                           [this](const std::string &error, const auto &) { tracker_edit_failed_ = !error.empty(); });
    if (!raytracer_ || !edited.raytracer)
        return;
    const auto failed = std::exchange(failed_raytracer_edit_, std::nullopt);
    RaytracerEdit edit =
        failed.value_or(RaytracerEdit{.raytracer = raytracer_->configuration, .scene = raytracer_->scene->source});
    if (differs("raytracer"))
        edit.raytracer = shared(edited.raytracers.front());
    const bool other_scene = edited.raytracer->scene != previous.raytracer->scene;
    if (other_scene)
        edit.scene = edited.scenes.front();
    const bool loads_scene = failed || scene_changed || other_scene || differs("coordinates");
    if (!loads_scene && !differs("raytracer"))
        return;
    failed_raytracer_edit_ = edit; // until the ray tracer has been replaced
    const auto ignored = [](const std::string &, const nlohmann::ordered_json &) {};
    if (loads_scene)
        load_next_scene(edit.scene, edit.raytracer, ignored);
    else
        start_next_raytracer(edit.raytracer, raytracer_->scene, ignored);
}

} // namespace arhost::host
