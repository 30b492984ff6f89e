// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf.hpp"

#include "scene/box.hpp"
#include "scene/mesh_file.hpp"
#include "scene/motion.hpp"

#include <glm/gtc/quaternion.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <nlohmann/json.hpp>
#include <tiny_gltf.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <map>

namespace arhost::scene {
namespace {

constexpr std::uint64_t file_limit = std::uint64_t(4) << 30; // for a .gltf, a .glb, and each external buffer
// Limits the size of accessors without a buffer view, whose elements are all 0.
constexpr std::size_t empty_accessor_limit = 10'000'000;
constexpr double min_scale = 1e-6; // a scale of 0 hides objects, but has no inverse
constexpr std::string_view supported_extension = "KHR_mesh_quantization"; // the only one

// Keeps the encoded image. It is decoded later, when a material refers to it.
bool keep_image_bytes(tinygltf::Image *image, int, std::string *, std::string *, int, int, const unsigned char *bytes,
                      int size, void *) {
    image->image.assign(bytes, bytes + size);
    return true;
}

bool is_file(const std::string &file, void *) { // rejects FIFOs, which would block when opened
    std::error_code ignored;
    return std::filesystem::is_regular_file(file, ignored);
}

// Input of read_file: how to read the resources (buffers and images) of a glTF file.
struct Resources {
    const Reporter &reporter;
    const std::string &gltf;                     // name of the glTF file, for messages
    std::vector<std::filesystem::path> readable; // resolved files and folders
};

bool is_below(const std::filesystem::path &file, const std::filesystem::path &folder) {
    return std::mismatch(folder.begin(), folder.end(), file.begin(), file.end()).first == folder.end();
}

bool read_file(std::vector<unsigned char> *content, std::string *error, const std::string &file, void *context) {
    const auto &resources = *static_cast<const Resources *>(context);
    std::error_code unresolved;
    const std::filesystem::path resolved = std::filesystem::canonical(file, unresolved);
    if (!unresolved &&
        std::ranges::none_of(resources.readable, [&](const auto &folder) { return is_below(resolved, folder); }))
        throw MeshError(resources.gltf + ": refers to '" + resolved.string() +
                        "', which is outside its folder; move that file there, or list it under 'reads' of the ray "
                        "tracer in the configuration");
    resources.reporter.reads(file);
    std::error_code ignored;
    if (is_file(resolved, nullptr) && std::filesystem::file_size(resolved, ignored) <= file_limit)
        return tinygltf::ReadWholeFile(content, error, resolved, nullptr);
    *error += file + ": is not a regular file, or is larger than 4 GiB";
    return false;
}

std::uint32_t number_at(std::string_view bytes, std::size_t offset) { // little-endian
    std::uint32_t number = 0;
    for (std::size_t i = 4; i-- > 0;)
        number = number << 8 | static_cast<unsigned char>(bytes[offset + i]);
    return number;
}

std::string printable(std::string text) {
    for (char &c : text)
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
            c = '?';
    return text.substr(0, 200);
}

// Returns what to change if tinygltf's `error` names a file that it could not find.
std::string hint_at_uri(std::string_view error) {
    constexpr std::string_view not_found = "File not found : ";
    const std::size_t at = error.find(not_found);
    const std::string_view uri = at == std::string_view::npos ? "" : error.substr(at + not_found.size());
    if (uri.substr(0, uri.find('\n')).find("://") != std::string_view::npos)
        return "; arhost downloads nothing: place the file next to the glTF file and write its relative path as "
               "'uri'";
    if (uri.starts_with('/'))
        return "; write a path relative to the glTF file as 'uri'";
    return "";
}

// Returns the content of a .gltf or .glb file, without bytes after the length that a .glb declares.
std::string_view content_of(const MeshFile &text) {
    constexpr std::size_t header = 12, length_at = 8;
    const std::string_view all = text.view();
    if (!all.starts_with("glTF") || all.size() < header)
        return all;
    const std::size_t length = number_at(all, length_at);
    if (length > all.size())
        text.fail("is truncated: it has " + std::to_string(all.size()) + " of " + std::to_string(length) + " bytes");
    return all.substr(0, std::max(length, header));
}

// Returns the JSON of a .gltf or .glb file. Throws if a chunk of a .glb extends past the end of the file.
std::string_view json_of(const MeshFile &text) {
    const std::string_view all = content_of(text);
    if (!all.starts_with("glTF"))
        return all;
    constexpr std::size_t header = 12, chunk_header = 8;
    std::string_view json;
    for (std::size_t at = header; at < all.size();) {
        const std::size_t left = all.size() - at;
        const std::size_t size = left < chunk_header ? left : number_at(all, at);
        if (left < chunk_header || size > left - chunk_header)
            text.fail("is truncated: a chunk extends past the end of the file");
        if (at == header)
            json = all.substr(at + chunk_header, size);
        at += chunk_header + size;
    }
    return json;
}

// Rejects files with which tinygltf would read out of bounds or recurse without limit.
void check_structure(const MeshFile &text) {
    using Json = nlohmann::json;
    const auto check_depth = [&](int depth, Json::parse_event_t, Json &) {
        constexpr int max_depth = 64;
        if (depth > max_depth)
            text.fail("its JSON is nested more than 64 levels deep");
        return true;
    };
    const std::string_view json = json_of(text);
    const Json root = Json::parse(json.begin(), json.end(), check_depth, false); // tinygltf reports invalid JSON
    if (!root.is_object())
        return;
    const auto list = [&](const char *key) {
        const auto found = root.find(key);
        return found != root.end() && found->is_array() ? *found : Json::array();
    };
    const auto number = [&](const Json &object, const char *key) -> std::uint64_t {
        if (!object.is_object() || !object.contains(key))
            return 0;
        if (!object[key].is_number_unsigned())
            text.fail("a value of '" + std::string(key) + "' is not an unsigned integer");
        return object[key].get<std::uint64_t>();
    };
    const Json asset = root.value("asset", Json());
    const Json version = asset.is_object() ? asset.value("version", Json()) : Json();
    if (!version.is_string() || !version.get<std::string>().starts_with("2."))
        text.fail("is not glTF 2: its asset.version must be \"2.0\"");
    if (const Json needed = asset.value("minVersion", Json("2.0")); needed != Json("2.0"))
        text.fail("its asset.minVersion is " + printable(needed.dump()) +
                  ", but arhost reads glTF 2.0; export it as glTF 2.0");
    for (const Json &accessor : list("accessors"))
        number(accessor, "byteOffset");
    const Json buffers = list("buffers"), views = list("bufferViews");
    for (std::size_t i = 0; i < views.size(); ++i) {
        const std::uint64_t buffer = number(views[i], "buffer"), offset = number(views[i], "byteOffset"),
                            size = number(views[i], "byteLength");
        const std::uint64_t all = buffer < buffers.size() ? number(buffers[buffer], "byteLength") : 0;
        if (offset > all || size > all - offset)
            text.fail("buffer view " + std::to_string(i) + " extends past the end of its buffer");
    }
}

tinygltf::Model parse(const std::filesystem::path &file, std::span<const std::filesystem::path> reads,
                      const Reporter &reporter) {
    const MeshFile text = MeshFile::read(file, file_limit - 1, reporter);
    check_structure(text);
    tinygltf::TinyGLTF parser;
    parser.SetImageLoader(keep_image_bytes, nullptr);
    const std::string folder = file.parent_path().string();
    Resources resources{reporter, text.name(), {reads.begin(), reads.end()}};
    resources.readable.push_back(std::filesystem::canonical(folder.empty() ? "." : folder));
    parser.SetFsCallbacks({is_file, tinygltf::ExpandFilePath, read_file, tinygltf::WriteWholeFile, &resources});
    tinygltf::Model model;
    std::string error, warning;
    const auto size = static_cast<unsigned int>(content_of(text).size());
    const bool good =
        text.view().starts_with("glTF")
            ? parser.LoadBinaryFromMemory(&model, &error, &warning,
                                          reinterpret_cast<const unsigned char *>(text.begin()), size, folder)
            : parser.LoadASCIIFromString(&model, &error, &warning, text.begin(), size, folder);
    const auto on_one_line = [](std::string lines) {
        while (!lines.empty() && lines.back() == '\n')
            lines.pop_back();
        for (char &c : lines)
            if (static_cast<unsigned char>(c) < 0x20)
                c = ' ';
        return lines.substr(0, 500);
    };
    if (!good)
        text.fail("cannot be loaded as glTF 2.0: " + on_one_line(error) + hint_at_uri(error));
    if (!warning.empty())
        reporter.info(text.name() + ": " + on_one_line(warning));
    return model;
}

template <class T> T component(const unsigned char *from) {
    T value;
    std::memcpy(&value, from, sizeof value);
    return value;
}

const char *type_name(int type) {
    return type == TINYGLTF_TYPE_SCALAR ? "SCALAR"
           : type == TINYGLTF_TYPE_VEC2 ? "VEC2"
           : type == TINYGLTF_TYPE_VEC3 ? "VEC3"
           : type == TINYGLTF_TYPE_VEC4 ? "VEC4"
                                        : "MAT4";
}

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
        const tinygltf::BufferView &view = at(model_.bufferViews, view_index, "buffer view");
        const auto &data = at(model_.buffers, view.buffer, "buffer").data;
        if (view.byteOffset > data.size() || view.byteLength > data.size() - view.byteOffset ||
            offset > view.byteLength || length > view.byteLength - offset)
            fail(name + " extends past the end of its buffer");
        return data.data() + view.byteOffset + offset;
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

class GltfLoader {
public:
    GltfLoader(ArenaBuilder &builder, Textures &textures, const std::filesystem::path &file,
               const GltfPlacement &placement, const LoadCallbacks &callbacks)
        : builder_(builder), textures_(textures), file_(file), name_(file.string()), placement_(placement),
          reporter_(callbacks, file.filename().string()), model_(parse(file, placement.reads, reporter_)),
          accessors_(model_, name_) {}

