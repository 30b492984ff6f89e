// SPDX-License-Identifier: Apache-2.0
#include "drawing.hpp"

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <cairo.h>
#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <vector>

namespace arhost::marker {
namespace {

constexpr double mm_per_inch = 25.4, points_per_mm = 72 / mm_per_inch;

using Surface = std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)>;
using Context = std::unique_ptr<cairo_t, decltype(&cairo_destroy)>;

void expect(cairo_status_t status) {
    if (status != CAIRO_STATUS_SUCCESS)
        throw std::runtime_error(std::string("cannot draw the page: ") + cairo_status_to_string(status));
}

Surface checked(cairo_surface_t *created) {
    Surface surface(created, cairo_surface_destroy);
    expect(cairo_surface_status(created));
    return surface;
}

cairo_status_t append(void *bytes, const unsigned char *data, unsigned size) {
    static_cast<std::string *>(bytes)->append(reinterpret_cast<const char *>(data), size);
    return CAIRO_STATUS_SUCCESS;
}

// A rectangle of black cells.
struct Block {
    int column, row, width, height;
};

// Covers the black cells with rectangles that do not overlap.
std::vector<Block> blocks_of(std::vector<bool> black, int side) {
    const auto cell = [&](int column, int row) { return black.begin()[row * side + column]; };
    std::vector<Block> blocks;
    for (int row = 0; row < side; ++row)
        for (int column = 0; column < side; ++column) {
            Block block{column, row, 0, 0};
            while (column + block.width < side && cell(column + block.width, row))
                ++block.width;
            const auto is_black = [&](int y) {
                for (int x = column; x < column + block.width; ++x)
                    if (!cell(x, y))
                        return false;
                return block.width > 0;
            };
            for (int y = row; y < side && is_black(y); ++y, ++block.height)
                for (int x = column; x < column + block.width; ++x)
                    cell(x, y) = false;
            if (block.width > 0)
                blocks.push_back(block);
        }
    return blocks;
}

class Canvas {
public:
    // `whole_units`: the edges of cells are at multiples of the surface's unit.
    Canvas(cairo_surface_t *surface, double units_per_mm, bool whole_units)
        : context_(cairo_create(surface), cairo_destroy), scale_(units_per_mm), whole_(whole_units) {
        cairo_select_font_face(context_.get(), "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
        const std::unique_ptr<cairo_font_options_t, decltype(&cairo_font_options_destroy)> options(
            cairo_font_options_create(), cairo_font_options_destroy);
        cairo_font_options_set_antialias(options.get(), CAIRO_ANTIALIAS_GRAY);
        cairo_font_options_set_hint_style(options.get(), CAIRO_HINT_STYLE_NONE);
        cairo_font_options_set_hint_metrics(options.get(), CAIRO_HINT_METRICS_OFF);
        cairo_set_font_options(context_.get(), options.get());
    }

    void draw(const Page &page, const Family &family) {
        for (const PlacedMarker &marker : page.markers)
            draw(marker, family);
        for (const auto &[left, top, side] : page.squares)
            add(placed(left * scale_), placed(top * scale_), placed((left + side) * scale_),
                placed((top + side) * scale_));
        cairo_fill(context_.get());
        for (const Line &line : page.lines)
            draw(line);
        for (const Label &label : page.labels)
            draw(label);
        cairo_show_page(context_.get());
        expect(cairo_status(context_.get()));
    }

    void paint_white() {
        cairo_set_source_rgb(context_.get(), 1, 1, 1);
        cairo_paint(context_.get());
        cairo_set_source_rgb(context_.get(), 0, 0, 0);
    }

private:
    // One path for all cells, because the edges of separate neighbours would show when they are antialiased.
    void draw(const PlacedMarker &marker, const Family &family) {
        const double cell = marker.side_mm / family.border_cells * scale_;
        const double left = placed(marker.left_mm * scale_), top = placed(marker.top_mm * scale_);
        const int outside = (family.cells - family.border_cells) / 2;
        const auto edge = [&](int cells) { return placed((cells - outside) * cell); };
        for (const auto &[column, row, width, height] : blocks_of(family.black(marker.id), family.cells))
            add(left + edge(column), top + edge(row), left + edge(column + width), top + edge(row + height));
        cairo_fill(context_.get());
        if (family.picture)
            draw(*family.picture, left, top, marker.side_mm * scale_);
    }

    // Draws each sample up to the right and bottom edge, below the samples that follow. If neighbouring samples ended
    // at the same edge, an antialiased line would show between them.
    void draw(const Picture &picture, double left, double top, double side) {
        const double first = side * (1 - picture.ratio) / 2, pitch = side * picture.ratio / picture.side;
        const auto edge = [&](int samples) { return placed(first + samples * pitch); };
        if (whole_) // the surface stores only ink, and a brighter sample must replace the ink below it
            cairo_set_operator(context_.get(), CAIRO_OPERATOR_SOURCE);
        for (int i = 0; i < picture.side * picture.side; ++i) {
            const double white = picture.grey[static_cast<std::size_t>(i)] / 255.0;
            if (whole_)
                cairo_set_source_rgba(context_.get(), 0, 0, 0, 1 - white);
            else
                cairo_set_source_rgb(context_.get(), white, white, white);
            add(left + edge(i % picture.side), top + edge(i / picture.side), left + edge(picture.side),
                top + edge(picture.side));
            cairo_fill(context_.get());
        }
        cairo_set_operator(context_.get(), CAIRO_OPERATOR_OVER);
        cairo_set_source_rgb(context_.get(), 0, 0, 0);
    }

    // Adds a rectangle to the path. Unlike cairo_rectangle(), which would round the width, rounds the right edge.
    void add(double left, double top, double right, double bottom) {
        cairo_move_to(context_.get(), left, top);
        cairo_line_to(context_.get(), right, top);
        cairo_line_to(context_.get(), right, bottom);
        cairo_line_to(context_.get(), left, bottom);
        cairo_close_path(context_.get());
    }

    double placed(double units) const { return whole_ ? std::round(units) : units; }

    void draw(const Line &line) {
        cairo_set_line_width(context_.get(), line.width_mm * scale_);
        cairo_move_to(context_.get(), line.x0_mm * scale_, line.y0_mm * scale_);
        cairo_line_to(context_.get(), line.x1_mm * scale_, line.y1_mm * scale_);
        cairo_stroke(context_.get());
    }

    void draw(const Label &label) {
        cairo_set_font_size(context_.get(), label.size_mm * scale_);
        cairo_text_extents_t extents;
        cairo_text_extents(context_.get(), label.text.c_str(), &extents);
        const double fit = std::min(1.0, label.max_width_mm * scale_ / extents.x_advance);
        cairo_set_font_size(context_.get(), label.size_mm * scale_ * fit);
        cairo_move_to(context_.get(), label.x_mm * scale_ - label.anchor * extents.x_advance * fit,
                      label.baseline_mm * scale_);
        cairo_show_text(context_.get(), label.text.c_str());
    }

    Context context_;
    double scale_;
    bool whole_;
};

void finish(cairo_surface_t *surface) {
    cairo_surface_finish(surface);
    expect(cairo_surface_status(surface));
}

void append_png(png_structp png, png_bytep data, std::size_t size) {
    static_cast<std::string *>(png_get_io_ptr(png))->append(reinterpret_cast<const char *>(data), size);
}

// `ink`: rows of one byte per pixel, 255 for black.
std::string encode_png(std::vector<std::uint8_t> ink, std::uint32_t width, std::uint32_t height, unsigned dpi) {
    std::ranges::transform(ink, ink.begin(), [](std::uint8_t alpha) { return 255 - alpha; });
    std::string bytes;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png ? png_create_info_struct(png) : nullptr;
    if (!info)
        throw std::bad_alloc();
    if (setjmp(png_jmpbuf(png))) { // libpng returns here after an error
        png_destroy_write_struct(&png, &info);
        throw std::runtime_error("cannot encode the PNG");
    }
    png_set_write_fn(png, &bytes, append_png, nullptr);
    png_set_IHDR(png, info, width, height, 8, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    const auto pixels_per_metre = static_cast<std::uint32_t>(std::lround(dpi * 1000 / mm_per_inch));
    png_set_pHYs(png, info, pixels_per_metre, pixels_per_metre, PNG_RESOLUTION_METER);
    png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_UP); // most rows equal the row above
    png_write_info(png, info);
    for (std::uint32_t y = 0; y < height; ++y)
        png_write_row(png, ink.data() + std::size_t{width} * y);
    png_write_end(png, nullptr);
    png_destroy_write_struct(&png, &info);
    return bytes;
}

} // namespace

std::string as_pdf(const Document &document, const Family &family, const std::string &title) {
    std::string bytes;
    const Surface surface = checked(cairo_pdf_surface_create_for_stream(
        append, &bytes, document.width_mm * points_per_mm, document.height_mm * points_per_mm));
    cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_TITLE, title.c_str());
    cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATOR, "arhost marker");
    Canvas canvas(surface.get(), points_per_mm, false);
    for (const Page &page : document.pages)
        canvas.draw(page, family);
    finish(surface.get());
    return bytes;
}

