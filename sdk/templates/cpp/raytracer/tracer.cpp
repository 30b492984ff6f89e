#include "tracer.hpp"

#include <algorithm>
#include <cstddef>

// ---- The scene ----

// What a buffer of the scene holds. arhost has checked all of it: indices, counts, numbers.
template <class T> const T *Tracer::elements(const arhost_buffer &buffer) const {
    const auto *arena = reinterpret_cast<const std::byte *>(&scene_);
    return buffer.count == 0 ? nullptr : reinterpret_cast<const T *>(arena + buffer.offset);
}

Tracer::Tracer(const arhost_scene &scene) : scene_(scene), objects_(scene.objects.count) {
    const auto *objects = elements<arhost_object>(scene.objects);
    for (std::uint32_t i = 0; i < scene.objects.count; ++i) {
        const arhost_object &from = objects[i];
        const arhost_geometry &geometry = elements<arhost_geometry>(scene.geometries)[from.geometry];
        Object &object = objects_[i];
        object.material = &elements<arhost_material>(scene.materials)[from.material];
        object.kind = from.role == ARHOST_ROLE_CATCHER              ? catcher
                      : from.role == ARHOST_ROLE_OCCLUDER           ? occluder
                      : object.material->model == ARHOST_MATERIAL_GLASS ? glass
                                                               : solid;
        place(i, from.world_from_object, elements<float>(geometry.positions), elements<float>(geometry.normals));
    }
}

void Tracer::move(const arhost_motion &motion) {
    const auto *objects = elements<arhost_object>(scene_.objects);
    const auto *geometries = elements<arhost_geometry>(scene_.geometries);
    std::vector<const float *> places(objects_.size());
    for (std::uint32_t i = 0; i < objects_.size(); ++i)
        places[i] = objects[i].world_from_object;
    for (std::uint32_t i = 0; i < motion.moved_count; ++i) {
        const arhost_moved_object &moved = motion.moved[i];
        const arhost_geometry &geometry = geometries[objects[moved.object].geometry];
        places[moved.object] = moved.world_from_object;
        if (!objects[moved.object].deforms)
            place(moved.object, moved.world_from_object, elements<float>(geometry.positions),
                  elements<float>(geometry.normals));
    }
    for (std::uint32_t i = 0; i < motion.deformed_count; ++i) {
        const arhost_deformed_geometry &deformed = motion.deformed[i];
        place(deformed.object, places[deformed.object], deformed.positions, deformed.normals);
    }
}

