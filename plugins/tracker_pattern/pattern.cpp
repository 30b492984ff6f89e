// SPDX-License-Identifier: Apache-2.0
#include "pattern.hpp"

#include <fiducial/artoolkit.hpp>

#include <arhost-cpp/plugin.hpp>

#include <cmath>

namespace tracker_pattern {

Samples normalized(const Samples &samples) {
    constexpr double min_contrast = 3; // standard deviation, grey levels
    cv::Scalar mean, deviation;
    cv::meanStdDev(samples, mean, deviation);
    if (!(deviation[0] >= min_contrast))
        return {};
    return (samples - mean[0]) / (deviation[0] * std::sqrt(static_cast<double>(samples.total())));
}

Pattern::Pattern(const std::string &file) {
    rotated_[0] = normalized(arhost::fiducial::read_pattern(file));
    if (rotated_[0].empty())
        throw arhost::Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                              "'" + file + "' has an almost uniform picture, which cannot be recognised");
    for (std::size_t i = 1; i < rotated_.size(); ++i)
        cv::rotate(rotated_[i - 1], rotated_[i], cv::ROTATE_90_CLOCKWISE);
}

Pattern::Match Pattern::match(const Samples &normalized) const {
    Match best{-1, 0};
    for (int turns = 0; turns < 4; ++turns)
        if (const double correlation = normalized.dot(rotated_[turns]); correlation > best.correlation)
            best = {correlation, turns};
    return best;
}

} // namespace tracker_pattern
