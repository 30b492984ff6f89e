// SPDX-License-Identifier: Apache-2.0
//
// Every input that is kept, once: what the fuzzers start from, and each that has shown a defect.
#include "targets.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <vector>

using namespace arhost::fuzz;

class Corpus : public testing::TestWithParam<Target> {};

TEST_P(Corpus, PassesWithoutADefect) {
    const std::filesystem::path folder = std::filesystem::path(ARHOST_FUZZ_CORPUS) / GetParam().name;
    std::vector<std::filesystem::path> files;
    for (const auto &entry : std::filesystem::directory_iterator(folder))
        files.push_back(entry.path());
    ASSERT_GT(files.size(), 0u) << folder;
    std::ranges::sort(files);
    for (const auto &file : files) {
        SCOPED_TRACE(file);
        std::ifstream stream(file, std::ios::binary);
        const std::vector<char> content{std::istreambuf_iterator<char>(stream), {}};
        EXPECT_NO_THROW(GetParam().run({reinterpret_cast<const std::uint8_t *>(content.data()), content.size()}));
    }
}

INSTANTIATE_TEST_SUITE_P(Fuzz, Corpus, testing::ValuesIn(targets),
                         [](const auto &info) { return std::string(info.param.name); });
