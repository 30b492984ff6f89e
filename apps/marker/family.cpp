// SPDX-License-Identifier: Apache-2.0
#include "family.hpp"

#include <fiducial/april_tags.hpp>
#include <fiducial/artoolkit.hpp>
#include <fiducial/aruco.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace arhost::marker {
namespace {

constexpr double artoolkit_quiet = 0.125; // half of the border

Family april_tags(const apriltag::FamilyType &type) {
    const std::shared_ptr<apriltag_family_t> family(type.create(), type.destroy);
    // Families with a reversed border have bits outside of the border. The others only have their quiet zone there.
    const int cells = family->reversed_border ? family->total_width : family->width_at_border;
    return {type.name,
            false,
            static_cast<int>(family->ncodes),
            cells,
            family->width_at_border,
            [family, cells](int id) {
                const std::unique_ptr<image_u8_t, decltype(&image_u8_destroy)> image(
                    apriltag_to_image(family.get(), id), image_u8_destroy);
                const int quiet = (image->width - cells) / 2;
                std::vector<bool> black;
                for (int row = quiet; row < quiet + cells; ++row)
                    for (int column = quiet; column < quiet + cells; ++column)
                        black.push_back(image->buf[row * image->stride + column] == 0);
                return black;
            },
            1.0 / family->width_at_border};
}

Family aruco_markers(const aruco::DictionaryType &type) {
    const cv::aruco::Dictionary dictionary = aruco::predefined(type.name);
    const int cells = dictionary.markerSize + 2;
    return {type.family,
            true,
            dictionary.bytesList.rows,
            cells,
            cells,
            [dictionary, cells](int id) {
                cv::Mat image;
                aruco::draw(dictionary, id, cells, image, 1);
                const cv::Mat_<uchar> is_black = image == 0;
                return std::vector<bool>(is_black.begin(), is_black.end());
            },
            1.0 / cells};
}

// Returns the family of matrix codes. Its cells are half as large as those of the code, because the border is half as
// wide as all cells of the code together.
Family matrix_codes(const fiducial::MatrixFamily &type) {
    const int side = 4 * type.side;
    return {type.name,
            false,
            type.id_count,
            side,
            side,
            [&type, side](int id) {
                const std::vector<bool> code = fiducial::matrix_cells(type, id);
                std::vector<bool> black;
                for (int row = 0; row < side; ++row)
                    for (int column = 0; column < side; ++column) {
                        const int y = row - type.side, x = column - type.side;
                        const bool inside = std::min(x, y) >= 0 && std::max(x, y) < 2 * type.side;
                        const int cell = y / 2 * type.side + x / 2;
                        black.push_back(!inside || code[static_cast<std::size_t>(cell)]);
                    }
                return black;
            },
            artoolkit_quiet};
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), 0);
    for (const char in_a : a) {
        std::size_t diagonal = row[0]++;
        for (std::size_t i = 0; i < b.size(); ++i) {
            const bool same = std::tolower(in_a) == std::tolower(b[i]);
            diagonal = std::exchange(row[i + 1], std::min({row[i] + 1, row[i + 1] + 1, diagonal + !same}));
        }
    }
    return row.back();
}

} // namespace

std::vector<std::string> family_names() {
    std::vector<std::string> names(apriltag::family_types.size());
    std::ranges::transform(apriltag::family_types, names.begin(), &apriltag::FamilyType::name);
    for (const aruco::DictionaryType &type : aruco::dictionary_types)
        if (!type.is_april_tag())
            names.emplace_back(type.option);
    for (const fiducial::MatrixFamily &type : fiducial::matrix_families())
        names.emplace_back(type.name);
    return names;
}

Family find_family(const std::string &name) {
    std::string known_as = name;
    for (const aruco::DictionaryType &type : aruco::dictionary_types)
        if (name == type.option) {
            if (!type.is_april_tag())
                return aruco_markers(type);
            known_as = type.family; // OpenCV would draw it upside down
        }
    for (const apriltag::FamilyType &type : apriltag::family_types)
        if (known_as == type.name)
            return april_tags(type);
    if (const auto *type = fiducial::find_matrix_family(name))
        return matrix_codes(*type);
    std::vector<std::string> names = family_names();
    std::ranges::stable_sort(names, {}, [&](const std::string &other) { return edit_distance(name, other); });
    names.resize(3);
    throw std::runtime_error(fmt::format("unknown family '{}'; similar names: {}; 'arhost marker --help' lists all",
                                         name, fmt::join(names, ", ")));
}

Family read_pattern(const std::string &file, double ratio) {
    const cv::Mat_<float> luma = fiducial::read_pattern(file);
    Picture picture{ratio, luma.rows, {}};
    std::ranges::transform(luma, std::back_inserter(picture.grey),
                           [](float grey) { return static_cast<std::uint8_t>(std::lround(grey)); });
    return {std::filesystem::path(file).filename(), false,           1,      1, 1,
            [](int) { return std::vector{true}; },  artoolkit_quiet, picture};
}

std::vector<int> parse_ids(std::string_view text, const Family &family) {
    std::vector<int> ids;
    const auto id_in = [&](std::string_view word) {
        double id = -1;
        const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), id);
        if (error != std::errc() || end != word.data() + word.size() || !(id >= 0 && id == std::floor(id)))
            throw std::runtime_error(
                fmt::format("ids '{}': write numbers and ranges, such as {}:7,9,12-20", text, family.name));
        if (id >= family.count)
            throw std::runtime_error(
                fmt::format("{} has the ids 0 to {}, not {}", family.name, family.count - 1, word));
        return static_cast<int>(id);
    };
    for (std::size_t at = 0; at <= text.size();) {
        const std::string_view part = text.substr(at, text.find(',', at) - at);
        const std::size_t dash = part.find('-');
        const int first = id_in(part.substr(0, dash));
        const int last = dash == std::string_view::npos ? first : id_in(part.substr(dash + 1));
        if (last < first)
            throw std::runtime_error(fmt::format("ids '{}': the range {} ends before it begins", text, part));
        for (int id = first; id <= last; ++id)
            ids.push_back(id);
        at += part.size() + 1;
    }
    return ids;
}

} // namespace arhost::marker