    float load() {
        check_extensions();
        collect_nodes();
        choose_animation();
        for (std::size_t i = 0; i < nodes_.size(); ++i) {
            add_parts(i);
            reporter_.report(static_cast<double>(i) / static_cast<double>(nodes_.size()));
        }
        if (parts_.empty())
            accessors_.fail("its default scene contains no triangles");
        bake_static_deformations();
        if (animation_)
            add_motion();
        for (Part &part : parts_)
            add_object(part);
        log_size();
        return animation_ ? duration_s_ : 0;
    }

private:
    struct SceneNode {
        int file_node;                      // index of the node in the file
        std::uint32_t parent = ARHOST_NONE; // index in nodes_
        glm::dmat4 placement_from_node{1};  // in the rest pose, relative to placement_.node
        bool has_channel = false;           // the animation changes its translation, rotation or scale
        bool moves = false;                 // the animation moves this node or an ancestor
        bool has_weights_channel = false;
        std::vector<float> morph_weights;
    };

    struct Part {
        TriangleMesh mesh;
        std::uint32_t material, node; // node: index in nodes_
        int skin;
        std::string name;
        bool deforms = false;
    };

    void check_extensions() const {
        std::string ignored;
        for (const std::string &extension : model_.extensionsUsed)
            if (extension != supported_extension)
                ignored += (ignored.empty() ? "" : ", ") + extension;
        for (std::size_t i = 0; i < model_.extensionsRequired.size(); ++i)
            if (const std::string &extension = model_.extensionsRequired[i]; extension != supported_extension)
                accessors_.fail("extensionsRequired[" + std::to_string(i) + "] requires the unsupported extension '" +
                                printable(extension) + "'; export it without this extension");
        if (!ignored.empty())
            reporter_.info(name_ + ": unsupported extensions are ignored: " + printable(ignored));
    }

