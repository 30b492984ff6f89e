// SPDX-License-Identifier: Apache-2.0
#include "host/outcome.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>

namespace arhost::host {
namespace {

std::uint64_t count(const std::map<std::string, std::uint64_t> &counts, const char *stage) {
    const auto found = counts.find(stage);
    return found == counts.end() ? 0 : found->second;
}

} // namespace

std::optional<Problem> problem_with_run(const run_config::Configuration &configuration, const Statistics &statistics,
                                        const std::string &looked_for) {
    if (statistics.frames_in == 0)
        return std::nullopt;
    if (configuration.time_codes)
        return statistics.stages.all().contains("glass_to_glass")
                   ? std::nullopt
                   : std::optional(Problem{"latency", fmt::format("no time code was seen in any of {} frames; point "
                                                                  "the camera at the output's picture",
                                                                  statistics.frames_in)});
    const bool poses_from_tracker = configuration.tracker && !configuration.trajectory;
    if (poses_from_tracker && statistics.tracker_results == 0 && count(statistics.skipped, "tracker") > 0)
        return Problem{"tracker", "it delivered no result: it failed in every frame; see its messages above"};
    if (poses_from_tracker && statistics.tracker_results > 0 && statistics.tracked == 0)
        return Problem{
            "tracker",
            fmt::format("no marker was seen in any of {} frames{}; it looked for {}; compare the numbers and the "
                        "dictionary with the print",
                        statistics.tracker_results, configuration.raytracer ? ", so no frame has an overlay" : "",
                        looked_for),
            true};
    if (configuration.mode != run_config::Mode::live || !configuration.raytracer || statistics.composited == 0 ||
        statistics.augmented > 0)
        return std::nullopt;
    std::string why;
    for (const auto &[stage, frames] : statistics.skipped)
        why += fmt::format("{}{} frames: {}", why.empty() ? "" : ", ", frames, stage);
    return Problem{"raytracer",
                   fmt::format("none of the {} frames shown has an overlay ({}); raise 'live.max_latency_ms', or "
                               "choose fewer samples or a smaller image",
                               statistics.composited, why.empty() ? "all were late" : why)};
}

std::string unseen_markers(const run_config::Configuration &configuration, const Statistics &statistics) {
    if (!configuration.tracker || configuration.trajectory || configuration.time_codes || statistics.markers.empty())
        return {};
    std::string ids;
    std::size_t count = 0;
    for (const arhost_marker_config &listed : configuration.tracker->markers)
        if (!statistics.markers.contains(listed.id)) {
            ids += fmt::format("{} {}", ids.empty() ? "" : ",", listed.id);
            ++count;
        }
    if (count == 0)
        return {};
    return fmt::format("{}{} never seen in {} frames", count == 1 ? "marker" : "markers",
                       ids + (count == 1 ? " was" : " were"), statistics.tracker_results);
}

std::string describe_targets(const std::vector<arhost_marker_config> &markers, const ipc::PluginDescription &plugin,
                             const std::vector<ipc::OptionValue> &options) {
    std::string text = markers.size() == 1 ? "marker" : "the markers";
    for (std::size_t i = 0; i < markers.size(); ++i)
        text += fmt::format("{} {}", i == 0 ? "" : ",", markers[i].id);
    std::string values;
    for (std::size_t i = 0; i < std::min(plugin.options.size(), options.size()); ++i)
        if (!plugin.options[i].choices.empty())
            values += fmt::format("{}{} {}", values.empty() ? "" : ", ", options[i].key, options[i].text);
    return values.empty() ? text : text + " (" + values + ")";
}

} // namespace arhost::host
