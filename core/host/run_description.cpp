// SPDX-License-Identifier: Apache-2.0
#include "host/documents.hpp"

#include "base/unique_fd.hpp"

#include <arhost-cpp/url.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

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

// Limits the hashed data, because the run waits while files are hashed.
constexpr std::uint64_t max_hashed_bytes = 32 << 20;

Json plugin_json(const Component &component) {
    const PluginDescription &plugin = component.description();
    return {{"plugin", plugin.short_name()}, {"id", plugin.id}, {"version", plugin.version}};
}

std::string utc_now() {
    const std::time_t now = std::time(nullptr);
    std::tm parts{};
    ::gmtime_r(&now, &parts);
    char text[32];
    std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
    return text;
}

// Returns the options that the command `set` has changed, by path; each value in YAML syntax.
Json changed_options(const RunParts &parts, const Assembly &assembly) {
    Json changed = Json::object();
    const auto add = [&](const auto *stage) {
        const ComponentOptions::InUse *const options = stage ? parts.options.of(stage->component()) : nullptr;
        if (!options)
            return;
        for (const OptionValue &value : options->values)
            if (options->changed.contains(value.key))
                changed[options->path + ".options." + value.key] = run_config::yaml_text(value);
    };
    add(assembly.tracker());
    add(assembly.raytracer());
    return changed;
}

// Describes the files of the scene, with hashes of the first ones.
Json scene_files(const LoadedScene &scene) {
    std::set<std::filesystem::path> read = scene.files;
    read.insert(scene.source.file);
    Json files = Json::array();
    std::uint64_t left = max_hashed_bytes;
    for (const std::filesystem::path &file : read)
        if (const auto fingerprint = fingerprint_of(file, left)) {
            left -= fingerprint->hash.empty() ? 0 : fingerprint->bytes;
            files.push_back({{"file", file.string()}, {"bytes", fingerprint->bytes}});
            if (!fingerprint->hash.empty())
                files.back()["fnv1a"] = fingerprint->hash;
        }
    return files;
}

} // namespace

std::string run_description(const RunParts &parts, const Assembly &assembly, const std::string &id) {
    const yaml::Node &configuration = assembly.latest()->node;
    const yaml::Node::Origin origin = configuration.origin();
    Json overridden = Json::object();
    for (const auto &[path, folder] : origin.overridden)
        overridden[path] = folder.string();
    const Video &video = parts.video;
    Json description = {{"format", "arhost-session"},
                        {"version", session_version},
                        {"id", id},
                        {"recorded", utc_now()},
                        {"arhost", ARHOST_VERSION},
                        {"abi", ARHOST_ABI_VERSION},
                        {"mode", parts.live() ? "live" : "lockstep"},
                        {"fps", video.format.fps},
                        {"camera", video.intrinsics.width > 0 ? camera_json(video.intrinsics) : Json(nullptr)},
                        {"plugins", Json::object()}};
    Json &plugins = description["plugins"];
    const auto add_stage = [&](const char *kind, const auto *stage) {
        if (!stage)
            return;
        plugins[kind] = plugin_json(stage->component());
        plugins[kind]["name"] = stage->configuration()->name;
    };
    if (assembly.source().component())
        plugins["source"] = plugin_json(*assembly.source().component());
    add_stage("tracker", assembly.tracker());
    add_stage("raytracer", assembly.raytracer());
    const Raytracer *const raytracer = assembly.raytracer();
    if (raytracer)
        description["scene"] = raytracer->scene()->source.name;
    description.update({{"scene_files", raytracer ? scene_files(*raytracer->scene()) : Json::array()},
                        {"folder", origin.folder.string()},
                        {"overridden", std::move(overridden)},
                        {"changed_options", changed_options(parts, assembly)}});
    // Any sink can read the description, and users pass sessions on. Therefore the description omits the outputs,
    // whose options may be secret and which a replay does not use, and the names, passwords and queries of URLs.
    description["configuration"] =
        without_url_credentials(configuration.to_yaml({"outputs", "snapshot", "record"}), "") + "\n";
    std::string text = description.dump(-1, ' ', false, Json::error_handler_t::replace);
    if (Json(text).dump(-1, ' ', false, Json::error_handler_t::replace).size() > messages::max_run_description)
        throw std::runtime_error("the configuration is too long to be recorded in a session: more than " +
                                 std::to_string(messages::max_run_description >> 10) +
                                 " KiB with the list of scene files");
    return text;
}

std::optional<Fingerprint> fingerprint_of(const std::filesystem::path &file, std::uint64_t max_hashed_bytes) {
    const base::UniqueFd fd(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
    struct stat status {};
    if (fd.get() < 0 || ::fstat(fd.get(), &status) != 0 || !S_ISREG(status.st_mode))
        return std::nullopt;
    Fingerprint fingerprint{static_cast<std::uint64_t>(status.st_size), ""};
    if (fingerprint.bytes > max_hashed_bytes)
        return fingerprint;
    std::uint64_t hash = 0xcbf29ce484222325; // FNV-1a: offset basis and prime for 64 bits
    std::vector<unsigned char> buffer(1 << 16);
    std::uint64_t left = fingerprint.bytes;
    while (left > 0) {
        const ssize_t got = ::read(fd.get(), buffer.data(), std::min<std::uint64_t>(left, buffer.size()));
        if (got <= 0)
            return std::nullopt;
        left -= static_cast<std::uint64_t>(got);
        for (ssize_t i = 0; i < got; ++i)
            hash = (hash ^ buffer[static_cast<std::size_t>(i)]) * 0x100000001b3;
    }
    char digits[17];
    std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(hash));
    fingerprint.hash = digits;
    return fingerprint;
}

} // namespace arhost::host
