// SPDX-License-Identifier: Apache-2.0
#include "camera_common/frame_size.hpp"

#include <arhost-cpp/plugin.hpp>

#include <gmock/gmock.h>

using namespace arhost;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(FrameSize, TheCalibrationDemandsItsSize) {
    arhost_intrinsics calibration{};
    calibration.width = 640;
    calibration.height = 480;
    EXPECT_EQ(demanded_size({}, nullptr).size, FrameSize());
    EXPECT_EQ(demanded_size({320, 240}, nullptr).size, (FrameSize{320, 240}));
    EXPECT_EQ(demanded_size({}, &calibration).size, (FrameSize{640, 480}));
    EXPECT_THAT(demanded_size({}, &calibration).advice, HasSubstr("calibrate at the size that you use"));
    EXPECT_EQ(demanded_size({640, 480}, &calibration).advice, "set 'width' and 'height'");
    EXPECT_THAT(
        [&] {
            (void)demanded_size({320, 240}, &calibration);
        },
        ThrowsMessage<Failure>("width, height: 320×240 is configured, but the camera calibration is for 640×480"));
}
