// SPDX-License-Identifier: Apache-2.0
//
// Runs every input of the corpus once. The corpus has the seeds of the fuzzers and all inputs that have revealed a
// bug. Then runs a fixed number of deterministic mutations, which often find regressions without libFuzzer.
#include "mutator.hpp"
#include "targets.hpp"

#include <directories.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <tuple>
#include <unistd.h>
#include <vector>

using namespace arhost::fuzz;

namespace {

std::vector<std::filesystem::path> corpus_of(const Target &target) {
    std::vector<std::filesystem::path> files;
    for (const auto &entry : std::filesystem::directory_iterator(
             std::filesystem::path(arhost::test::source_directory() + "/tests/fuzz/corpus") / target.name))
        files.push_back(entry.path());
    std::ranges::sort(files);
    return files;
}

Mutator::Content content_of(const std::filesystem::path &file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

} // namespace

class Corpus : public testing::TestWithParam<Target> {};
class CorpusMutations : public testing::TestWithParam<std::tuple<Target, unsigned>> {}; // the part of its tries: 1/n

TEST_P(Corpus, InputsPass) {
    const auto files = corpus_of(GetParam());
    ASSERT_GT(files.size(), 0u);
    for (const auto &file : files) {
        SCOPED_TRACE(file);
        EXPECT_NO_THROW(GetParam().run(content_of(file)));
    }
}

TEST_P(CorpusMutations, Pass) {
    const auto &[target, divisor] = GetParam();
    std::vector<Mutator::Content> corpus;
    for (const auto &file : corpus_of(target))
        corpus.push_back(content_of(file));
    constexpr std::uint32_t seed = 1;
    Mutator mutator(std::move(corpus), seed);
    // This file remains if the input crashes the process.
    const std::filesystem::path last =
        testing::TempDir() + "arhost-fuzz-" + std::string(target.name) + "-" + std::to_string(::getpid()) + ".input";
    for (unsigned i = 0; i < target.tries / divisor; ++i) {
        const Mutator::Content content = mutator.next();
        std::ofstream(last, std::ios::binary)
            .write(reinterpret_cast<const char *>(content.data()), static_cast<std::streamsize>(content.size()));
        ASSERT_NO_THROW(target.run(content)) << "try " << i << ", the input is " << last;
    }
    std::filesystem::remove(last);
}

INSTANTIATE_TEST_SUITE_P(Fuzz, Corpus, testing::ValuesIn(targets),
                         [](const auto &info) { return std::string(info.param.name); });

namespace {

std::string name_of(const testing::TestParamInfo<std::tuple<Target, unsigned>> &info) {
    return std::string(std::get<0>(info.param).name);
}

} // namespace

INSTANTIATE_TEST_SUITE_P(Fuzz, CorpusMutations, testing::Combine(testing::ValuesIn(targets), testing::Values(20u)),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Exhaustive, CorpusMutations,
                         testing::Combine(testing::ValuesIn(targets), testing::Values(1u)), name_of);
