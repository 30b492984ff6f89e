// SPDX-License-Identifier: Apache-2.0
//
// Draws text and lines over the picture, in pixel coordinates of the window with the origin at the top left.
#pragma once

#include "picture.hpp"

#include <string>
#include <vector>

namespace sink_window {

struct Colour {
    std::uint8_t red, green, blue;
};
inline constexpr Colour white{255, 255, 255}, grey{170, 170, 170}, red{255, 96, 80}, green{90, 230, 110},
    blue{90, 160, 255}, yellow{255, 210, 60}, pink{255, 120, 220};

// A line of text. Boxes align the texts of their rows, after the longest label.
struct Row {
    std::string label, text;
    Colour colour = white; // of `text`
};

class Overlay {
public:
    explicit Overlay(const Rectangle &window);
    ~Overlay();
    Overlay(const Overlay &) = delete;
    Overlay &operator=(const Overlay &) = delete;

    double text_height() const; // of one line, px
    // Draws a line that is visible on every background.
    void line(Point from, Point to, Colour colour) const;
    // Draws text in a dark box. `x`, `y`: where in the free space, from 0 (left, top) to 1 (right, bottom). `top`,
    // `bottom`: height of the space at the edges that is not free, px. Uses smaller text if the box would not fit
    // into the window. Returns the height of the box and its margin in px.
    double box(const std::vector<Row> &rows, double x, double y, double top = 0, double bottom = 0) const;
    // Draws text in a dark box around a point.
    void label(Point centre, const std::string &text, Colour colour) const;
    // Draws a dark bar with text at its left and right end along the bottom of the window; returns its height in px.
    double bar(const std::string &left, const std::string &right) const;
    // Splits a message into rows that are not wider than the window.
    std::vector<Row> wrap(const std::string &text, Colour colour) const;

private:
    void rectangle(double x, double y, double width, double height) const;
    void text(double x, double y, int scale, const std::string &text, Colour colour) const;

    double width_, height_;
    int scale_; // px of the window per px of the font
};

} // namespace sink_window
