// SPDX-License-Identifier: Apache-2.0
//
// Provides tests of ray tracers with scenes, cameras and the plugin under test.
#pragma once

#include "plugin_under_test.hpp"
#include "scene/arena_builder.hpp"
#include "scene/motion.hpp"

#include <arhost/shading/srgb8.hpp>

#include <glm/vec3.hpp>
#include <sys/mman.h>

#include <array>
#include <cstring>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace arhost::test {

using Options = std::map<std::string, std::string>;
using Pixel = std::array<int, 4>;

inline arhost_intrinsics pinhole(std::uint32_t width = 200, std::uint32_t height = 150, double focal = 200) {
    return {.struct_size = sizeof(arhost_intrinsics),
            .width = width,
            .height = height,
            .distortion = ARHOST_DISTORTION_NONE,
            .fx = focal,
            .fy = focal,
            .cx = (width - 1) / 2.0,
            .cy = (height - 1) / 2.0,
            .coefficient_count = 0,
            .reserved = 0,
            .coefficients = {},
            .reserved_for_growth = {}};
}
inline arhost_intrinsics with_lens(arhost_intrinsics in, arhost_distortion distortion,
                                   const std::vector<double> &coefficients) {
    in.distortion = distortion;
    in.coefficient_count = static_cast<std::uint32_t>(coefficients.size());
    std::ranges::copy(coefficients, in.coefficients);
    return in;
}

inline arhost_camera camera(std::array<double, 3> eye, std::array<double, 3> look_at, std::array<double, 3> up,
                            const arhost_intrinsics &intrinsics = pinhole()) {
    arhost_camera c{sizeof c, 0, {}, {}, {}, intrinsics, {}};
    std::copy(eye.begin(), eye.end(), c.eye);
    std::copy(look_at.begin(), look_at.end(), c.look_at);
    std::copy(up.begin(), up.end(), c.up);
    return c;
}

// Whether the padding of an image's rows and the guard bytes around it still have the value 0xa5.
inline bool only_rows_written(const GuardedBuffer &buffer, std::uint32_t row_bytes, std::uint32_t stride,
                              std::uint32_t height) {
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t i = row_bytes; i < stride; ++i)
            if (buffer.data()[std::size_t{stride} * y + i] != 0xa5)
                return false;
    return buffer.intact();
}

// An image with row padding and guard bytes, which the plugin must not write.
class Picture {
public:
    explicit Picture(const arhost_intrinsics &in)
        : width(in.width), height(in.height), stride_((4 * width + 63) / 64 * 64 + 64),
          buffer_(std::size_t{stride_} * height) {}

    arhost_image image() { return {sizeof(arhost_image), stride_, width, height, buffer_.data(), nullptr, nullptr}; }
    Pixel at(std::uint32_t x, std::uint32_t y) const {
        const std::uint8_t *p = buffer_.data() + std::size_t{stride_} * y + 4 * x;
        return {p[0], p[1], p[2], p[3]};
    }
    int alpha(std::uint32_t x, std::uint32_t y) const { return at(x, y)[3]; }
    std::vector<Pixel> pixels() const {
        std::vector<Pixel> all;
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                all.push_back(at(x, y));
        return all;
    }
    // Returns the number of pixels for each alpha.
    std::map<int, int> alphas() const {
        std::map<int, int> counts;
        for (const Pixel &pixel : pixels())
            ++counts[pixel[3]];
        return counts;
    }
    // Returns the bounding box of the pixels whose alpha is not 0: the first column and row, and those beyond the
    // last.
    std::array<std::uint32_t, 4> bounds() const {
        std::uint32_t x0 = width, y0 = height, x1 = 0, y1 = 0;
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                if (alpha(x, y)) {
                    x0 = std::min(x0, x), x1 = std::max(x1, x + 1);
                    y0 = std::min(y0, y), y1 = std::max(y1, y + 1);
                }
        return {x0, y0, x1, y1};
    }
    bool only_pixels_written() const { return only_rows_written(buffer_, 4 * width, stride_, height); }

    std::uint32_t width, height;
    arhost_render_info info{sizeof(arhost_render_info), 0, 0, 0, 0, 0, 0, 0, 0};

private:
    std::uint32_t stride_;
    GuardedBuffer buffer_;
};

class SceneBuilder : public scene::ArenaBuilder {
public:
    explicit SceneBuilder(const scene::Settings &with = {}) { settings = with; }

