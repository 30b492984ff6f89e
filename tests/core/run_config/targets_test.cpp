// SPDX-License-Identifier: Apache-2.0
#include "errors.hpp"
#include "plugin_under_test.hpp"
#include "run_config/configuration.hpp"

#include <gmock/gmock.h>

#include <fstream>
#include <numbers>

using namespace arhost;
using testing::AllOf;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
namespace fs = std::filesystem;

namespace {

// Parses configurations; their plugins are empty files.
struct TargetsTest : testing::Test {
    TargetsTest() {
        for (const char *plugin : {"source_x.so", "tracker_x.so", "tracker_aruco.so", "tracker_apriltag.so"})
            write(plugin, "");
    }
    void write(const std::string &name, const std::string &text) const { std::ofstream(folder / name) << text; }
    run_config::Configuration parse_tracker(const std::string &tracker, const std::string &more = "") const {
        return run_config::parse(yaml::Node::parse("version: 1\nsource: {plugin: source_x}\n"
                                                   "camera: {width: 640, height: 480, fx: 600}\n"
                                                   "tracker: " +
                                                       tracker + "\n" + more,
                                                   (folder / "lab.yaml").string()),
                                 folder);
    }
    run_config::TrackerConfiguration parse(const std::string &targets) const {
        return *parse_tracker("{plugin: tracker_x, targets: " + targets + "}").tracker;
    }
    // Returns the errors without the folder.
    template <class Call> std::string error_of(const Call &call) const {
        return test::without_folder(test::error_of(call), folder);
    }
    std::string error_in_tracker(const std::string &tracker, const std::string &more = "") const {
        return error_of([&] { parse_tracker(tracker, more); });
    }
    std::string error_in(const std::string &targets) const {
        return error_of([&] { parse(targets); });
    }
    // Returns the error without the name of the map's file.
    std::string error_in_map(const std::string &map) const {
        write("board.map.yaml", map);
        return test::after("board.map.yaml:", error_in("[{name: board, map: board.map.yaml}]"));
    }
    std::string error_in_marker(const std::string &marker) const {
        return error_in_map("version: 1\nfamily: tag36h11\nmarkers:\n- " + marker + "\n");
    }
    std::vector<run_config::TargetMarker> markers_of(const std::string &map) const {
        write("board.map.yaml", map);
        return parse("[{name: board, map: board.map.yaml}]").targets.at(0).markers;
    }
    std::array<std::array<double, 3>, 4> corners_of(const std::string &marker) const {
        return markers_of("version: 1\nfamily: tag36h11\nmarkers: [" + marker + "]\n").at(0).corners_mm;
    }
    static std::vector<std::string> names_of(const std::vector<run_config::Target> &targets) {
        std::vector<std::string> names;
        for (const run_config::Target &target : targets)
            names.push_back(target.name);
        return names;
    }
    test::ScratchFolder scratch;
    const fs::path folder = fs::canonical(scratch.path());
};

void expect_near(const std::array<std::array<double, 3>, 4> &corners,
                 const std::array<std::array<double, 3>, 4> &expected) {
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t k = 0; k < 3; ++k)
            EXPECT_NEAR(corners[i][k], expected[i][k], 1e-9) << "corner " << i << ", coordinate " << k;
}

} // namespace

TEST_F(TargetsTest, AMarkerIsCentredInTheCoordinatesOfItsTarget) {
    const auto targets = parse("[{name: cup, marker: 7, family: tag36h11, side_mm: 40}]").targets;
    ASSERT_EQ(targets.size(), 1u);
    EXPECT_EQ(targets[0].name, "cup");
    EXPECT_EQ(targets[0].body, "");
    ASSERT_EQ(targets[0].markers.size(), 1u);
    EXPECT_EQ(targets[0].markers[0].id, 7);
    EXPECT_EQ(targets[0].markers[0].family, "tag36h11");
    EXPECT_EQ(targets[0].markers[0].corners_mm,
              (std::array<std::array<double, 3>, 4>{{{-20, 20, 0}, {20, 20, 0}, {20, -20, 0}, {-20, -20, 0}}}));
}

TEST_F(TargetsTest, FamilyAndDictionaryAreSynonyms) {
    const auto targets =
        parse("[{marker: 0, dictionary: DICT_6X6_250, side_mm: 40}, {marker: 0, family: DICT_5X5_100, side_mm: 40}]")
            .targets;
    EXPECT_EQ(targets[0].markers[0].family, "DICT_6X6_250");
    EXPECT_EQ(targets[1].markers[0].family, "DICT_5X5_100");
    EXPECT_THAT(names_of(targets), ElementsAre("DICT_6X6_250-0", "DICT_5X5_100-0"));
}

TEST_F(TargetsTest, IdsAreSeveralTargets) {
    const auto range = parse("[{ids: 0-35, family: tag36h11, side_mm: 95.5}]").targets;
    ASSERT_EQ(range.size(), 36u);
    EXPECT_EQ(range[35].name, "tag36h11-35");
    EXPECT_EQ(range[35].markers.at(0).id, 35);
    EXPECT_EQ(range[35].markers.at(0).corners_mm[1], (std::array<double, 3>{47.75, 47.75, 0}));
    for (const char *ids : {"'0-3,7,9-10'", "\"0-3, 7, 9-10\"", "[0-3, 7, 9-10]", "['0-3,7', 9, 10]"})
        EXPECT_THAT(names_of(parse(std::string("[{family: t, side_mm: 9, ids: ") + ids + "}]").targets),
                    ElementsAre("t-0", "t-1", "t-2", "t-3", "t-7", "t-9", "t-10"))
            << ids;
    EXPECT_THAT(names_of(parse("[{ids: 2147483647, family: t, side_mm: 9}]").targets), ElementsAre("t-2147483647"));
    EXPECT_THAT(
        names_of(parse_tracker("\n  plugin: tracker_x\n  targets:\n  - ids: 5-6,8\n    family: t\n    side_mm: 9\n")
                     .tracker->targets),
        ElementsAre("t-5", "t-6", "t-8"));
}

