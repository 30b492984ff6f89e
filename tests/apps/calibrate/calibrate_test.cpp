// SPDX-License-Identifier: Apache-2.0
//
// Calibrates cameras with arhost-calibrate: rendered ones, whose lens is known, and those of OpenCV's photos.
#include "camera/calibration.hpp"
#include "program_test.hpp"
#include "rendered_board.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include <fstream>

namespace {

using namespace arhost::calibrate;
namespace fs = std::filesystem;
using arhost::camera::read_calibration;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

const BoardOptions charuco{true, 10, 7, 36, 28, "DICT_5X5_100", 0};
const BoardOptions chessboard{false, 9, 6, 36, 0, "", 0};
const std::string charuco_arguments = "--charuco 10x7 --square 36 --marker 28 --dictionary DICT_5X5_100 ";
const std::string chessboard_arguments = "--chessboard 9x6 --square 36 ";
const char *const photos = "/usr/share/doc/opencv-doc"; // of the Debian package opencv-doc

// ChArUco boards may be cut off by the border of the image.
std::vector<Pose> poses_for(const BoardOptions &board) {
    return good_poses(board.is_charuco ? 1.05 : 1.45);
}

class Calibrate : public arhost::test::ProgramTest {
protected:
    const std::string arhost_calibrate = program("arhost-calibrate");
    void write_images(const TrueCamera &camera, const BoardOptions &board, const std::vector<Pose> &poses) const {
        Renderer renderer(camera, board);
        fs::create_directory(folder() / "images");
        for (std::size_t i = 0; i < poses.size(); ++i)
            cv::imwrite(folder() / ("images/" + std::to_string(10 + i) + ".png"), renderer.image(poses[i]));
    }
    // The board is held still for two frames in each pose, and moves for one frame to the next one.
    void write_video(const TrueCamera &camera, const BoardOptions &board, const std::vector<Pose> &poses) const {
        Renderer renderer(camera, board);
        cv::VideoWriter video(folder() / "video.avi", cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 30, camera.size,
                              false);
        video.set(cv::VIDEOWRITER_PROP_QUALITY, 98);
        ASSERT_TRUE(video.isOpened());
        for (std::size_t i = 0; i < poses.size(); ++i) {
            for (int frame = 0; frame < 2; ++frame)
                video.write(renderer.image(poses[i]));
            const Pose &next = poses[(i + 1) % poses.size()];
            Pose between = poses[i];
            between.x = (poses[i].x + next.x) / 2;
            between.y = (poses[i].y + next.y) / 2;
            video.write(renderer.image(between, 2));
        }
    }
};

void expect_lens(const fs::path &file, const TrueCamera &camera, double focal_length_percent,
                 double principal_point_px) {
    const arhost_intrinsics found = read_calibration(file);
    const auto &expected = camera.lens.matrix;
    EXPECT_EQ(found.width, camera.size.width);
    EXPECT_EQ(found.height, camera.size.height);
    EXPECT_NEAR(found.fx, expected(0, 0), expected(0, 0) * focal_length_percent / 100);
    EXPECT_NEAR(found.fy, expected(1, 1), expected(1, 1) * focal_length_percent / 100);
    EXPECT_NEAR(found.cx, expected(0, 2), principal_point_px);
    EXPECT_NEAR(found.cy, expected(1, 2), principal_point_px);
    EXPECT_EQ(found.distortion,
              camera.lens.model == Model::fisheye ? ARHOST_DISTORTION_FISHEYE : ARHOST_DISTORTION_BROWN);
    EXPECT_EQ(found.coefficient_count, camera.lens.coefficients.size());
}

struct Case {
    const char *name;
    BoardOptions board;
    TrueCamera camera;
    std::string arguments;
};

void PrintTo(const Case &value, std::ostream *out) {
    *out << value.name;
}

class EveryBoardAndLens : public Calibrate, public testing::WithParamInterface<Case> {};
INSTANTIATE_TEST_SUITE_P(Calibrate, EveryBoardAndLens,
                         testing::Values(Case{"CharucoBrown", charuco, brown_camera(), charuco_arguments},
                                         Case{"ChessboardBrown", chessboard, brown_camera(), chessboard_arguments},
                                         Case{"CharucoFisheye", charuco, fisheye_camera(),
                                              charuco_arguments + "--model fisheye "},
                                         Case{"ChessboardFisheye", chessboard, fisheye_camera(),
                                              chessboard_arguments + "--model fisheye "}),
                         [](const auto &info) { return std::string(info.param.name); });

} // namespace