std::string as_svg(const Document &document, std::size_t page, const Family &family) {
    std::string bytes;
    const Surface surface = checked(cairo_svg_surface_create_for_stream(
        append, &bytes, document.width_mm * points_per_mm, document.height_mm * points_per_mm));
    cairo_svg_surface_set_document_unit(surface.get(), CAIRO_SVG_UNIT_PT);
    Canvas canvas(surface.get(), points_per_mm, false);
    canvas.paint_white(); // viewers may show transparent pictures on black
    canvas.draw(document.pages[page], family);
    finish(surface.get());
    return bytes;
}

std::string as_png(const Document &document, std::size_t page, const Family &family, unsigned dpi) {
    const double pixels_per_mm = dpi / mm_per_inch;
    const int width = static_cast<int>(std::lround(document.width_mm * pixels_per_mm));
    const int height = static_cast<int>(std::lround(document.height_mm * pixels_per_mm));
    const PlacedMarker &marker = document.pages[page].markers.front();
    const double cells = family.picture ? family.picture->side / family.picture->ratio : family.border_cells;
    const double cell = marker.side_mm / cells * pixels_per_mm;
    if (cell < 2)
        throw std::runtime_error(
            fmt::format("--dpi {}: a cell would be only {:.1f} px wide; use a larger --dpi or a PDF", dpi, cell));
    constexpr int cairo_limit = 32767;
    if (std::max(width, height) > cairo_limit)
        throw std::runtime_error(
            fmt::format("--dpi {}: the page would have {} x {} px, but the limit is {} px; use a "
                        "smaller --dpi or a PDF",
                        dpi, width, height, cairo_limit));
    // Only black ink is drawn, so its coverage (alpha) is enough.
    const Surface surface = checked(cairo_image_surface_create(CAIRO_FORMAT_A8, width, height));
    Canvas(surface.get(), pixels_per_mm, true).draw(document.pages[page], family);
    cairo_surface_flush(surface.get());
    const std::uint8_t *data = cairo_image_surface_get_data(surface.get());
    std::vector<std::uint8_t> ink;
    ink.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    for (int y = 0; y < height; ++y, data += cairo_image_surface_get_stride(surface.get()))
        ink.insert(ink.end(), data, data + width);
    return encode_png(std::move(ink), static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height), dpi);
}

} // namespace arhost::marker