    // ---- nodes ----

    // Collects the nodes of the default scene in nodes_, parents before children.
    void collect_nodes() {
        std::vector<std::pair<int, std::uint32_t>> pending; // node, parent
        if (model_.scenes.empty()) {
            std::vector<bool> is_child(model_.nodes.size());
            for (const tinygltf::Node &node : model_.nodes)
                for (const int child : node.children)
                    if (child >= 0 && static_cast<std::size_t>(child) < is_child.size())
                        is_child[static_cast<std::size_t>(child)] = true;
            for (std::size_t i = model_.nodes.size(); i-- > 0;)
                if (!is_child[i])
                    pending.emplace_back(static_cast<int>(i), ARHOST_NONE);
        } else {
            const tinygltf::Scene &scene = accessors_.at(model_.scenes, std::max(model_.defaultScene, 0), "scene");
            for (auto node = scene.nodes.rbegin(); node != scene.nodes.rend(); ++node)
                pending.emplace_back(*node, ARHOST_NONE);
        }
        scene_index_.assign(model_.nodes.size(), ARHOST_NONE);
        const glm::dmat4 root = placement_.from_gltf.matrix();
        while (!pending.empty()) {
            const auto [index, parent] = pending.back();
            pending.pop_back();
            const tinygltf::Node &node = accessors_.at(model_.nodes, index, "node");
            std::uint32_t &scene_index = scene_index_[static_cast<std::size_t>(index)];
            if (scene_index != ARHOST_NONE)
                accessors_.fail("node " + std::to_string(index) + " has more than one parent");
            scene_index = static_cast<std::uint32_t>(nodes_.size());
            nodes_.push_back(
                {index,
                 parent,
                 (parent == ARHOST_NONE ? root : nodes_[parent].placement_from_node) * parent_from_node(index),
                 false,
                 false,
                 false,
                 {}});
            for (auto child = node.children.rbegin(); child != node.children.rend(); ++child)
                pending.emplace_back(*child, scene_index);
        }
    }

    std::vector<double> numbers(const std::vector<double> &values, std::vector<double> defaults, int index) const {
        if (values.empty())
            return defaults;
        if (values.size() != defaults.size() ||
            !std::ranges::all_of(values, [](double v) { return std::abs(v) <= coordinate_limit_mm; }))
            accessors_.fail("node " + std::to_string(index) + " has an invalid transform");
        return values;
    }
    glm::dvec3 translation(int index) const {
        return glm::make_vec3(
            numbers(model_.nodes[static_cast<std::size_t>(index)].translation, {0, 0, 0}, index).data());
    }
    glm::dquat rotation(int index) const {
        const auto r = numbers(model_.nodes[static_cast<std::size_t>(index)].rotation, {0, 0, 0, 1}, index);
        const glm::dquat quaternion(r[3], r[0], r[1], r[2]);
        if (!(glm::length(quaternion) > 1e-6))
            accessors_.fail("node " + std::to_string(index) + " has a rotation of length 0");
        return glm::normalize(quaternion);
    }
    glm::dvec3 scale(int index) const {
        auto s = numbers(model_.nodes[static_cast<std::size_t>(index)].scale, {1, 1, 1}, index);
        for (double &factor : s)
            if (std::abs(factor) < min_scale)
                factor = std::copysign(min_scale, factor);
        return glm::make_vec3(s.data());
    }

    glm::dmat4 parent_from_node(int index) const {
        const tinygltf::Node &node = model_.nodes[static_cast<std::size_t>(index)];
        if (!node.matrix.empty()) {
            glm::dmat4 matrix = glm::make_mat4(numbers(node.matrix, std::vector<double>(16), index).data());
            for (int column = 0; column < 4; ++column)
                matrix[column][3] = column == 3;
            if (!(std::abs(glm::determinant(matrix)) > 1e-18))
                accessors_.fail("node " + std::to_string(index) + " has a matrix that cannot be inverted");
            return matrix;
        }
        glm::dmat4 matrix = glm::mat4_cast(rotation(index));
        for (int i = 0; i < 3; ++i)
            matrix[i] *= scale(index)[i];
        matrix[3] = glm::dvec4(translation(index), 1);
        return matrix;
    }

    // ---- animations ----

