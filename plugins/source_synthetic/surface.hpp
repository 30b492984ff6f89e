// SPDX-License-Identifier: Apache-2.0
//
// What a point of the desk is made of, and the shapes that lie on it. Millimetres for a marker of 80 mm.
#pragma once

#include <arhost/shading/scalar.hpp>
#include <arhost/shading/vec3.hpp>

#include <algorithm>
#include <cmath>
#include <functional>

namespace arhost::synthetic {

using Colour = shading::Vec3T<float>; // linear light
using Vec3 = shading::Vec3T<float>;

struct Point {
    float x, y;
    friend Point operator+(Point a, Point b) { return {a.x + b.x, a.y + b.y}; }
    friend Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y}; }
    friend Point operator*(Point a, float s) { return {a.x * s, a.y * s}; }
    friend float dot(Point a, Point b) { return a.x * b.x + a.y * b.y; }
};
inline float length(Point p) {
    return std::sqrt(dot(p, p));
}

struct Surface {
    Colour albedo{};
    float gloss = 0;  // share of the mirror image that a varnished board shows
    float window = 1; // share of the window's light that arrives, or more on a slope towards it
    float sky = 1;    // share of the room's light
};

inline Colour srgb(double red, double green, double blue) {
    const auto linear = [](double code) { return static_cast<float>(shading::srgb_decode(code / 255)); };
    return {linear(red), linear(green), linear(blue)};
}

inline float mix(float a, float b, float share) {
    return a + (b - a) * share;
}
inline Colour mix(Colour a, Colour b, float share) {
    return a + (b - a) * share;
}
inline Surface mix(const Surface &a, const Surface &b, float share) {
    return {mix(a.albedo, b.albedo, share), mix(a.gloss, b.gloss, share), mix(a.window, b.window, share),
            mix(a.sky, b.sky, share)};
}
// 0 before `from`, 1 after `to`, either way round.
inline float smoothstep(float from, float to, float x) {
    const float t = std::clamp((x - from) / (to - from), 0.0f, 1.0f);
    return t * t * (3 - 2 * t);
}

// Where a shape lies: its middle, and its x axis turned against the clock.
class Placement {
public:
    Placement(Point at, double degrees)
        : at_(at), c_(static_cast<float>(std::cos(degrees * 0.017453292519943295))),
          s_(static_cast<float>(std::sin(degrees * 0.017453292519943295))) {}
    Point local(Point p) const {
        const Point d = p - at_;
        return turned(d);
    }
    Point turned(Point d) const { return {c_ * d.x + s_ * d.y, c_ * d.y - s_ * d.x}; }
    Point at() const { return at_; }

private:
    Point at_;
    float c_, s_;
};

// Signed distances, negative inside.
inline float box(Point p, Point half, float corner_radius = 0) {
    const float x = std::abs(p.x) - half.x + corner_radius, y = std::abs(p.y) - half.y + corner_radius;
    const Point outside{std::max(x, 0.0f), std::max(y, 0.0f)};
    return length(outside) + std::min(std::max(x, y), 0.0f) - corner_radius;
}
inline float segment(Point p, Point a, Point b) { // its distance, never negative
    const Point along = b - a;
    const float t = std::clamp(dot(p - a, along) / dot(along, along), 0.0f, 1.0f);
    return length(p - a - along * t);
}
// The share of a texel that is inside.
inline float coverage(float distance, float texel) {
    return std::clamp(0.5f - distance / texel, 0.0f, 1.0f);
}

// The window stands to the back and left; shadows fall away from it.
inline constexpr Point shadow_direction{0.67f, -0.74f};
inline constexpr float shadow_per_height = 1.35f;
inline constexpr Vec3 towards_window{-0.54f, 0.595f, 0.595f};

// How much of the window's light a slope gets, against a level surface.
inline float slope_light(Vec3 normal) {
    return std::max(0.0f, dot(normal, towards_window)) / towards_window.z;
}

struct Bounds {
    Point low, high;
    static Bounds about(Point middle, float reach) {
        return {middle - Point{reach, reach}, middle + Point{reach, reach}};
    }
    Bounds with(Bounds other) const {
        return {{std::min(low.x, other.low.x), std::min(low.y, other.low.y)},
                {std::max(high.x, other.high.x), std::max(high.y, other.high.y)}};
    }
    bool contain(Point p) const { return p.x > low.x && p.y > low.y && p.x < high.x && p.y < high.y; }
};

// Something on the desk. `draw` changes the surface below it, nothing outside of its bounds, and tells
// whether it lies there itself, not its shadow alone.
struct Item {
    Bounds bounds;
    std::function<bool(Point p, float texel, Surface &surface)> draw;
};

// The shadow of a shape `height` mm thick: soft where it falls, and dark where the shape touches.
template <class Distance>
void cast_shadow(Point p, float height, const Placement &place, const Distance &distance, Surface &surface) {
    const float soft = 0.6f * height + 0.4f;
    const Point from = p - shadow_direction * (height * shadow_per_height * 0.75f);
    surface.window *= 1 - 0.86f * smoothstep(soft, -soft, distance(place.local(from)));
    surface.sky *= 1 - 0.55f * smoothstep(2.2f * height + 0.8f, -0.4f, distance(place.local(p)));
}

// A shape with its shadow. `look` gives the surface at a local point, and may use the distance.
template <class Distance, class Look>
Item lay(Placement place, float radius, float height, Distance distance, Look look) {
    return {Bounds::about(place.at(), radius + 4 * height + 2), [=](Point p, float texel, Surface &surface) {
                cast_shadow(p, height, place, distance, surface);
                const Point local = place.local(p);
                const float d = distance(local), share = coverage(d, texel);
                if (share > 0)
                    surface = mix(surface, look(local, d, texel), share);
                return share > 0;
            }};
}

} // namespace arhost::synthetic
