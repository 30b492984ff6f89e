// SPDX-License-Identifier: Apache-2.0
#include "conformance/prints.hpp"

#include <arhost/shading/lens.hpp>

#include <glm/gtc/matrix_transform.hpp>
#include <glm/mat3x3.hpp>
#include <png.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <optional>
#include <random>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace arhost::conformance {
namespace {

constexpr double min_margin = 1.0 / 8; // width of the paper's margin relative to the marker's side

struct Marker {
    int id;
    std::vector<std::string_view> rows; // '#' is ink
};
struct DrawnFamily {
    std::string_view name;
    std::vector<Marker> markers; // with the orientation of the AprilTag library, of OpenCV, or of ARToolKit
    bool is_of_artoolkit =
        false; // the rows are those inside the border, whose width is a quarter of the marker's side
};
const std::vector<DrawnFamily> families = {
    {"tag36h11",
     {{31, {"########", "###.#..#", "##...#.#", "#...##.#", "#.#.#.##", "###....#", "##..#.##", "########"}},
      {7, {"########", "####.###", "####..##", "##.#.###", "#.#...##", "####...#", "##.#.###", "########"}},
      {586, {"########", "#...#.##", "#####..#", "#.#....#", "#.##.###", "#.#..#.#", "#..##..#", "########"}},
      {2, {"########", "#..#...#", "##.##.##", "#.######", "###.##.#", "####.###", "###...##", "########"}}}},
    {"DICT_6X6_250",
     {{31, {"########", "######.#", "#.##.#.#", "#.#....#", "#......#", "##....##", "#....#.#", "########"}},
      {7, {"########", "#.###.##", "###.#.##", "##.#.###", "###....#", "###.#.##", "##..#.##", "########"}},
      {203, {"########", "###....#", "###.##.#", "#.####.#", "#####..#", "#..##.##", "#.###.##", "########"}},
      {2, {"########", "####.#.#", "##..##.#", "######.#", "#.....##", "#.#.#..#", "###..#.#", "########"}}}},
    {"tag25h9",
     {{31, {"#######", "#.##..#", "#..##.#", "#.#.###", "####.##", "#.#####", "#######"}},
      {7, {"#######", "#.#####", "##..###", "#.#...#", "##..#.#", "##.#..#", "#######"}},
      {12, {"#######", "##..#.#", "#.#...#", "#.##.##", "###.#.#", "##...##", "#######"}},
      {2, {"#######", "#.#...#", "#.#..##", "####.##", "#..#..#", "##.####", "#######"}}}},
    {"artoolkit-5x5-bch-22-7-7",
     {{31, {"#..##", "###.#", "..##.", ".##.#", "#.#.."}},
      {7, {"#....", "###.#", ".###.", ".#..#", "##.#."}},
      {12, {"#...#", "#..#.", "...##", "##...", "##..."}},
      {2, {"#....", ".#...", "#####", ".#.##", "###.."}}},
     true},
    {pattern_family, // in no two orientations, nor mirrored, are these similar
     {{31, {".##.", "#...", ".##.", ".#.#"}},
      {7, {"##..", "###.", "....", "##.#"}},
      {12, {"##.#", "..##", "...#", "#.#."}},
      {2, {".#..", ".#..", "..##", "####"}}},
     true},
};
constexpr std::array picture_ids = {31, 7, 12, 2};

Print print_of_artoolkit(const Marker &marker) {
    const auto border = static_cast<std::uint32_t>(marker.rows.size()); // in pixels: half as wide as the cells
    Print print{marker.id, 4 * border, std::vector<std::uint8_t>(std::size_t{16} * border * border, 0)};
    for (std::uint32_t y = 0; y < 2 * border; ++y)
        for (std::uint32_t x = 0; x < 2 * border; ++x)
            if (marker.rows[y / 2][x / 2] != '#')
                print.grey[std::size_t{border + y} * print.side + border + x] = 255;
    return print;
}

// Writes the picture inside the border as mk_patt does: the planes blue, green and red of four orientations.
void write_pattern(const Print &print, const std::filesystem::path &file) {
    constexpr std::uint32_t side = 16;
    // The print's pixel in the middle of an element.
    const auto element = [&](std::uint32_t row, std::uint32_t column) {
        const auto at = [&](std::uint32_t i) { return (print.side * side + print.side * (2 * i + 1)) / (4 * side); };
        return int{print.grey[std::size_t{at(row)} * print.side + at(column)]};
    };
    std::ofstream stream(file);
    for (int orientation = 0; orientation < 4; ++orientation)
        for (int plane = 0; plane < 3; ++plane)
            for (std::uint32_t row = 0; row < side; ++row)
                for (std::uint32_t column = 0; column < side; ++column) {
                    std::uint32_t r = row, c = column;
                    for (int turn = 0; turn < orientation; ++turn)
                        r = std::exchange(c, side - 1 - r);
                    stream << element(r, c) << (column + 1 < side ? ' ' : '\n');
                }
    if (!stream.flush())
        throw std::runtime_error("cannot write " + file.string());
}

Print print_of(const Marker &marker) {
    Print print{marker.id, static_cast<std::uint32_t>(marker.rows.size()), {}};
    for (const std::string_view row : marker.rows)
        for (const char cell : row)
            print.grey.push_back(cell == '#' ? 0 : 255);
    return print;
}

Print read_print(int id, const std::filesystem::path &file) {
    const auto error = [&](const std::string &why) {
        return std::runtime_error("--print " + std::to_string(id) + "=" + file.string() + ": " + why);
    };
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    if (!png_image_begin_read_from_file(&png, file.c_str()))
        throw error(png.message);
    if (png.width != png.height) {
        png_image_free(&png);
        throw error("the picture must be square: crop it to the print between the marker's corners");
    }
    png.format = PNG_FORMAT_GRAY;
    Print print{id, png.width, std::vector<std::uint8_t>(PNG_IMAGE_SIZE(png))};
    const png_color white{255, 255, 255};
    if (!png_image_finish_read(&png, &white, print.grey.data(), 0, nullptr))
        throw error(png.message);
    return print;
}

constexpr std::uint32_t rays = 32;
using Offsets = std::array<glm::dvec2, rays>; // within a pixel, from (0, 0) to (1, 1)

Offsets hammersley() {
    Offsets offsets;
    for (std::uint32_t i = 0; i < rays; ++i) {
        double reversed = 0;
        for (std::uint32_t bit = 0; bit < 5; ++bit)
            reversed += (i >> bit & 1) / static_cast<double>(2u << bit);
        offsets[i] = {(i + 0.5) / rays, reversed + 0.5 / rays};
    }
    return offsets;
}

glm::dvec3 ray_at(const shading::Lens &lens, double x, double y) {
    const auto ray = lens.ray({x, y});
    return ray ? glm::dvec3(ray->x, ray->y, ray->z) : glm::dvec3(0, 0, -1);
}

// Intersects rays (OpenCV's axes) with a marker's plane.
struct View {
    const Placed &marker;
    double cells;  // print pixels per marker side
    double margin; // of the paper, relative to the marker's side
    glm::dmat3 marker_from_ray;
    std::uint32_t left, top, right, bottom; // pixels that may show it; right and bottom are exclusive

