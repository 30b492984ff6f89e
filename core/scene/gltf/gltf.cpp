// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/gltf.hpp"

#include "scene/box.hpp"
#include "scene/gltf/accessors.hpp"
#include "scene/gltf/lights.hpp"
#include "scene/gltf/materials.hpp"
#include "scene/material_textures.hpp"
#include "scene/motion.hpp"
#include "scene/tangents.hpp"

#include <glm/gtc/quaternion.hpp>
#include <glm/gtc/type_ptr.hpp>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <map>
#include <set>
#include <span>

namespace arhost::scene {
namespace {

constexpr std::size_t most_instances = 1'000'000; // of all meshes together

double invertible_scale(double scale) { // a scale of 0 hides objects, but has no inverse
    constexpr double least = 1e-6;
    return std::abs(scale) < least ? std::copysign(least, scale) : scale;
}

// docs/scenes.md lists them.
constexpr std::string_view supported_extensions[] = {
    "EXT_mesh_gpu_instancing",    "EXT_meshopt_compression",
    "EXT_texture_webp",           "KHR_draco_mesh_compression",
    "KHR_lights_punctual",        "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",    "KHR_materials_emissive_strength",
    "KHR_materials_ior",          "KHR_materials_iridescence",
    "KHR_materials_sheen",        "KHR_materials_specular",
    "KHR_materials_transmission", "KHR_materials_unlit",
    "KHR_materials_variants",     "KHR_materials_volume",
    "KHR_mesh_quantization",      "KHR_texture_transform",
};

bool is_supported(const std::string &extension) {
    return std::ranges::find(supported_extensions, extension) != std::end(supported_extensions);
}

class GltfLoader {
public:
    GltfLoader(ArenaBuilder &builder, Textures &textures, const std::filesystem::path &file,
               const GltfPlacement &placement, const LoadCallbacks &callbacks)
        : builder_(builder), name_(file.string()), placement_(placement),
          reporter_(callbacks, file.filename().string()), content_(read_gltf_file(file, placement.reads, reporter_)),
          model_(content_.model), accessors_(model_, name_),
          materials_(builder, textures, file, name_, content_, accessors_) {}

    float load() {
        check_extensions();
        collect_nodes();
        builder_.contents.nodes += nodes_.size();
        choose_animations();
        choose_variant();
        count_uses();
        for (std::size_t i = 0; i < nodes_.size(); ++i) {
            add_parts(i);
            reporter_.report(static_cast<double>(i) / static_cast<double>(nodes_.size()));
        }
        if (parts_.empty())
            accessors_.fail("its default scene contains no triangles");
        find_deforming_parts();
        place();
        bake_static_deformations();
        if (placement_.has_lights)
            add_lights();
        if (!animations_.empty())
            add_motion();
        for (Part &part : parts_)
            add_object(part);
        log_size();
        return duration_s_;
    }

private:
    struct SceneNode {
        int file_node;                      // index of the node in the file
        std::uint32_t parent = ARHOST_NONE; // index in nodes_
        // In the rest pose; to the axes of the scene until place(), then to the coordinates of placement_.node.
        glm::dmat4 placement_from_node{1};
        bool has_channel = false; // the animation changes its translation, rotation or scale
        bool moves = false;       // the animation moves this node or an ancestor
        bool has_weights_channel = false;
        std::vector<float> morph_weights;
    };

    // A mesh that several objects show. The transforms of these objects are not applied to its vertices.
    struct SharedMesh {
        std::uint32_t geometry = 0; // index in the arena
        Box box;
        bool is_closed = false;
        std::size_t triangles = 0, vertices = 0;
    };

    struct Part {
        TriangleMesh mesh; // empty if `shared` is not NULL
        const SharedMesh *shared;
        std::uint32_t material, node; // node: index in nodes_
        int skin;
        std::string name;
        bool hides_back_faces;
        std::optional<glm::dmat4> node_from_instance; // of EXT_mesh_gpu_instancing
        bool deforms = false;
    };

    // Logs a sentence once.
    void notice(const std::string &text) {
        if (notices_.insert(text).second)
            reporter_.info(name_ + ": " + text);
    }

    JsonNode json_of(const char *table, int index) const {
        return {content_.json[table][static_cast<std::size_t>(index)],
                std::string(table) + "[" + std::to_string(index) + "]", name_};
    }

