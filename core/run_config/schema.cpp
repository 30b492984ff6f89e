// SPDX-License-Identifier: Apache-2.0
#include "run_config/schema.hpp"

#include "sandbox/sandbox.hpp"

#include <algorithm>
#include <stdexcept>

namespace arhost::run_config {
namespace {

using enum Type;

// A key of the table. `path` is relative to the path of the part that contains the key.
struct Row {
    std::string_view path;
    Type type;
    std::string_view default_value, meaning;
    std::span<const std::string_view> choices{};
};

constexpr std::string_view run_modes[] = {"lockstep", "live"}, distortion_models[] = {"none", "brown", "fisheye"},
                           filters[] = {"none", "adaptive"}, compositing_spaces[] = {"linear", "srgb"};

constexpr Row run_keys[] = {
    {"version", integer, required, "Version of this format: 1."},
    {"mode", text, "lockstep",
     "`lockstep`: every frame in order, with reproducible results. `live`: always the newest frame.", run_modes},
    {"sandbox", text, "standard",
     "`standard`: every layer that the machine supports; without namespaces and Landlock, which limit the files that "
     "a plugin can read, only arhost's own plugins run. `permissive`: every layer that the machine supports. "
     "`strict`: all layers; the run fails if one is missing. `none`: no sandbox, for debuggers.",
     sandbox::modes},
    {"paced", boolean, "if there is a window",
     "Mode `lockstep`: show a film at its own rate instead of as fast as possible."},
    {"frames", integer, "0", "Stop after this many frames; 0: stop at the end of the source."},
    {"plugin_path", list, "", "Folders to search for plugins before the folder of built-in plugins."}};

// The keys that every component has, after its own keys.
constexpr Row component_keys[] = {
    {"options", free_map, "", "The plugin's own options; `arhost plugins --options` lists them."},
    {"allow", list, "nothing",
     "Sandbox permissions: `video`, `usb`, `gpu`, `display`, `network`, `listen`, `processes`, `jit` "
     "(docs/security.md)."},
    {"usb", map, "", "The USB device that the plugin may use, and no other (docs/security.md)."},
    {"usb.vendor", text, required, "Vendor ID: four hexadecimal digits, as `lsusb` prints them."},
    {"usb.product", text, required, "Product ID: four hexadecimal digits."},
    {"usb.serial", text, "any", "Serial number, if there are several of these devices."},
    {"reads", list, "", "Additional files and folders that the plugin may read."},
    {"writes", list, "", "Additional folders that the plugin may write to."},
    {"environment", list, "", "Additional environment variables that the plugin receives (docs/security.md)."},
    {"memory_mb", integer, "0",
     "Limit of the plugin's private memory, in MiB; 0: three quarters of the machine's memory."},
    {"deadline_ms", integer, "5000", "Timeout without progress for one frame, in ms."},
    {"start_deadline_ms", integer, "10000", "Timeout without progress during start, in ms."},
    {"stop_deadline_ms", integer, "30000", "Timeout without progress during shutdown, in ms."}};

constexpr Row conform = {"conform", boolean, "false",
                         "Check the plugin's results and report contract violations (docs/conformance.md)."};
constexpr Row fallback = {
    "fallback", text, "",
    "Plugin to use after this one has failed too often or has lost its device three times within a minute."};
constexpr Row name = {"name", text, "the plugin's name", "Name for the command `swap`."};
constexpr Row alternative_keys[] = {name, fallback, conform};
// Keys of the outputs that commands start.
constexpr Row command_output_keys[] = {
    {"path", output_path, "", "Output file; the host replaces %d or %03d by the first free number."}};

constexpr Row source_keys[] = {
    {"path", input_path, "", "Input file or numbered file name (frame_%05d.png), for plugins that read files."},
    {"fps", real, "0", "Frames per second; 0: the source's own rate."},
    conform};

constexpr Row camera_keys[] = {
    {"trajectory", input_path, "",
     "File with camera poses, which are used instead of those of the tracker (docs/trajectories.md)."},
    {"camera", map, "from the trajectory or the source", "Camera intrinsics (docs/camera.md)."},
    {"camera.file", input_path, "", "Calibration file of OpenCV, ROS, Kalibr or ARToolKit (docs/camera.md)."},
    {"camera.name", text, "cam0", "Camera in a calibration file of Kalibr."},
    {"camera.width", integer, "", "Image width that the intrinsics refer to, in px."},
    {"camera.height", integer, "", "Image height that the intrinsics refer to, in px."},
    {"camera.fx", real, "", "Horizontal focal length, in px."},
    {"camera.fy", real, "fx", "Vertical focal length, in px."},
    {"camera.vertical_fov_degrees", real, "",
     "Vertical field of view, in degrees; replaces fx and fy if the camera is not calibrated."},
    {"camera.cx", real, "(width − 1) / 2",
     "Horizontal position of the principal point, in px; pixel centres are at integers."},
    {"camera.cy", real, "(height − 1) / 2", "Vertical position of the principal point, in px."},
    {"camera.distortion", map, "none", "Lens distortion."},
    {"camera.distortion.model", text, required, "`none`, `brown` (OpenCV's calib3d) or `fisheye` (OpenCV's fisheye).",
     distortion_models},
    {"camera.distortion.coefficients", reals, "",
     "Coefficients in OpenCV's order: k1 k2 p1 p2 k3 …; for `fisheye`: k1 k2 k3 k4."}};

constexpr Row tracker_keys[] = {
    {"targets", list, required,
     "The targets, each with one of `marker`, `ids`, `map`, `pattern`, `image` and `body`. The first one is the "
     "world, the frame of the scene."},
    {"targets[].name", text, "FAMILY-ID",
     "Name of the target, required with `map`, `pattern`, `image` and `body`: up to 63 letters, digits, `_`, `.` and "
     "`-`."},
    {"targets[].marker", integer, "", "ID of a single marker in its family."},
    {"targets[].ids", text, "",
     "IDs of several single markers, such as `0-35` or `[0-3, 7]`: a target for each, named FAMILY-ID."},
    {"targets[].family", text, "",
     "Family of `marker` or `ids`, or of a `map` whose format does not name it, such as `tag36h11`; `dictionary` "
     "means the same."},
    {"targets[].dictionary", text, "", "Dictionary of `marker` or `ids`, such as `DICT_6X6_250`."},
    {"targets[].side_mm", real, "", "Side of the black square of `marker`, `ids` or `pattern`, in mm."},
    {"targets[].map", input_path, "",
     "File with the places of several markers, also of apriltag_ros or ARToolKit (docs/markers.md)."},
    {"targets[].pattern", input_path, "", "Pattern file of ARToolKit (`.patt`), for `tracker_pattern`."},
    {"targets[].pattern_ratio", real, "0.5",
     "Side of the pattern inside the black border, relative to that of the square."},
    {"targets[].image", input_path, "", "Picture, for `tracker_image`."},
    {"targets[].width_mm", real, "", "Width of the printed picture, in mm."},
    {"targets[].body", text, "",
     "Name of a body, for trackers that report the poses of bodies, such as motion capture."},
    {"hold_frames", integer, "0", "Frames for which the last pose is kept after the targets are lost."},
    {"world_grace_frames", integer, "90",
     "Frames for which other targets tell where the world is, after the first target was last seen."},
    {"full_search_every", integer, "10",
     "Longest interval, in frames, between searches of the whole frame; in the other frames, a tracker may search "
     "only where markers are expected. 1: always."},
    {"confirm", boolean, "true",
     "Report markers of small families, which clutter contains by chance, only when they are seen in successive "
     "frames (docs/tracking.md)."},
    {"filter", text, "none",
     "Filter of the poses: `adaptive` halves the jitter of resting targets and hardly delays moving ones "
     "(docs/tracking.md).",
     filters},
    fallback,
    conform};

constexpr Row raytracer_keys[] = {
    {"scene", input_path, required,
     "Scene file (docs/scenes.md), or the name of a scene in config/scenes, such as demo."},
    {"composite", text, "from the scene's integrator",
     "Space in which the overlay is blended with the video: `linear` light, the default of `integrator: path`, or "
     "`srgb` codes, the default of `integrator: whitted`.",
     compositing_spaces},
    fallback,
    conform};

constexpr Row coordinates_keys[] = {
    {"coordinates", map, "from the scene's axes",
     "Transform from the marker's axes to the scene's (docs/camera.md)."},
    {"coordinates.ar", integer, "1",
     "Profile of the tracker's axes: 1 x-right y-back z-up, 2 x-right y-up z-front, 3 other."},
    {"coordinates.rt", integer, "1", "Profile of the scene's axes."},
    {"coordinates.rotations", list, "", "One or two rotations, applied if the profiles differ."},
    {"coordinates.rotations[].degrees", real, required, "Angle in degrees, counter-clockwise."},
    {"coordinates.rotations[].axis", reals, required, "Three numbers, not all zero."}};

constexpr Row output_keys[] = {
    {"path", output_path, "",
     "Output file, for plugins that write files; its folder becomes writable. `-`: standard output (`sink_pipe`, "
     "`sink_poses`)."},
    {"control", list, "nothing",
     "Commands that the output may send (docs/control.md): `quit`, `freeze`, `snapshot`, `record`, `load_scene`, "
     "`swap`, `set`, `status`."}};

constexpr Row choices_keys[] = {
    {"scenes", list, "", "Scenes from which the command `load_scene` chooses, besides `raytracer.scene`."},
    {"alternatives", map, "", "Components from which the command `swap` chooses."}};

constexpr Row remaining_keys[] = {
    {"live", map, "", "Settings of mode `live`."},
    {"live.max_latency_ms", integer, "500",
     "If tracking and tracing take longer than this, in ms, frames are shown without overlay."},
    {"live.target_fps", real, "0",
     "If the ray tracer is too slow for this frame rate, it renders with fewer samples, then shades fewer pixels, "
     "then renders smaller images; 0: never."},
    {"live.min_scale", real, "0.5",
     "Smallest size of the images relative to the frame, 0.1 to 1; 1: never smaller images."},
    {"live.min_samples", integer, "1", "Smallest number of samples per pixel."},
    {"restart", map, "", "Restart policy for failed components."},
    {"restart.proven_after_frames", integer, "10",
     "A component that has delivered this many frames is restarted without delay or limit if it delivers frames "
     "between its failures; a `fallback` still replaces it after three lost devices within a minute."},
    {"restart.quarantine_after", integer, "5", "Consecutive failures after which a component is disabled."},
    {"restart.first_delay_ms", integer, "250", "Delay after the first failure, in ms; it doubles with each failure."},
    {"restart.longest_delay_ms", integer, "10000", "Longest delay, in ms."},
    {"stats", output_path, "", "File for the statistics of the run (JSON)."},
    {"timeline", output_path, "", "File for the times of each frame (CSV)."}};

struct Part {
    Row component;           // without a path if the rows belong to no component
    std::string_view plugin; // an example of a plugin
    std::span<const Row> rows;
};
constexpr Part parts[] = {
    {{}, "", run_keys},
    {{"source", map, "",
      "Source of the video frames. Optional if there is a `trajectory`; the frames are then black."},
     "source_synthetic",
     source_keys},
    {{}, "", camera_keys},
    {{"tracker", map, "no tracking", "Finds the targets."}, "tracker_aruco", tracker_keys},
    {{"raytracer", map, "no overlay", "Renders the virtual objects."}, "rt_embree", raytracer_keys},
    {{}, "", coordinates_keys},
    {{"outputs", list, "", "Outputs for the augmented frames."}, "sink_video", output_keys},
    {{}, "", choices_keys},
    {{"alternatives.tracker", list, "", "Alternatives to the tracker; they use its targets."},
     "tracker_apriltag",
     alternative_keys},
    {{"alternatives.raytracer", list, "", "Alternatives to the ray tracer; they use its scene."},
     "rt_vulkan",
     alternative_keys},
    {{"snapshot", map, "", "Output that writes one frame at the command `snapshot`."},
     "sink_images",
     command_output_keys},
    {{"record", map, "", "Output that the command `record` starts and stops."}, "sink_video", command_output_keys},
    {{}, "", remaining_keys}};

std::vector<Key> make_table() {
    std::vector<Key> keys;
    const auto add = [&](const std::string &prefix, std::span<const Row> rows) {
        for (const Row &row : rows)
            keys.push_back(
                {prefix + std::string(row.path), row.type, row.default_value, std::string(row.meaning), row.choices});
    };
    for (const auto &[component, plugin, rows] : parts) {
        if (component.path.empty()) {
            add("", rows);
            continue;
        }
        add("", {&component, 1});
        const std::string prefix = keys.back().path + (component.type == list ? "[]." : ".");
        keys.push_back(
            {prefix + "plugin", text, required, "Plugin name (`" + std::string(plugin) + "`), or path to a `.so`."});
        add(prefix, rows);
        add(prefix, component_keys);
    }
    return keys;
}

const std::vector<Key> &table() {
    static const std::vector<Key> keys = make_table();
    return keys;
}

// Splits "a.b[].c" into "a.b[]" and "c".
std::pair<std::string_view, std::string_view> split(std::string_view path) {
    const std::size_t dot = path.rfind('.');
    if (dot == std::string_view::npos)
        return {"", path};
    return {path.substr(0, dot), path.substr(dot + 1)};
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

} // namespace arhost::run_config