TEST_F(TargetsTest, AMultiMarkerFileIsAMap) {
    const std::string upright = "40\n1 0 0 35\n0 1 0 -7\n0 0 1 0.5\n", lying = "20\n1 0 0 0\n0 0 -1 0\n0 1 0 100\n";
    const auto error_with = [&](const std::string &file, const std::string &more = "") {
        write("marker.dat", file);
        return error_in("[{name: board, map: marker.dat" + more + "}]");
    };
    write("hiro.patt", "");
    write("one.patt", "");
    write("marker.dat", "2\nhiro.patt\n" + upright + "07\n" + lying);
    const auto tracker =
        parse("[{name: one, pattern: one.patt, side_mm: 9}, {name: board, map: marker.dat, family: artoolkit-3x3}]");
    const auto &markers = tracker.targets.at(1).markers;
    ASSERT_EQ(markers.size(), 2u);
    EXPECT_EQ(markers[0].family, "pattern");
    EXPECT_EQ(markers[0].file, (folder / "hiro.patt").string());
    EXPECT_EQ(markers[0].pattern_ratio, 0.5);
    EXPECT_NE(markers[0].id, tracker.targets[0].markers.at(0).id);
    expect_near(markers[0].corners_mm, {{{15, 13, 0.5}, {55, 13, 0.5}, {55, -27, 0.5}, {15, -27, 0.5}}});
    EXPECT_EQ(markers[1].family, "artoolkit-3x3");
    EXPECT_EQ(markers[1].id, 7);
    EXPECT_EQ(markers[1].file, "");
    expect_near(markers[1].corners_mm, {{{-10, 0, 110}, {10, 0, 110}, {10, 0, 90}, {-10, 0, 90}}});
    EXPECT_THAT(tracker.map_files, testing::Contains(folder / "marker.dat"));
    write("small.dat", "2\n7\n" + upright + "8\n0.5\n1 0 0 90\n0 1 0 0\n0 0 1 0\n");
    EXPECT_THAT(parse_tracker("{plugin: tracker_x, targets: [{name: b, map: small.dat, family: t}]}").warnings,
                ElementsAre(HasSubstr("a print of 0.5 mm")));
    EXPECT_THAT(tracker.policy.readable, testing::Contains(folder / "hiro.patt"));

    EXPECT_THAT(error_with("1\n7\n" + upright), HasSubstr("the key 'family' or 'dictionary' is missing"));
    EXPECT_THAT(error_with("1\nhiro.patt\n" + upright, ", family: t"),
                HasSubstr("family: does not apply to a map of patterns; remove it"));
    EXPECT_THAT(error_with("1\nhira.patt\n" + upright),
                AllOf(HasSubstr("marker.dat:2: there is no file 'hira.patt'"), HasSubstr("hiro.patt")));
    EXPECT_THAT(error_with("2\n7\n" + upright + "7\n" + lying, ", family: t"),
                HasSubstr("marker.dat:7: '7' is also at marker.dat:2; keep one of them"));
    EXPECT_THAT(error_with("2\n7\n" + upright + "07\n" + lying, ", family: t"), HasSubstr("t-7 also belongs to"));
    EXPECT_THAT(error_with("2\n7\n" + upright + "8\n" + upright, ", family: t"),
                HasSubstr("marker.dat:7: this marker is at the place of that at marker.dat:2; correct one of them"));
    EXPECT_THAT(error_with("1\n99999999999\n" + upright, ", family: t"),
                HasSubstr("marker.dat:2: ids are 0 to 2147483647, but this is 99999999999"));
    EXPECT_THAT(error_with("1\n7\nwide\n", ", family: t"), HasSubstr("marker.dat:3: the width of marker 1 must be"));
}

TEST_F(TargetsTest, ABodyHasNoMarkers) {
    const auto targets = parse("[{name: head, body: 'Rigid body 1'}]").targets;
    EXPECT_EQ(targets[0].name, "head");
    EXPECT_EQ(targets[0].body, "Rigid body 1");
    EXPECT_THAT(targets[0].markers, IsEmpty());
}

TEST_F(TargetsTest, LimitsOfFramesHaveDefaults) {
    const std::string targets = "targets: [{name: head, body: head}]";
    const auto standard = *parse_tracker("{plugin: tracker_x, " + targets + "}").tracker;
    EXPECT_EQ(standard.hold_frames, 0u);
    EXPECT_EQ(standard.world_grace_frames, 90u);
    EXPECT_EQ(standard.full_search_every, 10u);
    const auto other =
        *parse_tracker("{plugin: tracker_x, hold_frames: 3, world_grace_frames: 0, full_search_every: 1, " + targets +
                       "}")
             .tracker;
    EXPECT_EQ(other.hold_frames, 3u);
    EXPECT_EQ(other.world_grace_frames, 0u);
    EXPECT_EQ(other.full_search_every, 1u);
    EXPECT_THAT(error_in_tracker("{plugin: tracker_x, full_search_every: 0, " + targets + "}"),
                HasSubstr("tracker.full_search_every: must be 1 to "));
}

TEST_F(TargetsTest, PosesAreFilteredOnRequest) {
    const std::string targets = "targets: [{name: head, body: head}]";
    EXPECT_FALSE(parse_tracker("{plugin: tracker_x, " + targets + "}").tracker->smooth);
    EXPECT_FALSE(parse_tracker("{plugin: tracker_x, filter: none, " + targets + "}").tracker->smooth);
    EXPECT_TRUE(parse_tracker("{plugin: tracker_x, filter: adaptive, " + targets + "}").tracker->smooth);
    EXPECT_THAT(error_in_tracker("{plugin: tracker_x, filter: kalman, " + targets + "}"),
                HasSubstr("tracker.filter: 'kalman' is not one of none, adaptive"));
}

TEST_F(TargetsTest, AreConfirmedByDefault) {
    const std::string targets = "targets: [{name: head, body: head}]";
    EXPECT_TRUE(parse_tracker("{plugin: tracker_x, " + targets + "}").tracker->confirm);
    EXPECT_FALSE(parse_tracker("{plugin: tracker_x, confirm: false, " + targets + "}").tracker->confirm);
}

