// SPDX-License-Identifier: Apache-2.0
#include "scene/arena_builder.hpp"

#include "scene/box.hpp"
#include "scene/motion.hpp"

#include <algorithm>
#include <cstring>
#include <new>
#include <stdexcept>
#include <type_traits>

namespace arhost::scene {
namespace {

constexpr std::uint64_t align_up(std::uint64_t size) {
    return (size + arena_alignment - 1) / arena_alignment * arena_alignment;
}

// Appends buffers to an arena. If the arena is null, only counts bytes.
class Writer {
public:
    explicit Writer(std::byte *arena) : arena_(arena) {}

    template <class T> arhost_buffer put(std::span<const T> values) {
        static_assert(std::is_trivially_copyable_v<T>);
        if (values.empty())
            return {};
        if (values.size() > ARHOST_NONE)
            throw std::length_error("a buffer of the scene has more than 2^32 elements");
        const std::uint64_t offset = end_;
        end_ = align_up(offset + values.size_bytes() + arena_spare_bytes);
        if (arena_) {
            std::memcpy(arena_ + offset, values.data(), values.size_bytes());
            std::memset(arena_ + offset + values.size_bytes(), 0, end_ - offset - values.size_bytes());
        }
        return {offset, static_cast<std::uint32_t>(values.size()), sizeof(T)};
    }
    template <class T> arhost_buffer put(const std::vector<T> &values) { return put(std::span<const T>(values)); }

