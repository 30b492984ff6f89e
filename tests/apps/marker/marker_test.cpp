// SPDX-License-Identifier: Apache-2.0
//
// Prints sheets with arhost-marker and measures them with the libraries that the trackers use.
#include "fiducial/tracker_support.hpp"
#include "program_test.hpp"
#include "run_config/targets.hpp"

#include <directories.hpp>
#include <fiducial/april_tags.hpp>
#include <fiducial/artoolkit.hpp>
#include <fiducial/aruco.hpp>

#include <gmock/gmock.h>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <set>

namespace {

namespace fs = std::filesystem;
using arhost::apriltag::family_types;
using arhost::aruco::dictionary_types;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr double dpi = 600, tolerance_mm = 0.1;
constexpr double px_per_mm = dpi / 25.4;

// Top left, top right, bottom right, bottom left; in mm from the top left corner of the picture, y down.
using Corners = std::array<cv::Point2d, 4>;
using Found = std::map<int, Corners>;

Found april_tags(const std::string &name, const cv::Mat &picture) {
    const auto &type = *std::ranges::find(family_types, name, &arhost::apriltag::FamilyType::name);
    const std::unique_ptr<apriltag_family_t, decltype(type.destroy)> family(type.create(), type.destroy);
    const std::unique_ptr<apriltag_detector_t, decltype(&apriltag_detector_destroy)> detector(
        apriltag_detector_create(), apriltag_detector_destroy);
    apriltag_detector_add_family_bits(detector.get(), family.get(), 0);
    image_u8_t image{picture.cols, picture.rows, static_cast<int>(picture.step), picture.data};
    const std::unique_ptr<zarray_t, decltype(&apriltag_detections_destroy)> tags(
        apriltag_detector_detect(detector.get(), &image), apriltag_detections_destroy);
    Found found;
    for (int i = 0; i < zarray_size(tags.get()); ++i) {
        apriltag_detection_t *tag = nullptr;
        zarray_get(tags.get(), i, &tag);
        for (std::size_t k = 0; k < 4; ++k) // they begin at the bottom left and are counter-clockwise
            found[tag->id][k] = cv::Point2d(tag->p[3 - k][0], tag->p[3 - k][1]) / px_per_mm;
    }
    apriltag_detector_clear_families(detector.get());
    return found;
}

cv::aruco::Dictionary dictionary(const std::string &name) {
    const auto type = std::ranges::find(dictionary_types, name, &arhost::aruco::DictionaryType::option);
    return arhost::aruco::predefined(type->name);
}

arhost::aruco::DetectedMarkers detected(const std::string &name, const cv::Mat &picture) {
    cv::aruco::DetectorParameters parameters;
    parameters.cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
    parameters.minMarkerDistanceRate = 0.02;
    return arhost::aruco::detect(picture, dictionary(name), parameters);
}

Found aruco_markers(const std::string &name, const cv::Mat &picture) {
    Found found;
    const auto [ids, corners, rejected] = detected(name, picture);
    for (std::size_t i = 0; i < ids.size(); ++i)
        for (std::size_t k = 0; k < 4; ++k) // pixel centres are at integers
            found[ids[i]][k] = (cv::Point2d(corners[i][k]) + cv::Point2d(0.5, 0.5)) / px_per_mm;
    return found;
}

// Finds what tracker_pattern finds.
Found artoolkit_markers(const std::vector<arhost::test::Listed> &listed, const cv::Mat &picture) {
    arhost::test::Tracker tracker("tracker_pattern");
    if (tracker.start(arhost::test::plain_camera(picture.size()), listed) != ARHOST_STATUS_OK)
        throw std::runtime_error(tracker.log());
    Found found;
    for (const arhost_observation &seen : tracker.track(arhost::test::GreyFrame(picture)))
        for (std::size_t k = 0; k < 4; ++k) // pixel centres are at integers
            found[seen.id][k] =
                (cv::Point2d(seen.corners_px[k][0], seen.corners_px[k][1]) + cv::Point2d(0.5, 0.5)) / px_per_mm;
    return found;
}

Found markers(const std::string &name, const cv::Mat &picture) {
    if (const auto *family = arhost::fiducial::find_matrix_family(name)) {
        std::vector<arhost::test::Listed> listed;
        for (int id = 0; id < std::min(family->id_count, 64); ++id)
            listed.push_back({id, 12, name});
        return artoolkit_markers(listed, picture);
    }
    return name.starts_with("DICT_") ? aruco_markers(name, picture) : april_tags(name, picture);
}

std::set<int> ids_of(const Found &found) {
    std::set<int> ids;
    for (const auto &[id, corners] : found)
        ids.insert(id);
    return ids;
}

cv::Point2d centre_of(const Corners &corners) {
    return (corners[0] + corners[1] + corners[2] + corners[3]) / 4;
}

void expect_upright_squares(const Found &found, double side_mm) {
    for (const auto &[id, corners] : found) {
        const cv::Point2d centre = centre_of(corners);
        const double half = side_mm / 2;
        const Corners expected{centre + cv::Point2d(-half, -half), centre + cv::Point2d(half, -half),
                               centre + cv::Point2d(half, half), centre + cv::Point2d(-half, half)};
        for (std::size_t k = 0; k < 4; ++k) {
            EXPECT_NEAR(cv::norm(corners[(k + 1) % 4] - corners[k]), side_mm, tolerance_mm) << id;
            EXPECT_LT(cv::norm(corners[k] - expected[k]), tolerance_mm) << id << ", corner " << k;
        }
    }
}

// Returns the length of the longest black horizontal line in the lowest 20 mm of the page.
double ruler_mm(const cv::Mat &page) {
    int longest = 0;
    for (int y = page.rows - static_cast<int>(20 * px_per_mm); y < page.rows; ++y)
        for (int x = 0, length = 0; x < page.cols; ++x) {
            length = page.at<std::uint8_t>(y, x) < 128 ? length + 1 : 0;
            longest = std::max(longest, length);
        }
    return longest / px_per_mm;
}

class Marker : public arhost::test::ProgramTest {
protected:
    const std::string arhost_marker = program("arhost-marker");
    // Writes a pattern file of ARToolKit: grey levels from 20 on, and a white corner at the top left.
    fs::path write_pattern() const {
        const fs::path file = folder() / "hiro.patt";
        std::ofstream stream(file);
        for (int plane = 0; plane < 12; ++plane)
            for (int i = 0; i < 16; ++i)
                stream << (i == 0 ? 255 : 20 + 10 * i) << (i % 4 == 3 ? '\n' : ' ');
        return file;
    }
    cv::Mat picture(const fs::path &file) const { return cv::imread(folder() / file, cv::IMREAD_GRAYSCALE); }
    // Renders the first page of a PNG, PDF or SVG at 600 dpi.
    cv::Mat page(const std::string &file) const {
        if (file.ends_with(".png"))
            return picture(file);
        EXPECT_TRUE(succeeds(file.ends_with(".pdf") ? "pdftoppm -singlefile -r 600 -gray -png " + file + " rendered"
                                                    : "rsvg-convert -d 600 -p 600 -b white -o rendered.png " + file));
        return picture("rendered.png");
    }

