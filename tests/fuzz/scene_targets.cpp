// SPDX-License-Identifier: Apache-2.0
//
// Targets for the input of the scene loader, and for its output, which the host reads.
#include "../core/scene/scene_samples.hpp"
#include "input.hpp"
#include "targets.hpp"

#include "scene/gltf/gltf.hpp"
#include "scene/image.hpp"
#include "scene/mesh_loader.hpp"
#include "scene/motion.hpp"
#include "scene/scene_loader.hpp"

#include <stdexcept>

namespace arhost::fuzz {
namespace {

using namespace scene;

constexpr std::size_t arena_size_limit = std::size_t(64) << 20;

// Uses an arena like a ray tracer: if `validate` accepts it, reads it without further checks.
void use(std::span<const std::byte> arena) {
    const auto &header = *reinterpret_cast<const arhost_scene *>(arena.data());
    MotionEvaluator evaluator(header);
    for (const double time_s : {0.0, 0.7, 1e9, -3.0})
        evaluator.at(time_s);
}

void check(ArenaBuilder builder) {
    if (builder.byte_size() > arena_size_limit)
        return;
    const Arena arena = std::move(builder).build();
    if (validate(arena.bytes()).empty())
        use(arena.bytes());
}

void load(Bytes bytes, const char *name) {
    try {
        MeshOptions options;
        options.byte_limit = std::uint64_t(16) << 20;
        ArenaBuilder builder;
        const std::uint32_t material = builder.add_material(make_material(ARHOST_MATERIAL_DIFFUSE));
        const MeshWithMaterials loaded = load_mesh_with_materials(write_scratch(name, bytes), options);
        std::vector<std::size_t> parts(loaded.mesh.triangles.size());
        for (const MaterialUses::Run &run : loaded.uses.runs)
            std::fill(parts.begin() + static_cast<std::ptrdiff_t>(run.first_triangle), parts.end(), run.name);
        for (TriangleMesh &mesh : split(loaded.mesh, parts, loaded.uses.names.size() + 1))
            if (!mesh.triangles.empty())
                builder.add_object("mesh", builder.add_triangles(std::move(mesh)), material);
        check(std::move(builder));
    } catch (const MeshError &) {
    }
}

} // namespace

void run_obj(Bytes bytes) {
    load(bytes, "mesh.obj");
}

void run_ply(Bytes bytes) {
    load(bytes, "mesh.ply");
}

void run_stl(Bytes bytes) {
    load(bytes, "mesh.stl");
}

void run_mtl(Bytes bytes) {
    constexpr std::string_view triangle =
        "mtllib mesh.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\n";
    constexpr std::string_view image = "P5\n2 1\n255\n\1\200";
    const auto as_bytes = [](std::string_view text) {
        return Bytes(reinterpret_cast<const std::uint8_t *>(text.data()), text.size());
    };
    [[maybe_unused]] static const auto mesh = write_scratch("textured.obj", as_bytes(triangle));
    [[maybe_unused]] static const auto texture = write_scratch("t.pgm", as_bytes(image));
    write_scratch("mesh.mtl", bytes);
    try {
        check(load_scene(yaml::Node::parse("version: 1\naxes: y-up\nmaterials: {}\nobjects: [{mesh: textured.obj}]\n",
                                           (scratch() / "scene.yaml").string())));
    } catch (const yaml::Error &) {
    }
}

void run_gltf(Bytes bytes) {
    const bool binary = bytes.size() > 4 && std::memcmp(bytes.data(), "glTF", 4) == 0;
    try {
        GltfPlacement placement;
        placement.name = "gltf";
        placement.animations = {"all"};
        const auto file = write_scratch(binary ? "model.glb" : "model.gltf", bytes);
        const auto load = [&] {
            ArenaBuilder builder;
            const LoadCallbacks callbacks;
            Textures textures(builder, callbacks);
            builder.settings.duration_s = add_gltf(builder, textures, file, placement, callbacks);
            check(std::move(builder));
        };
        try {
            load();
        } catch (const AnimationError &) {
            placement.animations.clear();
            load();
        }
    } catch (const MeshError &) {
    } catch (const ImageError &) {
    }
}

namespace {

// Loads a .glb whose binary chunk is `bytes`.
void load_glb(const std::string &json, Bytes bytes) {
    const auto number = [](std::size_t value) {
        const auto v = static_cast<std::uint32_t>(value);
        return std::string(reinterpret_cast<const char *>(&v), sizeof v);
    };
    const std::string chunk = json + std::string(3 - (json.size() + 3) % 4, ' ');
    const std::string file = "glTF" + number(2) + number(28 + chunk.size() + bytes.size()) + number(chunk.size()) +
                             "JSON" + chunk + number(bytes.size()) + std::string("BIN\0", 4) +
                             std::string(bytes.begin(), bytes.end());
    run_gltf({reinterpret_cast<const std::uint8_t *>(file.data()), file.size()});
}

} // namespace

void run_draco(Bytes bytes) {
    const std::string size = std::to_string(bytes.size());
    load_glb(
        R"({"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "buffers": [{"byteLength": )" + size +
            R"(}], "bufferViews": [{"buffer": 0, "byteLength": )" + size +
            R"(}], "accessors": [{"componentType": 5126, "count": 3, "type": "VEC3"}], "meshes": [{"primitives": [{
                 "attributes": {"POSITION": 0, "COLOR_0": 0}, "extensions": {"KHR_draco_mesh_compression": {
                 "bufferView": 0, "attributes": {"POSITION": 0, "COLOR_0": 1}}}}]}]})",
        bytes);
}

