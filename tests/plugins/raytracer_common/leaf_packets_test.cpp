// SPDX-License-Identifier: Apache-2.0
//
// Checks that the packet versions of the leaf functions give the same results as the scalar versions.
#include "leaf_packets.hpp"

#include <arhost/shading/scalar.hpp>
#include <directories.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::shading {
namespace {

#include "leaf_calls.inl"

using namespace arhost::raytracer_common;

struct InstructionSet {
    const char *name;
    bool is_supported;
    CallLeaf call;
};

void PrintTo(const InstructionSet &set, std::ostream *stream) {
    *stream << set.name;
}

// Returns the instruction sets for which the kernel is compiled.
std::vector<InstructionSet> instruction_sets() {
    std::vector<InstructionSet> sets{{"base", true, base::call_leaf}};
#ifdef ARHOST_LEAF_PACKETS_avx2
    sets.push_back({"avx2", __builtin_cpu_supports("avx2") != 0, avx2::call_leaf});
#endif
#ifdef ARHOST_LEAF_PACKETS_avx512
    const bool is_supported = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                              __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
    sets.push_back({"avx512", is_supported, avx512::call_leaf});
#endif
    return sets;
}

class LeafPackets : public testing::TestWithParam<InstructionSet> {};

// Fills the arguments with random values: unit vectors where `vectors` has a bit set, else numbers between 0 and 1.
void fill(Packet (&arguments)[max_arguments], unsigned vectors, std::mt19937 &random) {
    std::uniform_real_distribution<float> number(0.05f, 0.95f);
    for (int lane = 0; lane < packet_lanes; ++lane)
        for (int i = 0; i < max_arguments; ++i) {
            if (!(vectors >> i & 1)) {
                arguments[i].lane[lane] = number(random);
                continue;
            }
            const double z = 2 * number(random) - 1, r = std::sqrt(1 - z * z), turn = number(random);
            for (const double at : {r * cosine_of_turn(turn), r * sine_of_turn(turn), z})
                arguments[i++].lane[lane] = static_cast<float>(at);
            --i;
        }
}

} // namespace

TEST_P(LeafPackets, MatchTheScalarFunctions) {
    if (!GetParam().is_supported)
        GTEST_SKIP() << "this processor does not support " << GetParam().name;
    // Set by the fisheye lens, whose ninth power amplifies the error of turn_of (2e-6 turns). The other functions are
    // more accurate.
    constexpr double tolerance = 1e-4;
    std::mt19937 random(1);
    for (int number = 0; number < static_cast<int>(std::size(leaf_functions)); ++number)
        for (int round = 0; round < 100; ++round) {
            Packet arguments[max_arguments], results[max_results];
            fill(arguments, leaf_functions[number].vectors, random);
            GetParam().call(number, arguments, results);
            for (int lane = 0; lane < packet_lanes; ++lane) {
                double from[max_arguments], to[max_results]{};
                for (int i = 0; i < max_arguments; ++i)
                    from[i] = arguments[i].lane[lane];
                leaf_functions[number].call(from, to);
                const double size = std::hypot(to[0], to[1], to[2]);
                // The results of offset_from_surface are far below 1 and free of cancellation, so only their relative
                // error counts.
                const double absolute =
                    leaf_functions[number].name == std::string_view("offset_from_surface") ? 0 : 1;
                for (int i = 0; i < max_results; ++i)
                    ASSERT_NEAR(results[i].lane[lane], to[i], tolerance * (absolute + size))
                        << leaf_functions[number].name;
            }
        }
}

TEST(LeafCalls, ListEveryLeafFunction) {
    std::size_t declared = 0;
    for (const auto &entry : std::filesystem::directory_iterator(arhost::test::source_directory() +
                                                                 "/core/shading/include/arhost/shading/leaf")) {
        std::ifstream file(entry.path());
        for (std::string line; std::getline(file, line);)
            declared += line.starts_with("ARHOST_LEAF ");
    }
    EXPECT_EQ(std::size(leaf_functions), declared);
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, LeafPackets, testing::ValuesIn(instruction_sets()),
                         [](const auto &info) { return std::string(info.param.name); });

} // namespace arhost::shading
