// SPDX-License-Identifier: Apache-2.0
#include <fiducial/other_markers.hpp>

#include <fiducial/prints.hpp>

#include <gmock/gmock.h>

#include <array>
#include <stdexcept>
#include <vector>

namespace {

using namespace arhost::test;
using arhost::fiducial::Family;
using arhost::fiducial::markers_of_other_families;
using arhost::fiducial::OtherMarkers;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

// Looks for the markers 3 and 5 of the first family, in pictures of one pixel whose code is the number of the frame.
class OtherMarkersTest : public testing::Test {
protected:
    OtherMarkersTest() {
        host_.struct_size = sizeof host_;
        host_.context = this;
        host_.log = [](const arhost_host *host, arhost_severity, const char *text) {
            static_cast<OtherMarkersTest *>(host->context)->log_.emplace_back(text);
        };
    }
    void run(int frames, const std::vector<arhost_observation> &seen = {}) {
        for (int i = 0; i < frames; ++i)
            others_.frame(cv::Mat(1, 1, CV_8U, cv::Scalar(++frame_)), seen);
    }
    static arhost_observation sighting(std::int32_t id, double false_positive_rate) {
        arhost_observation one{};
        one.id = id;
        one.false_positive_rate = false_positive_rate;
        return one;
    }

    std::vector<std::string> log_;
    std::vector<int> searched_; // frames
    std::function<OtherMarkers::Markers(int frame)> markers_ = [](int) { return OtherMarkers::Markers{}; };

private:
    arhost_tracker_setup setup() {
        for (std::size_t i = 0; i < markers_of_setup_.size(); ++i)
            markers_of_setup_[i] = marker_config(i == 0 ? 3 : 5);
        arhost_tracker_setup setup{};
        setup.struct_size = sizeof setup;
        setup.markers = markers_of_setup_.data();
        setup.marker_count = static_cast<std::uint32_t>(markers_of_setup_.size());
        return setup;
    }