    std::uint64_t end() const { return end_; }

private:
    std::byte *arena_;
    std::uint64_t end_ = align_up(sizeof(arhost_scene));
};

arhost_geometry put_geometry(Writer &writer, const TriangleMesh &mesh) {
    arhost_geometry geometry{};
    geometry.type = ARHOST_GEOMETRY_TRIANGLES;
    geometry.positions = writer.put(mesh.positions);
    geometry.normals = writer.put(mesh.normals);
    geometry.texcoords = writer.put(mesh.texcoords);
    geometry.tangents = writer.put(mesh.tangents);
    geometry.colours = writer.put(mesh.colours);
    geometry.indices = writer.put(mesh.triangles);
    geometry.joints = writer.put(mesh.joints);
    geometry.weights = writer.put(mesh.weights);
    geometry.morph_positions = writer.put(mesh.morph_positions);
    geometry.morph_normals = writer.put(mesh.morph_normals);
    return geometry;
}

arhost_geometry put_geometry(Writer &writer, const Spheres &spheres) {
    arhost_geometry geometry{};
    geometry.type = ARHOST_GEOMETRY_SPHERES;
    geometry.positions = writer.put(spheres);
    return geometry;
}

void copy(const glm::vec3 &from, float *to) {
    for (int i = 0; i < 3; ++i)
        to[i] = from[i];
}

void copy(const glm::mat4x3 &from, float *to) {
    for (int column = 0; column < 4; ++column)
        copy(from[column], to + 3 * column);
}

arhost_texel_image put_image(Writer &writer, const TexelImage &image, std::uint32_t name) {
    const auto texels = [&]<class Texel>(Texel) {
        return std::span(reinterpret_cast<const Texel *>(image.texels.bytes.get()),
                         image.texels.size / sizeof(Texel));
    };
    return {image.format,
            image.width,
            image.height,
            name,
            image.level_count,
            0,
            image.format == ARHOST_TEXEL_RGBA32F ? writer.put(texels(glm::vec4()))
                                                 : writer.put(texels(glm::u8vec4()))};
}

arhost_texture written(const Texture &texture) {
    arhost_texture to{texture.image, texture.wrap_u, texture.wrap_v, texture.filter, texture.texcoord_set, {}};
    std::memcpy(to.image_from_texcoord, &texture.image_from_texcoord, sizeof to.image_from_texcoord);
    return to;
}

arhost_node put_node(Writer &writer, const MotionNode &node) {
    arhost_node written{};
    written.parent = node.parent;
    written.animated = node.animated;
    copy(node.parent_from_node, written.parent_from_node);
    copy(node.translation, written.translation);
    for (int i = 0; i < 4; ++i)
        written.rotation[i] = node.rotation[i];
    copy(node.scale, written.scale);
    written.morph_weights = writer.put(node.morph_weights);
    return written;
}

arhost_channel put_channel(Writer &writer, const Channel &channel, float duration_s) {
    return {channel.node,
            channel.target,
            channel.interpolation,
            channel.period_s.value_or(duration_s),
            writer.put(channel.times),
            writer.put(channel.values)};
}

arhost_skin put_skin(Writer &writer, const Skin &skin) {
    return {writer.put(skin.joints), writer.put(skin.node_from_mesh)};
}

// Writes the buffers of all elements (for example the positions of all meshes), then the table whose rows refer to
// these buffers.
template <class Row, class Elements, class Put>
arhost_buffer put_table(Writer &writer, Elements &elements, const Put &put) {
    std::vector<Row> rows;
    rows.reserve(elements.size());
    for (auto &element : elements)
        rows.push_back(put(element));
    return writer.put(rows);
}

} // namespace

arhost_material make_material(arhost_material_model model) {
    arhost_material material{};
    material.model = model;
    material.colour_texture = material.metallic_roughness_texture = material.normal_texture =
        material.emission_texture = material.occlusion_texture = material.specular_texture =
            material.specular_colour_texture = material.transmission_texture = material.clearcoat_texture =
                material.clearcoat_roughness_texture = material.clearcoat_normal_texture = material.sheen_texture =
                    material.sheen_roughness_texture = material.anisotropy_texture = material.iridescence_texture =
                        material.iridescence_thickness_texture = ARHOST_NONE;
    material.opacity = material.normal_scale = material.occlusion_strength = material.specular_weight =
        material.clearcoat_normal_scale = 1;
    material.anisotropy_direction[0] = 1;
    material.iridescence_index = 1.3f;
    if (model == ARHOST_MATERIAL_METALLIC_ROUGHNESS)
        copy(glm::vec3(1), material.specular);
    material.exponent = 1;
    copy(glm::vec3(1), material.reflectivity);
    material.metallic = 1;
    material.roughness = model == ARHOST_MATERIAL_GLASS ? 0 : 1;
    material.index = 1.5f;
    material.fresnel_exponent = 5; // Schlick's approximation; fresnel_minimum is for a refractive index of 1.5
    material.fresnel_minimum = 0.04f;
    material.fresnel_maximum = 1;
    copy(glm::vec3(1), material.refraction);
    copy(glm::vec3(default_shadow_attenuation), material.shadow_attenuation);
    material.importance_cutoff = 0.01f;
    material.reflection_depth = material.refraction_depth = max_depth_limit;
    return material;
}

std::uint64_t texel_count(std::uint32_t width, std::uint32_t height, std::uint32_t level_count) {
    std::uint64_t count = 0;
    for (std::uint32_t level = 0; level < level_count; ++level)
        count += std::uint64_t(std::max(width >> level, 1u)) * std::max(height >> level, 1u);
    return count;
}

arhost_light make_light(arhost_light_type type) {
    arhost_light light{};
    light.type = type;
    light.falloff = ARHOST_FALLOFF_NONE;
    light.direction[2] = -1;
    copy(glm::vec3(1), light.intensity);
    light.axis_u[0] = light.axis_v[1] = 0.5f;
    light.radius = type == ARHOST_LIGHT_SPHERE ? 0.5f : 0;
    light.cosine_inner = light.cosine_outer = 0;
    return light;
}

Arena::Arena(std::size_t byte_size)
    : size_(byte_size), bytes_(static_cast<std::byte *>(std::aligned_alloc(arena_alignment, align_up(byte_size)))) {
    if (!bytes_)
        throw std::bad_alloc();
}

std::vector<std::string> Origins::all(Table table) const {
    std::vector<std::string> origins;
    for (const std::size_t text : tables_[static_cast<std::size_t>(table)])
        origins.push_back(text == 0 ? "" : texts_[text - 1]);
    return origins;
}

std::string Origins::message(const Fault &fault) const {
    const std::vector<std::size_t> &origins = tables_[static_cast<std::size_t>(fault.table)];
    const std::size_t text = fault.index < origins.size() ? origins[fault.index] : 0;
    return text == 0 ? fault.text : texts_[text - 1] + ": " + fault.text;
}

std::uint32_t ArenaBuilder::add_triangles(TriangleMesh mesh) {
    origins_.add(Table::geometries);
    geometries_.emplace_back(std::move(mesh));
    return static_cast<std::uint32_t>(geometries_.size() - 1);
}

std::uint32_t ArenaBuilder::add_spheres(Spheres spheres) {
    origins_.add(Table::geometries);
    geometries_.emplace_back(std::move(spheres));
    return static_cast<std::uint32_t>(geometries_.size() - 1);
}

std::uint32_t ArenaBuilder::add_name(const std::string &name) {
    const auto offset = static_cast<std::uint32_t>(names_.size());
    names_ += name + '\0';
    return offset;
}

std::uint32_t ArenaBuilder::add_image(const std::string &name, TexelImage image) {
    origins_.add(Table::images);
    images_.emplace_back(add_name(name), std::move(image));
    return static_cast<std::uint32_t>(images_.size() - 1);
}

std::uint32_t ArenaBuilder::add_texture(const Texture &texture) {
    origins_.add(Table::textures);
    textures_.push_back(texture);
    return static_cast<std::uint32_t>(textures_.size() - 1);
}

std::uint32_t ArenaBuilder::add_texture(const std::string &name, TexelImage image, Texture texture) {
    texture.image = add_image(name, std::move(image));
    return add_texture(texture);
}

std::uint32_t ArenaBuilder::add_node(MotionNode node) {
    origins_.add(Table::nodes);
    nodes_.push_back(std::move(node));
    return static_cast<std::uint32_t>(nodes_.size() - 1);
}

std::uint32_t ArenaBuilder::add_channel(Channel channel) {
    origins_.add(Table::channels);
    channels_.push_back(std::move(channel));
    return static_cast<std::uint32_t>(channels_.size() - 1);
}

std::uint32_t ArenaBuilder::add_skin(Skin skin) {
    origins_.add(Table::skins);
    skins_.push_back(std::move(skin));
    return static_cast<std::uint32_t>(skins_.size() - 1);
}

std::uint32_t ArenaBuilder::add_anchor(const std::string &target) {
    origins_.add(Table::anchors);
    const std::uint32_t node = add_node({});
    anchors_.push_back({node, add_name(target)});
    return node;
}

std::uint32_t ArenaBuilder::add_material(const arhost_material &material, const std::string &name) {
    origins_.add(Table::materials);
    materials_.push_back(material);
    contents.materials.push_back(name);
    return static_cast<std::uint32_t>(materials_.size() - 1);
}

std::uint32_t ArenaBuilder::add_object(const std::string &name, std::uint32_t geometry, std::uint32_t material,
                                       arhost_role role, const glm::mat4x3 &world_from_object, const Motion &motion,
                                       bool hides_back_faces) {
    origins_.add(Table::objects);
    arhost_object object{};
    object.geometry = geometry;
    object.material = material;
    object.role = role;
    object.name = add_name(name);
    copy(world_from_object, object.world_from_object);
    object.moves = motion.moves;
    object.deforms = motion.deforms;
    object.node = motion.node;
    object.skin = motion.skin;
    object.hides_back_faces = hides_back_faces;
    objects_.push_back(object);
    return static_cast<std::uint32_t>(objects_.size() - 1);
}

std::uint32_t ArenaBuilder::add_light(const arhost_light &light) {
    origins_.add(Table::lights);
    lights_.push_back(light);
    return static_cast<std::uint32_t>(lights_.size() - 1);
}

std::size_t ArenaBuilder::triangle_count() const {
    std::size_t count = 0;
    for (const Geometry &geometry : geometries_)
        if (const auto *mesh = std::get_if<TriangleMesh>(&geometry))
            count += mesh->triangles.size();
    return count;
}

// Must visit the buffers in the same order as `write`.
std::size_t ArenaBuilder::byte_size() const {
    Writer counter(nullptr);
    counter.put(materials_);
    counter.put(objects_);
    counter.put(lights_);
    counter.put(std::span<const char>(names_));
    counter.put(anchors_);
    counter.put(environment.rows);
    counter.put(environment.columns);
    put_table<arhost_node>(counter, nodes_, [&](const MotionNode &node) { return put_node(counter, node); });
    put_table<arhost_channel>(counter, channels_, [&](const Channel &c) { return put_channel(counter, c, 0); });
    put_table<arhost_skin>(counter, skins_, [&](const Skin &skin) { return put_skin(counter, skin); });
    put_table<arhost_texture>(counter, textures_, written);
    put_table<arhost_texel_image>(counter, images_,
                                  [&](const auto &named) { return put_image(counter, named.second, named.first); });
    put_table<arhost_geometry>(counter, geometries_, [&](const Geometry &geometry) {
        return std::visit([&](const auto &shape) { return put_geometry(counter, shape); }, geometry);
    });
    return counter.end();
}

void ArenaBuilder::write(std::span<std::byte> arena) && {
    const std::size_t size = byte_size();
    if (arena.size() < size || reinterpret_cast<std::uintptr_t>(arena.data()) % arena_alignment != 0)
        throw std::invalid_argument("the memory for the scene is too small or not aligned to 64 bytes");

    arhost_scene scene{};
    scene.magic = ARHOST_SCENE_MAGIC;
    scene.version = ARHOST_SCENE_VERSION;
    scene.struct_size = sizeof scene;
    scene.byte_size = size;
    scene.axes = settings.axes;
    scene.max_depth = settings.max_depth;
    copy(settings.ambient, scene.ambient);
    copy(settings.background, scene.background);
    scene.shadow_alpha_opaque = settings.shadow_alpha_opaque;
    scene.shadow_alpha_translucent = settings.shadow_alpha_translucent;
    scene.coloured_shadows = settings.coloured_shadows;
    scene.duration_s = settings.duration_s;
    scene.integrator = settings.integrator;

    Writer writer(arena.data()); // must visit the buffers in the same order as byte_size
    scene.materials = writer.put(materials_);
    scene.objects = writer.put(objects_);
    scene.lights = writer.put(lights_);
    scene.names = writer.put(std::span<const char>(names_));
    scene.anchors = writer.put(anchors_);
    scene.environment.texture = environment.texture;
    if (environment.texture != ARHOST_NONE) {
        scene.environment.intensity = environment.intensity;
        scene.environment.follows_video = environment.follows_video;
        for (int column = 0; column < 3; ++column)
            copy(environment.environment_from_world[column], scene.environment.environment_from_world + 3 * column);
    }
    scene.environment.rows = writer.put(environment.rows);
    scene.environment.columns = writer.put(environment.columns);
    scene.nodes =
        put_table<arhost_node>(writer, nodes_, [&](const MotionNode &node) { return put_node(writer, node); });
    scene.channels = put_table<arhost_channel>(
        writer, channels_, [&](const Channel &c) { return put_channel(writer, c, settings.duration_s); });
    scene.skins = put_table<arhost_skin>(writer, skins_, [&](const Skin &skin) { return put_skin(writer, skin); });
    scene.textures = put_table<arhost_texture>(writer, textures_, written);
    scene.images = put_table<arhost_texel_image>(writer, images_, [&](auto &named) {
        const arhost_texel_image image = put_image(writer, named.second, named.first);
        named.second.texels = {};
        return image;
    });
    scene.geometries = put_table<arhost_geometry>(writer, geometries_, [&](Geometry &geometry) {
        return std::visit(
            [&](auto &shape) {
                const arhost_geometry written = put_geometry(writer, shape);
                shape = {};
                return written;
            },
            geometry);
    });
    std::memset(arena.data(), 0, align_up(sizeof scene));
    std::memcpy(arena.data(), &scene, sizeof scene);
    apply_initial_motion(arena);
    *this = {};
}

// Sets the transforms of moving objects at time 0, and the bounds of the scene, which depend on them.
void ArenaBuilder::apply_initial_motion(std::span<std::byte> arena) const {
    auto &scene = *reinterpret_cast<arhost_scene *>(arena.data());
    const auto elements = [&]<class T>(const arhost_buffer &buffer, T) {
        return std::span(reinterpret_cast<T *>(arena.data() + buffer.offset), buffer.count);
    };
    const auto geometries = elements(scene.geometries, arhost_geometry());
    const auto objects = elements(scene.objects, arhost_object());
    std::vector<Box> boxes(objects.size());
    for (std::size_t i = 0; i < objects.size(); ++i)
        if (objects[i].geometry < geometries.size() && !objects[i].deforms) {
            const arhost_geometry &geometry = geometries[objects[i].geometry];
            boxes[i] = geometry.type == ARHOST_GEOMETRY_SPHERES
                           ? box_of(std::span<const glm::vec4>(elements(geometry.positions, glm::vec4())))
                           : box_of(std::span<const glm::vec3>(elements(geometry.positions, glm::vec3())));
        }
    if (is_moving(scene)) {
        MotionEvaluator evaluator(scene);
        const arhost_motion motion = evaluator.at(0);
        for (std::uint32_t i = 0; i < motion.moved_count; ++i)
            std::memcpy(objects[motion.moved[i].object].world_from_object, motion.moved[i].world_from_object,
                        sizeof motion.moved[i].world_from_object);
        for (std::uint32_t i = 0; i < motion.deformed_count; ++i)
            boxes[motion.deformed[i].object] = box_of(std::span(
                reinterpret_cast<const glm::vec3 *>(motion.deformed[i].positions), motion.deformed[i].vertex_count));
    }
    Box bounds;
    for (std::size_t i = 0; i < objects.size(); ++i)
        if (objects[i].geometry < geometries.size())
            bounds.include(transformed(objects[i].world_from_object, boxes[i]));
    copy(objects.empty() ? glm::vec3(0) : bounds.min, scene.bounds_min);
    copy(objects.empty() ? glm::vec3(0) : bounds.max, scene.bounds_max);
}

Arena ArenaBuilder::build() && {
    Arena arena(byte_size());
    std::move(*this).write(arena.bytes());
    return arena;
}

} // namespace arhost::scene