TEST_P(EveryBoardAndLens, GivesTheLensOfRenderedImages) {
    write_images(GetParam().camera, GetParam().board, poses_for(GetParam().board));
    ASSERT_TRUE(succeeds(arhost_calibrate + GetParam().arguments +
                         "--images images/*.png -o camera.yaml --coverage coverage.png"));
    EXPECT_THAT(files(), ElementsAre("camera.yaml", "coverage.png", "images"));
    expect_lens(folder() / "camera.yaml", GetParam().camera, 0.2, 1);
    for (const char *text : {"RMS error: 0.", " corners of 1", " views)", "\n27.png", "focal length: fx ", " ± ",
                             "principal point: cx ", "\ncamera.yaml written\n"})
        EXPECT_THAT(printed(), HasSubstr(text));
    const cv::Mat picture = cv::imread(folder() / "coverage.png");
    EXPECT_EQ(picture.cols, 1000);
    EXPECT_GT(picture.rows, 750);
}

TEST_F(Calibrate, AcceptsABoardThatDoesNotBeginWithId0) {
    BoardOptions board = charuco;
    board.first_id = 40;
    write_images(brown_camera(), board, poses_for(board));
    ASSERT_TRUE(succeeds(
        arhost_calibrate +
        "--charuco 10x7 --square 36 --marker 28 --dictionary DICT_5X5_100:40 --images images/*.png -o camera.yaml"));
    expect_lens(folder() / "camera.yaml", brown_camera(), 0.2, 1);
}

TEST_F(Calibrate, ChoosesViewsFromAVideo) {
    write_video(brown_camera(), charuco, poses_for(charuco));
    ASSERT_TRUE(succeeds(arhost_calibrate + charuco_arguments + "--video video.avi --max-views 14 -o camera.yaml"));
    expect_lens(folder() / "camera.yaml", brown_camera(), 0.4, 2);
    EXPECT_THAT(printed(), HasSubstr("video.avi: 54 frames, 18 views taken; "));
    EXPECT_THAT(printed(), HasSubstr(" corners of 14 views)"));
}

TEST_F(Calibrate, SaysIfTheBoardNeverRests) {
    Renderer renderer(brown_camera(), charuco);
    cv::VideoWriter video(folder() / "video.avi", cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 30, {640, 480}, false);
    for (int i = 0; i < 5; ++i)
        video.write(renderer.image({0.4 + 0.04 * i, 0.5, 1.05, 10, 0, 0}));
    video.release();
    EXPECT_EQ(execute(arhost_calibrate + charuco_arguments + "--video video.avi -o camera.yaml"), 2);
    EXPECT_THAT(printed(), HasSubstr("no view was taken; hold the board still in each one (video.avi: 5 frames, 0 "
                                     "views taken; 0 frames without the board, 5 in motion, "));
}

TEST_F(Calibrate, AdvisesWhichViewACameraNeeds) {
    write_video(brown_camera(), charuco, poses_for(charuco));
    ASSERT_TRUE(succeeds(arhost_calibrate + charuco_arguments + "--camera video.avi -o camera.yaml"));
    for (const char *line : {"0 views: move the board to the top left of the image\n",
                             "1 view: move the board to the top right of the image\n",
                             "3 views: move the board to the bottom left of the image\n",
                             ": the views are complete\n", "\ncamera.yaml written\n"})
        EXPECT_THAT(printed(), HasSubstr(line));
    expect_lens(folder() / "camera.yaml", brown_camera(), 0.4, 2);
    EXPECT_EQ(execute(arhost_calibrate + charuco_arguments + "--camera video.avi --size 800x600 -o camera.yaml"), 2);
    EXPECT_THAT(printed(), HasSubstr("--size 800x600: the camera delivers 640 x 480 px"));
}

TEST_F(Calibrate, ShowsAWindowIfThereIsADisplay) {
    write_video(brown_camera(), charuco, poses_for(charuco));
    const std::string command = arhost_calibrate + charuco_arguments + "--camera video.avi -o camera.yaml";
    EXPECT_TRUE(succeeds("DISPLAY=:9977 " + command));
    EXPECT_THAT(printed(), HasSubstr("warning: the display cannot be opened, so there is no window"));
    EXPECT_TRUE(succeeds("DISPLAY=:9977 " + command + " --no-window"));
    EXPECT_THAT(printed(), Not(HasSubstr("warning")));
    if (std::system("command -v xvfb-run > /dev/null") != 0)
        GTEST_SKIP() << "xvfb-run is not installed";
    EXPECT_TRUE(succeeds("xvfb-run -a " + command));
    EXPECT_THAT(printed(), Not(HasSubstr("warning")));
}

