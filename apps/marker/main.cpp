// SPDX-License-Identifier: Apache-2.0
//
// arhost-marker prints markers in their true size (docs/markers.md). `arhost marker` runs it, because the host itself
// links no OpenCV and draws nothing.
#include "base/atomic_file.hpp"
#include "base/file_identity.hpp"
#include "base/program.hpp"
#include "base/text.hpp"
#include "base/write_all.hpp"
#include "command_line/command_line.hpp"
#include "drawing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <numeric>
#include <optional>
#include <string_view>
#include <vector>

namespace {

using namespace arhost::marker;
namespace base = arhost::base;
namespace fs = std::filesystem;

enum ExitStatus { success = 0, failed = 2 };

struct Arguments {
    std::string markers, output, map, paper = "a4";
    std::optional<double> side_mm, gap_mm, square_mm, marker_mm, pattern_ratio;
    std::array<std::uint32_t, 2> grid{}, charuco{}; // columns, rows; 0 if not given
    double margin_mm = 10;
    unsigned dpi = 600;
    bool cut_marks = false;
};

// Parses the whole text as a number. NaN if it is not one.
double number_in(std::string_view text) {
    double number = NAN;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    return error == std::errc() && end == text.data() + text.size() ? number : NAN;
}

std::function<std::string(const std::string &)> length_from(double minimum_mm, double maximum_mm) {
    return [=](const std::string &text) {
        const double mm = number_in(text);
        return mm >= minimum_mm && mm <= maximum_mm
                   ? ""
                   : fmt::format("must be from {} to {} mm, is {}", minimum_mm, maximum_mm, text);
    };
}

// Returns the consecutive ids of a board: the given ids or, if only one is given, those that begin with it.
std::vector<int> board_ids(const Family &family, std::vector<int> ids, std::size_t count) {
    if (ids.size() == 1) {
        if (ids.front() + count > static_cast<std::size_t>(family.count))
            throw std::runtime_error(fmt::format("the board needs {} ids from {} on, but {} has only the ids 0 to {}",
                                                 count, ids.front(), family.name, family.count - 1));
        ids.resize(count);
        std::iota(ids.begin(), ids.end(), ids.front());
    }
    const auto is_consecutive = [&] {
        return std::ranges::adjacent_find(ids, [](int a, int b) { return b != a + 1; }) == ids.end();
    };
    if (ids.size() != count || !is_consecutive())
        throw std::runtime_error(
            fmt::format("the board needs {} consecutive ids; give only the first one, such as {}:{}", count,
                        family.name, ids.front()));
    return ids;
}

Paper paper_of(const Arguments &arguments) {
    struct Format {
        std::string_view name;
        double width_mm, height_mm;
    };
    for (const auto &[name, width, height] : {Format{"a4", 210, 297}, {"a3", 297, 420}, {"letter", 215.9, 279.4}})
        if (arguments.paper == name)
            return {width, height, arguments.margin_mm};
    const std::string_view text = arguments.paper;
    const std::size_t x = text.find('x');
    const double width = number_in(text.substr(0, x)),
                 height = number_in(text.substr(std::min(x, text.size() - 1) + 1));
    if (!(width >= 30 && height >= 30 && width <= 2000 && height <= 2000)) // the comparisons reject NaN
        throw std::runtime_error(
            fmt::format("--paper {}: use a4, a3, letter, or WIDTHxHEIGHT in mm, each from 30 to 2000", text));
    return {width, height, arguments.margin_mm};
}

bool is_pattern(const Arguments &arguments) {
    return fs::path(arguments.markers).extension() == ".patt";
}

void expect_consistent(const Arguments &arguments) {
    const bool is_grid = arguments.grid[0] > 0, is_charuco = arguments.charuco[0] > 0;
    const auto reject = [](bool wrong, const char *message) {
        if (wrong)
            throw std::runtime_error(message);
    };
    reject(!is_pattern(arguments) && arguments.pattern_ratio,
           "--pattern-ratio needs a pattern file of ARToolKit, such as hiro.patt");
    reject(is_pattern(arguments) && (is_grid || is_charuco),
           "--grid and --charuco need a family of markers; print the patterns one by one");
    reject(is_grid && is_charuco, "--grid and --charuco exclude each other; remove one of them");
    reject(is_charuco && arguments.side_mm,
           "--side does not apply to --charuco; set the marker's side with --marker");
    reject(is_charuco && !(arguments.square_mm && arguments.marker_mm),
           "--charuco needs --square and --marker, in mm");
    reject(!is_charuco && (arguments.square_mm || arguments.marker_mm), "--square and --marker need --charuco");
    reject(!is_charuco && !arguments.side_mm, "--side is missing: the side of a marker in mm");
    reject(!is_grid && arguments.gap_mm, "--gap needs --grid");
    reject(!is_grid && !is_charuco && !arguments.map.empty(), "--map needs a board: --grid or --charuco");
    reject(!arguments.map.empty() && fs::path(arguments.map).extension() != ".yaml",
           "--map: the file's name must end in .yaml, such as board.map.yaml");
}

// Returns the boards or markers to print, all of the same size.
std::vector<Item> items_of(const Arguments &arguments, const Family &family, const std::vector<int> &ids) {
    const auto [columns, rows] = arguments.grid;
    const auto [squares_x, squares_y] = arguments.charuco;
    const auto as_int = [](std::uint32_t number) { return static_cast<int>(number); };
    if (squares_x > 0)
        return {charuco_board(family, board_ids(family, ids, squares_x * squares_y / 2), as_int(squares_x),
                              as_int(squares_y), *arguments.square_mm, *arguments.marker_mm)};
    if (columns > 0)
        return {grid_board(family, board_ids(family, ids, columns * rows), as_int(columns), as_int(rows),
                           *arguments.side_mm, arguments.gap_mm.value_or(*arguments.side_mm * family.quiet))};
    std::vector<Item> items(ids.size());
    std::ranges::transform(ids, items.begin(), [&](int id) { return single_marker(family, id, *arguments.side_mm); });
    return items;
}

struct File {
    fs::path path;
    std::string bytes;
};
struct Result {
    std::vector<File> files;
    std::string summary;
};

Result draw(const Arguments &arguments) {
    const fs::path output = arguments.output;
    const std::string kind = output.extension();
    if (kind != ".pdf" && kind != ".svg" && kind != ".png")
        throw std::runtime_error(arguments.output + ": the file's name must end in .pdf, .svg or .png");
    expect_consistent(arguments);
    const Paper paper = paper_of(arguments);
    const std::size_t colon = is_pattern(arguments) ? std::string::npos : arguments.markers.find(':');
    const Family family = is_pattern(arguments)
                              ? read_pattern(arguments.markers, arguments.pattern_ratio.value_or(0.5))
                              : find_family(arguments.markers.substr(0, colon));
    const bool is_board = arguments.grid[0] > 0 || arguments.charuco[0] > 0;
    if (colon == std::string::npos && !is_board && !is_pattern(arguments))
        throw std::runtime_error(fmt::format("'{0}' names no ids; write for example {0}:0-9", arguments.markers));
    const std::string ids = colon == std::string::npos ? "0" : arguments.markers.substr(colon + 1);
    const std::vector<Item> items = items_of(arguments, family, parse_ids(ids, family));
    const Document document = lay_out(items, paper, arguments.cut_marks);
    const std::size_t count = document.pages.size();
    std::vector<File> files;
    if (kind == ".pdf")
        files.push_back({output, as_pdf(document, family, is_board ? items.front().label : arguments.markers)});
    for (std::size_t i = 0; i < count && kind != ".pdf"; ++i) {
        fs::path path = output;
        if (count > 1) {
            const std::size_t digits = std::to_string(count).size();
            path.replace_filename(fmt::format("{}-{:0{}}{}", output.stem().string(), i + 1, digits, kind));
        }
        files.push_back(
            {path, kind == ".svg" ? as_svg(document, i, family) : as_png(document, i, family, arguments.dpi)});
    }
    if (!arguments.map.empty())
        files.push_back({arguments.map, map_of(items.front(), family)});
    return {files,
            fmt::format("{}: {} of {} x {} mm; print at 100 %", arguments.output, base::count_of(count, "page"),
                        mm_text(document.width_mm), mm_text(document.height_mm))};
}

// Writes all files. If this fails, removes the files that it has written, and throws.
void write(const std::vector<File> &files) {
    std::vector<std::unique_ptr<base::AtomicFile>> targets;
    targets.reserve(files.size());
    for (const File &file : files)
        targets.push_back(std::make_unique<base::AtomicFile>(file.path));
    std::size_t written = 0;
    try {
        for (; written < files.size(); ++written)
            targets[written]->write(files[written].bytes);
    } catch (...) {
        std::error_code ignored;
        for (std::size_t i = 0; i < written; ++i)
            if (const fs::path path = base::real_path(files[i].path); fs::is_regular_file(path, ignored))
                fs::remove(path, ignored);
        throw;
    }
}

} // namespace

