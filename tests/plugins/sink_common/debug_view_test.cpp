// SPDX-License-Identifier: Apache-2.0
#include "sink_common/debug_view.hpp"

#include "sink_under_test.hpp"
#include "tracked_record.hpp"

#include <gmock/gmock.h>

#include <array>
#include <limits>

namespace arhost::drawing {
namespace {

constexpr std::uint32_t width = 640, height = 480, stride = 3 * width + 5;

// Whether the pixel has this colour, with at least this opacity over black.
bool has(const std::uint8_t *bgr, Colour colour, double opacity = 1) {
    const std::uint8_t wanted[] = {colour.blue, colour.green, colour.red};
    return std::ranges::all_of(std::array{0, 1, 2},
                               [&](int i) { return bgr[i] <= wanted[i] && bgr[i] >= opacity * wanted[i] - 1; });
}

class Black {
public:
    const std::uint8_t *at(double x, double y) const {
        return bgr.data() + std::size_t(std::lround(y)) * stride + 3 * std::size_t(std::lround(x));
    }
    bool is_black() const {
        return std::ranges::all_of(bgr, [](std::uint8_t byte) { return byte == 0; });
    }
    std::vector<std::uint8_t> bgr = std::vector<std::uint8_t>(std::size_t(stride) * height);
};

class DebugViewTest : public testing::Test {
protected:
    DebugViewTest() {
        const arhost_intrinsics lens = test::make_intrinsics(width, height);
        arhost_sink_setup setup{};
        setup.width = width;
        setup.height = height;
        setup.intrinsics = &lens;
        view().start(setup);
    }
    DebugView &view() {
        if (!view_) {
            arhost_option option{};
            option.struct_size = sizeof option;
            option.key = DebugView::key;
            option.type = ARHOST_OPTION_BOOL;
            option.integer = 1;
            view_.emplace(Options(&option, 1));
        }
        return *view_;
    }
    // Draws over a black frame.
    Black draw(const arhost_record &record) {
        Black drawn;
        arhost_output output{};
        output.struct_size = sizeof output;
        output.width = width;
        output.height = height;
        output.stride = stride;
        output.bgr = frame.bgr.data();
        output.record = &record;
        const arhost_output &result = view().applied_to(output);
        EXPECT_EQ(result.width, width);
        EXPECT_EQ(result.record, &record);
        for (std::size_t y = 0; y < height; ++y)
            std::copy_n(result.bgr + y * result.stride, 3 * width, drawn.bgr.data() + y * stride);
        return drawn;
    }

