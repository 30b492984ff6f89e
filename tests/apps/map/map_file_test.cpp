// SPDX-License-Identifier: Apache-2.0
#include "map/map_file.hpp"

#include "errors.hpp"
#include "plugin_under_test.hpp"
#include "simulated_markers.hpp"
#include "yaml/yaml.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

namespace arhost::map {
namespace {

using testing::EndsWith;
using testing::HasSubstr;

class MapFile : public testing::Test {
protected:
    std::filesystem::path write(const std::string &text) const {
        const auto file = scratch_.path() / "desk.map.yaml";
        std::ofstream(file) << text;
        return file;
    }
    std::string error_of(const std::string &text) const {
        return test::error_of<std::exception>([&] { read_map(write(text), family_); });
    }
    const marker::Family family_ = marker::find_family("tag36h11");

private:
    test::ScratchFolder scratch_;
};

TEST_F(MapFile, IsReadAsItWasWritten) {
    std::vector<LearnedMarker> markers;
    for (const Eigen::Vector3d &degrees : {Eigen::Vector3d(0, 0, 0),
                                           {10, -20, 170},
                                           {-179, 45, 3},
                                           {30, 90, 0},
                                           {30, -90, 0},
                                           {90, 0, 90},
                                           {0, 180, 0}}) {
        LearnedMarker &marker = markers.emplace_back();
        marker.id = static_cast<int>(markers.size());
        marker.side_mm = 40.25;
        const Eigen::Vector3d angles = pose::radians * degrees;
        marker.map_from_marker = {pose::rotation_by({0, 0, angles.z()}) * pose::rotation_by({0, angles.y(), 0}) *
                                      pose::rotation_by({angles.x(), 0, 0}),
                                  {1.5, -2.25, -1e-7}};
    }
    const std::string text = map_text(markers, family_, "# A desk.\n");
    EXPECT_THAT(text, HasSubstr("# A desk.\nversion: 1\nfamily: tag36h11\nmarkers:\n  - {id: 1, side_mm: 40.25, "
                                "position_mm: [1.5, -2.25, 0], rotation_degrees: [0, 0, 0]}\n  - {id: 2, side_mm: "
                                "40.25, position_mm: [1.5, -2.25, 0], rotation_degrees: [10, -20, 170]}\n"));
    const std::vector<Marker> read = read_map(write(text), family_);
    ASSERT_EQ(read.size(), markers.size());
    for (std::size_t i = 0; i < read.size(); ++i) {
        EXPECT_EQ(read[i].id, markers[i].id);
        EXPECT_EQ(read[i].side_mm, 40.25);
        EXPECT_LE(pose::degrees_between(read[i].map_from_marker, markers[i].map_from_marker), 1e-3) << i;
    }
}

TEST_F(MapFile, MayListCorners) {
    const auto markers = read_map(write("version: 1\nfamily: DICT_APRILTAG_36h11\nmarkers:\n  - {id: 2, corners_mm: "
                                        "[[0, 0, 40], [0, 40, 40], [0, 40, 0], [0, 0, 0]]}\n"),
                                  family_);
    ASSERT_EQ(markers.size(), 1u);
    EXPECT_NEAR(markers[0].side_mm, 40, 1e-9);
    EXPECT_LE((markers[0].map_from_marker.translation_mm - Eigen::Vector3d(0, 20, 20)).norm(), 1e-9);
    EXPECT_LE((markers[0].map_from_marker.rotation.col(2) - Eigen::Vector3d::UnitX()).norm(), 1e-9);
}

TEST_F(MapFile, IsRejectedWithItsLine) {
    const std::string head = "version: 1\nfamily: tag36h11\nmarkers:\n";
    const std::pair<std::string, const char *> cases[] = {
        {"version: 2\nfamily: tag36h11\nmarkers: []\n", "desk.map.yaml:1:10: version: "},
        {"version: 1\nmarkers: []\n", "dictionary"},
        {"version: 1\nfamily: tag25h9\nmarkers: []\n",
         "desk.map.yaml:2:9: family: is tag25h9, but the markers to find are of tag36h11"},
        {head + "  - {id: 1, side_mm: 40, position_mm: [1, 2]}\n", "desk.map.yaml:4:39: markers[0].position_mm: "},
        {head + "  - {id: 587, side_mm: 40, position_mm: [1, 2, 3]}\n", "markers[0].id: "},
        {head + "  - {id: 1, position_mm: [1, 2, 3]}\n", "side_mm"},
        {head + "  - {id: 1, size_mm: 40, position_mm: [1, 2, 3]}\n", "size_mm"},
        {head +
             "  - {id: 1, side_mm: 40, position_mm: [1, 2, 3]}\n  - {id: 1, side_mm: 40, position_mm: [1, 2, 3]}\n",
         "desk.map.yaml:5:5: markers[1]: marker 1 is listed twice"},
        {head + "  - {id: 1, corners_mm: [[0, 0, 40], [0, 40, 40], [0, 40, 0]]}\n", "must be the 4 corners"},
        {head + "  - {id: 1, corners_mm: [[0, 0, 0], [0, 40, 40], [0, 40, 0], [0, 0, 40]]}\n",
         "must be the corners of a square"},
    };
    for (const auto &[text, message] : cases)
        EXPECT_THAT(error_of(text), HasSubstr(message)) << text;
}

} // namespace
} // namespace arhost::map
