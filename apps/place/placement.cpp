// SPDX-License-Identifier: Apache-2.0
#include "place/placement.hpp"

#include "base/program.hpp"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <sstream>

namespace arhost::place {
namespace {

namespace fs = std::filesystem;

// Returns a YAML string.
std::string quoted(const std::string &text) {
    std::string result = "\"";
    for (const char c : text) {
        if (static_cast<unsigned char>(c) < 0x20)
            throw base::InvalidInput("a name contains a control character; rename the file");
        if (c == '"' || c == '\\')
            result += '\\';
        result += c;
    }
    return result + '"';
}

std::string number(double value) {
    std::ostringstream text;
    text << value;
    return text.str();
}

// Returns `file` as the text in `from` names it: relative if it is below the same folder or that above.
std::string named_in(const fs::path &from, const fs::path &file) {
    const fs::path absolute = fs::absolute(file).lexically_normal(),
                   relative = absolute.lexically_relative(fs::absolute(from).parent_path());
    return quoted(relative.empty() || relative.string().starts_with("../..") ? absolute : relative);
}

std::string extension_of(const fs::path &file) {
    std::string extension = file.extension().string();
    std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
    return extension;
}

// Whether the first MTL file that an OBJ file names exists.
bool has_material_library(const fs::path &obj) {
    std::ifstream file(obj);
    for (std::string line; std::getline(file, line);)
        if (line.starts_with("mtllib ")) {
            const std::size_t end = line.find_last_not_of(" \t\r");
            return fs::is_regular_file(obj.parent_path() / line.substr(7, end - 6));
        }
    return false;
}

std::string tracker_text(const Placement &placement, const fs::path &configuration) {
    const std::string side = ", side_mm: " + number(placement.side_mm) + "}]}\n";
    if (extension_of(placement.target) == ".patt")
        return "tracker: {plugin: tracker_pattern, targets: [{pattern: " + named_in(configuration, placement.target) +
               side;
    const std::size_t colon = placement.target.rfind(':');
    unsigned id = 0;
    const char *end = placement.target.data() + placement.target.size();
    if (colon == std::string::npos || colon == 0 ||
        std::from_chars(placement.target.data() + colon + 1, end, id).ptr != end ||
        colon + 1 == placement.target.size())
        throw base::InvalidInput("--on " + placement.target +
                                 ": must be FAMILY:ID, such as tag36h11:23, or a pattern file (.patt)");
    const std::string family = placement.target.substr(0, colon);
    return "tracker: {plugin: " + std::string(family.starts_with("artoolkit") ? "tracker_pattern" : "tracker_aruco") +
           ", targets: [{marker: " + std::to_string(id) + ", family: " + quoted(family) + side;
}

std::string source_text(const Placement &placement, const fs::path &configuration) {
    const std::string &source = placement.source;
    if (source.starts_with("/dev/"))
        return "source: {plugin: source_v4l2, allow: [video], fps: 30, options: {device: " + quoted(source) + "}}\n";
    if (source.find("://") != std::string::npos)
        return "source: {plugin: source_network, allow: [network], options: {url: " + quoted(source) + "}}\n";
    return "source: {plugin: source_file, path: " + named_in(configuration, source) + "}\n";
}

std::string output_text(const Placement &placement) {
    const std::string extension = extension_of(placement.output), path = quoted(placement.output.string());
    if (placement.output.empty())
        return "outputs: [{plugin: sink_window, allow: [display], control: [quit, freeze, snapshot, record, "
               "status]}]\n";
    const bool is_picture = extension == ".png" || extension == ".jpg" || extension == ".jpeg";
    return "outputs: [{plugin: " + std::string(is_picture ? "sink_images" : "sink_video") + ", path: " + path +
           "}]\n";
}

} // namespace

std::string scene_text(const Placement &placement, const fs::path &scene) {
    if (!fs::is_regular_file(placement.model))
        throw base::InvalidInput(placement.model.string() + ": is not a file");
    const std::string extension = extension_of(placement.model);
    const bool is_gltf = extension == ".gltf" || extension == ".glb";
    const double size_mm = placement.fit_mm.value_or(placement.side_mm);
    std::string model = "  - name: model\n    " + std::string(is_gltf ? "gltf" : "mesh") + ": " +
                        named_in(scene, placement.model) + "\n    fit_mm: " + number(size_mm) +
                        " # the largest side\n    place: on_ground\n";
    if (!placement.animation.empty())
        model += "    animation: " + quoted(placement.animation) + "\n";
    if (!placement.variant.empty())
        model += "    variant: " + quoted(placement.variant) + "\n";
    if (!is_gltf && !(extension == ".obj" && has_material_library(placement.model)))
        model += "    material: plain\n";
    const std::string table = number(20 * std::max(size_mm, placement.side_mm));
    return "# Written by `" + placement.command_line + "`. Format: docs/scenes.md.\n" +
           "version: 2\n"
           "axes: z-up # z: away from the marker\n"
           "materials:\n"
           "  plain: {model: metallic-roughness, colour: 0.8, metallic: 0, roughness: 0.6}\n"
           "  table: {model: diffuse, diffuse: 0.5}\n"
           "# Without lamps, the light is a guess that follows the video; docs/light.md tells how to bring that of "
           "your room.\n"
           "objects:\n" +
           model + "  - name: table # receives the shadow\n    plane: {size: [" + table + ", " + table +
           "]}\n    role: catcher\n    material: table\n";
}

std::string configuration_text(const Placement &placement, const fs::path &scene, const fs::path &configuration) {
    const bool is_camera = placement.source.starts_with("/dev/") || placement.source.find("://") != std::string::npos;
    if (placement.camera.empty() && !is_camera)
        throw base::InvalidInput("--camera is missing: the calibration of the camera that took " + placement.source +
                                 "; `arhost calibrate` measures it (docs/calibration.md)");
    const std::string camera =
        placement.camera.empty() ? "camera: {width: 640, height: 480, fx: 600, fy: 600} # a typical webcam; "
                                   "measure yours: docs/calibration.md\n"
                                 : "camera: {file: " + named_in(configuration, placement.camera) +
                                       (placement.width == 0 ? ""
                                                             : ", width: " + std::to_string(placement.width) +
                                                                   ", height: " + std::to_string(placement.height)) +
                                       "}\n";
    return "# Written by `" + placement.command_line + "`. Format: docs/config.md.\n" + "version: 1\n" +
           (is_camera ? "mode: live\nlive: {target_fps: 25}\n" : "mode: lockstep\n") +
           source_text(placement, configuration) + camera + tracker_text(placement, configuration) +
           "raytracer: {plugin: " + quoted(placement.raytracer) + ", scene: " + named_in(configuration, scene) +
           "}\n" + output_text(placement);
}

} // namespace arhost::place
