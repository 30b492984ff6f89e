// SPDX-License-Identifier: Apache-2.0
//
// Starts a camera, also one that is not connected again after it was lost.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <utility>

namespace arhost {

// Calls `start`. After a restart, the options have worked before, so whatever fails is temporary: the camera is not
// connected, not ready, or not accessible until udev has set its permissions. The host then waits for the camera.
template <class Start> void start_camera(const arhost_source_setup &setup, Start &&start) {
    try {
        std::forward<Start>(start)();
    } catch (const Failure &failure) {
        if (setup.first_sequence == 0 || failure.status() == ARHOST_STATUS_ERROR_CANCELLED)
            throw;
        throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST, failure.what());
    }
}

} // namespace arhost