    // Positions of markers in a map, in mm; y up.
    std::map<int, cv::Point2d> positions_in(const std::string &map, double side_mm) const {
        std::map<int, cv::Point2d> positions;
        std::vector<std::string> warnings;
        for (const auto &marker : arhost::run_config::read_map(folder() / map, warnings)) {
            const auto &corners = marker.corners_mm;
            const cv::Point2d top_left(corners[0][0], corners[0][1]), bottom_right(corners[2][0], corners[2][1]);
            EXPECT_NEAR(bottom_right.x - top_left.x, side_mm, 1e-9);
            EXPECT_NEAR(top_left.y - bottom_right.y, side_mm, 1e-9);
            EXPECT_EQ(corners[0][2], 0);
            positions[marker.id] = (top_left + bottom_right) / 2;
        }
        return positions;
    }
    // Expects the markers of a print where the map says, and returns the origin of the map on the page.
    static cv::Point2d expect_as_in_map(const Found &found, const std::map<int, cv::Point2d> &positions) {
        cv::Point2d origin;
        for (const auto &[id, at] : positions)
            if (found.contains(id))
                origin +=
                    (centre_of(found.at(id)) - cv::Point2d(at.x, -at.y)) / static_cast<double>(positions.size());
        EXPECT_EQ(found.size(), positions.size());
        for (const auto &[id, at] : positions) {
            if (!found.contains(id)) {
                ADD_FAILURE() << "marker " << id << " is not found";
                continue;
            }
            EXPECT_LT(cv::norm(centre_of(found.at(id)) - origin - cv::Point2d(at.x, -at.y)), tolerance_mm) << id;
        }
        return origin;
    }
};

bool is_installed(const char *program) {
    return std::system((std::string("command -v ") + program + " > /dev/null").c_str()) == 0;
}
#define ARHOST_REQUIRE_RENDERER(kind)                                                                                \
    if (const char *program = (kind) == std::string("pdf") ? "pdftoppm" : "rsvg-convert";                            \
        (kind) != std::string("png") && !is_installed(program))                                                      \
    GTEST_SKIP() << program << " is not installed (tools/packages.txt)"

std::vector<std::string> all_names() {
    std::vector<std::string> names;
    for (const auto &type : family_types)
        names.emplace_back(type.name);
    for (const auto &type : dictionary_types)
        if (!type.is_april_tag())
            names.emplace_back(type.option);
    return names;
}

class EveryFamily : public Marker, public testing::WithParamInterface<std::string> {};
INSTANTIATE_TEST_SUITE_P(Marker, EveryFamily, testing::ValuesIn(all_names()),
                         [](const auto &info) { return info.param; });

class EveryFormat : public Marker, public testing::WithParamInterface<const char *> {};
INSTANTIATE_TEST_SUITE_P(Marker, EveryFormat, testing::Values("pdf", "svg", "png"),
                         [](const auto &info) { return std::string(info.param); });

} // namespace