TEST_F(Calibrate, AgreesWithOpenCvOnItsChessboardPhotos) {
    const fs::path data = fs::path(photos) / "examples/data";
    if (!fs::exists(data / "left01.jpg"))
        GTEST_SKIP() << "needs the photos of the Debian package opencv-doc in " << data;
    ASSERT_EQ(execute(arhost_calibrate + "--images " + data.string() +
                      "/left??.jpg --chessboard 9x6 --square 25 -o left.yaml"),
              2);
    EXPECT_THAT(printed(),
                AllOf(HasSubstr("move the board to the top left of the image; "), Not(HasSubstr("tilt the"))))
        << "no photo has corners there";
    ASSERT_TRUE(succeeds(arhost_calibrate + "--images " + data.string() +
                         "/left??.jpg --chessboard 9x6 --square 25 --accept-poor-coverage -o left.yaml"));
    EXPECT_THAT(printed(), HasSubstr(" corners of 13 views)"));
    const arhost_intrinsics found = read_calibration(folder() / "left.yaml"),
                            expected = read_calibration(data / "left_intrinsics.yml"); // OpenCV's result for them
    EXPECT_NEAR(found.fx, expected.fx, 0.005 * expected.fx);
    EXPECT_NEAR(found.fy, expected.fy, 0.005 * expected.fy);
    EXPECT_NEAR(found.cx, expected.cx, 2);
    EXPECT_NEAR(found.cy, expected.cy, 2);
    EXPECT_NEAR(found.coefficients[0], expected.coefficients[0], 0.02);
    const cv::FileStorage file(folder() / "left.yaml", cv::FileStorage::READ);
    EXPECT_LT(file["avg_reprojection_error"].real(), 0.4) << "OpenCV: 0.39";
}

// OpenCV's documentation has only one photo of its ChArUco board in the original size, with the result of its
// calibration tutorial. The corners found must be where the tutorial's lens has them.
TEST_F(Calibrate, AgreesWithOpenCvOnItsCharucoPhoto) {
    ARHOST_REQUIRE_SHARED_DATA("markers/opencv_doc");
    const fs::path data = arhost::test::shared_data("markers/opencv_doc");
    const cv::Mat photo = cv::imread(data / "choriginal.jpg", cv::IMREAD_GRAYSCALE);
    const auto view = Board({true, 5, 7, 40, 20, "DICT_6X6_250", 0}).find(photo);
    ASSERT_TRUE(view);
    EXPECT_EQ(view->image_px.size(), 24u);
    const cv::FileStorage file(data / "tutorial_camera_charuco.yml", cv::FileStorage::READ);
    const cv::Mat matrix = file["camera_matrix"].mat(), coefficients = file["distortion_coefficients"].mat();
    cv::Mat rotation, translation;
    ASSERT_TRUE(cv::solvePnP(view->board_mm, view->image_px, matrix, coefficients, rotation, translation));
    std::vector<cv::Point2f> expected;
    cv::projectPoints(view->board_mm, rotation, translation, matrix, coefficients, expected);
    EXPECT_LT(cv::norm(expected, view->image_px) / std::sqrt(24), 0.3);

    EXPECT_EQ(execute(arhost_calibrate + "--images " + (data / "choriginal.jpg").string() +
                      " --charuco 5x7 --square 40 --marker 20 --dictionary DICT_6X6_250 -o camera.yaml"),
              2);
    EXPECT_THAT(printed(), HasSubstr("the board was found in 1 view, but a calibration needs at least 3"));
}

TEST_F(Calibrate, RefusesPoorCoverage) {
    std::vector<Pose> poses = good_poses();
    for (Pose &pose : poses)
        pose.x = 0.25 + (pose.x - 0.25) / 4; // on the left side of the image
    write_images(brown_camera(), chessboard, poses);
    const std::string arguments =
        chessboard_arguments + "--images images/*.png -o camera.yaml --coverage coverage.png ";
    EXPECT_EQ(execute(arhost_calibrate + arguments), 2);
    EXPECT_THAT(printed(), HasSubstr("the views do not determine the lens well: move the board to the top right of "
                                     "the image; move the board to the bottom right of the image; move the board to "
                                     "the right of the image (or use --accept-poor-coverage)"));
    EXPECT_THAT(files(), ElementsAre("coverage.png", "images"));
    EXPECT_TRUE(succeeds(arhost_calibrate + arguments + "--accept-poor-coverage"));
    EXPECT_THAT(printed(), HasSubstr("warning: the views do not determine the lens well: move the board to the top"));
    EXPECT_THAT(files(), ElementsAre("camera.yaml", "coverage.png", "images"));
}

