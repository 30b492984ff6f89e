// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/meshopt.hpp"

#include <meshoptimizer.h>

#include <limits>

namespace arhost::scene {
namespace {

using Filter = void(void *, std::size_t count, std::size_t stride);

// Returns NULL for the filter NONE. The filters assert that the stride is valid.
Filter *filter_of(const JsonNode &extension, std::uint32_t stride) {
    const std::string name = extension.text_or("filter", "NONE");
    if (name == "NONE")
        return nullptr;
    const auto filter = [&](Filter *function, bool fits) {
        if (!fits)
            extension.fail("the filter " + name + " does not support its byteStride of " + std::to_string(stride));
        return function;
    };
    if (name == "OCTAHEDRAL")
        return filter(meshopt_decodeFilterOct, stride == 4 || stride == 8);
    if (name == "QUATERNION")
        return filter(meshopt_decodeFilterQuat, stride == 8);
    if (name == "EXPONENTIAL")
        return filter(meshopt_decodeFilterExp, stride % 4 == 0);
    extension.at("filter").fail("must be NONE, OCTAHEDRAL, QUATERNION or EXPONENTIAL");
}

} // namespace

std::vector<unsigned char> decode_meshopt(std::span<const unsigned char> bytes, const JsonNode &extension,
                                          ExpansionBudget &budget) {
    const std::uint32_t count = extension.at("count").integer(1, std::numeric_limits<std::int32_t>::max()),
                        stride = extension.at("byteStride").integer(1, 256);
    const std::string mode = extension.at("mode").text();
    const bool has_triangles = mode == "TRIANGLES", has_vertices = mode == "ATTRIBUTES";
    if (!has_triangles && !has_vertices && mode != "INDICES")
        extension.at("mode").fail("must be ATTRIBUTES, TRIANGLES or INDICES");
    if (has_vertices ? stride % 4 != 0 : stride != 2 && stride != 4)
        extension.at("byteStride").fail(has_vertices ? "must be a multiple of 4" : "must be 2 or 4");
    if (has_triangles && count % 3 != 0)
        extension.at("count").fail("must be a multiple of 3");
    Filter *const filter = filter_of(extension, stride);
    if (filter && !has_vertices)
        extension.at("filter").fail("must be NONE with the mode " + mode);
    budget.take(std::uint64_t(count) * stride, extension);
    std::vector<unsigned char> decoded(std::size_t(count) * stride);
    using Decode = int(void *, std::size_t count, std::size_t size, const unsigned char *, std::size_t);
    Decode *const vertices = meshopt_decodeVertexBuffer, *const triangles = meshopt_decodeIndexBuffer,
                  *const indices = meshopt_decodeIndexSequence;
    Decode *const decode = has_vertices ? vertices : has_triangles ? triangles : indices;
    if (decode(decoded.data(), count, stride, bytes.data(), bytes.size()) != 0)
        extension.fail("its compressed data are corrupt, or of a version that arhost does not decode");
    if (filter)
        filter(decoded.data(), count, stride);
    return decoded;
}

} // namespace arhost::scene