TEST_P(EveryFamily, IsPrintedUprightInItsTrueSize) {
    ASSERT_TRUE(succeeds(arhost_marker + GetParam() + ":0,3,29 --side 12 --paper 120x70 --margin 5 -o sheet.png"));
    const Found found = markers(GetParam(), picture("sheet.png"));
    EXPECT_THAT(ids_of(found), ElementsAre(0, 3, 29));
    expect_upright_squares(found, 12);
}

TEST_P(EveryFormat, HasMarkersInTheirTrueSize) {
    ARHOST_REQUIRE_RENDERER(GetParam());
    for (const auto &[name, side_mm] :
         {std::pair("tag36h11", 17.3), {"tagStandard41h12", 11.0}, {"DICT_5X5_100", 14.0}, {"artoolkit-3x3", 15.0}}) {
        const std::string file = std::string("sheet.") + GetParam();
        ASSERT_TRUE(succeeds(arhost_marker + std::string(name) + ":1-4 --side " + std::to_string(side_mm) +
                             " --paper 110x90 --margin 5 --cut-marks -o " + file));
        const Found found = markers(name, page(file));
        EXPECT_THAT(ids_of(found), ElementsAre(1, 2, 3, 4));
        expect_upright_squares(found, side_mm);
    }
}

TEST_F(Marker, PrintsTheMatrixCodesOfArToolKit) {
    for (const auto &family : arhost::fiducial::matrix_families()) {
        SCOPED_TRACE(family.name);
        ASSERT_TRUE(succeeds(arhost_marker + std::string(family.name) +
                             ":0,3,7 --side 12 --paper 120x70 --margin 5 -o sheet.png"));
        const Found found = markers(family.name, picture("sheet.png"));
        EXPECT_THAT(ids_of(found), ElementsAre(0, 3, 7));
        expect_upright_squares(found, 12);
    }
}