    View(const arhost_intrinsics &camera, const Placed &placed)
        : marker(placed), cells(placed.print.side - 2.0 * placed.print.border),
          margin(std::max(min_margin, placed.print.border / cells)) {
        const Pose &m = placed.camera_from_marker;
        const glm::dmat3 cv_from_gl(1, 0, 0, 0, -1, 0, 0, 0, -1);
        marker_from_ray = glm::inverse(cv_from_gl * glm::dmat3(m[0], m[1], m[3]));
        const double half = placed.side_mm * (0.5 + margin);
        glm::dvec2 low(1e9), high(-1e9);
        for (int i = 0; i < 32; ++i) { // a lens may bend the edges outwards
            const double along = half * ((i % 8) / 3.5 - 1);
            const glm::dvec2 edge[] = {{along, -half}, {along, half}, {-half, along}, {half, along}};
            const glm::dvec2 px = pixel_of(camera, m * glm::dvec4(edge[i / 8], 0, 1));
            low = glm::min(low, px);
            high = glm::max(high, px);
        }
        const auto clamped = [](double px, std::uint32_t limit) {
            return static_cast<std::uint32_t>(std::clamp(px, 0.0, static_cast<double>(limit)));
        };
        constexpr double margin_px = 2;
        left = clamped(low.x - margin_px, camera.width), top = clamped(low.y - margin_px, camera.height);
        right = clamped(high.x + margin_px, camera.width), bottom = clamped(high.y + margin_px, camera.height);
    }