TEST_F(TargetsTest, ArePatternsAndPicturesThatTheTrackerMayRead) {
    write("hiro.patt", "");
    write("poster.png", "");
    const std::string targets = "[{name: hiro, pattern: hiro.patt, side_mm: 80}, {name: logo, pattern: hiro.patt, "
                                "side_mm: 60, pattern_ratio: 0.7}, {name: poster, image: poster.png, width_mm: 210}]";
    const auto configuration = parse_tracker("{plugin: tracker_x, targets: " + targets + "}",
                                             "alternatives: {tracker: [{plugin: tracker_aruco}]}\n");
    const run_config::TrackerConfiguration &tracker = *configuration.tracker;
    ASSERT_EQ(names_of(tracker.targets), (std::vector<std::string>{"hiro", "logo", "poster"}));
    const auto marker = [&](std::size_t target) { return tracker.targets[target].markers.at(0); };
    EXPECT_EQ(marker(0).family, "pattern");
    EXPECT_EQ(marker(0).file, (folder / "hiro.patt").string());
    EXPECT_EQ(marker(0).pattern_ratio, 0.5);
    EXPECT_EQ(marker(1).pattern_ratio, 0.7);
    EXPECT_EQ(marker(1).corners_mm[2], (std::array<double, 3>{30, -30, 0}));
    EXPECT_NE(marker(0).id, marker(1).id);
    EXPECT_EQ(marker(2).family, "image");
    EXPECT_EQ(marker(2).corners_mm[1], (std::array<double, 3>{105, 105, 0}))
        << "a square, until the tracker is asked";
    for (const run_config::TrackerConfiguration &choice : configuration.trackers)
        EXPECT_THAT(choice.policy.readable, testing::IsSupersetOf({folder / "hiro.patt", folder / "poster.png"}));
}

TEST_F(TargetsTest, RejectsInvalidPatternsAndPictures) {
    const std::string at = "lab.yaml:4:40: tracker.targets[0]";
    write("hiro.patt", "");
    EXPECT_THAT(error_in("[{name: a, pattern: hiri.patt, side_mm: 80}]"),
                HasSubstr("tracker.targets[0].pattern: there is no file 'hiri.patt'; did you mean 'hiro.patt'?"));
    EXPECT_THAT(error_in("[{name: a, image: a.png, width_mm: 80}]"), HasSubstr("image: there is no file 'a.png'"));
    EXPECT_THAT(error_in("[{name: a, image: /home, width_mm: 80}]"), HasSubstr("image: '/home' is not a file"));
    EXPECT_EQ(error_in("[{pattern: hiro.patt, side_mm: 80}]"), at + ": the key 'name' is missing");
    EXPECT_EQ(error_in("[{name: a, pattern: hiro.patt}]"), at + ": the key 'side_mm' is missing");
    EXPECT_EQ(error_in("[{name: a, image: hiro.patt}]"), at + ": the key 'width_mm' is missing");
    EXPECT_THAT(error_in("[{name: a, image: hiro.patt, side_mm: 80}]"),
                HasSubstr("side_mm: does not apply to a target with 'image'; remove it"));
    EXPECT_THAT(error_in("[{name: a, pattern: hiro.patt, side_mm: 80, pattern_ratio: 0.95}]"),
                HasSubstr("pattern_ratio: must be 0.1 to 0.9, but is 0.95"));
    EXPECT_THAT(error_in("[{name: a, pattern: hiro.patt, side_mm: 0}]"), HasSubstr("side_mm: must be"));
    EXPECT_THAT(error_in("[{marker: 1, family: pattern, side_mm: 80}]"),
                HasSubstr("family: is not a family of markers; write 'pattern: FILE' instead of 'marker' or 'ids'"));
}

TEST_F(TargetsTest, RejectsInvalidTargets) {
    const std::string at = "lab.yaml:4:40: tracker.targets[0]";
    EXPECT_EQ(error_in("[]"), "lab.yaml:4:39: tracker.targets: must list 1 to 1024 targets, as in [{marker: 0, "
                              "family: tag36h11, side_mm: 80}]");
    EXPECT_EQ(error_in_tracker("{plugin: tracker_x}"), "lab.yaml:4:10: tracker: the key 'targets' is missing");
    EXPECT_EQ(error_in("[7]"), at + ": must be a map of keys, as in {marker: 0, family: tag36h11, side_mm: 80}");
    EXPECT_EQ(error_in("[{family: tag36h11, side_mm: 80}]"),
              at + ": one of the keys 'marker', 'ids', 'map', 'pattern', 'image' and 'body' is missing, as in "
                   "{marker: 0, family: tag36h11, side_mm: 80}");
    EXPECT_EQ(error_in("[{marker: 0, ids: 1-2, family: a, side_mm: 80}]"),
              "lab.yaml:4:57: tracker.targets[0].ids: a target has only one of the keys 'marker', 'ids', 'map', "
              "'pattern', 'image' and 'body', but 'marker' is there, too; make two targets of them");
    EXPECT_EQ(
        error_in("[{marker: 0, side_mm: 80}]"),
        at + ": the key 'family' or 'dictionary' is missing, as in 'family: tag36h11' or 'dictionary: DICT_6X6_250'");
    EXPECT_EQ(
        error_in("[{marker: 0, family: a, dictionary: b, side_mm: 80}]"),
        "lab.yaml:4:75: tracker.targets[0].dictionary: 'family' and 'dictionary' mean the same; remove one of them");
    EXPECT_EQ(error_in("[{marker: 0, family: a}]"), at + ": the key 'side_mm' is missing");
    EXPECT_THAT(error_in("[{marker: 0, familly: a, side_mm: 80}]"),
                HasSubstr("tracker.targets[0].familly: unknown key; did you mean 'family'?"));
    EXPECT_THAT(error_in("[{marker: -1, family: a, side_mm: 80}]"),
                HasSubstr("tracker.targets[0].marker: must be 0 to 2147483647, but is -1"));
    for (const char *side : {"0", "0.001", "-80", "2e6", ".nan", ".inf"})
        EXPECT_THAT(error_in(std::string("[{marker: 0, family: a, side_mm: ") + side + "}]"),
                    AllOf(HasSubstr("tracker.targets[0].side_mm: must be "), HasSubstr("0.01 to 1e+06")))
            << side;
    EXPECT_THAT(error_in("[{body: head}]"), EndsWith("tracker.targets[0]: the key 'name' is missing"));
    EXPECT_THAT(error_in("[{name: head, body: \"a\\tb\"}]"),
                HasSubstr("tracker.targets[0].body: must have at most 63 bytes of printable text"));
    EXPECT_THAT(error_in("[{name: head, body: " + std::string(64, 'b') + "}]"), HasSubstr("[0].body: must have"));
    EXPECT_THAT(error_in("[{name: head, body: head, family: a}]"),
                HasSubstr("tracker.targets[0].family: does not apply to a body, which has no markers; remove it"));
    EXPECT_THAT(error_in("[{map: a.map.yaml}]"), EndsWith("tracker.targets[0]: the key 'name' is missing"));
    EXPECT_THAT(error_in("[{name: board, map: a.map.yaml, side_mm: 80}]"),
                HasSubstr("tracker.targets[0].side_mm: belongs in the map; remove it here"));
}

