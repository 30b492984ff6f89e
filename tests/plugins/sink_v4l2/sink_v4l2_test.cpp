// SPDX-License-Identifier: Apache-2.0
//
// Errors that need no device. vivid_loop_test.cpp tests the output itself.
#include "sink_under_test.hpp"

#include <gmock/gmock.h>

using arhost::test::SinkUnderTest;
using testing::HasSubstr;

TEST(SinkV4l2, RejectsAMissingDevice) {
    SinkUnderTest sink("sink_v4l2", {{"device", "/dev/video-missing"}});
    EXPECT_EQ(sink.start(64, 48), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(sink.log(), HasSubstr("device: '/dev/video-missing' does not exist; create a virtual camera"));
}

// The device may come back.
TEST(SinkV4l2, ReportsADeviceThatIsMissingAfterARestartAsLost) {
    SinkUnderTest sink("sink_v4l2", {{"device", "/dev/video-missing"}});
    EXPECT_EQ(sink.start(64, 48, 7), ARHOST_STATUS_ERROR_DEVICE_LOST);
}

TEST(SinkV4l2, RejectsAFileThatIsNotAVideoDevice) {
    SinkUnderTest sink("sink_v4l2", {{"device", "/dev/null"}});
    EXPECT_EQ(sink.start(64, 48), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(sink.log(), HasSubstr("'/dev/null' is not a video device"));
}