    void choose_animation() {
        std::string names;
        for (std::size_t i = 0; i < model_.animations.size(); ++i)
            names += (i ? ", " : "") + std::to_string(i) + " '" + printable(model_.animations[i].name) + "'";
        if (!placement_.animation) {
            if (!names.empty())
                reporter_.info(name_ + ": no animation selected; available for 'animation': " + names);
            return;
        }
        const std::string &wanted = *placement_.animation;
        for (const tinygltf::Animation &animation : model_.animations)
            if (animation.name == wanted && !animation_)
                animation_ = &animation;
        std::size_t number = 0;
        const auto [end, error] = std::from_chars(wanted.data(), wanted.data() + wanted.size(), number);
        if (!animation_ && error == std::errc() && end == wanted.data() + wanted.size() &&
            number < model_.animations.size())
            animation_ = &model_.animations[number];
        if (!animation_)
            throw AnimationError(name_ + ": has no animation '" + printable(wanted) + "'" +
                                 (names.empty() ? "; the file has no animations" : "; available: " + names));
        for (const tinygltf::AnimationChannel &channel : animation_->channels) {
            if (const auto node = find_node(channel.target_node)) {
                if (channel.target_path == "weights")
                    nodes_[*node].has_weights_channel = true;
                else if (channel.target_path == "translation" || channel.target_path == "rotation" ||
                         channel.target_path == "scale")
                    nodes_[*node].has_channel = true;
            }
        }
        for (SceneNode &node : nodes_) {
            node.moves = node.has_channel || (node.parent != ARHOST_NONE && nodes_[node.parent].moves);
            if (node.has_channel && !model_.nodes[static_cast<std::size_t>(node.file_node)].matrix.empty())
                accessors_.fail("node " + std::to_string(node.file_node) +
                                " has a matrix; animated nodes must have translation, rotation and scale instead");
        }
    }

    arhost_interpolation interpolation_of(const std::string &name) const {
        if (name == "STEP")
            return ARHOST_INTERPOLATION_STEP;
        if (name == "CUBICSPLINE")
            return ARHOST_INTERPOLATION_CUBIC;
        if (name != "LINEAR") // tinygltf's default
            accessors_.fail("an animation has the unknown interpolation '" + printable(name) +
                            "'; glTF defines LINEAR, STEP and CUBICSPLINE");
        return ARHOST_INTERPOLATION_LINEAR;
    }

    // Converts the index of a node in the file to its index in nodes_. Returns std::nullopt if the node is not in the
    // scene.
    std::optional<std::uint32_t> find_node(int node) const {
        if (node < 0 || static_cast<std::size_t>(node) >= scene_index_.size() ||
            scene_index_[static_cast<std::size_t>(node)] == ARHOST_NONE)
            return std::nullopt;
        return scene_index_[static_cast<std::size_t>(node)];
    }

    Channel channel_of(const tinygltf::AnimationChannel &from, std::uint32_t node) {
        const tinygltf::AnimationSampler &sampler = accessors_.at(animation_->samplers, from.sampler, "sampler");
        Channel channel;
        channel.node = first_node_ + node;
        channel.interpolation = interpolation_of(sampler.interpolation);
        channel.times = accessors_.read<float>(sampler.input, TINYGLTF_TYPE_SCALAR, "an animation's times");
        const auto &times = channel.times;
        if (times.empty())
            accessors_.fail("an animation has no keyframes");
        if (!(times.front() >= 0 && times.back() <= duration_limit_s))
            accessors_.fail("an animation has keyframe times outside 0 to 1e6 s");
        for (std::size_t i = 1; i < times.size(); ++i)
            if (!(times[i] > times[i - 1]))
                accessors_.fail("an animation's times are not strictly increasing");
        std::size_t width = 3;
        int type = TINYGLTF_TYPE_VEC3;
        if (from.target_path == "weights") {
            channel.target = ARHOST_CHANNEL_MORPH_WEIGHTS;
            width = nodes_[node].morph_weights.size();
            type = TINYGLTF_TYPE_SCALAR;
        } else if (from.target_path == "rotation") {
            channel.target = ARHOST_CHANNEL_ROTATION;
            width = 4;
            type = TINYGLTF_TYPE_VEC4;
        } else {
            channel.target = from.target_path == "scale" ? ARHOST_CHANNEL_SCALE : ARHOST_CHANNEL_TRANSLATION;
        }
        channel.values = accessors_.read<float>(sampler.output, type, "an animation's values");
        auto &values = channel.values;
        const bool cubic = channel.interpolation == ARHOST_INTERPOLATION_CUBIC;
        if (values.size() != times.size() * width * (cubic ? 3 : 1))
            accessors_.fail("an animation has " + std::to_string(values.size()) + " values for " +
                            std::to_string(times.size()) + " keyframes");
        if (!std::ranges::all_of(values, [](float v) { return std::abs(v) <= coordinate_limit_mm; }))
            accessors_.fail("an animation has a value whose absolute value exceeds 1e9");
        if (channel.target == ARHOST_CHANNEL_ROTATION)
            for (std::size_t key = 0; key < times.size(); ++key) {
                float *v = &values[cubic ? key * 12 + 4 : key * 4];
                const glm::vec4 rotation(v[0], v[1], v[2], v[3]);
                if (!(glm::length(rotation) > 1e-6f && glm::length(rotation) < 1e6f))
                    accessors_.fail("an animation has a rotation of length 0");
                for (int i = 0; i < 4; ++i)
                    v[i] = rotation[i] / glm::length(rotation);
            }
        duration_s_ = std::max(duration_s_, times.back());
        return channel;
    }

    MotionNode motion_node(const SceneNode &node) const {
        MotionNode result;
        result.morph_weights = node.morph_weights;
        result.animated = node.has_channel;
        if (node.has_channel) {
            const glm::dquat q = rotation(node.file_node);
            result.translation = translation(node.file_node);
            result.rotation = glm::vec4(q.x, q.y, q.z, q.w);
            result.scale = scale(node.file_node);
        } else {
            result.parent_from_node = glm::dmat4x3(parent_from_node(node.file_node));
        }
        return result;
    }