// A file of AprilRobotics' apriltag_ros: metres, quaternions; the tags' axes are those of arhost.
const std::string bundles = R"(standalone_tags: [{id: 9, size: 0.1}]
tag_bundles:
  [
    {name: desk, layout: [{id: 3, size: 0.04, x: 0.1, y: -0.02, z: 0.003, qw: 1, qx: 0, qy: 0, qz: 0},
                          {id: 4, size: 0.06, qw: 2, qz: 2}]},
    {name: wall, layout: [{id: 5, size: 0.04}]}
  ]
)";

TEST_F(TargetsTest, BundlesOfAprilTagRosAreMaps) {
    write("tags.yaml", bundles);
    const auto targets = parse("[{name: desk, map: tags.yaml, family: tag36h11}]").targets;
    ASSERT_EQ(targets.size(), 1u);
    ASSERT_EQ(targets[0].markers.size(), 2u);
    const auto &[first, second] = std::tie(targets[0].markers[0], targets[0].markers[1]);
    EXPECT_EQ(first.id, 3);
    EXPECT_EQ(first.family, "tag36h11");
    const auto near = [](double x, double y, double z) {
        return ElementsAre(testing::DoubleNear(x, 1e-9), testing::DoubleNear(y, 1e-9), testing::DoubleNear(z, 1e-9));
    };
    EXPECT_THAT(first.corners_mm, ElementsAre(near(80, 0, 3), near(120, 0, 3), near(120, -40, 3), near(80, -40, 3)));
    EXPECT_EQ(second.id, 4);
    EXPECT_THAT(second.corners_mm,
                ElementsAre(near(-30, -30, 0), near(-30, 30, 0), near(30, 30, 0), near(30, -30, 0)))
        << "a quarter turn about z, of a quaternion that is not normalized";
    EXPECT_EQ(parse("[{name: wall, map: tags.yaml, dictionary: DICT_APRILTAG_36h11}]").targets[0].markers[0].id, 5);
}

TEST_F(TargetsTest, RejectsInvalidBundles) {
    write("tags.yaml", bundles);
    EXPECT_THAT(error_in("[{name: desk, map: tags.yaml}]"), HasSubstr("the key 'family' or 'dictionary' is missing"));
    EXPECT_THAT(
        error_in("[{name: table, map: tags.yaml, family: tag36h11}]"),
        HasSubstr(
            "tags.yaml:3:3: tag_bundles: has the bundles 'desk', 'wall'; give the target the name of one of them"));
    const auto error_in_layout = [&](const std::string &layout) {
        write("tags.yaml", "tag_bundles: [{name: a, layout: [" + layout + "]}]\n");
        return error_in("[{name: desk, map: tags.yaml, family: tag36h11}]");
    };
    EXPECT_EQ(error_in_layout("{id: 1, size: 0.1}"), "no error") << "the only bundle may have another name";
    EXPECT_THAT(error_in_layout("{id: 1, size: 0.1}, {id: 1, size: 0.1, x: 1}"), HasSubstr("the marker 1 is also"));
    EXPECT_THAT(error_in_layout("{id: 1, size: 0}"), HasSubstr("layout[0].size: must be "));
    EXPECT_THAT(error_in_layout("{size: 0.1}"), HasSubstr("the key 'id' is missing"));
    EXPECT_THAT(error_in_layout("{id: 1, size: 0.1, qw: 0}"),
                HasSubstr("the quaternion qw, qx, qy, qz must not be 0"));
    EXPECT_THAT(error_in_layout("{id: 1, size: 0.1, roll: 0}"), HasSubstr("roll"));
    EXPECT_THAT(error_in_layout(""), HasSubstr("must list 1 to 1024 markers"));
    write("tags.yaml", "tag_bundles: []\n");
    EXPECT_THAT(error_in("[{name: desk, map: tags.yaml, family: tag36h11}]"), HasSubstr("has no bundle"));
}

TEST_F(TargetsTest, RejectsInvalidNames) {
    const auto error_of_name = [&](const std::string &name) {
        return error_in("[{name: " + name + ", marker: 0, family: a, side_mm: 80}]");
    };
    EXPECT_EQ(error_of_name(std::string(63, 'n')), "no error");
    EXPECT_EQ(error_of_name("aZ09_.-"), "no error");
    EXPECT_EQ(error_of_name("'my cup'"), "lab.yaml:4:47: tracker.targets[0].name: must have at most 63 characters, "
                                         "only letters, digits, '_', '.' and '-', but is 'my cup'");
    for (const std::string &name :
         {std::string(64, 'n'), std::string("Größe"), std::string("a/b"), std::string("\"a\\nb\"")})
        EXPECT_THAT(error_of_name(name), HasSubstr("tracker.targets[0].name: must have at most 63")) << name;
    EXPECT_THAT(error_in("[{marker: 0, family: " + std::string(32, 'f') + ", side_mm: 80}]"),
                HasSubstr("tracker.targets[0].family: must have at most 31 characters"));
    EXPECT_THAT(error_in("[{name: a, ids: 0-1, family: f, side_mm: 80}]"),
                HasSubstr("tracker.targets[0].name: the targets of a range of ids are named FAMILY-ID, such as f-0; "
                          "remove this key, or list targets with 'marker'"));
}

