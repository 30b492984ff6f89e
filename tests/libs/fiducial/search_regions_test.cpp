// SPDX-License-Identifier: Apache-2.0
#include <fiducial/search_regions.hpp>

#include "tracker_support.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <set>
#include <string>

namespace {

using arhost::fiducial::Family;
using arhost::fiducial::FamilyTraits;
using arhost::fiducial::Pass;
using arhost::fiducial::RegionLimits;
using arhost::fiducial::SearchRegions;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

// Markers 0 to 3: 0 and 1 belong to the first target, the others to targets of their own. Marker 3 is of the second
// family. All need a margin of half of their side.
class Regions : public testing::Test {
protected:
    Regions() {
        for (std::int32_t i = 0; i < 4; ++i)
            markers_.push_back(arhost::test::marker_config(i, i == 3 ? 1 : 0, std::max(i - 1, 0)));
        setup_.markers = markers_.data();
        setup_.marker_count = 4;
        setup_.families = families_;
        setup_.family_count = 2;
        format_.width = 400;
        format_.height = 300;
        frame_.format = &format_;
        request_.frame = &frame_;
        regions_.emplace(setup_, [](const std::string &family) {
            return FamilyTraits{0.5, family == "tag36h11" ? 36 : 25};
        });
    }
    // Expects a marker with sides of 20 px, centred here, to 5 px.
    void expect(std::uint32_t marker, double x, double y) {
        expected_.push_back({sizeof(arhost_expected_marker),
                             marker,
                             {{x - 10, y - 10}, {x + 10, y - 10}, {x + 10, y + 10}, {x - 10, y + 10}},
                             5});
        request_.expected = expected_.data();
        request_.expected_count = static_cast<std::uint32_t>(expected_.size());
    }
    std::vector<cv::Rect> regions(const RegionLimits &limits = {}, const Family *family = nullptr) const {
        return regions_->rectangles(request_, limits, family);
    }
    bool missed(const std::vector<arhost_observation> &seen) const { return regions_->miss_a_target(request_, seen); }
    static arhost_observation seen(std::int32_t id, std::uint32_t family = 0) {
        arhost_observation one{};
        one.id = id;
        one.family = family;
        return one;
    }

