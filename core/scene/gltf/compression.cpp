// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/compression.hpp"

#include "scene/gltf/accessors.hpp"
#include "scene/gltf/draco.hpp"
#include "scene/gltf/meshopt.hpp"

#include <limits>
#include <optional>

namespace arhost::scene {
namespace {

constexpr const char *meshopt_extension = "EXT_meshopt_compression", *draco_extension = "KHR_draco_mesh_compression";
constexpr std::uint32_t size_limit = std::numeric_limits<std::int32_t>::max();

// Appends a tightly packed accessor and returns its index.
int add_accessor(tinygltf::Model &model, std::vector<unsigned char> bytes, tinygltf::Accessor accessor) {
    tinygltf::BufferView view;
    view.buffer = static_cast<int>(model.buffers.size());
    view.byteLength = bytes.size();
    model.buffers.emplace_back().data = std::move(bytes);
    accessor.bufferView = static_cast<int>(model.bufferViews.size());
    accessor.byteOffset = 0;
    accessor.sparse.isSparse = false;
    model.bufferViews.push_back(std::move(view));
    model.accessors.push_back(std::move(accessor));
    return static_cast<int>(model.accessors.size() - 1);
}

void decode_primitive(tinygltf::Model &model, tinygltf::Primitive &primitive, const JsonNode &extension,
                      const Accessors &accessors, ExpansionBudget &budget) {
    const DracoMesh mesh(accessors.view(extension.at("bufferView").index(), draco_extension), extension, budget);
    for (const auto &[name, id] : extension.at("attributes").members()) {
        const auto attribute = primitive.attributes.find(name);
        if (attribute == primitive.attributes.end())
            id.fail("is not an attribute of the primitive");
        budget.take(mesh.vertex_count() * sizeof(float[4]), id); // several names may have the same data
        DracoMesh::Attribute decoded = mesh.attribute(id.integer(0, size_limit), id);
        tinygltf::Accessor accessor;
        accessor.componentType = decoded.component_type;
        accessor.type = decoded.type;
        accessor.normalized = accessors.at(model.accessors, attribute->second, "accessor").normalized;
        accessor.count = mesh.vertex_count();
        attribute->second = add_accessor(model, std::move(decoded.values), std::move(accessor));
    }
    tinygltf::Accessor corners;
    corners.componentType = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    corners.type = TINYGLTF_TYPE_SCALAR;
    std::vector<unsigned char> indices = mesh.triangles();
    corners.count = indices.size() / sizeof(std::uint32_t);
    primitive.indices = add_accessor(model, std::move(indices), std::move(corners));
    primitive.mode = TINYGLTF_MODE_TRIANGLES; // also for TRIANGLE_STRIP, which Draco does not keep
}

} // namespace

void ExpansionBudget::take(std::uint64_t bytes, const JsonNode &node) {
    if (bytes > left_)
        node.fail("the compressed meshes expand to more than " + std::to_string(limit_ >> 20) +
                  " MiB, the limit for a file of this size; export it without compression if it is genuine");
    left_ -= bytes;
}

nlohmann::json plain_json(const nlohmann::json &json, const std::string &name) {
    nlohmann::json plain = json;
    const JsonNode root(json, "", name);
    const std::vector<JsonNode> buffers = root.items("buffers"), views = root.items("bufferViews"),
                                images = root.items("images"), textures = root.items("textures"),
                                meshes = root.items("meshes");
    for (std::size_t i = 0; i < buffers.size(); ++i)
        if (const auto extension = buffers[i].extension(meshopt_extension);
            extension && extension->boolean_or("fallback", false))
            plain["buffers"][i] = {{"byteLength", 1u}, {"uri", "data:application/octet-stream;base64,AA=="}};
    for (std::size_t i = 0; i < views.size(); ++i)
        if (const auto extension = views[i].extension(meshopt_extension))
            plain["bufferViews"][i] = {{"buffer", extension->at("buffer").integer(0, size_limit)},
                                       {"byteOffset", extension->integer_or("byteOffset", 0, 0, size_limit)},
                                       {"byteLength", extension->at("byteLength").integer(1, size_limit)}};
    for (std::size_t i = 0; i < images.size(); ++i) { // tinygltf knows no data of the type image/webp
        const std::string uri = images[i].text_or("uri", ""), start = "data:image/";
        const bool is_known = uri.starts_with(start + "png;") || uri.starts_with(start + "jpeg;");
        if (const std::size_t end = uri.find(";base64,");
            uri.starts_with(start) && !is_known && end < start.size() + 20)
            plain["images"][i]["uri"] = "data:application/octet-stream" + uri.substr(end);
    }
    for (std::size_t i = 0; i < textures.size(); ++i)
        if (const auto extension = textures[i].extension("EXT_texture_webp"))
            plain["textures"][i]["source"] = extension->at("source").integer(0, size_limit);
    for (std::size_t i = 0; i < meshes.size(); ++i) {
        const std::vector<JsonNode> primitives = meshes[i].items("primitives");
        for (std::size_t k = 0; k < primitives.size(); ++k)
            if (primitives[k].extension(draco_extension)) // tinygltf requires that indices have a buffer view
                plain["meshes"][i]["primitives"][k].erase("indices");
    }
    return plain;
}

void decompress(GltfFile &file, const std::string &name, const Reporter &reporter) {
    tinygltf::Model &model = file.model;
    const Accessors accessors(model, name);
    const JsonNode root(file.json, "", name);
    std::uint64_t size = 0;
    for (const tinygltf::Buffer &buffer : model.buffers)
        size += buffer.data.size();
    ExpansionBudget budget(expansion_limit(size));
    const std::vector<JsonNode> views = root.items("bufferViews"), meshes = root.items("meshes");
    for (std::size_t i = 0; i < views.size(); ++i)
        if (const auto extension = views[i].extension(meshopt_extension)) {
            reporter.report(-1);
            std::vector<unsigned char> bytes =
                decode_meshopt(accessors.view(static_cast<int>(i), meshopt_extension), *extension, budget);
            if (views[i].at("byteLength").integer(0, size_limit) != bytes.size())
                views[i].at("byteLength").fail("must be count * byteStride of " + std::string(meshopt_extension));
            tinygltf::BufferView &view = model.bufferViews[i];
            view.buffer = static_cast<int>(model.buffers.size());
            view.byteOffset = 0;
            view.byteLength = bytes.size();
            view.byteStride = views[i].integer_or("byteStride", 0, 4, 252);
            model.buffers.emplace_back().data = std::move(bytes);
        }
    for (std::size_t i = 0; i < meshes.size(); ++i) {
        const std::vector<JsonNode> primitives = meshes[i].items("primitives");
        for (std::size_t k = 0; k < primitives.size(); ++k)
            if (const auto extension = primitives[k].extension(draco_extension)) {
                if (primitives.size() != model.meshes[i].primitives.size()) // tinygltf skips such primitives
                    meshes[i].fail("has a primitive without attributes");
                reporter.report(-1);
                decode_primitive(model, model.meshes[i].primitives[k], *extension, accessors, budget);
            }
    }
}

} // namespace arhost::scene
