// SPDX-License-Identifier: Apache-2.0
//
// Runs arhost-map on rendered pictures of boards that arhost-marker has printed, and on a real sequence.
#include "map/map_file.hpp"
#include "program_test.hpp"
#include "simulated_markers.hpp"

#include <arhost/shading/srgb8.hpp>
#include <directories.hpp>
#include <fiducial/rbt_sequence.hpp>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include <csignal>
#include <fstream>

namespace {

namespace fs = std::filesystem;
using arhost::map::Marker;
using arhost::pose::pose_at;
using arhost::pose::Rigid;
using testing::HasSubstr;
using testing::Not;

constexpr double print_dpi = 150, print_px_per_mm = print_dpi / 25.4;
constexpr double focal_px = 600;
constexpr int width = 640, height = 480;

class MapProgram : public arhost::test::ProgramTest {
protected:
    const std::string arhost_map = program("arhost-map");
    void write_camera(const std::string &file = "camera.yaml", int wide = width) const {
        write(file, fmt::format("image_width: {}\nimage_height: {}\ncamera_matrix: {{rows: 3, cols: 3, data: [{}, 0, "
                                "{}, 0, {}, {}, 0, 0, 1]}}\ndistortion_model: plumb_bob\ndistortion_coefficients: "
                                "{{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}}\n",
                                wide, height, focal_px, (width - 1) / 2.0, focal_px, (height - 1) / 2.0));
    }
    // Prints a board and its map, and returns the print.
    cv::Mat print_board(const std::string &family) const {
        EXPECT_TRUE(succeeds(program("arhost-marker") + family +
                             " --grid 3x2 --side 40 --gap 12 --paper 280x230 --margin 5 --dpi 150 -o board.png --map "
                             "board.map.yaml"));
        return cv::imread(folder() / "board.png", cv::IMREAD_GRAYSCALE);
    }
    // Pictures of a print from different directions.
    static std::vector<cv::Mat> photos(const cv::Mat &print, int count, double blur_px = 0) {
        constexpr int samples = 4; // per pixel and axis
        std::vector<cv::Mat> result;
        for (int i = 0; i < count; ++i) {
            const Rigid camera_from_page = pose_at({3.0 * (i % 5) - 6, 2.0 * (i % 3), 330 + 8.0 * (i % 4)},
                                                   12 + 3.0 * (i % 9), 77.0 * i, 23.0 * i);
            // Page coordinates: mm from the centre of the print, x right, y up.
            const auto to_photo = [&](double x_px, double y_px) {
                const Eigen::Vector3d point =
                    camera_from_page * Eigen::Vector3d((x_px + 0.5 - print.cols / 2.0) / print_px_per_mm,
                                                       (print.rows / 2.0 - y_px - 0.5) / print_px_per_mm, 0);
                const double x = focal_px * point.x() / point.z() + (width - 1) / 2.0,
                             y = focal_px * point.y() / point.z() + (height - 1) / 2.0;
                return cv::Point2f(static_cast<float>(samples * (x + 0.5) - 0.5),
                                   static_cast<float>(samples * (y + 0.5) - 0.5));
            };
            const float right = static_cast<float>(print.cols - 1), bottom = static_cast<float>(print.rows - 1);
            const std::vector<cv::Point2f> from{{0, 0}, {right, 0}, {right, bottom}, {0, bottom}};
            std::vector<cv::Point2f> to;
            for (const cv::Point2f &corner : from)
                to.push_back(to_photo(corner.x, corner.y));
            cv::Mat fine, photo;
            cv::warpPerspective(print, fine, cv::getPerspectiveTransform(from, to),
                                cv::Size(samples * width, samples * height), cv::INTER_LINEAR, cv::BORDER_CONSTANT,
                                cv::Scalar(200));
            cv::resize(fine, photo, cv::Size(width, height), 0, 0, cv::INTER_AREA);
            if (blur_px > 0)
                cv::GaussianBlur(photo, photo, {}, blur_px);
            cv::LUT(photo, srgb_of_light(), photo);
            result.push_back(photo);
        }
        return result;
    }
    // A camera averages light and then encodes it.
    static cv::Mat srgb_of_light() {
        cv::Mat_<std::uint8_t> codes(1, 256);
        for (int light = 0; light < 256; ++light)
            codes(0, light) = static_cast<std::uint8_t>(arhost::shading::srgb8_exact(light / 255.0));
        return codes;
    }
    void write_photos(const std::string &family, int count, double blur_px = 0) const {
        int i = 0;
        for (const cv::Mat &photo : photos(print_board(family), count, blur_px))
            cv::imwrite(folder() / fmt::format("photo-{:02}.png", i++), photo);
        write_camera();
    }