    const char *families_[2] = {"tag36h11", "tag25h9"};
    std::vector<arhost_marker_config> markers_;
    std::vector<arhost_expected_marker> expected_;
    arhost_tracker_setup setup_{};
    arhost_frame_format format_{};
    arhost_frame frame_{};
    arhost_track_request request_{};
    std::optional<SearchRegions> regions_;
};

const cv::Rect whole_frame(0, 0, 400, 300);

TEST_F(Regions, AreTheWholeFrameIfTheRequestSaysSo) {
    expect(0, 100, 100);
    request_.search_everywhere = 1;
    EXPECT_THAT(regions(), ElementsAre(whole_frame));
}

TEST_F(Regions, ContainTheExpectedCornersWithTheirMarginAndThatOfThePrint) {
    expect(0, 100, 150);
    EXPECT_THAT(regions(), ElementsAre(cv::Rect(75, 125, 51, 51))); // ±10 of the square, ±5, ±20/2
}

TEST_F(Regions, ThatOverlapBecomeOne) {
    expect(0, 100, 100);
    expect(1, 300, 100);
    expect(2, 130, 100);
    EXPECT_THAT(regions(), UnorderedElementsAre(cv::Rect(75, 75, 81, 51), cv::Rect(275, 75, 51, 51)));
    expect(3, 215, 100); // overlaps neither
    EXPECT_EQ(regions().size(), 3u);
    expected_.back().margin_px = 40; // overlaps both
    EXPECT_THAT(regions(), ElementsAre(cv::Rect(75, 40, 251, 121)));
}

TEST_F(Regions, BeginOnTheGrid) {
    expect(0, 100, 150);
    EXPECT_THAT(regions({8, 1}), ElementsAre(cv::Rect(72, 120, 56, 56)));
}

TEST_F(Regions, AreLargeEnoughForTheDetector) {
    expect(0, 100, 150);
    expect(2, -10, 285); // cut off by two borders
    for (const cv::Rect &region : regions({4, 90})) {
        EXPECT_GE(region.width, 90) << region;
        EXPECT_GE(region.height, 90) << region;
        EXPECT_EQ(region & whole_frame, region);
        EXPECT_EQ(region.x % 4 + region.y % 4, 0) << region;
    }
}

TEST_F(Regions, EndAtTheBorderOfTheFrame) {
    expect(0, 0, 0);
    expect(2, 399, 299);
    EXPECT_THAT(regions(), ElementsAre(cv::Rect(0, 0, 26, 26), cv::Rect(374, 274, 26, 26)));
    format_.width = format_.height = 1;
    EXPECT_THAT(regions({4, 8}), ElementsAre(cv::Rect(0, 0, 1, 1)));
}

TEST_F(Regions, OutsideOfTheFrameAreLeftOut) {
    expect(0, -26, 100);
    expect(1, 100, 1e300);
    expect(2, std::numeric_limits<double>::quiet_NaN(), 100);
    EXPECT_THAT(regions(), IsEmpty());
}

TEST_F(Regions, ThatCoverMostOfTheFrameAreTheWholeFrame) {
    expect(0, 100, 150);
    expected_.back().margin_px = 1e12;
    EXPECT_THAT(regions(), ElementsAre(whole_frame));
}

TEST_F(Regions, AreThoseOfOneFamilyIfThatIsGiven) {
    expect(0, 100, 150);
    expect(3, 300, 150);
    const Family second{"tag25h9", 1, 35, {{0, 1}, {3, 1}}};
    EXPECT_THAT(regions({}, &second), ElementsAre(cv::Rect(275, 125, 51, 51)));
}

TEST_F(Regions, MissATargetIfNoneOfItsExpectedMarkersIsSeen) {
    expect(0, 100, 150);
    expect(1, 200, 150);
    expect(3, 300, 150);
    EXPECT_FALSE(missed({seen(1), seen(3, 1)}));
    EXPECT_TRUE(missed({seen(0), seen(1)}));
    EXPECT_TRUE(missed({seen(0), seen(3, 0)})) << "of another family";
    request_.search_everywhere = 1;
    EXPECT_FALSE(missed({})) << "everything has been searched";
}

TEST_F(Regions, AreSearchedByEachPassAndThenTheWholeFrameIfATargetIsMissed) {
    expect(0, 100, 150);
    expect(3, 300, 150);
    const Family first{"tag36h11", 0, 587, {{0, 0}, {1, 0}, {2, 0}}}, second{"tag25h9", 1, 35, {{0, 1}, {3, 1}}};
    std::vector<std::pair<int, cv::Rect>> searched; // pass and region
    bool finds_second = true;
    std::size_t candidates = 3; // of the first pass
    const auto search = [&] {
        searched.clear();
        const Pass passes[] = {{&first,
                                [&](const cv::Rect &region, auto &all) {
                                    searched.emplace_back(1, region);
                                    all.candidates += candidates;
                                    all.markers.push_back(seen(0));
                                }},
                               {&second, [&](const cv::Rect &region, auto &all) {
                                    searched.emplace_back(2, region);
                                    all.candidates += region == whole_frame ? 8 : 2;
                                    if (finds_second)
                                        all.markers.push_back(seen(3, 1));
                                }}};
        return regions_->search(request_, {}, passes);
    };
    const std::pair near_first(1, cv::Rect(75, 125, 51, 51)), near_second(2, cv::Rect(275, 125, 51, 51));
    auto found = search();
    EXPECT_EQ(found.markers.size(), 2u);
    EXPECT_EQ(found.candidates, 3u) << "those of the pass with most of them";
    candidates = 0;
    EXPECT_EQ(search().candidates, 2u) << "at least as many as markers";
    candidates = 3;
    EXPECT_THAT(searched, ElementsAre(near_first, near_second));
    finds_second = false;
    found = search();
    EXPECT_EQ(found.markers.size(), 1u) << "what the first search found is not reported twice";
    EXPECT_EQ(found.candidates, 8u);
    EXPECT_THAT(searched, ElementsAre(near_first, near_second, std::pair(1, whole_frame), std::pair(2, whole_frame)));
}

TEST_F(Regions, OfVerifiedMarkersAreSearchedOnlyIfEverythingIs) {
    expect(0, 100, 150);
    expect(3, 300, 150);
    const arhost::fiducial::Verify verify = [&](const arhost_expected_marker &expected, std::int32_t id,
                                                std::uint32_t family) {
        EXPECT_EQ(expected.marker, static_cast<std::uint32_t>(id));
        return id == 3 ? std::optional(seen(id, family)) : std::nullopt;
    };
    for (const bool everywhere : {false, true}) {
        request_.search_everywhere = everywhere;
        const auto verified = regions_->verified(request_, verify);
        std::vector<cv::Rect> searched;
        const Pass pass{.family = nullptr, .detect = [&](const cv::Rect &region, auto &all) {
                            searched.push_back(region);
                            all.candidates += 1;
                            EXPECT_EQ(arhost::fiducial::markers_of(verified).size(), 1u);
                            all.markers.push_back(seen(0));
                        }};
        const auto found = regions_->search(request_, {}, {&pass, 1}, verified);
        EXPECT_THAT(searched, ElementsAre(everywhere ? whole_frame : cv::Rect(75, 125, 51, 51)));
        std::vector<int> ids;
        for (const arhost_observation &one : found.markers)
            ids.push_back(one.id);
        EXPECT_THAT(ids, UnorderedElementsAre(0, 3));
        EXPECT_EQ(found.candidates, 2u);
    }
}

// A pass that sees marker 0 and has a fast and a slow closer look.
class CloserLooks : public Regions {
protected:
    arhost::fiducial::Seen search() {
        searched_.clear();
        wanted_.clear();
        const auto look = [&](const std::string &name) {
            return [this, name](const cv::Rect &region, auto &all) {
                searched_.emplace_back(name, region);
                for (std::int32_t id = 0; id < 4; ++id)
                    if (!all.wants || all.wants(id, 0))
                        wanted_.insert(id);
                all.markers.insert(all.markers.end(), finds_.begin(), finds_.end());
                all.candidates += 7;
            };
        };
        const Pass pass{.family = nullptr,
                        .detect =
                            [&](const cv::Rect &region, auto &all) {
                                searched_.emplace_back("normal", region);
                                if (region.contains({100, 150}))
                                    all.markers.push_back(seen(0));
                                all.candidates += 2;
                            },
                        .closer_looks = {{look("fast"), false}, {look("slow"), true}}};
        return regions_->search(request_, {}, {&pass, 1});
    }
    using Search = std::pair<std::string, cv::Rect>;

