// SPDX-License-Identifier: Apache-2.0
#include "run_config/schema.hpp"

#include <algorithm>
#include <stdexcept>

namespace arhost::run_config {
namespace {

using enum Type;

void add(std::vector<Key> &keys, const std::string &prefix, const std::vector<Key> &more) {
    for (Key key : more) {
        key.path = prefix + key.path;
        keys.push_back(key);
    }
}

// Adds the keys of a component: its `own` keys and the keys that every component has. `example` is the name of a
// plugin of this kind.
void add_component(std::vector<Key> &keys, const Key &component, const std::string &example,
                   const std::vector<Key> &own) {
    const std::string prefix = component.path + (component.type == list ? "[]." : ".");
    keys.push_back(component);
    add(keys, prefix, {{"plugin", text, true, "", "Plugin name (`" + example + "`), or path to a `.so`."}});
    add(keys, prefix, own);
    add(keys, prefix,
        {{"options", free_map, false, "", "The plugin's own options; `arhost plugins --options` lists them."},
         {"allow", list, false, "nothing",
          "Sandbox permissions: `video`, `usb`, `gpu`, `display`, `network`, `listen`, `processes` "
          "(docs/security.md)."},
         {"usb", map, false, "", "The USB device that the plugin may use, and no other (docs/security.md)."},
         {"usb.vendor", text, true, "", "Vendor ID: four hexadecimal digits, as `lsusb` prints them."},
         {"usb.product", text, true, "", "Product ID: four hexadecimal digits."},
         {"usb.serial", text, false, "any", "Serial number, if there are several of these devices."},
         {"reads", list, false, "", "Additional files and folders that the plugin may read."},
         {"writes", list, false, "", "Additional folders that the plugin may write to."},
         {"environment", list, false, "",
          "Additional environment variables that the plugin receives (docs/security.md)."},
         {"memory_mb", integer, false, "0",
          "Limit of the plugin's private memory, in MiB; 0: three quarters of the machine's memory."},
         {"deadline_ms", integer, false, "5000", "Timeout for one frame, in ms."},
         {"start_deadline_ms", integer, false, "10000", "Timeout without progress during start, in ms."},
         {"stop_deadline_ms", integer, false, "30000", "Timeout without progress during shutdown, in ms."}});
}

std::vector<Key> make_table() {
    const Key conform = {"conform", boolean, false, "false",
                         "Check the plugin's results and report contract violations (docs/conformance.md)."};
    const Key fallback = {
        "fallback", text, false, "",
        "Plugin to use after this one has failed too often or has lost its device three times within a minute."};
    std::vector<Key> keys = {
        {"version", integer, true, "", "Version of this format: 1."},
        {"mode",
         text,
         false,
         "lockstep",
         "`lockstep`: every frame in order, with reproducible results. `live`: always the newest frame.",
         {"lockstep", "live"}},
        {"sandbox",
         text,
         false,
         "standard",
         "`standard`: every layer that the machine supports; without namespaces and Landlock, which limit the files "
         "that a plugin can read, only arhost's own plugins run. `permissive`: every layer that the machine "
         "supports. "
         "`strict`: all layers; the run fails if one is missing. `none`: no sandbox, for debuggers.",
         {"standard", "permissive", "strict", "none"}},
        {"paced", boolean, false, "if there is a window",
         "Mode `lockstep`: show a film at its own rate instead of as fast as possible."},
        {"frames", integer, false, "0", "Stop after this many frames; 0: stop at the end of the source."},
        {"plugin_path", list, false, "", "Folders to search for plugins before the folder of built-in plugins."},
    };
    add_component(keys,
                  {"source", map, false, "",
                   "Source of the video frames. Optional if there is a `trajectory`; the frames are then black."},
                  "source_synthetic",
                  {{"path", input_path, false, "",
                    "Input file or numbered file name (frame_%05d.png), for plugins that read files."},
                   {"fps", real, false, "0", "Frames per second; 0: the source's own rate."},
                   conform});
    add(keys, "",
        {{"trajectory", input_path, false, "",
          "File with camera poses, which are used instead of those of the tracker (docs/trajectories.md)."},
         {"camera", map, false, "from the trajectory or the source", "Camera intrinsics (docs/camera.md)."},
         {"camera.file", input_path, false, "",
          "Calibration file of OpenCV, ROS, Kalibr or ARToolKit (docs/camera.md)."},
         {"camera.name", text, false, "cam0", "Camera in a calibration file of Kalibr."},
         {"camera.width", integer, false, "", "Image width that the intrinsics refer to, in px."},
         {"camera.height", integer, false, "", "Image height that the intrinsics refer to, in px."},
         {"camera.fx", real, false, "", "Horizontal focal length, in px."},
         {"camera.fy", real, false, "fx", "Vertical focal length, in px."},
         {"camera.vertical_fov_degrees", real, false, "",
          "Vertical field of view, in degrees; replaces fx and fy if the camera is not calibrated."},
         {"camera.cx", real, false, "(width − 1) / 2",
          "Horizontal position of the principal point, in px; pixel centres are at integers."},
         {"camera.cy", real, false, "(height − 1) / 2", "Vertical position of the principal point, in px."},
         {"camera.distortion", map, false, "none", "Lens distortion."},
         {"camera.distortion.model",
          text,
          true,
          "",
          "`none`, `brown` (OpenCV's calib3d) or `fisheye` (OpenCV's fisheye).",
          {"none", "brown", "fisheye"}},
         {"camera.distortion.coefficients", reals, false, "",
          "Coefficients in OpenCV's order: k1 k2 p1 p2 k3 …; for `fisheye`: k1 k2 k3 k4."}});
    add_component(
        keys, {"tracker", map, false, "no tracking", "Finds the targets."}, "tracker_aruco",
        {{"targets", list, true, "",
          "The targets, each with one of `marker`, `ids`, `map`, `pattern`, `image` and `body`. The first one is the "
          "world, the frame of "
          "the scene."},
         {"targets[].name", text, false, "FAMILY-ID",
          "Name of the target, required with `map`, `pattern`, `image` and `body`: up to 63 letters, digits, `_`, "
          "`.` "
          "and `-`."},
         {"targets[].marker", integer, false, "", "ID of a single marker in its family."},
         {"targets[].ids", text, false, "",
          "IDs of several single markers, such as `0-35` or `[0-3, 7]`: a target for each, named FAMILY-ID."},
         {"targets[].family", text, false, "",
          "Family of `marker` or `ids`, or of a `map` whose format does not name it, such as `tag36h11`; "
          "`dictionary` means "
          "the same."},
         {"targets[].dictionary", text, false, "", "Dictionary of `marker` or `ids`, such as `DICT_6X6_250`."},
         {"targets[].side_mm", real, false, "", "Side of the black square of `marker`, `ids` or `pattern`, in mm."},
         {"targets[].map", input_path, false, "",
          "File with the places of several markers, also of apriltag_ros or ARToolKit (docs/markers.md)."},
         {"targets[].pattern", input_path, false, "", "Pattern file of ARToolKit (`.patt`), for `tracker_pattern`."},
         {"targets[].pattern_ratio", real, false, "0.5",
          "Side of the pattern inside the black border, relative to that of the square."},
         {"targets[].image", input_path, false, "", "Picture, for `tracker_image`."},
         {"targets[].width_mm", real, false, "", "Width of the printed picture, in mm."},
         {"targets[].body", text, false, "",
          "Name of a body, for trackers that report the poses of bodies, such as motion capture."},
         {"hold_frames", integer, false, "0", "Frames for which the last pose is kept after the targets are lost."},
         {"world_grace_frames", integer, false, "90",
          "Frames for which other targets tell where the world is, after the first target was last seen."},
         {"full_search_every", integer, false, "10",
          "Longest interval, in frames, between searches of the whole frame; in the other frames, a tracker may "
          "search "
          "only where markers are expected. 1: always."},
         {"confirm", boolean, false, "true",
          "Report markers of small families, which clutter contains by chance, only when they are seen in successive "
          "frames (docs/tracking.md)."},
         {"filter",
          text,
          false,
          "none",
          "Filter of the poses: `adaptive` halves the jitter of resting targets and hardly delays moving ones "
          "(docs/tracking.md).",
          {"none", "adaptive"}},
         fallback,
         conform});
    add_component(keys, {"raytracer", map, false, "no overlay", "Renders the virtual objects."}, "rt_embree",
                  {{"scene", input_path, true, "",
                    "Scene file (docs/scenes.md), or the name of a scene in config/scenes, such as demo."},
                   fallback,
                   conform});
    add(keys, "",
        {{"coordinates", map, false, "from the scene's axes",
          "Transform from the marker's axes to the scene's (docs/camera.md)."},
         {"coordinates.ar", integer, false, "1",
          "Profile of the tracker's axes: 1 x-right y-back z-up, 2 x-right y-up z-front, 3 other."},
         {"coordinates.rt", integer, false, "1", "Profile of the scene's axes."},
         {"coordinates.rotations", list, false, "", "One or two rotations, applied if the profiles differ."},
         {"coordinates.rotations[].degrees", real, true, "", "Angle in degrees, counter-clockwise."},
         {"coordinates.rotations[].axis", reals, true, "", "Three numbers, not all zero."}});
    add_component(keys, {"outputs", list, false, "", "Outputs for the augmented frames."}, "sink_video",
                  {{"path", output_path, false, "",
                    "Output file, for plugins that write files; its folder becomes writable. `-`: standard output "
                    "(`sink_pipe`)."},
                   {"control", list, false, "nothing",
                    "Commands that the output may send (docs/control.md): `quit`, `freeze`, `snapshot`, `record`, "
                    "`load_scene`, "
                    "`swap`, `set`, `status`."}});
    const Key name = {"name", text, false, "the plugin's name", "Name for the command `swap`."};
    add(keys, "",
        {{"scenes", list, false, "",
          "Scenes from which the command `load_scene` chooses, besides `raytracer.scene`."},
         {"alternatives", map, false, "", "Components from which the command `swap` chooses."}});
    add_component(keys,
                  {"alternatives.tracker", list, false, "", "Alternatives to the tracker; they use its targets."},
                  "tracker_apriltag", {name, fallback, conform});
    add_component(keys,
                  {"alternatives.raytracer", list, false, "", "Alternatives to the ray tracer; they use its scene."},
                  "rt_vulkan", {name, fallback, conform});
    const Key numbered_path = {"path", output_path, false, "",
                               "Output file; the host replaces %d or %03d by the first free number."};
    add_component(keys, {"snapshot", map, false, "", "Output that writes one frame at the command `snapshot`."},
                  "sink_images", {numbered_path});
    add_component(keys, {"record", map, false, "", "Output that the command `record` starts and stops."},
                  "sink_video", {numbered_path});
    add(keys, "",
        {
            {"live", map, false, "", "Settings of mode `live`."},
            {"live.max_latency_ms", integer, false, "500",
             "If tracking and tracing take longer than this, in ms, frames are shown without overlay."},
            {"live.target_fps", real, false, "0",
             "If the ray tracer is too slow for this frame rate, it renders with fewer samples, then smaller images; "
             "0: never."},
            {"live.min_scale", real, false, "0.5",
             "Smallest size of the images relative to the frame, 0.1 to 1; 1: never smaller images."},
            {"live.min_samples", integer, false, "1", "Smallest number of samples per pixel."},

            {"restart", map, false, "", "Restart policy for failed components."},
            {"restart.proven_after_frames", integer, false, "10",
             "A component that has delivered this many frames is restarted without delay or limit if it delivers "
             "frames between its failures; a `fallback` still replaces it after three lost devices within a minute."},
            {"restart.quarantine_after", integer, false, "5",
             "Consecutive failures after which a component is disabled."},
            {"restart.first_delay_ms", integer, false, "250",
             "Delay after the first failure, in ms; it doubles with each failure."},
            {"restart.longest_delay_ms", integer, false, "10000", "Longest delay, in ms."},

            {"stats", output_path, false, "", "File for the statistics of the run (JSON)."},
            {"timeline", output_path, false, "", "File for the times of each frame (CSV)."},
        });
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
