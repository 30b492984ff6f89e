// SPDX-License-Identifier: Apache-2.0
//
// Tests very large scenes: ten million triangles, and the largest texture.
#include "rich_scene.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

namespace arhost::test {
namespace {

double available_gib() {
    std::ifstream info("/proc/meminfo");
    double kib = 0;
    for (std::string key; info >> key && key != "MemAvailable:";)
        info.ignore(64, '\n');
    info >> kib;
    return kib / (1024 * 1024);
}

} // namespace

TEST(Huge, TracesTenMillionTriangles) {
    if (available_gib() < 6)
        GTEST_SKIP() << "needs 6 GiB of memory";
    constexpr unsigned n = 2237; // squares per side of the sheet
    scene::TriangleMesh mesh;
    mesh.positions.reserve((n + 1) * (n + 1));
    mesh.triangles.reserve(2 * n * n);
    for (unsigned y = 0; y <= n; ++y)
        for (unsigned x = 0; x <= n; ++x) {
            const float u = static_cast<float>(x) / n - 0.5f, v = static_cast<float>(y) / n - 0.5f;
            mesh.positions.push_back({100 * u, 100 * v, 2 * std::sin(40 * u) * std::sin(40 * v)});
            if (x < n && y < n) {
                const unsigned a = y * (n + 1) + x, b = a + n + 1;
                mesh.triangles.push_back({a, a + 1, b});
                mesh.triangles.push_back({a + 1, b + 1, b});
            }
        }
    ASSERT_GT(mesh.triangles.size(), 10'000'000u);
    SceneBuilder builder({.ambient = glm::vec3(1)});
    builder.add_mesh("sheet", mesh, flat(0.5f, 0.5f, 0.5f));
    // A triangle is a twentieth of a pixel wide. Without `robust`, one ray in a few hundred passes between two
    // adjacent triangles.
    const Picture picture = Tracer(std::move(builder), {{"robust", "true"}}).render(from_above());
    int inside = 0;
    for (int y = 30; y < 120; ++y)
        for (int x = 55; x < 145; ++x)
            inside += picture.at(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y)) ==
                      Pixel{shading::srgb8_exact(0.5), shading::srgb8_exact(0.5), shading::srgb8_exact(0.5), 255};
    EXPECT_EQ(inside, 90 * 90) << "the sheet has no holes";
    EXPECT_EQ(picture.alpha(5, 5), 0);
}

TEST(Huge, SamplesTheLastRowsOfA16384By16384Texture) {
    if (available_gib() < 4)
        GTEST_SKIP() << "needs 4 GiB of memory";
    constexpr std::uint32_t side = 16384;
    scene::TexelImage texture;
    texture.width = texture.height = side;
    texture.format = ARHOST_TEXEL_RGBA8;
    texture.texels.size = std::size_t{4} * side * side;
    texture.texels.bytes = std::make_unique<std::byte[]>(texture.texels.size); // black, alpha 0
    // The last quarter of each of the last 2000 rows is white. These texels are at byte offsets beyond 2^29.
    for (std::size_t y = side - 2000; y < side; ++y)
        std::memset(texture.texels.bytes.get() + 4 * (y * side + 3 * side / 4), 0xff, side);
    SceneBuilder builder({.ambient = glm::vec3(1)});
    arhost_material material = flat(1, 1, 1);
    material.colour_texture =
        builder.add_texture("map", std::move(texture), {.wrap_u = ARHOST_WRAP_CLAMP, .wrap_v = ARHOST_WRAP_CLAMP});
    builder.add_mesh("sheet", textured_square(50, 0), material);
    const Picture picture = Tracer(std::move(builder)).render(from_above());
    EXPECT_EQ(picture.at(140, 120)[0], 255) << "the white area is at the bottom right";
    EXPECT_EQ(picture.at(110, 120)[0], 0);
    EXPECT_EQ(picture.at(140, 60)[0], 0);
}

} // namespace arhost::test
