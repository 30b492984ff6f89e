// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/draco.hpp"

#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/varint_decoding.h>

#include <algorithm>
#include <cstring>

namespace arhost::scene {
namespace {

// Draco trusts the counts in its data, so that a few bytes could make it allocate gigabytes.
template <class Decoder> class BoundedDecoder final : public Decoder {
public:
    BoundedDecoder(const JsonNode &node, ExpansionBudget &budget) : node_(node), budget_(budget) {}

private:
    bool DecodeConnectivity() override {
        draco::DecoderBuffer next = *this->buffer();
        std::uint32_t faces = 0, vertices = 0;
        std::uint8_t seams = 0; // number of attributes with their own connectivity
        constexpr bool is_sequential = std::is_same_v<Decoder, draco::MeshSequentialDecoder>;
        if (!draco::DecodeVarint(is_sequential ? &faces : &vertices, &next) ||
            !draco::DecodeVarint(is_sequential ? &vertices : &faces, &next) ||
            (!is_sequential && !next.Decode(&seams)))
            return false;
        budget_.take(std::uint64_t(faces) * sizeof(draco::Mesh::Face) * (1u + seams), node_);
        return Decoder::DecodeConnectivity();
    }

    bool DecodeAllAttributes() override {
        const draco::PointCloud &cloud = *this->point_cloud();
        std::uint64_t vertex_size = 0;
        for (int i = 0; i < cloud.num_attributes(); ++i) // Draco decodes most components to 32 bits first
            vertex_size +=
                std::uint64_t(cloud.attribute(i)->num_components()) *
                static_cast<std::uint64_t>(std::max(draco::DataTypeLength(cloud.attribute(i)->data_type()), 4));
        budget_.take(vertex_size * cloud.num_points(), node_);
        return Decoder::DecodeAllAttributes();
    }

    const JsonNode &node_;
    ExpansionBudget &budget_;
};

// Returns 0 if glTF has no such type.
int component_type_of(draco::DataType type) {
    switch (type) {
    case draco::DT_INT8:
        return TINYGLTF_COMPONENT_TYPE_BYTE;
    case draco::DT_UINT8:
        return TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE;
    case draco::DT_INT16:
        return TINYGLTF_COMPONENT_TYPE_SHORT;
    case draco::DT_UINT16:
        return TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT;
    case draco::DT_UINT32:
        return TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    case draco::DT_FLOAT32:
        return TINYGLTF_COMPONENT_TYPE_FLOAT;
    default:
        return 0;
    }
}

} // namespace

DracoMesh::DracoMesh(std::span<const unsigned char> bytes, const JsonNode &node, ExpansionBudget &budget)
    : mesh_(std::make_unique<draco::Mesh>()) {
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char *>(bytes.data()), bytes.size());
    draco::DecoderBuffer start = buffer;
    draco::DracoHeader header;
    if (!draco::PointCloudDecoder::DecodeHeader(&start, &header).ok())
        node.fail("has no Draco data");
    if (header.encoder_type != draco::TRIANGULAR_MESH)
        node.fail("has a Draco point cloud instead of a mesh");
    if (header.version_major != 2 || header.version_minor != 2)
        node.fail("has Draco data of version " + std::to_string(header.version_major) + "." +
                  std::to_string(header.version_minor) + "; glTF requires 2.2");
    const auto decode = [&]<class Decoder>(BoundedDecoder<Decoder> decoder) {
        return decoder.Decode(draco::DecoderOptions(), &buffer, mesh_.get());
    };
    const draco::Status status = header.encoder_method == draco::MESH_SEQUENTIAL_ENCODING
                                     ? decode(BoundedDecoder<draco::MeshSequentialDecoder>(node, budget))
                                     : decode(BoundedDecoder<draco::MeshEdgebreakerDecoder>(node, budget));
    if (!status.ok())
        node.fail("its Draco data are corrupt: " + status.error_msg_string());
}

DracoMesh::~DracoMesh() = default;

std::size_t DracoMesh::vertex_count() const {
    return mesh_->num_points();
}

DracoMesh::Attribute DracoMesh::attribute(std::uint32_t id, const JsonNode &node) const {
    const draco::PointAttribute *attribute = mesh_->GetAttributeByUniqueId(id);
    if (!attribute || !attribute->buffer())
        node.fail("refers to the Draco attribute " + std::to_string(id) + ", which does not exist");
    constexpr int types[] = {TINYGLTF_TYPE_SCALAR, TINYGLTF_TYPE_VEC2, TINYGLTF_TYPE_VEC3, TINYGLTF_TYPE_VEC4};
    const int width = attribute->num_components(), component_type = component_type_of(attribute->data_type());
    if (width < 1 || width > 4 || component_type == 0)
        node.fail("has a type that glTF does not support");
    const auto size =
        static_cast<std::size_t>(width) * static_cast<std::size_t>(draco::DataTypeLength(attribute->data_type()));
    Attribute result{component_type, types[width - 1], std::vector<unsigned char>(vertex_count() * size)};
    const draco::DataBuffer &values = *attribute->buffer();
    for (std::uint32_t vertex = 0; vertex < vertex_count(); ++vertex) {
        const bool is_mapped = attribute->is_mapping_identity() || vertex < attribute->indices_map_size();
        const auto offset =
            is_mapped
                ? static_cast<std::size_t>(attribute->GetBytePos(attribute->mapped_index(draco::PointIndex(vertex))))
                : values.data_size();
        if (offset + size > values.data_size())
            node.fail("has no value for vertex " + std::to_string(vertex));
        std::memcpy(&result.values[vertex * size], values.data() + offset, size);
    }
    return result;
}

std::vector<unsigned char> DracoMesh::triangles() const {
    std::vector<unsigned char> bytes(std::size_t(mesh_->num_faces()) * 12);
    for (std::uint32_t i = 0; i < mesh_->num_faces(); ++i)
        for (std::size_t k = 0; k < 3; ++k) {
            const std::uint32_t corner = mesh_->face(draco::FaceIndex(i))[k].value();
            std::memcpy(&bytes[12 * std::size_t(i) + 4 * k], &corner, 4);
        }
    return bytes;
}

} // namespace arhost::scene
