// SPDX-License-Identifier: Apache-2.0
//
// Measures the time from a mesh file to a validated arena. Two baselines:
// - the lower bound for a .gz file: reading it and decompressing it with zlib into a buffer of the right size;
// - a minimal parser, which also converts the numbers, but checks nothing.
// Exits with 1 if loading the mesh, writing the arena and validating it take more than 1.5 times as long as the
// minimal parser.
//
//   scene-loading-bench dragon_vrip.ply.gz [runs]
#include "scene/arena_builder.hpp"
#include "scene/mesh_loader.hpp"

#include <sys/resource.h>
#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace {

using namespace arhost::scene;

// The name of a step and its times in ms. operator() runs and times the step once; print() prints the best and the
// median time.
struct Times {
    const char *what;
    std::vector<double> ms;
    template <class Work> auto operator()(Work &&work) {
        const auto start = std::chrono::steady_clock::now();
        auto result = work();
        ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
        return result;
    }
    void print() {
        std::sort(ms.begin(), ms.end());
        std::printf("%-34s %8.1f %8.1f\n", what, ms.front(), ms[ms.size() / 2]);
    }
};

// Decompresses the file into `out` and returns the decompressed size. If the file is not compressed, returns its size
// and leaves `out` unchanged. From the second run on, `out` needs no reallocation.
std::size_t read_and_unzip(const char *path, std::vector<char> &out) {
    std::ifstream stream(path, std::ios::binary | std::ios::ate);
    std::vector<char> packed(static_cast<std::size_t>(stream.tellg()));
    stream.seekg(0).read(packed.data(), static_cast<std::streamsize>(packed.size()));
    if (!stream || packed.size() < 18 || packed[0] != '\x1f' || packed[1] != '\x8b')
        return packed.size();
    unsigned char size[4];
    std::memcpy(size, packed.data() + packed.size() - 4, 4);
    out.resize(size[0] | size[1] << 8 | size[2] << 16 | std::size_t(size[3]) << 24);
    z_stream unzip{};
    unzip.next_in = reinterpret_cast<Bytef *>(packed.data());
    unzip.avail_in = static_cast<uInt>(packed.size());
    unzip.next_out = reinterpret_cast<Bytef *>(out.data());
    unzip.avail_out = static_cast<uInt>(out.size());
    inflateInit2(&unzip, 16 + MAX_WBITS);
    inflate(&unzip, Z_FINISH);
    inflateEnd(&unzip);
    return unzip.total_out;
}

// Reads, without any checks, the numbers of an ASCII PLY file that contains vertices (x, y, z and optionally more
// properties) and triangles.
std::size_t parse_blindly(const char *path, std::vector<char> &text, std::vector<float> &floats,
                          std::vector<std::uint32_t> &indices) {
    const std::size_t size = read_and_unzip(path, text);
    if (text.size() < size) { // the file is not compressed
        text.resize(size);
        std::ifstream(path, std::ios::binary).read(text.data(), static_cast<std::streamsize>(size));
    }
    const std::string_view header(text.data(), std::min<std::size_t>(size, 4096));
    const auto count_of = [&](std::string_view element) {
        const std::size_t at = header.find(element);
        return at == header.npos ? 0 : std::strtoul(header.data() + at + element.size(), nullptr, 10);
    };
    const std::size_t vertices = count_of("element vertex "), faces = count_of("element face ");
    const std::size_t begin = header.find("end_header");
    if (header.find("format ascii") == header.npos || begin == header.npos)
        return 0;
    std::size_t columns = 0;
    for (std::size_t at = header.find("element vertex "), end = header.find("element face ");
         (at = header.find("property float", at)) < end; ++at)
        ++columns;
    floats.resize(columns * vertices);
    indices.resize(3 * faces);
    const char *next = text.data() + begin + 11, *const end = text.data() + size;
    const auto number = [&](auto &value) {
        while (next < end && static_cast<unsigned char>(*next) <= ' ')
            ++next;
        next = std::from_chars(next, end, value).ptr;
    };
    for (float &value : floats)
        number(value);
    for (std::size_t i = 0; i < indices.size(); ++i) {
        std::uint32_t corners;
        if (i % 3 == 0)
            number(corners);
        number(indices[i]);
    }
    return size;
}

ArenaBuilder scene_of(TriangleMesh mesh) {
    ArenaBuilder builder;
    builder.add_object("mesh", builder.add_triangles(std::move(mesh)),
                       builder.add_material(make_material(ARHOST_MATERIAL_DIFFUSE)));
    return builder;
}

bool run(const char *path, int runs) {
    Times unzip{"read and unzip only (lower bound)", {}}, bare{"minimal parser", {}},
        load{"load: read, unzip, parse", {}}, normals{"smooth normals", {}}, write{"write the arena (flat)", {}},
        check{"validate it", {}}, write_smooth{"write the arena (with normals)", {}}, check_smooth{"validate it", {}};
    std::vector<char> text;
    std::size_t bytes = 0, triangles = 0;
    for (int i = 0; i < runs; ++i) {
        bytes = unzip([&] { return read_and_unzip(path, text); });
        std::vector<float> floats;
        std::vector<std::uint32_t> indices;
        if (bare([&] { return parse_blindly(path, text, floats, indices); }) == 0)
            throw std::runtime_error("the minimal parser supports only ASCII PLY");
        if (indices.back() == 0 || indices.back() >= floats.size() / 3)
            throw std::runtime_error("the minimal parser returned invalid indices");
        TriangleMesh mesh = load([&] { return load_mesh(path); });
        triangles = mesh.triangles.size();
        TriangleMesh smooth = mesh;
        smooth.normals = normals([&] { return smooth_normals(mesh); });
        const auto fill = [](Times &write_times, Times &check_times, TriangleMesh &&content) {
            ArenaBuilder builder = scene_of(std::move(content));
            const Arena arena = write_times([&] { return std::move(builder).build(); });
            if (const std::string fault = check_times([&] { return validate(arena.bytes()); }); !fault.empty())
                throw std::runtime_error(fault);
        };
        fill(write, check, std::move(mesh));
        fill(write_smooth, check_smooth, std::move(smooth));
    }
    std::printf("%s: %zu triangles, %.1f MB of text, %d runs\n%-34s %8s %8s\n", path, triangles,
                static_cast<double>(bytes) / 1e6, runs, "ms", "best", "median");
    for (Times *times : {&unzip, &bare, &load, &write, &check, &normals, &write_smooth, &check_smooth})
        times->print();
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    std::printf("peak memory %ld MB\n", usage.ru_maxrss / 1000);
    const double ratio = (load.ms.front() + write.ms.front() + check.ms.front()) / bare.ms.front();
    std::printf("load, write and validate relative to the minimal parser: %.2f (target 1.5)\n", ratio);
    return ratio <= 1.5;
}

} // namespace

int main(int count, char **arguments) {
    if (count < 2) {
        std::fprintf(stderr, "usage: scene-loading-bench MESH [RUNS]\n");
        return 2;
    }
    try {
        return run(arguments[1], count > 2 ? std::max(1, std::atoi(arguments[2])) : 10) ? 0 : 1;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}
