#include "tracer.hpp"

#include <algorithm>
#include <cstddef>

// ---- The scene ----

// The elements of a buffer of the scene. arhost has validated all indices, counts and numbers.
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
        object.kind = from.role == ARHOST_ROLE_CATCHER                  ? catcher
                      : from.role == ARHOST_ROLE_OCCLUDER               ? occluder
                      : object.material->model == ARHOST_MATERIAL_GLASS ? glass
                                                                        : solid;
        update_geometry(i, from.world_from_object, elements<float>(geometry.positions),
                        elements<float>(geometry.normals));
    }
}

void Tracer::update(const arhost_motion &motion) {
    const auto *objects = elements<arhost_object>(scene_.objects);
    const auto *geometries = elements<arhost_geometry>(scene_.geometries);
    std::vector<const float *> transforms(objects_.size());
    for (std::uint32_t i = 0; i < objects_.size(); ++i)
        transforms[i] = objects[i].world_from_object;
    for (std::uint32_t i = 0; i < motion.moved_count; ++i) {
        const arhost_moved_object &moved = motion.moved[i];
        const arhost_geometry &geometry = geometries[objects[moved.object].geometry];
        transforms[moved.object] = moved.world_from_object;
        objects_[moved.object].is_visible = moved.is_visible != 0;
        if (!objects[moved.object].deforms)
            update_geometry(moved.object, moved.world_from_object, elements<float>(geometry.positions),
                            elements<float>(geometry.normals));
    }
    for (std::uint32_t i = 0; i < motion.deformed_count; ++i) {
        const arhost_deformed_geometry &deformed = motion.deformed[i];
        objects_[deformed.object].is_visible = deformed.is_visible != 0;
        update_geometry(deformed.object, transforms[deformed.object], deformed.positions, deformed.normals);
    }
}

// Transforms an object's geometry to world coordinates. `normals`, one per vertex, may be null.
void Tracer::update_geometry(std::uint32_t number, const float *world_from_object, const float *positions,
                             const float *normals) {
    const std::uint32_t geometry_number = elements<arhost_object>(scene_.objects)[number].geometry;
    const arhost_geometry &geometry = elements<arhost_geometry>(scene_.geometries)[geometry_number];
    const float *m = world_from_object; // columns: axes and origin
    const Vec x = vec(m), y = vec(m + 3), z = vec(m + 6), origin = vec(m + 9);
    const auto to_world = [&](const float *p) { return p[0] * x + p[1] * y + p[2] * z + origin; };
    // Normals transform by the inverse transpose. Its sign keeps the normals of a mirrored object pointing outwards.
    const double sign = dot(cross(x, y), z) < 0 ? -1 : 1;
    const auto rotated = [&](const float *n) {
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
                continue; // zero area: no normal
            t.face_normal = sign * normalised(across);
            for (int c = 0; c < 3; ++c)
                t.normals[c] = normals ? rotated(normals + at(c)) : t.face_normal;
            object.triangles.push_back(t);
        }
    }

    // Bounding sphere around the centre of the bounding box.
    Vec low{infinity, infinity, infinity}, high{-infinity, -infinity, -infinity};
    const auto for_each_sphere = [&](const auto &visit) {
        for (const Sphere &s : object.spheres)
            visit(s);
        for (const Triangle &t : object.triangles)
            for (const Vec corner : {t.corner, t.corner + t.edge_1, t.corner + t.edge_2})
                visit(Sphere{corner, 0});
    };
    for_each_sphere([&](const Sphere &s) {
        const Vec r{s.radius, s.radius, s.radius}, a = s.centre - r, b = s.centre + r;
        low = {std::min(low.x, a.x), std::min(low.y, a.y), std::min(low.z, a.z)};
        high = {std::max(high.x, b.x), std::max(high.y, b.y), std::max(high.z, b.z)};
    });
    object.bounds = {0.5 * (low + high), 0};
    for_each_sphere([&](const Sphere &s) {
        object.bounds.radius = std::max(object.bounds.radius, length(s.centre - object.bounds.centre) + s.radius);
    });
    object.bounds.radius *= 1 + 1e-9; // margin for rounding
}

