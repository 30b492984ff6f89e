// SPDX-License-Identifier: Apache-2.0
#include "run_config/schema.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace arhost::run_config {
namespace {

using enum Type;

const std::vector<Key> &table() {
    static const std::vector<Key> keys = {
        {"version", integer, true, "", "The version of this format: 1."},
        {"mode",
         text,
         false,
         "lockstep",
         "`lockstep`: every frame, in order, the same result each time. `live`: the newest frame wins.",
         {"lockstep", "live"}},
        {"sandbox",
         text,
         false,
         "permissive",
         "`permissive`: as far as the machine can. `strict`: all of it, or no run. `none`: for debuggers.",
         {"permissive", "strict", "none"}},
        {"frames", integer, false, "0", "Stop after so many frames; 0: at the source's end."},
        {"plugin_path", list, false, "", "Further folders to look for plugins in, before the built-in one."},

        {"source", map, false, "",
         "Where frames come from. Only a `trajectory` does without: it is traced over black."},
        {"source.plugin", text, true, "", "A plugin's name (`source_synthetic`), or a path to a `.so`."},
        {"source.path", input_path, false, "",
         "The file, or files by a printf pattern, for plugins that read files."},
        {"source.fps", real, false, "0", "Frames a second; 0: the source's own."},
        {"source.options", free_map, false, "", "The plugin's own options: `arhost plugins --options`."},
        {"source.allow", list, false, "nothing",
         "What the sandbox gives it: `video`, `usb`, `gpu`, `display`, `network`, `processes` (docs/security.md)."},
        {"source.reads", list, false, "", "Further files and folders that it may read."},
        {"source.writes", list, false, "", "Folders that it may write to."},
        {"source.environment", list, false, "",
         "Variables of the environment that it gets besides the usual ones (docs/security.md)."},
        {"source.memory_mb", integer, false, "0",
         "Most memory of its own, in MiB; 0: three quarters of the machine's."},
        {"source.conform", boolean, false, "false",
         "Reports frames that break a promise of the ABI (docs/conformance.md)."},
        {"source.deadline_ms", integer, false, "5000", "A frame that takes longer is a hang, in ms."},
        {"source.start_deadline_ms", integer, false, "10000", "Longest start without a word of progress, in ms."},
        {"source.stop_deadline_ms", integer, false, "30000", "Longest end without a word of progress, in ms."},

        {"trajectory", input_path, false, "", "Cameras from this file, not from the tracker (docs/trajectories.md)."},

        {"camera", map, false, "the trajectory's, or the source's own", "The camera's intrinsics (docs/camera.md)."},
        {"camera.file", input_path, false, "", "A calibration, as OpenCV writes it (YAML)."},
        {"camera.width", integer, false, "", "Image width that the intrinsics belong to, in px."},
        {"camera.height", integer, false, "", "Image height, in px."},
        {"camera.fx", real, false, "", "Focal length in px."},
        {"camera.fy", real, false, "fx", "Focal length in px."},
        {"camera.vertical_fov_degrees", real, false, "",
         "In place of fx and fy, where the camera is not calibrated."},
        {"camera.cx", real, false, "(width − 1) / 2", "Principal point in px; pixel centres are at integers."},
        {"camera.cy", real, false, "(height − 1) / 2", "Principal point in px."},
        {"camera.distortion", map, false, "none", "The lens."},
        {"camera.distortion.model",
         text,
         true,
         "",
         "`none`, `brown` (OpenCV's calib3d) or `fisheye` (OpenCV's fisheye).",
         {"none", "brown", "fisheye"}},
        {"camera.distortion.coefficients", reals, false, "",
         "As OpenCV orders them: k1 k2 p1 p2 k3 …; fisheye: k1 k2 k3 k4."},

        {"tracker", map, false, "no tracking", "What finds the markers."},
        {"tracker.plugin", text, true, "", "A plugin's name (`tracker_aruco`), or a path to a `.so`."},
        {"tracker.options", free_map, false, "", "The plugin's own options."},
        {"tracker.markers", list, true, "", "The markers; the first of them that is in view anchors the scene."},
        {"tracker.markers[].id", integer, true, "", "The marker's number in its dictionary."},
        {"tracker.markers[].side_mm", real, true, "", "Side of its black square, in mm."},
        {"tracker.hold_frames", integer, false, "0",
         "For so many frames after the markers are lost the last pose is held."},
        {"tracker.fallback", text, false, "", "The plugin to go on with when this one is given up."},
        {"tracker.allow", list, false, "nothing",
         "What the sandbox gives it: `video`, `usb`, `gpu`, `display`, `network`, `processes` (docs/security.md)."},
        {"tracker.reads", list, false, "", "Further files and folders that it may read."},
        {"tracker.writes", list, false, "", "Folders that it may write to."},
        {"tracker.environment", list, false, "",
         "Variables of the environment that it gets besides the usual ones (docs/security.md)."},
        {"tracker.memory_mb", integer, false, "0",
         "Most memory of its own, in MiB; 0: three quarters of the machine's."},
        {"tracker.conform", boolean, false, "false",
         "Reports results that break a promise of the ABI (docs/conformance.md)."},
        {"tracker.deadline_ms", integer, false, "5000", "A frame that takes longer is a hang, in ms."},
        {"tracker.start_deadline_ms", integer, false, "10000", "Longest start without a word of progress, in ms."},
        {"tracker.stop_deadline_ms", integer, false, "30000", "Longest end without a word of progress, in ms."},

        {"raytracer", map, false, "no overlay", "What draws the virtual objects."},
        {"raytracer.plugin", text, true, "", "A plugin's name (`rt_embree`), or a path to a `.so`."},
        {"raytracer.scene", input_path, true, "", "The scene file (docs/scenes.md)."},
        {"raytracer.options", free_map, false, "", "The plugin's own options."},
        {"raytracer.fallback", text, false, "", "The plugin to go on with when this one is given up."},
        {"raytracer.allow", list, false, "nothing",
         "What the sandbox gives it: `video`, `usb`, `gpu`, `display`, `network`, `processes` (docs/security.md)."},
        {"raytracer.reads", list, false, "", "Further files and folders that it may read."},
        {"raytracer.writes", list, false, "", "Folders that it may write to."},
        {"raytracer.environment", list, false, "",
         "Variables of the environment that it gets besides the usual ones (docs/security.md)."},
        {"raytracer.memory_mb", integer, false, "0",
         "Most memory of its own, in MiB; 0: three quarters of the machine's."},
        {"raytracer.conform", boolean, false, "false",
         "Reports images that break a promise of the ABI (docs/conformance.md)."},
        {"raytracer.deadline_ms", integer, false, "5000", "A frame that takes longer is a hang, in ms."},
        {"raytracer.start_deadline_ms", integer, false, "10000", "Longest start without a word of progress, in ms."},
        {"raytracer.stop_deadline_ms", integer, false, "30000", "Longest end without a word of progress, in ms."},

        {"coordinates", map, false, "from the scene's axes",
         "From the marker's axes to the scene's (docs/camera.md)."},
        {"coordinates.ar", integer, false, "1",
         "Profile of the tracker's axes: 1 x-right y-back z-up, 2 x-right y-up z-front, 3 other."},
        {"coordinates.rt", integer, false, "1", "Profile of the scene's axes."},
        {"coordinates.rotations", list, false, "", "One or two rotations, used where the profiles differ."},
        {"coordinates.rotations[].degrees", real, true, "", "Angle in degrees, counter-clockwise."},
        {"coordinates.rotations[].axis", reals, true, "", "Three numbers, not all zero."},

        {"outputs", list, false, "", "Where augmented frames go."},
        {"outputs[].plugin", text, true, "", "A plugin's name (`sink_video`), or a path to a `.so`."},
        {"outputs[].path", output_path, false, "", "The file, for plugins that write files."},
        {"outputs[].options", free_map, false, "", "The plugin's own options."},
        {"outputs[].allow", list, false, "nothing",
         "What the sandbox gives it: `video`, `usb`, `gpu`, `display`, `network`, `processes` (docs/security.md)."},
        {"outputs[].reads", list, false, "", "Further files and folders that it may read."},
        {"outputs[].writes", list, false, "", "Folders that it may write to, besides that of `path`."},
        {"outputs[].environment", list, false, "",
         "Variables of the environment that it gets besides the usual ones (docs/security.md)."},
        {"outputs[].memory_mb", integer, false, "0",
         "Most memory of its own, in MiB; 0: three quarters of the machine's."},
        {"outputs[].deadline_ms", integer, false, "5000", "A frame that takes longer is a hang, in ms."},
        {"outputs[].start_deadline_ms", integer, false, "10000", "Longest start without a word of progress, in ms."},
        {"outputs[].stop_deadline_ms", integer, false, "30000", "Longest end without a word of progress, in ms."},

        {"live", map, false, "", "Settings of mode live."},
        {"live.max_latency_ms", integer, false, "500",
         "When tracking and tracing take longer than this, in ms, the plain video goes on meanwhile."},

        {"restart", map, false, "", "How components that die are started again."},
        {"restart.proven_after_frames", integer, false, "10",
         "A component that has made so many frames restarts at once, however often it dies."},
        {"restart.quarantine_after", integer, false, "5", "Before that, so many failures end it."},
        {"restart.first_delay_ms", integer, false, "250",
         "Wait after the first failure, in ms; it doubles each time."},
        {"restart.longest_delay_ms", integer, false, "10000", "Longest wait, in ms."},

        {"stats", output_path, false, "", "Where the statistics are written at the end (JSON)."},
        {"timeline", output_path, false, "", "Where the times of each frame are written at the end (CSV)."},
    };
    return keys;
}

// "a.b[].c" → "a.b[]", "c".
std::pair<std::string_view, std::string_view> split(std::string_view path) {
    const std::size_t dot = path.rfind('.');
    if (dot == std::string_view::npos)
        return {"", path};
    return {path.substr(0, dot), path.substr(dot + 1)};
}

const char *type_name(Type type) {
    switch (type) {
    case map:
        return "map";
    case list:
        return "list";
    case text:
        return "text";
    case input_path:
        return "path (input)";
    case output_path:
        return "path (output)";
    case integer:
        return "whole number";
    case real:
        return "number";
    case boolean:
        return "true or false";
    case reals:
        return "list of numbers";
    case free_map:
        return "map of options";
    }
    return "";
}

using Json = nlohmann::ordered_json;

Json json_schema_of_map(std::string_view path);

Json json_schema_of(const Key &key) {
    Json json;
    switch (key.type) {
    case map:
        json = json_schema_of_map(key.path);
        break;
    case free_map:
        json["type"] = "object";
        break;
    case list: {
        json["type"] = "array";
        const std::string element = std::string(key.path) + "[]";
        json["items"] = keys_of(element).empty() ? Json{{"type", "string"}} : json_schema_of_map(element);
        break;
    }
    case reals:
        json = {{"type", "array"}, {"items", {{"type", "number"}}}};
        break;
    case integer:
        json["type"] = "integer";
        break;
    case real:
        json["type"] = "number";
        break;
    case boolean:
        json["type"] = "boolean";
        break;
    default:
        json["type"] = "string";
    }
    if (!key.choices.empty())
        json["enum"] = key.choices;
    if (key.path == "version")
        json["const"] = 1;
    json["description"] = key.meaning;
    return json;
}

Json json_schema_of_map(std::string_view path) {
    Json json = {{"type", "object"}, {"additionalProperties", false}};
    Json required = Json::array();
    for (const Key &key : table()) {
        const auto [parent, name] = split(key.path);
        if (parent != path)
            continue;
        json["properties"][std::string(name)] = json_schema_of(key);
        if (key.required)
            required.push_back(name);
    }
    if (!required.empty())
        json["required"] = required;
    return json;
}

} // namespace

std::span<const Key> schema() {
    return table();
}

std::vector<std::string_view> keys_of(std::string_view path) {
    std::vector<std::string_view> keys;
    for (const Key &key : table())
        if (const auto [parent, name] = split(key.path); parent == path)
            keys.push_back(name);
    return keys;
}

const Key &key_at(std::string_view path) {
    const auto found = std::find_if(table().begin(), table().end(), [&](const Key &key) { return key.path == path; });
    if (found == table().end())
        throw std::logic_error("no key " + std::string(path));
    return *found;
}

std::string schema_as_markdown() {
    std::string text = "| key | type | default | meaning |\n| --- | --- | --- | --- |\n";
    for (const Key &key : table()) {
        const std::string standard = key.required                ? "**required**"
                                     : key.default_value.empty() ? "—"
                                                                 : std::string(key.default_value);
        text += "| `" + std::string(key.path) + "` | " + type_name(key.type) + " | " + standard + " | " +
                std::string(key.meaning) + " |\n";
    }
    return text;
}

std::string schema_as_json_schema() {
    Json json = {{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", "arhost configuration"}};
    json.update(json_schema_of_map(""));
    return json.dump(2) + "\n";
}

} // namespace arhost::run_config
