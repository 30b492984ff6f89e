// SPDX-License-Identifier: Apache-2.0
//
// Builds small glTF files, and loads them as a scene.
#pragma once

#include "errors.hpp"
#include "plugin_under_test.hpp"
#include "scene/scene_loader.hpp"
#include "scene_samples.hpp"

#include <gmock/gmock.h>

#include <cstdint>
#include <string>
#include <vector>

namespace arhost::scene::test {

inline std::string base64(const std::string &bytes) {
    const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        std::uint32_t three = 0;
        for (std::size_t k = 0; k < 3; ++k)
            three = three << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
        for (std::size_t k = 0; k < 4; ++k)
            text += i + k > bytes.size() ? '=' : digits[three >> (18 - 6 * k) & 63];
    }
    return text;
}

// Builds a glTF file with one buffer.
struct Gltf {
    std::string bytes, views, accessors; // content of the JSON lists, without brackets
    std::string meshes,
        nodes = R"({"mesh": 0})", scene_nodes = "0", more,
        more_buffers; // further JSON members, and further entries of "buffers"; each starts with a comma
    int view_count = 0, accessor_count = 0;

    int view(const std::string &data, int stride = 0) {
        bytes.resize((bytes.size() + 3) / 4 * 4);
        views += std::string(view_count ? "," : "") + R"({"buffer": 0, "byteOffset": )" +
                 std::to_string(bytes.size()) + R"(, "byteLength": )" + std::to_string(data.size()) +
                 (stride ? R"(, "byteStride": )" + std::to_string(stride) : "") + "}";
        bytes += data;
        return view_count++;
    }
    int accessor(int view, int component, int count, const std::string &type, const std::string &extra = "") {
        accessors += std::string(accessor_count ? "," : "") + "{" +
                     (view >= 0 ? R"("bufferView": )" + std::to_string(view) + ", " : "") + R"("componentType": )" +
                     std::to_string(component) + R"(, "count": )" + std::to_string(count) + R"(, "type": ")" + type +
                     "\"" + extra + "}";
        return accessor_count++;
    }
    int floats(const std::vector<float> &values, const std::string &type, int width) {
        return accessor(view(std::string(reinterpret_cast<const char *>(values.data()), values.size() * 4)), 5126,
                        static_cast<int>(values.size()) / width, type);
    }
    std::string json(const std::string &buffer_uri) const {
        return R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [)" + scene_nodes +
               R"(]}], "nodes": [)" + nodes + R"(], "meshes": [)" + meshes + R"(], "bufferViews": [)" + views +
               R"(], "accessors": [)" + accessors + R"(], "buffers": [{"byteLength": )" +
               std::to_string(bytes.size()) + buffer_uri + "}" + more_buffers + "]" + more + "}";
    }
    std::string text() const {
        return json(R"(, "uri": "data:application/octet-stream;base64,)" + base64(bytes) + "\"");
    }
    std::string binary() const {
        std::string chunk = json(""), data = bytes;
        chunk.resize((chunk.size() + 3) / 4 * 4, ' ');
        data.resize((data.size() + 3) / 4 * 4);
        const auto number = [](std::size_t value) {
            const auto v = static_cast<std::uint32_t>(value);
            return std::string(reinterpret_cast<const char *>(&v), 4);
        };
        return "glTF" + number(2) + number(28 + chunk.size() + data.size()) + number(chunk.size()) + "JSON" + chunk +
               number(data.size()) + std::string("BIN\0", 4) + data;
    }
};

// Returns a file with one triangle: (0,0,0), (1,0,0), (0,1,0) in accessor 0, texture coordinates in accessor 1.
inline Gltf triangle() {
    Gltf gltf;
    gltf.floats({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3", 3);
    gltf.floats({0, 0, 1, 0, 0, 1}, "VEC2", 2);
    gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}}]})";
    return gltf;
}

struct Loaded {
    Arena arena;
    std::vector<std::string> info;
    Contents contents;
};

inline Loaded load(const std::string &gltf, const std::string &object = "", const std::string &axes = "y-up",
                   const std::string &name = "a.gltf") {
    const arhost::test::ScratchFolder folder;
    write_file(folder.path() / name, gltf);
    write_file(folder.path() / "s.yaml", "version: 1\naxes: " + axes +
                                             "\nmaterials: {grey: {model: mirror}}\nobjects:\n  - {gltf: " + name +
                                             object + "}\n");
    LoadCallbacks callbacks;
    std::vector<std::string> info;
    callbacks.info = [&](const std::string &text) { info.push_back(text); };
    ArenaBuilder builder = load_scene(folder.path() / "s.yaml", callbacks);
    const Contents contents = builder.contents;
    return {build(std::move(builder)), info, contents};
}

inline std::string error_of(const std::string &gltf, const std::string &object = "") {
    return arhost::test::error_of([&] { load(gltf, object); });
}

inline std::vector<float> vertex(const Arena &a, std::size_t i) {
    const float *p = elements<float>(a, geometry(a).positions) + 3 * i;
    return {p[0], p[1], p[2]};
}
inline auto near(float value) {
    return testing::FloatNear(value, 1e-5f);
}

} // namespace arhost::scene::test