// ---- Intersections ----

namespace {

// The distances at which the line of a ray enters and leaves a sphere; enter > leave if it misses the sphere.
struct Interval {
    double enter = infinity, leave = -infinity;
};
Interval sphere_interval(Vec centre, double radius, const Ray &ray) {
    const Vec to_centre = centre - ray.origin;
    const double middle = dot(to_centre, ray.direction);
    const Vec aside = to_centre - middle * ray.direction;
    const double squared = radius * radius - dot(aside, aside);
    if (!(squared > 0))
        return {};
    return {middle - std::sqrt(squared), middle + std::sqrt(squared)};
}

} // namespace

void Tracer::intersect_sphere(const Object &object, const Sphere &sphere, const Ray &ray, Faces faces, Hit &nearest) {
    const Interval interval = sphere_interval(sphere.centre, sphere.radius, ray);
    const double distance = interval.enter > 0 || faces == Faces::front ? interval.enter : interval.leave;
    if (!(distance > 0 && distance < nearest.distance))
        return;
    const Vec normal = 1 / sphere.radius * (ray.origin + distance * ray.direction - sphere.centre);
    nearest = {distance, &object, normal, normal, {}};
}

// Returns the vector from a point of a triangle to the curved surface that the triangle's shading normals describe.
// Shadow rays start at this surface, so that the facets of a smooth mesh do not shadow themselves (J. Hanika, Hacking
// the Shadow Terminator, Ray Tracing Gems II, 2021).
Vec Tracer::lift(const Triangle &t, double u, double v) {
    const Vec from_corner = u * t.edge_1 + v * t.edge_2;
    const auto to_corner = [&](Vec corner, Vec normal, double weight) {
        return weight * std::max(dot(corner - from_corner, normal), 0.0) * normal;
    };
    return to_corner({}, t.normals[0], 1 - u - v) + to_corner(t.edge_1, t.normals[1], u) +
           to_corner(t.edge_2, t.normals[2], v);
}

// Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, Journal of Graphics Tools 2(1), 1997.
void Tracer::intersect_triangle(const Object &object, const Triangle &t, const Ray &ray, Faces faces, Hit &nearest) {
    constexpr double epsilon = 1e-9; // prevents gaps between triangles with a common edge
    if (faces == Faces::front && dot(t.face_normal, ray.direction) > 0)
        return;
    const Vec p = cross(ray.direction, t.edge_2);
    const double inverse = 1 / dot(t.edge_1, p); // infinite if parallel, which fails the tests below
    const Vec from_corner = ray.origin - t.corner;
    const double u = inverse * dot(from_corner, p);
    if (!(u >= -epsilon && u <= 1 + epsilon))
        return;
    const Vec q = cross(from_corner, t.edge_1);
    const double v = inverse * dot(ray.direction, q);
    const double distance = inverse * dot(t.edge_2, q);
    if (!(v >= -epsilon && u + v <= 1 + epsilon && distance > 0 && distance < nearest.distance))
        return;
    const Vec normal = (1 - u - v) * t.normals[0] + u * t.normals[1] + v * t.normals[2];
    nearest = {distance, &object, t.face_normal, length(normal) > 0 ? normalised(normal) : t.face_normal,
               lift(t, u, v)};
}

// FILL IN: use a BVH, or a library such as Embree, to make this fast.
Tracer::Hit Tracer::nearest(const Ray &ray, unsigned kinds, Faces faces) const {
    Hit nearest;
    nearest.distance = ray.end;
    for (const Object &object : objects_) {
        if (!object.is_visible || !(object.kind & kinds))
            continue;
        const Interval bounds = sphere_interval(object.bounds.centre, object.bounds.radius, ray);
        if (!(bounds.enter < nearest.distance && bounds.leave > 0))
            continue;
        for (const Sphere &sphere : object.spheres)
            intersect_sphere(object, sphere, ray, faces, nearest);
        for (const Triangle &triangle : object.triangles)
            intersect_triangle(object, triangle, ray, faces, nearest);
    }
    return nearest;
}