    void check_extensions() {
        if (!model_.cameras.empty())
            notice("cameras are ignored; the tracker is the camera");
        std::string ignored;
        for (const std::string &extension : model_.extensionsUsed)
            if (!is_supported(extension))
                ignored += (ignored.empty() ? "" : ", ") + extension;
        for (std::size_t i = 0; i < model_.extensionsRequired.size(); ++i)
            if (const std::string &extension = model_.extensionsRequired[i]; !is_supported(extension))
                accessors_.fail("extensionsRequired[" + std::to_string(i) + "] requires the unsupported extension '" +
                                printable(extension) + "'; " +
                                (extension == ktx2_extension ? ktx2_conversion : "export it without this extension"));
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
        const glm::dmat4 root = placement_.axes_from_gltf.matrix();
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
            factor = invertible_scale(factor);
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

    // Returns the animation with a name or an index; NULL if there is none.
    const tinygltf::Animation *find_animation(const std::string &wanted) const {
        for (const tinygltf::Animation &animation : model_.animations)
            if (animation.name == wanted)
                return &animation;
        std::size_t number = 0;
        const auto [end, error] = std::from_chars(wanted.data(), wanted.data() + wanted.size(), number);
        return error == std::errc() && end == wanted.data() + wanted.size() && number < model_.animations.size()
                   ? &model_.animations[number]
                   : nullptr;
    }

    // The specification requires that the accessor of the times has a maximum.
    float duration_of(const tinygltf::Animation &animation) const {
        double duration_s = 0;
        for (const tinygltf::AnimationSampler &sampler : animation.samplers)
            if (static_cast<std::size_t>(sampler.input) < model_.accessors.size()) // else fails only if selected
                if (const auto &maxima = model_.accessors[static_cast<std::size_t>(sampler.input)].maxValues;
                    !maxima.empty())
                    duration_s = std::max(duration_s, maxima.front());
        return static_cast<float>(std::min<double>(duration_s, duration_limit_s));
    }

    void choose_animations() {
        for (const tinygltf::Animation &animation : model_.animations)
            builder_.contents.animations.push_back({animation.name, duration_of(animation)});
        std::string names;
        for (std::size_t i = 0; i < model_.animations.size(); ++i)
            names += (i ? ", " : "") + std::to_string(i) + " '" + printable(model_.animations[i].name) + "'";
        if (placement_.animations.empty() && !names.empty())
            reporter_.info(name_ + ": no animation selected; available for 'animation': " + names);
        for (const std::string &wanted : placement_.animations)
            if (const tinygltf::Animation *animation = find_animation(wanted))
                animations_.push_back(animation);
            else if (wanted == "all" && !model_.animations.empty())
                for (const tinygltf::Animation &each : model_.animations)
                    animations_.push_back(&each);
            else
                throw AnimationError(name_ + ": has no animation '" + printable(wanted) + "'" +
                                     (names.empty() ? "; the file has no animations" : "; available: " + names));
        for (const tinygltf::Animation *animation : animations_)
            mark_animated_nodes(*animation);
        for (SceneNode &node : nodes_) {
            node.moves = node.has_channel || (node.parent != ARHOST_NONE && nodes_[node.parent].moves);
            if (node.has_channel && !model_.nodes[static_cast<std::size_t>(node.file_node)].matrix.empty())
                accessors_.fail("node " + std::to_string(node.file_node) +
                                " has a matrix; animated nodes must have translation, rotation and scale instead");
        }
    }

    void mark_animated_nodes(const tinygltf::Animation &animation) {
        for (const tinygltf::AnimationChannel &channel : animation.channels) {
            if (const auto node = find_node(channel.target_node)) {
                if (channel.target_path == "weights")
                    nodes_[*node].has_weights_channel = true;
                else if (channel.target_path == "translation" || channel.target_path == "rotation" ||
                         channel.target_path == "scale")
                    nodes_[*node].has_channel = true;
            }
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

    Channel channel_of(const tinygltf::Animation &animation, const tinygltf::AnimationChannel &from,
                       std::uint32_t node) {
        const tinygltf::AnimationSampler &sampler = accessors_.at(animation.samplers, from.sampler, "sampler");
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
        for (float &time : channel.times)
            time /= placement_.speed;
        if (cubic) // tangents are changes per second
            for (std::size_t i = 0; i < values.size(); ++i)
                if (i / width % 3 != 1)
                    values[i] *= placement_.speed;
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
        root.parent_from_node = glm::dmat4x3((placed_ * placement_.axes_from_gltf).matrix());
        const std::uint32_t root_index = builder_.add_node(root);
        first_node_ = root_index + 1;
        for (const SceneNode &node : nodes_) {
            MotionNode added = motion_node(node);
            added.parent = node.parent == ARHOST_NONE ? root_index : first_node_ + node.parent;
            builder_.add_node(std::move(added));
        }
        for (const tinygltf::Animation *animation : animations_) {
            std::vector<Channel> channels;
            float duration_s = 0;
            for (const tinygltf::AnimationChannel &channel : animation->channels)
                if (const auto node = find_node(channel.target_node)) {
                    const bool weights = channel.target_path == "weights";
                    if (weights ? !nodes_[*node].morph_weights.empty() : nodes_[*node].has_channel) {
                        channels.push_back(channel_of(*animation, channel, *node));
                        duration_s = std::max(duration_s, channels.back().times.back());
                    }
                }
            for (Channel &channel : channels) {
                channel.period_s = placement_.loops ? duration_s : 0;
                builder_.add_channel(std::move(channel));
            }
            duration_s_ = std::max(duration_s_, duration_s);
        }
        if (!(duration_s_ > 0))
            throw AnimationError(name_ + ": the animation '" + printable(animations_.front()->name) +
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

    // Counts how often the scene shows each mesh.
    void count_uses() {
        mesh_uses_.assign(model_.meshes.size(), 0);
        for (const SceneNode &node : nodes_)
            if (const int mesh = model_.nodes[static_cast<std::size_t>(node.file_node)].mesh;
                mesh >= 0 && static_cast<std::size_t>(mesh) < mesh_uses_.size())
                mesh_uses_[static_cast<std::size_t>(mesh)] += instance_count_of(node.file_node);
    }

    std::size_t instance_count_of(int node) const {
        const auto extension = json_of("nodes", node).extension("EXT_mesh_gpu_instancing");
        const auto attributes = extension ? extension->find("attributes") : std::nullopt;
        for (const char *key : {"TRANSLATION", "ROTATION", "SCALE"})
            if (const auto accessor = attributes ? attributes->find(key) : std::nullopt)
                return accessors_.count(accessor->index());
        return 1;
    }

    // EXT_mesh_gpu_instancing. Returns the transforms of the instances of a node's mesh, relative to the node; empty
    // if the node has no such extension.
    std::vector<glm::dmat4> instances_of(int node) const {
        const auto extension = json_of("nodes", node).extension("EXT_mesh_gpu_instancing");
        const auto attributes = extension ? extension->find("attributes") : std::nullopt;
        if (!attributes)
            return {};
        std::vector<glm::dmat4> instances;
        const auto read = [&](const char *key, int type, std::size_t width) {
            const auto accessor = attributes->find(key);
            if (!accessor)
                return std::vector<float>();
            std::vector<float> values = accessors_.read<float>(accessor->index(), type, key);
            const std::size_t count = values.size() / width;
            if (count > most_instances || count == 0 || (!instances.empty() && instances.size() != count))
                accessor->fail("has " + std::to_string(count) +
                               " elements; all attributes of instances must have the "
                               "same number, 1 to " +
                               std::to_string(most_instances));
            if (!std::ranges::all_of(values, [](float v) { return std::abs(v) <= coordinate_limit_mm; }))
                accessor->fail("has a value that is NaN or beyond ±1e9");
            instances.resize(count, glm::dmat4(1));
            return values;
        };
        const std::vector<float> translations = read("TRANSLATION", TINYGLTF_TYPE_VEC3, 3),
                                 rotations = read("ROTATION", TINYGLTF_TYPE_VEC4, 4),
                                 scales = read("SCALE", TINYGLTF_TYPE_VEC3, 3);
        for (std::size_t i = 0; i < instances.size(); ++i) {
            if (!rotations.empty()) {
                const float *r = &rotations[4 * i];
                const glm::dquat rotation(r[3], r[0], r[1], r[2]);
                instances[i] =
                    glm::length(rotation) > 1e-6 ? glm::mat4_cast(glm::normalize(rotation)) : glm::dmat4(1);
            }
            for (int axis = 0; !scales.empty() && axis < 3; ++axis)
                instances[i][axis] *= invertible_scale(scales[3 * i + static_cast<std::size_t>(axis)]);
            if (!translations.empty())
                instances[i][3] = glm::dvec4(glm::make_vec3(&translations[3 * i]), 1);
        }
        return instances;
    }

    // KHR_materials_variants
    void choose_variant() {
        std::string names;
        if (const auto extension = JsonNode(content_.json, "", name_).extension("KHR_materials_variants"))
            if (const auto variants = extension->find("variants")) {
                const std::vector<JsonNode> items = variants->items();
                for (std::size_t i = 0; i < items.size(); ++i) {
                    const std::string name = items[i].text_or("name", "");
                    builder_.contents.variants.push_back(name);
                    if (name == placement_.variant && !variant_)
                        variant_ = i;
                    names += (i ? ", '" : "'") + printable(name) + "'";
                }
            }
        if (placement_.variant && !variant_)
            throw VariantError(name_ + ": has no variant '" + printable(*placement_.variant) + "'" +
                               (names.empty() ? "; the file has no variants" : "; available: " + names));
        if (!placement_.variant && !names.empty())
            reporter_.info(name_ + ": no variant selected; available for 'variant': " + names);
    }

    // Returns the index in the file of the material of a primitive, or −1 for the default material.
    int material_of(const JsonNode &primitive) const {
        if (const auto extension = primitive.extension("KHR_materials_variants"); extension && variant_)
            if (const auto mappings = extension->find("mappings"))
                for (const JsonNode &mapping : mappings->items())
                    if (const auto variants = mapping.find("variants"))
                        for (const JsonNode &variant : variants->items())
                            if (static_cast<std::size_t>(variant.index()) == *variant_)
                                if (const auto material = mapping.find("material"))
                                    return material->index();
        const auto material = primitive.find("material");
        return material ? material->index() : -1;
    }

    const GltfMaterials::Material &material_of_primitive(int mesh, std::size_t primitive) {
        const auto [known, is_new] = primitive_materials_.try_emplace({mesh, primitive});
        if (is_new) {
            const JsonNode of_mesh = json_of("meshes", mesh);
            const std::vector<JsonNode> primitives = of_mesh.find("primitives")->items();
            if (primitives.size() != model_.meshes[static_cast<std::size_t>(mesh)].primitives.size())
                of_mesh.fail("has a primitive without attributes");
            known->second = materials_.at(material_of(primitives[primitive]));
        }
        return known->second;
    }

    void add_parts(std::size_t node_index) {
        SceneNode &scene_node = nodes_[node_index];
        const tinygltf::Node &node = model_.nodes[static_cast<std::size_t>(scene_node.file_node)];
        if (node.mesh < 0)
            return;
        const tinygltf::Mesh &mesh = accessors_.at(model_.meshes, node.mesh, "mesh");
        if (mesh.primitives.empty())
            return;
        const std::size_t targets = mesh.primitives.front().targets.size();
        const std::vector<double> &weights = node.weights.empty() ? mesh.weights : node.weights;
        scene_node.morph_weights.assign(targets, 0);
        for (std::size_t i = 0; i < std::min(targets, weights.size()); ++i)
            if (std::abs(weights[i]) <= coordinate_limit_mm)
                scene_node.morph_weights[i] = static_cast<float>(weights[i]);
        std::vector<glm::dmat4> instances = instances_of(scene_node.file_node);
        if (!instances.empty() && (node.skin >= 0 || targets > 0)) {
            notice("instances of meshes that deform are ignored");
            instances.clear();
        }
        const bool is_shared = (mesh_uses_[static_cast<std::size_t>(node.mesh)] > 1 || !instances.empty()) &&
                               node.skin < 0 && targets == 0;
        const std::string &own_name = node.name.empty() ? mesh.name : node.name;
        const std::string name =
            placement_.name + "/" +
            (own_name.empty() ? "node " + std::to_string(scene_node.file_node) : printable(own_name));
        for (std::size_t i = 0; i < mesh.primitives.size(); ++i) {
            const tinygltf::Primitive &primitive = mesh.primitives[i];
            if (primitive.targets.size() != targets)
                accessors_.fail("the primitives of mesh " + std::to_string(node.mesh) +
                                " have different numbers of morph targets");
            GltfMaterials::Material material{0, true};
            if (placement_.material)
                material.index = *placement_.material;
            else
                material = material_of_primitive(node.mesh, i);
            const auto read_mesh = [&] { return mesh_of(primitive, node.skin >= 0, name, material.index); };
            if (!is_shared) {
                TriangleMesh own = read_mesh();
                const bool hides = !material.is_double_sided && !own.triangles.empty() && !is_closed(own);
                if (!own.triangles.empty())
                    parts_.push_back({std::move(own), nullptr, material.index, static_cast<std::uint32_t>(node_index),
                                      node.skin, name, hides, std::nullopt});
                continue;
            }
            const auto [known, is_new] = shared_.try_emplace({node.mesh, i});
            SharedMesh &shared = known->second;
            if (is_new) {
                TriangleMesh read = read_mesh();
                shared.triangles = read.triangles.size();
                shared.vertices = read.positions.size();
                shared.box = box_of(std::span<const glm::vec3>(read.positions));
                if (shared.triangles > 0) {
                    shared.is_closed = is_closed(read);
                    complete_tangents(read, material.index);
                    shared.geometry = builder_.add_triangles(std::move(read));
                }
            }
            if (shared.triangles == 0)
                continue;
            const Part part{{},
                            &shared,
                            material.index,
                            static_cast<std::uint32_t>(node_index),
                            -1,
                            name,
                            !material.is_double_sided && !shared.is_closed,
                            std::nullopt};
            if (instances.empty())
                parts_.push_back(part);
            for (const glm::dmat4 &instance : instances) {
                parts_.push_back(part);
                parts_.back().node_from_instance = instance;
            }
            if (parts_.size() > most_instances)
                accessors_.fail("has more than " + std::to_string(most_instances) + " instances");
        }
    }

    // `name`: of the object; `material`: index in the arena.
    TriangleMesh mesh_of(const tinygltf::Primitive &primitive, bool skinned, const std::string &name,
                         std::uint32_t material) {
        TriangleMesh mesh;
        const auto attribute = [](const std::map<std::string, int> &attributes, const char *name) {
            const auto found = attributes.find(name);
            return found == attributes.end() ? -1 : found->second;
        };
        const int mode = primitive.mode < 0 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
        if (mode != TINYGLTF_MODE_TRIANGLES && mode != TINYGLTF_MODE_TRIANGLE_STRIP &&
            mode != TINYGLTF_MODE_TRIANGLE_FAN) {
            notice("points and lines are ignored; ray tracers draw surfaces only");
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
        if (const int tangent = attribute(primitive.attributes, "TANGENT");
            tangent >= 0 && !mesh.normals.empty() && normal_texcoord_set_of(material)) {
            mesh.tangents = tangents_of(tangent);
            check_count(mesh.tangents.size(), "TANGENT");
        }
        for (std::uint32_t set = 0; set < texcoord_sets_of(material); ++set) {
            const std::string key = "TEXCOORD_" + std::to_string(set);
            std::vector<glm::vec2> texcoords(count);
            if (const int texcoord = attribute(primitive.attributes, key.c_str()); texcoord >= 0) {
                texcoords = vectors<glm::vec2>(accessors_.read<float>(texcoord, TINYGLTF_TYPE_VEC2, key.c_str()));
                check_count(texcoords.size(), key.c_str());
                check(texcoords, key.c_str());
            } else if (uses_texcoord_set(material, set)) {
                notice(name + ": its material has a texture, but the mesh has no texture coordinates " + key +
                       "; a corner texel colours the whole mesh");
            }
            mesh.texcoords.insert(mesh.texcoords.end(), texcoords.begin(), texcoords.end());
        }
        if (const int colour = attribute(primitive.attributes, "COLOR_0"); colour >= 0) {
            mesh.colours = colours_of(colour);
            check_count(mesh.colours.size(), "COLOR_0");
        }
        if (attribute(primitive.attributes, "COLOR_1") >= 0)
            notice("COLOR_1 and later sets of vertex colours are ignored");
        mesh.triangles = triangles_of(primitive, mode, count);
        if (skinned)
            read_joints(primitive, count, mesh);
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

    // Returns 1 + the highest set of texture coordinates that a material needs; 0 if it needs none.
    std::uint32_t texcoord_sets_of(std::uint32_t material) const {
        const auto of_normals = normal_texcoord_set_of(material);
        std::uint32_t sets = of_normals ? *of_normals + 1 : 0;
        for (const std::uint32_t texture : textures_of(builder_.material(material)))
            if (texture != ARHOST_NONE)
                sets = std::max(sets, builder_.texture(texture).texcoord_set + 1);
        return sets;
    }
    bool uses_texcoord_set(std::uint32_t material, std::uint32_t set) const {
        return std::ranges::any_of(textures_of(builder_.material(material)), [&](std::uint32_t texture) {
            return texture != ARHOST_NONE && builder_.texture(texture).texcoord_set == set;
        });
    }

    // Returns the set of texture coordinates along which a material needs tangents; std::nullopt if it needs none.
    // Textures that are turned or mirrored, or use several sets, need other tangents, which ray tracers compute for
    // each triangle.
    std::optional<std::uint32_t> normal_texcoord_set_of(std::uint32_t material) const {
        const arhost_material &of = builder_.material(material);
        std::optional<std::uint32_t> set;
        for (const std::uint32_t texture :
             {of.normal_texture, of.anisotropy > 0 ? of.anisotropy_texture : ARHOST_NONE,
              of.clearcoat_normal_texture})
            if (texture != ARHOST_NONE) {
                const glm::mat3x2 &m = builder_.texture(texture).image_from_texcoord;
                const std::uint32_t own = builder_.texture(texture).texcoord_set;
                if (m[0].x <= 0 || m[1].y <= 0 || m[0].y != 0 || m[1].x != 0 || own != set.value_or(own))
                    return std::nullopt;
                set = own;
            }
        return set || of.anisotropy == 0 ? set : std::optional(0u);
    }

    void complete_tangents(TriangleMesh &mesh, std::uint32_t material) const {
        const auto set = normal_texcoord_set_of(material);
        if (set && mesh.texcoords.size() / mesh.positions.size() > *set)
            add_tangents(mesh, *set);
    }

    std::vector<glm::vec4> tangents_of(int accessor) const {
        auto tangents = vectors<glm::vec4>(accessors_.read<float>(accessor, TINYGLTF_TYPE_VEC4, "TANGENT"));
        for (glm::vec4 &tangent : tangents) {
            const float length = glm::length(glm::vec3(tangent));
            tangent = length > 1e-6f && length < 1e6f
                          ? glm::vec4(glm::vec3(tangent) / length, tangent.w < 0 ? -1.f : 1.f)
                          : glm::vec4(0);
        }
        return tangents;
    }

    // KHR_lights_punctual
    void add_lights() {
        const GltfLights lights(content_.json, name_);
        const double scale = std::cbrt(std::abs(glm::determinant(glm::dmat3(placed_.matrix()))));
        for (const SceneNode &node : nodes_)
            if (const auto light = json_of("nodes", node.file_node).extension("KHR_lights_punctual")) {
                if (builder_.settings.integrator != ARHOST_INTEGRATOR_PATH)
                    notice("lights are ignored; they need 'integrator: path'");
                else if (node.moves || placement_.node != ARHOST_NONE)
                    notice("lights that move are ignored");
                else
                    builder_.add_light(lights.at(*light, node.placement_from_node, scale));
            }
    }

    std::vector<glm::u16vec4> colours_of(int accessor) const {
        const std::size_t width = accessors_.type(accessor) == TINYGLTF_TYPE_VEC3 ? 3 : 4;
        const std::vector<float> values =
            accessors_.read<float>(accessor, width == 3 ? TINYGLTF_TYPE_VEC3 : TINYGLTF_TYPE_VEC4, "COLOR_0");
        std::vector<glm::u16vec4> colours(values.size() / width, glm::u16vec4(65535));
        for (std::size_t i = 0; i < values.size(); ++i)
            colours[i / width][static_cast<int>(i % width)] = colour_channel(static_cast<double>(values[i]));
        return colours;
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

    void read_joints(const tinygltf::Primitive &primitive, std::size_t count, TriangleMesh &mesh) const {
        for (int set = 0;; ++set) {
            const std::string joints = "JOINTS_" + std::to_string(set), weights = "WEIGHTS_" + std::to_string(set);
            const auto of_joints = primitive.attributes.find(joints), of_weights = primitive.attributes.find(weights),
                       none = primitive.attributes.end();
            if (set > 0 && of_joints == none && of_weights == none)
                break;
            constexpr int most_sets = 16; // limits the memory of a mesh
            if (set == most_sets)
                accessors_.fail("a mesh has more than " + std::to_string(4 * most_sets) + " joints per vertex");
            if (of_joints == none || of_weights == none)
                accessors_.fail("a mesh has a skin, but not both of the attributes " + joints + " and " + weights);
            const auto indices =
                accessors_.read<std::uint32_t>(of_joints->second, TINYGLTF_TYPE_VEC4, joints.c_str());
            const auto shares =
                vectors<glm::vec4>(accessors_.read<float>(of_weights->second, TINYGLTF_TYPE_VEC4, weights.c_str()));
            if (indices.size() != 4 * count || shares.size() != count)
                accessors_.fail(joints + " and " + weights + " must have one element per vertex");
            for (std::size_t v = 0; v < count; ++v) {
                glm::vec4 &w = mesh.weights.emplace_back(shares[v]);
                glm::u16vec4 &j = mesh.joints.emplace_back(0);
                for (int i = 0; i < 4; ++i) {
                    w[i] = w[i] > 0 && w[i] < 1e6f ? w[i] : 0;
                    j[i] = w[i] > 0 ? static_cast<std::uint16_t>(std::min(indices[4 * v + i], 65535u)) : 0;
                }
            }
        }
        for (std::size_t v = 0; v < count; ++v) {
            float sum = 0;
            for (std::size_t set = v; set < mesh.weights.size(); set += count)
                sum += mesh.weights[set].x + mesh.weights[set].y + mesh.weights[set].z + mesh.weights[set].w;
            for (std::size_t set = v; set < mesh.weights.size(); set += count)
                mesh.weights[set] = sum > 0 ? mesh.weights[set] / sum : glm::vec4(set == v, 0, 0, 0);
        }
    }

    void find_deforming_parts() {
        for (Part &part : parts_) {
            const SceneNode &node = nodes_[part.node];
            if (part.skin >= 0) {
                const Skin skin = skin_of(part.skin, 0);
                for (std::size_t v = 0; v < part.mesh.joints.size(); ++v)
                    for (int i = 0; i < 4; ++i)
                        if (part.mesh.joints[v][i] >= skin.joints.size())
                            accessors_.fail("a vertex refers to joint " + std::to_string(part.mesh.joints[v][i]) +
                                            ", but the skin has only " + std::to_string(skin.joints.size()) +
                                            " joints");
                part.deforms = std::ranges::any_of(skin.joints, [&](std::uint32_t j) { return nodes_[j].moves; });
            }
            part.deforms |= !part.mesh.morph_positions.empty() && node.has_weights_channel;
        }
    }

    static bool is_deformed(const Part &part) { return part.skin >= 0 || !part.mesh.morph_positions.empty(); }

    // Returns the meshes of parts that are deformed, in the rest pose. Skinned meshes are relative to
    // placement_.node.
    std::vector<TriangleMesh> at_rest(std::span<Part *const> parts) const {
        ArenaBuilder builder; // temporary scene: the code that evaluates animations computes the rest pose
        builder.settings.duration_s = 1;
        for (const SceneNode &node : nodes_) {
            MotionNode world_node;
            world_node.parent_from_node = glm::dmat4x3(node.placement_from_node);
            world_node.morph_weights = node.morph_weights;
            builder.add_node(std::move(world_node));
        }
        for (const Part *part : parts) {
            const std::uint32_t skin = part->skin < 0 ? ARHOST_NONE : builder.add_skin(skin_of(part->skin, 0));
            builder.add_object("", builder.add_triangles(part->mesh), 0, ARHOST_ROLE_VIRTUAL, glm::mat4x3(1),
                               {false, true, part->node, skin});
        }
        const Arena arena = std::move(builder).build();
        const auto at = [&]<class T>(const arhost_buffer &buffer, T) {
            const T *from = reinterpret_cast<const T *>(arena.bytes().data() + buffer.offset);
            return std::vector<T>(from, from + buffer.count);
        };
        MotionEvaluator evaluator(arena.scene());
        const arhost_motion motion = evaluator.at(0);
        const auto geometries = at(arena.scene().geometries, arhost_geometry());
        std::vector<TriangleMesh> meshes(parts.size());
        for (std::size_t i = 0; i < parts.size(); ++i) {
            TriangleMesh &mesh = meshes[i];
            mesh.triangles = at(geometries[i].indices, glm::uvec3());
            mesh.texcoords = at(geometries[i].texcoords, glm::vec2());
            mesh.colours = at(geometries[i].colours, glm::u16vec4());
            const auto *positions = reinterpret_cast<const glm::vec3 *>(motion.deformed[i].positions);
            const auto *normals = reinterpret_cast<const glm::vec3 *>(motion.deformed[i].normals);
            mesh.positions.assign(positions, positions + motion.deformed[i].vertex_count);
            if (normals)
                mesh.normals.assign(normals, normals + motion.deformed[i].vertex_count);
        }
        return meshes;
    }

    // Returns the bounding box in the rest pose.
    Box box_at_rest() {
        std::vector<Part *> deformed;
        for (Part &part : parts_)
            if (is_deformed(part))
                deformed.push_back(&part);
        const std::vector<TriangleMesh> posed = at_rest(deformed);
        std::size_t next = 0; // in `posed`
        Box box;
        for (const Part &part : parts_) {
            const Transform from_mesh = Transform::of(nodes_[part.node].placement_from_node *
                                                      part.node_from_instance.value_or(glm::dmat4(1)));
            const auto include = [&](const glm::vec3 &p) {
                box.include(part.skin >= 0 ? p : glm::vec3(from_mesh(p)));
            };
            if (part.shared) {
                const glm::mat4x3 matrix(from_mesh.matrix());
                box.include(transformed(glm::value_ptr(matrix), part.shared->box));
            } else {
                std::ranges::for_each(is_deformed(part) ? posed[next++].positions : part.mesh.positions, include);
            }
        }
        return box;
    }

    // Fits and places the model.
    void place() {
        placed_ =
            placement_.placed * placement_.fit.transform(placement_.fit.needs_box() ? box_at_rest() : Box(), up());
        for (SceneNode &node : nodes_)
            node.placement_from_node = placed_.matrix() * node.placement_from_node;
        if (!placement_.material)
            materials_.scale_volumes(std::cbrt(std::abs(glm::determinant(glm::dmat3(placed_.matrix())))));
    }

    // Applies skins and morph targets that are not animated to the vertices, in the rest pose.
    void bake_static_deformations() {
        std::vector<Part *> resting;
        for (Part &part : parts_)
            if (is_deformed(part) && !part.deforms)
                resting.push_back(&part);
        if (resting.empty())
            return;
        std::vector<TriangleMesh> meshes = at_rest(resting);
        for (std::size_t i = 0; i < resting.size(); ++i)
            resting[i]->mesh = std::move(meshes[i]);
    }

    void add_object(Part &part) {
        const SceneNode &node = nodes_[part.node];
        if (part.shared) {
            add_instance(part);
            return;
        }
        triangles_ += part.mesh.triangles.size();
        vertices_ += part.mesh.positions.size();
        const Transform from_mesh = Transform::of(node.placement_from_node);
        const bool mirrored = glm::determinant(placed_.matrix()) < 0;
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

    // Adds an object that shows a shared mesh.
    void add_instance(const Part &part) {
        const SceneNode &node = nodes_[part.node];
        const glm::dmat4 node_from_mesh = part.node_from_instance.value_or(glm::dmat4(1)),
                         placement_from_mesh = node.placement_from_node * node_from_mesh;
        triangles_ += part.shared->triangles;
        vertices_ += part.shared->vertices;
        const glm::mat4x3 matrix(placement_from_mesh);
        box_.include(transformed(glm::value_ptr(matrix), part.shared->box));
        Motion motion;
        if (node.moves || placement_.node != ARHOST_NONE) {
            MotionNode own;
            own.parent = node.moves ? first_node_ + part.node : placement_.node;
            own.parent_from_node = glm::dmat4x3(node.moves ? node_from_mesh : placement_from_mesh);
            motion = {true, false, builder_.add_node(std::move(own)), ARHOST_NONE};
        }
        builder_.add_object(part.name, part.shared->geometry, part.material, placement_.role,
                            motion.moves ? glm::mat4x3(1) : matrix, motion, part.hides_back_faces);
    }

    void finish(Part &part, const Motion &motion) {
        if (part.deforms)
            part.mesh.tangents.clear();
        else
            complete_tangents(part.mesh, part.material);
        builder_.add_object(part.name, builder_.add_triangles(std::move(part.mesh)), part.material, placement_.role,
                            glm::mat4x3(1), motion, part.hides_back_faces);
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
        if (placement_.role == ARHOST_ROLE_VIRTUAL && placement_.node == ARHOST_NONE && box_.min.x <= box_.max.x)
            if (const std::string warning = placement_warning(box_, up()); !warning.empty())
                reporter_.warning(name_ + ": " + warning);
    }

    glm::dvec3 up() const { return glm::round(glm::dvec3(placement_.axes_from_gltf.matrix()[1])); } // glTF's y axis

    ArenaBuilder &builder_;
    const std::string name_;
    const GltfPlacement &placement_;
    const Reporter reporter_;
    const GltfFile content_;
    const tinygltf::Model &model_;
    const Accessors accessors_;
    GltfMaterials materials_;
    std::optional<std::size_t> variant_; // index in KHR_materials_variants
    std::vector<std::size_t> mesh_uses_; // for each mesh of the file: number of instances in the scene
    // Keys: mesh and primitive of the file.
    std::map<std::pair<int, std::size_t>, SharedMesh> shared_;
    std::map<std::pair<int, std::size_t>, GltfMaterials::Material> primitive_materials_;
    std::set<std::string> notices_;
    std::vector<SceneNode> nodes_;
    std::vector<std::uint32_t> scene_index_;              // file node → index in nodes_ or ARHOST_NONE
    std::vector<const tinygltf::Animation *> animations_; // those that are played
    float duration_s_ = 0;
    std::uint32_t first_node_ = 0; // arena index of nodes_[0]
    std::vector<Part> parts_;
    std::map<int, std::uint32_t> skins_; // index in the file → index in the arena
    Transform placed_;                   // of the axes to the coordinates of placement_.node
    std::size_t triangles_ = 0, vertices_ = 0;
    Box box_; // of what does not deform
};

} // namespace

float add_gltf(ArenaBuilder &builder, Textures &textures, const std::filesystem::path &file,
               const GltfPlacement &placement, const LoadCallbacks &callbacks) {
    return GltfLoader(builder, textures, file, placement, callbacks).load();
}

} // namespace arhost::scene