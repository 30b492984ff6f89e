// SPDX-License-Identifier: Apache-2.0
#include "sink_common/canvas.hpp"

#include <stb/stb_easy_font.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

namespace arhost::drawing {
namespace {

// Sizes in font px.
constexpr int line_height = 12, padding = 5, margin = 4, label_gap = 8;
constexpr int baseline_offset = 2; // centres letters, which are up to 9 px high, in their line

// Replaces characters that the font lacks.
std::string printable(std::string text) {
    std::ranges::replace_if(
        text, [](char c) { return c < ' ' || c > '~'; }, '?');
    return text;
}

int width_of(const std::string &text) {
    std::string copy = printable(text);
    return stb_easy_font_width(copy.data());
}

// The border of a half-plane: ax + by + c is the distance of a point, positive inside.
struct Edge {
    double a, b, c;
    double covers(double x, double y) const { return std::clamp(a * x + b * y + c + 0.5, 0.0, 1.0); }
};

} // namespace

Canvas::Canvas(double width, double height, double scale)
    : width_(width), height_(height), scale_(std::max(1, static_cast<int>(std::lround(scale)))) {}

double Canvas::text_height() const {
    return line_height * scale_;
}

void Canvas::stroke(Point from, Point to, double width, Colour colour, std::uint8_t alpha) const {
    const double length = std::hypot(to.x - from.x, to.y - from.y);
    if (!(length > 0))
        return;
    const double x = (to.x - from.x) / length * width / 2, y = (to.y - from.y) / length * width / 2;
    from = {from.x - x, from.y - y};
    to = {to.x + x, to.y + y};
    fill(
        std::array<Point, 4>{
            {{from.x - y, from.y + x}, {from.x + y, from.y - x}, {to.x + y, to.y - x}, {to.x - y, to.y + x}}},
        colour, alpha);
}

void Canvas::line(Point from, Point to, Colour colour) const {
    stroke(from, to, scale_ + 2, {0, 0, 0}, 140);
    stroke(from, to, scale_, colour, 255);
}

void Canvas::dashed_line(Point from, Point to, Colour colour) const {
    const double length = std::hypot(to.x - from.x, to.y - from.y), dash = 4 * scale_;
    // Uses an odd number of equal parts, so that the line begins and ends with a dash.
    const int parts = 2 * static_cast<int>(std::clamp(length / dash / 2, 0.0, 1e4)) + 1;
    const auto part = [&](double i) {
        return Point{from.x + i / parts * (to.x - from.x), from.y + i / parts * (to.y - from.y)};
    };
    for (int i = 0; i < parts; i += 2)
        stroke(part(i), part(i + 1), std::max(1.0, scale_ / 2.0), colour, 255);
}

void Canvas::rectangle(double x, double y, double width, double height) const {
    fill(std::array<Point, 4>{{{x, y}, {x + width, y}, {x + width, y + height}, {x, y + height}}}, {12, 14, 20}, 190);
}

void Canvas::text(double x, double y, int scale, const std::string &text, Colour colour) const {
    struct Vertex {
        float x, y, z;
        std::uint32_t colour;
    };
    std::string copy = printable(text);
    std::vector<Vertex> vertices(20 * (copy.size() + 1)); // the font needs about 17 per character
    const int quads = stb_easy_font_print(0, 0, copy.data(), nullptr, vertices.data(),
                                          static_cast<int>(vertices.size() * sizeof(Vertex)));
    std::vector<Point> corners;
    for (const Vertex &vertex : std::span(vertices).first(std::size_t{4} * static_cast<std::size_t>(quads)))
        corners.push_back({std::round(x) + scale * vertex.x, std::round(y) + scale * (vertex.y + baseline_offset)});
    fill(corners, colour, 255);
}

double Canvas::box(const std::vector<Row> &rows, double x, double y, double top, double bottom) const {
    int labels = 0, texts = 0;
    for (const Row &row : rows) {
        labels = std::max(labels, width_of(row.label));
        texts = std::max(texts, width_of(row.text));
    }
    if (labels > 0)
        labels += label_gap;
    const int columns = labels + texts + 2 * padding,
              lines = static_cast<int>(rows.size()) * line_height + 2 * padding;
    const double free_height = height_ - top - bottom;
    int scale = scale_;
    while (scale > 1 && ((columns + 2 * margin) * scale > width_ || (lines + 2 * margin) * scale > free_height))
        --scale;
    const double gap = margin * scale, width = columns * scale, height = lines * scale;
    const double left = std::round(gap + x * std::max(0.0, width_ - width - 2 * gap)),
                 upper = std::round(top + gap + y * std::max(0.0, free_height - height - 2 * gap));
    rectangle(left, upper, width, height);
    double line = upper + padding * scale;
    for (const Row &row : rows) {
        text(left + padding * scale, line, scale, row.label, yellow);
        text(left + (padding + labels) * scale, line, scale, row.text, row.colour);
        line += line_height * scale;
    }
    return height + gap;
}

void Canvas::label(Point centre, const std::string &content, Colour colour) const {
    const double width = (width_of(content) + 4) * scale_, height = line_height * scale_;
    const double left = std::round(centre.x - width / 2), top = std::round(centre.y - height / 2);
    rectangle(left, top, width, height);
    text(left + 2 * scale_, top, scale_, content, colour);
}

double Canvas::bar(const std::string &left, const std::string &right) const {
    const int columns = width_of(left) + width_of(right) + 4 * padding;
    int scale = scale_;
    while (scale > 1 && columns * scale > width_)
        --scale;
    const double height = (line_height + 4) * scale, line = height_ - height + 2 * scale;
    rectangle(0, height_ - height, width_, height);
    text(padding * scale, line, scale, left, white);
    if (columns * scale <= width_)
        text(width_ - (width_of(right) + padding) * scale, line, scale, right, grey);
    return height;
}

std::vector<Row> Canvas::wrap(const std::string &content, Colour colour) const {
    const double limit = width_ / scale_ - 2 * (padding + margin);
    std::vector<Row> rows;
    std::istringstream words(content);
    for (std::string word; words >> word;)
        if (rows.empty() || width_of(rows.back().text + " " + word) > limit)
            rows.push_back({"", word, colour});
        else
            rows.back().text += " " + word;
    return rows;
}

void PictureCanvas::fill(std::span<const Point> corners, Colour colour, std::uint8_t alpha) const {
    const std::uint8_t bgr[3] = {colour.blue, colour.green, colour.red};
    for (; corners.size() >= 4; corners = corners.subspan(4)) {
        const auto is_near = [](const Point &p) { return std::abs(p.x) < 1e6 && std::abs(p.y) < 1e6; };
        if (!std::ranges::all_of(corners.first(4), is_near)) // also false for NaN
            continue;
        double twice_area = 0, top = height_, bottom = 0;
        for (std::size_t i = 0; i < 4; ++i) {
            const Point p = corners[i], q = corners[(i + 1) % 4];
            twice_area += p.x * q.y - p.y * q.x;
            top = std::min(top, p.y);
            bottom = std::max(bottom, p.y);
        }
        Edge edges[4];
        for (std::size_t i = 0; i < 4; ++i) {
            const Point p = corners[i], q = corners[(i + 1) % 4];
            const double length = std::copysign(std::hypot(q.x - p.x, q.y - p.y), twice_area);
            edges[i] = {(p.y - q.y) / length, (q.x - p.x) / length, (p.x * q.y - p.y * q.x) / length};
            if (length == 0)
                edges[i] = {0, 0, 1};
        }
        const int end_y = static_cast<int>(std::clamp(std::ceil(bottom + 0.5), 0.0, double(height_)));
        for (int y = static_cast<int>(std::clamp(std::floor(top - 0.5), 0.0, double(height_))); y < end_y; ++y) {
            // Finds the pixels of the row whose centres are at most half a pixel outside of any edge.
            double begin = 0, end = width_;
            for (const Edge &edge : edges) {
                const double rest = edge.b * (y + 0.5) + edge.c + 0.5;
                if (edge.a > 0)
                    begin = std::max(begin, std::ceil(-rest / edge.a - 0.5));
                else if (edge.a < 0)
                    end = std::min(end, std::floor(-rest / edge.a - 0.5) + 1);
            }
            if (end <= 0)
                continue;
            // An almost horizontal edge may place `begin` far outside the picture.
            for (int x = static_cast<int>(std::min(begin, end)); x < end; ++x) {
                const auto covers = [&](const Edge &edge) { return edge.covers(x + 0.5, y + 0.5); };
                const double opacity = alpha / 255.0 * std::max(0.0, covers(edges[0]) + covers(edges[2]) - 1) *
                                       std::max(0.0, covers(edges[1]) + covers(edges[3]) - 1);
                std::uint8_t *pixel = bgr_ + static_cast<std::size_t>(y) * stride_ + 3 * x;
                for (int channel = 0; channel < 3; ++channel)
                    pixel[channel] = static_cast<std::uint8_t>(
                        std::lround(pixel[channel] + opacity * (bgr[channel] - pixel[channel])));
            }
        }
    }
}

} // namespace arhost::drawing
