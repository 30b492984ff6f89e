// SPDX-License-Identifier: Apache-2.0
//
// Every input that is kept, once: what the fuzzers start from, and each that has shown a defect. And a number of
// inputs like them, always the same ones: a defect that any change brings is often found without libFuzzer.
#include "mutator.hpp"
#include "targets.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <unistd.h>
#include <vector>

using namespace arhost::fuzz;

namespace {

std::vector<std::filesystem::path> kept_for(const Target &target) {
    std::vector<std::filesystem::path> files;
    for (const auto &entry :
         std::filesystem::directory_iterator(std::filesystem::path(ARHOST_FUZZ_CORPUS) / target.name))
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

TEST_P(Corpus, PassesWithoutADefect) {
    const auto files = kept_for(GetParam());
    ASSERT_GT(files.size(), 0u);
    for (const auto &file : files) {
        SCOPED_TRACE(file);
        EXPECT_NO_THROW(GetParam().run(content_of(file)));
    }
}

TEST_P(Corpus, AndWhatIsLikeItPasses) {
    std::vector<Mutator::Content> kept;
    for (const auto &file : kept_for(GetParam()))
        kept.push_back(content_of(file));
    constexpr std::uint32_t seed = 1;
    Mutator mutator(std::move(kept), seed);
    // What was tried last is left behind where it ends the process.
    const std::filesystem::path last = testing::TempDir() + "arhost-fuzz-" + std::string(GetParam().name) + "-" +
                                       std::to_string(::getpid()) + ".input";
    for (unsigned i = 0; i < GetParam().tries; ++i) {
        const Mutator::Content content = mutator.next();
        std::ofstream(last, std::ios::binary)
            .write(reinterpret_cast<const char *>(content.data()), static_cast<std::streamsize>(content.size()));
        ASSERT_NO_THROW(GetParam().run(content)) << "try " << i << ", the input is " << last;
    }
    std::filesystem::remove(last);
}

INSTANTIATE_TEST_SUITE_P(Fuzz, Corpus, testing::ValuesIn(targets),
                         [](const auto &info) { return std::string(info.param.name); });