    // Adds a root node that represents the coordinates of the file, all scene nodes as its descendants, and the
    // channels of the animation.
    void add_motion() {
        MotionNode root;
        root.parent = placement_.node;
        root.parent_from_node = glm::dmat4x3(placement_.from_gltf.matrix());
        const std::uint32_t root_index = builder_.add_node(root);
        first_node_ = root_index + 1;
        for (const SceneNode &node : nodes_) {
            MotionNode added = motion_node(node);
            added.parent = node.parent == ARHOST_NONE ? root_index : first_node_ + node.parent;
            builder_.add_node(std::move(added));
        }
        for (const tinygltf::AnimationChannel &channel : animation_->channels)
            if (const auto node = find_node(channel.target_node)) {
                const bool weights = channel.target_path == "weights";
                if (weights ? !nodes_[*node].morph_weights.empty() : nodes_[*node].has_channel)
                    builder_.add_channel(channel_of(channel, *node));
            }
        if (!(duration_s_ > 0))
            throw AnimationError(name_ + ": the animation '" + printable(*placement_.animation) +
                                 "' has a duration of 0");
    }

    // Reads skin `index` of the file. The joints of the result are indices in nodes_ plus `first_node`.
    Skin skin_of(int index, std::uint32_t first_node) const {
        const tinygltf::Skin &from = accessors_.at(model_.skins, index, "skin");
        Skin skin;
        for (const int joint : from.joints) {
            const auto node = find_node(joint);
            if (!node)
                accessors_.fail("skin " + std::to_string(index) + " has the joint " + std::to_string(joint) +
                                ", which is not in the default scene");
            skin.joints.push_back(first_node + *node);
        }
        if (skin.joints.empty() || skin.joints.size() > 65536)
            accessors_.fail("skin " + std::to_string(index) + " has " + std::to_string(skin.joints.size()) +
                            " joints; it must have 1 to 65536");
        skin.node_from_mesh.assign(skin.joints.size(), glm::mat4x3(1));
        if (from.inverseBindMatrices >= 0) {
            const auto matrices =
                accessors_.read<float>(from.inverseBindMatrices, TINYGLTF_TYPE_MAT4, "the inverse bind matrices");
            if (matrices.size() < 16 * skin.joints.size())
                accessors_.fail("skin " + std::to_string(index) + " has " + std::to_string(matrices.size() / 16) +
                                " inverse bind matrices for " + std::to_string(skin.joints.size()) + " joints");
            if (!std::ranges::all_of(matrices, [](float v) { return std::abs(v) <= coordinate_limit_mm; }))
                accessors_.fail("skin " + std::to_string(index) +
                                " has an inverse bind matrix with a value that is NaN or beyond ±1e9");
            for (std::size_t i = 0; i < skin.joints.size(); ++i)
                skin.node_from_mesh[i] = glm::mat4x3(glm::make_mat4(&matrices[16 * i]));
        }
        return skin;
    }

    // ---- meshes ----

    void add_parts(std::size_t node_index) {
        SceneNode &scene_node = nodes_[node_index];
        const tinygltf::Node &node = model_.nodes[static_cast<std::size_t>(scene_node.file_node)];
        if (node.mesh < 0)
            return;
        const tinygltf::Mesh &mesh = accessors_.at(model_.meshes, node.mesh, "mesh");
        const std::size_t targets = mesh.primitives.empty() ? 0 : mesh.primitives.front().targets.size();
        const std::vector<double> &weights = node.weights.empty() ? mesh.weights : node.weights;
        scene_node.morph_weights.assign(targets, 0);
        for (std::size_t i = 0; i < std::min(targets, weights.size()); ++i)
            if (std::abs(weights[i]) <= coordinate_limit_mm)
                scene_node.morph_weights[i] = static_cast<float>(weights[i]);
        for (std::size_t i = 0; i < mesh.primitives.size(); ++i) {
            const tinygltf::Primitive &primitive = mesh.primitives[i];
            if (primitive.targets.size() != targets)
                accessors_.fail("the primitives of mesh " + std::to_string(node.mesh) +
                                " have different numbers of morph targets");
            const std::string &own_name = node.name.empty() ? mesh.name : node.name;
            Part part{mesh_of(primitive, node.skin >= 0), 0, static_cast<std::uint32_t>(node_index), node.skin,
                      placement_.name + "/" +
                          (own_name.empty() ? "node " + std::to_string(scene_node.file_node) : printable(own_name))};
            if (part.mesh.triangles.empty())
                continue;
            part.material = placement_.material ? *placement_.material : material_of(primitive.material);
            add_missing_texcoords(part);
            parts_.push_back(std::move(part));
        }
    }

    // Adds texture coordinates (0, 0) if the material has textures but the mesh has no texture coordinates.
    void add_missing_texcoords(Part &part) const {
        const arhost_material &m = builder_.material(part.material);
        if (!part.mesh.texcoords.empty() ||
            (m.colour_texture == ARHOST_NONE && m.metallic_roughness_texture == ARHOST_NONE &&
             m.normal_texture == ARHOST_NONE && m.emission_texture == ARHOST_NONE))
            return;
        reporter_.info(part.name +
                       ": the mesh has a texture but no texture coordinates; a corner texel colours the whole mesh");
        part.mesh.texcoords.assign(part.mesh.positions.size(), glm::vec2(0));
    }

