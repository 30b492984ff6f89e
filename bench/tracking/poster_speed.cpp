// SPDX-License-Identifier: Apache-2.0
//
// Speed and accuracy of tracker_image on generated video of 640×480, in which half of the picture is covered, next to
// OpenCV's features (ORB, ratio test, findHomography with RANSAC) in every frame.
#include "command_line/command_line.hpp"

#include <tracker_image/poster_video.hpp>

#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <exception>
#include <numeric>
#include <optional>
#include <vector>

namespace {

using namespace arhost::test;
using Clock = std::chrono::steady_clock;

// Finds the picture by its features alone.
class BareOpenCv {
public:
    explicit BareOpenCv(const cv::Mat &picture) : size_(picture.size()) {
        features_->detectAndCompute(picture, {}, points_, descriptors_);
    }
    std::optional<Quad> find(const cv::Mat &frame) {
        std::vector<cv::KeyPoint> points;
        cv::Mat descriptors;
        features_->detectAndCompute(frame, {}, points, descriptors);
        if (points.size() < 2)
            return std::nullopt;
        std::vector<std::vector<cv::DMatch>> matches;
        matcher_.knnMatch(descriptors_, descriptors, matches, 2);
        std::vector<cv::Point2f> from, to;
        for (const auto &match : matches)
            if (match.size() == 2 && match[0].distance < 0.75F * match[1].distance) {
                from.push_back(points_[static_cast<std::size_t>(match[0].queryIdx)].pt);
                to.push_back(points[static_cast<std::size_t>(match[0].trainIdx)].pt);
            }
        if (from.size() < 10)
            return std::nullopt;
        const cv::Mat homography = cv::findHomography(from, to, cv::RANSAC, 3);
        if (homography.empty())
            return std::nullopt;
        const float right = static_cast<float>(size_.width) - 0.5F, bottom = static_cast<float>(size_.height) - 0.5F;
        const std::vector<cv::Point2f> corners{{-0.5F, -0.5F}, {right, -0.5F}, {right, bottom}, {-0.5F, bottom}};
        std::vector<cv::Point2f> seen;
        cv::perspectiveTransform(corners, seen, homography);
        return Quad{seen[0], seen[1], seen[2], seen[3]};
    }

private:
    cv::Size size_;
    cv::Ptr<cv::ORB> features_ = cv::ORB::create(1000);
    cv::BFMatcher matcher_{cv::NORM_HAMMING};
    std::vector<cv::KeyPoint> points_;
    cv::Mat descriptors_;
};

struct Result {
    int found = 0;
    double error_px = 0; // sum over the frames
    std::vector<double> ms;

    void add(const std::optional<Quad> &seen, const Quad &truth, Clock::duration spent) {
        ms.push_back(std::chrono::duration<double, std::milli>(spent).count());
        if (!seen)
            return;
        ++found;
        for (std::size_t i = 0; i < 4; ++i)
            error_px += cv::norm((*seen)[i] - truth[i]) / 4;
    }
    void print(const char *name) const {
        const double mean = std::accumulate(ms.begin(), ms.end(), 0.0) / static_cast<double>(ms.size());
        std::printf(
            "%-14s found %5.1f %%   mean error of corners %5.2f px   ms mean %5.2f p50 %5.2f p95 %5.2f   %4.0f fps\n",
            name, 100.0 * found / static_cast<double>(ms.size()), error_px / std::max(found, 1), mean,
            percentile(ms, 0.5), percentile(ms, 0.95), 1000 / mean);
    }
    double fps() const {
        return 1000.0 * static_cast<double>(ms.size()) / std::accumulate(ms.begin(), ms.end(), 0.0);
    }
};

std::optional<Quad> quad_of(const std::vector<arhost_observation> &seen) {
    if (seen.empty())
        return std::nullopt;
    Quad quad;
    for (std::size_t i = 0; i < 4; ++i)
        quad[i] = {seen[0].corners_px[i][0], seen[0].corners_px[i][1]};
    return quad;
}

} // namespace

int main(int argc, char **argv) try {
    bool is_quick = false;
    arhost::command_line::CommandLine line("Measures the speed of tracker_image.");
    line.flag("--quick", is_quick, "Measure with fewer frames; the figures are less precise");
    if (const auto status = line.parse(argc, argv))
        return *status;
    const int frames = is_quick ? 200 : 2000;
    constexpr int full_search_every = 10; // the default of tracker.full_search_every
    const ScratchFolder folder;
    const cv::Mat picture = poster(3);
    const std::string file = (folder.path() / "poster.png").string();
    cv::imwrite(file, picture);
    Tracker tracker("tracker_image");
    if (tracker.created() != ARHOST_STATUS_OK ||
        tracker.start(plain_camera({640, 480}), {{0, 210, "image", file}}) != ARHOST_STATUS_OK)
        throw std::runtime_error(tracker.log());
    BareOpenCv opencv(picture);
    Result ours, bare;
    std::optional<Quad> last;
    for (int t = 0; t < frames; ++t) {
        const Quad truth = place(t);
        cv::Mat grey = empty_frame();
        draw(picture, truth, grey);
        cover_half(grey, truth, t);
        add_sensor(grey, static_cast<std::uint64_t>(t) + 1);
        const GreyFrame frame(grey);
        std::vector<arhost_expected_marker> expected;
        if (last)
            expected.push_back(expected_at(0, *last));
        auto begin = Clock::now();
        last = quad_of(tracker.track(frame, expected, !last || t % full_search_every == 0));
        ours.add(last, truth, Clock::now() - begin);
        begin = Clock::now();
        const auto seen = opencv.find(grey);
        bare.add(seen, truth, Clock::now() - begin);
    }
    std::printf("%d frames of 640x480, half of the picture covered\n", frames);
    ours.print("tracker_image");
    bare.print("OpenCV, ORB");
    const bool met = ours.found >= 0.98 * frames && ours.error_px <= ours.found && ours.fps() >= 60;
    std::printf("target: found 98 %%, error 1 px, 60 fps: %s\n", met ? "met" : "MISSED");
    return met ? 0 : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "poster-speed: %s\n", error.what());
    return 1;
}