TEST_F(Calibrate, SaysWhichOtherBoardItSees) {
    write_images(brown_camera(), charuco, {good_poses()[4]});
    EXPECT_EQ(
        execute(
            arhost_calibrate +
            "--charuco 10x7 --square 36 --marker 28 --dictionary DICT_6X6_50 --images images/10.png -o camera.yaml"),
        2);
    EXPECT_THAT(printed(),
                HasSubstr("the board is in no image; expected a ChArUco board of 10 x 7 squares of 36 mm, markers of "
                          "28 mm, DICT_6X6_50 from id 0 on, but the images show 35 markers of DICT_5X5_"));
    write_images(brown_camera(), chessboard, {good_poses()[4]});
    EXPECT_EQ(execute(arhost_calibrate + "--chessboard 11x8 --square 36 --images images/10.png -o camera.yaml"), 2);
    EXPECT_THAT(printed(), HasSubstr("expected a chessboard with 11 x 8 inner corners, squares of 36 mm, but the "
                                     "images show a chessboard with about "));
}

TEST_F(Calibrate, RejectsABoardOfAnotherShape) {
    write_images(brown_camera(), charuco, poses_for(charuco));
    EXPECT_EQ(execute(arhost_calibrate + "--charuco 7x10 --square 36 --marker 28 --dictionary DICT_5X5_100 "
                                         "--accept-poor-coverage --images images/*.png -o camera.yaml"),
              2);
    EXPECT_THAT(printed(), HasSubstr("; expected a ChArUco board of 7 x 10 squares"));
    EXPECT_THAT(files(), ElementsAre("images"));
}

TEST_F(Calibrate, RejectsInvalidInputWithoutWritingAFile) {
    write_images(brown_camera(), chessboard, {good_poses()[4], good_poses()[3]});
    const cv::Mat image = cv::imread(folder() / "images/10.png", cv::IMREAD_GRAYSCALE);
    cv::imwrite(folder() / "images/small.png", image(cv::Rect(0, 0, 600, 480)));
    cv::imwrite(folder() / "images/tiny.png", image(cv::Rect(0, 0, 1, 1)));
    cv::imwrite(folder() / "images/grey.png", cv::Mat(480, 640, CV_8U, cv::Scalar(128)));
    std::ofstream(folder() / "images/text.png") << "no image";
    std::ofstream(folder() / "images/empty.png");
    const std::string images = "--images images/10.png ", square = "--square 36 ", output = "-o camera.yaml",
                      board = chessboard_arguments, rest = board + output;
    const std::string charuco_board = "--charuco 10x7 --square 36 ";
    const std::pair<std::string, const char *> cases[] = {
        {rest, "give one input: --images, --video or --camera"},
        {images + "--video images/10.png " + rest, "give one input: --images, --video or --camera"},
        {images + board, "--output is required"},
        {images + board + "-o camera.txt", "camera.txt: the file's name must end in .yaml"},
        {images + board + "-o missing/camera.yaml", "missing/camera.yaml: No such file or directory"},
        {images + rest + " --coverage a.jpg", "--coverage a.jpg: the file's name must end in .png"},
        {images + rest + " --coverage ./images/10.png", "--coverage ./images/10.png: would overwrite an input"},
        {images + rest + " --size 640x480", "--size needs --camera"},
        {images + rest + " --model pinhole", "--model: "},
        {images + rest + " --max-views 3", "--max-views: "},
        {images + square + output, "give the board: either --charuco or --chessboard"},
        {images + rest + " --charuco 10x7", "give the board: either --charuco or --chessboard"},
        {images + "--chessboard 9x6 " + output, "--square is missing"},
        {images + "--chessboard 9x2 " + square + output, "--chessboard: "},
        {images + "--chessboard 9 " + square + output, "--chessboard: "},
        {images + "--chessboard 9x6 --square 0 " + output, "--square: "},
        {images + "--chessboard 9x6 --square -36 " + output, "--square: "},
        {images + "--chessboard 9x6 --square inf " + output, "--square: "},
        {images + "--chessboard 9x6 --square nan " + output, "--square: nan is not a number"},
        {images + charuco_board + "--marker -NaN --dictionary DICT_5X5_50 " + output,
         "--marker: -NaN is not a number"},
        {images + rest + " --marker 5", "--marker and --dictionary need --charuco"},
        {images + charuco_board + output, "--charuco needs --marker, in mm"},
        {images + charuco_board + "--marker 20 " + output, "--charuco needs --dictionary"},
        {images + charuco_board + "--marker 20 --dictionary DICT_9X9_1 " + output,
         "unknown dictionary 'DICT_9X9_1'; use one of DICT_APRILTAG_36h11, "},
        {images + charuco_board + "--marker 20 --dictionary DICT_5X5_50:x " + output,
         "write the id of the board's first marker as a number"},
        {images + charuco_board + "--marker 20 --dictionary DICT_5X5_50:20 " + output,
         "--charuco 10x7: the board needs 35 ids from 20 on, but DICT_5X5_50 has only the ids 0 to 49"},
        {images + charuco_board + "--marker 36 --dictionary DICT_5X5_50 " + output,
         "--marker 36: a marker must be smaller than its square of 36 mm"},
        {"--images images/missing.png " + rest, "images/missing.png: there is no such file"},
        {"--images images/text.png " + rest, "text.png' cannot be read: damaged or unknown image format"},
        {"--images images/empty.png " + rest, "empty.png' cannot be read: the file is empty"},
        {"--images images " + rest, "images: is a folder, not a file"},
        {"--images images/tiny.png " + rest, "images/tiny.png: 1 x 1 px are too few to calibrate with"},
        {"--images images/10.png images/small.png " + rest,
         "images/small.png has 600 x 480 px, but images/10.png has 640 x 480 px; all images must be of one camera"},
        {"--images images/grey.png " + rest,
         "the board is in no image; expected a chessboard with 9 x 6 inner corners, squares of 36 mm\n"},
        {images + rest, "the board was found in 1 view, but a calibration needs at least 3, and a good one 10"},
        {"--images images/10.png images/11.png " + rest, "the board was found in 2 views"},
        {"--video missing.avi " + rest, "missing.avi: there is no such file"},
        {"--video images/text.png " + rest, "text.png' cannot be read: "},
        {"--camera /dev/video-missing " + rest, "/dev/video-missing"},
    };
    expect_rejected(arhost_calibrate, cases);
}

