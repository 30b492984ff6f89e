// SPDX-License-Identifier: Apache-2.0
//
// A USB camera in user space, until the standard input ends: bench-usb-camera WIDTH HEIGHT FPS
#include "../../tests/support/usb_camera.hpp"

#include <cstdio>
#include <cstdlib>
#include <exception>

int main(int count, char **arguments) {
    if (count != 4) {
        std::fprintf(stderr, "usage: bench-usb-camera WIDTH HEIGHT FPS\n");
        return 2;
    }
    try {
        arhost::test::UsbCamera::Setup setup;
        setup.frame_width = static_cast<std::uint16_t>(std::atoi(arguments[1]));
        setup.frame_height = static_cast<std::uint16_t>(std::atoi(arguments[2]));
        setup.interval_ns = static_cast<std::int64_t>(1e9 / std::atof(arguments[3]));
        const arhost::test::UsbCamera camera(setup);
        while (std::getchar() != EOF) {
        }
    } catch (const std::exception &error) {
        std::fprintf(stderr, "bench-usb-camera: %s\n", error.what());
        return 1;
    }
    return 0;
}