TEST_F(TargetsTest, RejectsInvalidIds) {
    for (const char *ids : {"3-1", "-3", "0-", "a", "'0-3,'", "','", "'1 2'", "0x3", "2147483648", "[0, [1]]", "{}",
                            "''", "1-2-3", "99999999999"})
        EXPECT_THAT(error_in(std::string("[{family: f, side_mm: 80, ids: ") + ids + "}]"),
                    HasSubstr("tracker.targets[0].ids"))
            << ids;
    EXPECT_EQ(error_in("[{family: f, side_mm: 80, ids: 3-1}]"),
              "lab.yaml:4:70: tracker.targets[0].ids: must be ids of 0 to 2147483647 in ascending order, such as "
              "0-35 or [0-3, 7], but is '3-1'");
    EXPECT_THAT(error_in("[{family: f, side_mm: 80, ids: []}]"), HasSubstr("ids: must not be empty"));
    EXPECT_THAT(error_in("[{family: f, side_mm: 80, ids: 0-2147483647}]"),
                HasSubstr("tracker.targets[0].ids: there can be at most 1024 targets"));
    EXPECT_EQ(
        error_in("[{ids: 0-3,7,9-12, family: f, side_mm: 80}]"),
        "lab.yaml:4:46: tracker.targets[0].ids: in braces, YAML ends a value at a comma; write ids: [0-3, 7, 9-12]");
}

TEST_F(TargetsTest, RejectsTooManyTargetsMarkersAndFamilies) {
    EXPECT_EQ(parse("[{ids: 0-1023, family: f, side_mm: 80}]").targets.size(), 1024u);
    EXPECT_THAT(error_in("[{ids: 0-1023, family: f, side_mm: 80}, {name: x, body: x}]"),
                HasSubstr("tracker.targets[1]: there can be at most 1024 targets"));
    std::string map = "version: 1\nfamily: f\nmarkers:\n";
    for (int id = 0; id < 1024; ++id)
        map +=
            "- {id: " + std::to_string(id) + ", side_mm: 8, position_mm: [" + std::to_string(10 * id) + ", 0, 0]}\n";
    write("board.map.yaml", map);
    EXPECT_EQ(parse("[{name: board, map: board.map.yaml}]").targets[0].markers.size(), 1024u);
    EXPECT_THAT(error_in("[{name: board, map: board.map.yaml}, {marker: 2000, family: f, side_mm: 80}]"),
                HasSubstr("tracker.targets[1]: there can be at most 1024 markers"));
    EXPECT_THAT(error_in_map(map + "- {id: 3000, side_mm: 8, position_mm: [0, 90, 0]}\n"),
                HasSubstr("4:1: markers: must list 1 to 1024 markers"));
    std::string families;
    for (int i = 0; i < 16; ++i)
        families += "{marker: 0, family: f" + std::to_string(i) + ", side_mm: 80}, ";
    EXPECT_EQ(parse("[" + families + "]").targets.size(), 16u);
    EXPECT_THAT(error_in("[" + families + "{marker: 0, family: g, side_mm: 80}]"),
                HasSubstr("tracker.targets[16]: there can be at most 16 families"));
}

TEST_F(TargetsTest, RejectsATargetOrMarkerThatIsThereTwice) {
    EXPECT_EQ(
        error_in("[{name: cup, marker: 0, family: f, side_mm: 80}, {name: cup, marker: 1, family: f, side_mm: 80}]"),
        "lab.yaml:4:88: tracker.targets[1]: the name 'cup' is also that of another target (lab.yaml:4:40); give each "
        "its own name");
    EXPECT_THAT(error_in("[{ids: '3,3', family: f, side_mm: 80}]"),
                HasSubstr("the marker f-3 also belongs to the target 'f-3'"));
    EXPECT_THAT(error_in("[{ids: 0-3, family: f, side_mm: 80}, {name: cup, marker: 2, family: f, side_mm: 80}]"),
                EndsWith("tracker.targets[1]: the marker f-2 also belongs to the target 'f-2'; remove one of them"));
    EXPECT_THAT(error_in("[{marker: 2, family: tag36h11, side_mm: 80}, {marker: 2, dictionary: DICT_APRILTAG_36h11, "
                         "side_mm: 80}]"),
                HasSubstr("also belongs to the target 'tag36h11-2'"))
        << "two names of the same family";
    EXPECT_THAT(error_in("[{ids: 0-9, dictionary: DICT_6X6_250, side_mm: 80}, {name: cup, marker: 9, dictionary: "
                         "DICT_6X6_50, side_mm: 40}]"),
                EndsWith("the marker DICT_6X6_50-9 also belongs to the target 'DICT_6X6_250-9'; remove one of them"))
        << "the smaller dictionary has the first markers of the larger one";
    for (const std::string other : {"DICT_5X5_250", "DICT_6X6_lab"})
        EXPECT_EQ(error_in("[{marker: 9, dictionary: DICT_6X6_250, side_mm: 80}, {marker: 9, dictionary: " + other +
                           ", side_mm: 40}]"),
                  "no error");
    write("poster.png", "");
    EXPECT_THAT(
        error_in("[{name: a, image: poster.png, width_mm: 60}, {name: b, image: ./poster.png, width_mm: 90}]"),
        testing::AllOf(HasSubstr("tracker.targets[1]: the print '"),
                       HasSubstr("poster.png' also belongs to the target 'a'; remove one of them")));
    write("board.map.yaml", "version: 1\nfamily: f\nmarkers: [{id: 4, side_mm: 8, position_mm: [0, 0, 0]}]\n");
    EXPECT_THAT(
        error_in("[{name: board, map: board.map.yaml}, {ids: 3-4, family: f, side_mm: 80}]"),
        EndsWith("tracker.targets[1]: the marker f-4 also belongs to the target 'board'; remove one of them"));
    EXPECT_THAT(error_in("[{name: a, map: board.map.yaml}, {name: b, map: board.map.yaml}]"),
                HasSubstr("the marker f-4 also belongs to the target 'a'"));
    EXPECT_EQ(error_in("[{marker: 2, family: a, side_mm: 80}, {marker: 2, family: b, side_mm: 80}]"), "no error");
}

