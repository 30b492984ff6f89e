// SPDX-License-Identifier: Apache-2.0
#include "scene/obj.hpp"

#include "scene/polygon.hpp"
#include "scene/srgb.hpp"

#include <arhost/scene.h>

#include <algorithm>
#include <array>
#include <bit>
#include <map>

namespace arhost::scene {
namespace {

class ObjParser {
public:
    ObjParser(const MeshFile &file, const Reporter &reporter)
        : file_(file), reporter_(reporter), p_(file.begin()), end_(file.end()) {}

    MeshWithMaterials parse() {
        if (file_.view().starts_with("\xef\xbb\xbf")) // UTF-8 byte order mark
            p_ += 3;
        const char *next_report = p_;
        while (p_ < end_) {
            statement();
            skip_line(p_, end_);
            if (p_ >= next_report) {
                reporter_.report(static_cast<double>(p_ - file_.begin()) / static_cast<double>(file_.view().size()));
                next_report = p_ + (1 << 20);
            }
        }
        if (corners_[0].empty())
            file_.fail("contains no triangles" + std::string(other_shapes_ ? ", only points, lines or curves" : "") +
                       (positions_.empty() ? ", and no vertices" : ""));
        if (!colours_.empty())
            colours_.resize(positions_.size(), no_colour);
        return {mesh(), std::move(uses_)};
    }

private:
    enum { Position, Texcoord, Normal };
    static constexpr glm::u16vec4 no_colour{65535};

    void statement() {
        skip_blanks(p_, end_);
        const char *line = p_;
        if (word("f"))
            face(line);
        else if (word("v"))
            vertex(line);
        else if (word("vn"))
            normals_.push_back(numbers<glm::vec3>(line, 3, "a normal"));
        else if (word("vt"))
            texcoords_.push_back(numbers<glm::vec2>(line, 1, "a texcoord"));
        else if (word("usemtl"))
            use_material(line);
        else if (word("mtllib"))
            uses_.libraries.emplace_back(rest_of_line(p_, end_));
        else if (word("l") || word("p") || word("curv") || word("surf"))
            other_shapes_ = true;
    }

    bool word(std::string_view expected) {
        const std::string_view left(p_, static_cast<std::size_t>(end_ - p_));
        if (!left.starts_with(expected) || left.size() == expected.size() || !is_blank(left[expected.size()]))
            return false;
        p_ += expected.size();
        return true;
    }

    // Skips blanks and line continuations (a backslash at the end of a line).
    void skip_gap() {
        while (true) {
            skip_blanks(p_, end_);
            if (p_ == end_ || *p_ != '\\')
                return;
            const char *after = p_ + 1;
            skip_blanks(after, end_);
            if (after < end_ && *after != '\n')
                return;
            p_ = std::min(after + 1, end_);
        }
    }
    bool at_line_end() {
        skip_gap();
        return p_ == end_ || *p_ == '\n' || *p_ == '#';
    }
    bool at_token_end() const { return p_ == end_ || is_blank(*p_) || *p_ == '\n' || *p_ == '\\' || *p_ == '#'; }

    template <class Vector> Vector numbers(const char *line, int needed, const char *what) {
        Vector values(0);
        for (int i = 0; i < Vector::length(); ++i) {
            if (at_line_end()) {
                if (i >= needed)
                    break;
                file_.fail_line(line, std::string(what) + " needs " + std::to_string(needed) + " numbers, but has " +
                                          std::to_string(i));
            }
            const char *token = p_;
            if (!read_number(p_, end_, values[i]) || !at_token_end())
                file_.fail_line(token, "'" + token_at(token, end_) + "' is not a number");
            if (!std::isfinite(values[i]))
                file_.fail_line(token, std::string(what) + " has the invalid number '" + token_at(token, end_) + "'");
        }
        return values;
    }

