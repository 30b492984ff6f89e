// SPDX-License-Identifier: Apache-2.0
//
// Compares pictures with reference pictures, which were verified by eye. A pixel is a probe if all its neighbours
// have the same alpha and a similar colour. A probe's alpha must match exactly, and its colour must match to within 1
// code. Of the other pixels, which are at edges, 1 % may differ, because Embree's results differ between processors.
//
// To update the references after an intended change, run:
// ARHOST_UPDATE_GOLDEN=1 build/release/tests/rt-embree-test --gtest_filter='*Golden*'
#include "scene/motion.hpp"
#include "scene/scene_loader.hpp"
#include "tracer.hpp"

#include <directories.hpp>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include <cstdlib>

namespace arhost::test {
namespace {

const std::filesystem::path folder = arhost::test::source_directory() + "/tests/plugins/rt_embree/golden";

struct View {
    const char *name, *scene;
    std::array<double, 3> eye, look_at, up;
    std::vector<int> classes; // alpha values; the picture must have at least 100 probes of each
    const char *samples = "1";
    double time_s = 0;
};

void PrintTo(const View &view, std::ostream *stream) {
    *stream << view.name;
}

class Golden : public testing::TestWithParam<View> {};

cv::Mat render(const View &view) {
    const std::filesystem::path scene = std::filesystem::path(arhost::test::source_directory()) / view.scene;
    Tracer tracer(scene::load_scene(scene), {{"samples", view.samples}});
    const arhost_camera from = camera(view.eye, view.look_at, view.up);
    EXPECT_EQ(tracer.start(from.intrinsics), ARHOST_STATUS_OK);
    const Picture picture = tracer.render_at(view.time_s, from);
    cv::Mat image(static_cast<int>(picture.height), static_cast<int>(picture.width), CV_8UC4);
    for (int y = 0; y < image.rows; ++y)
        for (int x = 0; x < image.cols; ++x) {
            const Pixel p = picture.at(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y));
            const bool transparent = p[3] == 0; // the colour of a transparent pixel is undefined
            for (int i = 0; i < 4; ++i)
                image.at<cv::Vec4b>(y, x)[i] =
                    transparent ? std::uint8_t{0}
                                : static_cast<std::uint8_t>(p[static_cast<std::size_t>(i < 3 ? 2 - i : 3)]);
        }
    return image;
}

int largest_difference(const cv::Vec4b &a, const cv::Vec4b &b) {
    int largest = 0;
    for (int i = 0; i < 4; ++i)
        largest = std::max(largest, std::abs(a[i] - b[i]));
    return largest;
}

bool is_probe(const cv::Mat &image, int x, int y) {
    const auto &here = image.at<cv::Vec4b>(y, x);
    for (int v = y - 1; v <= y + 1; ++v)
        for (int u = x - 1; u <= x + 1; ++u) {
            const auto &there = image.at<cv::Vec4b>(v, u);
            if (there[3] != here[3] || largest_difference(there, here) > 24)
                return false;
        }
    return true;
}

} // namespace

TEST_P(Golden, MatchesTheReferencePicture) {
    const std::filesystem::path file = folder / (std::string(GetParam().name) + ".png");
    const cv::Mat got = render(GetParam());
    if (std::getenv("ARHOST_UPDATE_GOLDEN"))
        cv::imwrite(file.string(), got);
    const cv::Mat expected = cv::imread(file.string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(expected.size(), got.size()) << file;
    ASSERT_EQ(expected.type(), got.type());
    std::map<int, int> probes;
    int others = 0, others_off = 0;
    for (int y = 1; y < got.rows - 1; ++y)
        for (int x = 1; x < got.cols - 1; ++x) {
            const auto &a = got.at<cv::Vec4b>(y, x), &b = expected.at<cv::Vec4b>(y, x);
            if (is_probe(expected, x, y)) {
                ++probes[b[3]];
                ASSERT_EQ(a[3], b[3]) << "alpha at " << x << ", " << y;
                ASSERT_LE(largest_difference(a, b), 1) << "colour at " << x << ", " << y;
            } else {
                ++others;
                others_off += largest_difference(a, b) > 1;
            }
        }
    EXPECT_LE(others_off, others / 100);
    for (const int alpha : GetParam().classes)
        EXPECT_GE(probes[alpha], 100) << "probes of alpha " << alpha;
}

INSTANTIATE_TEST_SUITE_P(
    Views, Golden,
    testing::Values(
        View{"classes",
             "tests/plugins/rt_embree/golden/classes.yaml",
             {10, -150, 120},
             {0, -2, 8},
             {0, 0, 1},
             {0, 77, 153, 255}},
        View{"desk", "tests/plugins/rt_embree/golden/desk.yaml", {20, -150, 110}, {0, 0, 15}, {0, 0, 1}, {0, 255}},
        View{"optix-cs", "config/scenes/optix-cs.yaml", {0, -330, 150}, {0, 0, 60}, {0, 0, 1}, {0, 255}},
        View{"vkray-cs", "config/scenes/vkray-cs.yaml", {0, 150, 330}, {0, 60, 0}, {0, 1, 0}, {0, 255}},
        View{"room",
             "tests/plugins/rt_embree/golden/room.yaml",
             {20, -190, 120}, // outside the room: the camera sees the front wall's back face
             {5, 0, 22},
             {0, 0, 1},
             {0, 255},
             "4"},
        View{"moving", "config/scenes/moving.yaml", {0, -250, 135}, {6, 0, 40}, {0, 0, 1}, {0, 153, 255}, "4", 1.3}),
    [](const auto &info) {
        std::string name = info.param.name;
        std::replace(name.begin(), name.end(), '-', '_');
        return name;
    });

} // namespace arhost::test
