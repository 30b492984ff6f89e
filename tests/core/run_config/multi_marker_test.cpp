// SPDX-License-Identifier: Apache-2.0
#include "run_config/multi_marker.hpp"

#include "errors.hpp"

#include <gmock/gmock.h>

using arhost::run_config::is_multi_marker_file;
using arhost::run_config::MultiMarker;
using arhost::run_config::parse_multi_marker_file;
using testing::StartsWith;

namespace {

const std::string rows = "1 0 0 35\n0 0 1.0 -7\n0 -1 0 0.5\n";

// Returns the error message without the name of the file.
std::string error_in(const std::string &text) {
    return arhost::test::after("marker.dat:",
                               arhost::test::error_of([&] { parse_multi_marker_file("marker.dat", text); }));
}

} // namespace

TEST(MultiMarkerFile, IsRecognisedByItsFirstLine) {
    EXPECT_TRUE(is_multi_marker_file("#the number of patterns\r\n\r\n 6\t\r\n"));
    EXPECT_FALSE(is_multi_marker_file("version: 1\nfamily: tag36h11\n"));
    EXPECT_FALSE(is_multi_marker_file("6 x\n"));
    EXPECT_FALSE(is_multi_marker_file("# only a comment\n"));
    EXPECT_FALSE(is_multi_marker_file(""));
}

TEST(MultiMarkerFile, HasPatternsAndIdsWithTheirPlaces) {
    const auto markers = parse_multi_marker_file("marker.dat", "# two\n2\n\n#marker 1\nmy a.patt \r\n40.0\r\n" +
                                                                   rows + "\n00\t\t\n+30\n0.0 0.0\n" + rows);
    ASSERT_EQ(markers.size(), 2u);
    EXPECT_EQ(markers[0].print, "my a.patt");
    EXPECT_EQ(markers[0].where, "marker.dat:5");
    EXPECT_EQ(markers[0].side_mm, 40);
    EXPECT_EQ(markers[0].position_mm, glm::dvec3(35, -7, 0.5));
    EXPECT_EQ(markers[0].rotation * glm::dvec3(0, 1, 0), glm::dvec3(0, 0, -1));
    EXPECT_EQ(markers[1].print, "00");
    EXPECT_EQ(markers[1].side_mm, 30);
    EXPECT_EQ(markers[1].position_mm, glm::dvec3(35, -7, 0.5)) << "the centre of ARToolKit 2 is skipped";
}

TEST(MultiMarkerFile, RejectsErrorsWithTheirLine) {
    const arhost::test::ErrorCase cases[] = {
        {"0\n", StartsWith("1: the number of markers must be 1 to 1024, but is '0'")},
        {"1.5\n", StartsWith("1: the number of markers must be")},
        {"1e300\n", StartsWith("1: the number of markers must be")},
        {"2\na.patt\n40\n" + rows,
         StartsWith("6: the file ends where marker 2 is expected; complete it, or correct the number of markers")},
        {"1\na.patt\n", StartsWith("2: the file ends where the width of marker 1")},
        {"1\na.patt\nwide\n" + rows,
         StartsWith("3: the width of marker 1 must be a number from 0.01 to 1e+06, in mm, but is 'wide'")},
        {"1\na.patt\n-40\n" + rows, StartsWith("3: the width of marker 1 must be")},
        {"1\na.patt\n40\n1 0 0\n",
         StartsWith("4: row 1 of the matrix of marker 1 must be 4 numbers, such as '1 0 0 35', but is '1 0 0'")},
        {"1\na.patt\n40\n1 0 0 nan\n", StartsWith("4: row 1 of the matrix")},
        {"1\na.patt\n40\n1 0 0 35\n0 1 0 \x01\n",
         StartsWith("5: row 2 of the matrix of marker 1 must be 4 numbers, such as '1 0 0 35', but is '0 1 0  '")},
        {"1\na.patt\n40\n1 0 0 35\n0 1 0 0\n",
         StartsWith("5: the file ends where the matrix of marker 1 is expected")},
    };
    expect_errors([&](const std::string &text) { return error_in(text); }, cases);
    for (const char *matrix :
         {"1 0 0 0\n0 1 0 0\n0 0 -1 0\n", "2 0 0 0\n0 2 0 0\n0 0 2 0\n", "1 0 0 0\n1 0 0 0\n0 0 1 0\n"})
        EXPECT_THAT(error_in(std::string("1\na.patt\n40\n") + matrix),
                    StartsWith("6: the first three columns of the matrix of marker 1 must be a rotation"))
            << matrix;
    EXPECT_THAT(error_in("1\na.patt\n40\n" + rows + "b.patt\n"),
                StartsWith("7: more follows after 1 markers; correct the number of markers"));
}
