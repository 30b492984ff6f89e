// Traces rays. FILL IN: replace this and tracer.cpp; @NAME@.cpp uses only the constructor, update() and trace().
#pragma once

#include <arhost/arhost.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

constexpr double infinity = std::numeric_limits<double>::infinity();

struct Vec {
    double x = 0, y = 0, z = 0;
};
inline Vec operator+(Vec a, Vec b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Vec operator-(Vec a, Vec b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Vec operator*(double s, Vec a) {
    return {s * a.x, s * a.y, s * a.z};
}
inline Vec operator*(Vec a, Vec b) { // per channel
    return {a.x * b.x, a.y * b.y, a.z * b.z};
}
inline double dot(Vec a, Vec b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Vec cross(Vec a, Vec b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double length(Vec a) {
    return std::sqrt(dot(a, a));
}
inline Vec normalised(Vec a) {
    return 1 / length(a) * a;
}
template <class Number> Vec vec(const Number *a) {
    return {double(a[0]), double(a[1]), double(a[2])};
}

struct Ray {
    Vec origin, direction; // mm; unit length
    double end = infinity; // maximum distance of a hit, mm
};

// The result of a ray that hits a virtual object or a shadow catcher. All members are 0 if only the video is visible.
struct Sample {
    bool is_virtual = false;
    Vec colour;                         // of the virtual object, linear light
    double opaque = 0, translucent = 0; // shares of the catcher's light that opaque and translucent objects hide
};

// Brute force: for each object whose bounding sphere a ray hits, tests the ray against every sphere or triangle of the
// object. All positions are in world coordinates, mm.
class Tracer {
public:
    explicit Tracer(const arhost_scene &scene); // the scene must outlive it
    void update(const arhost_motion &motion);   // applies the animated state
    Sample trace(const Ray &ray) const;

private:
    // Kinds of objects, as bits of a ray mask. Glass and solid objects cast different shadows.
    enum Kind : unsigned { solid = 1, glass = 2, catcher = 4, occluder = 8, all_kinds = 15 };
    enum class Faces { all, front };
    enum class Visibility { clear, through_glass, blocked };

    struct Sphere {
        Vec centre;
        double radius = 0;
    };
    struct Triangle {
        Vec corner, edge_1, edge_2;
        Vec face_normal; // geometric normal: outwards, unit length
        Vec normals[3];  // shading normals at the corners
    };
    struct Object {
        Kind kind;
        bool is_visible = true; // rays pass through invisible objects
        const arhost_material *material;
        Sphere bounds;
        std::vector<Sphere> spheres; // an object has either spheres or triangles
        std::vector<Triangle> triangles;
    };
    struct Hit {
        double distance = infinity;
        const Object *object = nullptr; // null: no hit
        Vec face_normal, normal;        // geometric and shading normal, unit length
        Vec lift;                       // from the hit to the origin of shadow rays
    };
    struct Surface;
    struct IncidentLight;

    template <class T> const T *elements(const arhost_buffer &buffer) const;
    void update_geometry(std::uint32_t number, const float *world_from_object, const float *positions,
                         const float *normals);
    static Vec lift(const Triangle &t, double u, double v);
    static void intersect_sphere(const Object &object, const Sphere &sphere, const Ray &ray, Faces faces,
                                 Hit &nearest);
    static void intersect_triangle(const Object &object, const Triangle &triangle, const Ray &ray, Faces faces,
                                   Hit &nearest);
    Hit nearest(const Ray &ray, unsigned kinds, Faces faces = Faces::all) const;
    static Surface surface_at(const Ray &ray, const Hit &hit);
    static IncidentLight incident(const arhost_light &light, const Surface &surface);
    Visibility visibility(const IncidentLight &light, const Surface &surface) const;
    Vec radiance(const Ray &ray, const Hit &hit, unsigned bounces) const;
    Vec direct_light(const Surface &surface, const arhost_material &material, Vec to_eye) const;
    Sample shadow(const Surface &surface) const;

    const arhost_scene &scene_;
    std::vector<Object> objects_;
};
