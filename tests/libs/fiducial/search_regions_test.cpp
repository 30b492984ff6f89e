// SPDX-License-Identifier: Apache-2.0
#include <fiducial/search_regions.hpp>

#include "tracker_support.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <set>
#include <string>
#include <tuple>

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

TEST_F(Regions, ThatAreTheWholeFrameAreSearchedOnce) {
    expect(0, 100, 150);
    expected_.back().margin_px = 1000;
    int searches = 0;
    const Pass pass{.family = nullptr, .detect = [&](const cv::Rect &region, auto &) {
                        EXPECT_EQ(region, whole_frame);
                        ++searches;
                    }};
    EXPECT_THAT(regions_->search(request_, {}, {&pass, 1}).markers, IsEmpty());
    EXPECT_EQ(searches, 1) << "although a target is missed";
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
                        .closer_looks = {{look("fast")}, {look("slow"), 1 / 16.0}}};
        return regions_->search(request_, {}, {&pass, 1});
    }
    using Search = std::pair<std::string, cv::Rect>;

    std::vector<Search> searched_;
    std::set<std::int32_t> wanted_;         // by the closer looks, of the first family
    std::vector<arhost_observation> finds_; // the closer looks
    static constexpr std::uint64_t frames_of_all_turns = 47;
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

TEST_F(CloserLooks, AreTakenOnlyAtExpectedPlacesAlsoIfEverythingIsSearched) {
    expect(2, 300, 150);
    request_.search_everywhere = 1;
    for (frame_.sequence = 0; frame_.sequence < 3; ++frame_.sequence) {
        search();
        EXPECT_THAT(searched_,
                    ElementsAre(Search("normal", whole_frame), Search("fast", third_), Search("slow", third_)));
    }
}

TEST_F(CloserLooks, TakeTurnsIfEverythingIsSearchedAndNoMissedMarkerIsExpected) {
    expect(0, 100, 150); // is seen
    request_.search_everywhere = 1;
    constexpr std::uint64_t first = 5;
    std::set<std::tuple<std::string, int, int>> closer;
    for (frame_.sequence = first; frame_.sequence < first + frames_of_all_turns; ++frame_.sequence) {
        search();
        const unsigned turn = SearchRegions::turn_of(frame_.sequence, 2 * SearchRegions::tile_count);
        const Search expected = turn % 2 == 0
                                    ? Search("fast", whole_frame)
                                    : Search("slow", SearchRegions::tile_of(whole_frame.size(), {}, turn / 2));
        ASSERT_THAT(searched_, ElementsAre(Search("normal", whole_frame), expected));
        closer.emplace(expected.first, expected.second.x, expected.second.y);
    }
    EXPECT_EQ(closer.size(), 1 + SearchRegions::tile_count) << "the fast one, and the slow one in each tile";
}

TEST_F(CloserLooks, TakeTurnsOnlyIfTheirPassHasAMissedMarker) {
    request_.search_everywhere = 1;
    const Family one{"tag36h11", 0, 587, {{0, 0}, {1, 0}}}, other{"tag36h10", 0, 587, {{2, 0}}};
    std::vector<std::string> looks;
    const auto pass = [&](const Family &family, const std::vector<std::int32_t> &sees) {
        return Pass{&family,
                    [sees](const cv::Rect &, auto &all) {
                        for (const std::int32_t id : sees)
                            all.markers.push_back(seen(id));
                    },
                    {{[&](const cv::Rect &, auto &) { looks.push_back(family.name); }}}};
    };
    const Pass passes[] = {pass(one, {1}), pass(other, {})};
    for (frame_.sequence = 0; frame_.sequence < 5; ++frame_.sequence)
        regions_->search(request_, {}, passes);
    EXPECT_EQ(looks, std::vector<std::string>(5, "tag36h10"));
}

TEST_F(CloserLooks, SearchAtMostTheirPartOfTheFrameAtExpectedPlaces) {
    format_.width = 1280;
    format_.height = 720;
    expect(2, 700, 300);
    for (const auto &[margin_px, is_taken] : {std::pair(99, true), {100, false}}) { // 239² and 241² px
        expected_.back().margin_px = margin_px;
        search();
        EXPECT_THAT(searched_, testing::Contains(testing::Pair("fast", testing::_)));
        EXPECT_EQ(std::ranges::count(searched_, "slow", &Search::first), is_taken) << margin_px;
    }
}