// ---- Shading ----

// A point hit by a ray.
struct Tracer::Surface {
    Vec position; // offset along the geometric normal, so that secondary rays do not hit it again
    Vec below;    // offset to the other side
    Vec lifted;   // origin of shadow rays
    Vec normal;   // shading normal, facing the ray's origin; unit length
    bool is_real; // a catcher or occluder
};

Tracer::Surface Tracer::surface_at(const Ray &ray, const Hit &hit) {
    const Vec at = ray.origin + hit.distance * ray.direction;
    const Vec face_normal = dot(hit.face_normal, ray.direction) > 0 ? -1 * hit.face_normal : hit.face_normal;
    const Vec normal = dot(hit.normal, face_normal) < 0 ? -1 * hit.normal : hit.normal;
    const Vec gap = 1e-9 * (length(at) + hit.distance) * face_normal;
    const Vec lift = dot(hit.normal, face_normal) < 0 ? Vec{} : hit.lift; // no lift inside an object
    return {at + gap, at - gap, at + gap + lift, normal, bool(hit.object->kind & (catcher | occluder))};
}

// The light that arrives at a surface from one light source.
struct Tracer::IncidentLight {
    Vec direction;         // to the light; unit length
    double distance;       // mm
    double cosine;         // to the normal; 0 if the light is behind the surface
    double irradiance = 1; // at normal incidence, for an intensity of 1
};

// FILL IN: area lights emit from their centre only; sample many points on them for soft shadows.
Tracer::IncidentLight Tracer::incident(const arhost_light &light, const Surface &surface) {
    const Vec beam = vec(light.direction);
    IncidentLight in = {-1 * beam, infinity, 0};
    if (light.type != ARHOST_LIGHT_DIRECTIONAL) {
        const Vec to_light = vec(light.position) - surface.position;
        in.distance = length(to_light);
        in.direction = 1 / in.distance * to_light;
        if (light.falloff == ARHOST_FALLOFF_INVERSE_SQUARE)
            in.irradiance = 1 / std::max(dot(to_light, to_light), 1e-6);
    }
    const double along_beam = -dot(beam, in.direction);
    if (light.type == ARHOST_LIGHT_RECTANGLE)
        in.irradiance *= std::max(along_beam, 0.0);
    if (light.type == ARHOST_LIGHT_SPOT) {
        const double outer = light.cosine_outer, inner = light.cosine_inner;
        const double t = std::clamp((along_beam - outer) / std::max(inner - outer, 1e-6), 0.0, 1.0);
        in.irradiance *= t * t * (3 - 2 * t);
    }
    in.cosine = std::max(dot(surface.normal, in.direction), 0.0);
    return in;
}

// Proxies for real objects cast no shadows on each other, because the video already shows these shadows.
Tracer::Visibility Tracer::visibility(const IncidentLight &light, const Surface &surface) const {
    Ray ray = {surface.lifted, light.direction, light.distance};
    if (light.distance < infinity) {
        const Vec to_light = surface.position + light.distance * light.direction - surface.lifted;
        ray.end = length(to_light);
        ray.direction = (1 / ray.end) * to_light;
    }
    if (nearest(ray, surface.is_real ? solid : solid | catcher | occluder).object)
        return Visibility::blocked;
    return nearest(ray, glass).object ? Visibility::through_glass : Visibility::clear;
}

