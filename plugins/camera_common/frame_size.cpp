// SPDX-License-Identifier: Apache-2.0
#include "frame_size.hpp"

#include <arhost-cpp/plugin.hpp>

namespace arhost {

DemandedSize demanded_size(const FrameSize &configured, const arhost_intrinsics *calibration) {
    if (!calibration)
        return {configured, "set 'width' and 'height'"};
    const FrameSize calibrated{calibration->width, calibration->height};
    if (configured == calibrated)
        return {calibrated, "set 'width' and 'height'"};
    if (configured != FrameSize{})
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "width, height: " + configured.text() +
                                                             " is configured, but the camera calibration is for " +
                                                             calibrated.text());
    return {calibrated,
            "the camera calibration is for " + calibrated.text() + "; calibrate at the size that you use"};
}

} // namespace arhost
