// SPDX-License-Identifier: Apache-2.0
//
// The tables and accessors of a glTF file. Private to core/scene.
#pragma once

#include "scene/gltf/file.hpp"
#include "scene/mesh.hpp"

#include <arhost/scene.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

namespace arhost::scene {

// Reads accessors with bounds checks.
class Accessors {
public:
    Accessors(const tinygltf::Model &model, const std::string &name) : model_(model), name_(name) {}

    [[noreturn]] void fail(const std::string &message) const { throw MeshError(name_ + ": " + message); }

    template <class T> const T &at(const std::vector<T> &table, int index, const char *what) const {
        if (index < 0 || static_cast<std::size_t>(index) >= table.size())
            fail("refers to " + std::string(what) + " " + std::to_string(index) + ", but the file has only " +
                 std::to_string(table.size()));
        return table[static_cast<std::size_t>(index)];
    }

    std::size_t count(int index) const { return at(model_.accessors, index, "accessor").count; }
    int type(int index) const { return at(model_.accessors, index, "accessor").type; } // TINYGLTF_TYPE_…

    // Returns the bytes of a buffer view. `name`: for messages.
    std::span<const unsigned char> view(int index, const std::string &name) const {
        const tinygltf::BufferView &view = at(model_.bufferViews, index, "buffer view");
        const auto &data = at(model_.buffers, view.buffer, "buffer").data;
        if (view.byteOffset > data.size() || view.byteLength > data.size() - view.byteOffset)
            fail(name + " extends past the end of its buffer");
        return {data.data() + view.byteOffset, view.byteLength};
    }

    // Returns all components of all elements of accessor `index`. `type` is the required element type
    // (TINYGLTF_TYPE_…). Normalized integers become 0 to 1 or −1 to 1. `what` names the accessor in messages.
    template <class T> std::vector<T> read(int index, int type, const char *what) const {
        const tinygltf::Accessor &accessor = at(model_.accessors, index, "accessor");
        const std::string name = std::string(what) + " (accessor " + std::to_string(index) + ")";
        if (accessor.type != type)
            fail(name + " must have elements of the type " + type_name(type));
        const auto width =
            static_cast<std::size_t>(tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(type)));
        const std::size_t size = size_of(accessor.componentType, name);
        if (std::is_integral_v<T> && accessor.componentType != TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE &&
            accessor.componentType != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT &&
            accessor.componentType != TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT)
            fail(name + " must have unsigned integer components");
        if (accessor.count > ARHOST_NONE || (accessor.bufferView < 0 && accessor.count > empty_accessor_limit))
            fail(name + " has too many elements");
        std::vector<T> values;
        if (accessor.bufferView >= 0) {
            const std::size_t view_stride = at(model_.bufferViews, accessor.bufferView, "buffer view").byteStride;
            const std::size_t stride = view_stride ? view_stride : size * width;
            if (stride < size * width || stride > 4096)
                fail(name + " has the invalid byte stride " + std::to_string(stride));
            const std::size_t length = accessor.count == 0 ? 0 : (accessor.count - 1) * stride + size * width;
            const unsigned char *from = bytes(accessor.bufferView, accessor.byteOffset, length, name);
            values.resize(accessor.count * width); // only after the bounds check
            for (std::size_t i = 0; i < accessor.count; ++i)
                convert<T>(from + i * stride, accessor, width, &values[i * width]);
        } else {
            values.resize(accessor.count * width);
        }
        if (accessor.sparse.isSparse)
            apply_sparse(accessor, width, size, name, values);
        return values;
    }

private:
    // Limits the size of accessors without a buffer view, whose elements are all 0.
    static constexpr std::size_t empty_accessor_limit = 10'000'000;

    template <class T> static T component(const unsigned char *from) {
        T value;
        std::memcpy(&value, from, sizeof value);
        return value;
    }

    static const char *type_name(int type) {
        return type == TINYGLTF_TYPE_SCALAR ? "SCALAR"
               : type == TINYGLTF_TYPE_VEC2 ? "VEC2"
               : type == TINYGLTF_TYPE_VEC3 ? "VEC3"
               : type == TINYGLTF_TYPE_VEC4 ? "VEC4"
                                            : "MAT4";
    }

