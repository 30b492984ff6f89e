// SPDX-License-Identifier: Apache-2.0
#include "desk.hpp"

#include "noise.hpp"
#include "print.hpp"
#include "wood.hpp"

#include <array>
#include <cstdio>
#include <memory>

namespace arhost::synthetic {
namespace {

// The window: a rectangle upright in the wall. Its middle, from the marker, and half its width.
constexpr Point window_at{-640, 702};
constexpr Point into_window{-0.674f, 0.739f}, along_window{0.739f, 0.674f};
constexpr float window_bottom = 240, window_top = 1180, window_half = 400;

// The share of the light at the marker that the window sends to a point: both cosines over the square of
// the distance, as for a small lamp, times a curtain's soft shade.
float window_light(Point p, const Noise &noise) {
    const float height = 0.5f * (window_bottom + window_top);
    const auto unscaled = [&](Point at) {
        const Point d = window_at - at;
        const float r2 = dot(d, d) + height * height;
        return height * std::max(0.0f, dot(d, into_window)) / (r2 * r2);
    };
    const float curtain =
        smoothstep(-0.2f, 0.7f, noise(dot(p, along_window) / 230 + 9.4f, dot(p, into_window) / 620));
    return unscaled(p) / unscaled({0, 0}) * (1.06f - 0.26f * curtain);
}

Colour radiance(const Surface &surface, float window) {
    constexpr Colour daylight{0.985f, 1.0f, 1.02f}, room{1.07f, 0.99f, 0.90f};
    const Colour light = daylight * (0.83f * window * surface.window) + room * (0.21f * surface.sky);
    return surface.albedo * light;
}

Paint painted(Colour light, float fourth) {
    constexpr int steps = 4096; // of the square root, which the curve is nearly even over
    static const std::vector<float> codes = [] {
        std::vector<float> table(steps + 1);
        for (int i = 0; i <= steps; ++i)
            table[i] = static_cast<float>(shading::srgb_encode(std::pow(static_cast<double>(i) / steps, 2)));
        return table;
    }();
    const auto code = [](float linear) {
        const float root = std::sqrt(std::clamp(linear / full_scale, 0.0f, 1.0f));
        return codes[static_cast<int>(root * steps + 0.5f)];
    };
    return {code(light.x), code(light.y), code(light.z), fourth};
}

// ---- the marker's sheet: A5, the marker in its upper half

constexpr Point sheet_half{74, 105}, sheet_at{0, -23};

Print sheet_print(const MarkerSheet &sheet) {
    Print print(2 * sheet_half.x, 2 * sheet_half.y, 8);
    const auto number = [](double value) {
        std::array<char, 32> text;
        std::snprintf(text.data(), text.size(), "%.4g", value);
        return std::string(text.data());
    };
    print.text(sheet.family + "  " + std::to_string(sheet.id), 14, 20, 4.4, 0.5);
    print.text("arhost", 114, 20, 3.4, 0.4);
    print.line(14, 25, 134, 25, 0.3);
    print.text("side " + number(sheet.side_mm) + " mm", 14, 31.5, 2.0);
    print.text("1 / 1", 128, 31.5, 2.0);

    // A ruler, to check the printer's scale with: ten parts of an eighth of the marker's side.
    const double left = 24, top = 140, unit = sheet.side_mm / drawn_side;
    print.line(left, top, left + 100, top, 0.25);
    for (int mm = 0; mm <= 100; ++mm)
        print.line(left + mm, top, left + mm,
                   top + (mm % 10 == 0  ? 5.0
                          : mm % 5 == 0 ? 3.6
                                        : 2.2),
                   mm % 10 ? 0.12 : 0.25);
    for (int cm = 0; cm <= 10; ++cm)
        print.text(number(10 * cm * unit), left + 10 * cm, top + 9, 2.0, 0.26, true);
    print.text("mm", left + 108, top + 9, 2.0);

    const char *const lines[] = {"Print at 100 %, without \"fit to page\".", "The ruler must measure true.",
                                 "Lay the sheet flat, with its white margin in view,",
                                 "in even light and without glare."};
    double y = 164;
    for (const char *line : lines)
        print.text(line, 24, y, 2.1), y += 5.2;
    // Grey steps.
    for (int step = 0; step < 8; ++step)
        print.bar(24 + 8 * step, 188, 31 + 8 * step, 194, 255 - 32 * step);
    print.text("page 1", 74, 203, 1.7, 0.24, true);
    return print;
}

// The share of a texel that is printed black; cells are exact squares.
float marker_ink(const cv::Mat_<uint8_t> &cells, Point p, float texel) {
    const float cell = drawn_side / static_cast<float>(cells.cols), half = drawn_side / 2;
    if (std::max(std::abs(p.x), std::abs(p.y)) > half + texel)
        return 0;
    // The texel's box meets two cells at most each way.
    const auto split = [&](float middle) {
        const float low = (middle - texel / 2) / cell, high = (middle + texel / 2) / cell;
        const std::int32_t first = floor_of(low), last = floor_of(high);
        const float share = first == last ? 1 : (static_cast<float>(last) - low) / (high - low);
        return std::tuple(first, last, share);
    };
    const auto [left, right, left_share] = split(p.x + half);
    const auto [top, bottom, top_share] = split(half - p.y);
    const auto black = [&](std::int32_t row, std::int32_t column) {
        const bool inside = row >= 0 && column >= 0 && row < cells.rows && column < cells.cols;
        return inside && !cells(row, column) ? 1.0f : 0.0f;
    };
    return mix(mix(black(bottom, right), black(bottom, left), left_share),
               mix(black(top, right), black(top, left), left_share), top_share);
}

Surface paper(Colour white, Point p, const Noise &noise, float texel) {
    Surface surface{white, 0.03f};
    const float fibres = texel < 0.8f ? noise(p.x / 0.5f, p.y / 0.5f) : 0;
    surface.albedo = surface.albedo * (1 + 0.008f * fibres + 0.008f * noise(p.x / 5, p.y / 5));
    return surface;
}

Item marker_sheet(const MarkerSheet &sheet, const std::shared_ptr<const Noise> &noise) {
    auto print = std::make_shared<const Print>(sheet_print(sheet));
    const Placement place(sheet_at, 0);
    const auto distance = [](Point p) { return box(p, sheet_half, 0.3f); };
    const auto draw = [=, cells = sheet.cells](Point p, float texel, Surface &surface) {
        // The lower right corner stands up a little, so its shadow is wider.
        const Point local = place.local(p);
        const float corner = length(local - Point{sheet_half.x, -sheet_half.y});
        const float lift = 9 * smoothstep(110, 0, corner);
        cast_shadow(p, 1.1f + lift, place, distance, surface);
        const float d = distance(local), share = coverage(d, texel);
        if (share == 0)
            return false;
        static const Colour white = srgb(241, 239, 233), ink = srgb(40, 39, 40);
        Surface top = paper(white, p, *noise, texel);
        const Point at{local.x + sheet_half.x, sheet_half.y - local.y};
        const float text = 0.93f * (*print)(at.x, at.y, texel), black = marker_ink(cells, p, texel);
        const float toner = 1 + 0.10f * (*noise)(p.x / 1.3f, p.y / 1.3f) + 0.06f * (*noise)(p.x / 17, p.y / 9);
        top.albedo = mix(top.albedo, ink * toner, std::max(text, black));
        top.gloss = mix(top.gloss, 0.22f, black);
        // Not quite flat: a fold across the middle, a wave, and the slope of the corner.
        const float fold = local.y - 14;
        top.window *= 1 + 0.028f * std::clamp(fold / 4, -1.0f, 1.0f) * smoothstep(46, 0, std::abs(fold));
        top.window *= 1 + 0.020f * (*noise)(p.x / 70 + 3, p.y / 90) - 0.13f * smoothstep(80, 8, corner) +
                      0.05f * smoothstep(30, 0, corner);
        top.window *= 1 + 0.05f * smoothstep(-0.6f, 0, d); // the cut edge
        surface = mix(surface, top, share);
        return true;
    };
    return {Bounds::about(sheet_at, length(sheet_half) + 20), draw};
}

// ---- what else lies about

Print notes_print(const Noise &noise) {
    Print print(210, 297, 5);
    print.text("Registration error over distance", 24, 34, 4.2, 0.5);
    const char *const paragraph[] = {"The camera was moved along a rail in steps of 50 mm, from",
                                     "300 mm to 1200 mm, and at each stop the corners of the marker",
                                     "were found in 200 frames. The figure shows the mean of the",
                                     "distance between the true and the estimated position, and",
                                     "its spread. Up to 800 mm it stays below one millimetre."};
    double y = 46;
    for (const char *line : paragraph)
        print.text(line, 24, y, 2.5, 0.3), y += 6;
    const double left = 34, bottom = 168, top = 88, right = 184;
    print.line(left, bottom, right, bottom, 0.4);
    print.line(left, bottom, left, top, 0.4);
    for (int i = 0; i <= 6; ++i) {
        const double x = left + (right - left) * i / 6, tick = bottom - (bottom - top) * i / 6;
        print.line(x, bottom, x, bottom + 2, 0.3);
        print.line(left - 2, tick, left, tick, 0.3);
        print.text(std::to_string(300 + 150 * i), x, bottom + 7, 2.2, 0.26, true);
    }
    for (int i = 0; i < 40; ++i) {
        const auto curve = [&](int n, double rise, float row) {
            return bottom - 6 - rise * n * n / 1600.0 - 2.2 * (noise(static_cast<float>(n) / 2, row) + 1);
        };
        const double x = left + 3 + 3.6 * i;
        print.line(x, curve(i, 62, 1), x + 3.6, curve(i + 1, 62, 1), 0.6);
        print.line(x, curve(i, 36, 9), x + 3.6, curve(i + 1, 36, 9), 0.3);
    }
    print.text("Figure 4. Distance of the camera (mm).", 109, 184, 2.5, 0.3, true);
    const char *const more[] = {"Beyond that the corners move by less than a tenth of a pixel",
                                "for a millimetre, so that noise decides. Two remedies were",
                                "tried: a longer exposure, which blurs the moving camera's",
                                "frames, and a larger print, which helps in proportion.",
                                "",
                                "The second column of the table repeats the measurement with",
                                "the lens stopped down. The corners are sharper, the light is",
                                "less, and the error remains within what the first one had."};
    y = 200;
    for (const char *line : more)
        print.text(line, 24, y, 2.5, 0.3), y += 6;
    return print;
}

void add_notes(std::vector<Item> &items, const std::shared_ptr<const Noise> &noise) {
    auto print = std::make_shared<const Print>(notes_print(*noise));
    const Point half{105, 148.5f};
    items.push_back(lay(
        Placement({172, 92}, -13), 185, 1.0f, [=](Point p) { return box(p, half, 0.3f); },
        [=](Point p, float, float texel) {
            static const Colour white = srgb(233, 231, 226), ink = srgb(52, 51, 53);
            Surface top = paper(white, p, *noise, texel);
            top.albedo = mix(top.albedo, ink, 0.85f * (*print)(p.x + half.x, half.y - p.y, texel));
            top.window *= 1 + 0.03f * (*noise)(p.x / 90 + 40, p.y / 120);
            return top;
        }));
    // A cup stood there: a ring, darker at its rims, open where the cup stood dry.
    const Point ring{168, -24};
    items.push_back({Bounds::about(ring, 52), [=](Point p, float, Surface &surface) {
                         static const Colour coffee = srgb(150, 104, 62);
                         const Point d = p - ring;
                         const float r = length(d) + 0.9f * (*noise)(d.x / 9 + 70, d.y / 9);
                         const float wet = smoothstep(-0.5f, 0.3f, (*noise)(d.x / 30 + 20, d.y / 30) + 0.25f);
                         const float rims = smoothstep(1.1f, 0.2f, std::abs(r - 40.3f)) +
                                            0.7f * smoothstep(0.9f, 0.2f, std::abs(r - 37.2f));
                         const float film = smoothstep(36.6f, 37.4f, r) * smoothstep(41, 40.2f, r);
                         const float amount = std::min(1.0f, wet * (0.62f * rims + 0.42f * film));
                         surface.albedo = surface.albedo * mix(Colour{1, 1, 1}, coffee, amount);
                         return amount > 0;
                     }});
}

void add_notebook(std::vector<Item> &items, const std::shared_ptr<const Noise> &noise) {
    const Point half{70, 105};
    items.push_back(lay(
        Placement({-186, 34}, 11), 130, 11, [=](Point p) { return box(p, half, 5); },
        [=](Point p, float d, float texel) {
            static const Colour cloth = srgb(34, 62, 84), band = srgb(24, 25, 28), label = srgb(214, 202, 176);
            Surface top{cloth, 0.12f, 1, 1};
            const float weave =
                texel < 0.6f ? (*noise)(p.x / 0.45f, p.y / 0.9f) + (*noise)(p.x / 0.9f, p.y / 0.45f) : 0;
            top.albedo = top.albedo * (1 + 0.16f * weave + 0.10f * (*noise)(p.x / 40, p.y / 40));
            // The board's eased edge, light on the side of the window.
            top.window *= 1 + 0.5f * smoothstep(-2.2f, 0, d) * (p.x < 0 || p.y > 0 ? 1.0f : -0.9f);
            top.window *= 1 - 0.25f * smoothstep(1.1f, 0.2f, std::abs(p.x + 57)); // the groove of the hinge
            const float tag = box({p.x - 6, p.y - 42}, {34, 19}, 2);
            Surface paper_label{label * (1 + 0.02f * (*noise)(p.x / 2, p.y / 2)), 0.05f};
            const float rule = std::min(std::abs(p.y - 44), std::abs(p.y - 34));
            const float frame = std::abs(tag + 2.4f);
            paper_label.albedo = mix(paper_label.albedo, cloth,
                                     0.8f * coverage(std::min(rule - 0.15f, frame - 0.25f), texel) *
                                         (std::abs(p.x - 6) < 32 ? 1.0f : 0.0f));
            top = mix(top, paper_label, coverage(tag, texel));
            Surface elastic{band * (1 + 0.25f * (*noise)(p.x / 0.6f, p.y / 2.5f)), 0.15f};
            const float strap = std::abs(p.x - 55) - 3.2f;
            top.window *= 1 - 0.55f * smoothstep(2.4f, 0, strap) * (p.x > 55 ? 1.0f : 0.4f);
            return mix(top, elastic, coverage(strap, texel));
        }));
}

// The distance from a pen's strokes, which go up and down in loops; four lines of words about the origin.
float handwriting(Point p, const Noise &noise) {
    float nearest = 1e3f;
    for (int line = 0; line < 4; ++line) {
        const auto key = static_cast<float>(11 * line);
        const float base = 17 - 12 * static_cast<float>(line), end = line == 3 ? -4.0f : 24 + 5 * noise(3.5f, key);
        if (p.y < base - 5 || p.y > base + 8 || p.x < -33 || p.x > end + 3)
            continue;
        // The pen at the time t, which is also about where it is.
        const auto pen_at = [&](float t) {
            const float tall = 1.5f + 2.6f * smoothstep(0.25f, 0.8f, noise(t / 1.9f, key)) - // an ascender
                               0.5f * noise(t / 0.8f, key + 3);
            const float low = 2.8f * smoothstep(0.45f, 0.9f, noise(t / 2.1f + 90, key + 5)); // a descender
            const float swing = std::sin(3.6f * t + noise(t / 1.3f, key + 7));
            return Point{t + 0.55f * std::cos(3.6f * t) + 0.22f * swing,
                         base + 0.04f * t + 0.8f + (swing > 0 ? tall : 0.8f + low) * swing};
        };
        constexpr float step = 0.14f;
        const float first = std::floor((p.x - 1.6f) / step) * step;
        Point before = pen_at(first);
        for (float t = first + step; t < p.x + 1.6f; t += step) {
            const Point at = pen_at(t);
            const bool between_words = noise(t / 6.5f + 40, key + 9) > 0.42f;
            if (!between_words && t > -31 && t < end)
                nearest = std::min(nearest, segment(p, before, at));
            before = at;
        }
    }
    return nearest;
}

void add_sticky_note(std::vector<Item> &items, const std::shared_ptr<const Noise> &noise) {
    items.push_back(lay(
        Placement({-128, -168}, -7), 60, 1.2f,
        [](Point p) {
            return box(p, {38, 38}, 0.3f);
        },
        [=](Point p, float, float texel) {
            static const Colour yellow = srgb(246, 219, 104), pen = srgb(32, 44, 110);
            Surface top = paper(yellow, p, *noise, texel);
            // Bent up towards its lower edge, stuck along the upper one.
            top.window *= 1 + 0.03f * smoothstep(10, 38, p.y) - 0.16f * smoothstep(-4, -38, p.y);
            const float stroke = handwriting(p, *noise);
            top.albedo = mix(top.albedo, pen, 0.85f * coverage(stroke - 0.32f, std::max(texel, 0.3f)));
            return top;
        }));
}

void add_pencil(std::vector<Item> &items, const std::shared_ptr<const Noise> &noise) {
    constexpr float tip = -82, cone_end = -62, end = 82, half_width = 3.7f;
    const Placement place({141, -132}, 38);
    const Point flat_light = place.turned({towards_window.x, towards_window.y});
    const auto width_at = [=](float x) {
        return half_width * std::clamp((x - tip + 0.8f) / (cone_end - tip), 0.0f, 1.0f);
    };
    items.push_back(lay(
        place, 84, 5,
        [=](Point p) {
            return std::max({(std::abs(p.y) - width_at(p.x)), p.x - end, tip - p.x});
        },
        [=](Point p, float, float texel) {
            static const Colour lacquer = srgb(22, 84, 62), gold = srgb(190, 160, 92), cedar = srgb(206, 158, 112);
            static const Colour graphite = srgb(54, 54, 58), cap = srgb(20, 20, 22);
            const float t = std::clamp(p.y / std::max(width_at(p.x), 0.1f), -1.0f, 1.0f);
            const bool is_cone = p.x < cone_end + 1.6f * std::cos(t * 5.5f);
            // Of a hexagon three sides are seen; the cone is round.
            const float slope = is_cone ? t : (t < -0.5f ? -0.86f : t > 0.5f ? 0.86f : 0.0f) * 0.9f + 0.1f * t;
            const float up = std::sqrt(std::max(0.05f, 1 - slope * slope));
            Surface top;
            top.albedo = p.x < tip + 6.5f   ? graphite
                         : is_cone          ? cedar * (1 + 0.08f * (*noise)(p.x / 6, p.y / 0.4f))
                         : p.x > end - 5    ? cap
                         : p.x > end - 7.5f ? gold
                                            : lacquer;
            if (!is_cone && std::abs(p.y) < 0.8f && p.x > 30 && p.x < 66) // stamped letters
                top.albedo =
                    mix(top.albedo, gold, 0.8f * smoothstep(0.1f, 0.3f, (*noise)(p.x / 0.7f, p.y / 0.5f + 60)));
            top.window = std::max(0.05f, (flat_light.y * slope + towards_window.z * up) / towards_window.z);
            top.sky = 0.55f + 0.45f * up;
            // The lacquer mirrors the window along an edge.
            const float shine =
                is_cone ? 0
                        : smoothstep(0.12f, 0.0f, std::abs(t - (flat_light.y > 0 ? 0.56f : -0.56f)) - texel * 0.05f);
            top.albedo = top.albedo + Colour{1, 1, 1} * (0.35f * shine);
            top.gloss = is_cone ? 0.05f : 0.5f;
            return top;
        }));
}

void add_eraser(std::vector<Item> &items, const std::shared_ptr<const Noise> &noise) {
    items.push_back(lay(
        Placement({116, -176}, -24), 32, 9,
        [](Point p) {
            return box(p, {23, 10}, 2.5f);
        },
        [=](Point p, float d, float) {
            static const Colour rubber = srgb(226, 222, 214), sleeve = srgb(44, 84, 152),
                                stripe = srgb(228, 228, 226);
            Surface top{rubber, 0.05f};
            if (p.x > -12) {
                top.albedo = p.x > 2 && p.x < 10 ? stripe : sleeve;
                top.gloss = 0.2f;
            } else { // worn and smudged
                top.albedo = top.albedo * (1 - 0.35f * smoothstep(-0.1f, 0.7f, (*noise)(p.x / 5 + 30, p.y / 5)) *
                                                   smoothstep(-14, -22, p.x));
            }
            top.window *= 1 + 0.25f * smoothstep(-2.5f, 0, d) * (p.y > 0 ? 1.0f : -1.6f);
            return top;
        }));
}

// A bent wire of round section along a line of points.
Item wire(std::vector<Point> points, float radius, Colour colour, float shine) {
    const float reach = 9 * radius;  // of the shadow
    constexpr std::size_t piece = 8; // points whose bounds are asked at once
    std::vector<Bounds> pieces;
    for (std::size_t i = 0; i + 1 < points.size(); i += piece) {
        Bounds bounds = Bounds::about(points[i], reach);
        for (std::size_t j = i + 1; j <= std::min(i + piece, points.size() - 1); ++j)
            bounds = bounds.with(Bounds::about(points[j], reach));
        pieces.push_back(bounds);
    }
    Bounds whole = pieces[0];
    for (const Bounds &bounds : pieces)
        whole = whole.with(bounds);
    struct Nearest {
        float distance;
        Point away; // from the wire's middle line, of length 1
    };
    const auto nearest = [points = std::move(points), pieces = std::move(pieces)](Point p) {
        Nearest best{1e6f, {}};
        for (std::size_t k = 0; k < pieces.size(); ++k) {
            if (!pieces[k].contain(p))
                continue;
            for (std::size_t i = k * piece + 1; i <= std::min((k + 1) * piece, points.size() - 1); ++i) {
                const Point a = points[i - 1], along = points[i] - a;
                const float t = std::clamp(dot(p - a, along) / dot(along, along), 0.0f, 1.0f);
                const Point off = p - a - along * t;
                if (const float d = length(off); d < best.distance)
                    best = {d, off * (1 / std::max(d, 1e-6f))};
            }
        }
        return best;
    };
    return {whole, [=](Point p, float texel, Surface &surface) {
                const Nearest at = nearest(p);
                if (at.distance > reach)
                    return false;
                const Placement here({0, 0}, 0);
                cast_shadow(
                    p, 2 * radius, here, [&](Point q) { return nearest(q).distance - radius; }, surface);
                const float share = coverage(at.distance - radius, texel);
                if (share == 0)
                    return false;
                const float slope = std::min(at.distance / radius, 1.0f),
                            up = std::sqrt(std::max(0.02f, 1 - slope * slope));
                const Vec3 normal{at.away.x * slope, at.away.y * slope, up};
                Surface top{colour, 0.1f, slope_light(normal), 0.5f + 0.5f * up};
                const float mirror = smoothstep(0.86f, 1.0f, dot(normal, Vec3{-0.30f, 0.33f, 0.895f}));
                top.albedo = top.albedo + Colour{1, 1, 1} * (shine * mirror);
                surface = mix(surface, top, share);
                return true;
            }};
}

// A cubic Bézier curve, `count` points of it added.
void curve(std::vector<Point> &points, Point a, Point b, Point c, Point d, int count) {
    for (int i = points.empty() ? 0 : 1; i <= count; ++i) {
        const float t = static_cast<float>(i) / static_cast<float>(count), u = 1 - t;
        points.push_back(a * (u * u * u) + b * (3 * u * u * t) + c * (3 * u * t * t) + d * (t * t * t));
    }
}

void add_wires(std::vector<Item> &items) {
    std::vector<Point> cable;
    curve(cable, {-560, 420}, {-300, 470}, {-260, 215}, {-70, 205}, 24);
    curve(cable, {-70, 205}, {60, 198}, {20, 330}, {130, 345}, 16);
    curve(cable, {130, 345}, {300, 365}, {330, 250}, {640, 330}, 16);
    items.push_back(wire(std::move(cable), 1.9f, srgb(46, 46, 49), 0.25f));

    for (const Placement &place : {Placement({-92, 112}, 62), Placement({-70, 138}, -20)}) {
        // A paper clip of 0.9 mm wire, in its own axes.
        std::vector<Point> clip;
        const auto arc = [&](Point middle, float r, float from, float to) {
            for (int i = 0; i <= 8; ++i) {
                const float angle = from + (to - from) * static_cast<float>(i) / 8;
                clip.push_back(middle + Point{std::cos(angle), std::sin(angle)} * r);
            }
        };
        constexpr float quarter = 1.5707963f;
        clip.push_back({-6, 3.2f});
        arc({11, 0}, 3.2f, quarter, -quarter);
        arc({-9, 0.6f}, 3.8f, -quarter, -3 * quarter);
        arc({8, 0.9f}, 3.5f, quarter, -quarter);
        clip.push_back({-4, -2.6f});
        const Point x = place.turned({1, 0}), y = place.turned({0, 1}); // transposed: turns the other way
        for (Point &p : clip)
            p = place.at() + Point{dot(p, x), dot(p, y)};
        items.push_back(wire(std::move(clip), 0.5f, srgb(150, 152, 156), 0.9f));
    }
}

} // namespace

PaintRow paint_desk(const MarkerSheet &sheet, std::uint64_t seed) {
    struct Scene {
        Wood wood;
        std::shared_ptr<const Noise> noise;
        std::vector<Item> items;
    };
    auto noise = std::make_shared<const Noise>(hashed(seed + 1));
    auto scene = std::make_shared<Scene>(Scene{Wood(hashed(seed + 2)), noise, {}});
    add_notes(scene->items, noise);
    add_notebook(scene->items, noise);
    add_wires(scene->items);
    scene->items.push_back(marker_sheet(sheet, noise));
    add_sticky_note(scene->items, noise);
    add_eraser(scene->items, noise);
    add_pencil(scene->items, noise);

    return [scene](float x, float y, float texel, std::span<Paint> row) {
        std::vector<const Item *> active;
        for (const Item &item : scene->items)
            if (y > item.bounds.low.y && y < item.bounds.high.y)
                active.push_back(&item);
        bool on_thing = false;
        const auto look = [&](Point p, float size) {
            Surface surface = scene->wood.at(p, size);
            on_thing = false;
            for (const Item *item : active)
                if (item->bounds.contain(p))
                    on_thing |= item->draw(p, size, surface);
            return painted(radiance(surface, window_light(p, *scene->noise)), surface.gloss);
        };
        for (std::size_t i = 0; i < row.size(); ++i) {
            const Point p{x + static_cast<float>(i) * texel, y};
            row[i] = look(p, texel);
            if (texel < 0.3f || !on_thing)
                continue;
            row[i] = {}; // coarse texels of fine things: the mean of four
            for (const Point off : {Point{-1, -1}, Point{1, -1}, Point{-1, 1}, Point{1, 1}}) {
                const Paint part = look(p + off * (texel / 4), texel / 2);
                for (int c = 0; c < 4; ++c)
                    row[i][c] += part[c] / 4;
            }
        }
    };
}

PaintRow paint_card(std::uint64_t seed) {
    auto noise = std::make_shared<const Noise>(hashed(seed + 3));
    // A postcard: hills in haze, one behind the other, in a white frame.
    return [noise](float x, float y, float texel, std::span<Paint> row) {
        static const Colour white = srgb(240, 237, 230), high = srgb(92, 142, 190), low = srgb(240, 206, 168);
        static const Colour near_hill = srgb(24, 52, 58), far_hill = srgb(150, 170, 186);
        for (std::size_t i = 0; i < row.size(); ++i) {
            const Point p{x + static_cast<float>(i) * texel, y};
            const Placement place({0, 0}, 0);
            const auto distance = [](Point q) { return box(q, card_half, 2); };
            Surface shade{{}, 0, 1, 1};
            cast_shadow(p, 2.2f, place, distance, shade);
            const float share = coverage(distance(p), texel);
            Surface top = paper(white, p, *noise, texel);
            Colour picture = mix(low, high, smoothstep(-12, 48, p.y));
            const float sun = length(p - Point{26, 8});
            picture = mix(picture, srgb(255, 236, 200), smoothstep(17, 5, sun));
            for (int hill = 0; hill < 5; ++hill) {
                const float n = static_cast<float>(hill), wide = 34 - 4 * n;
                const float crest = 10 - 13 * n + 11 * (*noise)(p.x / wide + 13 * n, n) +
                                    3 * (*noise)(p.x / 6 + 5 * n, 9 + n) +
                                    (0.4f + 0.25f * n) * (*noise)(p.x / 1.2f, 20 + n);
                const Colour tone = mix(far_hill, near_hill, 0.1f + 0.22f * n);
                picture = mix(picture, mix(tone, low, 0.25f * smoothstep(4, 26, crest - p.y)),
                              coverage(p.y - crest, texel));
            }
            top.albedo = mix(top.albedo, picture, coverage(box(p, card_half - Point{5, 5}), texel));
            const Paint paint = painted(radiance(top, window_light(p, *noise)), 1);
            const float dark = 1 - std::sqrt(0.75f * shade.window + 0.25f * shade.sky);
            row[i] = {paint[0] * share, paint[1] * share, paint[2] * share, mix(dark, 1, share)};
        }
    };
}

float mirrored_light(Point at, Vec3 view) {
    const float cosine = std::max(-view.z, 0.0f), grazing = 1 - cosine;
    const float fresnel = 0.04f + 0.96f * grazing * grazing * grazing * grazing * grazing; // Schlick, n = 1.5
    const Point out{view.x, view.y}; // mirrored at the level board: z alone is turned
    float light = 0.28f;             // of the room
    if (const float approach = dot(out, into_window); approach > 1e-3f) {
        const float s = dot(window_at - at, into_window) / approach; // way to the window's plane
        const float side = dot(at + out * s - window_at, along_window), height = -view.z * s;
        const float blur = 25 + 0.055f * s; // of the varnish, which is not a perfect mirror
        const auto between = [&](float x, float low, float high) {
            return smoothstep(low - blur, low + blur, x) * smoothstep(high + blur, high - blur, x);
        };
        const float frame = 38;
        const float panes = between(side, -window_half, -frame) + between(side, frame, window_half);
        const float crossbar = 1 - between(height, 840 - frame, 840 + frame);
        light += 4.6f * panes * between(height, window_bottom, window_top) * crossbar;
    }
    return fresnel * light;
}

} // namespace arhost::synthetic