int main(int argc, char **argv) {
    arhost::base::prepare_process();
    arhost::command_line::CommandLine app(
        fmt::format("Prints markers and boards in their true size. See docs/markers.md.\n"
                    "Families and dictionaries: {}.\n"
                    "Exit status: 0 success; 2 failure, without any output file.",
                    fmt::join(family_names(), ", ")),
        "arhost marker");
    Arguments arguments;
    app.option(
           "MARKERS", arguments.markers,
           "Family and ids, such as tag36h11:0-35 or DICT_6X6_250:7,9,12-20; for a board its first id, by default 0; "
           "or a pattern file of ARToolKit, such as hiro.patt")
        .required();
    const auto add_length = [&](const char *name, auto &value, double minimum_mm, const char *help) {
        return app.option(name, value, help).type_name("MM").check(length_from(minimum_mm, 1000));
    };
    add_length("--side", arguments.side_mm, 1, "Side of a marker, as trackers measure it");
    app.option("-o,--output", arguments.output,
               "File to write: .pdf, .svg or .png; several pages of .svg and .png are numbered")
        .type_name("FILE")
        .required();
    const auto add_counts = [&](const char *name, auto &counts, int minimum, const char *help) {
        app.option(name, counts, help).separator('x').type_name("COLUMNSxROWS").range(minimum, 200);
    };
    add_counts("--grid", arguments.grid, 1, "Print a board: a grid of markers");
    add_length("--gap", arguments.gap_mm, 0, "Gap between the markers of --grid (default: the smallest possible)");
    add_counts("--charuco", arguments.charuco, 2, "Print a ChArUco board, as a number of squares");
    add_length("--square", arguments.square_mm, 1, "Side of a square of --charuco");
    add_length("--marker", arguments.marker_mm, 1, "Side of a marker of --charuco");
    app.option("--pattern-ratio", arguments.pattern_ratio,
               "Side of the picture of a .patt file, relative to that of the black square (default: 0.5)")
        .range(0.1, 0.9);
    app.option("--map", arguments.map, "Also write the board's map, such as board.map.yaml").type_name("FILE");
    app.option("--paper", arguments.paper, "a4, a3, letter, or WIDTHxHEIGHT in mm; landscape if that saves pages")
        .type_name("FORMAT")
        .show_default();
    add_length("--margin", arguments.margin_mm, 0, "Margin of the paper").show_default();
    app.option("--dpi", arguments.dpi, "Resolution of .png").range(150, 2400).show_default();
    app.flag("--cut-marks", arguments.cut_marks, "Draw marks for cutting");
    if (const auto status = app.parse(argc, argv))
        return base::flush_stdout() ? *status : failed;
    try {
        const Result result = draw(arguments);
        write(result.files);
        std::printf("%s\n", base::printable(result.summary).c_str());
        return base::flush_stdout() ? success : failed;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "error: %s\n", base::printable(error.what()).c_str());
        return failed;
    }
}