// Shades with the models of Lambert and Phong.
Vec Tracer::direct_light(const Surface &surface, const arhost_material &material, Vec to_eye) const {
    const bool has_highlight = material.model == ARHOST_MATERIAL_SPECULAR || material.model == ARHOST_MATERIAL_METAL;
    const auto *lights = elements<arhost_light>(scene_.lights);
    Vec sum = vec(scene_.ambient) * vec(material.ambient) + vec(material.emission);
    for (std::uint32_t i = 0; i < scene_.lights.count; ++i) {
        const IncidentLight in = incident(lights[i], surface);
        if (!(in.cosine * in.irradiance > 0) || visibility(in, surface) == Visibility::blocked)
            continue;
        Vec reflected = in.cosine * vec(material.diffuse);
        if (has_highlight) {
            const Vec mirrored = 2 * dot(surface.normal, in.direction) * surface.normal - in.direction;
            const double lobe = std::pow(std::max(dot(mirrored, to_eye), 0.0), material.exponent);
            reflected = reflected + lobe * vec(material.specular);
        }
        sum = sum + in.irradiance * (reflected * vec(lights[i].intensity));
    }
    return sum;
}

// FILL IN: not implemented: textures, environment maps, microfacets (metallic-roughness is shaded as Lambert), and
// refraction, reflection and absorption of glass.
Vec Tracer::radiance(const Ray &ray, const Hit &hit, unsigned bounces) const {
    if (!hit.object)
        return vec(scene_.background);
    const arhost_material &material = *hit.object->material;
    const Surface surface = surface_at(ray, hit);
    const auto trace_secondary = [&](Vec origin, Vec direction) {
        if (bounces >= scene_.max_depth)
            return Vec{};
        const Ray secondary = {origin, direction};
        return radiance(secondary, nearest(secondary, all_kinds), bounces + 1);
    };
    const double cosine = -dot(ray.direction, surface.normal);
    const Vec mirrored = ray.direction + 2 * cosine * surface.normal;
    switch (material.model) {
    case ARHOST_MATERIAL_MIRROR:
        return vec(material.reflectivity) * trace_secondary(surface.position, mirrored);
    case ARHOST_MATERIAL_METAL: {
        const double schlick = std::pow(1 - std::clamp(cosine, 0.0, 1.0), 5);
        const Vec reflectance = (1 - schlick) * vec(material.reflectivity) + Vec{schlick, schlick, schlick};
        return direct_light(surface, material, -1 * ray.direction) +
               reflectance * trace_secondary(surface.position, mirrored);
    }
    case ARHOST_MATERIAL_GLASS:
        return vec(material.refraction) * trace_secondary(surface.below, ray.direction);
    default:
        return direct_light(surface, material, -1 * ray.direction);
    }
}

// ---- Overlay ----

// The shares of a catcher's light that virtual objects hide.
Sample Tracer::shadow(const Surface &surface) const {
    const auto *lights = elements<arhost_light>(scene_.lights);
    double total = 0, blocked = 0, through_glass = 0;
    for (std::uint32_t i = 0; i < scene_.lights.count; ++i) {
        const IncidentLight in = incident(lights[i], surface);
        const float *intensity = lights[i].intensity;
        const double light = in.cosine * in.irradiance * (double(intensity[0]) + intensity[1] + intensity[2]);
        if (!(light > 0))
            continue;
        const Visibility path = visibility(in, surface);
        total += light;
        blocked += path == Visibility::blocked ? light : 0;
        through_glass += path == Visibility::through_glass ? light : 0;
    }
    if (!(total > 0))
        return {};
    return {false, {}, blocked / total, through_glass / total};
}

Sample Tracer::trace(const Ray &ray) const {
    const Hit hit = nearest(ray, solid | glass | occluder);
    if (hit.object && hit.object->kind != occluder)
        return {true, radiance(ray, hit, 0)};
    // The video shows the real surface; the overlay adds only the shadow.
    const Hit shadowed = nearest({ray.origin, ray.direction, hit.distance}, catcher, Faces::front);
    return shadowed.object ? shadow(surface_at(ray, shadowed)) : Sample{};
}
