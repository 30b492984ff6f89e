// SPDX-License-Identifier: Apache-2.0
#include "calibrate/board.hpp"

#include <fiducial/aruco.hpp>

#include <fmt/format.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <stdexcept>

namespace arhost::calibrate {
namespace {

const aruco::DictionaryType &dictionary_type(const std::string &name) {
    const auto type = std::ranges::find(aruco::dictionary_types, name, &aruco::DictionaryType::option);
    if (type == aruco::dictionary_types.end()) {
        std::string names;
        for (const auto &known : aruco::dictionary_types)
            names += (names.empty() ? "" : ", ") + std::string(known.option);
        throw std::runtime_error(fmt::format("--dictionary: unknown dictionary '{}'; use one of {}", name, names));
    }
    return *type;
}

// Moves each corner to the place where the edges of its four squares meet. `clear_mm`: distance from a corner to the
// nearest other edge. OpenCV's ChArUco detector also refines, but only to 0.1 px. Returns which corners were refined.
// Other corners are too near to the border of the image, or too far from the expected place.
std::vector<bool> refine(const cv::Mat &grey, View &view, double clear_mm) {
    std::vector<bool> is_refined(view.board_mm.size());
    std::vector<cv::Point2f> board(view.board_mm.size());
    std::ranges::transform(view.board_mm, board.begin(), [](const auto &p) { return cv::Point2f(p.x, p.y); });
    const cv::Mat image_from_board = cv::findHomography(board, view.image_px);
    if (image_from_board.empty())
        return is_refined;
    const auto clear = static_cast<float>(clear_mm);
    for (std::size_t i = 0; i < board.size(); ++i) {
        const cv::Point2f centre = board[i];
        std::vector<cv::Point2f> near{centre, centre + cv::Point2f(clear, 0), centre - cv::Point2f(clear, 0),
                                      centre + cv::Point2f(0, clear), centre - cv::Point2f(0, clear)};
        cv::perspectiveTransform(near, near, image_from_board);
        const cv::Point2f at = view.image_px[i];
        double radius = std::min({at.x - 1.0, at.y - 1.0, grey.cols - at.x - 2.0, grey.rows - at.y - 2.0, 11.0});
        for (std::size_t k = 1; k < near.size(); ++k)
            radius = std::min(radius, std::max(cv::norm(near[k] - near[0]), 2.0));
        const int half = static_cast<int>(radius);
        if (half < 2)
            continue;
        std::vector<cv::Point2f> corner{at};
        cv::cornerSubPix(grey, corner, {half, half}, {-1, -1},
                         {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 0.001});
        is_refined[i] = corner[0] != at; // the result equals the initial position if that is too far from the corner
        view.image_px[i] = corner[0];
    }
    return is_refined;
}

} // namespace

Board::Board(const BoardOptions &options)
    : options_(options), corner_columns_(options.columns - (options.is_charuco ? 1 : 0)),
      corner_rows_(options.rows - (options.is_charuco ? 1 : 0)) {
    const int corners = corner_columns_ * corner_rows_;
    fewest_corners_ = static_cast<std::size_t>(options.is_charuco ? std::min(corners, 6) : corners);
    if (!options.is_charuco)
        return;
    const aruco::DictionaryType &type = dictionary_type(options.dictionary);
    dictionary_ = aruco::predefined(type.name);
    const int count = options.columns * options.rows / 2, available = dictionary_.bytesList.rows;
    if (options.first_id + count > available)
        throw std::runtime_error(fmt::format("--charuco {}x{}: the board needs {} ids from {} on, but {} has only "
                                             "the ids 0 to {}",
                                             options.columns, options.rows, count, options.first_id,
                                             options.dictionary, available - 1));
    if (options.marker_mm >= options.square_mm)
        throw std::runtime_error(fmt::format("--marker {}: a marker must be smaller than its square of {} mm",
                                             options.marker_mm, options.square_mm));
    std::vector<int> ids(static_cast<std::size_t>(count));
    std::iota(ids.begin(), ids.end(), options.first_id);
    const auto square = static_cast<float>(options.square_mm), marker = static_cast<float>(options.marker_mm);
#if ARHOST_OPENCV_HAS_ARUCO_DETECTOR
    charuco_ = cv::makePtr<cv::aruco::CharucoBoard>(cv::Size(options.columns, options.rows), square, marker,
                                                    dictionary_, ids);
#else
    charuco_ = cv::aruco::CharucoBoard::create(options.columns, options.rows, square, marker,
                                               cv::makePtr<cv::aruco::Dictionary>(dictionary_));
    charuco_->ids = ids;
#endif
}

std::string Board::description() const {
    if (!options_.is_charuco)
        return fmt::format("chessboard with {} x {} inner corners, squares of {} mm", options_.columns, options_.rows,
                           options_.square_mm);
    return fmt::format("ChArUco board of {} x {} squares of {} mm, markers of {} mm, {} from id {} on",
                       options_.columns, options_.rows, options_.square_mm, options_.marker_mm, options_.dictionary,
                       options_.first_id);
}

std::vector<cv::Point2f> Board::find_chessboard(const cv::Mat &grey, std::vector<int> &ids) const {
    // findChessboardCorners takes more than 10 s if a part of the board is outside of the image.
    constexpr double enough_px = 1600; // the corners are refined in the full image
    const double scale = std::min(1.0, enough_px / std::max(grey.cols, grey.rows));
    cv::Mat small = grey;
    if (scale < 1)
        cv::resize(grey, small, {}, scale, scale, cv::INTER_AREA);
    std::vector<cv::Point2f> corners;
    if (!cv::findChessboardCornersSB(small, {corner_columns_, corner_rows_}, corners, cv::CALIB_CB_NORMALIZE_IMAGE))
        return {};
    const cv::Point2d factor(static_cast<double>(grey.cols) / small.cols,
                             static_cast<double>(grey.rows) / small.rows);
    for (cv::Point2f &corner : corners)
        corner = cv::Point2d((corner.x + 0.5) * factor.x - 0.5, (corner.y + 0.5) * factor.y - 0.5);
    ids.resize(corners.size());
    std::iota(ids.begin(), ids.end(), 0);
    return corners;
}

std::vector<cv::Point2f> Board::find_charuco(const cv::Mat &grey, std::vector<int> &ids) const {
    std::vector<cv::Point2f> corners;
#if ARHOST_OPENCV_HAS_ARUCO_DETECTOR
    cv::aruco::CharucoDetector(*charuco_).detectBoard(grey, corners, ids);
#else
    const aruco::DetectedMarkers found = aruco::detect(grey, dictionary_, {});
    if (!found.ids.empty())
        cv::aruco::interpolateCornersCharuco(found.corners, found.ids, grey, charuco_, corners, ids);
#endif
    return corners;
}

std::optional<View> Board::find(const cv::Mat &grey) const {
    std::vector<int> ids;
    View view;
    view.image_px = options_.is_charuco ? find_charuco(grey, ids) : find_chessboard(grey, ids);
    if (ids.size() < fewest_corners_)
        return std::nullopt;
    for (const int id : ids) {
        const int column = id % corner_columns_, row = id / corner_columns_;
        view.board_mm.emplace_back(static_cast<float>(column * options_.square_mm),
                                   static_cast<float>(row * options_.square_mm), 0.0F);
    }
    const std::vector<bool> is_refined = refine(
        grey, view, options_.is_charuco ? (options_.square_mm - options_.marker_mm) / 2 : options_.square_mm * 0.45);
    if (!options_.is_charuco)
        return view;
    View refined;
    std::set<float> columns, rows;
    for (std::size_t i = 0; i < ids.size(); ++i)
        if (is_refined[i]) {
            refined.board_mm.push_back(view.board_mm[i]);
            refined.image_px.push_back(view.image_px[i]);
            columns.insert(view.board_mm[i].x);
            rows.insert(view.board_mm[i].y);
        }
    // Corners on one line do not determine a pose.
    if (refined.board_mm.size() < fewest_corners_ || columns.size() < 2 || rows.size() < 2)
        return std::nullopt;
    return refined;
}

std::string Board::seen_instead(const cv::Mat &grey) const {
    std::string best;
    std::size_t most = 2; // a detection of one or two markers of another dictionary may be wrong
    for (const aruco::DictionaryType &type : aruco::dictionary_types)
        if (const std::size_t count = aruco::detect(grey, aruco::predefined(type.name), {}).ids.size();
            count > most) {
            most = count;
            best = fmt::format("{} markers of {}", count, type.option);
        }
    if (!best.empty())
        return best;
    std::vector<cv::Point2f> corners;
    cv::Mat squares;
    if (cv::findChessboardCornersSB(grey, {5, 4}, corners, cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_LARGER,
                                    squares))
        return fmt::format("a chessboard with about {} x {} inner corners", std::max(squares.cols, squares.rows),
                           std::min(squares.cols, squares.rows));
    return "";
}

double edge_width_px(const cv::Mat &grey, const View &view) {
    constexpr int half = 8;
    std::vector<double> widths;
    for (const cv::Point2f &corner : view.image_px) {
        const cv::Rect around(cvRound(corner.x) - half, cvRound(corner.y) - half, 2 * half + 1, 2 * half + 1);
        cv::Mat patch, dx, dy, slope;
        cv::GaussianBlur(grey(around & cv::Rect(0, 0, grey.cols, grey.rows)), patch, {3, 3}, 0.5); // against noise
        if (patch.rows < half || patch.cols < half)
            continue;
        cv::Sobel(patch, dx, CV_32F, 1, 0, 1, 0.5);
        cv::Sobel(patch, dy, CV_32F, 0, 1, 1, 0.5);
        cv::magnitude(dx, dy, slope);
        double darkest = 0, brightest = 0, steepest = 0;
        cv::minMaxLoc(patch, &darkest, &brightest);
        cv::minMaxLoc(slope, nullptr, &steepest);
        widths.push_back((brightest - darkest) / std::max(steepest, 1e-3));
    }
    if (widths.empty())
        return INFINITY;
    std::ranges::nth_element(widths, widths.begin() + static_cast<std::ptrdiff_t>(widths.size() / 2));
    return widths[widths.size() / 2];
}

} // namespace arhost::calibrate