TEST_P(EveryFormat, HasPatternsOfArToolKit) {
    ARHOST_REQUIRE_RENDERER(GetParam());
    const std::string pattern = write_pattern(), file = std::string("sheet.") + GetParam();
    for (const auto &[option, ratio] : {std::pair("", 0.5), {" --pattern-ratio 0.7", 0.7}}) {
        ASSERT_TRUE(succeeds(arhost_marker + "hiro.patt --side 20 --paper 60x70 --margin 5 -o " + file + option));
        const cv::Mat page = this->page(file);
        const Found found = artoolkit_markers({{0, 20, "pattern", pattern, ratio}}, page);
        ASSERT_THAT(ids_of(found), ElementsAre(0));
        expect_upright_squares(found, 20);
        const cv::Point2d centre = centre_of(found.at(0));
        for (int i = 0; i < 16; ++i) {
            const double cell = 20 * ratio / 4;
            const cv::Point2d px = (centre + cell * cv::Point2d(i % 4 - 1.5, i / 4 - 1.5)) * px_per_mm;
            EXPECT_NEAR(page.at<std::uint8_t>(px), i == 0 ? 255 : 20 + 10 * i, 1) << i;
        }
    }
}

TEST_P(EveryFormat, HasARulerInItsTrueLength) {
    ARHOST_REQUIRE_RENDERER(GetParam());
    const std::string file = std::string("sheet.") + GetParam();
    for (const auto &[paper, length_mm] : {std::pair("130x60", 100), {"60x60", 40}}) {
        ASSERT_TRUE(succeeds(arhost_marker + "tag36h11:0 --side 12 --paper " + std::string(paper) + " -o " + file));
        EXPECT_NEAR(ruler_mm(page(file)), length_mm, tolerance_mm) << paper;
    }
}

TEST_P(EveryFormat, HasThePaperInItsTrueSize) {
    ARHOST_REQUIRE_RENDERER(GetParam());
    const std::string file = std::string("sheet.") + GetParam();
    ASSERT_TRUE(succeeds(arhost_marker + "tag36h11:0 --side 12 --paper 62.5x80 -o " + file));
    EXPECT_NEAR(page(file).cols / px_per_mm, 62.5, 0.05);
    EXPECT_NEAR(page(file).rows / px_per_mm, 80, 0.05);
}

TEST_P(EveryFormat, HasBoardsThatAgreeWithTheirMap) {
    ARHOST_REQUIRE_RENDERER(GetParam());
    const std::string file = std::string("board.") + GetParam();
    ASSERT_TRUE(succeeds(arhost_marker +
                         "tag25h9:10 --grid 4x3 --side 12 --gap 3 --paper 90x80 --margin 5 --map board.map.yaml -o " +
                         file));
    EXPECT_THAT(read("board.map.yaml"), HasSubstr("\nversion: 1\nfamily: tag25h9\nmarkers:\n  - {id: 10, "));
    const auto positions = positions_in("board.map.yaml", 12);
    EXPECT_EQ(positions.size(), 12u);
    EXPECT_EQ(positions.at(10), cv::Point2d(-22.5, 15));
    EXPECT_EQ(positions.at(21), cv::Point2d(22.5, -15));
    const Found found = markers("tag25h9", page(file));
    expect_as_in_map(found, positions);
    expect_upright_squares(found, 12);
}

TEST_F(Marker, PrintsBoardsOfMatrixCodesWithTheirMap) {
    ASSERT_TRUE(succeeds(arhost_marker + "artoolkit-4x4-bch-13-9-3:5 --grid 3x2 --side 12 --paper 90x80 --margin 5 "
                                         "--map board.map.yaml -o board.png"));
    EXPECT_THAT(read("board.map.yaml"), HasSubstr("\nversion: 1\nfamily: artoolkit-4x4-bch-13-9-3\n"));
    const auto positions = positions_in("board.map.yaml", 12);
    EXPECT_EQ(positions.at(5), cv::Point2d(-13.5, 6.75));
    expect_as_in_map(markers("artoolkit-4x4-bch-13-9-3", picture("board.png")), positions);
}

