// SPDX-License-Identifier: Apache-2.0
#include "host/stage.hpp"

#include <gtest/gtest.h>

using arhost::host::Stage;
using namespace std::chrono_literals;

TEST(Stage, CatchesUpAfterASingleDelay) {
    Stage stage;
    EXPECT_TRUE(stage.keeps_up(30)) << "before the first result";
    for (int i = 0; i < 30; ++i)
        stage.add_duration(5ms);
    stage.add_duration(200ms);
    EXPECT_TRUE(stage.keeps_up(30));
}

TEST(Stage, DoesNotCatchUpIfItIsAlwaysSlow) {
    Stage stage;
    stage.add_duration(40ms);
    EXPECT_FALSE(stage.keeps_up(30));
    EXPECT_TRUE(stage.keeps_up(10));
    for (int i = 0; i < 100; ++i)
        stage.add_duration(10ms);
    EXPECT_TRUE(stage.keeps_up(30)) << "it has become faster";
}

TEST(Stage, DoesNotCatchUpAtAnUnknownRate) {
    Stage stage;
    EXPECT_FALSE(stage.keeps_up(0));
}
