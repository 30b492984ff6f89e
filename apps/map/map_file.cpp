// SPDX-License-Identifier: Apache-2.0
#include "map_file.hpp"

#include "yaml/yaml.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <set>

namespace arhost::map {
namespace {

// Rotates about the fixed axes x, then y, then z.
Eigen::Matrix3d rotation_of(const Eigen::Vector3d &degrees) {
    const Eigen::Vector3d angles = std::numbers::pi / 180 * degrees;
    return (Eigen::AngleAxisd(angles.z(), Eigen::Vector3d::UnitZ()) *
            Eigen::AngleAxisd(angles.y(), Eigen::Vector3d::UnitY()) *
            Eigen::AngleAxisd(angles.x(), Eigen::Vector3d::UnitX()))
        .toRotationMatrix();
}

Eigen::Vector3d degrees_of(const Eigen::Matrix3d &r) {
    const double cosine = std::hypot(r(0, 0), r(1, 0));
    Eigen::Vector3d angles(std::atan2(r(2, 1), r(2, 2)), std::atan2(-r(2, 0), cosine), std::atan2(r(1, 0), r(0, 0)));
    if (cosine < 1e-9) // x and z turn about the same axis
        angles = {std::atan2(-r(1, 2), r(1, 1)), angles.y(), 0};
    return angles * (180 / std::numbers::pi);
}

Eigen::Vector3d vector_in(const yaml::Node &node) {
    return Eigen::Map<const Eigen::Vector3d>(node.reals(3).data());
}

Marker marker_in(const yaml::Node &node, const marker::Family &family) {
    node.allow_keys({"id", "side_mm", "position_mm", "rotation_degrees", "corners_mm"});
    Marker marker{static_cast<int>(node.require("id").integer(0, family.count - 1)), 0, {}};
    const auto given = node.find("corners_mm");
    if (!given) {
        marker.side_mm = node.require("side_mm").real(1e-3, 1e6);
        marker.map_from_marker.translation_mm = vector_in(node.require("position_mm"));
        if (const auto degrees = node.find("rotation_degrees"))
            marker.map_from_marker.rotation = rotation_of(vector_in(*degrees));
        return marker;
    }
    const std::vector<yaml::Node> items = given->items();
    if (items.size() != 4)
        given->fail("must be the 4 corners: top left, top right, bottom right, bottom left");
    std::array<Eigen::Vector3d, 4> corners;
    for (std::size_t i = 0; i < 4; ++i)
        corners[i] = vector_in(items[i]);
    const Eigen::Vector3d x = (corners[1] - corners[0] + corners[2] - corners[3]) / 2;
    const Eigen::Vector3d up = (corners[0] - corners[3] + corners[1] - corners[2]) / 2;
    const Eigen::Vector3d z = x.cross(up).normalized();
    marker.side_mm = x.norm();
    marker.map_from_marker.rotation << x.normalized(), z.cross(x.normalized()), z;
    marker.map_from_marker.translation_mm = (corners[0] + corners[1] + corners[2] + corners[3]) / 4;
    const auto square = pose::square_corners_mm(marker.side_mm);
    for (std::size_t i = 0; i < 4; ++i)
        if (!((marker.map_from_marker * square[i] - corners[i]).norm() < 0.02 * marker.side_mm)) // also for NaN
            given->fail(
                "must be the corners of a square, in the order top left, top right, bottom right, bottom left");
    return marker;
}

} // namespace

std::vector<Marker> read_map(const std::filesystem::path &file, const marker::Family &family) {
    const yaml::Node root = yaml::Node::load(file);
    root.allow_keys({"version", "family", "dictionary", "markers"});
    root.require("version").integer(1, 1);
    auto name = root.find("family");
    if (!name)
        name = root.require("dictionary");
    if (const std::string given = marker::find_family(name->text()).name; given != family.name)
        name->fail(fmt::format("is {}, but the markers to find are of {}", given, family.name));
    std::vector<Marker> markers;
    std::set<int> ids;
    for (const yaml::Node &node : root.require("markers").items())
        if (!ids.insert(markers.emplace_back(marker_in(node, family)).id).second)
            node.fail(fmt::format("marker {} is listed twice; remove one of the two", markers.back().id));
    return markers;
}

std::string map_text(const std::vector<LearnedMarker> &markers, const marker::Family &family,
                     const std::string &comment) {
    const auto list = [](const Eigen::Vector3d &v) {
        const auto rounded = [](double x) { return std::round(x * 1e4) / 1e4 + 0.0; }; // + 0.0: no −0
        return fmt::format("[{}, {}, {}]", rounded(v.x()), rounded(v.y()), rounded(v.z()));
    };
    std::string text = fmt::format("{}version: 1\n{}: {}\nmarkers:\n", comment,
                                   family.is_dictionary ? "dictionary" : "family", family.name);
    for (const LearnedMarker &marker : markers)
        text += fmt::format("  - {{id: {}, side_mm: {}, position_mm: {}, rotation_degrees: {}}}\n", marker.id,
                            marker.side_mm, list(marker.map_from_marker.translation_mm),
                            list(degrees_of(marker.map_from_marker.rotation)));
    return text;
}

} // namespace arhost::map