    Black frame;
    std::optional<DebugView> view_;
};

constexpr double corners[4][2] = {{200, 150}, {300, 160}, {310, 260}, {190, 250}};

test::TrackedRecord tracked() {
    test::TrackedRecord record{test::make_record(0), {}, {}};
    record.add_target("cup", ARHOST_TARGET_DETECTED, {0, 0, -500});
    record.add_observation(23, corners);
    return record;
}

arhost_expected_marker expected_at(double left, double top, double margin_px) {
    return {sizeof(arhost_expected_marker),
            0,
            {{left, top}, {left + 80, top}, {left + 80, top + 80}, {left, top + 80}},
            margin_px};
}

} // namespace

TEST_F(DebugViewTest, DrawsNothingIfItIsOff) {
    view().is_on = false;
    arhost_output output{};
    EXPECT_EQ(&view().applied_to(output), &output);
}

TEST_F(DebugViewTest, DrawsDetectedAndUnlistedMarkersAndLeavesTheFrameAsItIs) {
    test::TrackedRecord record = tracked();
    const double other[4][2] = {{420, 300}, {500, 300}, {500, 380}, {420, 380}};
    record.add_observation(24, other, false);
    const Black drawn = draw(record);
    for (int i = 0; i < 4; ++i) {
        const double *a = corners[i], *b = corners[(i + 1) % 4];
        EXPECT_TRUE(has(drawn.at(a[0], a[1]), yellow, 0.6)) << i;
        EXPECT_TRUE(has(drawn.at((a[0] + b[0]) / 2, (a[1] + b[1]) / 2), yellow, 0.6)) << i;
        EXPECT_TRUE(has(drawn.at(other[i][0], other[i][1]), pink, 0.6)) << i;
    }
    EXPECT_TRUE(frame.is_black());
}

TEST_F(DebugViewTest, MagnifiesTheResiduals) {
    test::TrackedRecord record = tracked();
    std::ranges::copy(&corners[0][0], &corners[0][0] + 8, &record.observations[0].projected_px[0][0]);
    const auto line_at = [&](const Black &drawn, double x) {
        return has(drawn.at(x, 150), violet, 0.9) && !has(drawn.at(x, 153), violet, 0.1);
    };
    record.observations[0].projected_px[0][0] -= 0.4; // a line of 20 px to the left
    const Black drawn = draw(record);
    EXPECT_TRUE(line_at(drawn, 190) && line_at(drawn, 181));
    EXPECT_FALSE(line_at(drawn, 177));
    record.observations[0].projected_px[0][0] -= 50; // limited to the longest side, which has 120 px
    const Black limited = draw(record);
    EXPECT_TRUE(line_at(limited, 85));
    EXPECT_FALSE(line_at(limited, 70));
}

TEST_F(DebugViewTest, DrawsExpectedPlacesAndMissedMarkers) {
    test::TrackedRecord record{test::make_record(0), {}, {}};
    record.expected = {expected_at(100, 150, 20), expected_at(300, 150, 20)};
    record.fields.search = {0, 1, 0, 2, 1, 0, {}};
    const Black drawn = draw(record);
    for (const double left : {100.0, 300.0}) {
        EXPECT_TRUE(has(drawn.at(left - 20, 130), cyan)) << left;
        EXPECT_TRUE(has(drawn.at(left + 100, 250), cyan)) << left;
        int dashed = 0;
        for (int x = -20; x <= 100; ++x)
            dashed += has(drawn.at(left + x, 130), cyan);
        EXPECT_GT(dashed, 40);
        EXPECT_LT(dashed, 90);
    }
    EXPECT_FALSE(has(drawn.at(100, 190), grey, 0.6)) << "this one was seen";
    EXPECT_TRUE(has(drawn.at(300, 190), grey, 0.6));
}

TEST_F(DebugViewTest, TheRecordOfAReplayHasNumbersWithoutPlaces) {
    test::TrackedRecord record{test::make_record(0), {}, {}};
    const Black before = draw(record);
    record.fields.search = {0, 1, 0, 2, 1, 0, {}};
    const Black drawn = draw(record);
    EXPECT_NE(drawn.bgr, before.bgr) << "the box has a row more";
    const std::size_t below_the_box = std::size_t{stride} * 100;
    EXPECT_TRUE(std::ranges::equal(std::span(drawn.bgr).subspan(below_the_box),
                                   std::span(before.bgr).subspan(below_the_box)));
}

TEST_F(DebugViewTest, SurvivesPlacesFarOutsideTheFrame) {
    for (const double far : {-1e5, 1e7, 1e300, -std::numeric_limits<double>::max()}) {
        const double corners_px[4][2] = {{far, far}, {200, far}, {far, 100}, {-far, 300}};
        test::TrackedRecord record = tracked();
        record.add_target("far", ARHOST_TARGET_DETECTED, {far, 0, -1});
        record.add_observation(1, corners_px).projected_px[0][0] = -far;
        record.add_observation(2, corners_px, false);
        record.expected = {expected_at(far, 10, 20), expected_at(10, far, std::abs(far))};
        record.fields.search = {0, 1, 0, 2, 2, 0, {}};
        EXPECT_TRUE(has(draw(record).at(200, 150), yellow, 0.6)) << far;
    }
}

TEST(PictureCanvas, LinesMayBeAlmostHorizontal) {
    for (const double rise : {1e-14, 1e-13, 1e-12, 1e-10, -1e-14, -1e-13, -1e-12, -1e-10})
        for (const double y : {200.0, 200.25, 200.5, 200.75}) {
            Black picture;
            const PictureCanvas canvas(picture.bgr.data(), stride, width, height);
            canvas.line({100.5, y}, {180.5, y + rise}, white);
            canvas.line({180.5, y + rise}, {100.5, y}, white);
            EXPECT_GT(picture.at(140, static_cast<std::size_t>(y))[0], 100) << y << " " << rise;
        }
}

TEST(PictureCanvas, LinesAreSmoothAndStayInThePicture) {
    Black picture;
    const PictureCanvas canvas(picture.bgr.data(), stride, width, height);
    canvas.line({-50, 100.25}, {5000, 100.25}, white); // centred a quarter of a pixel below the edge of a row
    EXPECT_NEAR(picture.at(300, 99)[0], 255 * 0.25, 2);
    EXPECT_NEAR(picture.at(300, 100)[0], 255 * 0.75, 2);
    EXPECT_EQ(picture.at(639, 100)[0], picture.at(0, 100)[0]);
    for (std::size_t y = 0; y < height; ++y) // the bytes between the rows
        for (std::size_t x = 3 * width; x < stride; ++x)
            ASSERT_EQ(picture.bgr[y * stride + x], 0);
}

} // namespace arhost::drawing
