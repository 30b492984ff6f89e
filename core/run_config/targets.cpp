// SPDX-License-Identifier: Apache-2.0
#include "run_config/targets.hpp"

#include "base/text.hpp"
#include "run_config/access.hpp"
#include "run_config/multi_marker.hpp"
#include "run_config/schema.hpp"
#include "run_config/user_view.hpp"

#include <arhost/tracker.h>

#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <tuple>
#include <utility>

namespace arhost::run_config {
namespace {

namespace fs = std::filesystem;
using Corners = std::array<glm::dvec3, 4>;

constexpr std::int32_t max_id = std::numeric_limits<std::int32_t>::max();
constexpr double min_side_mm = 0.01, max_side_mm = 1e6, max_coordinate_mm = 1e7;
constexpr double tolerance = 0.01; // of corners in a map, relative to the side
constexpr const char *pattern_family = "pattern", *image_family = "image"; // arhost_marker_config.file
constexpr double default_pattern_ratio = 0.5;                              // ARToolKit's
constexpr const char *name_rule = "letters, digits, '_', '.' and '-'";

bool is_name(std::string_view text, std::size_t size_with_nul) {
    return text.size() < size_with_nul && std::ranges::all_of(text, [](unsigned char c) {
               return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
                      c == '.' || c == '-';
           });
}

std::string parse_name(const yaml::Node &node, std::size_t size_with_nul) {
    std::string name = node.text();
    if (!is_name(name, size_with_nul))
        node.fail("must have at most " + std::to_string(size_with_nul - 1) + " characters, only " + name_rule +
                  ", but is '" + base::printable(name, 200) + "'");
    return name;
}

// Returns the name of a body, which another program has chosen.
std::string parse_body(const yaml::Node &node) {
    std::string body = node.text();
    if (body.size() >= ARHOST_MAX_NAME || base::printable(body) != body)
        node.fail("must have at most " + std::to_string(ARHOST_MAX_NAME - 1) + " bytes of printable text");
    return body;
}

std::string parse_family(const yaml::Node &map) {
    const auto family = map.find("family"), dictionary = map.find("dictionary");
    if (family && dictionary)
        dictionary->fail("'family' and 'dictionary' mean the same; remove one of them");
    if (!family && !dictionary)
        map.fail("the key 'family' or 'dictionary' is missing, as in 'family: tag36h11' or 'dictionary: "
                 "DICT_6X6_250'");
    const yaml::Node node = family ? *family : *dictionary;
    std::string name = parse_name(node, ARHOST_MAX_FAMILY);
    if (name == pattern_family || name == image_family)
        node.fail("is not a family of markers; write '" + name + ": FILE' instead of 'marker' or 'ids'");
    return name;
}

// Returns the same name for families that share markers. AprilTag's families are also dictionaries of OpenCV.
// DICT_6X6_50 contains the first markers of DICT_6X6_250.
std::string canonical(const std::string &family) {
    constexpr std::string_view april_tag = "DICT_APRILTAG_";
    if (family.starts_with(april_tag))
        return "tag" + family.substr(april_tag.size());
    for (const char *series : {"DICT_4X4", "DICT_5X5", "DICT_6X6", "DICT_7X7"})
        for (const char *count : {"_50", "_100", "_250", "_1000"})
            if (family == std::string(series) + count)
                return series;
    return family;
}

std::string marker_name(const std::string &family, std::int64_t id) {
    return family + "-" + std::to_string(id);
}

double parse_side(const yaml::Node &node) {
    return node.real(min_side_mm, max_side_mm);
}

// Returns a warning, or "".
std::string doubt_of_side(double side_mm) {
    if (side_mm >= 1 && side_mm <= 5000)
        return "";
    char text[32];
    char *const end = std::to_chars(text, std::end(text), side_mm, std::chars_format::general, 6).ptr;
    return "a print of " + std::string(text, end) + " mm is implausible; check the unit, which is mm";
}

// Returns whether it warns.
bool warn_of_side(const yaml::Node &node, double side_mm, std::vector<std::string> &warnings) {
    const std::string doubt = doubt_of_side(side_mm);
    if (!doubt.empty())
        warnings.push_back(warning_at(node, doubt));
    return !doubt.empty();
}

Corners square_mm(double side_mm) {
    const double s = side_mm / 2;
    return {{{-s, s, 0}, {s, s, 0}, {s, -s, 0}, {-s, -s, 0}}};
}

TargetMarker marker_of(std::int64_t id, const std::string &family, const Corners &corners_mm) {
    TargetMarker marker;
    marker.id = static_cast<std::int32_t>(id);
    marker.family = family;
    for (std::size_t i = 0; i < corners_mm.size(); ++i)
        marker.corners_mm[i] = {corners_mm[i].x, corners_mm[i].y, corners_mm[i].z};
    return marker;
}

// Parses "7" and "0-3".
std::optional<std::pair<std::int32_t, std::int32_t>> parse_range(std::string_view text) {
    const char *const end = text.data() + text.size();
    std::int32_t first = 0, last = 0;
    auto at = std::from_chars(text.data(), end, first);
    last = first;
    if (at.ec == std::errc() && at.ptr != end && *at.ptr == '-')
        at = std::from_chars(at.ptr + 1, end, last);
    if (at.ec != std::errc() || at.ptr != end || first < 0 || last < first)
        return std::nullopt;
    return std::pair(first, last);
}

// Parses ids, which are text such as "0-3,7", or a list of such texts.
std::vector<std::int32_t> parse_ids(const yaml::Node &node) {
    std::vector<std::int32_t> ids;
    for (const yaml::Node &item : node.is_sequence() ? node.items() : std::vector{node}) {
        std::istringstream parts(item.text() + ",");
        for (std::string part; std::getline(parts, part, ',');) {
            std::string_view text = part;
            text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
            text = text.substr(0, text.find_last_not_of(' ') + 1);
            const auto range = parse_range(text);
            if (!range)
                item.fail("must be ids of 0 to " + std::to_string(max_id) +
                          " in ascending order, such as 0-35 or [0-3, 7], but is '" +
                          base::printable(item.text(), 200) + "'");
            if (const std::size_t count =
                    static_cast<std::size_t>(range->second) - static_cast<std::size_t>(range->first) + 1;
                ids.size() + count > ARHOST_MAX_TARGETS)
                item.fail("there can be at most " + std::to_string(int{ARHOST_MAX_TARGETS}) + " targets");
            for (std::int32_t id = range->first; id < range->second; ++id)
                ids.push_back(id);
            ids.push_back(range->second);
        }
    }
    if (ids.empty())
        node.fail("must not be empty");
    return ids;
}

// Rejects `ids` that is a list without brackets: YAML parses {ids: 0-3,7} as ids: 0-3 and a key 7.
void expect_no_ids_as_keys(const yaml::Node &target) {
    const auto ids = target.find("ids");
    if (!ids || !ids->is_scalar())
        return;
    std::string list = ids->text();
    for (const auto &[key, value] : target.entries())
        if (value.is_null() && parse_range(key))
            list += ", " + key;
    if (list != ids->text())
        ids->fail("in braces, YAML ends a value at a comma; write ids: [" + list + "]");
}

glm::dvec3 parse_vector(const yaml::Node &node, double limit) {
    const std::vector<double> values = node.reals(3);
    for (const yaml::Node &value : node.items())
        value.real(-limit, limit);
    return {values[0], values[1], values[2]};
}

glm::dvec3 parse_point(const yaml::Node &node) {
    return parse_vector(node, max_coordinate_mm);
}

// Returns R = Rz·Ry·Rx.
glm::dmat3 parse_rotation(const yaml::Node &node) {
    const glm::dvec3 angles = glm::radians(parse_vector(node, 360));
    glm::dmat4 rotation(1);
    rotation = glm::rotate(rotation, angles.z, {0, 0, 1});
    rotation = glm::rotate(rotation, angles.y, {0, 1, 0});
    return glm::rotate(rotation, angles.x, {1, 0, 0});
}

double mean_side(const Corners &corners) {
    double sum = 0;
    for (std::size_t i = 0; i < 4; ++i)
        sum += glm::distance(corners[(i + 1) % 4], corners[i]);
    return sum / 4;
}

glm::dvec3 centre_of(const Corners &corners) {
    return (corners[0] + corners[1] + corners[2] + corners[3]) / 4.0;
}

// Returns the normal that points to the side from which the corners are clockwise, the front of the marker.
glm::dvec3 normal_of(const Corners &corners) {
    return glm::normalize(glm::cross(corners[3] - corners[1], corners[2] - corners[0]));
}

Corners parse_corners(const yaml::Node &node) {
    const std::vector<yaml::Node> points = node.items();
    if (points.size() != 4)
        node.fail("must be 4 corners [x, y, z]: top left, top right, bottom right, bottom left; but has " +
                  std::to_string(points.size()));
    Corners corners;
    std::ranges::transform(points, corners.begin(), parse_point);
    for (std::size_t i = 0; i < 4; ++i)
        if (const double side = glm::distance(corners[(i + 1) % 4], corners[i]);
            side < min_side_mm || side > max_side_mm)
            points[i].fail("the side to the next corner must be 0.01 to 1e+06 mm long");
    const glm::dvec3 centre = centre_of(corners), normal = normal_of(corners);
    for (std::size_t i = 0; i < 4; ++i) {
        const glm::dvec3 to = glm::normalize(corners[i] - corners[(i + 3) % 4]),
                         from = glm::normalize(corners[(i + 1) % 4] - corners[i]);
        if (!(glm::dot(glm::cross(from, to), normal) > tolerance)) // also true if the normal is NaN
            points[i].fail("the corners must form a convex quadrilateral in the order top left, top right, bottom "
                           "right, bottom left");
        if (std::abs(glm::dot(corners[i] - centre, normal)) > tolerance * mean_side(corners))
            node.fail("the corners must be in a plane to within 1 % of the side");
    }
    return corners;
}

struct PlacedMarker {
    std::int64_t id;
    Corners corners_mm;
};

PlacedMarker placed(std::int64_t id, double side_mm, const glm::dmat3 &rotation, const glm::dvec3 &position_mm) {
    PlacedMarker marker{id, square_mm(side_mm)};
    for (glm::dvec3 &corner : marker.corners_mm)
        corner = rotation * corner + position_mm;
    return marker;
}

PlacedMarker parse_placed_marker(const yaml::Node &node) {
    node.allow_keys({"id", "side_mm", "position_mm", "rotation_degrees", "corners_mm"});
    const auto corners = node.find("corners_mm");
    if (!corners && !node.find("side_mm"))
        node.fail("the key 'side_mm' (with 'position_mm') or 'corners_mm' is missing");
    for (const char *key : {"side_mm", "position_mm", "rotation_degrees"})
        if (const auto other = corners ? node.find(key) : std::nullopt)
            other->fail("the place is also given by 'corners_mm'; remove one of them");
    const std::int64_t id = node.require("id").integer(0, max_id);
    if (corners)
        return {id, parse_corners(*corners)};
    const auto rotation = node.find("rotation_degrees");
    return placed(id, parse_side(node.require("side_mm")), rotation ? parse_rotation(*rotation) : glm::dmat3(1),
                  parse_point(node.require("position_mm")));
}

// Parses a tag of a bundle of AprilRobotics' apriltag_ros: metres, and a quaternion of any length.
PlacedMarker parse_tag_of_bundle(const yaml::Node &node) {
    constexpr double mm_per_m = 1000;
    node.allow_keys({"id", "size", "name", "x", "y", "z", "qw", "qx", "qy", "qz"});
    const auto real_or = [&](const char *key, double fallback, double limit) {
        const auto value = node.find(key);
        return value ? value->real(-limit, limit) : fallback;
    };
    constexpr double limit_m = max_coordinate_mm / mm_per_m;
    const glm::dvec3 position_m(real_or("x", 0, limit_m), real_or("y", 0, limit_m), real_or("z", 0, limit_m));
    const glm::dquat rotation(real_or("qw", 1, 1e6), real_or("qx", 0, 1e6), real_or("qy", 0, 1e6),
                              real_or("qz", 0, 1e6));
    if (!(glm::length(rotation) > 1e-6))
        node.fail("the quaternion qw, qx, qy, qz must not be 0");
    return placed(node.require("id").integer(0, max_id),
                  mm_per_m * node.require("size").real(min_side_mm / mm_per_m, max_side_mm / mm_per_m),
                  glm::mat3_cast(glm::normalize(rotation)), mm_per_m * position_m);
}

bool are_at_the_same_place(const Corners &a, const Corners &b) {
    const double side = mean_side(a), limit = tolerance * side;
    return std::abs(side - mean_side(b)) < limit && glm::distance(centre_of(a), centre_of(b)) < limit &&
           glm::dot(normal_of(a), normal_of(b)) > 0;
}

// Whether both markers lie in one plane and partly cover each other. A small marker may be inside a larger one.
bool overlap(const Corners &a, const Corners &b) {
    const glm::dvec3 normal = normal_of(a);
    const double limit = tolerance * std::min(mean_side(a), mean_side(b));
    constexpr double parallel = 0.9999; // minimum cosine of the angle between the normals of parallel markers
    if (glm::dot(normal, normal_of(b)) < parallel || std::abs(glm::dot(normal, centre_of(b) - centre_of(a))) > limit)
        return false;
    // Returns how far the corners of `of` are outside of an edge of `from`.
    const auto outside = [&](const Corners &of, const Corners &from, std::size_t edge) {
        const glm::dvec3 outward = glm::normalize(glm::cross(normal, from[(edge + 1) % 4] - from[edge]));
        std::array<double, 4> distances{};
        std::ranges::transform(of, distances.begin(),
                               [&](const glm::dvec3 &corner) { return glm::dot(outward, corner - from[edge]); });
        return std::ranges::minmax(distances);
    };
    const auto is_apart_or_inside = [&](const Corners &of, const Corners &from) {
        bool is_inside = true;
        for (std::size_t edge = 0; edge < 4; ++edge) {
            const auto [nearest, farthest] = outside(of, from, edge);
            if (nearest > -limit)
                return true;
            is_inside &= farthest < limit;
        }
        return is_inside;
    };
    return !is_apart_or_inside(a, b) && !is_apart_or_inside(b, a);
}

// The owner of each marker: a marker belongs to one target.
class Owners {
public:
    void add(const yaml::Node &node, const Target &target) {
        for (const TargetMarker &marker : target.markers) {
            families_.insert(marker.family);
            std::error_code ignored;
            const fs::path file = marker.file.empty() ? "" : fs::canonical(marker.file, ignored);
            if (!file.empty()) {
                const auto [other, is_new] = prints_.try_emplace({file, marker.pattern_ratio}, target.name);
                if (!is_new)
                    node.fail("the print '" + base::printable(marker.file) + "' also belongs to the target '" +
                              other->second + "'; remove one of them");
            }
            if (const auto [other, is_new] = markers_.try_emplace({canonical(marker.family), marker.id}, target.name);
                !is_new)
                node.fail("the marker " + marker_name(marker.family, marker.id) + " also belongs to the target '" +
                          other->second + "'; remove one of them");
        }
        if (const auto [other, is_new] = names_.try_emplace(target.name, node.where()); !is_new)
            node.fail("the name '" + target.name + "' is also that of another target (" + other->second +
                      "); give each its own name");
    }
    std::size_t marker_count() const { return markers_.size(); }
    std::size_t family_count() const { return families_.size(); }

private:
    std::map<std::string, std::string> names_; // with the positions of the targets in the configuration
    std::map<std::pair<std::string, double>, std::string>
        prints_; // files and pattern ratios, with the names of targets
    std::map<std::pair<std::string, std::int32_t>, std::string> markers_;
    std::set<std::string> families_;
};

// Parses a list of placed markers and checks that they are different and at different places.
template <class ParseMarker>
std::vector<TargetMarker> parse_layout(const yaml::Node &list, const std::string &family, const ParseMarker &parse,
                                       const std::string &example, std::vector<std::string> &warnings) {
    const std::vector<yaml::Node> nodes = list.items();
    if (nodes.empty() || nodes.size() > ARHOST_MAX_MARKERS)
        list.fail("must list 1 to " + std::to_string(int{ARHOST_MAX_MARKERS}) + " markers, as in [" + example + "]");
    std::vector<PlacedMarker> layout;
    bool warned = false; // the unit is the same for all markers
    for (const yaml::Node &node : nodes) {
        const PlacedMarker marker = parse(node);
        for (std::size_t i = 0; i < layout.size(); ++i) {
            const auto other = [&] { return nodes[i].path() + " (" + nodes[i].where() + ")"; };
            if (layout[i].id == marker.id)
                node.require("id").fail("the marker " + std::to_string(marker.id) + " is also " + other() +
                                        "; keep one of them");
            if (are_at_the_same_place(layout[i].corners_mm, marker.corners_mm))
                node.fail("the marker " + std::to_string(marker.id) + " is at the place of marker " +
                          std::to_string(layout[i].id) + ", " + other() + "; correct one of them");
            if (overlap(layout[i].corners_mm, marker.corners_mm))
                node.fail("the marker " + std::to_string(marker.id) + " covers a part of marker " +
                          std::to_string(layout[i].id) + ", " + other() +
                          "; correct the place or the side of one of them");
        }
        layout.push_back(marker);
        warned = warned || warn_of_side(node, mean_side(marker.corners_mm), warnings);
    }
    std::vector<TargetMarker> markers(layout.size());
    std::ranges::transform(layout, markers.begin(), [&](const PlacedMarker &marker) {
        return marker_of(marker.id, family, marker.corners_mm);
    });
    return markers;
}

std::vector<TargetMarker> parse_map(const yaml::Node &root, std::vector<std::string> &warnings) {
    root.allow_keys({"version", "family", "dictionary", "markers"});
    if (const yaml::Node version = root.require("version"); version.integer() != 1)
        version.fail("must be 1, the only supported version");
    return parse_layout(root.require("markers"), parse_family(root), parse_placed_marker,
                        "{id: 0, side_mm: 80, position_mm: [0, 0, 0]}", warnings);
}

// Parses a bundle file of AprilRobotics' apriltag_ros. If it has several bundles, uses the one named `target_name`.
std::vector<TargetMarker> parse_bundle(const yaml::Node &bundles, const std::string &target_name,
                                       const std::string &family, std::vector<std::string> &warnings) {
    std::optional<yaml::Node> chosen;
    std::string names;
    const std::vector<yaml::Node> all = bundles.items();
    for (const yaml::Node &bundle : all) {
        bundle.allow_keys({"name", "layout"});
        const std::string name = bundle.require("name").text();
        if (all.size() == 1 || name == target_name)
            chosen = bundle;
        names += (names.empty() ? "'" : ", '") + base::printable(name, 200) + "'";
    }
    if (!chosen)
        bundles.fail(all.empty() ? "has no bundle"
                                 : "has the bundles " + names + "; give the target the name of one of them");
    return parse_layout(chosen->require("layout"), family, parse_tag_of_bundle,
                        "{id: 0, size: 0.08, x: 0, y: 0, z: 0, qw: 1, qx: 0, qy: 0, qz: 0}", warnings);
}

// Checks that `file`, the pattern or picture of a target, exists. Adds it to `files`, which the tracker may read.
// Reports errors through `owner`.
template <class Owner>
std::string found_print(const fs::path &file, const Owner &owner, std::vector<fs::path> &files) {
    std::error_code ignored;
    if (!fs::exists(file, ignored))
        owner.fail("there is no file '" + base::printable(file.string()) + "'" + hint_at_similar_name(file));
    if (!fs::is_regular_file(file, ignored))
        owner.fail("'" + base::printable(file.string()) + "' is not a file");
    files.push_back(file);
    return file.string();
}

// Returns the markers of a multi-marker file. `number`: the id for the first pattern.
std::vector<TargetMarker> markers_of(const std::vector<MultiMarker> &layout, const yaml::Node &target,
                                     const fs::path &folder, std::size_t number, std::vector<fs::path> &files,
                                     std::vector<std::string> &warnings) {
    std::vector<TargetMarker> markers;
    std::vector<Corners> places;
    bool has_ids = false, warned = false;
    for (std::size_t i = 0; i < layout.size(); ++i) {
        const MultiMarker &one = layout[i];
        places.push_back(placed(0, one.side_mm, one.rotation, one.position_mm).corners_mm);
        for (std::size_t k = 0; k < i; ++k) {
            if (layout[k].print == one.print)
                one.fail("'" + base::printable(one.print, 200) + "' is also at " + layout[k].where +
                         "; keep one of them");
            if (are_at_the_same_place(places[k], places[i]))
                one.fail("this marker is at the place of that at " + layout[k].where + "; correct one of them");
            if (overlap(places[k], places[i]))
                one.fail("this marker covers a part of that at " + layout[k].where +
                         "; correct the place or the side of one of them");
        }
        if (const std::string doubt = doubt_of_side(one.side_mm); !warned && !doubt.empty()) {
            warnings.push_back(one.where + ": " + doubt);
            warned = true;
        }
        const bool is_id = one.print.find_first_not_of("0123456789") == std::string::npos;
        if (is_id) {
            std::int32_t id = 0;
            if (std::from_chars(one.print.data(), one.print.data() + one.print.size(), id).ec != std::errc())
                one.fail("ids are 0 to " + std::to_string(max_id) + ", but this is " +
                         base::printable(one.print, 200));
            markers.push_back(marker_of(id, parse_family(target), places[i]));
        } else {
            markers.push_back(marker_of(static_cast<std::int64_t>(number + i), pattern_family, places[i]));
            markers.back().file = found_print((folder / one.print).lexically_normal(), one, files);
            markers.back().pattern_ratio = default_pattern_ratio;
        }
        has_ids |= is_id;
    }
    for (const char *key : {"family", "dictionary"})
        if (const auto family = target.find(key); family && !has_ids)
            family->fail("does not apply to a map of patterns; remove it");
    return markers;
}

Target parse_map_target(const yaml::Node &node, std::size_t number, std::vector<fs::path> &map_files,
                        std::vector<std::string> &warnings) {
    Target target{parse_name(node.require("name"), ARHOST_MAX_NAME), {}, ""};
    const yaml::Node map = node.require("map");
    const fs::path file = map.input_path();
    std::error_code ignored;
    if (!fs::exists(file, ignored))
        map.fail("there is no map file '" + file.string() + "'" + hint_at_similar_name(file));
    map_files.push_back(file);
    const std::string text = yaml::read_file(file);
    if (is_multi_marker_file(text)) {
        target.markers =
            markers_of(parse_multi_marker_file(file, text), node, file.parent_path(), number, map_files, warnings);
        return target;
    }
    const yaml::Node root = yaml::Node::parse(text, file.string());
    if (const auto bundles = root.find("tag_bundles")) {
        target.markers = parse_bundle(*bundles, target.name, parse_family(node), warnings);
        return target;
    }
    for (const char *key : {"family", "dictionary"})
        if (const auto family = node.find(key))
            family->fail("belongs in the map; remove it here");
    target.markers = parse_map(root, warnings);
    return target;
}

// Parses a target that is an ARToolKit pattern or a picture. `number`: the id for the marker.
Target parse_print_target(const yaml::Node &node, const char *kind, std::size_t number, std::vector<fs::path> &files,
                          std::vector<std::string> &warnings) {
    const bool is_pattern = std::string_view(kind) == pattern_family;
    const yaml::Node side = node.require(is_pattern ? "side_mm" : "width_mm");
    TargetMarker marker = marker_of(static_cast<std::int64_t>(number), kind, square_mm(parse_side(side)));
    warn_of_side(side, parse_side(side), warnings);
    const yaml::Node print = node.require(kind);
    marker.file = found_print(print.input_path(), print, files);
    const auto ratio = node.find("pattern_ratio");
    marker.pattern_ratio = ratio ? ratio->real(0.1, 0.9) : is_pattern ? default_pattern_ratio : 0;
    return {parse_name(node.require("name"), ARHOST_MAX_NAME), {marker}, ""};
}

// A kind of target. A target has this kind if it has the key that only this kind has. The other keys, besides `name`,
// are those that apply to the kind.
struct Kind {
    const char *key;
    std::vector<std::string_view> keys;
};
const std::vector<Kind> &kinds() {
    static const std::vector<Kind> all = {{"marker", {"family", "dictionary", "side_mm"}},
                                          {"ids", {"family", "dictionary", "side_mm"}},
                                          {"map", {"family", "dictionary"}},
                                          {"pattern", {"side_mm", "pattern_ratio"}},
                                          {"image", {"width_mm"}},
                                          {"body", {}}};
    return all;
}

constexpr const char *kind_names = "'marker', 'ids', 'map', 'pattern', 'image' and 'body'";

std::string kind_of(const yaml::Node &node) {
    const Kind *found = nullptr;
    for (const Kind &kind : kinds())
        if (const auto key = node.find(kind.key)) {
            if (found)
                key->fail(std::string("a target has only one of the keys ") + kind_names + ", but '" + found->key +
                          "' is there, too; make two targets of them");
            found = &kind;
        }
    if (!found)
        node.fail(std::string("one of the keys ") + kind_names +
                  " is missing, as in {marker: 0, family: tag36h11, side_mm: 80}");
    for (const char *key : {"family", "dictionary", "side_mm", "width_mm", "pattern_ratio"})
        if (const auto other = node.find(key); other && std::ranges::count(found->keys, key) == 0)
            other->fail(std::string_view(found->key) == "map" ? "belongs in the map; remove it here"
                        : std::string_view(found->key) == "body"
                            ? "does not apply to a body, which has no markers; remove it"
                            : "does not apply to a target with '" + std::string(found->key) + "'; remove it");
    return found->key;
}

// Returns the targets of an element of the list; several if the element is a range of ids. `number`: the id for the
// first marker.
std::vector<Target> parse_target(const yaml::Node &node, std::size_t number, std::vector<fs::path> &files,
                                 std::vector<std::string> &warnings) {
    if (!node.is_map())
        node.fail("must be a map of keys, as in {marker: 0, family: tag36h11, side_mm: 80}");
    expect_no_ids_as_keys(node);
    node.allow_keys(keys_of("tracker.targets[]"));
    const std::string kind = kind_of(node);
    if (kind == "body")
        return {{parse_name(node.require("name"), ARHOST_MAX_NAME), {}, parse_body(node.require("body"))}};
    if (kind == "map")
        return {parse_map_target(node, number, files, warnings)};
    if (kind == pattern_family || kind == image_family)
        return {parse_print_target(node, kind.c_str(), number, files, warnings)};

    const std::string family = parse_family(node);
    const yaml::Node side = node.require("side_mm");
    const Corners corners_mm = square_mm(parse_side(side));
    warn_of_side(side, parse_side(side), warnings);
    const auto name = node.find("name");
    if (kind == "marker") {
        const std::int64_t id = node.require("marker").integer(0, max_id);
        return {{name ? parse_name(*name, ARHOST_MAX_NAME) : marker_name(family, id),
                 {marker_of(id, family, corners_mm)},
                 ""}};
    }
    if (name)
        name->fail("the targets of a range of ids are named FAMILY-ID, such as " + marker_name(family, 0) +
                   "; remove this key, or list targets with 'marker'");
    std::vector<Target> targets;
    for (const std::int32_t id : parse_ids(node.require("ids")))
        targets.push_back({marker_name(family, id), {marker_of(id, family, corners_mm)}, ""});
    return targets;
}

// Returns the tracker's option that chose the family of all markers in earlier versions, if it is set.
std::optional<yaml::Node> family_option(const yaml::Node &tracker, const char *name) {
    const auto options = tracker.find("options");
    const auto option = options && options->is_map() ? options->find(name) : std::nullopt;
    return option && option->is_scalar() ? option : std::nullopt;
}

// Returns the family that earlier versions used for all markers of a configuration, in the syntax of a target.
std::string family_of_all_markers(const yaml::Node &tracker) {
    if (const auto file = family_option(tracker, "dictionary_file"))
        return "dictionary: " + fs::path(file->text()).stem().string();
    for (const char *name : {"dictionary", "family"})
        if (const auto option = family_option(tracker, name))
            return std::string(name) + ": " + option->text();
    return "family: tag36h11";
}

} // namespace

std::vector<Target> parse_targets(const yaml::Node &list, std::vector<yaml::Node> &nodes,
                                  std::vector<fs::path> &files, std::vector<std::string> &warnings) {
    std::vector<Target> targets;
    Owners owners;
    for (const yaml::Node &node : list.items())
        for (Target &target : parse_target(node, owners.marker_count(), files, warnings)) {
            owners.add(node, target);
            targets.push_back(std::move(target));
            nodes.push_back(node);
            for (const auto &[count, limit, what] : {std::tuple{targets.size(), int{ARHOST_MAX_TARGETS}, "targets"},
                                                     {owners.marker_count(), ARHOST_MAX_MARKERS, "markers"},
                                                     {owners.family_count(), ARHOST_MAX_FAMILIES, "families"}})
                if (count > static_cast<std::size_t>(limit))
                    node.fail("there can be at most " + std::to_string(limit) + " " + what);
        }
    if (targets.empty())
        list.fail("must list 1 to " + std::to_string(int{ARHOST_MAX_TARGETS}) +
                  " targets, as in [{marker: 0, family: tag36h11, side_mm: 80}]");
    return targets;
}

std::vector<TargetMarker> read_map(const fs::path &file, std::vector<std::string> &warnings) {
    return parse_map(yaml::Node::load(file), warnings);
}

void reject_markers(const yaml::Node &tracker) {
    const auto markers = tracker.find("markers");
    if (!markers)
        return;
    const std::string family = family_of_all_markers(tracker);
    std::string targets;
    if (markers->is_sequence())
        for (const yaml::Node &marker : markers->items()) {
            const auto id = marker.is_map() ? marker.find("id") : std::nullopt;
            const auto side = marker.is_map() ? marker.find("side_mm") : std::nullopt;
            if (id && side && id->is_scalar() && side->is_scalar())
                targets += (targets.empty() ? "" : ", ") +
                           ("{marker: " + id->text() + ", " + family + ", side_mm: " + side->text() + "}");
        }
    if (targets.empty())
        targets = "{marker: 0, " + family + ", side_mm: 80}";
    markers->fail("is now 'targets'; write: targets: [" + base::printable(targets) + "]");
}

void reject_family_option(const yaml::Node &tracker) {
    for (const auto &[plugin, name] : {std::pair{"tracker_aruco", "dictionary"}, {"tracker_apriltag", "family"}})
        if (const auto option = family_option(tracker, name);
            option && fs::path(tracker.require("plugin").text()).stem() == plugin)
            option->fail("belongs to each target now: remove it here and write '" + std::string(name) + ": " +
                         base::printable(option->text(), 200) + "' in tracker.targets");
}

} // namespace arhost::run_config