TEST_F(Calibrate, KeepsAnExistingFileIfItFails) {
    std::ofstream(folder() / "camera.yaml") << "before";
    write_images(brown_camera(), chessboard, {good_poses()[4]});
    EXPECT_EQ(execute(arhost_calibrate + chessboard_arguments + "--images images/*.png -o camera.yaml"), 2);
    EXPECT_EQ(read("camera.yaml"), "before");
}

TEST_F(Calibrate, FailsIfTheDiskIsFull) {
    fs::create_symlink("/dev/full", folder() / "camera.yaml");
    write_images(brown_camera(), chessboard, {good_poses()[0], good_poses()[4], good_poses()[8]});
    EXPECT_EQ(execute(arhost_calibrate + chessboard_arguments +
                      "--images images/*.png --accept-poor-coverage -o camera.yaml"),
              2);
    EXPECT_THAT(printed(), HasSubstr("No space left on device"));
}

TEST_F(Calibrate, FindsTheBoardThatArhostPrints) {
    std::ifstream document(arhost::test::source_directory() + "/docs/calibration.md");
    std::string print, calibrate;
    for (std::string line; std::getline(document, line);) {
        const std::size_t at = line.find_first_not_of(' ');
        if (at == std::string::npos)
            continue;
        if (line.substr(at).starts_with("arhost marker "))
            print = line.substr(at);
        if (line.substr(at).starts_with("arhost calibrate "))
            calibrate = line.substr(at);
    }
    ASSERT_NE(print.find("board.pdf"), std::string::npos);
    ASSERT_NE(calibrate.find("--camera /dev/video0 --size 1280x720"), std::string::npos);
    print.replace(print.find("board.pdf"), 9, "board.png --dpi 150");
    calibrate.replace(calibrate.find("--camera"), 36, "--images board.png");
    ASSERT_TRUE(succeeds(arhost::test::build_directory() + "/bin/" + print));
    EXPECT_EQ(execute(arhost::test::build_directory() + "/bin/" + calibrate), 2);
    EXPECT_THAT(printed(), HasSubstr("the board was found in 1 view, but"));
}

TEST_F(Calibrate, IsACommandOfArhost) {
    EXPECT_EQ(execute(program("arhost") + "calibrate --chessboard 9x6 -o a.yaml"), 2);
    EXPECT_THAT(printed(), HasSubstr("error: --square is missing"));
    EXPECT_TRUE(succeeds(program("arhost") + "help calibrate"));
    EXPECT_THAT(printed(), HasSubstr("Usage: arhost calibrate [OPTIONS]"));
}