TEST_F(Marker, PrintsTheChArucoBoardsOfOpenCv) {
    for (const auto &[columns, rows] : {std::pair(5, 4), {4, 3}}) {
        const std::string size = std::to_string(columns) + "x" + std::to_string(rows);
        ASSERT_TRUE(succeeds(arhost_marker + "DICT_6X6_250 --charuco " + size +
                             " --square 14 --marker 10 --paper 100x90 --margin 5 -o board.png --map board.map.yaml"));
        EXPECT_THAT(read("board.map.yaml"), HasSubstr("\nversion: 1\ndictionary: DICT_6X6_250\n"));
        const cv::Mat picture = this->picture("board.png");
        const cv::Point2d origin =
            expect_as_in_map(markers("DICT_6X6_250", picture), positions_in("board.map.yaml", 10));

        const auto [ids, corners, rejected] = detected("DICT_6X6_250", picture);
        const auto board = cv::aruco::CharucoBoard::create(
            columns, rows, 14, 10, cv::makePtr<cv::aruco::Dictionary>(dictionary("DICT_6X6_250")));
        cv::Mat chess_corners, chess_ids;
        cv::aruco::interpolateCornersCharuco(corners, ids, picture, board, chess_corners, chess_ids);
        ASSERT_EQ(chess_ids.rows, (columns - 1) * (rows - 1));
        for (int i = 0; i < chess_ids.rows; ++i) {
            const int id = chess_ids.at<int>(i), column = id % (columns - 1), row = id / (columns - 1);
            const cv::Point2d expected = origin + 14 * cv::Point2d(column + 1 - columns / 2.0, row + 1 - rows / 2.0);
            const cv::Point2d at =
                (cv::Point2d(chess_corners.at<cv::Point2f>(i)) + cv::Point2d(0.5, 0.5)) / px_per_mm;
            EXPECT_LT(cv::norm(at - expected), tolerance_mm) << id;
        }
    }
}

TEST_F(Marker, PrintsTheSameTagForBothOfItsNames) {
    ASSERT_TRUE(succeeds(arhost_marker + "tag36h11:23 --side 12 --paper 60x60 -o a.png"));
    ASSERT_TRUE(succeeds(arhost_marker + "DICT_APRILTAG_36h11:23 --side 12 --paper 60x60 -o b.png"));
    EXPECT_EQ(read("a.png"), read("b.png"));
}

TEST_F(Marker, KeepsAQuietZoneOfOneCell) {
    // Cells of the print per side between the corners.
    for (const auto &[name, border_cells, cells] :
         {std::tuple("tag36h11", 8, 8), {"tagStandard41h12", 5, 9}, {"DICT_4X4_50", 6, 6}}) {
        ASSERT_TRUE(succeeds(arhost_marker + std::string(name) +
                             ":0-1 --side 12 --paper 100x70 --margin 5 --cut-marks -o sheet.png"));
        const cv::Mat page = picture("sheet.png");
        const Found found = markers(name, page);
        EXPECT_EQ(found.size(), 2u);
        for (const auto &[id, corners] : found) {
            const double cell = 12.0 / border_cells, inner = cells * cell / 2 + 0.1, outer = inner + cell - 0.2;
            const cv::Point2d centre = centre_of(corners);
            for (double along = -outer; along <= outer; along += 0.04)
                for (double away = inner; away <= outer; away += 0.04)
                    for (const cv::Point2d offset :
                         {cv::Point2d(along, away), {along, -away}, {away, along}, {-away, along}}) {
                        const cv::Point2d px = (centre + offset) * px_per_mm;
                        ASSERT_EQ(page.at<std::uint8_t>(static_cast<int>(px.y), static_cast<int>(px.x)), 255)
                            << name << " " << id << ": " << offset;
                    }
        }
    }
}

TEST_F(Marker, PlacesTheEdgesOfCellsAtWholePixels) {
    ASSERT_TRUE(succeeds(arhost_marker + "tag36h11:0 --side 17.3 --paper 60x60 -o sheet.png"));
    const cv::Mat page = picture("sheet.png");
    const cv::Point2d centre = centre_of(markers("tag36h11", page).at(0)) * px_per_mm;
    const int half = static_cast<int>(8.65 * px_per_mm) + 10;
    const cv::Mat marker =
        page(cv::Rect(static_cast<int>(centre.x) - half, static_cast<int>(centre.y) - half, 2 * half, 2 * half));
    EXPECT_EQ(cv::countNonZero((marker > 0) & (marker < 255)), 0);
}

