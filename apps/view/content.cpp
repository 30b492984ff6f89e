// SPDX-License-Identifier: Apache-2.0
#include "view/content.hpp"

#include "base/file_identity.hpp"
#include "base/program.hpp"
#include "base/text.hpp"
#include "supervise/loading.hpp"
#include "view/interruption.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cctype>
#include <exception>

namespace arhost::view {
namespace {

namespace fs = std::filesystem;
namespace messages = ipc::messages;
using base::InvalidInput;
using nlohmann::json;

// The report contains these facts, and the hints are for scene files.
bool is_repeated(const std::string &message) {
    return std::ranges::any_of(std::initializer_list<std::string_view>{"; available for '", " triangles, ",
                                                                       "'fit_mm: 100'", "'place: on_ground'"},
                               [&](std::string_view part) { return message.find(part) != std::string::npos; });
}

void add(scene::Contents &contents, const messages::Listed &listed) {
    constexpr std::size_t most = 100'000; // the loader is not trusted
    if (std::max({contents.animations.size(), contents.variants.size(), contents.materials.size()}) >= most)
        return;
    if (listed.kind == "animation")
        contents.animations.push_back({listed.text, static_cast<float>(listed.number)});
    else if (listed.kind == "variant")
        contents.variants.push_back(listed.text);
    else if (listed.kind == "material")
        contents.materials.push_back(listed.text);
    else if (listed.kind == "nodes" && listed.number >= 0 && listed.number < 1e12)
        contents.nodes = static_cast<std::size_t>(listed.number);
}

std::string extension_of(const fs::path &file) {
    std::string extension = file.extension();
    if (extension == ".gz")
        extension = file.stem().extension();
    std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
    return extension;
}

} // namespace

Loader::Loader(Options options)
    : options_(std::move(options)), absolute_(fs::absolute(options_.file).lexically_normal()),
      launcher_(base::own_folder() / "arhost-launcher"), context_{reactor_, launcher_,
                                                                  base::own_folder() / "arhost-worker",
                                                                  [this](arhost_severity severity,
                                                                         const std::string &,
                                                                         const std::string &text) {
                                                                      if (severity >= ARHOST_SEVERITY_INFO)
                                                                          messages_.push_back(text);
                                                                  }} {
    const std::string extension = extension_of(options_.file), name = options_.file.string();
    if (!base::is_utf8(absolute_) || !base::is_utf8(options_.environment.native()))
        throw InvalidInput(name + ": the path is not valid UTF-8; rename the file or the folder");
    const fs::file_status status = fs::status(options_.file);
    if (fs::is_directory(status))
        throw InvalidInput(name + ": is a folder; name a model or a scene file");
    if (!fs::exists(status))
        throw InvalidInput(name + ": there is no such file");
    const auto [path, node] = base::identity_of(options_.file);
    check_reads(path, node);
    is_gltf_ = extension == ".gltf" || extension == ".glb";
    is_model_ = extension != ".yaml" && extension != ".yml";
    if (!options_.is_z_up) // most programs that write STL files are for 3D printing or CAD
        options_.is_z_up = extension == ".stl";
    if (!is_model_ && !options_.environment.empty())
        throw InvalidInput("--environment: a scene file has its own light; add the key 'environment' to it");
}

std::string Loader::scene_text(const Selection &selection, bool has_material) const {
    json object = {{"name", "model"}, {is_gltf_ ? "gltf" : "mesh", absolute_}};
    if (is_gltf_)
        object["unit"] = "m";
    if (!selection.animation.empty())
        object["animation"] = selection.animation;
    if (!selection.variant.empty())
        object["variant"] = selection.variant;
    json scene = {
        {"version", 2}, {"axes", *options_.is_z_up && !is_gltf_ ? "z-up" : "y-up"}, {"materials", json::object()}};
    if (has_material) {
        object["material"] = "plain";
        scene["materials"]["plain"] = {
            {"model", "metallic-roughness"}, {"colour", 0.8}, {"metallic", 0}, {"roughness", 0.6}};
    }
    scene["objects"] = {object};
    if (!options_.environment.empty())
        scene["environment"] = {{"image", fs::absolute(options_.environment)}};
    return scene.dump(); // YAML contains JSON
}

Content Loader::load(const Selection &selection) {
    if (!is_model_ && !(selection == Selection{}))
        throw InvalidInput("--animation and --variant choose those of a glTF file; a scene file has keys for them");
    if (!is_gltf_ && !(selection == Selection{}))
        throw InvalidInput(options_.file.string() + ": only glTF files have animations and variants");
    const bool is_obj = extension_of(options_.file) == ".obj";
    if (!is_obj)
        return load_text(is_model_ ? scene_text(selection, !is_gltf_) : "");
    try {
        return load_text(scene_text(selection, false));
    } catch (const InvalidInput &error) {
        Content content = load_text(scene_text(selection, true)); // fails if the mesh is the reason
        const std::string why = error.what();
        content.messages.push_back((why.find("has no materials") == std::string::npos ? why : "has no materials") +
                                   "; shown with a plain one");
        return content;
    }
}

void Loader::check_reads(const fs::path &path, const std::string &node) const {
    if (options_.output.empty())
        return;
    const auto [output_path, output_node] = base::identity_of(options_.output);
    if (path == output_path || node == output_node)
        throw InvalidInput(options_.output.string() + ": the scene reads this file; choose another output file");
}

// Replaces the place in the scene file that the user has not written, and the absolute path.
std::string Loader::readable(std::string text) const {
    if (!is_model_)
        return text;
    const std::string place = absolute_ + ":1:";
    if (const std::size_t end = text.starts_with(place) ? text.find(": ", text.find(": ") + 1) : std::string::npos;
        end != std::string::npos)
        text.erase(0, end + 2);
    for (std::size_t at = 0; (at = text.find(absolute_, at)) != std::string::npos;) {
        text.replace(at, absolute_.size(), options_.file.string());
        at += options_.file.string().size();
    }
    return text.starts_with(options_.file.string()) ? text : options_.file.string() + ": " + text;
}

Content Loader::load_text(const std::string &text) {
    Content content;
    std::string failure;
    std::exception_ptr rejected;
    messages_.clear();
    const auto on_message = [&](const ipc::Message &message) {
        if (ipc::is<messages::Listed>(message))
            add(content.contents, ipc::parse<messages::Listed>(message));
        if (!ipc::is<messages::Reads>(message) || rejected)
            return;
        const auto reads = ipc::parse<messages::Reads>(message);
        try {
            check_reads(reads.path, reads.node);
        } catch (const InvalidInput &) {
            rejected = std::current_exception();
        }
    };
    messages::Load load{absolute_};
    load.content = text;
    load.lists_contents = true;
    ipc::SharedMemory memory;
    {
        supervise::Loading loading(context_, {absolute_, "scene", "scene loader"}, load,
                                   supervise::policy_of_scene_loader(sandbox::Mode::standard),
                                   {on_message,
                                    [&](ipc::SharedMemory loaded, std::span<const std::byte> bytes) {
                                        failure = scene::validate(bytes);
                                        memory = std::move(loaded);
                                    },
                                    [&](const std::string &reason) { failure = reason; }});
        while (failure.empty() && !memory && !rejected) {
            reactor_.run_once();
            throw_if_interrupted();
        }
    }
    if (rejected)
        std::rethrow_exception(rejected);
    if (!failure.empty())
        throw InvalidInput(readable(failure));
    content.arena = memory.map(ipc::Access::read_only);
    for (const std::string &message : messages_)
        if (!is_model_ || !is_repeated(message))
            content.messages.push_back(readable(message));
    return content;
}

} // namespace arhost::view
