// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh_loader.hpp"

#include "scene/mesh_file.hpp"
#include "scene/obj.hpp"
#include "scene/ply.hpp"
#include "scene/stl.hpp"

#include <algorithm>
#include <cctype>

namespace arhost::scene {
namespace {

enum class Kind { Obj, Ply, Stl };

// "dragon.PLY.gz" → ".ply"
std::string extension_of(std::filesystem::path file) {
    const auto lower = [](std::string text) {
        std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
        return text;
    };
    if (lower(file.extension().string()) == ".gz")
        file = file.stem();
    return lower(file.extension().string());
}

// Returns a command that converts `file` to glTF, or "" if none is known.
std::string converter(const std::filesystem::path &file, const std::string &extension) {
    const auto is_one_of = [&](std::initializer_list<std::string_view> extensions) {
        return std::ranges::find(extensions, extension) != extensions.end();
    };
    // Users paste the command into a shell.
    const auto is_plain = [](unsigned char c) { return std::isalnum(c) != 0 || c == '.' || c == '_' || c == '-'; };
    const std::string base = file.filename().string();
    const bool is_safe = std::ranges::all_of(base, is_plain) && !base.starts_with('-');
    const std::string name = "'" + (is_safe ? base : "FILE" + extension) + "'",
                      result = "'" + (is_safe ? file.stem().string() : "FILE") + ".glb'";
    const std::string write = "bpy.ops.export_scene.gltf(filepath=" + result + ")\"";
    if (extension == ".blend")
        return "blender --background " + name + " --python-expr \"import bpy; " + write;
    if (is_one_of({".usd", ".usda", ".usdc", ".usdz"}))
        return "blender --background --python-expr \"import bpy; bpy.ops.wm.read_factory_settings(use_empty=True); "
               "bpy.ops.wm.usd_import(filepath=" +
               name + "); " + write;
    if (is_one_of({".3mf", ".dae", ".fbx", ".x3d"}))
        return "assimp export " + name + " " + result + " -fglb2";
    return "";
}

Kind kind_of(const std::filesystem::path &file) {
    const std::string extension = extension_of(file);
    if (extension == ".obj")
        return Kind::Obj;
    if (extension == ".ply")
        return Kind::Ply;
    if (extension == ".stl")
        return Kind::Stl;
    if (extension == ".gltf" || extension == ".glb")
        throw MeshError(file.string() + ": is a glTF file; name it with the key 'gltf' instead of 'mesh'");
    if (const std::string command = converter(file, extension); !command.empty())
        throw MeshError(file.string() + ": the format '" + extension + "' is unsupported; convert the file with `" +
                        command + "`, and name the result with the key 'gltf' instead of 'mesh'");
    throw MeshError(
        file.string() + ": " +
        (extension.empty() ? "the file name has no extension" : "the format '" + extension + "' is unsupported") +
        "; convert the mesh to .obj, .ply or .stl (optionally compressed: .obj.gz, .ply.gz, .stl.gz)");
}

void check_content(const MeshFile &file, Kind kind) {
    const std::string_view content = file.view();
    if (content.empty())
        file.fail("is empty");
    const bool is_ply = content.starts_with("ply\n") || content.starts_with("ply\r");
    if (kind != Kind::Ply && is_ply)
        file.fail(std::string("has the extension ") + (kind == Kind::Obj ? ".obj" : ".stl") +
                  " but contains a PLY mesh; rename it to .ply");
    if (kind == Kind::Stl)
        return;
    if (content.starts_with("\xfe\xff") || content.starts_with("\xff\xfe"))
        file.fail("is UTF-16 text; save it as UTF-8 or ASCII");
    if (kind == Kind::Ply && !is_ply)
        file.fail_line(file.begin(), "the first line must be 'ply'");
}

} // namespace

MeshWithMaterials load_mesh_with_materials(const std::filesystem::path &file, const MeshOptions &options,
                                           const LoadCallbacks &callbacks) {
    const Kind kind = kind_of(file);
    const Reporter reporter(callbacks, file.filename().string());
    MeshWithMaterials loaded;
    {
        MeshFile content = MeshFile::read(file, options.byte_limit, reporter);
        check_content(content, kind);
        if (kind == Kind::Obj)
            loaded = parse_obj(content, reporter);
        else
            loaded.mesh = kind == Kind::Ply ? parse_ply(content, reporter) : parse_stl(content, reporter);
    }
    for (glm::vec2 &texcoord : loaded.mesh.texcoords) // in OBJ and PLY, v = 0 is the bottom of the texture
        texcoord.y = 1 - texcoord.y;
    complete_normals(loaded.mesh, options.smooth);
    return loaded;
}

TriangleMesh load_mesh(const std::filesystem::path &file, const MeshOptions &options,
                       const LoadCallbacks &callbacks) {
    MeshWithMaterials loaded = load_mesh_with_materials(file, options, callbacks);
    if (callbacks.info && (!loaded.uses.libraries.empty() || !loaded.uses.names.empty()))
        callbacks.info(file.string() + ": the MTL materials are ignored; the scene file defines the materials");
    return std::move(loaded.mesh);
}

} // namespace arhost::scene