    // The largest distance of a marker's corner from that of the true map, in mm, if the two frames coincide at one
    // marker.
    double difference_mm(const std::string &learned_file, const std::string &true_file,
                         const std::string &family) const {
        const auto type = arhost::marker::find_family(family);
        const auto learned = arhost::map::read_map(folder() / learned_file, type),
                   truth = arhost::map::read_map(folder() / true_file, type);
        EXPECT_EQ(learned.size(), truth.size());
        double largest = 0;
        for (std::size_t i = 0; i < std::min(learned.size(), truth.size()); ++i) {
            EXPECT_EQ(learned[i].id, truth[i].id);
            EXPECT_EQ(learned[i].side_mm, truth[i].side_mm);
            const Rigid expected = truth[0].map_from_marker.inverse() * truth[i].map_from_marker;
            for (const Eigen::Vector3d &corner : arhost::pose::square_corners_mm(truth[i].side_mm))
                largest = std::max(largest, (learned[i].map_from_marker * corner - expected * corner).norm());
        }
        return largest;
    }
};

class MapOfFamily : public MapProgram, public testing::WithParamInterface<const char *> {};
INSTANTIATE_TEST_SUITE_P(Every, MapOfFamily, testing::Values("tag36h11", "DICT_6X6_250", "tagStandard41h12"));

TEST_P(MapOfFamily, IsThatOfThePrintedBoard) {
    const std::string family = GetParam();
    write_photos(family, 12);
    ASSERT_TRUE(succeeds(arhost_map + "--images photo-*.png --camera camera.yaml --family " + family +
                         " --side 40 -o desk.map.yaml"));
    EXPECT_LE(difference_mm("desk.map.yaml", "board.map.yaml", family), 0.3) << read("desk.map.yaml");
    EXPECT_THAT(printed(), HasSubstr("desk.map.yaml: 6 markers from 12 of 12 frames; RMS reprojection error 0.0"));
    EXPECT_THAT(printed(), HasSubstr("\n     0       40      12    0.0"));
    EXPECT_THAT(read("desk.map.yaml"),
                HasSubstr("\nversion: 1\n" + std::string(family.starts_with("DICT") ? "dictionary" : "family") +
                          ": " + family));
}

TEST_F(MapProgram, IsPreciseInBlurredImages) {
    write_photos("tag36h11", 12, 2);
    const std::string arguments = "--images photo-*.png --camera camera.yaml --family tag36h11 --ids 1-4 --side 40";
    ASSERT_TRUE(succeeds(arhost_map + arguments + " -o desk.map.yaml"));
    EXPECT_THAT(printed(), HasSubstr("4 markers from 12 of 12 frames; RMS reprojection error 0.0"));
}

TEST_F(MapProgram, ReadsAVideo) {
    {
        cv::VideoWriter video(folder() / "desk.avi", cv::CAP_FFMPEG, cv::VideoWriter::fourcc('F', 'F', 'V', '1'), 25,
                              cv::Size(width, height), false);
        ASSERT_TRUE(video.isOpened());
        for (const cv::Mat &photo : photos(print_board("tag36h11"), 20))
            video.write(photo);
    }
    write_camera();
    const std::string arguments =
        "--video desk.avi --camera camera.yaml --family tag36h11 --side 40 -o desk.map.yaml";
    ASSERT_TRUE(succeeds(arhost_map + arguments));
    EXPECT_THAT(printed(), HasSubstr("6 markers from 20 of 20 frames"));
    EXPECT_LE(difference_mm("desk.map.yaml", "board.map.yaml", "tag36h11"), 0.3);
    ASSERT_TRUE(succeeds(arhost_map + arguments + " --every 3"));
    EXPECT_THAT(printed(), HasSubstr("6 markers from 7 of 7 frames"));
}

TEST_F(MapProgram, IsACommandOfArhost) {
    write_photos("tag36h11", 6);
    ASSERT_TRUE(succeeds(program("arhost") + "map --images photo-*.png --camera camera.yaml "
                                             "--family DICT_APRILTAG_36h11 --side 40 -o desk.map.yaml"));
    EXPECT_THAT(read("desk.map.yaml"), HasSubstr("family: tag36h11"));
    EXPECT_TRUE(succeeds(program("arhost") + "help map"));
    EXPECT_THAT(printed(), HasSubstr("Usage: arhost map [OPTIONS]"));
}

TEST_F(MapProgram, TakesSidesIdsAndALayout) {
    write_photos("tag36h11", 6);
    const std::string images = "--images photo-*.png --camera camera.yaml --family tag36h11 ";
    ASSERT_TRUE(succeeds(arhost_map + images + "--side 40 --side 1-2=20 --ids 0,3-5 -o a.map.yaml"));
    EXPECT_THAT(read("a.map.yaml"), Not(HasSubstr("id: 1")));
    EXPECT_THAT(printed(), HasSubstr("4 markers"));
    EXPECT_EQ(execute(arhost_map + images + "--side 0-4=40 -o b.map.yaml"), 2);
    EXPECT_THAT(printed(),
                HasSubstr("photo-00.png: shows marker 5, whose side is unknown; add --side 5=MM, or list"));
    ASSERT_TRUE(succeeds(arhost_map + images + "--layout board.map.yaml -o c.map.yaml"));
    const auto family = arhost::marker::find_family("tag36h11");
    const auto learned = arhost::map::read_map(folder() / "c.map.yaml", family),
               truth = arhost::map::read_map(folder() / "board.map.yaml", family);
    ASSERT_EQ(learned.size(), 6u);
    for (std::size_t i = 0; i < 6; ++i)
        EXPECT_LE((learned[i].map_from_marker.translation_mm - truth[i].map_from_marker.translation_mm).norm(), 0.3);
    EXPECT_THAT(read("c.map.yaml"), HasSubstr("# Frame: as in the layout.\n"));
    ASSERT_TRUE(succeeds(arhost_map + images + "--side 40 --origin 4 --plane -o d.map.yaml"));
    EXPECT_THAT(read("d.map.yaml"), HasSubstr("# Frame: z = 0 is the best plane, x as on marker 4.\n"));
}

TEST_F(MapProgram, RefusesMarkersThatAreNotConnected) {
    const cv::Mat board = print_board("tag36h11");
    int i = 0;
    for (cv::Mat photo : photos(board, 6)) {
        if (i >= 2) // hides the right third of the board in some pictures
            photo = photos(board(cv::Rect(0, 0, board.cols * 62 / 100, board.rows)), i + 1)[i];
        cv::imwrite(folder() / fmt::format("photo-{}.png", i++), photo);
    }
    write_camera();
    const std::string arguments =
        "--images photo-*.png --camera camera.yaml --family tag36h11 --side 40 -o desk.map.yaml";
    EXPECT_EQ(execute(arhost_map + arguments), 2);
    EXPECT_THAT(printed(),
                HasSubstr("error: marker 2 was seen in only 2 frames; at least 3 are needed; marker 5 was "));
    EXPECT_THAT(printed(), HasSubstr("(--skip-unconnected leaves such markers out)"));
    EXPECT_THAT(files(), Not(testing::Contains("desk.map.yaml")));
    EXPECT_TRUE(succeeds(arhost_map + arguments + " --skip-unconnected"));
    EXPECT_THAT(printed(), HasSubstr("warning: left out: marker 2 was seen"));
    EXPECT_THAT(printed(), HasSubstr("4 markers from 6 of 6 frames"));
    EXPECT_EQ(execute(arhost_map + arguments + " --skip-unconnected --origin 5"), 2);
    EXPECT_THAT(printed(), HasSubstr("marker 5 cannot be the origin"));
}

TEST_F(MapProgram, RejectsInvalidArgumentsWithoutWritingAFile) {
    write_photos("tag36h11", 3);
    write_camera("wide.yaml", 1280);
    cv::imwrite(folder() / "empty.png", cv::Mat(height, width, CV_8UC1, cv::Scalar(128)));
    cv::imwrite(folder() / "small.png", cv::Mat(120, 160, CV_8UC1, cv::Scalar(128)));
    write("text.png", "text");
    write("text.avi", "text");
    write("bad.map.yaml", "version: 1\nfamily: tag36h11\nmarkers: [{id: 1}]\n");
    write("other.map.yaml", "version: 1\nfamily: tag36h11\nmarkers: [{id: 90, side_mm: 40, position_mm: [0, 0, 0]}, "
                            "{id: 91, side_mm: 40, position_mm: [60, 0, 0]}]\n");
    const std::string camera = " --camera camera.yaml --family tag36h11 ", side = "--side 40 ",
                      out = "-o desk.map.yaml";
    const std::string photos = "--images photo-00.png photo-01.png photo-02.png";
    const std::pair<std::string, const char *> cases[] = {
        {camera + side + out, "give either --images or --video"},
        {photos + " --video text.avi" + camera + side + out, "give either --images or --video"},
        {photos + camera + side + "-o desk.txt", "desk.txt: the file's name must end in .yaml"},
        {photos + camera + side, "--output is required"},
        {photos + camera + side + "-o missing/desk.yaml", "missing/desk.yaml: No such file or directory"},
        {photos + " --camera camera.yaml --family tag36h12 --side 40 " + out, "unknown family 'tag36h12'"},
        {photos + " --camera camera.yaml --family artoolkit-3x3 --side 40 " + out,
         "arhost map finds AprilTags and markers of OpenCV, not artoolkit-3x3"},
        {photos + " --camera missing.yaml --family tag36h11 --side 40 " + out, "missing.yaml"},
        {photos + " --camera wide.yaml --family tag36h11 --side 40 " + out,
         "the calibration is for images of 1280×480"},
        {photos + camera + out, "--side is missing"},
        {photos + camera + "--side wide " + out, "--side wide: write a length from 1 to 10000 mm, or IDS=MM"},
        {photos + camera + "--side 0 " + out, "--side 0: write a length"},
        {photos + camera + "--side 900=40 " + out, "tag36h11 has the ids 0 to 586, not 900"},
        {photos + camera + side + "--ids 3-1 " + out, "the range 3-1 ends before it begins"},
        {photos + camera + side + "--ids 100-120 " + out,
         "none of the tag36h11 markers to find was seen in 3 frames; the first ones show 6 markers of tag36h11, such "
         "as 0"},
        {photos + camera + side + "--ids 1 " + out, "a map needs at least two markers in the same frames"},
        {photos + camera + side + "--ids 0-5,50-53,60 " + out, "not seen: 50-53, 60 (--skip-unconnected leaves"},
        {photos + camera + side + "--origin 77 " + out, "marker 77 cannot be the origin"},
        {photos + camera + side + "--origin -1 " + out, "--origin: "},
        {photos + camera + "--side nan " + out, "--side nan: write a length"},
        {photos + camera + "--side 3=-40 " + out, "--side 3=-40: write a length"},
        {photos + camera + side + "--layout bad.map.yaml " + out, "bad.map.yaml:3:11: markers[0]"},
        {photos + camera + side + "--layout missing.yaml " + out, "missing.yaml"},
        {photos + camera + side + "--layout other.map.yaml " + out, "none of the layout's markers is in the map"},
        {photos + camera + side + "--layout board.map.yaml --plane " + out,
         "--plane and --layout exclude each other"},
        {photos + camera + side + "-o ./camera.yaml", "./camera.yaml: --output would overwrite an input"},
        {photos + camera + "--layout board.map.yaml -o board.map.yaml", "board.map.yaml: --output would overwrite"},
        {photos + " small.png" + camera + side + out,
         "small.png: is 160×120 px, but the images before it are 640×480"},
        {photos + " text.png" + camera + side + out, "text.png' cannot be read: damaged or unknown image format"},
        {photos + " missing.png" + camera + side + out, "missing.png: there is no such file"},
        {"--images empty.png" + camera + side + out, "none of the tag36h11 markers to find was seen in 1 frame\n"},
        {"--images photo-00.png photo-01.png" + camera + side + out, "marker 0 was seen in only 2 frames"},
        {"--video text.avi" + camera + side + out, "text.avi' cannot be read: Invalid data"},
        {"--video missing.avi" + camera + side + out, "missing.avi: there is no such file"},
        {"--video . " + camera + side + out, ".: is a folder, not a file"},
    };
    expect_rejected(arhost_map, cases);
}

TEST_F(MapProgram, LeavesTheOldMapIfItIsInterrupted) {
    write_photos("tag36h11", 3);
    write("desk.map.yaml", "old");
    const auto before = files();
    std::string images;
    for (int i = 0; i < 3000; ++i)
        images += " photo-00.png";
    EXPECT_EQ(execute("timeout --preserve-status -s INT 0.3 " + arhost_map + "--images" + images +
                      " --camera camera.yaml --family tag36h11 --side 40 -o desk.map.yaml"),
              128 + SIGINT)
        << printed();
    EXPECT_EQ(files(), before);
    EXPECT_EQ(read("desk.map.yaml"), "old");
}

TEST_F(MapProgram, LearnsARealBoard) {
    ARHOST_REQUIRE_SHARED_DATA("markers/rbt_sequence");
    const arhost_intrinsics camera = arhost::test::RbtSequence::camera();
    write("camera.yaml", fmt::format("image_width: 640\nimage_height: 480\ncamera_matrix: {{rows: 3, cols: 3, data: "
                                     "[{}, 0, {}, 0, {}, {}, 0, 0, 1]}}\ndistortion_model: plumb_bob\n"
                                     "distortion_coefficients: {{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}}\n",
                                     camera.fx, camera.cx, camera.fy, camera.cy));
    ASSERT_TRUE(
        succeeds(arhost_map + "--images " + arhost::test::shared_data("markers/rbt_sequence").string() +
                 "/color_image_00?[02468].png --camera camera.yaml --family tag36h11 --side 95.5 -o board.map.yaml"));
    const auto map = arhost::map::read_map(folder() / "board.map.yaml", arhost::marker::find_family("tag36h11"));
    EXPECT_EQ(map.size(), 10u);
    for (const Marker &marker : map) {
        // The nominal layout, in the frame of tag 0, is known only roughly.
        const Eigen::Vector2d expected(120 * (marker.id % 4), -120 * (marker.id / 4));
        EXPECT_LE((marker.map_from_marker.translation_mm.head<2>() - expected).norm(), 12) << marker.id;
        EXPECT_LE(std::abs(marker.map_from_marker.translation_mm.z()), 25) << marker.id;
    }
}

} // namespace