    TriangleMesh mesh_of(const tinygltf::Primitive &primitive, bool skinned) {
        TriangleMesh mesh;
        const auto attribute = [](const std::map<std::string, int> &attributes, const char *name) {
            const auto found = attributes.find(name);
            return found == attributes.end() ? -1 : found->second;
        };
        const int mode = primitive.mode < 0 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
        if (mode != TINYGLTF_MODE_TRIANGLES && mode != TINYGLTF_MODE_TRIANGLE_STRIP &&
            mode != TINYGLTF_MODE_TRIANGLE_FAN) {
            reporter_.info(name_ + ": points and lines are ignored");
            return mesh;
        }
        const auto vec3s = [&](int accessor, const char *what) {
            return vectors<glm::vec3>(accessors_.read<float>(accessor, TINYGLTF_TYPE_VEC3, what));
        };
        const auto check = [&](const auto &values, const char *what) {
            for (const auto &value : values)
                for (int i = 0; i < value.length(); ++i)
                    if (!(std::abs(value[i]) <= coordinate_limit_mm))
                        accessors_.fail(std::string(what) + " has a value that is NaN or beyond ±1e9");
        };
        const int position = attribute(primitive.attributes, "POSITION");
        if (position < 0)
            return mesh;
        mesh.positions = vec3s(position, "POSITION");
        check(mesh.positions, "POSITION");
        const std::size_t count = mesh.positions.size();
        const auto check_count = [&](std::size_t found, const char *what) {
            if (found != count)
                accessors_.fail(std::string(what) + " has " + std::to_string(found) + " elements for " +
                                std::to_string(count) + " vertices");
        };
        if (const int normal = attribute(primitive.attributes, "NORMAL"); normal >= 0) {
            mesh.normals = vec3s(normal, "NORMAL");
            check_count(mesh.normals.size(), "NORMAL");
        }
        if (const int texcoord = attribute(primitive.attributes, "TEXCOORD_0"); texcoord >= 0) {
            mesh.texcoords = vectors<glm::vec2>(accessors_.read<float>(texcoord, TINYGLTF_TYPE_VEC2, "TEXCOORD_0"));
            check_count(mesh.texcoords.size(), "TEXCOORD_0");
            check(mesh.texcoords, "TEXCOORD_0");
        }
        mesh.triangles = triangles_of(primitive, mode, count);
        if (skinned)
            read_joints(attribute(primitive.attributes, "JOINTS_0"), attribute(primitive.attributes, "WEIGHTS_0"),
                        count, mesh);
        if (attribute(primitive.attributes, "JOINTS_1") >= 0)
            reporter_.info(name_ + ": vertices have more than four joints; only the first four are used");
        constexpr std::size_t max_offsets = 100'000'000; // for all morph targets together
        if (primitive.targets.size() > max_offsets / std::max<std::size_t>(count, 1))
            accessors_.fail(std::to_string(primitive.targets.size()) + " morph targets of " + std::to_string(count) +
                            " vertices each exceed the limit of 1e8 vertex offsets");
        const bool has_normals = !mesh.normals.empty();
        for (const auto &target : primitive.targets) {
            const auto append = [&](const char *name, std::vector<glm::vec3> &to) {
                const int accessor = attribute(target, name);
                const auto values = accessor < 0 ? std::vector<glm::vec3>(count) : vec3s(accessor, name);
                check_count(values.size(), name);
                check(values, name);
                to.insert(to.end(), values.begin(), values.end());
            };
            append("POSITION", mesh.morph_positions);
            if (has_normals)
                append("NORMAL", mesh.morph_normals);
        }
        complete_normals(mesh, std::nullopt);
        return mesh;
    }

    std::vector<glm::uvec3> triangles_of(const tinygltf::Primitive &primitive, int mode,
                                         std::size_t vertex_count) const {
        std::vector<std::uint32_t> corners;
        if (primitive.indices >= 0) {
            corners = accessors_.read<std::uint32_t>(primitive.indices, TINYGLTF_TYPE_SCALAR, "the triangles");
        } else {
            corners.resize(vertex_count);
            for (std::size_t i = 0; i < corners.size(); ++i)
                corners[i] = static_cast<std::uint32_t>(i);
        }
        for (const std::uint32_t corner : corners)
            if (corner >= vertex_count)
                accessors_.fail("a triangle refers to vertex " + std::to_string(corner) + ", but the mesh has only " +
                                std::to_string(vertex_count));
        std::vector<glm::uvec3> triangles;
        const std::size_t step = mode == TINYGLTF_MODE_TRIANGLES ? 3 : 1;
        triangles.reserve(corners.size() / step);
        for (std::size_t i = 0; i + 2 < corners.size(); i += step) {
            if (mode == TINYGLTF_MODE_TRIANGLE_FAN)
                triangles.emplace_back(corners[i + 1], corners[i + 2], corners[0]);
            else if (mode == TINYGLTF_MODE_TRIANGLE_STRIP && i % 2 == 1)
                triangles.emplace_back(corners[i], corners[i + 2], corners[i + 1]);
            else
                triangles.emplace_back(corners[i], corners[i + 1], corners[i + 2]);
        }
        return triangles;
    }

    void read_joints(int joints, int weights, std::size_t count, TriangleMesh &mesh) const {
        if (joints < 0 || weights < 0)
            accessors_.fail("a mesh has a skin, but not both of the attributes JOINTS_0 and WEIGHTS_0");
        const auto indices = accessors_.read<std::uint32_t>(joints, TINYGLTF_TYPE_VEC4, "JOINTS_0");
        mesh.weights = vectors<glm::vec4>(accessors_.read<float>(weights, TINYGLTF_TYPE_VEC4, "WEIGHTS_0"));
        if (indices.size() != 4 * count || mesh.weights.size() != count)
            accessors_.fail("JOINTS_0 and WEIGHTS_0 must have one element per vertex");
        mesh.joints.resize(count);
        for (std::size_t v = 0; v < count; ++v) {
            glm::vec4 &w = mesh.weights[v];
            for (int i = 0; i < 4; ++i)
                w[i] = w[i] > 0 && w[i] < 1e6f ? w[i] : 0;
            const float sum = w.x + w.y + w.z + w.w;
            w = sum > 0 ? w / sum : glm::vec4(1, 0, 0, 0);
            for (int i = 0; i < 4; ++i)
                mesh.joints[v][i] = w[i] > 0 ? static_cast<std::uint16_t>(std::min(indices[4 * v + i], 65535u)) : 0;
        }
    }

