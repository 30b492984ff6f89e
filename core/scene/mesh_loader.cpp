// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh_loader.hpp"

#include "scene/mesh_file.hpp"
#include "scene/obj.hpp"
#include "scene/ply.hpp"

#include <algorithm>
#include <cctype>

namespace arhost::scene {
namespace {

enum class Kind { Obj, Ply };

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

Kind kind_of(const std::filesystem::path &file) {
    const std::string extension = extension_of(file);
    if (extension == ".obj")
        return Kind::Obj;
    if (extension == ".ply")
        return Kind::Ply;
    if (extension == ".gltf" || extension == ".glb")
        throw MeshError(file.string() + ": is a glTF file; name it with the key 'gltf' instead of 'mesh'");
    throw MeshError(
        file.string() + ": " +
        (extension.empty() ? "the file name has no extension" : "the format '" + extension + "' is unsupported") +
        "; convert the mesh to .obj or .ply (optionally compressed: .obj.gz, .ply.gz)");
}

void check_content(const MeshFile &file, Kind kind) {
    const std::string_view content = file.view();
    if (content.empty())
        file.fail("is empty");
    if (content.starts_with("\xfe\xff") || content.starts_with("\xff\xfe"))
        file.fail("is UTF-16 text; save it as UTF-8 or ASCII");
    const bool is_ply = content.starts_with("ply\n") || content.starts_with("ply\r");
    if (kind == Kind::Ply && !is_ply)
        file.fail_line(file.begin(), "the first line must be 'ply'");
    if (kind == Kind::Obj && is_ply)
        file.fail("has the extension .obj but contains a PLY mesh; rename it to .ply");
}

} // namespace

TriangleMesh load_mesh(const std::filesystem::path &file, const MeshOptions &options,
                       const LoadCallbacks &callbacks) {
    const Kind kind = kind_of(file);
    const Reporter reporter(callbacks, file.filename().string());
    TriangleMesh mesh;
    {
        MeshFile content = MeshFile::read(file, options.byte_limit, reporter);
        check_content(content, kind);
        mesh = kind == Kind::Obj ? parse_obj(content, reporter) : parse_ply(content, reporter);
    }
    for (glm::vec2 &texcoord : mesh.texcoords) // in OBJ and PLY, v = 0 is the bottom of the texture
        texcoord.y = 1 - texcoord.y;
    complete_normals(mesh, options.smooth);
    return mesh;
}

} // namespace arhost::scene
