// SPDX-License-Identifier: Apache-2.0
//
// Checks that a ray tracer rejects invalid input.
#pragma once

#include "rich_scene.hpp"

#include <gmock/gmock.h>

#include <limits>

namespace arhost::test {

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();

// `too_far_mm`: a coordinate that the ray tracer does not support.
inline void expect_invalid_cameras_are_rejected(const std::string &plugin, double too_far_mm) {
    Tracer tracer(rich_scene(), {}, plugin);
    ASSERT_EQ(tracer.start(pinhole()), ARHOST_STATUS_OK) << tracer.log();
    const struct {
        const char *name;
        arhost_camera camera;
        const char *message = "";
        arhost_intrinsics image = pinhole();
    } cases[] = {
        {"up is parallel to the view", camera({0, 0, 0}, {0, 0, 1}, {0, 0, 2}), "up is parallel"},
        {"no up", camera({0, 0, 0}, {0, 0, 1}, {0, 0, 0})},
        {"look_at equals the eye", camera({1, 2, 3}, {1, 2, 3}, {0, 0, 1})},
        {"eye is NaN", camera({nan_value, 0, 0}, {0, 0, 1}, {0, 1, 0}), "must be finite"},
        {"look_at is infinite", camera({0, 0, 0}, {0, HUGE_VAL, 1}, {0, 1, 0})},
        {"up is NaN", camera({0, 0, 0}, {0, 0, 1}, {0, nan_value, 0})},
        {"too far away", camera({0, -too_far_mm, 0}, {0, 0, 0}, {0, 0, 1})},
        {"other intrinsics than at start", from_the_side(pinhole(200, 150, 201))},
        {"an image of another size", from_the_side(), "", pinhole(150, 200)},
    };
    for (const auto &[name, camera, message, image] : cases) {
        Picture picture(image);
        EXPECT_EQ(tracer.try_render(camera, picture), ARHOST_STATUS_ERROR_INVALID_ARGUMENT) << name;
        EXPECT_THAT(tracer.log(), testing::HasSubstr(message)) << name;
    }
}

inline void expect_invalid_intrinsics_are_rejected(const std::string &plugin) {
    Tracer tracer(rich_scene(), {}, plugin);
    arhost_intrinsics no_focal_length = pinhole(), no_principal_point = pinhole();
    no_focal_length.fx = 0;
    no_principal_point.cy = nan_value;
    for (const arhost_intrinsics &in : {no_focal_length, no_principal_point, pinhole(0, 10),
                                        with_lens(pinhole(), ARHOST_DISTORTION_BROWN, {1, 2, 3})})
        EXPECT_EQ(tracer.start(in), ARHOST_STATUS_ERROR_INVALID_ARGUMENT)
            << in.width << " px, fx " << in.fx << ", cy " << in.cy << ", " << in.coefficient_count << " coefficients";
}

inline void expect_cancelled_calls_fail(const std::string &plugin) {
    Tracer tracer(rich_scene(), {}, plugin);
    ASSERT_EQ(tracer.start(pinhole()), ARHOST_STATUS_OK) << tracer.log();
    tracer.plugin().cancel();
    Picture picture(pinhole());
    EXPECT_EQ(tracer.try_render(from_the_side(), picture), ARHOST_STATUS_ERROR_CANCELLED);
    EXPECT_EQ(tracer.start(pinhole()), ARHOST_STATUS_ERROR_CANCELLED);
}

} // namespace arhost::test
