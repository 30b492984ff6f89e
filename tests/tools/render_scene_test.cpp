// SPDX-License-Identifier: Apache-2.0
#include "plugin_under_test.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>

namespace {

namespace fs = std::filesystem;

class RenderScene : public testing::Test {
protected:
    // The picture file's bytes; none where the program fails.
    std::string picture(const std::string &scene, const std::string &options) const {
        const fs::path file = scratch_.path() / "picture.ppm";
        fs::remove(file);
        const std::string command = ARHOST_BINARY_DIRECTORY "/bin/render-scene " ARHOST_SOURCE_DIRECTORY
                                                            "/config/scenes/" +
                                    scene + ".yaml --size 80x60 --samples 1 --output " + file.string() + " " +
                                    options + " > " + (scratch_.path() / "said.txt").string() + " 2>&1";
        status_ = std::system(command.c_str());
        return read(file);
    }
    std::string said() const { return read(scratch_.path() / "said.txt"); }
    bool failed() const { return status_ != 0; }

private:
    static std::string read(const fs::path &file) {
        std::ifstream stream(file, std::ios::binary);
        return {std::istreambuf_iterator<char>(stream), {}};
    }

    arhost::test::ScratchFolder scratch_;
    mutable int status_ = 0;
};

} // namespace

TEST_F(RenderScene, ShowsWhatMovesWhereItIsAtThatTime) {
    const std::string early = picture("moving", "--time 1"), late = picture("moving", "--time 2.5");
    ASSERT_FALSE(early.empty()) << said();
    EXPECT_NE(early, late);
    EXPECT_EQ(picture("moving", "--time 8.5"), late) << "a loop takes 6 s";
    EXPECT_EQ(picture("moving", ""), picture("moving", "--time 0"));
}

TEST_F(RenderScene, PassesOverTheTimeWhereNothingMoves) {
    const std::string still = picture("demo", "");
    ASSERT_FALSE(still.empty()) << said();
    EXPECT_EQ(picture("demo", "--time 2.5"), still);
}

TEST_F(RenderScene, SoftensShadowsWithTheirSamples) {
    const std::string few = picture("moving", "--light-samples 1");
    ASSERT_FALSE(few.empty()) << said();
    EXPECT_NE(picture("moving", "--light-samples 4"), few);
    EXPECT_EQ(picture("moving", "--light-samples 4"), picture("moving", "")) << "as the plugin's default";
}

TEST_F(RenderScene, RefusesWhatIsNoTimeAndNoNumberOfSamples) {
    for (const char *option : {"--time -1", "--time soon", "--light-samples 0", "--samples 257"}) {
        EXPECT_EQ(picture("moving", option), "") << option;
        EXPECT_TRUE(failed()) << option;
        EXPECT_NE(said().find(std::string(option).substr(0, std::string(option).find(' '))), std::string::npos)
            << said();
    }
}
