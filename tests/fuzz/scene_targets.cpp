// SPDX-License-Identifier: Apache-2.0
//
// Targets for the input of the scene loader, and for its output, which the host reads.
#include "../core/scene/scene_samples.hpp"
#include "input.hpp"
#include "targets.hpp"

#include "scene/gltf/gltf.hpp"
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
        ArenaBuilder builder;
        const LoadCallbacks callbacks;
        Textures textures(builder, callbacks);
        GltfPlacement placement;
        placement.name = "gltf";
        placement.animations = {"all"};
        const auto file = write_scratch(binary ? "model.glb" : "model.gltf", bytes);
        try {
            builder.settings.duration_s = add_gltf(builder, textures, file, placement, callbacks);
        } catch (const AnimationError &) {
            placement.animations.clear();
            builder = ArenaBuilder();
            add_gltf(builder, textures, file, placement, callbacks);
        }
        check(std::move(builder));
    } catch (const MeshError &) {
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