// Puts an object's geometry into the world. `normals`, one a vertex, may be null.
void Tracer::place(std::uint32_t number, const float *world_from_object, const float *positions,
                   const float *normals) {
    const std::uint32_t geometry_number = elements<arhost_object>(scene_.objects)[number].geometry;
    const arhost_geometry &geometry = elements<arhost_geometry>(scene_.geometries)[geometry_number];
    const float *m = world_from_object; // its columns are the axes and the origin
    const Vec x = vec(m), y = vec(m + 3), z = vec(m + 6), origin = vec(m + 9);
    const auto to_world = [&](const float *p) { return p[0] * x + p[1] * y + p[2] * z + origin; };
    // Normals turn by the inverse's transpose. In a mirrored object its sign keeps the outside outside.
    const double sign = dot(cross(x, y), z) < 0 ? -1 : 1;
    const auto turned = [&](const float *n) {
        return sign * normalised(n[0] * cross(y, z) + n[1] * cross(z, x) + n[2] * cross(x, y));
    };

    Object &object = objects_[number];
    object.spheres.clear();
    object.triangles.clear();
    if (geometry.type == ARHOST_GEOMETRY_SPHERES) {
        for (std::uint32_t i = 0; i < geometry.positions.count; ++i)
            object.spheres.push_back({to_world(positions + 4 * i), positions[4 * i + 3] * length(x)});
    } else {
        const auto *indices = elements<std::uint32_t>(geometry.indices);
        for (std::uint32_t i = 0; i < geometry.indices.count; ++i) {
            const std::uint32_t *corners = indices + std::size_t(3) * i;
            const auto at = [&](int c) { return std::size_t(3) * corners[c]; };
            const Vec corner = to_world(positions + at(0));
            Triangle t = {corner, to_world(positions + at(1)) - corner, to_world(positions + at(2)) - corner, {}, {}};
            const Vec across = cross(t.edge_1, t.edge_2);
            if (length(across) == 0)
                continue; // no area, no facet
            t.facet = sign * normalised(across);
            for (int c = 0; c < 3; ++c)
                t.normals[c] = normals ? turned(normals + at(c)) : t.facet;
            object.triangles.push_back(t);
        }
    }

    // The bounds: about the middle of the box that holds all.
    Vec low{infinity, infinity, infinity}, high{-infinity, -infinity, -infinity};
    const auto for_each_ball = [&](const auto &use) {
        for (const Sphere &s : object.spheres)
            use(s);
        for (const Triangle &t : object.triangles)
            for (const Vec corner : {t.corner, t.corner + t.edge_1, t.corner + t.edge_2})
                use(Sphere{corner, 0});
    };
    for_each_ball([&](const Sphere &s) {
        const Vec r{s.radius, s.radius, s.radius}, a = s.centre - r, b = s.centre + r;
        low = {std::min(low.x, a.x), std::min(low.y, a.y), std::min(low.z, a.z)};
        high = {std::max(high.x, b.x), std::max(high.y, b.y), std::max(high.z, b.z)};
    });
    object.bounds = {0.5 * (low + high), 0};
    for_each_ball([&](const Sphere &s) {
        object.bounds.radius = std::max(object.bounds.radius, length(s.centre - object.bounds.centre) + s.radius);
    });
    object.bounds.radius *= 1 + 1e-9; // rounding must not cut its rim off
}

// ---- Rays and what they hit ----

namespace {

// Where a line is inside a sphere, as distances along it; `in` is not below `out` where it misses.
struct Inside {
    double in = infinity, out = -infinity;
};
Inside inside(Vec centre, double radius, const Ray &ray) {
    const Vec to_centre = centre - ray.origin;
    const double middle = dot(to_centre, ray.direction);
    const Vec aside = to_centre - middle * ray.direction;
    const double squared = radius * radius - dot(aside, aside);
    if (!(squared > 0))
        return {};
    return {middle - std::sqrt(squared), middle + std::sqrt(squared)};
}

} // namespace

void Tracer::try_sphere(const Object &object, const Sphere &sphere, const Ray &ray, Sides sides, Hit &nearest) {
    const Inside way = inside(sphere.centre, sphere.radius, ray);
    const double distance = way.in > 0 || sides == Sides::outside ? way.in : way.out;
    if (!(distance > 0 && distance < nearest.distance))
        return;
    const Vec normal = 1 / sphere.radius * (ray.origin + distance * ray.direction - sphere.centre);
    nearest = {distance, &object, normal, normal};
}

// Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, Journal of Graphics Tools 2(1), 1997.
void Tracer::try_triangle(const Object &object, const Triangle &t, const Ray &ray, Sides sides, Hit &nearest) {
    constexpr double slack = 1e-9; // no ray may slip through between two triangles that share an edge
    if (sides == Sides::outside && dot(t.facet, ray.direction) > 0)
        return;
    const Vec p = cross(ray.direction, t.edge_2);
    const double share = 1 / dot(t.edge_1, p); // of a ray along the plane infinite, which the comparisons refuse
    const Vec from_corner = ray.origin - t.corner;
    const double u = share * dot(from_corner, p);
    if (!(u >= -slack && u <= 1 + slack))
        return;
    const Vec q = cross(from_corner, t.edge_1);
    const double v = share * dot(ray.direction, q);
    const double distance = share * dot(t.edge_2, q);
    if (!(v >= -slack && u + v <= 1 + slack && distance > 0 && distance < nearest.distance))
        return;
    const Vec normal = (1 - u - v) * t.normals[0] + u * t.normals[1] + v * t.normals[2];
    nearest = {distance, &object, t.facet, length(normal) > 0 ? normalised(normal) : t.facet};
}