    // Add an object with a geometry and a material of its own.
    void add_mesh(const std::string &name, scene::TriangleMesh mesh, const arhost_material &material,
                  arhost_role role = ARHOST_ROLE_VIRTUAL, const glm::mat4x3 &world_from_object = glm::mat4x3(1),
                  const scene::Motion &motion = {}) {
        add_object(name, add_triangles(std::move(mesh)), add_material(material), role, world_from_object, motion);
    }
    void add_ball(const std::string &name, const glm::vec4 &sphere, const arhost_material &material) {
        add_object(name, add_spheres({sphere}), add_material(material));
    }
    void add_animated(const std::string &name, scene::TriangleMesh mesh, const arhost_material &material,
                      const scene::Motion &motion) {
        add_mesh(name, std::move(mesh), material, ARHOST_ROLE_VIRTUAL, glm::mat4x3(1), motion);
    }
    // Adds a node that moves from the first position to the last within a second.
    std::uint32_t add_moving_node(const glm::vec3 &from, const glm::vec3 &to) {
        const std::uint32_t node = add_node({.animated = true, .morph_weights = {}});
        add_channel({.node = node, .times = {0, 1}, .values = {from.x, from.y, from.z, to.x, to.y, to.z}});
        return node;
    }
    // Adds a node that morphs its mesh from the first shape to the last within `duration_s`.
    std::uint32_t add_morphing_node(float duration_s = 1) {
        const std::uint32_t node = add_node({.animated = true, .morph_weights = {0}});
        add_channel(
            {.node = node, .target = ARHOST_CHANNEL_MORPH_WEIGHTS, .times = {0, duration_s}, .values = {0, 1}});
        return node;
    }
};

// A plugin and its scene. The scene's arena is in read-only memory, so a plugin that writes to it crashes. Unless the
// options say otherwise, images have one sample per pixel and are not denoised.
class Tracer {
public:
    explicit Tracer(scene::ArenaBuilder builder, const Options &options = {}, const std::string &plugin = "rt_embree")
        : plugin_(plugin), size_(builder.byte_size()) {
        memory_ = mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        std::move(builder).write({static_cast<std::byte *>(memory_), size_});
        EXPECT_EQ(scene::validate({static_cast<std::byte *>(memory_), size_}), "");
        mprotect(memory_, size_, PROT_READ);
        Options all{{"quality", "reference"}, {"samples", "1"}};
        for (const auto &[key, value] : options)
            all[key] = value;
        EXPECT_EQ(plugin_.create(all), ARHOST_STATUS_OK) << plugin_.log();
    }
    ~Tracer() {
        stop();
        plugin_.destroy();
        munmap(memory_, size_);
    }
    Tracer(const Tracer &) = delete;
    Tracer &operator=(const Tracer &) = delete;

    arhost_status start(const arhost_intrinsics &in) {
        stop();
        const arhost_raytracer_setup setup{
            sizeof setup, in.width, in.height, ARHOST_IMAGE_FORM_STRAIGHT, &scene(), &in, ARHOST_COMPOSITING_SRGB, 0,
            nullptr};
        const arhost_status status = functions().start(plugin_.instance(), &setup);
        started_ = status == ARHOST_STATUS_OK;
        return status;
    }
    arhost_status try_render(const arhost_camera &camera, Picture &picture, const arhost_motion *motion = nullptr) {
        const arhost_render_request request{sizeof request, 0,       0, 0,       camera, motion, nullptr,
                                            nullptr,        nullptr, 0, nullptr, 0,      0};
        const arhost_image image = picture.image();
        return functions().render(plugin_.instance(), &request, &image, &picture.info);
    }
    Picture render(const arhost_camera &camera) {
        EXPECT_EQ(start(camera.intrinsics), ARHOST_STATUS_OK) << plugin_.log();
        return render_next(camera);
    }
    // Renders without starting the plugin again.
    Picture render_next(const arhost_camera &camera) {
        Picture picture(camera.intrinsics);
        EXPECT_EQ(try_render(camera, picture), ARHOST_STATUS_OK) << plugin_.log();
        EXPECT_TRUE(picture.only_pixels_written());
        return picture;
    }

    arhost_status try_render_at(double time_s, const arhost_camera &camera, Picture &picture) {
        if (!motion_)
            motion_.emplace(scene());
        const arhost_motion motion = motion_->at(time_s);
        return try_render(camera, picture, &motion);
    }
    // Renders the animated scene at this time, without starting the plugin again.
    Picture render_at(double time_s, const arhost_camera &camera) {
        Picture picture(camera.intrinsics);
        EXPECT_EQ(try_render_at(time_s, camera, picture), ARHOST_STATUS_OK) << plugin_.log();
        EXPECT_TRUE(picture.only_pixels_written());
        return picture;
    }

    PluginUnderTest &plugin() { return plugin_; }
    std::string log() const { return plugin_.log(); }
    const arhost_scene &scene() const { return *static_cast<const arhost_scene *>(memory_); }

private:
    void stop() {
        if (started_)
            functions().stop(plugin_.instance());
        started_ = false;
    }
    const arhost_raytracer &functions() const { return plugin_.functions<arhost_raytracer>(); }

    PluginUnderTest plugin_;
    std::size_t size_;
    void *memory_;
    std::optional<scene::MotionEvaluator> motion_;
    bool started_ = false;
};

