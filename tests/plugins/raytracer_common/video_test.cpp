// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/video.hpp"

#include <arhost/shading/scalar.hpp>
#include <gmock/gmock.h>

namespace arhost::raytracer_common {
namespace {

using testing::ElementsAre;
using testing::FloatNear;

// A video whose left half is white and whose right half is red.
VideoImage white_and_red() {
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = ARHOST_PIXEL_FORMAT_RGB8;
    format.width = 32;
    format.height = 16;
    arhost_frame_layout(&format);
    std::vector<std::uint8_t> bytes(format.byte_size);
    for (std::uint32_t y = 0; y < format.height; ++y)
        for (std::uint32_t x = 0; x < format.width; ++x) {
            std::uint8_t *to = bytes.data() + std::size_t{format.stride[0]} * y + 3 * x;
            to[0] = 255;
            to[1] = to[2] = x < format.width / 2 ? 255 : 0;
        }
    arhost_frame frame{};
    frame.struct_size = sizeof frame;
    frame.format = &format;
    frame.plane[0] = bytes.data();
    VideoImage video;
    video.set(frame);
    return video;
}

TEST(VideoImage, HasItsMeanInLinearLight) {
    EXPECT_THAT(white_and_red().mean(), ElementsAre(1, 0.5f, 0.5f));
}

TEST(EnvironmentScale, IsTheIntensityOfAnEnvironmentOfItsOwn) {
    const VideoImage video = white_and_red();
    arhost_environment environment{};
    environment.intensity = 3;
    EXPECT_THAT(environment_scale(environment, &video), ElementsAre(3, 3, 3));
    EXPECT_THAT(environment_scale(environment, nullptr), ElementsAre(3, 3, 3));
}

TEST(EnvironmentScale, FollowsTheVideoOrIsMidGrey) {
    const VideoImage video = white_and_red();
    arhost_environment environment{};
    environment.intensity = 2;
    environment.follows_video = 1;
    // The mean is (1, 0.5, 0.5), its luminance 0.6063.
    EXPECT_THAT(environment_scale(environment, &video),
                ElementsAre(FloatNear(1.6063f, 1e-4f), FloatNear(1.1063f, 1e-4f), FloatNear(1.1063f, 1e-4f)));
    EXPECT_THAT(environment_scale(environment, nullptr), ElementsAre(0.36f, 0.36f, 0.36f));
}

} // namespace
} // namespace arhost::raytracer_common