    // Intersection with the marker's plane in units of its side: (0, 0) is its top left corner, (1, 1) its bottom
    // right corner.
    std::optional<glm::dvec2> intersect(const glm::dvec3 &ray) const {
        const glm::dvec3 at = marker_from_ray * ray;
        if (at.z <= 0)
            return std::nullopt;
        return glm::dvec2(0.5 + at.x / at.z / marker.side_mm, 0.5 - at.y / at.z / marker.side_mm);
    }
    // The code at a point; nullopt outside the paper.
    std::optional<int> code(const glm::dvec2 &at) const {
        const double low = std::min(at.x, at.y), high = std::max(at.x, at.y);
        if (low < -margin || high > 1 + margin)
            return std::nullopt;
        const auto [column, row] = cell(at);
        const int side = static_cast<int>(marker.print.side);
        if (std::min(column, row) < 0 || std::max(column, row) >= side)
            return paper_code;
        return ink_code +
               (paper_code - ink_code) *
                   marker.print
                       .grey[static_cast<std::size_t>(row) * marker.print.side + static_cast<std::size_t>(column)] /
                   255;
    }
    std::pair<int, int> cell(const glm::dvec2 &at) const {
        return {static_cast<int>(std::floor(at.x * cells + marker.print.border)),
                static_cast<int>(std::floor(at.y * cells + marker.print.border))};
    }

    // Mean code of a pixel over `background`. The rays go through its top left corner and the corners right of and
    // below it.
    std::uint8_t mean(const glm::dvec3 &corner, const glm::dvec3 &right_of, const glm::dvec3 &below,
                      const Offsets &offsets, std::uint8_t background) const {
        // Within a pixel the lens is approximately linear.
        const glm::dvec3 right = right_of - corner, down = below - corner;
        const auto hit = [&](double u, double v) { return intersect(corner + right * u + down * v); };
        const auto same = [&](const std::optional<glm::dvec2> &a, const std::optional<glm::dvec2> &b) {
            return a && b && cell(*a) == cell(*b) && code(*a) == code(*b);
        };
        const auto first = hit(0, 0);
        if (same(first, hit(1, 0)) && same(first, hit(0, 1)) && same(first, hit(1, 1))) // most pixels
            return static_cast<std::uint8_t>(code(*first).value_or(background));
        int sum = 0;
        for (const glm::dvec2 &offset : offsets) {
            const auto at = hit(offset.x, offset.y);
            sum += (at ? code(*at) : std::nullopt).value_or(background);
        }
        return static_cast<std::uint8_t>((sum + rays / 2) / rays);
    }
};

} // namespace

// Rectangles of random greys, the smaller ones on top.
Print picture_of(int id) {
    constexpr std::uint32_t side = 256, count = 200;
    Print print{id, side, std::vector<std::uint8_t>(std::size_t{side} * side, 128)};
    std::mt19937 random(static_cast<std::uint32_t>(id));
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::uint32_t largest = side >> (1 + 3 * i / count);
        const auto length = [&] { return largest / 2 + random() % (largest / 2); };
        const std::uint32_t x0 = random() % side, x1 = std::min<std::uint32_t>(side, x0 + length());
        const std::uint32_t y0 = random() % side, y1 = std::min<std::uint32_t>(side, y0 + length());
        const auto grey = static_cast<std::uint8_t>(random());
        for (std::uint32_t y = y0; y < y1; ++y)
            std::fill_n(print.grey.begin() + std::size_t{side} * y + x0, x1 - x0, grey);
    }
    return print;
}

void write_picture(const Print &print, const std::filesystem::path &file) {
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    png.width = png.height = print.side;
    png.format = PNG_FORMAT_GRAY;
    if (!png_image_write_to_file(&png, file.c_str(), 0, print.grey.data(), 0, nullptr))
        throw std::runtime_error("cannot write " + file.string() + ": " + png.message);
}

Print Print::mirrored() const {
    Print other = *this;
    for (auto row = other.grey.begin(); row != other.grey.end(); row += side)
        std::reverse(row, row + side);
    return other;
}

std::vector<Print> prints_of(const PrintFiles &files, std::string_view family) {
    std::vector<Print> prints;
    if (files.empty() && family == picture_family)
        for (const int id : picture_ids)
            prints.push_back(picture_of(id));
    else if (files.empty()) {
        const DrawnFamily &drawn = *std::ranges::find(families, family, &DrawnFamily::name);
        for (const Marker &marker : drawn.markers)
            prints.push_back(drawn.is_of_artoolkit ? print_of_artoolkit(marker) : print_of(marker));
    }
    for (auto file = files.rbegin(); file != files.rend(); ++file)
        prints.push_back(read_print(file->first, file->second));
    return prints;
}