    void vertex(const char *line) {
        positions_.push_back(numbers<glm::vec3>(line, 3, "a vertex"));
        std::array<float, 4> colour{0, 0, 0, 1};
        std::size_t count = 0;
        while (count < colour.size() && !at_line_end() && read_number(p_, end_, colour[count]))
            ++count;
        if (count < 3) // a weight
            return;
        colours_.resize(positions_.size() - 1, no_colour);
        const auto linear = [&](std::size_t i) {
            return colour_channel(linear_from_srgb(static_cast<double>(colour[i])));
        };
        colours_.emplace_back(linear(0), linear(1), linear(2), colour_channel(static_cast<double>(colour[3])));
    }

    void use_material(const char *line) {
        // Names may contain blanks.
        const auto [name, is_new] = names_.try_emplace(std::string(rest_of_line(p_, end_)), uses_.names.size());
        if (is_new) {
            line_number_ += static_cast<std::size_t>(std::count(counted_, line, '\n'));
            counted_ = line;
            uses_.names.push_back({name->first, line_number_});
        }
        const std::size_t first_triangle = corners_[Position].size();
        if (!uses_.runs.empty() && uses_.runs.back().first_triangle == first_triangle)
            uses_.runs.pop_back();
        uses_.runs.push_back({first_triangle, name->second});
    }

    // Corners are v, v/vt, v//vn or v/vt/vn; indices count from 1, or backwards from -1.
    void face(const char *line) {
        for (auto &corners : polygon_)
            corners.clear();
        while (!at_line_end()) {
            const char *token = p_;
            polygon_[Position].push_back(index(token, positions_.size(), "vertex"));
            std::uint32_t texcoord = ARHOST_NONE, normal = ARHOST_NONE;
            if (p_ < end_ && *p_ == '/') {
                ++p_;
                if (p_ < end_ && *p_ != '/' && !at_token_end())
                    texcoord = index(token, texcoords_.size(), "texcoord");
                if (p_ < end_ && *p_ == '/') {
                    ++p_;
                    if (!at_token_end())
                        normal = index(token, normals_.size(), "normal");
                }
            }
            if (!at_token_end())
                file_.fail_line(token, "'" + token_at(token, end_) + "' is not a corner of a face");
            polygon_[Texcoord].push_back(texcoord);
            polygon_[Normal].push_back(normal);
        }
        const auto &polygon = polygon_[Position];
        if (polygon.size() < 3)
            file_.fail_line(line, "a face needs at least three corners, but this one has " +
                                      std::to_string(polygon.size()));
        const auto triangles = triangulate(polygon, positions_, triangles_);
        if (triangles.empty())
            file_.fail_line(line, "a concave face has " + std::to_string(polygon.size()) + " corners, more than " +
                                      std::to_string(concave_corner_limit) + "; triangulate it");
        if (corners_[Position].size() + triangles.size() >= ARHOST_NONE / 3)
            file_.fail_line(line, "too many triangles");
        for (const glm::uvec3 &t : triangles) {
            for (const int kind : {Position, Texcoord, Normal}) {
                const auto &from = polygon_[kind];
                if (kind != Position && !used_[kind]) {
                    if (from[t.x] == ARHOST_NONE && from[t.y] == ARHOST_NONE && from[t.z] == ARHOST_NONE)
                        continue;
                    used_[kind] = true; // earlier triangles have no such attribute
                    corners_[kind].resize(corners_[Position].size() - 1, glm::uvec3(ARHOST_NONE));
                }
                corners_[kind].emplace_back(from[t.x], from[t.y], from[t.z]);
            }
        }
    }

    std::uint32_t index(const char *token, std::size_t count, const char *what) {
        std::int64_t value = 0;
        if (!read_integer(p_, end_, value))
            file_.fail_line(token, "'" + token_at(token, end_) + "' is not a corner of a face");
        const std::int64_t zero_based = value < 0 ? static_cast<std::int64_t>(count) + value : value - 1;
        if (value == 0 || zero_based < 0 || zero_based >= static_cast<std::int64_t>(count))
            file_.fail_line(token, "a face refers to " + std::string(what) + " " + std::to_string(value) +
                                       ", but only " + std::to_string(count) + " are defined above");
        return static_cast<std::uint32_t>(zero_based);
    }

