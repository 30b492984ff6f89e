// SPDX-License-Identifier: Apache-2.0
#include "overlay.hpp"

#include <stb/stb_easy_font.h>

#include <algorithm>
#include <cmath>
#include <sstream>

namespace sink_window {
namespace {

// Sizes in px of the font.
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

void quad(Point a, Point b, Point c, Point d) {
    glBegin(GL_QUADS);
    for (const Point &p : {a, b, c, d})
        glVertex2d(p.x, p.y);
    glEnd();
}

void stroke(Point from, Point to, double width) {
    const double length = std::hypot(to.x - from.x, to.y - from.y);
    if (!(length > 0))
        return;
    const double x = (to.x - from.x) / length * width / 2, y = (to.y - from.y) / length * width / 2;
    from = {from.x - x, from.y - y};
    to = {to.x + x, to.y + y};
    quad({from.x - y, from.y + x}, {from.x + y, from.y - x}, {to.x + y, to.y - x}, {to.x - y, to.y + x});
}

} // namespace

Overlay::Overlay(const Rectangle &window)
    : width_(window.width), height_(window.height),
      scale_(std::max(1, static_cast<int>(std::lround(std::min(width_ / 340, height_ / 255))))) {
    glViewport(0, 0, window.width, window.height);
    glPushMatrix();
    glOrtho(0, width_, height_, 0, -1, 1);
    glEnable(GL_BLEND);
    glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
}

Overlay::~Overlay() {
    glDisable(GL_BLEND);
    glPopMatrix();
}

double Overlay::text_height() const {
    return line_height * scale_;
}

void Overlay::line(Point from, Point to, Colour colour) const {
    glColor4ub(0, 0, 0, 140);
    stroke(from, to, scale_ + 2);
    glColor3ub(colour.red, colour.green, colour.blue);
    stroke(from, to, scale_);
}

void Overlay::rectangle(double x, double y, double width, double height) const {
    glColor4ub(12, 14, 20, 190);
    quad({x, y}, {x + width, y}, {x + width, y + height}, {x, y + height});
}

void Overlay::text(double x, double y, int scale, const std::string &text, Colour colour) const {
    std::string copy = printable(text);
    std::vector<float> vertices(80 * (copy.size() + 1)); // the font needs about 270 bytes per character
    const int quads = stb_easy_font_print(0, 0, copy.data(), nullptr, vertices.data(),
                                          static_cast<int>(vertices.size() * sizeof(float)));
    glColor3ub(colour.red, colour.green, colour.blue);
    glPushMatrix();
    glTranslated(std::round(x), std::round(y) + baseline_offset * scale, 0);
    glScaled(scale, scale, 1);
    glEnableClientState(GL_VERTEX_ARRAY);
    glVertexPointer(2, GL_FLOAT, 16, vertices.data());
    glDrawArrays(GL_QUADS, 0, 4 * quads);
    glDisableClientState(GL_VERTEX_ARRAY);
    glPopMatrix();
}

double Overlay::box(const std::vector<Row> &rows, double x, double y, double top, double bottom) const {
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

void Overlay::label(Point centre, const std::string &content, Colour colour) const {
    const double width = (width_of(content) + 4) * scale_, height = line_height * scale_;
    const double left = std::round(centre.x - width / 2), top = std::round(centre.y - height / 2);
    rectangle(left, top, width, height);
    text(left + 2 * scale_, top, scale_, content, colour);
}

double Overlay::bar(const std::string &left, const std::string &right) const {
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

std::vector<Row> Overlay::wrap(const std::string &content, Colour colour) const {
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

} // namespace sink_window