    std::size_t size_of(int component_type, const std::string &name) const {
        if (component_type == TINYGLTF_COMPONENT_TYPE_DOUBLE)
            fail(name + " has double-precision components, which glTF does not support");
        const int size = tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(component_type));
        if (size <= 0)
            fail(name + " has an unknown component type");
        return static_cast<std::size_t>(size);
    }

    const unsigned char *bytes(int view_index, std::size_t offset, std::size_t length,
                               const std::string &name) const {
        const std::span<const unsigned char> all = view(view_index, name);
        if (offset > all.size() || length > all.size() - offset)
            fail(name + " extends past the end of its buffer");
        return all.data() + offset;
    }

    template <class T>
    static void convert(const unsigned char *from, const tinygltf::Accessor &accessor, std::size_t width, T *to) {
        for (std::size_t i = 0; i < width; ++i)
            switch (accessor.componentType) {
            case TINYGLTF_COMPONENT_TYPE_FLOAT:
                to[i] = static_cast<T>(component<float>(from + 4 * i));
                break;
            case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
                to[i] = static_cast<T>(component<std::uint32_t>(from + 4 * i));
                break;
            case TINYGLTF_COMPONENT_TYPE_INT:
                to[i] = static_cast<T>(component<std::int32_t>(from + 4 * i));
                break;
            case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
                to[i] = scaled<T>(component<std::uint16_t>(from + 2 * i), 65535, accessor.normalized);
                break;
            case TINYGLTF_COMPONENT_TYPE_SHORT:
                to[i] = scaled<T>(component<std::int16_t>(from + 2 * i), 32767, accessor.normalized);
                break;
            case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
                to[i] = scaled<T>(component<std::uint8_t>(from + i), 255, accessor.normalized);
                break;
            default:
                to[i] = scaled<T>(component<std::int8_t>(from + i), 127, accessor.normalized);
            }
    }

    template <class T> static T scaled(int value, int one, bool normalized) {
        if (!normalized)
            return static_cast<T>(value);
        return static_cast<T>(std::max(static_cast<float>(value) / static_cast<float>(one), -1.f));
    }

    template <class T>
    void apply_sparse(const tinygltf::Accessor &accessor, std::size_t width, std::size_t size,
                      const std::string &name, std::vector<T> &values) const {
        const auto &sparse = accessor.sparse;
        const int type = sparse.indices.componentType;
        if (sparse.count < 0 || sparse.indices.byteOffset < 0 || sparse.values.byteOffset < 0 ||
            (type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE && type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT &&
             type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT))
            fail(name + " has invalid sparse data");
        const auto count = static_cast<std::size_t>(sparse.count);
        const std::size_t index_size = size_of(type, name);
        const unsigned char *indices = bytes(
            sparse.indices.bufferView, static_cast<std::size_t>(sparse.indices.byteOffset), count * index_size, name);
        const unsigned char *from = bytes(
            sparse.values.bufferView, static_cast<std::size_t>(sparse.values.byteOffset), count * size * width, name);
        for (std::size_t i = 0; i < count; ++i) {
            const std::size_t index = index_size == 1   ? indices[i]
                                      : index_size == 2 ? component<std::uint16_t>(indices + 2 * i)
                                                        : component<std::uint32_t>(indices + 4 * i);
            if (index >= accessor.count)
                fail(name + " has a sparse index out of range");
            convert<T>(from + i * size * width, accessor, width, &values[index * width]);
        }
    }

    const tinygltf::Model &model_;
    const std::string &name_;
};
template <class Vector> std::vector<Vector> vectors(const std::vector<float> &floats) {
    std::vector<Vector> result(floats.size() / Vector::length());
    if (!result.empty())
        std::memcpy(static_cast<void *>(result.data()), floats.data(), result.size() * sizeof(Vector));
    return result;
}

} // namespace arhost::scene
