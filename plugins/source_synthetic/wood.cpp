// SPDX-License-Identifier: Apache-2.0
#include "wood.hpp"

namespace arhost::synthetic {
namespace {

constexpr float board_width = 138, board_length = 1250;
constexpr Point table_half{830, 585};

} // namespace

// A board is a slice through a trunk's rings: r is a point's distance from the trunk's axis, which lies at
// some depth below the board and wanders along it. That gives the arches of plain-sawn wood in the middle
// and straight lines at the sides.
Surface Wood::at(Point p, float texel) const {
    static const Colour early = srgb(184, 142, 101), late = srgb(122, 82, 52), pore = srgb(74, 46, 28);
    static const Colour knot_heart = srgb(70, 40, 22), floor = srgb(74, 67, 62);

    const Point q = boards_.local(p);
    const float edge = box(q, table_half, 6);
    if (edge > texel) {
        const float patch = noise_(q.x / 420, q.y / 420) + 0.5f * noise_(q.x / 150, q.y / 150);
        const float near_table = smoothstep(260, 0, edge);
        return {mix(floor, floor * 1.7f, smoothstep(0.1f, 0.6f, patch)), 0.05f, 0.6f * (1 - 0.6f * near_table),
                0.8f * (1 - 0.4f * near_table)};
    }

    const float rows = q.y / board_width + 0.36f;
    const std::int32_t row = floor_of(rows);
    const float across = (rows - static_cast<float>(row) - 0.5f) * board_width;
    const float lengths = q.x / board_length + random_share(seed_, row, 1);
    const std::int32_t piece = floor_of(lengths);
    const float in_piece = (lengths - static_cast<float>(piece)) * board_length;
    const auto of_board = [&](int property) { return random_share(seed_, row * 64 + property, piece + 7); };
    const float along = q.x + 3000 * of_board(0);
    const float shift = 90 * of_board(1); // of the noise, so that no two boards share it
    const auto noise = [&](float x_mm, float y_mm) { return noise_(along / x_mm + shift, across / y_mm + shift); };

    // A knot: the rings flow around it.
    float bulge = 0, knot = 0, knot_rings = 0;
    if (of_board(2) < 0.55f) {
        const float size = 5 + 4 * of_board(3);
        const Point d{in_piece - board_length * (0.12f + 0.76f * of_board(4)), across - 90 * (of_board(5) - 0.5f)};
        const float far2 = (d.x * d.x) / (25 * size * size) + (d.y * d.y) / (6 * size * size);
        if (far2 < 9) {
            bulge = 2.6f * size * std::exp(-far2);
            const float r = std::sqrt(d.x * d.x / 1.9f + d.y * d.y) + 0.7f * noise(6, 5);
            knot = smoothstep(size, 0.72f * size, r);
            knot_rings = 0.5f + 0.5f * std::sin(r * 4.2f);
        }
    }

    const float from_axis =
        across - (of_board(6) - 0.5f) * 0.9f * board_width + 13 * noise(430, 150) + 3.2f * noise(120, 45) + bulge;
    const float depth = 14 + 34 * of_board(7) + 0.035f * in_piece + 16 * noise_(along / 620 + shift, 3.3f);
    const float r = std::sqrt(from_axis * from_axis + depth * depth) + 0.45f * noise(46, 4) + 0.8f * bulge;
    const float ring = r / (4.6f + 1.6f * of_board(8)) + 0.8f * noise_(r / 11 + shift, 5.5f);
    const float t = ring - static_cast<float>(floor_of(ring));
    const float dark = smoothstep(0.25f, 0.9f, t) * smoothstep(1.0f, 0.93f, t);

    const float fibre = noise(34, 0.9f), fine = texel < 0.8f ? noise(11, 0.38f) : 0;
    const float pores = texel < 0.8f ? smoothstep(0.42f, 0.8f, noise(8, 0.42f)) * (1 - 0.75f * dark) : 0.06f;
    const float flame = noise(24, 30); // light that comes back from slanting fibres
    Surface surface;
    surface.albedo = mix(early, late, std::clamp(0.14f + 0.62f * dark * (0.75f + 0.35f * fibre), 0.0f, 1.0f));
    surface.albedo = mix(surface.albedo, pore, 0.55f * pores);
    const float board_tone = of_board(9) - 0.5f;
    surface.albedo = surface.albedo * (1 + 0.24f * board_tone + 0.07f * noise(190, 60) + 0.075f * fibre +
                                       0.06f * fine + 0.045f * flame);
    surface.albedo.x *= 1 + 0.05f * (of_board(10) - 0.5f);
    surface.albedo.z *= 1 - 0.16f * (of_board(10) - 0.5f);
    if (knot > 0)
        surface.albedo = mix(surface.albedo, mix(knot_heart, late, 0.3f + 0.35f * knot_rings), 0.9f * knot);
    surface.gloss = 0.86f - 0.25f * pores + 0.1f * fibre - 0.06f * dark;

    // The joints: a dark gap between eased edges.
    const float gap = std::min(board_width / 2 - std::abs(across), std::min(in_piece, board_length - in_piece));
    if (gap < 2.2f) {
        surface.window *= 1 - 0.16f * smoothstep(2.0f, 0.5f, gap) * (across > 0 ? 1.0f : -0.6f);
        const float open = smoothstep(0.55f + texel / 2, 0.1f - texel / 2, gap);
        surface.window *= 1 - 0.9f * open;
        surface.sky *= 1 - 0.75f * open;
        surface.gloss *= 1 - open;
    }
    // The table's rounded edge catches the light.
    const float rim = smoothstep(-9, 0, edge);
    surface.window *= 1 + 0.25f * rim;
    const float inside = coverage(edge, texel);
    return mix(Surface{floor, 0.05f, 0.09f, 0.3f}, surface, inside);
}

} // namespace arhost::synthetic
