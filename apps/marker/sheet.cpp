// SPDX-License-Identifier: Apache-2.0
#include "sheet.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace arhost::marker {
namespace {

constexpr double label_mm = 2.5, label_space_mm = 4;
constexpr double footer_mm = 13, ruler_height_mm = 7, ruler_mm = 100;
constexpr double cut_mark_mm = 1.5, cut_mark_space_mm = 1;

std::string id_range(const std::vector<int> &ids) {
    return fmt::format("{}-{}", ids.front(), ids.back());
}

// The orientation of a page, and the number of items for which it has room.
struct Layout {
    double width_mm, height_mm, margin_mm;
    std::size_t columns, rows;

    Layout(double width, double height, double margin, double slot_width, double slot_height)
        : width_mm(width), height_mm(height), margin_mm(margin), columns(fitting(free_width_mm(), slot_width)),
          rows(fitting(free_height_mm(), slot_height)) {}

    double free_width_mm() const { return width_mm - 2 * margin_mm; }
    double free_height_mm() const { return height_mm - 2 * margin_mm - footer_mm; }
    std::size_t pages(std::size_t items) const { // SIZE_MAX if an item does not fit
        return columns * rows == 0 ? SIZE_MAX : (items + columns * rows - 1) / (columns * rows);
    }

private:
    static std::size_t fitting(double space, double slot) {
        return static_cast<std::size_t>(std::max(0.0, std::floor(space / slot + 1e-9)));
    }
};

// Draws the ruler and the texts of the footer. The length of the ruler is the distance between the outer edges of its
// first and last tick.
void add_footer(Page &page, const Layout &layout, std::size_t number, std::size_t count) {
    const double left = layout.margin_mm, bottom = layout.height_mm - layout.margin_mm;
    const double top = bottom - ruler_height_mm, baseline = top - 1.5;
    const int length =
        std::min(static_cast<int>(ruler_mm), static_cast<int>(layout.free_width_mm() / 10 + 1e-9) * 10);
    constexpr double width = 0.2;
    page.lines.push_back({left, top + width / 2, left + length, top + width / 2, width});
    for (int i = 0; i <= length; ++i) {
        const double x = left + std::clamp<double>(i, width / 2, length - width / 2);
        page.lines.push_back({x, top, x,
                              top + (i % 10 == 0  ? 4
                                     : i % 5 == 0 ? 3
                                                  : 2),
                              i % 5 == 0 ? width : width / 2});
        if (i % 10 == 0)
            page.labels.push_back({std::to_string(i), x, bottom - 0.3, 2, 8, 0.5});
    }
    const double number_width = count > 1 ? std::min(25.0, layout.free_width_mm() / 3) : 0;
    page.labels.push_back({fmt::format("Print at 100 %; this ruler must measure {} mm", length), left, baseline, 3,
                           layout.free_width_mm() - number_width, 0});
    if (count > 1)
        page.labels.push_back({fmt::format("page {} of {}", number, count), layout.width_mm - left, baseline, 2.5,
                               number_width - 2, 1});
}

} // namespace

std::string mm_text(double mm) {
    const double rounded = std::round(mm * 1e4) / 1e4;
    return fmt::format("{:.7g}", rounded + 0.0); // -0 becomes 0
}

Item single_marker(const Family &family, int id, double side_mm) {
    Item item = grid_board(family, {id}, 1, 1, side_mm, side_mm);
    item.label = family.picture ? fmt::format("{}, {} mm", family.name, mm_text(side_mm))
                                : fmt::format("{} {}, {} mm", family.name, id, mm_text(side_mm));
    return item;
}

Item grid_board(const Family &family, const std::vector<int> &ids, int columns, int rows, double side_mm,
                double gap_mm) {
    const double print = side_mm / family.border_cells * family.cells, pitch = print + gap_mm;
    const double quiet = side_mm * family.quiet;
    if (gap_mm < quiet * (1 - 1e-9))
        throw std::runtime_error(fmt::format("--gap {}: each marker needs a quiet zone; use --gap {} or more",
                                             mm_text(gap_mm), mm_text(std::ceil(quiet * 100 - 1e-6) / 100)));
    Item board{columns * pitch - gap_mm,
               rows * pitch - gap_mm,
               quiet,
               {},
               {},
               fmt::format("{} {}, {} x {}, {} mm, gap {} mm", family.name, id_range(ids), columns, rows,
                           mm_text(side_mm), mm_text(gap_mm))};
    const double inset = (print - side_mm) / 2;
    for (int row = 0; row < rows; ++row)
        for (int column = 0; column < columns; ++column)
            board.markers.push_back(
                {ids[board.markers.size()], column * pitch + inset, row * pitch + inset, side_mm});
    return board;
}

