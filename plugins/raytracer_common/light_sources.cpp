// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/light_sources.hpp"

#include "raytracer_common/scene_geometry.hpp"
#include "raytracer_common/video.hpp"

#include <arhost/shading/scalar.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

namespace arhost::raytracer_common {
namespace {

using shading::Vec3;

Vec3 vector_of(const float *xyz) {
    return {xyz[0], xyz[1], xyz[2]};
}

Vec3 transformed(const float *m, Vec3 p) {
    return vector_of(m) * p.x + vector_of(m + 3) * p.y + vector_of(m + 6) * p.z + vector_of(m + 9);
}

void write(Vec3 v, float *to) {
    to[0] = static_cast<float>(v.x);
    to[1] = static_cast<float>(v.y);
    to[2] = static_cast<float>(v.z);
}

double mean_of(const float *rgb) {
    return (double{rgb[0]} + rgb[1] + rgb[2]) / 3;
}

// Calls use(position) for each vertex, or use(centre, radius) for each sphere, in world space.
template <class Vertex, class Sphere>
void for_each_point(const arhost_scene &arena, std::uint32_t number, const PlacedObject &placed, Vertex vertex,
                    Sphere sphere) {
    const arhost_object &object = elements<arhost_object>(arena, arena.objects)[number];
    const arhost_geometry &geometry = elements<arhost_geometry>(arena, arena.geometries)[object.geometry];
    const std::byte *at = placed.positions ? reinterpret_cast<const std::byte *>(placed.positions)
                                           : bytes(arena) + geometry.positions.offset;
    const std::size_t stride = placed.positions ? placed.position_stride : geometry.positions.stride;
    const bool is_sphere = geometry.type == ARHOST_GEOMETRY_SPHERES;
    const double scale = length(vector_of(placed.world_from_object));
    for (std::uint32_t i = 0; i < geometry.positions.count; ++i, at += stride) {
        float p[4] = {};
        std::memcpy(p, at, is_sphere ? 16 : 12);
        const Vec3 position = transformed(placed.world_from_object, vector_of(p));
        if (is_sphere)
            sphere(position, p[3] * scale);
        else
            vertex(position);
    }
}

struct Bounds {
    Vec3 low{std::numeric_limits<double>::max(), std::numeric_limits<double>::max(),
             std::numeric_limits<double>::max()};
    Vec3 high = low * -1.0;
    void add(Vec3 p, double radius = 0) {
        low = {std::min(low.x, p.x - radius), std::min(low.y, p.y - radius), std::min(low.z, p.z - radius)};
        high = {std::max(high.x, p.x + radius), std::max(high.y, p.y + radius), std::max(high.z, p.z + radius)};
    }
    bool empty() const { return low.x > high.x; }
    Vec3 centre() const { return (low + high) * 0.5; }
    double radius() const { return length(high - low) / 2; }
};

struct Sphere {
    Vec3 centre;
    double radius;
};

// Returns the smallest sphere around two spheres.
Sphere merged(const Sphere &a, const Sphere &b) {
    const double distance = length(b.centre - a.centre);
    if (distance + b.radius <= a.radius)
        return a;
    if (distance + a.radius <= b.radius)
        return b;
    const double radius = (distance + a.radius + b.radius) / 2;
    return {a.centre + (b.centre - a.centre) * ((radius - a.radius) / std::max(distance, 1e-12)), radius};
}

} // namespace

bool is_specular(const arhost_material &material) {
    return material.model == ARHOST_MATERIAL_MIRROR || material.model == ARHOST_MATERIAL_METAL ||
           material.model == ARHOST_MATERIAL_GLASS || material.transmission > 0;
}

LightSources::LightSources(const arhost_scene &arena) : arena_(arena) {
    if (arena.environment.texture == ARHOST_NONE) {
        environment_radiance_ = static_cast<float>(mean_of(arena.background));
        return;
    }
    const arhost_texel_image &image = environment_image(arena);
    const auto texels = elements<std::array<float, 4>>(arena, image.texels);
    double sum = 0, weights = 0, brightest = 0;
    for (std::uint32_t y = 0; y < image.height; ++y) {
        const double weight = shading::equirectangular_sine((y + 0.5) / image.height);
        double row = 0;
        for (std::uint32_t x = 0; x < image.width; ++x) {
            const double light = mean_of(texels[std::size_t{y} * image.width + x].data());
            row += light;
            brightest = std::max(brightest, light);
        }
        sum += row * weight;
        weights += weight * image.width;
    }
    has_sharp_environment_ = brightest * weights > 200 * sum; // a sun
    // The chances of the light sources need not follow the video.
    environment_radiance_ = static_cast<float>(sum / weights * environment_scale(arena.environment, nullptr)[0]);
}

// One sphere for each object. If there are too many, the two that lie next to each other along the longest axis and
// have the smallest common sphere are merged.
std::vector<std::array<float, 4>> LightSources::bounds_of(std::span<const PlacedObject> placed,
                                                          bool only_specular) const {
    std::vector<Sphere> spheres;
    Bounds all;
    const auto materials = elements<arhost_material>(arena_, arena_.materials);
    const auto objects = elements<arhost_object>(arena_, arena_.objects);
    for (std::uint32_t i = 0; i < objects.size(); ++i) {
        if (objects[i].role != ARHOST_ROLE_VIRTUAL || !placed[i].is_visible ||
            (only_specular && !is_specular(materials[objects[i].material])))
            continue;
        Bounds box;
        for_each_point(
            arena_, i, placed[i], [&](Vec3 p) { box.add(p); }, [&](Vec3 c, double r) { box.add(c, r); });
        if (box.empty())
            continue;
        const Vec3 centre = box.centre();
        double radius = 0;
        for_each_point(
            arena_, i, placed[i], [&](Vec3 p) { radius = std::max(radius, length(p - centre)); },
            [&](Vec3 c, double r) { radius = std::max(radius, length(c - centre) + r); });
        spheres.push_back({centre, radius});
        all.add(box.low);
        all.add(box.high);
    }
    if (spheres.size() > max_spheres) {
        const Vec3 size = all.high - all.low;
        const auto along = [&](const Sphere &s) {
            return size.x >= size.y && size.x >= size.z ? s.centre.x : size.y >= size.z ? s.centre.y : s.centre.z;
        };
        std::ranges::sort(spheres, {}, along);
        // Merges whole runs first, so that thousands of objects take no quadratic time.
        while (spheres.size() > 4 * max_spheres) {
            std::vector<Sphere> fewer;
            for (std::size_t i = 0; i < spheres.size(); i += 2)
                fewer.push_back(i + 1 < spheres.size() ? merged(spheres[i], spheres[i + 1]) : spheres[i]);
            spheres = std::move(fewer);
        }
        while (spheres.size() > max_spheres) {
            std::size_t best = 0;
            double smallest = std::numeric_limits<double>::max();
            for (std::size_t i = 0; i + 1 < spheres.size(); ++i)
                if (const double radius = merged(spheres[i], spheres[i + 1]).radius; radius < smallest) {
                    smallest = radius;
                    best = i;
                }
            spheres[best] = merged(spheres[best], spheres[best + 1]);
            spheres.erase(spheres.begin() + static_cast<std::ptrdiff_t>(best) + 1);
        }
    }
    std::vector<std::array<float, 4>> bounds;
    for (const Sphere &sphere : spheres) {
        std::array<float, 4> to{};
        write(sphere.centre, to.data());
        to[3] = static_cast<float>(sphere.radius * 1.0001);
        bounds.push_back(to);
    }
    return bounds;
}

// Returns a new record; its rows are 0, except the type.
float *LightSources::add_record(float type) {
    records_.resize(records_.size() + source_rows);
    float *to = records_.data() + records_.size() - source_rows;
    to[type_row] = type;
    return to;
}

// Adds the records of an object that emits light. Surfaces with an emission texture, holes or a clear coat, and
// geometries of several spheres, are not sampled; scattered rays find them.
void LightSources::add_emitter(std::uint32_t number, const PlacedObject &placed) {
    const arhost_object &object = elements<arhost_object>(arena_, arena_.objects)[number];
    const arhost_material &material = elements<arhost_material>(arena_, arena_.materials)[object.material];
    const arhost_geometry &geometry = elements<arhost_geometry>(arena_, arena_.geometries)[object.geometry];
    if (object.role != ARHOST_ROLE_VIRTUAL || !placed.is_visible || mean_of(material.emission) <= 0 ||
        material.emission_texture != ARHOST_NONE || material.alpha_cutoff > 0 || material.blends != 0 ||
        material.clearcoat > 0 || material.model == ARHOST_MATERIAL_MIRROR || material.model == ARHOST_MATERIAL_GLASS)
        return;
    const auto add = [&](SourceType type, Vec3 position, double area) {
        float *to = add_record(static_cast<float>(type));
        write(position, to + position_row);
        std::copy_n(material.emission, 3, to + intensity_row);
        to[area_row] = static_cast<float>(area);
        return to;
    };
    if (geometry.type == ARHOST_GEOMETRY_SPHERES) {
        if (geometry.positions.count != 1)
            return;
        for_each_point(
            arena_, number, placed, [](Vec3) {},
            [&](Vec3 centre, double radius) {
                emitters_[number].ball_radius = static_cast<float>(radius);
                add(ball_source, centre, std::numbers::pi * radius * radius)[radius_row] = static_cast<float>(radius);
            });
        return;
    }
    std::vector<Vec3> vertices;
    for_each_point(
        arena_, number, placed, [&](Vec3 p) { vertices.push_back(p); }, [](Vec3, double) {});
    const std::byte *at = bytes(arena_) + geometry.indices.offset;
    for (std::uint32_t i = 0; i < geometry.indices.count; ++i, at += geometry.indices.stride) {
        std::uint32_t corners[3];
        std::memcpy(corners, at, sizeof corners);
        const Vec3 a = vertices[corners[0]], edge_1 = vertices[corners[1]] - a, edge_2 = vertices[corners[2]] - a;
        const double area = length(cross(edge_1, edge_2)) / 2;
        if (!(static_cast<float>(area) > 0))
            continue;
        float *to = add(triangle_source, a, area);
        write(edge_1, to + axis_u_row);
        write(edge_2, to + axis_v_row);
    }
}

void LightSources::place(std::span<const PlacedObject> placed) {
    spheres_ = bounds_of(placed, false);
    specular_spheres_ = bounds_of(placed, true);
    Bounds all;
    for (const auto &sphere : spheres_)
        all.add(vector_of(sphere.data()), sphere[3]);
    const Vec3 middle = all.empty() ? Vec3{0, 0, 0} : all.centre();
    const double extent = all.empty() ? 1 : std::max(all.radius(), 1e-6);

    records_.clear();
    emitters_.assign(arena_.objects.count, {});
    for (const arhost_light &lamp : elements<arhost_light>(arena_, arena_.lights)) {
        float *to = add_record(static_cast<float>(lamp.type));
        to[falloff_row] = lamp.falloff == ARHOST_FALLOFF_INVERSE_SQUARE;
        std::copy_n(lamp.position, 3, to + position_row);
        std::copy_n(lamp.direction, 3, to + direction_row);
        std::copy_n(lamp.intensity, 3, to + intensity_row);
        std::copy_n(lamp.axis_u, 3, to + axis_u_row);
        std::copy_n(lamp.axis_v, 3, to + axis_v_row);
        const bool is_round = lamp.type == ARHOST_LIGHT_SPHERE || lamp.type == ARHOST_LIGHT_SPOT;
        to[radius_row] = is_round ? lamp.radius : 0;
        to[cosine_inner_row] = lamp.cosine_inner;
        to[cosine_outer_row] = lamp.cosine_outer;
        to[area_row] =
            static_cast<float>(is_round ? std::numbers::pi * lamp.radius * lamp.radius
                                        : 4 * length(vector_of(lamp.axis_u)) * length(vector_of(lamp.axis_v)));
    }
    std::vector<std::uint32_t> object_of; // of each emissive record
    for (std::uint32_t i = 0; i < arena_.objects.count; ++i) {
        add_emitter(i, placed[i]);
        object_of.resize(records_.size() / source_rows - lamp_count(), i);
    }
    if (environment_radiance_ > 0)
        add_record(environment_source);
    choose(object_of, middle, extent);
}

// Sets the chances of the light sources. A lamp, an emissive object and the environment are chosen about in
// proportion to the light that they send to the middle of the virtual objects, and the triangles of an object in
// proportion to their areas. `object_of`: the object of each emissive record. `extent`: radius of the virtual
// objects, mm.
void LightSources::choose(const std::vector<std::uint32_t> &object_of, Vec3 middle, double extent) {
    const std::size_t count = records_.size() / source_rows, lamps = lamp_count(), emissive = object_of.size();
    // Sources nearer than the objects' extent count as if they were that far away.
    std::vector<double> light(count);
    std::vector<double> light_of(arena_.objects.count), area_of(arena_.objects.count);
    double sum = 0, of_room = 0, of_objects = 0; // of_objects: emissive ones
    for (std::size_t i = 0; i < count; ++i) {
        const float *from = records_.data() + i * source_rows;
        const Vec3 to_middle = middle - vector_of(from + position_row);
        const double squared = std::max(dot(to_middle, to_middle), extent * extent / 4);
        if (i < lamps)
            light[i] = mean_of(from + intensity_row) * (from[falloff_row] > 0 ? 1 / squared : 1);
        else if (i < lamps + emissive)
            light[i] = mean_of(from + intensity_row) * from[area_row] / (std::numbers::pi * squared);
        else
            light[i] = environment_radiance_;
        sum += light[i];
        if (i >= lamps && i < lamps + emissive) {
            light_of[object_of[i - lamps]] += light[i];
            area_of[object_of[i - lamps]] += from[area_row];
            of_objects += light[i];
        } else {
            of_room += light[i];
        }
    }
    light_ = static_cast<float>(sum);
    light_of_room_ = static_cast<float>(of_room);
    has_sharp_lamp_ = false;
    for (std::size_t i = 0; i < lamps; ++i) {
        const float *from = records_.data() + i * source_rows;
        const double half_width =
            from[type_row] == float{ARHOST_LIGHT_RECTANGLE}
                ? std::min(length(vector_of(from + axis_u_row)), length(vector_of(from + axis_v_row)))
                : double{from[radius_row]};
        const bool is_sharp = from[type_row] == float{ARHOST_LIGHT_DIRECTIONAL} ||
                              half_width < 0.05 * length(middle - vector_of(from + position_row));
        has_sharp_lamp_ = has_sharp_lamp_ || (is_sharp && light[i] > 0.05 * of_room);
    }
    const auto emitters =
        static_cast<std::size_t>(std::ranges::count_if(area_of, [](double area) { return area > 0; }));
    // A small part of the samples is spread evenly, because a surface may be near a source that is far from the
    // middle.
    constexpr double even = 0.1;
    const double share = 1 / static_cast<double>(count - emissive + emitters);
    // Lamps and the environment, whose shadows are seen everywhere, and emissive objects, which shine on what is
    // near, have at least a third of the rest each, unless their light is negligible.
    double of_lamp = 1, of_emitter = 1; // factors of their light
    if (of_room > 0 && of_objects > 0) {
        const auto least = [&](double part) { return std::min(1 / 3.0, 30 * part / sum); };
        const double lamp_share = std::clamp(of_room / sum, least(of_room), 1 - least(of_objects));
        of_lamp = lamp_share * sum / of_room;
        of_emitter = (1 - lamp_share) * sum / of_objects;
    }
    const auto chance_of = [&](double part) { return sum > 0 ? (1 - even) * part / sum + even * share : share; };
    cumulative_.assign(count, 1);
    double before = 0;
    for (std::size_t i = 0; i < count; ++i) {
        float *to = records_.data() + i * source_rows;
        double chance = 0;
        if (i < lamps || i >= lamps + emissive) {
            chance = chance_of(of_lamp * light[i]);
        } else {
            const std::uint32_t object = object_of[i - lamps];
            const double per_area = chance_of(of_emitter * light_of[object]) / area_of[object];
            chance = per_area * to[area_row];
            emitters_[object].density = static_cast<float>(emitters_[object].ball_radius > 0 ? chance : per_area);
        }
        to[chance_row] = static_cast<float>(chance);
        before += chance;
        if (i + 1 < count)
            cumulative_[i] = static_cast<float>(before);
    }
    lamp_chances_.resize(lamps);
    for (std::size_t i = 0; i < lamps; ++i)
        lamp_chances_[i] = records_[i * source_rows + chance_row];
    environment_chance_ = environment_radiance_ > 0 ? records_[(count - 1) * source_rows + chance_row] : 0;
}

float LightSources::least_irradiance(const VideoImage *video) const {
    const float of_scene = 1e-3f * light_;
    if (light_of_room_ > 0 || !video)
        return of_scene;
    constexpr float mean_reflectance = 0.35f; // of rooms, as of the default light of scenes
    const std::array<float, 3> mean = video->mean();
    return std::max(of_scene, static_cast<float>(mean_of(mean.data())) / mean_reflectance);
}

std::vector<float> environment_irradiance(const arhost_scene &arena) {
    const arhost_environment &environment = arena.environment;
    if (environment.texture == ARHOST_NONE)
        return {};
    const arhost_texel_image &image = environment_image(arena);
    const auto texels = elements<std::array<float, 4>>(arena, image.texels);
    // Moments of the light from the cells of a coarse grid, for each channel: the sum of radiance times solid angle
    // times direction. They are exact for surfaces that see all of a cell.
    constexpr std::uint32_t columns = 128, rows = 64;
    std::vector<std::array<Vec3, 3>> moments(std::size_t{columns} * rows);
    const std::uint32_t cells_x = std::max(columns, image.width), cells_y = std::max(rows, image.height);
    const double area = 2 * std::numbers::pi * std::numbers::pi / (static_cast<double>(cells_x) * cells_y);
    for (std::uint32_t y = 0; y < cells_y; ++y) {
        const double v = (y + 0.5) / cells_y;
        const double power = area * shading::equirectangular_sine(v);
        const std::size_t from_row = std::size_t{y} * image.height / cells_y * image.width;
        const std::size_t to_row = std::size_t{y} * rows / cells_y * columns;
        for (std::uint32_t x = 0; x < cells_x; ++x) {
            const float *texel = texels[from_row + std::size_t{x} * image.width / cells_x].data();
            const Vec3 direction = shading::equirectangular_direction((x + 0.5) / cells_x, v) * power;
            std::array<Vec3, 3> &to = moments[to_row + std::size_t{x} * columns / cells_x];
            for (std::size_t c = 0; c < 3; ++c)
                to[c] = to[c] + direction * texel[c];
        }
    }
    std::vector<float> irradiance(std::size_t{4} * irradiance_width * irradiance_height);
    for (std::uint32_t y = 0; y < irradiance_height; ++y)
        for (std::uint32_t x = 0; x < irradiance_width; ++x) {
            const Vec3 normal =
                shading::equirectangular_direction((x + 0.5) / irradiance_width, (y + 0.5) / irradiance_height);
            Vec3 sum{0, 0, 0};
            for (const auto &[red, green, blue] : moments)
                sum = sum + Vec3{std::max(dot(normal, red), 0.0), std::max(dot(normal, green), 0.0),
                                 std::max(dot(normal, blue), 0.0)};
            write(sum * std::numbers::inv_pi, irradiance.data() + 4 * (std::size_t{y} * irradiance_width + x));
        }
    return irradiance;
}

float brightest_texel(const arhost_scene &arena) {
    if (arena.environment.texture == ARHOST_NONE)
        return 0;
    const arhost_texel_image &image = environment_image(arena);
    float brightest = 0;
    for (const auto &texel : elements<std::array<float, 4>>(arena, image.texels))
        brightest = std::max(brightest, 0.2126f * texel[0] + 0.7152f * texel[1] + 0.0722f * texel[2]);
    return brightest;
}

} // namespace arhost::raytracer_common
