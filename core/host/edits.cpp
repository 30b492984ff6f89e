// SPDX-License-Identifier: Apache-2.0
#include "host/edits.hpp"

#include "base/text.hpp"

#include <spdlog/fmt/fmt.h>
#include <spdlog/fmt/ranges.h>

#include <algorithm>
#include <array>
#include <utility>

namespace arhost::host {

namespace {

// The keys whose edits take effect while the video runs.
constexpr std::array<std::string_view, 5> applied_keys = {"tracker", "raytracer", "scenes", "alternatives",
                                                          "coordinates"};

// All components use these keys. If one of them changes, the whole edit is rejected, because applying only a part of
// it would mix old and new settings.
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

// Returns the configuration's file, and the maps and prints of the targets.
FileWatch::Files configuration_files(const run_config::Configuration &configuration) {
    FileWatch::Files files = paths_to(std::filesystem::absolute(configuration.node.file()));
    if (configuration.tracker)
        for (const std::filesystem::path &map : configuration.tracker->map_files)
            files.merge(paths_to(map));
    return files;
}

// Whether the file of a pattern or picture was edited. Such an edit does not change the targets, which contain only
// the path of the file.
bool has_edited_print(const run_config::TrackerConfiguration &tracker, const FileWatch::Files &edited) {
    for (const model::Target &target : tracker.targets)
        for (const model::TargetMarker &marker : target.markers)
            if (!marker.file.empty() &&
                std::ranges::any_of(paths_to(marker.file), [&](const auto &path) { return edited.contains(path); }))
                return true;
    return false;
}

} // namespace

Edits::Edits(RunParts &parts, Assembly &assembly, std::function<run_config::Configuration()> read)
    : parts_(parts), assembly_(assembly), read_(std::move(read)),
      file_watch_(parts.context.reactor,
                  [this](const FileWatch::Files &files) { edited_.insert(files.begin(), files.end()); }) {
    watch(configuration_files(parts.configuration));
}

void Edits::watch(const FileWatch::Files &files) {
    try {
        file_watch_.add(files);
    } catch (const std::system_error &error) {
        parts_.log(ARHOST_SEVERITY_WARNING, std::string(error.what()) + "; edits there have no effect");
    }
}

void Edits::on_swapped(const Assembly::Exchanged &exchanged) {
    if (exchanged.tracker)
        tracker_edit_failed_ = false;
    if (exchanged.raytracer)
        failed_raytracer_edit_.reset();
}

void Edits::apply() {
    if (edited_.empty() || assembly_.swaps_tracker() || assembly_.swaps_raytracer())
        return;
    const FileWatch::Files files = std::exchange(edited_, {});
    const auto is_edited = [&](const std::filesystem::path &file) { return files.contains(file); };
    const std::shared_ptr<const run_config::Configuration> previous = assembly_.latest();
    if (std::ranges::any_of(configuration_files(*previous), is_edited))
        read_configuration(*previous);
    const run_config::Configuration &latest = *assembly_.latest();
    const Raytracer *const raytracer = assembly_.raytracer();
    const bool scene_changed =
        raytracer && std::ranges::any_of(files, [&](const auto &each) {
            return each == raytracer->scene()->source.file || raytracer->scene()->files.contains(each);
        });
    try {
        apply(latest, *previous, scene_changed, latest.tracker && has_edited_print(*latest.tracker, files));
    } catch (const std::exception &error) {
        parts_.log(ARHOST_SEVERITY_WARNING, std::string(error.what()) + "; the edit is not applied");
    }
}

void Edits::read_configuration(const run_config::Configuration &previous) {
    try {
        auto edited = std::make_shared<const run_config::Configuration>(read_());
        for (const std::string_view key : shared_keys)
            if (content_of(edited->node, key) != content_of(previous.node, key))
                throw std::runtime_error("an edit of '" + std::string(key) + "' needs a new run");
        watch(configuration_files(*edited));
        assembly_.set_latest(std::move(edited));
    } catch (const std::exception &error) {
        parts_.log(ARHOST_SEVERITY_WARNING,
                   std::string(error.what()) + "; the run continues with the previous configuration");
    }
}

void Edits::apply(const run_config::Configuration &edited, const run_config::Configuration &previous,
                  bool scene_changed, bool print_changed) {
    if (const auto keys = unapplied_edits(edited, previous); !keys.empty())
        parts_.log(ARHOST_SEVERITY_WARNING,
                   fmt::format("the edit of '{}' takes effect in the next run", fmt::join(keys, "', '")));
    const auto differs = [&](std::string_view key) {
        return content_of(edited.node, key) != content_of(previous.node, key);
    };
    // A failed edit is tried again together with the next edit. The run logs the outcome of each attempt.
    if (assembly_.tracker() && edited.tracker &&
        (differs("tracker") || edited.tracker->targets != previous.tracker->targets || print_changed ||
         std::exchange(tracker_edit_failed_, false)))
        assembly_.swap_tracker(
            assembly_.shared(edited.trackers.front()),
            [this](const std::string &error, const auto &) { tracker_edit_failed_ = !error.empty(); });
    const Raytracer *const raytracer = assembly_.raytracer();
    if (!raytracer || !edited.raytracer)
        return;
    const auto failed = std::exchange(failed_raytracer_edit_, std::nullopt);
    RaytracerEdit edit =
        failed.value_or(RaytracerEdit{.raytracer = raytracer->configuration(), .scene = raytracer->scene()->source});
    if (differs("raytracer"))
        edit.raytracer = assembly_.shared(edited.raytracers.front());
    const bool other_scene = edited.raytracer->scene != previous.raytracer->scene;
    if (other_scene)
        edit.scene = edited.scenes.front();
    const bool loads_scene = failed || scene_changed || other_scene || differs("coordinates");
    if (!loads_scene && !differs("raytracer"))
        return;
    failed_raytracer_edit_ = edit; // remains set until the ray tracer has been replaced
    const auto ignored = [](const std::string &, const nlohmann::ordered_json &) {};
    if (loads_scene)
        assembly_.swap_scene(edit.scene, edit.raytracer, ignored);
    else
        assembly_.swap_raytracer(edit.raytracer, ignored);
}

} // namespace arhost::host
