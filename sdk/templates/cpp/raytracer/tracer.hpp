// What is seen along a ray. FILL IN: this and tracer.cpp are the part to replace; @NAME@.cpp needs no more of it than
// move() and look().
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
inline Vec operator*(Vec a, Vec b) { // of colours
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
    Vec origin, direction; // length 1
    double end = infinity; // hits beyond do not count
};

// What to lay over the video. Alpha is exactly 0 where the video shows, exactly 1 on virtual objects.
struct Seen {
    Vec colour; // linear light
    double alpha = 0;
};

// By brute force: each ray is tried on every object whose bounds it meets, and there on every triangle. All places
// are in the world, in mm.
class Tracer {
public:
    explicit Tracer(const arhost_scene &scene); // which must live longer
    void move(const arhost_motion &motion);     // puts what moves where it is now
    Seen look(const Ray &ray) const;

private:
    // What rays can hit, as bits. A shadow of glass is another than that of a solid body.
    enum Kind : unsigned { solid = 1, glass = 2, catcher = 4, occluder = 8, anything = 15 };
    enum class Sides { both, outside };
    enum class Way { clear, through_glass, blocked };

    struct Sphere {
        Vec centre;
        double radius = 0;
    };
    struct Triangle {
        Vec corner, edge_1, edge_2;
        Vec facet;      // out of the outside; length 1
        Vec normals[3]; // at the corners
    };
    struct Object {
        Kind kind;
        const arhost_material *material;
        Sphere bounds;
        std::vector<Sphere> spheres;     // one of the two
        std::vector<Triangle> triangles; // is empty
    };
    struct Hit {
        double distance = infinity;
        const Object *object = nullptr; // none: the ray missed
        Vec facet, normal;              // the flat one and the interpolated one; length 1
    };
    struct Surface;
    struct Incoming;

    template <class T> const T *elements(const arhost_buffer &buffer) const;
    void place(std::uint32_t number, const float *world_from_object, const float *positions, const float *normals);
    static void try_sphere(const Object &object, const Sphere &sphere, const Ray &ray, Sides sides, Hit &nearest);
    static void try_triangle(const Object &object, const Triangle &triangle, const Ray &ray, Sides sides,
                             Hit &nearest);
    Hit nearest(const Ray &ray, unsigned kinds, Sides sides = Sides::both) const;
    static Surface surface_at(const Ray &ray, const Hit &hit);
    static Incoming incoming(const arhost_light &light, const Surface &surface);
    Way way_to(const Incoming &light, const Surface &surface) const;
    Vec colour(const Ray &ray, const Hit &hit, unsigned bounces) const;
    Vec lit(const Surface &surface, const arhost_material &material, Vec to_eye) const;
    double shadow_alpha(const Surface &surface) const;

    const arhost_scene &scene_;
    std::vector<Object> objects_;
};
