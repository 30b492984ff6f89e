// SPDX-License-Identifier: Apache-2.0
#include "run_config/multi_marker.hpp"

#include "base/text.hpp"
#include "yaml/yaml.hpp"

#include <arhost/tracker.h>

#include <glm/matrix.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

namespace arhost::run_config {
namespace {

constexpr std::string_view blanks = " \t\r";

// The lines that are neither empty nor comments.
class Lines {
public:
    Lines(std::string file, std::string_view text) : file_(std::move(file)), text_(text) {}

    std::optional<std::string_view> next() {
        while (!text_.empty()) {
            const std::size_t end = text_.find('\n');
            std::string_view line = text_.substr(0, end);
            text_.remove_prefix(end == std::string_view::npos ? text_.size() : end + 1);
            ++number_;
            line.remove_prefix(std::min(line.find_first_not_of(blanks), line.size()));
            line = line.substr(0, line.find_last_not_of(blanks) + 1);
            if (!line.empty() && line.front() != '#')
                return line;
        }
        return std::nullopt;
    }
    std::string_view require(const std::string &expected) {
        const auto line = next();
        if (!line)
            fail("the file ends where " + expected + " is expected; complete it, or correct the number of markers");
        return *line;
    }
    std::string where() const { return file_ + ":" + std::to_string(number_); }
    [[noreturn]] void fail(const std::string &message) const { throw yaml::Error(where() + ": " + message); }

private:
    std::string file_;
    std::string_view text_;
    std::size_t number_ = 0; // number of the current line
};

// Parses numbers that are separated by blanks. Returns an empty list if the line contains anything else.
std::vector<double> numbers_in(std::string_view line) {
    std::vector<double> numbers;
    while (!line.empty()) {
        const std::size_t size = std::min(line.find_first_of(blanks), line.size());
        const std::string_view word =
            line.substr(line.starts_with('+') ? 1 : 0, line.starts_with('+') ? size - 1 : size);
        double number = 0;
        const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
        if (error != std::errc() || end != word.data() + word.size() || !(std::abs(number) <= 1e7))
            return {};
        numbers.push_back(number);
        line.remove_prefix(std::min(line.find_first_not_of(blanks, size), line.size()));
    }
    return numbers;
}

MultiMarker parse_marker(Lines &lines, const std::string &name) {
    MultiMarker marker;
    marker.print = lines.require(name);
    marker.where = lines.where();
    const auto quoted = [](std::string_view line) { return "'" + base::printable(line, 100) + "'"; };
    std::string_view line = lines.require("the width of " + name);
    const std::vector<double> width = numbers_in(line);
    if (width.size() != 1 || !(width[0] >= 0.01 && width[0] <= 1e6))
        lines.fail("the width of " + name + " must be a number from 0.01 to 1e+06, in mm, but is " + quoted(line));
    marker.side_mm = width[0];
    for (int row = 0; row < 3; ++row) {
        line = lines.require("the matrix of " + name);
        std::vector<double> numbers = numbers_in(line);
        if (row == 0 && numbers.size() == 2) { // in files of ARToolKit 2, this line contains the centre
            line = lines.require("the matrix of " + name);
            numbers = numbers_in(line);
        }
        if (numbers.size() != 4)
            lines.fail("row " + std::to_string(row + 1) + " of the matrix of " + name +
                       " must be 4 numbers, such as '1 0 0 35', but is " + quoted(line));
        for (int column = 0; column < 3; ++column)
            marker.rotation[column][row] = numbers[static_cast<std::size_t>(column)];
        marker.position_mm[row] = numbers[3];
    }
    constexpr double tolerance = 0.01;
    const glm::dmat3 product = glm::transpose(marker.rotation) * marker.rotation;
    for (int i = 0; i < 9; ++i)
        if (std::abs(product[i / 3][i % 3] - (i % 4 == 0)) > tolerance || glm::determinant(marker.rotation) < 0)
            lines.fail("the first three columns of the matrix of " + name +
                       " must be a rotation: perpendicular to each other, 1 long, and not mirrored");
    return marker;
}

} // namespace

void MultiMarker::fail(const std::string &message) const {
    throw yaml::Error(where + ": " + message);
}

bool is_multi_marker_file(std::string_view text) {
    const auto first = Lines("", text).next();
    return first && numbers_in(*first).size() == 1;
}

std::vector<MultiMarker> parse_multi_marker_file(const std::filesystem::path &file, std::string_view text) {
    Lines lines(file.string(), text);
    const std::string_view first = lines.require("the number of markers");
    const std::vector<double> count = numbers_in(first);
    if (count.size() != 1 ||
        !(count[0] >= 1 && count[0] <= int{ARHOST_MAX_MARKERS} && count[0] == std::floor(count[0])))
        lines.fail("the number of markers must be 1 to " + std::to_string(int{ARHOST_MAX_MARKERS}) + ", but is '" +
                   base::printable(first, 100) + "'");
    std::vector<MultiMarker> markers;
    for (int i = 1; i <= static_cast<int>(count[0]); ++i)
        markers.push_back(parse_marker(lines, "marker " + std::to_string(i)));
    if (lines.next())
        lines.fail("more follows after " + std::to_string(markers.size()) +
                   " markers; correct the number of markers at the beginning, or remove this");
    return markers;
}

} // namespace arhost::run_config