// FILL IN: a hierarchy of bounds, or a library that has one, makes this fast.
Tracer::Hit Tracer::nearest(const Ray &ray, unsigned kinds, Sides sides) const {
    Hit nearest;
    nearest.distance = ray.end;
    for (const Object &object : objects_) {
        if (!(object.kind & kinds))
            continue;
        const Inside bounds = inside(object.bounds.centre, object.bounds.radius, ray);
        if (!(bounds.in < nearest.distance && bounds.out > 0))
            continue;
        for (const Sphere &sphere : object.spheres)
            try_sphere(object, sphere, ray, sides, nearest);
        for (const Triangle &triangle : object.triangles)
            try_triangle(object, triangle, ray, sides, nearest);
    }
    return nearest;
}

// ---- Light ----

// Where a ray has hit.
struct Tracer::Surface {
    Vec position;      // a little above the facet, so that rays that go on do not hit it again
    Vec below;         // and a little below
    Vec facet, normal; // to where the ray came from; length 1
    bool is_real;      // a catcher or occluder
};

Tracer::Surface Tracer::surface_at(const Ray &ray, const Hit &hit) {
    const Vec at = ray.origin + hit.distance * ray.direction;
    const Vec facet = dot(hit.facet, ray.direction) > 0 ? -1 * hit.facet : hit.facet;
    const Vec normal = dot(hit.normal, facet) < 0 ? -1 * hit.normal : hit.normal;
    const Vec gap = 1e-9 * (length(at) + hit.distance) * facet;
    return {at + gap, at - gap, facet, normal, bool(hit.object->kind & (catcher | occluder))};
}

// A light as a surface has it.
struct Tracer::Incoming {
    Vec direction;         // to the light; length 1
    double distance;       // mm
    double cosine;         // of the surface's inclination; 0: the light is behind it
    double irradiance = 1; // of what faces the light, for an intensity of 1
};

// FILL IN: rectangles and spheres shine from their middle alone. Many points of theirs make soft shadows.
Tracer::Incoming Tracer::incoming(const arhost_light &light, const Surface &surface) {
    const Vec beam = vec(light.direction);
    Incoming in = {-1 * beam, infinity, 0};
    if (light.type != ARHOST_LIGHT_DIRECTIONAL) {
        const Vec way = vec(light.position) - surface.position;
        in.distance = length(way);
        in.direction = 1 / in.distance * way;
        if (light.falloff == ARHOST_FALLOFF_INVERSE_SQUARE)
            in.irradiance = 1 / std::max(dot(way, way), 1e-6);
    }
    const double along_beam = -dot(beam, in.direction);
    if (light.type == ARHOST_LIGHT_RECTANGLE)
        in.irradiance *= std::max(along_beam, 0.0);
    if (light.type == ARHOST_LIGHT_SPOT) {
        const double outer = light.cosine_outer, inner = light.cosine_inner;
        const double t = std::clamp((along_beam - outer) / std::max(inner - outer, 1e-6), 0.0, 1.0);
        in.irradiance *= t * t * (3 - 2 * t);
    }
    if (dot(surface.facet, in.direction) > 0)
        in.cosine = std::max(dot(surface.normal, in.direction), 0.0);
    return in;
}

// Real things cast no shadows on each other: those are in the video.
Tracer::Way Tracer::way_to(const Incoming &light, const Surface &surface) const {
    const Ray ray = {surface.position, light.direction, light.distance};
    if (nearest(ray, surface.is_real ? solid : solid | catcher | occluder).object)
        return Way::blocked;
    return nearest(ray, glass).object ? Way::through_glass : Way::clear;
}