TEST_F(CloserLooks, AreNeededForMissedMarkersOfTheFamilyThatMayBeFound) {
    const Family first{"tag36h11", 0, 587, {{0, 0}, {1, 0}, {2, 0}}}, second{"tag25h9", 1, 35, {{3, 1}}};
    const auto need = [&](const std::vector<arhost_observation> &seen, const Family *family = nullptr) {
        return regions_->needs_closer_look(request_, seen, family);
    };
    request_.search_everywhere = 1;
    EXPECT_TRUE(need({seen(1)}));
    EXPECT_TRUE(need({seen(1)}, &first));
    EXPECT_FALSE(need({seen(1)}, &second)) << "has too few bits";
    EXPECT_FALSE(need({seen(1), seen(2)}));
    request_.search_everywhere = 0;
    expect(1, 200, 150);
    EXPECT_FALSE(need({seen(0)})) << "marker 2 is not expected, and the target of marker 1 is seen";
    EXPECT_TRUE(need({seen(2)}));
    expect(2, 300, 150);
    EXPECT_TRUE(need({seen(0)}));
    EXPECT_FALSE(need({seen(0), seen(2)}));
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
                    .closer_looks = {{[&](const cv::Rect &, auto &) { ++looks; }}}};
    EXPECT_EQ(regions_->search(request_, {}, {&pass, 1}).markers.size(), 3u);
    EXPECT_EQ(looks, 0) << "one marker of the first target is enough";
}

TEST(Tiles, AreThreeSeventhsOfTheFrameOnTheGridAndLargeEnoughForTheDetector) {
    for (const cv::Size size : {cv::Size(1, 1), cv::Size(7, 7), cv::Size(33, 9), cv::Size(640, 480)})
        for (const RegionLimits limits : {RegionLimits{}, {4, 8}, {6, 20}})
            for (unsigned index = 0; index < SearchRegions::tile_count; ++index) {
                const cv::Rect tile = SearchRegions::tile_of(size, limits, index);
                EXPECT_EQ(tile & cv::Rect({}, size), tile);
                EXPECT_EQ(tile.x % limits.grid_px + tile.y % limits.grid_px, 0) << tile;
                for (const auto &[part, whole] : {std::pair(tile.width, size.width), {tile.height, size.height}}) {
                    const int least = std::max((3 * whole + 6) / 7, std::min(whole, limits.min_side_px));
                    EXPECT_GE(part, least);
                    EXPECT_LT(part, least + limits.grid_px);
                }
            }
}

TEST(Tiles, ContainEveryMarkerOfASeventhOfTheWidthAndAFifthOfTheHeight) {
    for (const cv::Size size : {cv::Size(479, 361), cv::Size(640, 480), cv::Size(1280, 720), cv::Size(1920, 1080)})
        for (const RegionLimits limits : {RegionLimits{}, {4, 8}}) {
            std::vector<cv::Rect> tiles;
            for (unsigned index = 0; index < SearchRegions::tile_count; ++index)
                tiles.push_back(SearchRegions::tile_of(size, limits, index));
            const cv::Size marker(size.width / 7, size.height / 5);
            for (int y = 0; y <= size.height - marker.height; ++y)
                for (int x = 0; x <= size.width - marker.width; ++x) {
                    const cv::Rect place({x, y}, marker);
                    ASSERT_TRUE(std::ranges::any_of(tiles, [&](const cv::Rect &t) { return (t & place) == place; }))
                        << place << " in " << size;
                }
        }
}

TEST(Turns, OccurOnceInEachBlockAndSoAmongTwiceAsManyFrames) {
    for (const unsigned count : {1U, 12U, 24U, 36U, 48U})
        for (std::uint64_t begin = 0; begin < 5 * count; ++begin) {
            std::set<unsigned> turns;
            const std::uint64_t frames = begin % count == 0 ? count : 2 * count - 1;
            for (std::uint64_t sequence = begin; sequence < begin + frames; ++sequence)
                turns.insert(SearchRegions::turn_of(sequence, count));
            EXPECT_EQ(turns.size(), count) << "from " << begin;
            EXPECT_EQ(*turns.rbegin(), count - 1);
        }
}

TEST(Turns, AllOccurHoweverOftenFramesAreSearched) {
    constexpr unsigned count = 2 * SearchRegions::tile_count;
    for (const std::uint64_t every : {2, 5, 6, 10, 12, 24, 30, 34, 48, 55, 89}) {
        std::set<unsigned> turns;
        for (std::uint64_t sequence = 0; sequence < 300 * every; sequence += every)
            turns.insert(SearchRegions::turn_of(sequence, count));
        EXPECT_EQ(turns.size(), count) << "every " << every;
    }
}

} // namespace