inline void set3(float (&to)[3], float x, float y, float z) {
    to[0] = x;
    to[1] = y;
    to[2] = z;
}
inline arhost_material flat(float r, float g,
                            float b) { // constant colour if the scene has no lights and its ambient light is 1
    arhost_material material = scene::make_material(ARHOST_MATERIAL_DIFFUSE);
    set3(material.ambient, r, g, b);
    return material;
}
inline arhost_material diffuse(float r, float g, float b) {
    arhost_material material = flat(r, g, b);
    set3(material.diffuse, r, g, b);
    return material;
}
inline arhost_material shiny(float diffuse_grey, float specular, float exponent) {
    arhost_material material = scene::make_material(ARHOST_MATERIAL_SPECULAR);
    set3(material.diffuse, diffuse_grey, diffuse_grey, diffuse_grey);
    set3(material.specular, specular, specular, specular);
    material.exponent = exponent;
    return material;
}
inline arhost_material glass_of(float index = 1.5f, float roughness = 0) {
    arhost_material material = scene::make_material(ARHOST_MATERIAL_GLASS);
    material.index = index;
    material.roughness = roughness;
    return material;
}
inline arhost_material metallic_roughness(const glm::vec3 &colour, float metallic, float roughness) {
    arhost_material material = scene::make_material(ARHOST_MATERIAL_METALLIC_ROUGHNESS);
    set3(material.diffuse, colour.r, colour.g, colour.b);
    material.metallic = metallic;
    material.roughness = roughness;
    return material;
}
inline arhost_material mirror(float reflectivity) {
    arhost_material material = scene::make_material(ARHOST_MATERIAL_MIRROR);
    set3(material.reflectivity, reflectivity, reflectivity, reflectivity);
    return material;
}
// Returns a directional light.
inline arhost_light sun(float x = 0, float y = 0, float z = -1) {
    arhost_light light = scene::make_light(ARHOST_LIGHT_DIRECTIONAL);
    set3(light.direction, x, y, z);
    return light;
}
inline arhost_light placed(arhost_light_type type, const glm::vec3 &position, float intensity,
                           arhost_falloff falloff = ARHOST_FALLOFF_NONE) {
    arhost_light light = scene::make_light(type);
    light.falloff = falloff;
    set3(light.position, position.x, position.y, position.z);
    set3(light.intensity, intensity, intensity, intensity);
    return light;
}
inline arhost_light light(float x, float y, float z, float intensity, arhost_falloff falloff = ARHOST_FALLOFF_NONE) {
    return placed(ARHOST_LIGHT_POINT, {x, y, z}, intensity, falloff);
}
inline arhost_light bulb(const glm::vec3 &position, float radius, float intensity = 1,
                         arhost_falloff falloff = ARHOST_FALLOFF_NONE) {
    arhost_light light = placed(ARHOST_LIGHT_SPHERE, position, intensity, falloff);
    light.radius = radius;
    return light;
}
// Returns a horizontal rectangle that shines downwards.
inline arhost_light panel(const glm::vec3 &position, const glm::vec2 &half_sides, float intensity,
                          arhost_falloff falloff = ARHOST_FALLOFF_NONE) {
    arhost_light light = placed(ARHOST_LIGHT_RECTANGLE, position, intensity, falloff);
    set3(light.axis_u, half_sides.x, 0, 0);
    set3(light.axis_v, 0, half_sides.y, 0);
    return light;
}
inline scene::TriangleMesh quad(const glm::vec3 &a, const glm::vec3 &b, const glm::vec3 &c, const glm::vec3 &d) {
    return {{a, b, c, d}, {}, {}, {{0, 1, 2}, {0, 2, 3}}};
}
// Returns a square at the height `z`; its front face is up.
inline scene::TriangleMesh square(float half_side, float z = 0) {
    const float s = half_side;
    return quad({-s, -s, z}, {s, -s, z}, {s, s, z}, {-s, s, z});
}
inline scene::TriangleMesh cube(float half_side) {
    scene::TriangleMesh mesh;
    for (int corner = 0; corner < 8; ++corner)
        mesh.positions.push_back({corner & 1 ? half_side : -half_side, corner & 2 ? half_side : -half_side,
                                  corner & 4 ? half_side : -half_side});
    mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                      {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    return mesh;
}

inline scene::TriangleMesh moved(scene::TriangleMesh mesh, const glm::vec3 &by) {
    for (glm::vec3 &position : mesh.positions)
        position += by;
    return mesh;
}

// Returns a camera that looks obliquely down at the origin.
inline arhost_camera from_the_side(const arhost_intrinsics &in = pinhole()) {
    return camera({0, -150, 110}, {0, 0, 0}, {0, 0, 1}, in);
}
// from_above() returns a camera 200 mm above the plane z = 0 that looks straight down. on_the_floor() returns the
// point of that plane which a pixel of this camera shows.
inline arhost_camera from_above() {
    return camera({0, 0, 200}, {0, 0, 0}, {0, 1, 0});
}
inline glm::dvec3 on_the_floor(int x, int y) {
    return {x - 99.5, -(y - 74.5), 0};
}

// Whether `code` is the sRGB code of a value within the relative error `tolerance` of `linear`.
inline ::testing::AssertionResult is_code_of(int code, double linear, double tolerance = 2e-5) {
    const int low = shading::srgb8_exact(linear * (1 - tolerance)),
              high = shading::srgb8_exact(linear * (1 + tolerance));
    if (code >= low && code <= high)
        return ::testing::AssertionSuccess();
    return ::testing::AssertionFailure()
           << "code " << code << ", but the linear value " << linear << " has the code " << low;
}

} // namespace arhost::test