TEST_F(TargetsTest, RejectsMarkersAndPrintsTheirReplacement) {
    EXPECT_EQ(error_in_tracker("{plugin: tracker_x, markers: [{id: 0, side_mm: 80}]}"),
              "lab.yaml:4:39: tracker.markers: is now 'targets'; write: targets: [{marker: 0, family: tag36h11, "
              "side_mm: 80}]");
    EXPECT_THAT(error_in_tracker("{plugin: tracker_aruco, options: {dictionary: DICT_6X6_250}, markers: [{id: 7, "
                                 "side_mm: 40}, {id: 8, side_mm: 95.5}]}"),
                EndsWith("write: targets: [{marker: 7, dictionary: DICT_6X6_250, side_mm: 40}, {marker: 8, "
                         "dictionary: DICT_6X6_250, side_mm: 95.5}]"));
    EXPECT_THAT(
        error_in_tracker("{plugin: tracker_apriltag, options: {family: tag25h9}, markers: [{id: 7, side_mm: 40}]}"),
        EndsWith("write: targets: [{marker: 7, family: tag25h9, side_mm: 40}]"));
    EXPECT_THAT(
        error_in_tracker(
            "{plugin: tracker_aruco, options: {dictionary_file: x/mine.yml}, markers: [{id: 7, side_mm: 40}]}"),
        EndsWith("write: targets: [{marker: 7, dictionary: mine, side_mm: 40}]"));
    for (const char *markers : {"", "[]", "7", "[7]", "[{id: {}, side_mm: 3}]", "[{id: 3}]"})
        EXPECT_THAT(error_in_tracker(std::string("{plugin: tracker_x, markers: ") + markers + "}"),
                    EndsWith("write: targets: [{marker: 0, family: tag36h11, side_mm: 80}]"))
            << markers;
}

TEST_F(TargetsTest, TheReplacementOfMarkersIsValid) {
    const std::string error = error_in_tracker(
        "{plugin: tracker_x, options: {family: tag16h5}, markers: [{id: 0, side_mm: 80}, {id: 3, side_mm: 8}]}");
    const std::string key = "targets: [";
    ASSERT_THAT(error, HasSubstr(key));
    EXPECT_THAT(names_of(parse(error.substr(error.find(key) + key.size() - 1)).targets),
                ElementsAre("tag16h5-0", "tag16h5-3"));
}

TEST_F(TargetsTest, RejectsTheFamilyAsAnOptionOfTheTracker) {
    const std::string targets = "targets: [{marker: 0, family: tag36h11, side_mm: 80}]";
    EXPECT_EQ(error_in_tracker("{plugin: tracker_aruco, options: {dictionary: DICT_6X6_250}, " + targets + "}"),
              "lab.yaml:4:56: tracker.options.dictionary: belongs to each target now: remove it here and write "
              "'dictionary: DICT_6X6_250' in tracker.targets");
    EXPECT_EQ(error_in_tracker("{plugin: ./tracker_apriltag.so, options: {family: tag25h9}, " + targets + "}"),
              "lab.yaml:4:60: tracker.options.family: belongs to each target now: remove it here and write 'family: "
              "tag25h9' in tracker.targets");
    EXPECT_THAT(error_in_tracker("{plugin: tracker_x, " + targets + "}",
                                 "alternatives: {tracker: [{plugin: tracker_apriltag, options: {family: tag25h9}}]}"),
                HasSubstr("alternatives.tracker[0].options.family: belongs to each target now"));
    EXPECT_EQ(error_in_tracker("{plugin: tracker_x, options: {family: a, dictionary: b}, " + targets + "}"),
              "no error");
}

TEST_F(TargetsTest, MapsPlaceMarkers) {
    const auto markers = markers_of("version: 1\ndictionary: DICT_6X6_250\nmarkers:\n"
                                    "- {id: 3, side_mm: 20, position_mm: [100, 200, 300]}\n"
                                    "- {id: 1, corners_mm: [[0, 1, 5], [2, 1, 5], [2, 0, 5], [0, 0, 5]]}\n");
    ASSERT_EQ(markers.size(), 2u);
    EXPECT_EQ(markers[0].id, 3);
    EXPECT_EQ(markers[0].family, "DICT_6X6_250");
    EXPECT_EQ(markers[0].corners_mm, (std::array<std::array<double, 3>, 4>{
                                         {{90, 210, 300}, {110, 210, 300}, {110, 190, 300}, {90, 190, 300}}}));
    EXPECT_EQ(markers[1].corners_mm,
              (std::array<std::array<double, 3>, 4>{{{0, 1, 5}, {2, 1, 5}, {2, 0, 5}, {0, 0, 5}}}));
}