std::filesystem::path print_file(const std::filesystem::path &folder, const std::string &family, int id,
                                 const PrintFiles &files) {
    const bool is_pattern = family == pattern_family;
    const std::filesystem::path file = folder / (std::to_string(id) + (is_pattern ? ".patt" : ".png"));
    if (!std::filesystem::exists(file))
        for (const Print &print : prints_of(files, family))
            if (print.id == id)
                (is_pattern ? write_pattern : write_picture)(print, file);
    return file;
}

double pattern_ratio_of(std::string_view family) {
    return family == pattern_family ? 0.5 : 0;
}

Grey Grey::part(std::uint32_t x0, std::uint32_t y0, std::uint32_t part_width, std::uint32_t part_height) const {
    return filled(part_width, part_height, [&](auto x, auto y) { return at(x0 + x, y0 + y); });
}

Picture Grey::picture() const {
    Picture picture(width, height);
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x)
            picture.set(x, y, {at(x, y), at(x, y), at(x, y), 255});
    return picture;
}

Pose pose(const glm::dvec3 &centre, double about_x, double about_y, double about_z) {
    Pose result = glm::translate(Pose(1), centre);
    result = glm::rotate(result, glm::radians(about_z), glm::dvec3(0, 0, 1));
    result = glm::rotate(result, glm::radians(about_y), glm::dvec3(0, 1, 0));
    return glm::rotate(result, glm::radians(about_x), glm::dvec3(1, 0, 0));
}

Pose tilted(const glm::dvec3 &centre, double tilt, double towards, double about_z) {
    const double direction = glm::radians(towards);
    Pose result = glm::translate(Pose(1), centre);
    result = glm::rotate(result, glm::radians(tilt), glm::dvec3(-std::sin(direction), std::cos(direction), 0));
    return glm::rotate(result, glm::radians(about_z), glm::dvec3(0, 0, 1));
}

Grey draw(const arhost_intrinsics &camera, std::span<const Placed> markers) {
    const Offsets offsets = hammersley();
    const shading::Lens lens(camera);
    Grey image = filled(camera.width, camera.height, [](auto, auto) { return background_code; });
    std::vector<View> views;
    views.reserve(markers.size());
    for (const Placed &marker : markers)
        views.emplace_back(camera, marker);
    for (const View &view : views) {
        const auto rays_at = [&](std::uint32_t row) { // through the pixels' top left corners
            std::vector<glm::dvec3> found;
            found.reserve(view.right - view.left + 1);
            for (std::uint32_t x = view.left; x <= view.right; ++x)
                found.push_back(ray_at(lens, x - 0.5, row - 0.5));
            return found;
        };
        std::vector<glm::dvec3> above = rays_at(view.top);
        for (std::uint32_t y = view.top; y < view.bottom; ++y) {
            std::vector<glm::dvec3> below = rays_at(y + 1);
            for (std::uint32_t x = view.left; x < view.right; ++x) {
                const std::size_t i = x - view.left;
                image.at(x, y) = view.mean(above[i], above[i + 1], below[i], offsets, image.at(x, y));
            }
            above = std::move(below);
        }
    }
    return image;
}

glm::dvec2 pixel_of(const arhost_intrinsics &camera, const glm::dvec3 &p) {
    const auto pixel = shading::Lens(camera).project({p.x, -p.y, -p.z});
    if (!pixel)
        throw std::runtime_error("the test's marker is not in view");
    return {pixel->x, pixel->y};
}

std::array<glm::dvec2, 4> corners_of(const arhost_intrinsics &camera, const Placed &marker) {
    const double h = marker.side_mm / 2;
    const auto corner = [&](double x, double y) {
        return pixel_of(camera, marker.camera_from_marker * glm::dvec4(x, y, 0, 1));
    };
    return {corner(-h, h), corner(h, h), corner(h, -h), corner(-h, -h)};
}

Grey blurred(const Grey &image, double sigma_px) {
    const int radius = static_cast<int>(std::ceil(3 * sigma_px));
    std::vector<double> weights;
    double sum = 0;
    for (int i = -radius; i <= radius; ++i)
        sum += weights.emplace_back(std::exp(-i * i / (2 * sigma_px * sigma_px)));
    // Filters along rows into a transposed image; applied twice.
    const auto pass = [&](const Grey &from) {
        return filled(from.height, from.width, [&](auto y, auto x) {
            double mean = 0;
            for (int i = -radius; i <= radius; ++i) {
                const int at = std::clamp(static_cast<int>(x) + i, 0, static_cast<int>(from.width) - 1);
                mean += weights[i + radius] / sum * from.at(static_cast<std::uint32_t>(at), y);
            }
            return static_cast<int>(std::lround(mean));
        });
    };
    return pass(pass(image));
}

} // namespace arhost::conformance