Item charuco_board(const Family &family, const std::vector<int> &ids, int columns, int rows, double square_mm,
                   double marker_mm) {
    if (!family.is_dictionary)
        throw std::runtime_error(
            fmt::format("--charuco: {} is not an ArUco dictionary, and OpenCV detects no ChArUco boards of other "
                        "markers, and those of AprilTags only if they are upside down; use for example DICT_6X6_250",
                        family.name));
    const double cell = marker_mm / family.cells, largest = square_mm * family.cells / (family.cells + 2);
    if (marker_mm > largest * (1 + 1e-9))
        throw std::runtime_error(fmt::format(
            "--marker {}: each marker needs a quiet zone of one cell in its square of {} mm; use --marker {} or less",
            mm_text(marker_mm), mm_text(square_mm), mm_text(std::floor(largest * 100 + 1e-6) / 100)));
    Item board{columns * square_mm,
               rows * square_mm,
               cell,
               {},
               {},
               fmt::format("{} {}, {} mm, ChArUco {} x {}, {} mm", family.name, id_range(ids), mm_text(marker_mm),
                           columns, rows, mm_text(square_mm))};
    const double inset = (square_mm - marker_mm) / 2;
    for (int row = 0; row < rows; ++row)
        for (int column = 0; column < columns; ++column) {
            const double left = column * square_mm, top = row * square_mm;
            if ((row + column) % 2 == 0)
                board.squares.push_back({left, top, square_mm});
            else
                board.markers.push_back({ids[board.markers.size()], left + inset, top + inset, marker_mm});
        }
    return board;
}

std::string map_of(const Item &board, const Family &family) {
    std::string text = fmt::format("# Origin at the board's centre; x right, y up on the print, z out of the paper.\n"
                                   "version: 1\n{}: {}\nmarkers:\n",
                                   family.is_dictionary ? "dictionary" : "family", family.name);
    for (const PlacedMarker &marker : board.markers)
        text += fmt::format("  - {{id: {}, side_mm: {}, position_mm: [{}, {}, 0], rotation_degrees: [0, 0, 0]}}\n",
                            marker.id, mm_text(marker.side_mm),
                            mm_text(marker.left_mm + marker.side_mm / 2 - board.width_mm / 2),
                            mm_text(board.height_mm / 2 - marker.top_mm - marker.side_mm / 2));
    return text;
}

Document lay_out(const std::vector<Item> &items, const Paper &paper, bool cut_marks) {
    const Item &first = items.front();
    const double quiet = first.quiet_mm + (cut_marks ? cut_mark_space_mm : 0);
    const double slot_width = first.width_mm + 2 * quiet, slot_height = first.height_mm + 2 * quiet + label_space_mm;
    const Layout as_given(paper.width_mm, paper.height_mm, paper.margin_mm, slot_width, slot_height);
    const Layout turned(paper.height_mm, paper.width_mm, paper.margin_mm, slot_width, slot_height);
    const Layout &layout = turned.pages(items.size()) < as_given.pages(items.size()) ? turned : as_given;
    const std::size_t count = layout.pages(items.size());
    if (layout.free_width_mm() < 20)
        throw std::runtime_error(fmt::format("--margin {}: only {} mm of the paper's width remain; 20 mm are needed",
                                             mm_text(paper.margin_mm), mm_text(layout.free_width_mm())));
    if (count == SIZE_MAX)
        throw std::runtime_error(fmt::format(
            "{} needs {} x {} mm with its quiet zone and label, but the paper has room for {} x {} mm between its "
            "margins and the ruler; make it smaller, or choose a larger --paper or a smaller --margin",
            first.markers.size() > 1 ? "the board" : "a marker", mm_text(slot_width), mm_text(slot_height),
            mm_text(layout.free_width_mm()), mm_text(layout.free_height_mm())));
    if (count > max_pages)
        throw std::runtime_error(fmt::format("{} markers need {} pages; print them in parts of at most {} pages",
                                             items.size(), count, max_pages));
    Document document{layout.width_mm, layout.height_mm, std::vector<Page>(count)};
    const std::size_t columns = std::min(layout.columns, items.size());
    const std::size_t rows = std::min(layout.rows, (items.size() + columns - 1) / columns);
    const double left = (layout.width_mm - static_cast<double>(columns) * slot_width) / 2;
    const double top = layout.margin_mm + (layout.free_height_mm() - static_cast<double>(rows) * slot_height) / 2;
    for (std::size_t i = 0; i < items.size(); ++i) {
        const Item &item = items[i];
        Page &page = document.pages[i / (columns * rows)];
        const double slot_x = left + static_cast<double>(i % columns) * slot_width;
        const double slot_y = top + static_cast<double>(i / columns % rows) * slot_height;
        for (const auto &[id, x, y, side] : item.markers)
            page.markers.push_back({id, slot_x + quiet + x, slot_y + quiet + y, side});
        for (const auto &[x, y, side] : item.squares)
            page.squares.push_back({slot_x + quiet + x, slot_y + quiet + y, side});
        page.labels.push_back({item.label, slot_x + slot_width / 2, slot_y + slot_height - label_space_mm + label_mm,
                               label_mm, 0.95 * slot_width, 0.5});
        for (const double x : {slot_x, slot_x + slot_width})
            for (const double y : {slot_y, slot_y + slot_height})
                if (cut_marks) {
                    page.lines.push_back({x - cut_mark_mm, y, x + cut_mark_mm, y, 0.1});
                    page.lines.push_back({x, y - cut_mark_mm, x, y + cut_mark_mm, 0.1});
                }
    }
    for (std::size_t i = 0; i < count; ++i)
        add_footer(document.pages[i], layout, i + 1, count);
    return document;
}

} // namespace arhost::marker