TEST_F(TargetsTest, MapsTurnMarkersAboutFixedAxes) {
    const auto turned = [&](const std::string &degrees) {
        return corners_of("{id: 0, side_mm: 2, position_mm: [0, 0, 0], rotation_degrees: " + degrees + "}");
    };
    expect_near(turned("[0, 0, 90]"), {{{-1, -1, 0}, {-1, 1, 0}, {1, 1, 0}, {1, -1, 0}}});
    expect_near(turned("[90, 0, 0]"), {{{-1, 0, 1}, {1, 0, 1}, {1, 0, -1}, {-1, 0, -1}}});
    expect_near(turned("[0, 90, 0]"), {{{0, 1, 1}, {0, 1, -1}, {0, -1, -1}, {0, -1, 1}}});
    // The right side of a box whose z axis points up (docs/markers.md): first about x, then about z.
    expect_near(turned("[90, 0, 90]"), {{{0, -1, 1}, {0, 1, 1}, {0, 1, -1}, {0, -1, -1}}});

    const double x = 20 * std::numbers::pi / 180, y = -35 * std::numbers::pi / 180, z = 50 * std::numbers::pi / 180;
    const double cx = std::cos(x), sx = std::sin(x), cy = std::cos(y), sy = std::sin(y), cz = std::cos(z),
                 sz = std::sin(z);
    // The first two columns of Rz·Ry·Rx.
    const double right[3] = {cz * cy, sz * cy, -sy};
    const double up[3] = {cz * sy * sx - sz * cx, sz * sy * sx + cz * cx, cy * sx};
    const double signs[4][2] = {{-1, 1}, {1, 1}, {1, -1}, {-1, -1}}, position[3] = {5, -6, 7};
    std::array<std::array<double, 3>, 4> expected{};
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t k = 0; k < 3; ++k)
            expected[i][k] = position[k] + 1.5 * (signs[i][0] * right[k] + signs[i][1] * up[k]);
    expect_near(corners_of("{id: 0, side_mm: 3, position_mm: [5, -6, 7], rotation_degrees: [20, -35, 50]}"),
                expected);
}

TEST_F(TargetsTest, AMapIsAFileThatTheRunReads) {
    write("board.map.yaml", "version: 1\nfamily: f\nmarkers: [{id: 4, side_mm: 8, position_mm: [0, 0, 0]}]\n");
    const std::string tracker = "{plugin: tracker_x, targets: [{name: board, map: board.map.yaml}]}";
    EXPECT_THAT(parse_tracker(tracker).tracker->map_files, ElementsAre(folder / "board.map.yaml"));
    EXPECT_THAT(error_in_tracker(tracker, "stats: " + (folder / "board.map.yaml").string()),
                HasSubstr("is a file that this run reads; choose another path"));
}

TEST_F(TargetsTest, RejectsInvalidMaps) {
    const std::string marker = "{id: 0, side_mm: 80, position_mm: [0, 0, 0]}";
    write("boart.map.yaml", "");
    EXPECT_THAT(
        error_in("[{name: board, map: board.map.yaml}]"),
        EndsWith("tracker.targets[0].map: there is no map file 'board.map.yaml'; did you mean 'boart.map.yaml'?"));
    EXPECT_EQ(error_in_map("version: 1\nfamily: f\nmarkers: [" + marker + "]\n"), "no error");
    EXPECT_THAT(error_in_map("version: [\n"), HasSubstr("2:1: YAML syntax"));
    EXPECT_EQ(error_in_map("version: 2\nfamily: f\nmarkers: [" + marker + "]\n"),
              "1:10: version: must be 1, the only supported version");
    EXPECT_EQ(error_in_map("family: f\nmarkers: [" + marker + "]\n"), "1:1: the key 'version' is missing");
    EXPECT_EQ(
        error_in_map("version: 1\nmarkers: [" + marker + "]\n"),
        "1:1: the key 'family' or 'dictionary' is missing, as in 'family: tag36h11' or 'dictionary: DICT_6X6_250'");
    EXPECT_THAT(error_in_map("version: 1\nfamily: f\ndictionary: f\nmarkers: [" + marker + "]\n"),
                HasSubstr("3:13: dictionary: 'family' and 'dictionary' mean the same"));
    EXPECT_THAT(error_in_map("version: 1\nfamily: f\nmarker: [" + marker + "]\n"),
                HasSubstr("3:1: marker: unknown key; did you mean 'markers'?"));
    EXPECT_THAT(error_in_map("version: 1\nfamily: f\n"), HasSubstr("the key 'markers' is missing"));
    EXPECT_THAT(error_in_map("version: 1\nfamily: f\nmarkers: []\n"),
                HasSubstr("3:10: markers: must list 1 to 1024 markers"));
}

TEST_F(TargetsTest, RejectsInvalidMarkersOfMaps) {
    EXPECT_EQ(error_in_marker("{id: 0, side_mm: 80}"), "4:3: markers[0]: the key 'position_mm' is missing");
    EXPECT_EQ(error_in_marker("{side_mm: 80, position_mm: [0, 0, 0]}"), "4:3: markers[0]: the key 'id' is missing");
    EXPECT_EQ(error_in_marker("{id: 0, position_mm: [0, 0, 0]}"),
              "4:3: markers[0]: the key 'side_mm' (with 'position_mm') or 'corners_mm' is missing");
    EXPECT_THAT(error_in_marker("{id: 0, size_mm: 80, position_mm: [0, 0, 0]}"),
                HasSubstr("markers[0].size_mm: unknown key; did you mean 'side_mm'?"));
    EXPECT_THAT(error_in_marker("{id: -1, side_mm: 80, position_mm: [0, 0, 0]}"),
                HasSubstr("markers[0].id: must be 0 to 2147483647"));
    EXPECT_THAT(error_in_marker("{id: 0, side_mm: 0, position_mm: [0, 0, 0]}"),
                HasSubstr("markers[0].side_mm: must be 0.01 to 1e+06"));
    EXPECT_THAT(error_in_marker("{id: 0, side_mm: 80, position_mm: [0, 0]}"),
                HasSubstr("markers[0].position_mm: must be a list of 3 numbers, but has 2"));
    EXPECT_THAT(error_in_marker("{id: 0, side_mm: 80, position_mm: [0, 0, .inf]}"),
                HasSubstr("markers[0].position_mm[2]: must be a finite number"));
    EXPECT_THAT(error_in_marker("{id: 0, side_mm: 80, position_mm: [0, 1e8, 0]}"),
                HasSubstr("markers[0].position_mm[1]: must be -1e+07 to 1e+07"));
    EXPECT_THAT(error_in_marker("{id: 0, side_mm: 80, position_mm: [0, 0, 0], rotation_degrees: [0, 0, 400]}"),
                HasSubstr("markers[0].rotation_degrees[2]: must be -360 to 360"));
    EXPECT_EQ(error_in_marker("{id: 0, corners_mm: [[0, 1, 0], [1, 1, 0], [1, 0, 0], [0, 0, 0]], side_mm: 1}"),
              "4:78: markers[0].side_mm: the place is also given by 'corners_mm'; remove one of them");
}