// Lambert, and Phong's highlight.
Vec Tracer::lit(const Surface &surface, const arhost_material &material, Vec to_eye) const {
    const bool shines = material.model == ARHOST_MATERIAL_SPECULAR || material.model == ARHOST_MATERIAL_METAL;
    const auto *lights = elements<arhost_light>(scene_.lights);
    Vec sum = vec(scene_.ambient) * vec(material.ambient) + vec(material.emission);
    for (std::uint32_t i = 0; i < scene_.lights.count; ++i) {
        const Incoming in = incoming(lights[i], surface);
        if (!(in.cosine * in.irradiance > 0) || way_to(in, surface) == Way::blocked)
            continue;
        Vec reflected = in.cosine * vec(material.diffuse);
        if (shines) {
            const Vec mirrored = 2 * dot(surface.normal, in.direction) * surface.normal - in.direction;
            const double lobe = std::pow(std::max(dot(mirrored, to_eye), 0.0), material.exponent);
            reflected = reflected + lobe * vec(material.specular);
        }
        sum = sum + in.irradiance * (reflected * vec(lights[i].intensity));
    }
    return sum;
}

// FILL IN: there are no textures, no environment, no microfacets (metallic-roughness is drawn as Lambert), and glass
// does not bend light, nor reflect or colour any.
Vec Tracer::colour(const Ray &ray, const Hit &hit, unsigned bounces) const {
    if (!hit.object)
        return vec(scene_.background);
    const arhost_material &material = *hit.object->material;
    const Surface surface = surface_at(ray, hit);
    const auto light_from = [&](Vec origin, Vec direction) {
        if (bounces >= scene_.max_depth)
            return Vec{};
        const Ray onwards = {origin, direction};
        return colour(onwards, nearest(onwards, anything), bounces + 1);
    };
    const double cosine = -dot(ray.direction, surface.normal);
    const Vec mirrored = ray.direction + 2 * cosine * surface.normal;
    switch (material.model) {
    case ARHOST_MATERIAL_MIRROR:
        return vec(material.reflectivity) * light_from(surface.position, mirrored);
    case ARHOST_MATERIAL_METAL: {
        const double rim = std::pow(1 - std::clamp(cosine, 0.0, 1.0), 5); // Schlick
        const Vec reflectance = (1 - rim) * vec(material.reflectivity) + Vec{rim, rim, rim};
        return lit(surface, material, -1 * ray.direction) + reflectance * light_from(surface.position, mirrored);
    }
    case ARHOST_MATERIAL_GLASS:
        return vec(material.refraction) * light_from(surface.below, ray.direction);
    default:
        return lit(surface, material, -1 * ray.direction);
    }
}

// ---- What lies over the video ----

// The share of a catcher's light that virtual objects hide decides how dark it becomes.
double Tracer::shadow_alpha(const Surface &surface) const {
    const auto *lights = elements<arhost_light>(scene_.lights);
    double all = 0, blocked = 0, through_glass = 0;
    for (std::uint32_t i = 0; i < scene_.lights.count; ++i) {
        const Incoming in = incoming(lights[i], surface);
        const float *intensity = lights[i].intensity;
        const double light = in.cosine * in.irradiance * (double(intensity[0]) + intensity[1] + intensity[2]);
        if (!(light > 0))
            continue;
        const Way way = way_to(in, surface);
        all += light;
        blocked += way == Way::blocked ? light : 0;
        through_glass += way == Way::through_glass ? light : 0;
    }
    if (!(all > 0))
        return 0;
    return blocked / all * scene_.shadow_alpha_opaque + through_glass / all * scene_.shadow_alpha_translucent;
}

Seen Tracer::look(const Ray &ray) const {
    const Hit drawn = nearest(ray, solid | glass | occluder);
    if (drawn.object && drawn.object->kind != occluder)
        return {colour(ray, drawn, 0), 1};
    // A catcher is in the video already. Only the shadow on it is missing there.
    const Hit caught = nearest({ray.origin, ray.direction, drawn.distance}, catcher, Sides::outside);
    if (caught.object)
        return {Vec{}, shadow_alpha(surface_at(ray, caught))};
    return {};
}
