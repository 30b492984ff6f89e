// SPDX-License-Identifier: Apache-2.0
#include <fiducial/family_search.hpp>

#include <fiducial/prints.hpp>
#include <fiducial/rendered_marker.hpp>

#include <gmock/gmock.h>

namespace {

using namespace arhost::test;
using arhost::fiducial::Family;
using arhost::fiducial::markers_of_other_families;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

cv::Mat two_markers() {
    const arhost_intrinsics camera = intrinsics_of({480, 360}, 450, 450, 239.5, 179.5);
    return render(camera, {{april_tag("tagStandard41h12", 3).with_margin(1), 60, pose_of(-80, 0, 400, 10)},
                           {aruco_marker("DICT_4X4_250", 77), 60, pose_of(80, 0, 400, 10)}});
}

TEST(FamilySearch, FindsMarkersOfBothLibrariesExceptUsedFamilies) {
    const cv::Mat picture = two_markers();
    EXPECT_THAT(markers_of_other_families(picture, {}),
                ElementsAre(Pair("DICT_4X4_100", ElementsAre(77)), Pair("tagStandard41h12", ElementsAre(3))));
    const Family used[] = {{"tagStandard41h12", 0, 2115, {}}, {"DICT_4X4_100", 1, 100, {}}};
    EXPECT_THAT(markers_of_other_families(picture, used), IsEmpty());
}

TEST(FamilySearch, ReducesLargePictures) {
    cv::Mat large;
    cv::resize(two_markers(), large, {}, 5, 5, cv::INTER_NEAREST);
    EXPECT_THAT(markers_of_other_families(large, {}),
                ElementsAre(Pair("DICT_4X4_100", ElementsAre(77)), Pair("tagStandard41h12", ElementsAre(3))));
}

TEST(FamilySearch, FindsNothingInTinyPictures) {
    for (const cv::Size size : {cv::Size(1, 1), {7, 7}, {5000, 1}, {3, 5000}})
        EXPECT_THAT(markers_of_other_families(cv::Mat(size, CV_8UC1, cv::Scalar(90)), {}), IsEmpty()) << size;
}

} // namespace
