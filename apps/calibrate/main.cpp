// SPDX-License-Identifier: Apache-2.0
//
// arhost-calibrate calibrates cameras (docs/calibration.md). `arhost calibrate` runs it, because the host itself
// links no OpenCV.
#include "base/atomic_file.hpp"
#include "base/file_identity.hpp"
#include "base/program.hpp"
#include "base/text.hpp"
#include "base/write_all.hpp"
#include "calibrate/input.hpp"
#include "calibrate/picture.hpp"
#include "command_line/command_line.hpp"

#include <fmt/format.h>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>

namespace {

using namespace arhost::calibrate;
namespace base = arhost::base;
namespace fs = std::filesystem;

enum ExitStatus { success = 0, failed = 2 };

struct Arguments {
    std::vector<fs::path> images;
    fs::path video, output, coverage;
    std::string camera, dictionary, model = "brown";
    std::array<std::uint32_t, 2> charuco{}, chessboard{}, size{}; // 0 if not given
    std::optional<double> square_mm, marker_mm;
    unsigned max_views = 40;
    bool accept_poor_coverage = false, no_window = false;
};

void reject(bool wrong, const std::string &message) {
    if (wrong)
        throw std::runtime_error(message);
}

BoardOptions board_of(const Arguments &arguments) {
    const bool is_charuco = arguments.charuco[0] > 0;
    reject(is_charuco == (arguments.chessboard[0] > 0), "give the board: either --charuco or --chessboard");
    reject(!arguments.square_mm, "--square is missing: the side of a square in mm");
    reject(is_charuco && !arguments.marker_mm, "--charuco needs --marker, in mm");
    reject(is_charuco && arguments.dictionary.empty(), "--charuco needs --dictionary, such as DICT_6X6_250");
    reject(!is_charuco && (arguments.marker_mm || !arguments.dictionary.empty()),
           "--marker and --dictionary need --charuco");
    const auto &counts = is_charuco ? arguments.charuco : arguments.chessboard;
    BoardOptions board{is_charuco,
                       static_cast<int>(counts[0]),
                       static_cast<int>(counts[1]),
                       *arguments.square_mm,
                       arguments.marker_mm.value_or(0),
                       arguments.dictionary,
                       0};
    // As in `arhost marker`, a number after the name is the id of the first marker.
    if (const std::size_t colon = board.dictionary.find(':'); colon != std::string::npos) {
        const char *begin = board.dictionary.data() + colon + 1,
                   *end = board.dictionary.data() + board.dictionary.size();
        const auto [last, error] = std::from_chars(begin, end, board.first_id);
        reject(error != std::errc() || last != end || board.first_id < 0,
               fmt::format("--dictionary {}: write the id of the board's first marker as a number, such as "
                           "DICT_6X6_250:17",
                           arguments.dictionary));
        board.dictionary.resize(colon);
    }
    return board;
}

void expect_consistent(const Arguments &arguments) {
    const int inputs =
        (arguments.images.empty() ? 0 : 1) + (arguments.video.empty() ? 0 : 1) + (arguments.camera.empty() ? 0 : 1);
    reject(inputs != 1, "give one input: --images, --video or --camera");
    reject(arguments.size[0] > 0 && arguments.camera.empty(), "--size needs --camera");
    const std::string kind = arguments.output.extension();
    reject(kind != ".yaml" && kind != ".yml",
           fmt::format("{}: the file's name must end in .yaml, such as camera.yaml", arguments.output.string()));
    reject(!arguments.coverage.empty() && arguments.coverage.extension() != ".png",
           fmt::format("--coverage {}: the file's name must end in .png", arguments.coverage.string()));
    for (const fs::path &image : arguments.images)
        reject(!arguments.coverage.empty() && base::real_path(image) == base::real_path(arguments.coverage),
               fmt::format("--coverage {}: would overwrite an input", arguments.coverage.string()));
}

Views views_of(const Reading &reading, const Arguments &arguments, const Board &board, Model model) {
    if (!arguments.video.empty())
        return views_of_video(reading, arguments.video, board, model, arguments.max_views);
    if (!arguments.camera.empty())
        return views_of_camera(reading,
                               {arguments.camera,
                                {static_cast<int>(arguments.size[0]), static_cast<int>(arguments.size[1])},
                                !arguments.no_window},
                               board, model, arguments.max_views);
    Views found = views_of_images(reading, arguments.images, board);
    if (found.views.size() > arguments.max_views) {
        std::vector<View> chosen;
        for (const std::size_t index :
             select(found.views, found.image, assumed_lens(found.image), arguments.max_views))
            chosen.push_back(found.views[index]);
        found.summary = fmt::format("{} of the {} views chosen (--max-views)", chosen.size(), found.views.size());
        found.views = std::move(chosen);
    }
    return found;
}

std::string report(const Views &found, const Calibration &calibration, const Coverage &coverage) {
    std::string text;
    const auto line = [&]<class... Values>(fmt::format_string<Values...> format, Values &&...values) {
        text += base::printable(fmt::format(format, std::forward<Values>(values)...)) + "\n";
    };
    for (const std::string &name : found.without_board)
        line("{}: the board is not visible", name);
    if (!found.summary.empty())
        line("{}", found.summary);
    std::size_t width = 4, corners = 0, left_out = 0;
    for (const View &view : found.views)
        width = std::max(width, view.name.size());
    line("{:<{}}  corners  error px  tilt about vertical, horizontal axis", "view", width);
    for (const UsedView &used : calibration.used) {
        line("{:<{}}  {:7}  {:8.2f}  {:18.0f}°, {:.0f}°", found.views[used.index].name, width, used.corners_px.size(),
             used.error_px, used.tilt.about_vertical_degrees, used.tilt.about_horizontal_degrees);
        corners += used.corners_px.size();
        left_out += used.left_out;
    }
    for (const DroppedView &dropped : calibration.dropped)
        line("{:<{}}  {:7}  {:8.2f}  left out: the error is far above the other views'",
             found.views[dropped.index].name, width, found.views[dropped.index].image_px.size(), dropped.error_px);
    if (left_out > 0)
        line("{} left out: the error is far above that of other corners", base::count_of(left_out, "corner"));
    const auto &matrix = calibration.lens.matrix;
    const auto &deviations = calibration.deviations_px;
    line("RMS error: {:.3f} px ({} corners of {} views)", calibration.error_px, corners, calibration.used.size());
    line("focal length: fx {:.2f} ± {:.2f} px, fy {:.2f} ± {:.2f} px", matrix(0, 0), deviations[0], matrix(1, 1),
         deviations[1]);
    line("principal point: cx {:.2f} ± {:.2f} px, cy {:.2f} ± {:.2f} px", matrix(0, 2), deviations[2], matrix(1, 2),
         deviations[3]);
    line("distortion ({}): {:.5g}", calibration.lens.model == Model::fisheye ? "fisheye" : "brown",
         fmt::join(calibration.lens.coefficients, ", "));
    line(
        "coverage: {:.0f} % of the image; tilts {:.0f}° to {:.0f}° about the vertical axis, {:.0f}° to {:.0f}° about "
        "the horizontal axis",
        100 * coverage.fraction(), coverage.lowest().about_vertical_degrees,
        coverage.highest().about_vertical_degrees, coverage.lowest().about_horizontal_degrees,
        coverage.highest().about_horizontal_degrees);
    return text;
}

std::string yaml_of(const Views &found, const Calibration &calibration, const Board &board) {
    cv::FileStorage file(".yaml", cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
    std::vector<double> errors;
    for (const UsedView &used : calibration.used)
        errors.push_back(used.error_px);
    const auto &deviations = calibration.deviations_px;
    file << "image_width" << found.image.width << "image_height" << found.image.height;
    file << "camera_matrix" << cv::Mat(calibration.lens.matrix);
    file << "distortion_model" << (calibration.lens.model == Model::fisheye ? "fisheye" : "brown");
    file << "distortion_coefficients" << cv::Mat(calibration.lens.coefficients).reshape(1, 1);
    file << "avg_reprojection_error" << calibration.error_px;
    file << "per_view_reprojection_errors" << cv::Mat(errors);
    file << "standard_deviations" << std::vector<double>(deviations.begin(), deviations.end()); // fx, fy, cx, cy
    file << "board" << board.description();
    return file.releaseAndGetString();
}

// Returns the text for stdout. Writes no calibration if it throws.
std::string calibrate(const Arguments &arguments, int signals) {
    const Board board(board_of(arguments));
    expect_consistent(arguments);
    const Model model = arguments.model == "fisheye" ? Model::fisheye : Model::brown;
    base::AtomicFile output(arguments.output, signals), picture(arguments.coverage, signals);
    arhost::plugin_tools::Workers workers;
    const Views found = views_of({workers, signals}, arguments, board, model);
    if (found.views.empty())
        throw std::runtime_error(fmt::format(
            "{}; expected a {}{}",
            found.summary.empty() ? "the board is in no image"
                                  : "no view was taken; hold the board still in each one (" + found.summary + ")",
            board.description(), found.seen_instead.empty() ? "" : ", but the images show " + found.seen_instead));
    const Calibration calibration = arhost::calibrate::calibrate(found.views, found.image, model);
    const Coverage coverage(calibration);
    const std::string text = report(found, calibration, coverage);
    const std::vector<std::string> missing = coverage.missing();

    const double largest_error_px = std::max(2.0, 0.003 * std::hypot(found.image.width, found.image.height));
    const bool is_wrong = !(calibration.error_px < largest_error_px);
    const bool is_refused = is_wrong || (!missing.empty() && !arguments.accept_poor_coverage);
    if (is_refused)
        std::fputs(text.c_str(), stdout);
    // Draws refused views, too, because the picture shows what is missing.
    if (!arguments.coverage.empty()) {
        std::vector<unsigned char> png;
        cv::imencode(".png", coverage_picture(found.views, calibration, coverage), png,
                     {cv::IMWRITE_PNG_COMPRESSION, 9});
        picture.write({png.begin(), png.end()});
    }
    reject(is_wrong, fmt::format("an error of {:.1f} px is too large for any lens; expected a {}, flat and rigid, in "
                                 "which the columns and rows are not swapped",
                                 calibration.error_px, board.description()));
    if (is_refused)
        throw std::runtime_error(fmt::format("the views do not determine the lens well: {} (or use "
                                             "--accept-poor-coverage)",
                                             fmt::join(missing, "; ")));
    if (!missing.empty())
        std::fprintf(stderr, "warning: the views do not determine the lens well: %s\n",
                     fmt::format("{}", fmt::join(missing, "; ")).c_str());
    output.write(yaml_of(found, calibration, board));
    return text + base::printable(arguments.output.string()) + " written\n";
}

} // namespace

int main(int argc, char **argv) {
    arhost::base::prepare_process();
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    arhost::command_line::CommandLine app("Calibrates a camera with a board, and writes YAML for camera.file. See "
                                          "docs/calibration.md.\n"
                                          "Exit status: 0 success; 2 failure, without a calibration.",
                                          "arhost calibrate");
    Arguments arguments;
    app.option("--images", arguments.images, "Images of the board, 10 or more").type_name("FILE");
    app.option("--video", arguments.video, "Video of the board; the best views are chosen").type_name("FILE");
    app.option("--camera", arguments.camera,
               "Camera, such as /dev/video0 or rtsp://HOST/1; prints which view to show next")
        .type_name("DEVICE");
    app.option("--size", arguments.size, "Size of the camera's images in px (default: the camera's)")
        .separator('x')
        .type_name("WIDTHxHEIGHT")
        .range(1, 16384);
    app.option("--charuco", arguments.charuco, "ChArUco board, as a number of squares, as in arhost marker")
        .separator('x')
        .type_name("COLUMNSxROWS")
        .range(3, 200);
    app.option("--chessboard", arguments.chessboard,
               "Chessboard, as a number of inner corners: 9x6 for 10 x 7 squares")
        .separator('x')
        .type_name("COLUMNSxROWS")
        .range(3, 200);
    const auto add_length = [&](const char *name, auto &value, const char *help) {
        app.option(name, value, help).type_name("MM").range(0.1, 10000.0);
    };
    add_length("--square", arguments.square_mm, "Side of a square");
    add_length("--marker", arguments.marker_mm, "Side of a marker of --charuco");
    app.option("--dictionary", arguments.dictionary,
               "Dictionary of --charuco, such as DICT_6X6_250; with a first id other than 0: DICT_6X6_250:17")
        .type_name("NAME");
    app.option("-o,--output", arguments.output, "Calibration to write, such as camera.yaml")
        .type_name("FILE")
        .required();
    app.option("--coverage", arguments.coverage, "Also draw the corners of all views and their errors, as .png")
        .type_name("FILE");
    app.option("--model", arguments.model, "Lens model: brown with k1 k2 p1 p2 k3, or fisheye with k1 k2 k3 k4")
        .one_of({"brown", "fisheye"})
        .show_default();
    app.option("--max-views", arguments.max_views, "Use at most this number of views").range(10, 200).show_default();
    app.flag("--accept-poor-coverage", arguments.accept_poor_coverage,
             "Write the calibration even if parts of the image or tilts are missing");
    app.flag("--no-window", arguments.no_window, "Do not show the images of --camera");
    if (const auto status = app.parse(argc, argv))
        return base::flush_stdout() ? *status : failed;
    try {
        std::fputs(calibrate(arguments, base::watch_signals().get()).c_str(), stdout);
        return base::flush_stdout() ? success : failed;
    } catch (const base::Interrupted &interrupted) {
        base::end_by_signal(interrupted.signal);
    } catch (const std::exception &error) {
        base::flush_stdout();
        std::fprintf(stderr, "error: %s\n", base::printable(error.what()).c_str());
        return failed;
    }
}
