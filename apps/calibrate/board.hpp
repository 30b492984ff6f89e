// SPDX-License-Identifier: Apache-2.0
//
// Finds the corners of a ChArUco board or a chessboard in an image.
#pragma once

#include <fiducial/aruco.hpp>

#include <opencv2/core.hpp>
#if ARHOST_OPENCV_HAS_ARUCO_DETECTOR
#include <opencv2/objdetect/charuco_detector.hpp>
#else
#include <opencv2/aruco/charuco.hpp>
#endif

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace arhost::calibrate {

struct BoardOptions {
    bool is_charuco = false;
    int columns = 0, rows = 0; // squares of a ChArUco board, inner corners of a chessboard
    double square_mm = 0, marker_mm = 0;
    std::string dictionary; // of a ChArUco board, such as DICT_6X6_250
    int first_id = 0;       // id of the ChArUco board's first marker
};

// The corners of the board in one image.
struct View {
    std::string name;                  // file or number of the frame
    std::vector<cv::Point3f> board_mm; // x right and y down on the print, z = 0
    std::vector<cv::Point2f> image_px; // pixel centres at integers
};

class Board {
public:
    // Throws std::runtime_error if there is no such board.
    explicit Board(const BoardOptions &options);

    std::string description() const;
    // Returns std::nullopt if the image does not show the board, or too few of its corners.
    std::optional<View> find(const cv::Mat &grey) const;
    // For a message: describes another board that the image shows, such as "markers of DICT_4X4_50"; "" if there is
    // none.
    std::string seen_instead(const cv::Mat &grey) const;

private:
    std::vector<cv::Point2f> find_chessboard(const cv::Mat &grey, std::vector<int> &ids) const;
    std::vector<cv::Point2f> find_charuco(const cv::Mat &grey, std::vector<int> &ids) const;

    BoardOptions options_;
    int corner_columns_, corner_rows_;
    std::size_t fewest_corners_;
    cv::aruco::Dictionary dictionary_;
    cv::Ptr<cv::aruco::CharucoBoard> charuco_;
};

// Width in px of the edges at the view's corners, between black and white. It is 2 px in a sharp image; blur
// increases it.
double edge_width_px(const cv::Mat &grey, const View &view);

} // namespace arhost::calibrate