    std::vector<Search> searched_;
    std::set<std::int32_t> wanted_;         // by the closer looks, of the first family
    std::vector<arhost_observation> finds_; // the closer looks
    const cv::Rect first_{75, 125, 51, 51}, third_{275, 125, 51, 51};
};

TEST_F(CloserLooks, AreTakenWhereMarkersOfMissedTargetsAreExpected) {
    expect(0, 100, 150);
    expect(1, 200, 150); // belongs to the target of marker 0
    expect(2, 300, 150);
    finds_ = {seen(2), seen(0), seen(9)};
    const auto found = search();
    EXPECT_THAT(wanted_, ElementsAre(2)) << "others need not be refined again";
    EXPECT_THAT(searched_, testing::IsSupersetOf({Search("fast", third_), Search("slow", third_)}));
    EXPECT_THAT(searched_, testing::Not(testing::Contains(testing::Pair("fast", first_))));
    EXPECT_EQ(found.candidates, 7u) << "the search with most of them";
    std::vector<int> ids;
    for (const arhost_observation &one : found.markers)
        ids.push_back(one.id);
    EXPECT_THAT(ids, UnorderedElementsAre(0, 2, 2)) << "by both looks, and no markers but those of missed targets";
}

TEST_F(CloserLooks, PrecedeASearchOfTheWholeFrame) {
    expect(0, 100, 150);
    expect(2, 300, 150);
    EXPECT_EQ(search().markers.size(), 1u);
    EXPECT_THAT(searched_, ElementsAre(Search("normal", first_), Search("normal", third_), Search("fast", third_),
                                       Search("slow", third_), Search("normal", whole_frame)));
}

TEST_F(CloserLooks, KeepWhatTheyAndTheRegionsHaveFoundIfAnotherTargetIsMissed) {
    expect(2, 300, 150);
    expect(3, 200, 150);
    finds_ = {seen(2)};
    finds_[0].decision_margin = 7;
    const auto found = search();
    ASSERT_THAT(searched_, testing::Contains(Search("normal", whole_frame)));
    EXPECT_THAT(found.markers, testing::Contains(testing::Field(&arhost_observation::decision_margin, 7)));
}

TEST_F(CloserLooks, AreTakenAtExpectedPlacesAlsoIfEverythingIsSearched) {
    expect(2, 300, 150);
    request_.search_everywhere = 1;
    finds_ = {seen(2)};
    search();
    EXPECT_THAT(searched_,
                ElementsAre(Search("normal", whole_frame), Search("fast", third_), Search("slow", third_)));
}

TEST_F(CloserLooks, SearchTheWholeFrameOrATileForTargetsThatAreNotExpected) {
    request_.search_everywhere = 1;
    format_.width = 1280;
    format_.height = 720;
    const cv::Rect everywhere(0, 0, 1280, 720);
    for (frame_.sequence = 0; frame_.sequence < 3; ++frame_.sequence) {
        search();
        EXPECT_THAT(searched_, ElementsAre(Search("normal", everywhere), Search("fast", everywhere),
                                           Search("slow", SearchRegions::tile_of({1280, 720}, frame_.sequence))));
    }
}

TEST_F(CloserLooks, AreSlowInAtMostTheAreaOfATile) {
    format_.width = 1280;
    format_.height = 720;
    expect(2, 700, 300);
    expected_.back().margin_px = 210;
    search();
    EXPECT_THAT(searched_, ElementsAre(testing::Pair("normal", testing::_), testing::Pair("fast", testing::_),
                                       testing::Pair("normal", cv::Rect(0, 0, 1280, 720))));
}

TEST_F(CloserLooks, AreNotTakenForMarkersOfSmallFamilies) {
    expect(0, 100, 150);
    expect(3, 300, 150);
    search();
    EXPECT_THAT(searched_, testing::Each(testing::Pair("normal", testing::_)));
}

TEST_F(CloserLooks, DoNotCountIfTheMarkerIsProbablyChance) {
    expect(2, 300, 150);
    finds_ = {seen(2)};
    finds_[0].false_positive_rate = 1e-6;
    EXPECT_THAT(search().markers, testing::SizeIs(1)) << "that of the whole frame";
}

TEST_F(CloserLooks, AreNotTakenIfAllTargetsAreSeen) {
    request_.search_everywhere = 1;
    int looks = 0;
    const Pass pass{.family = nullptr,
                    .detect =
                        [&](const cv::Rect &, auto &all) {
                            all.markers = {seen(1), seen(2), seen(3, 1)};
                        },
                    .closer_looks = {{[&](const cv::Rect &, auto &) { ++looks; }, false}}};
    EXPECT_EQ(regions_->search(request_, {}, {&pass, 1}).markers.size(), 3u);
    EXPECT_EQ(looks, 0) << "one marker of the first target is enough";
}

TEST(Tiles, AreTheWholeOfASmallFrame) {
    for (const cv::Size size : {cv::Size(1, 1), cv::Size(300, 20), cv::Size(480, 360)})
        for (const std::uint64_t sequence : {0, 1, 1000})
            EXPECT_EQ(SearchRegions::tile_of(size, sequence), cv::Rect({}, size));
}

TEST(Tiles, ContainEveryMarkerOf96PxSoonHoweverOftenFramesAreSearched) {
    for (const cv::Size size : {cv::Size(481, 361), cv::Size(640, 480), cv::Size(1280, 720), cv::Size(1920, 1080)})
        for (const std::uint64_t every : {1, 2, 5, 6, 10, 30, 34, 55, 89}) {
            std::set<std::pair<int, int>> begins;
            for (std::uint64_t sequence = 0; sequence < 300 * every; sequence += every) {
                const cv::Rect tile = SearchRegions::tile_of(size, sequence);
                ASSERT_EQ(tile & cv::Rect({}, size), tile);
                ASSERT_EQ(tile.size(), cv::Size(480, 360));
                begins.emplace(tile.x, tile.y);
            }
            for (int y = 0; y <= size.height - 96; y += 24)
                for (int x = 0; x <= size.width - 96; x += 24)
                    EXPECT_TRUE(std::ranges::any_of(
                        begins,
                        [&](const auto &begin) {
                            const cv::Rect marker(x, y, 96, 96);
                            return (cv::Rect({begin.first, begin.second}, cv::Size(480, 360)) & marker) == marker;
                        }))
                        << x << ' ' << y << " in " << size << ", every " << every;
        }
}

} // namespace
