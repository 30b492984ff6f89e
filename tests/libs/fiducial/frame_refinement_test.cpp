// SPDX-License-Identifier: Apache-2.0
#include <fiducial/frame_refinement.hpp>

#include "tag_sheet.hpp"

#include <gmock/gmock.h>

#include <algorithm>

namespace arhost::test::frame_refinement {
namespace {

using fiducial::Corners;
using fiducial::FrameRefinement;
using fiducial::MeasuredCorners;
using fiducial::RoughMarker;

constexpr double plenty = 1e6; // work for each pixel
const TagSheet sheet{{320, 240}, {5, 3}, sheet_side_px};
const fiducial::Lens lens(plain_camera(sheet.size));

double area_px(const Corners &c) {
    return (c[2] - c[0]).cross(c[3] - c[1]) / 2;
}

// A picture of the sheet, and its tags as the AprilTag library finds them.
class Picture {
public:
    explicit Picture(const Exposure &exposure) : frame_(sheet.frame(exposure)) {
        const apriltag::Detector detector(apriltag_detector_create(), apriltag_detector_destroy);
        detector->quad_decimate = 1;
        apriltag_detector_add_family(detector.get(), family_.get());
        apriltag::detect(*detector, grey(), [&](const apriltag_detection_t &tag) {
            tags_.push_back({apriltag::corners_of(tag), tag.family->width_at_border,
                             [this, id = tag.id] { return apriltag::print_of(*family_, id); }, true});
        });
    }
    cv::Mat grey() const {
        const arhost_frame_format &format = frame_.format();
        return {static_cast<int>(format.height), static_cast<int>(format.width), CV_8U,
                const_cast<std::uint8_t *>(frame_.frame().grey), format.grey_stride};
    }
    const std::vector<RoughMarker> &tags() const { return tags_; }

    FrameRefinement refinement(const cv::Mat &grey, double work_per_px) const {
        return {grey, ARHOST_TRANSFER_LINEAR, lens, work_per_px};
    }
    std::vector<std::optional<MeasuredCorners>> refined(double work_per_px, const std::vector<RoughMarker> &tags,
                                                        int threads = 0) const {
        const cv::Mat pixels = grey();
        return refinement(pixels, work_per_px).refine(tags, threads);
    }

private:
    GreyFrame frame_;
    std::unique_ptr<apriltag_family_t, decltype(&tag36h11_destroy)> family_{tag36h11_create(), tag36h11_destroy};
    std::vector<RoughMarker> tags_;
};

std::vector<std::optional<Corners>> corners_of(const std::vector<std::optional<MeasuredCorners>> &refined) {
    std::vector<std::optional<Corners>> corners;
    for (const auto &one : refined)
        corners.push_back(one ? std::optional(one->corners_px) : std::nullopt);
    return corners;
}

const Exposure &sharp = exposures[0], &blurred = exposures[1], &overexposed = exposures[2];

// The fits took twice as much work and more when they began with a wrong blur and used all pixels in all steps.
TEST(FrameRefinement, PrintsNeedFewSteps) {
    for (const Exposure &exposure : {blurred, overexposed}) {
        const Picture picture(exposure);
        const cv::Mat grey = picture.grey();
        ASSERT_GE(picture.tags().size(), 10u) << exposure.name;
        std::uint64_t work = 0;
        for (const RoughMarker &tag : picture.tags()) {
            const auto by_edges = fiducial::refine_by_edges(grey, ARHOST_TRANSFER_LINEAR, tag.corners_px, lens,
                                                            tag.cells, tag.is_subpixel);
            EXPECT_TRUE(by_edges.need_print()) << exposure.name;
            EXPECT_TRUE(fiducial::refine_by_print(grey, ARHOST_TRANSFER_LINEAR, tag.corners_px, lens, tag.cells,
                                                  tag.print(), by_edges, work));
        }
        EXPECT_LE(work, picture.tags().size() * 6'500) << exposure.name;
    }
}

TEST(FrameRefinement, FitsTheLargestPrintsUntilTheBudgetIsSpent) {
    const Picture picture(overexposed);
    const std::vector<RoughMarker> &tags = picture.tags();
    const auto all = picture.refined(plenty, tags), none = picture.refined(0, tags),
               some = picture.refined(0.5, tags);
    double smallest_fitted = 1e9, largest_left = 0;
    std::size_t count = 0;
    for (std::size_t i = 0; i < tags.size(); ++i) {
        const double area = area_px(tags[i].corners_px);
        ASSERT_TRUE(all[i] && none[i] && some[i]) << "edges are fitted in any case";
        EXPECT_NE(all[i]->corners_px, none[i]->corners_px);
        if (some[i]->corners_px == none[i]->corners_px) {
            largest_left = std::max(largest_left, area);
            continue;
        }
        ++count;
        smallest_fitted = std::min(smallest_fitted, area);
        EXPECT_EQ(some[i]->corners_px, all[i]->corners_px);
    }
    EXPECT_GT(count, 1u);
    EXPECT_LT(count, tags.size() / 2);
    EXPECT_LE(largest_left, smallest_fitted);
}

TEST(FrameRefinement, DependsNeitherOnTheOrderOfTheMarkersNorOnThreads) {
    const Picture picture(blurred);
    std::vector<RoughMarker> tags = picture.tags();
    const auto expected = corners_of(picture.refined(0.5, tags, 1));
    EXPECT_EQ(corners_of(picture.refined(0.5, tags, 4)), expected);
    std::ranges::reverse(tags);
    auto reversed = corners_of(picture.refined(0.5, tags));
    std::ranges::reverse(reversed);
    EXPECT_EQ(reversed, expected);
}

TEST(FrameRefinement, DoesWhatRefineCornersDoesIfTheBudgetSuffices) {
    for (const Exposure &exposure : {sharp, blurred, overexposed}) {
        const Picture picture(exposure);
        const auto refined = picture.refined(plenty, picture.tags());
        for (std::size_t i = 0; i < refined.size(); ++i) {
            const RoughMarker &tag = picture.tags()[i];
            const auto alone = fiducial::refine_corners(picture.grey(), ARHOST_TRANSFER_LINEAR, tag.corners_px, lens,
                                                        tag.cells, tag.print, tag.is_subpixel);
            ASSERT_TRUE(alone && refined[i]) << exposure.name;
            EXPECT_EQ(refined[i]->corners_px, alone->corners_px);
        }
    }
}

TEST(FrameRefinement, HasOneBudgetForAllCallsInAFrame) {
    const Picture picture(blurred);
    const cv::Mat grey = picture.grey();
    FrameRefinement refinement = picture.refinement(grey, 0.5);
    refinement.refine(picture.tags());
    const std::span last(&picture.tags().back(), 1);
    EXPECT_EQ(refinement.refine(last).front(), std::nullopt);
    EXPECT_NE(picture.refinement(grey, 0.5).refine(last).front(), std::nullopt);
}

TEST(FrameRefinement, ReservesAPartOfTheBudgetOnce) {
    const Picture picture(overexposed);
    const cv::Mat grey = picture.grey();
    FrameRefinement refinement = picture.refinement(grey, 0.8);
    for (int call = 0; call < 3; ++call)
        refinement.reserve(0.3);
    const auto corners = corners_of(refinement.refine(picture.tags()));
    EXPECT_EQ(corners, corners_of(picture.refined(0.5, picture.tags())));
    EXPECT_NE(corners, corners_of(picture.refined(0.8, picture.tags())));
}

} // namespace
} // namespace arhost::test::frame_refinement
