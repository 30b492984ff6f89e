// SPDX-License-Identifier: Apache-2.0
//
// Draws text and lines over a frame, in pixels of the canvas with the origin at the top left corner.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace arhost::drawing {

struct Point {
    double x, y;
};

struct Colour {
    std::uint8_t red, green, blue;
};
inline constexpr Colour white{255, 255, 255}, grey{170, 170, 170}, red{255, 96, 80}, green{90, 230, 110},
    blue{90, 160, 255}, yellow{255, 210, 60}, pink{255, 120, 220}, cyan{70, 225, 255}, violet{205, 130, 255};

// A line of text. A box aligns the texts of its rows, to the right of the longest label.
struct Row {
    std::string label, text;
    Colour colour = white; // colour of `text`
};

class Canvas {
public:
    // `scale`: canvas px per font px, at least 1. Lines are `scale` px wide.
    Canvas(double width, double height, double scale);
    virtual ~Canvas() = default;
    Canvas(const Canvas &) = delete;
    Canvas &operator=(const Canvas &) = delete;

    // Converts pixel coordinates of the frame, whose pixel centres are at integers, to coordinates of the canvas.
    virtual Point at(Point pixel) const = 0;

    double text_height() const; // height of one line, px
    // Draws a line that is visible on every background.
    void line(Point from, Point to, Colour colour) const;
    void dashed_line(Point from, Point to, Colour colour) const; // thinner
    // Draws text in a dark box. Returns the height of the box plus its margin, in px. Uses smaller text if the box
    // would not fit on the canvas.
    // - `x`, `y`: position in the free area, from 0 (left, top) to 1 (right, bottom).
    // - `top`, `bottom`: heights of the occupied areas at the top and bottom edges, px.
    double box(const std::vector<Row> &rows, double x, double y, double top = 0, double bottom = 0) const;
    // Draws text in a dark box around a point.
    void label(Point centre, const std::string &text, Colour colour) const;
    // Draws a dark bar with text at its left and right end along the bottom of the canvas; returns its height in px.
    double bar(const std::string &left, const std::string &right) const;
    // Splits a message into rows that are not wider than the canvas.
    std::vector<Row> wrap(const std::string &text, Colour colour) const;

protected:
    // Fills convex quadrilaterals, each of which has four corners. `alpha`: 255 is opaque.
    virtual void fill(std::span<const Point> corners, Colour colour, std::uint8_t alpha) const = 0;

private:
    void stroke(Point from, Point to, double width, Colour colour, std::uint8_t alpha) const;
    void rectangle(double x, double y, double width, double height) const;
    void text(double x, double y, int scale, const std::string &text, Colour colour) const;

    double width_, height_;
    int scale_;
};

// Draws into a picture of B, G, R bytes, with smooth edges.
class PictureCanvas final : public Canvas {
public:
    // `stride`: bytes from one row to the next.
    PictureCanvas(std::uint8_t *bgr, std::size_t stride, std::uint32_t width, std::uint32_t height)
        : Canvas(width, height, height / 360.0), bgr_(bgr), stride_(stride), width_(width), height_(height) {}
    Point at(Point pixel) const override { return {pixel.x + 0.5, pixel.y + 0.5}; }

protected:
    void fill(std::span<const Point> corners, Colour colour, std::uint8_t alpha) const override;

private:
    std::uint8_t *bgr_;
    std::size_t stride_;
    std::uint32_t width_, height_;
};

} // namespace arhost::drawing
