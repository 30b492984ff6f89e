// SPDX-License-Identifier: Apache-2.0
#include "scene/stl.hpp"

#include <arhost/scene.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <cstring>

namespace arhost::scene {
namespace {

static_assert(std::endian::native == std::endian::little); // as the numbers of binary files

constexpr std::size_t header_size = 84, count_at = 80, facet_size = 50;

bool same_word(std::string_view word, std::string_view lower_case) {
    return std::ranges::equal(word, lower_case, {}, [](unsigned char c) { return std::tolower(c); });
}

std::uint64_t declared_size(const MeshFile &file) {
    std::uint32_t count = 0;
    std::memcpy(&count, file.begin() + count_at, sizeof count);
    return header_size + facet_size * std::uint64_t(count);
}

// The header of a binary file may begin with "solid", too. Only ascii files have no zero bytes.
bool is_binary(const MeshFile &file) {
    const std::string_view all = file.view();
    if (all.size() < header_size)
        return false;
    const std::size_t begin = std::min(all.find_first_not_of(" \t\r\n"), all.size());
    return declared_size(file) == all.size() || !same_word(all.substr(begin, 5), "solid") ||
           all.substr(0, header_size).find('\0') != std::string_view::npos;
}

TriangleMesh binary_mesh(const MeshFile &file, const Reporter &reporter) {
    const std::uint64_t size = declared_size(file), count = (size - header_size) / facet_size;
    if (size > file.view().size())
        file.fail_byte(file.begin() + count_at, "the header declares " + std::to_string(count) +
                                                    " triangles, which need " + std::to_string(size) +
                                                    " bytes, but the file has " + std::to_string(file.view().size()));
    TriangleMesh mesh;
    mesh.positions.reserve(3 * count);
    for (std::uint64_t i = 0; i < count; ++i) {
        const char *corners = file.begin() + header_size + facet_size * i + sizeof(glm::vec3); // after the normal
        for (int corner = 0; corner < 3; ++corner, corners += sizeof(glm::vec3)) {
            glm::vec3 position;
            std::memcpy(&position, corners, sizeof position);
            if (!std::isfinite(position.x) || !std::isfinite(position.y) || !std::isfinite(position.z))
                file.fail_byte(corners, "triangle " + std::to_string(i) + " has a coordinate that is not finite");
            mesh.positions.push_back(position);
        }
        if (i % 65536 == 0)
            reporter.report(static_cast<double>(i) / static_cast<double>(count));
    }
    return mesh;
}

class StlParser {
public:
    StlParser(const MeshFile &file, const Reporter &reporter)
        : file_(file), reporter_(reporter), p_(file.begin()), end_(file.end()) {}

    TriangleMesh parse() {
        expect("solid");
        skip_line(p_, end_); // the name
        const char *next_report = p_;
        for (std::string_view word = next(); !word.empty(); word = next()) {
            if (same_word(word, "facet"))
                facet();
            else if (same_word(word, "solid") || same_word(word, "endsolid"))
                skip_line(p_, end_);
            else
                fail("'facet' or 'endsolid' is expected here");
            if (p_ >= next_report) {
                reporter_.report(static_cast<double>(p_ - file_.begin()) / static_cast<double>(file_.view().size()));
                next_report = p_ + (1 << 20);
            }
        }
        return std::move(mesh_);
    }

private:
    // Returns "" at the end of the file.
    std::string_view next() {
        const auto is_space = [](char c) { return is_blank(c) || c == '\n'; };
        word_ = std::find_if_not(p_, end_, is_space);
        p_ = std::find_if(word_, end_, is_space);
        return {word_, static_cast<std::size_t>(p_ - word_)};
    }
    void expect(const char *word) {
        if (!same_word(next(), word))
            fail("'" + std::string(word) + "' is expected here");
    }
    [[noreturn]] void fail(const std::string &expectation) const {
        file_.fail_line(word_, word_ == end_ ? "the file is truncated: " + expectation
                                             : expectation + ", not '" + token_at(word_, end_) + "'");
    }

    void facet() {
        expect("normal");
        for (int i = 0; i < 3; ++i)
            next();
        expect("outer");
        expect("loop");
        for (int corner = 0; corner < 3; ++corner) {
            expect("vertex");
            glm::vec3 position;
            for (int i = 0; i < 3; ++i) {
                next();
                const char *stop = word_;
                if (!read_number(stop, p_, position[i]) || stop != p_ || !std::isfinite(position[i]))
                    fail("a finite number is expected here");
            }
            mesh_.positions.push_back(position);
        }
        expect("endloop");
        expect("endfacet");
    }

    const MeshFile &file_;
    const Reporter &reporter_;
    const char *p_, *end_, *word_ = nullptr;
    TriangleMesh mesh_;
};

} // namespace

TriangleMesh parse_stl(MeshFile &file, const Reporter &reporter) {
    TriangleMesh mesh;
    if (is_binary(file)) {
        mesh = binary_mesh(file, reporter);
    } else {
        file.normalize_line_ends();
        mesh = StlParser(file, reporter).parse();
    }
    if (mesh.positions.empty())
        file.fail("contains no triangles");
    if (mesh.positions.size() >= ARHOST_NONE)
        file.fail("has too many triangles");
    mesh.triangles.resize(mesh.positions.size() / 3);
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i)
        mesh.triangles[i] = glm::uvec3(3 * i) + glm::uvec3(0, 1, 2);
    weld(mesh);
    return mesh;
}

} // namespace arhost::scene
