// SPDX-License-Identifier: Apache-2.0
#include "host/outcome.hpp"

#include "base/text.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <iterator>

namespace arhost::host {
namespace {

// Names the markers with the most frames.
std::string frames_text(const std::map<std::string, std::uint64_t> &frames_of_marker) {
    std::vector<std::pair<std::uint64_t, std::string>> most_frequent;
    most_frequent.reserve(frames_of_marker.size());
    for (const auto &[name, frames] : frames_of_marker)
        most_frequent.emplace_back(frames, name);
    std::ranges::stable_sort(most_frequent, std::greater{}, &std::pair<std::uint64_t, std::string>::first);
    most_frequent.resize(std::min<std::size_t>(most_frequent.size(), 5));
    std::string text;
    for (const auto &[frames, name] : most_frequent)
        text += fmt::format("{}{} ({})", text.empty() ? "" : ", ", name, base::count_of(frames, "frame"));
    return text;
}

std::uint64_t count(const std::map<std::string, std::uint64_t> &counts, const char *stage) {
    const auto found = counts.find(stage);
    return found == counts.end() ? 0 : found->second;
}

} // namespace

std::optional<Problem> problem_with_run(const run_config::Configuration &configuration, const Statistics &statistics,
                                        const std::vector<model::Target> &targets) {
    if (statistics.frames_in == 0)
        return std::nullopt;
    if (configuration.time_codes)
        return statistics.stages.all().contains("glass_to_glass")
                   ? std::nullopt
                   : std::optional(Problem{"latency", fmt::format("no time code was seen in {}; point the "
                                                                  "camera at the output's picture",
                                                                  base::count_of(statistics.frames_in, "frame"))});
    const bool poses_from_tracker = configuration.tracker && !configuration.trajectory;
    if (poses_from_tracker && statistics.tracker_results == 0 && count(statistics.skipped, "tracker") > 0)
        return Problem{"tracker", "it delivered no result: it failed in every frame; see its messages above"};
    if (poses_from_tracker && statistics.tracker_results > 0 && statistics.targets.empty())
        return Problem{"tracker",
                       fmt::format("no target was seen in {}{}; it looked for {}{}{}",
                                   base::count_of(statistics.tracker_results, "frame"),
                                   configuration.raytracer ? ", so no frame has an overlay" : "",
                                   describe_targets(targets), seen_instead(statistics, targets),
                                   how_to_compare(targets)),
                       true};
    if (!configuration.raytracer || statistics.composited == 0 || statistics.augmented > 0)
        return std::nullopt;
    if (poses_from_tracker && statistics.tracker_results > 0 && !targets.empty() &&
        !statistics.targets.contains(targets.front().name)) {
        return Problem{"tracker",
                       fmt::format("no frame has an overlay, because '{}', the first target, is the world of the "
                                   "scene; {}{}",
                                   targets.front().name, unseen_targets(configuration, statistics, targets),
                                   how_to_compare({targets.front()})),
                       true};
    }
    if (configuration.mode != run_config::Mode::live)
        return std::nullopt;
    std::string why;
    for (const auto &[stage, frames] : statistics.skipped)
        why += fmt::format("{}{}: {}", why.empty() ? "" : ", ", base::count_of(frames, "frame"), stage);
    return Problem{"raytracer",
                   fmt::format("{} shown, none with an overlay ({}); raise 'live.max_latency_ms', or "
                               "choose fewer samples or a smaller image",
                               base::count_of(statistics.composited, "frame"), why.empty() ? "all were late" : why)};
}

std::string unseen_targets(const run_config::Configuration &configuration, const Statistics &statistics,
                           const std::vector<model::Target> &targets) {
    if (!configuration.tracker || configuration.trajectory || configuration.time_codes || statistics.targets.empty())
        return {};
    std::vector<model::Target> unseen;
    std::ranges::copy_if(targets, std::back_inserter(unseen),
                         [&](const model::Target &target) { return !statistics.targets.contains(target.name); });
    if (unseen.empty())
        return {};
    return fmt::format("never seen in {}: {}{}", base::count_of(statistics.tracker_results, "frame"),
                       describe_targets(unseen), seen_instead(statistics, unseen));
}

std::string looks_for(const Statistics &statistics, const std::vector<model::Target> &targets) {
    return "it looks for " + describe_targets(targets) + seen_instead(statistics, targets) + how_to_compare(targets);
}

std::string missing_target(const run_config::Configuration &configuration, const Statistics &statistics,
                           const std::vector<model::Target> &targets, std::chrono::steady_clock::time_point now) {
    constexpr std::chrono::seconds grace{1}; // targets are lost for a moment, too
    if (!configuration.tracker || configuration.trajectory || configuration.time_codes ||
        !statistics.without_target_since || now - *statistics.without_target_since < grace)
        return {};
    return (statistics.targets.empty()
                ? std::string("the tracker has seen no target yet; ")
                : fmt::format("the tracker has seen no target for {} s; ",
                              duration_cast<std::chrono::seconds>(now - *statistics.without_target_since).count())) +
           looks_for(statistics, targets);
}

std::string misfitting_targets(const Statistics &statistics, const std::vector<model::Target> &targets) {
    // A usable calibration or layout causes smaller errors.
    const auto fits = [](const TargetStatistics &seen) {
        return seen.mean_reprojection_px <= std::max(3.0, 0.01 * seen.largest_px);
    };
    std::string text;
    bool has_map = false;
    for (const model::Target &target : targets) {
        const auto seen = statistics.targets.find(target.name);
        if (seen == statistics.targets.end() || fits(seen->second))
            continue;
        text += fmt::format("{}'{}' (mean reprojection error {:.1f} px)", text.empty() ? "" : ", ", target.name,
                            seen->second.mean_reprojection_px);
        has_map = has_map || target.markers.size() > 1;
    }
    return text.empty() ? ""
                        : "the corners and the computed poses disagree: " + text +
                              "; check the calibration of the camera and the proportions of the prints" +
                              (has_map ? ", and the places and sides in the map ('arhost map' learns a map)" : "");
}

std::string marker_name(const model::TargetMarker &marker) {
    return marker.family + " " +
           (marker.file.empty() ? std::to_string(marker.id) : std::filesystem::path(marker.file).filename().string());
}

std::string describe_targets(const std::vector<model::Target> &targets) {
    constexpr std::size_t max_named = 8;
    std::string text;
    for (std::size_t i = 0; i < std::min(targets.size(), max_named); ++i) {
        const model::Target &target = targets[i];
        text += i == 0 ? "'" : ", '";
        text += target.name + "' ";
        if (!target.body.empty())
            text += "(body '" + target.body + "')";
        else if (target.markers.size() == 1)
            text += "(" + marker_name(target.markers[0]) + ")";
        else
            text += fmt::format("(map of {} markers of {})", target.markers.size(), target.markers[0].family);
    }
    if (targets.size() > max_named)
        text += fmt::format(" and {} more", targets.size() - max_named);
    return text;
}

std::string seen_instead(const Statistics &statistics, const std::vector<model::Target> &unseen) {
    std::map<std::string, std::uint64_t> unconfirmed_ids, unconfirmed_files;
    for (const model::Target &target : unseen)
        for (const model::TargetMarker &marker : target.markers)
            if (const auto found = statistics.unconfirmed.find(marker_name(marker));
                found != statistics.unconfirmed.end())
                (marker.file.empty() ? unconfirmed_ids : unconfirmed_files).insert(*found);
    std::string text;
    if (const std::string unlisted = unlisted_text(statistics); !unlisted.empty())
        text += "; it saw " + unlisted;
    for (const std::string &hint : statistics.hints)
        text += "; " + hint;
    if (!unconfirmed_ids.empty())
        text += "; it saw " + frames_text(unconfirmed_ids) +
                " but got no pose: either the corners fit none (check the calibration of the camera, and whether "
                "something hides a corner), or a small family was not seen in successive frames (see "
                "'tracker.confirm' in docs/config.md)";
    if (!unconfirmed_files.empty())
        text += "; it saw " + frames_text(unconfirmed_files) +
                " but got no pose, because the corners fit none: check the calibration of the camera, the "
                "proportions of the print, and whether something hides a corner";
    if (const SearchStatistics &search = statistics.search;
        text.empty() && statistics.targets.empty() && search.frames_with_candidate_count > 0)
        text =
            search.candidates == 0
                ? std::string("; it found no quadrilaterals: check the light, the focus and the size of the print "
                              "in the image")
                : fmt::format("; of {:.1f} quadrilaterals per frame, none could be read as a marker of these targets",
                              static_cast<double>(search.candidates) /
                                  static_cast<double>(search.frames_with_candidate_count));
    return text;
}

std::string how_to_compare(const std::vector<model::Target> &unseen) {
    bool has_ids = false, has_files = false;
    for (const model::Target &target : unseen)
        for (const model::TargetMarker &marker : target.markers)
            (marker.file.empty() ? has_ids : has_files) = true;
    return std::string(has_ids ? "; compare the numbers and the family with the print" : "") +
           (has_files ? "; compare the files with the prints" : "");
}

std::string unlisted_text(const Statistics &statistics) {
    return frames_text(statistics.unlisted);
}

} // namespace arhost::host
