// SPDX-License-Identifier: Apache-2.0
#include "scene/arena.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <new>
#include <stdexcept>
#include <type_traits>

namespace arhost::scene {
namespace {

constexpr std::size_t alignment = 64, spare_bytes = 16;
constexpr float emission_limit = 1e6f, extinction_limit = 1e6f;
// Of lengths of normals and of the bounds' fit: what float arithmetic may lose.
constexpr float tolerance = 1e-3f;

constexpr std::uint64_t align_up(std::uint64_t size) {
    return (size + alignment - 1) / alignment * alignment;
}

struct Box {
    glm::vec3 min{std::numeric_limits<float>::max()}, max{-std::numeric_limits<float>::max()};

    void include(const glm::vec3 &point) {
        for (int i = 0; i < 3; ++i) {
            min[i] = point[i] < min[i] ? point[i] : min[i];
            max[i] = point[i] > max[i] ? point[i] : max[i];
        }
    }
    void include(const Box &box) {
        include(box.min);
        include(box.max);
    }
};

// Lane by lane over blocks of four points, which compilers turn into SIMD; one minimum after the other
// would wait for itself.
Box box_of(std::span<const glm::vec3> points) {
    constexpr std::size_t lanes = 12;
    std::array<float, lanes> low, high;
    low.fill(Box{}.min.x);
    high.fill(Box{}.max.x);
    std::size_t i = 0;
    for (; i + 4 <= points.size(); i += 4) {
        const float *values = &points[i].x;
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            low[lane] = values[lane] < low[lane] ? values[lane] : low[lane];
            high[lane] = values[lane] > high[lane] ? values[lane] : high[lane];
        }
    }
    Box box;
    for (std::size_t lane = 0; lane < lanes; lane += 3) {
        box.min = glm::min(box.min, glm::vec3(low[lane], low[lane + 1], low[lane + 2]));
        box.max = glm::max(box.max, glm::vec3(high[lane], high[lane + 1], high[lane + 2]));
    }
    for (; i < points.size(); ++i)
        box.include(points[i]);
    return box;
}

Box box_of(std::span<const glm::vec4> spheres) {
    Box box;
    for (const glm::vec4 &sphere : spheres) {
        box.include(glm::vec3(sphere) - sphere.w);
        box.include(glm::vec3(sphere) + sphere.w);
    }
    return box;
}

// The box round a transformed box: exact for the identity, a little wide for rotations.
Box transformed(const float *world_from_object, const Box &box) {
    const float *m = world_from_object;
    Box world;
    for (int corner = 0; corner < 8; ++corner) {
        const glm::vec3 p(corner & 1 ? box.max.x : box.min.x, corner & 2 ? box.max.y : box.min.y,
                          corner & 4 ? box.max.z : box.min.z);
        world.include(glm::vec3(m[0] * p.x + m[3] * p.y + m[6] * p.z + m[9],
                                m[1] * p.x + m[4] * p.y + m[7] * p.z + m[10],
                                m[2] * p.x + m[5] * p.y + m[8] * p.z + m[11]));
    }
    return world;
}

// Puts buffers one behind the other; where there is no memory, it only counts.
class Writer {
public:
    explicit Writer(std::byte *arena) : arena_(arena) {}

