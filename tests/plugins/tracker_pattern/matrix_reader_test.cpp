// SPDX-License-Identifier: Apache-2.0
#include <fiducial/artoolkit.hpp>
#include <fiducial/clutter.hpp>
#include <fiducial/rendered_marker.hpp>

#include <gmock/gmock.h>

#include <random>

namespace {

using namespace arhost::test;
using arhost::fiducial::find_matrix_family;
using arhost::fiducial::matrix_families;
using arhost::fiducial::MatrixFamily;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double side_mm = 80;
const arhost_intrinsics camera = intrinsics_of({640, 480}, 1200, 1200, 319.5, 239.5);

// `wrong_cells`: so many cells are inverted, from the second one on.
Print print_of(const MatrixFamily &family, int id, int wrong_cells = 0) {
    const std::vector<bool> black = arhost::fiducial::matrix_cells(family, id);
    const int cells = family.side;
    cv::Mat_<std::uint8_t> picture(cells, cells);
    for (int i = 0; i < cells * cells; ++i)
        picture(i / cells, i % cells) = black[static_cast<std::size_t>(i)] != (i >= 1 && i <= wrong_cells) ? 0 : 255;
    Print print{cv::Mat_<std::uint8_t>(4 * cells, 4 * cells, std::uint8_t{0}), 4 * cells};
    cv::Mat inside = print.cells(cv::Rect(cells, cells, 2 * cells, 2 * cells));
    cv::resize(picture, inside, inside.size(), 0, 0, cv::INTER_NEAREST);
    return print.with_margin(cells / 2);
}

cv::Mat picture_of(const std::vector<Placed> &markers, std::uint64_t seed = 1) {
    cv::Mat picture = render(camera, markers);
    cv::GaussianBlur(picture, picture, {}, 0.6);
    add_noise(picture, 1.5, seed);
    return picture;
}

// All markers of a family, or 100 of them, if it is large.
std::vector<Listed> listed(const MatrixFamily &family) {
    std::vector<Listed> markers;
    for (int id = 0; id<family.id_count; id += family.id_count> 512 ? family.id_count / 100 + 1 : 1)
        markers.push_back({id, side_mm, family.name});
    return markers;
}

TEST(MatrixReader, TellsAllMarkersOfAFamilyApartAtTiltsOfUpTo60Degrees) {
    double worst_px = 0;
    for (const MatrixFamily &family : matrix_families()) {
        SCOPED_TRACE(family.name);
        Tracker tracker("tracker_pattern");
        const std::vector<Listed> markers = listed(family);
        ASSERT_EQ(tracker.start(camera, markers), ARHOST_STATUS_OK) << tracker.log();
        std::mt19937 random(1);
        std::uniform_real_distribution<double> turn(-180, 180), tilt(0, 60), shift(-5, 5);
        constexpr std::size_t columns = 4, per_picture = 12;
        for (std::size_t first = 0; first < markers.size(); first += per_picture) {
            std::vector<Placed> placed;
            for (std::size_t i = first; i < std::min(markers.size(), first + per_picture); ++i) {
                const double x_mm = 140 * static_cast<double>((i - first) % columns) - 210 + shift(random);
                const double y_mm = 140 * static_cast<double>((i - first) / columns) - 140 + shift(random);
                const double about_x = i % 2 ? tilt(random) : 0, about_y = i % 2 ? 0 : tilt(random);
                placed.push_back({print_of(family, markers[i].id), side_mm,
                                  pose_of(x_mm, y_mm, 1200, about_x, about_y, turn(random))});
            }
            const auto seen = tracker.track(GreyFrame(picture_of(placed, first + 1)));
            ASSERT_EQ(seen.size(), placed.size()) << "from " << markers[first].id << " on";
            for (std::size_t i = 0; i < seen.size(); ++i) {
                ASSERT_EQ(seen[i].id, markers[first + i].id);
                EXPECT_EQ(seen[i].hamming, 0u) << seen[i].id;
                worst_px =
                    std::max(worst_px, greatest_distance_px(seen[i], corners_of(placed[i].mt, camera, side_mm)));
            }
        }
    }
    EXPECT_LE(worst_px, 0.2);
}

TEST(MatrixReader, CorrectsAsManyCellsAsTheCodeCan) {
    for (const MatrixFamily &family : matrix_families()) {
        const int id = 5, most = family.corrects;
        Tracker tracker("tracker_pattern", {}, camera, {{id, side_mm, family.name}});
        for (int wrong_cells = 0; wrong_cells <= most + 1; ++wrong_cells) {
            SCOPED_TRACE(std::string(family.name) + ", wrong cells: " + std::to_string(wrong_cells));
            const auto seen = tracker.track(GreyFrame(
                picture_of({{print_of(family, id, wrong_cells), side_mm, pose_of(10, 20, 1000, 20, 10, 100)}})));
            ASSERT_EQ(seen.size(), wrong_cells <= most ? 1u : 0u);
            if (wrong_cells <= most) {
                EXPECT_EQ(seen[0].hamming, static_cast<std::uint32_t>(wrong_cells));
            }
        }
    }
}

TEST(MatrixReader, ReadsOnlyClearCellsInsideABlackBorder) {
    const MatrixFamily &family = *find_matrix_family("artoolkit-3x3");
    Tracker tracker("tracker_pattern", {}, camera, listed(family));
    const auto seen = [&](const Print &print) {
        return tracker.track(GreyFrame(picture_of({{print, side_mm, pose_of(0, 0, 1000, 20, 10, 100)}})));
    };
    const Print print = print_of(family, 37);
    ASSERT_EQ(seen(print).size(), 1u);
    const cv::Rect centre(6, 6, 2, 2), in_border(6, 2, 2, 2), corner(4, 4, 2, 2); // with a margin of one cell
    for (const auto &[cell, grey] : {std::pair(centre, 128), std::pair(in_border, 255), std::pair(corner, 255)}) {
        Print other{print.cells.clone(), print.corner_cells};
        other.cells(cell) = static_cast<std::uint8_t>(grey);
        EXPECT_THAT(seen(other), IsEmpty()) << cell;
    }
    Print dim{print.cells.clone(), print.corner_cells};
    dim.cells(cv::Rect(4, 4, 6, 6)) /= 16;
    EXPECT_THAT(seen(dim), IsEmpty());
}

TEST(MatrixReader, SurvivesDimCodesThatAreAlmostUniform) {
    for (const auto &[name, id] : {std::pair("artoolkit-3x3", 63), {"artoolkit-4x4", 8191}}) {
        const MatrixFamily &family = *find_matrix_family(name);
        Tracker tracker("tracker_pattern", {}, camera, {{id, side_mm, name}});
        cv::Mat picture = render(camera, {{print_of(family, id), side_mm, pose_of(0, 0, 1000, 20, 10, 100)}});
        cv::GaussianBlur(picture, picture, {}, 1.5);
        for (int percent = 5; percent <= 20; ++percent) {
            cv::Mat dim = picture * (percent / 100.0);
            EXPECT_NO_THROW(tracker.track(GreyFrame(dim))) << percent;
        }
    }
}

TEST(MatrixReader, FindsSeveralFamiliesAndPatternsInOnePicture) {
    ARHOST_REQUIRE_SHARED_DATA("markers/artoolkit");
    const MatrixFamily &small = *find_matrix_family("artoolkit-3x3-hamming63"),
                       &large = *find_matrix_family("artoolkit-4x4-bch-13-9-3");
    Tracker tracker("tracker_pattern");
    const auto hiro = (shared_data("markers/artoolkit") / "hiro.patt").string();
    ASSERT_EQ(tracker.start(
                  camera, {{3, side_mm, small.name}, {0, side_mm, "pattern", hiro, 0.5}, {300, side_mm, large.name}}),
              ARHOST_STATUS_OK)
        << tracker.log();
    const Mt left = pose_of(-75, 0, 1000, 20, 10, 5), right = pose_of(75, 0, 1000, -20, 10, 150);
    const GreyFrame frame(picture_of({{print_of(small, 3), side_mm, left}, {print_of(large, 300), side_mm, right}}));
    const auto all = tracker.track(frame);
    ASSERT_EQ(all.size(), 2u);
    EXPECT_EQ(tracker.family(all[0]), small.name);
    EXPECT_EQ(tracker.family(all[1]), large.name);
    EXPECT_EQ(all[1].id, 300);
    const auto corners = corners_of(left, camera, side_mm);
    const auto near = tracker.track(frame, {expected_at(0, corners)}, false);
    ASSERT_EQ(near.size(), 1u);
    EXPECT_EQ(near[0].id, 3);
    EXPECT_LT(greatest_distance_px(near[0], corners), 0.2);
}

void expect_nothing_in(const std::vector<cv::Mat> &pictures) {
    // The other families of these sizes have a subset of the words, or correct fewer cells.
    std::vector<Listed> markers;
    for (const char *name : {"artoolkit-3x3", "artoolkit-4x4-bch-13-9-3", "artoolkit-5x5-bch-22-7-7"})
        std::ranges::copy(listed(*find_matrix_family(name)), std::back_inserter(markers));
    const std::vector<Listed> correcting = listed(*find_matrix_family("artoolkit-3x3-hamming63"));
    Tracker tracker("tracker_pattern");
    for (const cv::Mat &picture : pictures)
        for (const std::vector<Listed> &each : {markers, correcting}) {
            ASSERT_EQ(tracker.start(plain_camera(picture.size()), each), ARHOST_STATUS_OK) << tracker.log();
            EXPECT_THAT(tracker.track(GreyFrame(picture)), IsEmpty());
        }
}

TEST(MatrixReader, FindsNothingInRealPhotos) {
    ARHOST_REQUIRE_SHARED_DATA("markers");
    std::vector<std::filesystem::path> files;
    for (const auto &entry : std::filesystem::recursive_directory_iterator(shared_data("markers"))) {
        const std::string name = entry.path().filename(), kind = entry.path().extension();
        if ((kind == ".png" || kind == ".jpg") && !name.starts_with("depth_"))
            files.push_back(entry.path());
    }
    std::ranges::sort(files);
    ASSERT_GT(files.size(), 50u);
    std::vector<cv::Mat> photos;
    for (const auto &file : files)
        photos.push_back(read_grey(file));
    expect_nothing_in(photos);
}

TEST(MatrixReader, FindsNothingInClutter) {
    std::vector<cv::Mat> pictures;
    for (std::uint64_t seed = 1; seed <= 40; ++seed)
        pictures.push_back(clutter({640, 480}, seed));
    expect_nothing_in(pictures);
}

TEST(MatrixReader, RejectsUnknownFamiliesIdsAndTwins) {
    Tracker tracker("tracker_pattern");
    const auto error_of = [&](const std::vector<Listed> &markers) {
        EXPECT_EQ(tracker.start(camera, markers), ARHOST_STATUS_ERROR_CONFIGURATION);
        return tracker.log();
    };
    EXPECT_THAT(error_of({{0, side_mm, "artoolkit-6x6"}}),
                HasSubstr("unknown family 'artoolkit-6x6': tracker_pattern finds targets with a 'pattern', and has "
                          "artoolkit-3x3, artoolkit-3x3-parity65"));
    EXPECT_THAT(
        error_of({{8, side_mm, "artoolkit-3x3-hamming63"}}),
        HasSubstr("target 'artoolkit-3x3-hamming63-8': marker id 8 is not in artoolkit-3x3-hamming63, whose ids "
                  "are 0 to 7"));
    EXPECT_THAT(
        error_of({{7, side_mm, "artoolkit-3x3-hamming63"}, {52, side_mm, "artoolkit-3x3"}}),
        HasSubstr("the markers artoolkit-3x3-hamming63-7 and artoolkit-3x3-52 look the same; use the markers of "
                  "one family"));
}

} // namespace