    std::array<arhost_marker_config, 2> markers_of_setup_{};
    arhost_host host_{};
    int frame_ = 0;

protected:
    OtherMarkers others_{arhost::Host(&host_), setup(), [this](const cv::Mat &grey) {
                             searched_.push_back(grey.at<std::uint8_t>(0, 0));
                             return markers_(searched_.back());
                         }};
};

TEST_F(OtherMarkersTest, SearchesEverRarerAndAtTheEnd) {
    run(100);
    EXPECT_THAT(searched_, ElementsAre(30, 60));
    others_.finish();
    others_.finish();
    EXPECT_THAT(searched_, ElementsAre(30, 60, 100));
    EXPECT_THAT(log_, IsEmpty());
}

TEST_F(OtherMarkersTest, NamesMarkersThatAreInTwoSuccessiveFrames) {
    markers_ = [](int frame) {
        return frame == 30 ? OtherMarkers::Markers{{"a", {1, 2}}, {"b", {7}}}
                           : OtherMarkers::Markers{{"a", {2, 4}}, {"b", {7}}, {"c", {9}}};
    };
    run(40);
    EXPECT_THAT(searched_, ElementsAre(30, 31)) << "one in each call, because a call has a deadline";
    EXPECT_THAT(log_, ElementsAre("other markers were in view: a 2; b 7"));
}

TEST_F(OtherMarkersTest, NamesMarkersThatAreInTheLastTwoFrames) {
    markers_ = [](int frame) {
        return frame == 9 ? OtherMarkers::Markers{{"a", {1, 2}}} : OtherMarkers::Markers{{"a", {2}}, {"c", {9}}};
    };
    run(10);
    others_.finish();
    EXPECT_THAT(searched_, ElementsAre(10, 9));
    EXPECT_THAT(log_, ElementsAre("other markers were in view: a 2"));
}

TEST_F(OtherMarkersTest, NamesEachFamilyOnceAndFiveOfItsMarkers) {
    markers_ = [](int frame) {
        return frame <= 31 ? OtherMarkers::Markers{{"a", {1, 2, 3, 4, 5, 6, 7}}}
                           : OtherMarkers::Markers{{"a", {1}}, {"b", {1}}};
    };
    run(61);
    EXPECT_THAT(log_, ElementsAre("other markers were in view: a 1, 2, 3, 4, 5 and 2 more",
                                  "other markers were in view: b 1"));
}

TEST_F(OtherMarkersTest, ASingleFrameSufficesIfThereIsNoOther) {
    markers_ = [](int) { return OtherMarkers::Markers{{"a", {1}}}; };
    run(1);
    others_.finish();
    EXPECT_THAT(log_, ElementsAre("other markers were in view: a 1"));
}

TEST_F(OtherMarkersTest, StopsWhenAListedMarkerIsSeen) {
    run(1, {sighting(5, 1e-9)});
    run(60);
    others_.finish();
    EXPECT_THAT(searched_, IsEmpty());
}

TEST_F(OtherMarkersTest, StopsWhenAListedMarkerOfASmallFamilyIsSeenInSuccessiveFrames) {
    run(1, {sighting(5, 1e-4)});
    run(28, {sighting(3, 1)});
    run(1, {sighting(5, 1e-4)});
    EXPECT_THAT(searched_, ElementsAre(30)) << "the sightings were not successive";
    run(1, {sighting(5, 1e-4)});
    run(60);
    EXPECT_THAT(searched_, ElementsAre(30));
}

TEST_F(OtherMarkersTest, IgnoresMarkersThatAreNotListed) {
    run(30, {sighting(4, 0)});
    EXPECT_THAT(searched_, ElementsAre(30));
}

TEST_F(OtherMarkersTest, ReportsASearchThatFails) {
    markers_ = [](int) -> OtherMarkers::Markers { throw std::runtime_error("no memory"); };
    run(100);
    others_.finish();
    EXPECT_THAT(log_, ElementsAre("the search for other markers failed: no memory"));
}

TEST_F(OtherMarkersTest, DoesNothingWithoutAFrame) {
    others_.finish();
    EXPECT_THAT(searched_, IsEmpty());
}

cv::Mat two_markers() {
    const arhost_intrinsics camera = intrinsics_of({480, 360}, 450, 450, 239.5, 179.5);
    return render(camera, {{april_tag("tagStandard41h12", 3).with_margin(1), 60, pose_of(-80, 0, 400, 10)},
                           {aruco_marker("DICT_4X4_250", 77), 60, pose_of(80, 0, 400, 10)}});
}

TEST(MarkersOfOtherFamilies, AreOfBothLibrariesExceptUsedFamilies) {
    const cv::Mat picture = two_markers();
    EXPECT_THAT(markers_of_other_families(picture, {}),
                ElementsAre(Pair("DICT_4X4_100", ElementsAre(77)), Pair("tagStandard41h12", ElementsAre(3))));
    const Family used[] = {{"tagStandard41h12", 0, 2115, {}}, {"DICT_4X4_100", 1, 100, {}}};
    EXPECT_THAT(markers_of_other_families(picture, used), IsEmpty());
}

TEST(MarkersOfOtherFamilies, AreFoundInLargePicturesThatAreReduced) {
    cv::Mat large;
    cv::resize(two_markers(), large, {}, 5, 5, cv::INTER_NEAREST);
    EXPECT_THAT(markers_of_other_families(large, {}),
                ElementsAre(Pair("DICT_4X4_100", ElementsAre(77)), Pair("tagStandard41h12", ElementsAre(3))));
}

TEST(MarkersOfOtherFamilies, AreNotInTinyPictures) {
    for (const cv::Size size : {cv::Size(1, 1), {7, 7}, {5000, 1}, {3, 5000}})
        EXPECT_THAT(markers_of_other_families(cv::Mat(size, CV_8UC1, cv::Scalar(90)), {}), IsEmpty()) << size;
}

} // namespace
