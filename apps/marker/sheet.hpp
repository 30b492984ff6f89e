// SPDX-License-Identifier: Apache-2.0
//
// Arranges markers on pages, in millimetres from the top left corner of the page; y points down.
#pragma once

#include "family.hpp"

#include <string>
#include <vector>

namespace arhost::marker {

struct PlacedMarker {
    int id;
    double left_mm, top_mm, side_mm; // the square between the corners that trackers report
};

struct Square {
    double left_mm, top_mm, side_mm;
};

// A single marker, or a board: a rigid body of several markers. Coordinates begin at its top left corner.
struct Item {
    double width_mm, height_mm; // without the quiet zone
    double quiet_mm;            // width of the quiet zone
    std::vector<PlacedMarker> markers;
    std::vector<Square> squares; // the black squares of a ChArUco board
    std::string label;
};

Item single_marker(const Family &family, int id, double side_mm);
// Markers in rows from the top left. `gap_mm`: between neighbouring prints. Throws std::runtime_error if the gap is
// narrower than the quiet zone.
Item grid_board(const Family &family, const std::vector<int> &ids, int columns, int rows, double side_mm,
                double gap_mm);
// A board of OpenCV 4.6 and later: the top left square is black, and the ids are in rows from the top left. Throws
// std::runtime_error if the family or the sizes do not suit.
Item charuco_board(const Family &family, const std::vector<int> &ids, int columns, int rows, double square_mm,
                   double marker_mm);

// Returns the map file of a board, in the board's frame: origin at its centre, x right, y up on the print, z out of
// the paper.
std::string map_of(const Item &board, const Family &family);

struct Line {
    double x0_mm, y0_mm, x1_mm, y1_mm, width_mm;
};

struct Label {
    std::string text;
    double x_mm, baseline_mm;
    double size_mm, max_width_mm; // a longer text is drawn smaller
    double anchor;                // position of x in the text: 0 its left end, 0.5 its centre, 1 its right end
};

struct Page {
    std::vector<PlacedMarker> markers;
    std::vector<Square> squares;
    std::vector<Line> lines;
    std::vector<Label> labels;
};

struct Paper {
    double width_mm = 210, height_mm = 297, margin_mm = 10;
};

struct Document {
    double width_mm, height_mm; // of each page
    std::vector<Page> pages;
};

// Places items of equal size on as few pages as possible, portrait or landscape. Throws std::runtime_error if the
// paper is too small, or if more than `max_pages` pages would be necessary.
inline constexpr std::size_t max_pages = 500;
Document lay_out(const std::vector<Item> &items, const Paper &paper, bool cut_marks);

std::string mm_text(double mm); // rounded to 0.0001 mm: "40", "22.5"

} // namespace arhost::marker