    template <class T> arhost_buffer put(std::span<const T> values) {
        static_assert(std::is_trivially_copyable_v<T>);
        if (values.empty())
            return {};
        if (values.size() > ARHOST_NONE)
            throw std::length_error("more than 2^32 elements in one buffer of the scene");
        const std::uint64_t offset = end_;
        end_ = align_up(offset + values.size_bytes() + spare_bytes);
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
    geometry.type = ARHOST_TRIANGLES;
    geometry.positions = writer.put(mesh.positions);
    geometry.normals = writer.put(mesh.normals);
    geometry.texcoords = writer.put(mesh.texcoords);
    geometry.indices = writer.put(mesh.triangles);
    return geometry;
}

arhost_geometry put_geometry(Writer &writer, const Spheres &spheres) {
    arhost_geometry geometry{};
    geometry.type = ARHOST_SPHERES;
    geometry.positions = writer.put(spheres);
    return geometry;
}

Box box_of(const TriangleMesh &mesh) {
    return box_of(std::span(mesh.positions));
}
Box box_of(const Spheres &spheres) {
    return box_of(std::span(spheres));
}

void copy(const glm::vec3 &from, float *to) {
    for (int i = 0; i < 3; ++i)
        to[i] = from[i];
}

} // namespace

arhost_material make_material(arhost_material_model model) {
    arhost_material material{};
    material.model = model;
    material.colour_texture = material.metallic_roughness_texture = material.normal_texture =
        material.emission_texture = ARHOST_NONE;
    material.exponent = 1;
    copy(glm::vec3(1), material.reflectivity);
    material.metallic = material.roughness = 1;
    material.index = 1.5f;
    material.fresnel_exponent = 5; // Schlick's, and with the minimum that of an index of 1.5
    material.fresnel_minimum = 0.04f;
    material.fresnel_maximum = 1;
    copy(glm::vec3(1), material.refraction);
    copy(glm::vec3(1), material.shadow_attenuation);
    material.importance_cutoff = 0.01f;
    material.reflection_depth = material.refraction_depth = max_depth_limit;
    return material;
}

arhost_light make_light(arhost_light_type type) {
    arhost_light light{};
    light.type = type;
    light.falloff = ARHOST_FALLOFF_NONE;
    light.direction[2] = -1;
    copy(glm::vec3(1), light.intensity);
    light.axis_u[0] = light.axis_v[1] = 0.5f;
    light.radius = 0.5f;
    light.cosine_inner = light.cosine_outer = 0;
    return light;
}

Arena::Arena(std::size_t byte_size)
    : size_(byte_size), bytes_(static_cast<std::byte *>(std::aligned_alloc(alignment, align_up(byte_size)))) {
    if (!bytes_)
        throw std::bad_alloc();
}

std::uint32_t ArenaBuilder::add_triangles(TriangleMesh mesh) {
    geometries_.emplace_back(std::move(mesh));
    return static_cast<std::uint32_t>(geometries_.size() - 1);
}

std::uint32_t ArenaBuilder::add_spheres(Spheres spheres) {
    geometries_.emplace_back(std::move(spheres));
    return static_cast<std::uint32_t>(geometries_.size() - 1);
}

std::uint32_t ArenaBuilder::add_material(const arhost_material &material) {
    materials_.push_back(material);
    return static_cast<std::uint32_t>(materials_.size() - 1);
}

std::uint32_t ArenaBuilder::add_object(const std::string &name, std::uint32_t geometry, std::uint32_t material,
                                       arhost_role role, const glm::mat4x3 &world_from_object) {
    arhost_object object{};
    object.geometry = geometry;
    object.material = material;
    object.role = role;
    object.name = static_cast<std::uint32_t>(names_.size());
    object.node = object.skin = ARHOST_NONE;
    for (int column = 0; column < 4; ++column)
        copy(world_from_object[column], object.world_from_object + 3 * column);
    names_ += name + '\0';
    objects_.push_back(object);
    return static_cast<std::uint32_t>(objects_.size() - 1);
}

std::uint32_t ArenaBuilder::add_light(const arhost_light &light) {
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

std::size_t ArenaBuilder::byte_size() const {
    Writer counter(nullptr);
    counter.put(std::vector<arhost_geometry>(geometries_.size()));
    counter.put(materials_);
    counter.put(objects_);
    counter.put(lights_);
    counter.put(std::span<const char>(names_));
    for (const Geometry &geometry : geometries_)
        std::visit([&](const auto &shape) { put_geometry(counter, shape); }, geometry);
    return counter.end();
}

void ArenaBuilder::write(std::span<std::byte> arena) && {
    const std::size_t size = byte_size();
    if (arena.size() < size || reinterpret_cast<std::uintptr_t>(arena.data()) % alignment != 0)
        throw std::invalid_argument("the memory for the scene is too small or not aligned to 64 bytes");

    Writer writer(arena.data());
    std::vector<arhost_geometry> table(geometries_.size());
    std::vector<Box> boxes(geometries_.size());
    const arhost_buffer geometries = writer.put(table); // filled in below
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
    scene.environment.texture = ARHOST_NONE;
    scene.geometries = geometries;
    scene.materials = writer.put(materials_);
    scene.objects = writer.put(objects_);
    scene.lights = writer.put(lights_);
    scene.names = writer.put(std::span<const char>(names_));
    for (std::size_t i = 0; i < geometries_.size(); ++i)
        std::visit(
            [&](auto &shape) {
                table[i] = put_geometry(writer, shape);
                boxes[i] = box_of(shape);
                shape = {};
            },
            geometries_[i]);
    if (!table.empty())
        std::memcpy(arena.data() + geometries.offset, table.data(), table.size() * sizeof table[0]);

    Box bounds;
    for (const arhost_object &object : objects_)
        if (object.geometry < boxes.size())
            bounds.include(transformed(object.world_from_object, boxes[object.geometry]));
    copy(objects_.empty() ? glm::vec3(0) : bounds.min, scene.bounds_min);
    copy(objects_.empty() ? glm::vec3(0) : bounds.max, scene.bounds_max);
    std::memset(arena.data(), 0, align_up(sizeof scene));
    std::memcpy(arena.data(), &scene, sizeof scene);
    *this = {};
}

Arena ArenaBuilder::build() && {
    Arena arena(byte_size());
    std::move(*this).write(arena.bytes());
    return arena;
}

namespace {

struct Fault {
    std::string text;
};

[[noreturn]] void fault(const std::string &text) {
    throw Fault{text};
}

std::string number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%g", value);
    return text;
}

// NaN compares as false, so it is outside every range.
bool within(float value, float low, float high) {
    return value >= low && value <= high;
}

void check_floats(std::span<const float> values, float low, float high, const std::string &what) {
    for (const float value : values)
        if (!within(value, low, high))
            fault(what + " is " + number(value) + ", outside " + number(low) + " to " + number(high));
}

// A float with its sign cleared orders like the integer of its bits; infinities and NaN come last. This
// loop is all integers, so it runs at the speed of memory.
bool all_within_limit(std::span<const float> values) {
    const std::int32_t limit = std::bit_cast<std::int32_t>(coordinate_limit_mm);
    std::int32_t outside = 0;
    for (const float value : values)
        outside |= (std::bit_cast<std::int32_t>(value) & 0x7fffffff) > limit;
    return !outside;
}

template <class T> std::span<const float> floats_of(std::span<const T> values) {
    return {reinterpret_cast<const float *>(values.data()), values.size() * sizeof(T) / sizeof(float)};
}

class Checker {
public:
    explicit Checker(std::span<const std::byte> arena) : arena_(arena) {}

    void run() {
        check_header();
        geometries_ = view<arhost_geometry>(scene_->geometries, "the table of geometries");
        materials_ = view<arhost_material>(scene_->materials, "the table of materials");
        objects_ = view<arhost_object>(scene_->objects, "the table of objects");
        lights_ = view<arhost_light>(scene_->lights, "the table of lights");
        names_ = view<char>(scene_->names, "the names");
        check_names();
        for (std::size_t i = 0; i < objects_.size(); ++i)
            check_object(i);
        for (std::size_t i = 0; i < materials_.size(); ++i)
            check_material(i);
        for (std::size_t i = 0; i < lights_.size(); ++i)
            check_light(i);
        std::vector<Box> boxes;
        for (std::size_t i = 0; i < geometries_.size(); ++i)
            boxes.push_back(check_geometry(i));
        check_bounds(boxes);
    }

private:
    void check_header() {
        if (reinterpret_cast<std::uintptr_t>(arena_.data()) % alignment != 0)
            fault("it does not lie at a multiple of 64 bytes in memory");
        if (arena_.size() < sizeof(arhost_scene))
            fault("it is too short for its header");
        scene_ = reinterpret_cast<const arhost_scene *>(arena_.data());
        if (scene_->magic != ARHOST_SCENE_MAGIC)
            fault("it does not begin with the magic number of scenes");
        if (scene_->version != ARHOST_SCENE_VERSION)
            fault("its version is " + std::to_string(scene_->version) + ", not " +
                  std::to_string(ARHOST_SCENE_VERSION));
        if (scene_->struct_size != sizeof(arhost_scene))
            fault("its header has the wrong size");
        if (scene_->byte_size < sizeof(arhost_scene) || scene_->byte_size > arena_.size())
            fault("its header says that it has " + std::to_string(scene_->byte_size) + " bytes, but " +
                  std::to_string(arena_.size()) + " are there");
        arena_ = arena_.first(scene_->byte_size);
        unclaimed_ = scene_->byte_size - sizeof(arhost_scene);
        if (scene_->axes != ARHOST_Z_UP && scene_->axes != ARHOST_Y_UP)
            fault("its axes are of no known kind");
        if (scene_->max_depth > max_depth_limit)
            fault("max_depth is " + std::to_string(scene_->max_depth) + ", more than " +
                  std::to_string(max_depth_limit));
        check_floats(scene_->ambient, 0, coordinate_limit_mm, "the ambient light");
        check_floats(scene_->background, 0, coordinate_limit_mm, "the background");
        check_floats({&scene_->shadow_alpha_opaque, 1}, 0, 1, "shadow_alpha_opaque");
        check_floats({&scene_->shadow_alpha_translucent, 1}, 0, 1, "shadow_alpha_translucent");
        check_floats(scene_->bounds_min, -4 * coordinate_limit_mm, 4 * coordinate_limit_mm, "bounds_min");
        check_floats(scene_->bounds_max, -4 * coordinate_limit_mm, 4 * coordinate_limit_mm, "bounds_max");
    }

    // The elements of a buffer, once it is known that they and the spare bytes lie in the arena. No byte
    // may belong to two buffers: else a small arena could name one large buffer a million times.
    template <class T> std::span<const T> view(const arhost_buffer &buffer, const std::string &what) {
        if (buffer.count == 0) {
            if (buffer.offset != 0 || buffer.stride != 0)
                fault(what + " is absent, yet its offset and stride are not 0");
            return {};
        }
        if (buffer.stride != sizeof(T))
            fault(what + " has a stride of " + std::to_string(buffer.stride) + " bytes, not " +
                  std::to_string(sizeof(T)));
        if (buffer.offset % alignment != 0)
            fault(what + " does not begin at a multiple of 64 bytes");
        if (buffer.offset < sizeof(arhost_scene))
            fault(what + " lies over the header");
        const std::uint64_t needed = std::uint64_t(buffer.count) * sizeof(T) + spare_bytes; // < 2^32 · 2^7
        if (buffer.offset > arena_.size() || needed > arena_.size() - buffer.offset)
            fault(what + " reaches past the end of the scene");
        if (needed > unclaimed_)
            fault(what + " shares bytes with other buffers");
        unclaimed_ -= needed;
        return {reinterpret_cast<const T *>(arena_.data() + buffer.offset), buffer.count};
    }

    void check_names() {
        if (!names_.empty() && names_.back() != '\0')
            fault("the last name has no end");
        for (const char c : names_)
            if (c != '\0' && (static_cast<unsigned char>(c) < 0x20 || c == 0x7f))
                fault("a name holds a control character");
    }

    std::string name_of(std::size_t object) const {
        constexpr std::size_t shown = 64; // a million objects may share one name of a gigabyte
        const char *name = names_.data() + objects_[object].name;
        return "object " + std::to_string(object) + " '" + std::string(name, strnlen(name, shown)) + "'";
    }

    void check_object(std::size_t i) {
        const arhost_object &object = objects_[i];
        if (object.name >= names_.size())
            fault("the name of object " + std::to_string(i) + " lies outside the names");
        const auto in_table = [&](std::uint32_t index, std::size_t count, const char *what) {
            if (index >= count)
                fault(name_of(i) + " has " + what + " " + std::to_string(index) + ", but there are " +
                      std::to_string(count));
        };
        in_table(object.geometry, geometries_.size(), "geometry");
        in_table(object.material, materials_.size(), "material");
        if (object.role < ARHOST_VIRTUAL || object.role > ARHOST_OCCLUDER)
            fault(name_of(i) + " has a role of no known kind");
        const float *m = object.world_from_object;
        check_floats(object.world_from_object, -coordinate_limit_mm, coordinate_limit_mm,
                     name_of(i) + ": a number of world_from_object");
        const glm::dvec3 x(m[0], m[1], m[2]), y(m[3], m[4], m[5]), z(m[6], m[7], m[8]);
        const double size = glm::length(x) * glm::length(y) * glm::length(z);
        if (!(std::abs(glm::dot(glm::cross(x, y), z)) > 1e-9 * size))
            fault(name_of(i) + ": world_from_object can't be inverted");
    }

    void check_material(std::size_t i) {
        const arhost_material &material = materials_[i];
        const std::string what = "material " + std::to_string(i) + ": ";
        if (material.model < ARHOST_DIFFUSE || material.model > ARHOST_METALLIC_ROUGHNESS)
            fault(what + "its model is of no known kind");
        for (const std::uint32_t texture : {material.colour_texture, material.metallic_roughness_texture,
                                            material.normal_texture, material.emission_texture})
            if (texture != ARHOST_NONE)
                fault(what + "it has texture " + std::to_string(texture) + ", but there are 0");
        check_floats(material.ambient, 0, 1, what + "ambient");
        check_floats(material.diffuse, 0, 1, what + "diffuse");
        check_floats(material.specular, 0, 1, what + "specular");
        check_floats(material.reflectivity, 0, 1, what + "reflectivity");
        check_floats({&material.exponent, 1}, 1, coordinate_limit_mm, what + "exponent");
        check_floats(material.emission, 0, emission_limit, what + "emission");
        check_floats({&material.alpha_cutoff, 1}, 0, 1, what + "alpha_cutoff");
        check_floats({&material.metallic, 1}, 0, 1, what + "metallic");
        check_floats({&material.roughness, 1}, 0, 1, what + "roughness");
        check_floats({&material.index, 1}, 1, 4, what + "index");
        check_floats({&material.fresnel_exponent, 1}, 0.01f, 100, what + "fresnel_exponent");
        check_floats({&material.fresnel_minimum, 1}, 0, 1, what + "fresnel_minimum");
        check_floats({&material.fresnel_maximum, 1}, material.fresnel_minimum, 1, what + "fresnel_maximum");
        check_floats(material.refraction, 0, 1, what + "refraction");
        check_floats(material.extinction, 0, extinction_limit, what + "extinction");
        check_floats(material.shadow_attenuation, 0, 1, what + "shadow_attenuation");
        check_floats(material.cutoff_colour, 0, 1, what + "cutoff_colour");
        check_floats({&material.importance_cutoff, 1}, 0, 1, what + "importance_cutoff");
    }

    void check_light(std::size_t i) {
        const arhost_light &light = lights_[i];
        const std::string what = "light " + std::to_string(i) + ": ";
        if (light.type < ARHOST_POINT_LIGHT || light.type > ARHOST_SPHERE_LIGHT)
            fault(what + "its type is of no known kind");
        if (light.falloff != ARHOST_FALLOFF_NONE && light.falloff != ARHOST_FALLOFF_INVERSE_SQUARE)
            fault(what + "its falloff is of no known kind");
        check_floats(light.position, -coordinate_limit_mm, coordinate_limit_mm, what + "position");
        check_floats(light.intensity, 0, std::numeric_limits<float>::max(), what + "intensity");
        const auto length_of = [](const float(&v)[3]) { return glm::length(glm::dvec3(v[0], v[1], v[2])); };
        check_floats(light.direction, -1 - tolerance, 1 + tolerance, what + "direction");
        if (light.type != ARHOST_POINT_LIGHT && light.type != ARHOST_SPHERE_LIGHT &&
            !within(static_cast<float>(length_of(light.direction)), 1 - tolerance, 1 + tolerance))
            fault(what + "its direction is not of length 1");
        check_floats(light.axis_u, -coordinate_limit_mm, coordinate_limit_mm, what + "axis_u");
        check_floats(light.axis_v, -coordinate_limit_mm, coordinate_limit_mm, what + "axis_v");
        check_floats({&light.radius, 1}, 0, coordinate_limit_mm, what + "radius");
        check_floats({&light.cosine_outer, 1}, -1, 1, what + "cosine_outer");
        check_floats({&light.cosine_inner, 1}, light.cosine_outer, 1, what + "cosine_inner");
        if (light.type == ARHOST_DIRECTIONAL_LIGHT && light.falloff != ARHOST_FALLOFF_NONE)
            fault(what + "light from infinitely far can't fall off");
    }

    // "geometry 3 (object 1 'bunny')"
    std::string geometry_name(std::size_t geometry) const {
        std::string text = "geometry " + std::to_string(geometry);
        for (std::size_t i = 0; i < objects_.size(); ++i)
            if (objects_[i].geometry == geometry)
                return text + " (" + name_of(i) + ")";
        return text;
    }

    Box check_geometry(std::size_t i) {
        const arhost_geometry &geometry = geometries_[i];
        try {
            if (geometry.reserved != 0)
                fault("a reserved field is not 0");
            switch (geometry.type) {
            case ARHOST_TRIANGLES:
                return check_triangles(geometry);
            case ARHOST_SPHERES:
                return check_spheres(geometry);
            default:
                fault("its type is of no known kind");
            }
        } catch (const Fault &inner) {
            fault(geometry_name(i) + ": " + inner.text);
        }
    }

    static void check_coordinates(std::span<const float> values, std::size_t components, const char *what) {
        if (all_within_limit(values))
            return;
        for (std::size_t i = 0; i < values.size(); ++i)
            if (!within(values[i], -coordinate_limit_mm, coordinate_limit_mm))
                fault(std::string(what) + " " + std::to_string(i / components) + " has the coordinate " +
                      number(values[i]));
    }

    Box check_triangles(const arhost_geometry &geometry) {
        const auto positions = view<glm::vec3>(geometry.positions, "the buffer of positions");
        const auto normals = view<glm::vec3>(geometry.normals, "the buffer of normals");
        const auto texcoords = view<glm::vec2>(geometry.texcoords, "the buffer of texcoords");
        const auto triangles = view<glm::uvec3>(geometry.indices, "the buffer of indices");
        if (triangles.empty())
            fault("it has no triangles");
        if (!normals.empty() && normals.size() != positions.size())
            fault("it has " + std::to_string(normals.size()) + " normals for " + std::to_string(positions.size()) +
                  " vertices");
        if (!texcoords.empty() && texcoords.size() != positions.size())
            fault("it has " + std::to_string(texcoords.size()) + " texcoords for " +
                  std::to_string(positions.size()) + " vertices");
        check_coordinates(floats_of(positions), 3, "vertex");
        check_coordinates(floats_of(texcoords), 2, "texcoord");
        check_normals(normals);
        check_indices(triangles, positions.size());
        return box_of(positions);
    }

    static void check_normals(std::span<const glm::vec3> normals) {
        const auto is_unit = [](const glm::vec3 &n) {
            return std::abs(n.x * n.x + n.y * n.y + n.z * n.z - 1) <= 2 * tolerance;
        };
        bool all = true;
        for (const glm::vec3 &normal : normals)
            all &= is_unit(normal);
        if (!all)
            fault("normal " +
                  std::to_string(std::find_if_not(normals.begin(), normals.end(), is_unit) - normals.begin()) +
                  " is not of unit length");
    }

    static void check_indices(std::span<const glm::uvec3> triangles, std::size_t vertex_count) {
        std::uint32_t highest = 0;
        for (const std::uint32_t index : std::span(&triangles.front().x, triangles.size() * 3))
            highest = index > highest ? index : highest;
        if (highest < vertex_count)
            return;
        for (std::size_t i = 0; i < triangles.size(); ++i)
            if (const std::uint32_t index = std::max({triangles[i].x, triangles[i].y, triangles[i].z});
                index >= vertex_count)
                fault("triangle " + std::to_string(i) + " has the vertex " + std::to_string(index) +
                      ", but there are " + std::to_string(vertex_count));
    }

    Box check_spheres(const arhost_geometry &geometry) {
        const auto spheres = view<glm::vec4>(geometry.positions, "the buffer of spheres");
        for (const arhost_buffer &other : {geometry.normals, geometry.texcoords, geometry.indices})
            if (other.count != 0 || other.offset != 0 || other.stride != 0)
                fault("spheres have no normals, texcoords or indices");
        if (spheres.empty())
            fault("it has no spheres");
        check_coordinates(floats_of(spheres), 4, "sphere");
        for (std::size_t i = 0; i < spheres.size(); ++i)
            if (!(spheres[i].w > 0))
                fault("sphere " + std::to_string(i) + " has the radius " + number(spheres[i].w));
        return box_of(spheres);
    }

    void check_bounds(const std::vector<Box> &boxes) const {
        const glm::vec3 low(scene_->bounds_min[0], scene_->bounds_min[1], scene_->bounds_min[2]);
        const glm::vec3 high(scene_->bounds_max[0], scene_->bounds_max[1], scene_->bounds_max[2]);
        if (!(low.x <= high.x && low.y <= high.y && low.z <= high.z))
            fault("bounds_min is above bounds_max");
        const glm::vec3 slack = (high - low) * tolerance + glm::abs(low) * 1e-6f + glm::abs(high) * 1e-6f;
        for (std::size_t i = 0; i < objects_.size(); ++i) {
            const Box box = transformed(objects_[i].world_from_object, boxes[objects_[i].geometry]);
            const glm::vec3 below = low - box.min - slack, above = box.max - high - slack;
            if (!(std::max({below.x, below.y, below.z, above.x, above.y, above.z}) <= 0))
                fault(name_of(i) + " lies outside the scene's bounds");
        }
    }

    std::span<const std::byte> arena_;
    const arhost_scene *scene_ = nullptr;
    std::uint64_t unclaimed_ = 0; // bytes that no buffer has claimed yet
    std::span<const arhost_geometry> geometries_;
    std::span<const arhost_material> materials_;
    std::span<const arhost_object> objects_;
    std::span<const arhost_light> lights_;
    std::span<const char> names_;
};

} // namespace

std::string validate(std::span<const std::byte> arena) {
    try {
        Checker(arena).run();
        return {};
    } catch (const Fault &found) {
        return found.text;
    }
}

} // namespace arhost::scene