    // Applies skins and morph targets that are not animated to the vertices, in the rest pose.
    void bake_static_deformations() {
        ArenaBuilder at_rest; // temporary scene: the code that evaluates animations computes the rest pose
        at_rest.settings.duration_s = 1;
        for (const SceneNode &node : nodes_) {
            MotionNode world_node;
            world_node.parent_from_node = glm::dmat4x3(node.placement_from_node);
            world_node.morph_weights = node.morph_weights;
            at_rest.add_node(std::move(world_node));
        }
        std::vector<Part *> resting;
        for (Part &part : parts_) {
            const SceneNode &node = nodes_[part.node];
            const bool morphs = !part.mesh.morph_positions.empty();
            if (part.skin < 0 && !morphs)
                continue;
            Skin skin;
            if (part.skin >= 0) {
                skin = skin_of(part.skin, 0);
                for (std::size_t v = 0; v < part.mesh.joints.size(); ++v)
                    for (int i = 0; i < 4; ++i)
                        if (part.mesh.joints[v][i] >= skin.joints.size())
                            accessors_.fail("a vertex refers to joint " + std::to_string(part.mesh.joints[v][i]) +
                                            ", but the skin has only " + std::to_string(skin.joints.size()) +
                                            " joints");
            }
            part.deforms = (morphs && node.has_weights_channel) ||
                           std::ranges::any_of(skin.joints, [&](std::uint32_t j) { return nodes_[j].moves; });
            if (part.deforms)
                continue;
            const std::uint32_t skin_index = part.skin < 0 ? ARHOST_NONE : at_rest.add_skin(std::move(skin));
            at_rest.add_object("", at_rest.add_triangles(std::move(part.mesh)), 0, ARHOST_ROLE_VIRTUAL,
                               glm::mat4x3(1), {false, true, part.node, skin_index});
            resting.push_back(&part);
        }
        if (resting.empty())
            return;
        const Arena arena = std::move(at_rest).build();
        const auto at = [&]<class T>(const arhost_buffer &buffer, T) {
            const T *from = reinterpret_cast<const T *>(arena.bytes().data() + buffer.offset);
            return std::vector<T>(from, from + buffer.count);
        };
        MotionEvaluator evaluator(arena.scene());
        const arhost_motion motion = evaluator.at(0);
        const auto geometries = at(arena.scene().geometries, arhost_geometry());
        for (std::size_t i = 0; i < resting.size(); ++i) {
            TriangleMesh &mesh = resting[i]->mesh;
            mesh = {};
            mesh.triangles = at(geometries[i].indices, glm::uvec3());
            mesh.texcoords = at(geometries[i].texcoords, glm::vec2());
            const auto *positions = reinterpret_cast<const glm::vec3 *>(motion.deformed[i].positions);
            const auto *normals = reinterpret_cast<const glm::vec3 *>(motion.deformed[i].normals);
            mesh.positions.assign(positions, positions + motion.deformed[i].vertex_count);
            if (normals)
                mesh.normals.assign(normals, normals + motion.deformed[i].vertex_count);
        }
    }

    void add_object(Part &part) {
        const SceneNode &node = nodes_[part.node];
        triangles_ += part.mesh.triangles.size();
        vertices_ += part.mesh.positions.size();
        const Transform from_mesh = Transform::of(node.placement_from_node);
        const bool mirrored = glm::determinant(placement_.from_gltf.matrix()) < 0;
        if (part.deforms && part.skin >= 0) {
            if (mirrored) // skinned vertices are in world space, so mirroring flips the winding
                for (glm::uvec3 &t : part.mesh.triangles)
                    std::swap(t.y, t.z);
            const std::uint32_t skin = skin_index(part.skin);
            const bool morphs = !part.mesh.morph_positions.empty();
            finish(part, {false, true, morphs ? first_node_ + part.node : ARHOST_NONE, skin});
        } else if (part.skin < 0 && (part.deforms || node.moves)) {
            Box box;
            for (const glm::vec3 &p : part.mesh.positions)
                box.include(glm::vec3(from_mesh(p)));
            box_.include(box);
            finish(part, {true, part.deforms, first_node_ + part.node, ARHOST_NONE});
        } else {
            if (part.skin < 0)
                from_mesh.apply(part.mesh);
            else if (mirrored)
                for (glm::uvec3 &t : part.mesh.triangles)
                    std::swap(t.y, t.z);
            for (const glm::vec3 &p : part.mesh.positions) {
                box_.include(p);
                if (!(std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) <= coordinate_limit_mm))
                    accessors_.fail("the mesh extends beyond 1e9 mm after its transform");
            }
            const bool moves = placement_.node != ARHOST_NONE;
            finish(part, {moves, false, placement_.node, ARHOST_NONE});
        }
    }

    void finish(Part &part, const Motion &motion) {
        builder_.add_object(part.name, builder_.add_triangles(std::move(part.mesh)), part.material, placement_.role,
                            glm::mat4x3(1), motion);
    }

    std::uint32_t skin_index(int skin) {
        const auto [known, is_new] = skins_.try_emplace(skin);
        if (is_new)
            known->second = builder_.add_skin(skin_of(skin, first_node_));
        return known->second;
    }

    void log_size() const {
        char text[200];
        if (box_.min.x <= box_.max.x)
            std::snprintf(text, sizeof text, ": %zu triangles, %zu vertices, %.4g x %.4g x %.4g mm", triangles_,
                          vertices_, box_.max.x - box_.min.x, box_.max.y - box_.min.y, box_.max.z - box_.min.z);
        else
            std::snprintf(text, sizeof text, ": %zu triangles, %zu vertices, deformed by an animation", triangles_,
                          vertices_);
        reporter_.info(name_ + text);
    }