void run_meshopt(Bytes bytes) {
    Input input(bytes);
    constexpr const char *modes[] = {"ATTRIBUTES", "TRIANGLES", "INDICES"},
                         *filters[] = {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL"};
    const std::string mode = modes[input.number() % 3], filter = filters[input.number() % 4],
                      stride = std::to_string(input.number()), count = std::to_string(input.number<std::uint16_t>());
    const Bytes rest = input.take(bytes.size());
    const std::string size = std::to_string(rest.size());
    load_glb(R"({"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "buffers": [{"byteLength": )" + size +
                 R"(}], "bufferViews": [{"buffer": 0, "byteLength": )" +
                 std::to_string(std::stoul(stride) * std::stoul(count)) +
                 R"(, "extensions": {"EXT_meshopt_compression": {"buffer": 0, "byteLength": )" + size +
                 R"(, "mode": ")" + mode + R"(", "filter": ")" + filter + R"(", "byteStride": )" + stride +
                 R"(, "count": )" + count +
                 R"(}}}], "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
                 "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]})",
             rest);
}

void run_webp(Bytes bytes) {
    if (bytes.empty()) // read_image would read a file
        return;
    const std::string start("RIFF\0\0\0\0WEBP", 12);
    std::vector<unsigned char> content(bytes.begin(), bytes.end());
    content.resize(std::max(content.size(), start.size()));
    std::copy_n(start.begin(), 4, content.begin()); // no other decoder
    std::copy_n(start.begin() + 8, 4, content.begin() + 8);
    const LoadCallbacks callbacks;
    ImageBudget budget(1 << 20); // larger images take seconds
    try {
        read_image("image.webp", content, Reporter(callbacks, "image.webp"), budget);
    } catch (const ImageError &) {
    }
}

void run_scene(Bytes bytes) {
    constexpr std::string_view triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    [[maybe_unused]] static const auto mesh =
        write_scratch("triangle.obj", {reinterpret_cast<const std::uint8_t *>(triangle.data()), triangle.size()});
    try {
        check(load_scene(yaml::Node::parse({bytes.begin(), bytes.end()}, (scratch() / "scene.yaml").string())));
    } catch (const yaml::Error &) {
    }
}

// The first byte selects the mode: raw bytes, or a valid arena with some ranges overwritten.
void run_arena(Bytes bytes) {
    Input input(bytes);
    if (input.number() == 0) {
        const auto raw = input.take(bytes.size());
        const std::unique_ptr<std::byte, decltype(&std::free)> exact(
            static_cast<std::byte *>(std::aligned_alloc(64, (raw.size() + 63) / 64 * 64)), &std::free);
        std::copy(raw.begin(), raw.end(), reinterpret_cast<std::uint8_t *>(exact.get()));
        if (const std::span<const std::byte> arena(exact.get(), raw.size()); validate(arena).empty())
            use(arena);
        return;
    }
    Arena arena = scene::test::full_scene().build();
    input.corrupt(arena.bytes());
    if (validate(arena.bytes()).empty())
        use(arena.bytes());
}

} // namespace arhost::fuzz