TEST_F(Marker, WritesTheResolutionIntoAPng) {
    ASSERT_TRUE(succeeds(arhost_marker + "tag36h11:0 --side 12 --paper 60x60 --dpi 300 -o sheet.png"));
    const std::string bytes = read("sheet.png");
    const std::size_t at = bytes.find("pHYs");
    ASSERT_NE(at, std::string::npos);
    EXPECT_EQ(bytes.substr(at + 4, 9), std::string("\0\0\x2e\x23\0\0\x2e\x23\1", 9)) << "11811 pixels per metre";
    EXPECT_EQ(picture("sheet.png").cols, 709);
}

TEST_F(Marker, UsesSeveralPagesOfAPdf) {
    ARHOST_REQUIRE_RENDERER("pdf");
    ASSERT_TRUE(succeeds(arhost_marker + "tag36h11:0-35 --side 40 -o sheet.pdf"));
    EXPECT_EQ(printed(), "sheet.pdf: 3 pages of 210 x 297 mm; print at 100 %\n");
    ASSERT_TRUE(succeeds("pdftoppm -r 100 -gray -png sheet.pdf page"));
    EXPECT_THAT(files(), ElementsAre("page-1.png", "page-2.png", "page-3.png", "sheet.pdf"));
    std::set<int> ids;
    for (const char *page : {"page-1.png", "page-2.png", "page-3.png"}) {
        const std::set<int> found = ids_of(april_tags("tag36h11", picture(page)));
        EXPECT_EQ(found.size(), 12u);
        ids.insert(found.begin(), found.end());
    }
    EXPECT_EQ(ids.size(), 36u);
    EXPECT_EQ(*ids.rbegin(), 35);
}

TEST_F(Marker, NumbersTheFilesOfSeveralPages) {
    ASSERT_TRUE(succeeds(arhost_marker + "tag36h11:0-23 --side 12 --paper 100x70 --margin 5 -o sheet.svg"));
    ASSERT_TRUE(
        succeeds(arhost_marker + "tag36h11:0-140 --side 12 --paper 100x70 --margin 5 --dpi 150 -o sheet.png"));
    const std::vector<std::string> names = files();
    ASSERT_EQ(names.size(), 2u + 9u);
    EXPECT_EQ(names[0], "sheet-1.png");
    EXPECT_EQ(names[1], "sheet-1.svg");
    EXPECT_EQ(names[3], "sheet-2.svg");
}

TEST_F(Marker, TurnsThePaperIfThatSavesPages) {
    ASSERT_TRUE(succeeds(arhost_marker + "tag36h11:0-14 --side 40 -o sheet.pdf"));
    EXPECT_EQ(printed(), "sheet.pdf: 1 page of 297 x 210 mm; print at 100 %\n");
    ASSERT_TRUE(succeeds(arhost_marker + "tag36h11 --grid 6x4 --side 30 --gap 10 -o board.pdf"));
    EXPECT_THAT(printed(), HasSubstr("1 page of 297 x 210 mm"));
}

TEST_F(Marker, IsACommandOfArhost) {
    const std::string arguments = " tag36h11:7 --side 12 --paper 60x60 -o ";
    ASSERT_TRUE(succeeds(program("arhost") + "marker" + arguments + "a.png"));
    ASSERT_TRUE(succeeds(arhost_marker + arguments + "b.png"));
    EXPECT_EQ(read("a.png"), read("b.png"));
    EXPECT_EQ(execute(program("arhost") + "marker tag36h11:7 --side 0 -o c.png"), 2);
    EXPECT_TRUE(succeeds(program("arhost") + "help marker"));
    for (const char *text : {"Usage: arhost marker [OPTIONS] MARKERS", "tagStandard52h13", "DICT_ARUCO_ORIGINAL"})
        EXPECT_THAT(printed(), HasSubstr(text));
}

TEST_F(Marker, RunsTheCommandsOfItsDocumentation) {
    write_pattern();
    std::ifstream document(arhost::test::source_directory() + "/docs/markers.md");
    int count = 0;
    for (std::string line; std::getline(document, line);)
        if (line.starts_with("arhost marker ")) {
            EXPECT_TRUE(succeeds(arhost::test::build_directory() + "/bin/" + line)) << line;
            ++count;
        }
    EXPECT_GE(count, 4);
}