TEST_F(TargetsTest, RejectsCornersThatAreNotThoseOfAMarker) {
    const auto error_of_corners = [&](const std::string &corners) {
        return error_in_marker("{id: 0, corners_mm: [" + corners + "]}");
    };
    EXPECT_EQ(error_of_corners("[0, 10, 0], [10, 10, 0], [10, 0, 0], [0, 0, 0]"), "no error");
    EXPECT_EQ(error_of_corners("[0, 10, 0], [14, 9, 0], [12, 0, 0], [0, 2, 0]"), "no error");
    EXPECT_EQ(error_of_corners("[0, 10, 0.09], [10, 10, 0], [10, 0, 0.09], [0, 0, 0]"), "no error");
    EXPECT_EQ(error_of_corners("[0, 10, 0], [10, 10, 0], [10, 0, 0], [0, 0, 1]"),
              "4:23: markers[0].corners_mm: the corners must be in a plane to within 1 % of the side");
    EXPECT_EQ(error_of_corners("[0, 10, 0], [10, 10, 0], [10, 0, 0]"),
              "4:23: markers[0].corners_mm: must be 4 corners [x, y, z]: top left, top right, bottom right, bottom "
              "left; but has 3");
    EXPECT_THAT(error_of_corners("[0, 10, .nan], [10, 10, 0], [10, 0, 0], [0, 0, 0]"),
                HasSubstr("markers[0].corners_mm[0][2]: must be a finite number"));
    EXPECT_THAT(error_of_corners("[0, 10], [10, 10, 0], [10, 0, 0], [0, 0, 0]"),
                HasSubstr("markers[0].corners_mm[0]: must be a list of 3 numbers"));
    EXPECT_THAT(error_of_corners("[0, 10, 0], [10, 10, 0], [10, 10, 0], [0, 0, 0]"),
                HasSubstr("markers[0].corners_mm[1]: the side to the next corner must be 0.01 to 1e+06 mm long"));
    const std::string order =
        "the corners must form a convex quadrilateral in the order top left, top right, bottom right, bottom left";
    for (const char *corners : {
             "[0, 10, 0], [10, 0, 0], [10, 10, 0], [0, 0, 0]", // crossed
             "[0, 10, 0], [3, 3, 0], [10, 0, 0], [0, 0, 0]",   // concave
             "[0, 10, 0], [5, 10, 0], [10, 10, 0], [0, 0, 0]", // a triangle
             "[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]",     // a line
         })
        EXPECT_THAT(error_of_corners(corners), HasSubstr(order)) << corners;
}

TEST_F(TargetsTest, RejectsContradictionsInMaps) {
    const std::string first = "{id: 4, side_mm: 80, position_mm: [0, 0, 0]}\n- ";
    EXPECT_EQ(error_in_marker(first + "{id: 4, side_mm: 80, position_mm: [0, 100, 0]}"),
              "5:8: markers[1].id: the marker 4 is also markers[0] (board.map.yaml:4:3); keep one of them");
    EXPECT_EQ(error_in_marker(first + "{id: 5, side_mm: 80, position_mm: [0, 0.5, 0]}"),
              "5:3: markers[1]: the marker 5 is at the place of marker 4, markers[0] (board.map.yaml:4:3); correct "
              "one of them");
    EXPECT_THAT(
        error_in_marker(first + "{id: 5, corners_mm: [[40, 40, 0], [40, -40, 0], [-40, -40, 0], [-40, 40, 0]]}"),
        HasSubstr("is at the place of marker 4"));
    EXPECT_EQ(error_in_marker(first + "{id: 5, side_mm: 8, position_mm: [0, 0, 0]}"), "no error") << "a smaller one";
    EXPECT_EQ(error_in_marker(first + "{id: 5, side_mm: 80, position_mm: [70, 0, 0], rotation_degrees: [0, 0, 45]}"),
              "5:3: markers[1]: the marker 5 covers a part of marker 4, markers[0] (board.map.yaml:4:3); correct the "
              "place or the side of one of them");
    for (const char *beside : {"[80, 0, 0]", "[80, 80, 0]", "[0, -80, 0]", "[70, 0, 5]"})
        EXPECT_EQ(error_in_marker(first + "{id: 5, side_mm: 80, position_mm: " + beside + "}"), "no error") << beside;
    EXPECT_EQ(error_in_marker(first + "{id: 5, side_mm: 80, position_mm: [90, 0, 0], rotation_degrees: [0, 0, 45]}"),
              "5:3: markers[1]: the marker 5 covers a part of marker 4, markers[0] (board.map.yaml:4:3); correct the "
              "place or the side of one of them");
    EXPECT_EQ(error_in_marker(first + "{id: 5, side_mm: 80, position_mm: [97, 0, 0], rotation_degrees: [0, 0, 45]}"),
              "no error");
    EXPECT_EQ(
        error_in_marker(first + "{id: 5, side_mm: 80, position_mm: [0, 0, -0.1], rotation_degrees: [180, 0, 0]}"),
        "no error")
        << "on the back";
}

TEST_F(TargetsTest, AMapHasOneWarningAboutItsUnit) {
    write("board.map.yaml", "version: 1\nfamily: f\nmarkers:\n"
                            "- {id: 0, side_mm: 0.08, position_mm: [0, 0, 0]}\n"
                            "- {id: 1, corners_mm: [[1, 0.08, 0], [1.08, 0.08, 0], [1.08, 0, 0], [1, 0, 0]]}\n");
    const auto warnings =
        parse_tracker("{plugin: tracker_x, targets: [{name: board, map: board.map.yaml}]}").warnings;
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_EQ(test::without_folder(warnings[0], folder),
              "board.map.yaml:4:3: markers[0]: a print of 0.08 mm is implausible; check the unit, which is mm");
}