    // ---- materials ----

    std::uint32_t material_of(int index) {
        const auto [known, is_new] = materials_.try_emplace(index);
        if (is_new)
            known->second = builder_.add_material(
                read_material(index < 0 ? tinygltf::Material() : accessors_.at(model_.materials, index, "material")));
        return known->second;
    }

    arhost_material read_material(const tinygltf::Material &from) {
        const auto number = [](double value, double limit) {
            return static_cast<float>(std::clamp(value, 0.0, limit));
        };
        const auto &pbr = from.pbrMetallicRoughness;
        arhost_material material = make_material(ARHOST_MATERIAL_METALLIC_ROUGHNESS);
        for (std::size_t i = 0; i < 3; ++i) {
            material.ambient[i] = material.diffuse[i] =
                pbr.baseColorFactor.size() > i ? number(pbr.baseColorFactor[i], 1) : 1;
            material.emission[i] =
                from.emissiveFactor.size() > i ? number(from.emissiveFactor[i], radiance_limit) : 0;
        }
        material.metallic = number(pbr.metallicFactor, 1);
        material.roughness = number(pbr.roughnessFactor, 1);
        material.colour_texture = texture_of(pbr.baseColorTexture, true);
        material.metallic_roughness_texture = texture_of(pbr.metallicRoughnessTexture, false);
        material.normal_texture = texture_of(from.normalTexture, false);
        material.emission_texture = texture_of(from.emissiveTexture, true);
        set_alpha_cutoff(from, material);
        return material;
    }

    void set_alpha_cutoff(const tinygltf::Material &from, arhost_material &material) const {
        const bool is_blended = from.alphaMode == "BLEND";
        if (from.alphaMode == "OPAQUE" || from.alphaMode.empty())
            return;
        if (!is_blended && from.alphaMode != "MASK")
            accessors_.fail("the material '" + printable(from.name) + "' has the alphaMode '" +
                            printable(from.alphaMode) + "', which must be OPAQUE, MASK or BLEND");
        const std::vector<double> &factors = from.pbrMetallicRoughness.baseColorFactor;
        const double alpha = factors.size() > 3 ? factors[3] : 1, cutoff = is_blended ? 0.5 : from.alphaCutoff;
        if (!(cutoff >= 0))
            accessors_.fail("the material '" + printable(from.name) + "' has an alphaCutoff below 0");
        const bool is_textured = material.colour_texture != ARHOST_NONE;
        const auto info = [&](const char *what) {
            reporter_.info(name_ + ": the material '" + printable(from.name) + "' is " + what);
        };
        if (is_blended)
            info(is_textured ? "blended; drawn with holes where its alpha is below 0.5"
                             : "translucent; drawn opaque unless 'material' replaces it, for example with glass");
        else if (alpha < cutoff)
            info("invisible, because its alpha factor is below its alphaCutoff; drawn where its texture is opaque");
        // In the file, the cutoff applies to the product of texture alpha and alpha factor.
        if (is_textured && cutoff > 0)
            material.alpha_cutoff = alpha > cutoff ? static_cast<float>(cutoff / alpha) : 1;
    }

    template <class Info> std::uint32_t texture_of(const Info &info, bool is_colour) {
        if (info.index < 0)
            return ARHOST_NONE;
        if (info.texCoord != 0)
            reporter_.info(name_ + ": a texture uses the texture coordinates TEXCOORD_" +
                           std::to_string(info.texCoord) + ", which is unsupported; TEXCOORD_0 is used instead");
        const tinygltf::Texture &texture = accessors_.at(model_.textures, info.index, "texture");
        const tinygltf::Image &image = accessors_.at(model_.images, texture.source, "image");
        if (image.image.empty())
            accessors_.fail("the image '" + printable(image.uri.substr(0, 100)) + "' cannot be read");
        TextureUse use{is_colour};
        if (texture.sampler >= 0) {
            const auto wrap = [](int mode) {
                return mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE     ? ARHOST_WRAP_CLAMP
                       : mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? ARHOST_WRAP_MIRROR
                                                                       : ARHOST_WRAP_REPEAT;
            };
            const tinygltf::Sampler &sampler = accessors_.at(model_.samplers, texture.sampler, "sampler");
            use.wrap_u = wrap(sampler.wrapS);
            use.wrap_v = wrap(sampler.wrapT);
        }
        return textures_.add(file_, use, image.image, "#image " + std::to_string(texture.source));
    }

    ArenaBuilder &builder_;
    Textures &textures_;
    const std::filesystem::path &file_;
    const std::string name_;
    const GltfPlacement &placement_;
    const Reporter reporter_;
    const tinygltf::Model model_;
    const Accessors accessors_;
    std::vector<SceneNode> nodes_;
    std::vector<std::uint32_t> scene_index_; // file node → index in nodes_ or ARHOST_NONE
    const tinygltf::Animation *animation_ = nullptr;
    float duration_s_ = 0;
    std::uint32_t first_node_ = 0; // arena index of nodes_[0]
    std::vector<Part> parts_;
    std::map<int, std::uint32_t> materials_, skins_; // index in the file → index in the arena
    std::size_t triangles_ = 0, vertices_ = 0;
    Box box_;
};

} // namespace

float add_gltf(ArenaBuilder &builder, Textures &textures, const std::filesystem::path &file,
               const GltfPlacement &placement, const LoadCallbacks &callbacks) {
    return GltfLoader(builder, textures, file, placement, callbacks).load();
}

} // namespace arhost::scene
