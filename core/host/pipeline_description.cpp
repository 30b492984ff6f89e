// SPDX-License-Identifier: Apache-2.0
//
// The description of a run for the sinks that record it (docs/sessions.md).
#include "host/pipeline.hpp"

#include "run_config/recorded_session.hpp"

#include <arhost-cpp/url.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <ctime>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;
using Json = nlohmann::ordered_json;

namespace {

Json camera_json(const arhost_intrinsics &camera) {
    const char *model = camera.distortion == ARHOST_DISTORTION_BROWN     ? "brown"
                        : camera.distortion == ARHOST_DISTORTION_FISHEYE ? "fisheye"
                                                                         : "none";
    const std::vector<double> coefficients(camera.coefficients, camera.coefficients + camera.coefficient_count);
    return {{"width", camera.width},
            {"height", camera.height},
            {"fx", camera.fx},
            {"fy", camera.fy},
            {"cx", camera.cx},
            {"cy", camera.cy},
            {"distortion", {{"model", model}, {"coefficients", coefficients}}}};
}

// The run waits while its files are hashed.
constexpr std::uint64_t max_hashed_bytes = 32 << 20;

Json plugin_json(const Component &component) {
    return {{"plugin", component.description().id}, {"version", component.description().version}};
}

std::string utc_now() {
    const std::time_t now = std::time(nullptr);
    std::tm parts{};
    ::gmtime_r(&now, &parts);
    char text[32];
    std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
    return text;
}

} // namespace

std::string Pipeline::run_description(const std::string &id) const {
    const yaml::Node::Origin origin = latest_->node.origin();
    Json overridden = Json::object();
    for (const auto &[path, folder] : origin.overridden)
        overridden[path] = folder.string();
    Json changed = Json::object(); // by the command `set`; each value in YAML syntax
    const auto add_changed = [&](const Component &component) {
        const auto found = options_.find(&component);
        if (found == options_.end())
            return;
        const OptionsInUse &options = found->second;
        for (const OptionValue &value : options.values)
            if (options.changed.contains(value.key))
                changed[options.path + ".options." + value.key] = run_config::yaml_text(value);
    };
    if (tracker_)
        add_changed(*tracker_->component);
    if (raytracer_)
        add_changed(*raytracer_->component);
    Json description = {{"format", "arhost-session"},
                        {"version", run_config::session_version},
                        {"id", id},
                        {"recorded", utc_now()},
                        {"arhost", ARHOST_VERSION},
                        {"abi", ARHOST_ABI_VERSION},
                        {"mode", live_ ? "live" : "lockstep"},
                        {"fps", format_->fps},
                        {"camera", intrinsics_.width > 0 ? camera_json(intrinsics_) : Json(nullptr)},
                        {"plugins", Json::object()}};
    Json &plugins = description["plugins"];
    if (source_)
        plugins["source"] = plugin_json(*source_);
    if (tracker_) {
        plugins["tracker"] = plugin_json(*tracker_->component);
        plugins["tracker"]["name"] = tracker_->configuration->name;
    }
    Json files = Json::array();
    if (raytracer_) {
        plugins["raytracer"] = plugin_json(*raytracer_->component);
        plugins["raytracer"]["name"] = raytracer_->configuration->name;
        description["scene"] = raytracer_->scene->source.name;
        std::set<std::filesystem::path> read = raytracer_->scene->files;
        read.insert(raytracer_->scene->source.file);
        std::uint64_t left = max_hashed_bytes;
        for (const std::filesystem::path &file : read)
            if (const auto fingerprint = run_config::fingerprint_of(file, left)) {
                left -= fingerprint->hash.empty() ? 0 : fingerprint->bytes;
                files.push_back({{"file", file.string()}, {"bytes", fingerprint->bytes}});
                if (!fingerprint->hash.empty())
                    files.back()["fnv1a"] = fingerprint->hash;
            }
    }
    description.update({{"scene_files", std::move(files)},
                        {"folder", origin.folder.string()},
                        {"overridden", std::move(overridden)},
                        {"changed_options", std::move(changed)}});
    // Any sink can read the description, and sessions are passed on: it contains neither the outputs, whose options
    // may be secret and which a replay does not use, nor names, passwords and queries of URLs.
    description["configuration"] =
        without_url_credentials(latest_->node.to_yaml({"outputs", "snapshot", "record"}), "") + "\n";
    std::string text = description.dump(-1, ' ', false, Json::error_handler_t::replace);
    if (Json(text).dump(-1, ' ', false, Json::error_handler_t::replace).size() > messages::max_run_description)
        throw std::runtime_error("the configuration is too long to be recorded in a session: more than " +
                                 std::to_string(messages::max_run_description >> 10) +
                                 " KiB with the list of scene files");
    return text;
}

} // namespace arhost::host