TEST_F(Marker, RejectsInvalidArgumentsWithoutWritingAFile) {
    const std::string board = "tag36h11 --grid 3x2 --side 12 -o a.pdf ",
                      charuco = "--charuco 5x4 --square 14 -o a.pdf ";
    const std::pair<std::string, const char *> cases[] = {
        {"tag36h12:0 --side 40 -o a.pdf", "unknown family 'tag36h12'; similar names: tag36h11, "},
        {"DICT_6x6_25:0 --side 40 -o a.pdf", "unknown family 'DICT_6x6_25'; similar names: DICT_6X6_250, "},
        {":0 --side 40 -o a.pdf", "unknown family ''"},
        {"tag36h11:587 --side 40 -o a.pdf", "tag36h11 has the ids 0 to 586, not 587"},
        {"DICT_4X4_50:0,48-50 --side 40 -o a.svg", "DICT_4X4_50 has the ids 0 to 49, not 50"},
        {"tag36h11:99999999999 --side 40 -o a.pdf", "has the ids 0 to 586, not 99999999999"},
        {"tag36h11:9-3 --side 40 -o a.pdf", "the range 9-3 ends before it begins"},
        {"tag36h11:-3 --side 40 -o a.pdf", "write numbers and ranges, such as tag36h11:7,9,12-20"},
        {"tag36h11:1.5 --side 40 -o a.pdf", "ids '1.5': write numbers"},
        {"tag36h11:1, --side 40 -o a.pdf", "ids '1,': write numbers"},
        {"tag36h11: --side 40 -o a.pdf", "ids '': write numbers"},
        {"tag36h11 --side 40 -o a.pdf", "'tag36h11' names no ids; write for example tag36h11:0-9"},
        {"tag36h11:0 -o a.pdf", "--side is missing"},
        {"tag36h11:0 --side 0 -o a.pdf", "--side: must be from 1 to 1000 mm, is 0"},
        {"tag36h11:0 --side -5 -o a.pdf", "--side: must be from 1 to 1000 mm, is -5"},
        {"tag36h11:0 --side nan -o a.pdf", "--side: must be from 1 to 1000 mm, is nan"},
        {"tag36h11:0 --side wide -o a.pdf", "--side: "},
        {"tag36h11:0 --side 300 -o a.pdf",
         "a marker needs 375 x 379 mm with its quiet zone and label, but the paper has room for 190 x 264 mm"},
        {"tag36h11 --grid 6x4 --side 40 -o a.pdf", "the board needs "},
        {"tag36h11:0 --side 10 --margin 100 -o a.pdf", "--margin 100: only 10 mm of the paper's width remain"},
        {"tag36h11:0-500 --side 150 -o a.pdf", "501 markers need 501 pages"},
        {"tag36h11:0 --side 10 --paper a9 -o a.pdf", "--paper a9: use a4, a3, letter, or WIDTHxHEIGHT"},
        {"tag36h11:0 --side 10 --paper 10x297 -o a.pdf", "--paper 10x297: use "},
        {"tag36h11:0 --side 10 -o a.jpg", "a.jpg: the file's name must end in .pdf, .svg or .png"},
        {"tag36h11:0 --side 10 -o a", "a: the file's name must end in"},
        {"tag36h11:0 --side 10", "--output is required"},
        {"tag36h11:0 --side 1 --dpi 150 -o a.png", "--dpi 150: a cell would be only 0.7 px wide"},
        {"tag36h11:0 --side 10 --paper 1000x1000 --dpi 2400 -o a.png",
         "--dpi 2400: the page would have 94488 x 94488 px"},
        {"tag36h11:0 --side 10 -o missing/a.pdf", "missing/a.pdf: No such file or directory"},
        {"tag36h11:0 --side 10 --gap 5 -o a.pdf", "--gap needs --grid"},
        {"tag36h11:0 --side 10 --marker 5 -o a.pdf", "--square and --marker need --charuco"},
        {"tag36h11:0 --side 10 --map a.map.yaml -o a.pdf", "--map needs a board: --grid or --charuco"},
        {board + "--gap 1", "--gap 1: each marker needs a quiet zone; use --gap 1.5 or more"},
        {board + "--map map.txt", "--map: the file's name must end in .yaml"},
        {board + "--map missing/a.map.yaml", "missing/a.map.yaml: No such file or directory"},
        {"tag36h11 --grid 3x2 " + charuco, "--grid and --charuco exclude each other"},
        {"tag36h11:0-4 --grid 3x2 --side 12 -o a.pdf", "the board needs 6 consecutive ids; give only the first one"},
        {"tag36h11:0,1,2,4,5,6 --grid 3x2 --side 12 -o a.pdf", "the board needs 6 consecutive ids"},
        {"tag36h11:585 --grid 3x2 --side 12 -o a.pdf",
         "needs 6 ids from 585 on, but tag36h11 has only the ids 0 to 586"},
        {"tag36h11 --grid 0x2 --side 12 -o a.pdf", "--grid: "},
        {"DICT_4X4_50 " + charuco, "--charuco needs --square and --marker"},
        {"DICT_4X4_50 --side 9 --marker 9 " + charuco, "--side does not apply to --charuco"},
        {"DICT_4X4_50 --marker 12 " + charuco,
         "--marker 12: each marker needs a quiet zone of one cell in its square of 14 mm; use --marker 10.5 or less"},
        {"missing.patt --side 40 -o a.pdf", "'missing.patt' cannot be read"},
        {"missing.patt --grid 3x2 --side 12 -o a.pdf", "--grid and --charuco need a family of markers; print the "},
        {"tag36h11:0 --pattern-ratio 0.5 --side 12 -o a.pdf", "--pattern-ratio needs a pattern file of ARToolKit"},
        {"a.patt --pattern-ratio 1 --side 12 -o a.pdf", "--pattern-ratio: "},
        {"a.patt --pattern-ratio nan --side 12 -o a.pdf", "--pattern-ratio: nan is not a number"},
        {"tag36h11:0 --side nan -o a.pdf", "--side: must be from 1 to 1000 mm, is nan"},
        {"tag36h11:0 --side 12 --margin -1 -o a.pdf", "--margin: must be from 0 to 1000 mm, is -1"},
        {"tag36h11:0 --side 12 --paper 200xnan -o a.pdf", "--paper 200xnan: use a4, a3, letter, or WIDTHxHEIGHT"},
        {"artoolkit-3x3-hamming63:8 --side 40 -o a.pdf", "artoolkit-3x3-hamming63 has the ids 0 to 7, not 8"},
        {"artoolkit-3x4:0 --side 40 -o a.pdf", "unknown family 'artoolkit-3x4'; similar names: artoolkit-3x3, "},
        {"artoolkit-4x4 --marker 10 " + charuco, "--charuco: artoolkit-4x4 is not an ArUco dictionary"},
        {"tag36h11 --marker 10 " + charuco, "--charuco: tag36h11 is not an ArUco dictionary"},
    };
    expect_rejected(arhost_marker, cases);
}

TEST_F(Marker, RemovesAllPagesIfOneCannotBeWritten) {
    fs::create_symlink("/dev/full", folder() / "sheet-2.svg");
    EXPECT_EQ(execute(arhost_marker + "tag36h11:0-23 --side 12 --paper 100x70 --margin 5 -o sheet.svg"), 2);
    EXPECT_THAT(printed(), HasSubstr("No space left on device"));
    EXPECT_THAT(files(), ElementsAre("sheet-2.svg"));
}

TEST_F(Marker, KeepsAnExistingFileIfItFails) {
    ASSERT_TRUE(succeeds(arhost_marker + "tag36h11:0 --side 12 --paper 60x60 -o sheet.svg"));
    const std::string before = read("sheet.svg");
    EXPECT_EQ(execute(arhost_marker + "tag36h11:0 --side 120 --paper 60x60 -o sheet.svg"), 2);
    EXPECT_EQ(read("sheet.svg"), before);
}