    TriangleMesh mesh() {
        if (used_[Normal] && has_gap(corners_[Normal])) {
            reporter_.info(file_.name() + ": only some faces have normals; all normals are ignored");
            used_[Normal] = false;
        }
        if (!used_[Normal] && !used_[Texcoord])
            return {std::move(positions_), {}, {}, std::move(corners_[Position]), std::move(colours_)};
        return with_joined_vertices();
    }

    static bool has_gap(const std::vector<glm::uvec3> &corners) {
        for (const glm::uvec3 &c : corners)
            if (c.x == ARHOST_NONE || c.y == ARHOST_NONE || c.z == ARHOST_NONE)
                return true;
        return false;
    }

    // Returns a mesh with one vertex for each distinct combination of position, texcoord and normal. Finds them with
    // a hash table with open addressing.
    TriangleMesh with_joined_vertices() {
        TriangleMesh mesh;
        const std::size_t corner_count = corners_[Position].size() * 3;
        std::vector<std::uint32_t> table(std::bit_ceil(corner_count * 2), ARHOST_NONE);
        std::vector<glm::uvec3> triples;
        const auto vertex = [&](const glm::uvec3 &triple) {
            std::uint64_t hash =
                triple.x * 0x9e3779b97f4a7c15u ^ triple.y * 0xc2b2ae3d27d4eb4fu ^ triple.z * 0x165667b19e3779f9u;
            hash ^= hash >> 29;
            for (std::size_t slot = hash & (table.size() - 1);; slot = (slot + 1) & (table.size() - 1)) {
                if (table[slot] == ARHOST_NONE) {
                    table[slot] = static_cast<std::uint32_t>(triples.size());
                    triples.push_back(triple);
                    return table[slot];
                }
                if (triples[table[slot]] == triple)
                    return table[slot];
            }
        };
        mesh.triangles = std::move(corners_[Position]);
        for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
            for (int corner = 0; corner < 3; ++corner)
                mesh.triangles[i][corner] =
                    vertex({mesh.triangles[i][corner], used_[Texcoord] ? corners_[Texcoord][i][corner] : ARHOST_NONE,
                            used_[Normal] ? corners_[Normal][i][corner] : ARHOST_NONE});
        for (const glm::uvec3 &triple : triples) {
            mesh.positions.push_back(positions_[triple.x]);
            if (used_[Texcoord])
                mesh.texcoords.push_back(triple.y == ARHOST_NONE ? glm::vec2(0) : texcoords_[triple.y]);
            if (used_[Normal])
                mesh.normals.push_back(normals_[triple.z]);
            if (!colours_.empty())
                mesh.colours.push_back(colours_[triple.x]);
        }
        return mesh;
    }

    const MeshFile &file_;
    const Reporter &reporter_;
    const char *p_, *end_;
    std::vector<glm::vec3> positions_, normals_;
    std::vector<glm::vec2> texcoords_;
    std::vector<glm::u16vec4> colours_;  // of the first positions
    std::vector<glm::uvec3> corners_[3]; // per triangle, indexed by the enum above
    bool used_[3] = {true, false, false};
    std::vector<std::uint32_t> polygon_[3];
    std::vector<glm::uvec3> triangles_;
    MaterialUses uses_;
    std::map<std::string, std::size_t> names_; // indices in uses_.names
    const char *counted_ = p_;                 // start of the line `line_number_`
    std::size_t line_number_ = 1;
    bool other_shapes_ = false;
};

} // namespace

MeshWithMaterials parse_obj(MeshFile &file, const Reporter &reporter) {
    file.normalize_line_ends();
    return ObjParser(file, reporter).parse();
}

} // namespace arhost::scene
