// SPDX-License-Identifier: Apache-2.0
//
// The record of a frame for tests of sinks, with its targets and observations.
#pragma once

#include <arhost/sink.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <vector>

namespace arhost::test {

struct TrackedRecord {
    arhost_record fields{}; // without the arrays and their lengths
    std::vector<arhost_target> targets;
    std::vector<arhost_observation> observations;
    std::vector<arhost_expected_marker> expected{};

    // Adds a target with this position (mm, eye space), which faces the camera.
    arhost_target &add_target(std::string_view name, arhost_target_state state, std::array<double, 3> position_mm) {
        arhost_target target{};
        target.struct_size = sizeof target;
        target.state = state;
        name.copy(target.name, ARHOST_MAX_NAME - 1);
        target.first_observation = static_cast<std::uint32_t>(observations.size());
        target.mt[0] = target.mt[5] = target.mt[10] = target.mt[15] = 1;
        std::memcpy(target.mt + 12, position_mm.data(), sizeof position_mm);
        return targets.emplace_back(target);
    }
    // Adds an observation of the first family. It belongs to the last target if `is_listed`; then the observations
    // that no target lists must not have been added yet.
    arhost_observation &add_observation(std::int32_t id, const double (&corners_px)[4][2], bool is_listed = true) {
        arhost_observation observation{};
        observation.struct_size = sizeof observation;
        observation.id = id;
        std::memcpy(observation.corners_px, corners_px, sizeof corners_px);
        targets.back().observation_count += is_listed;
        return observations.emplace_back(observation);
    }
    // The result points into this object.
    operator arhost_record() const {
        arhost_record record = fields;
        record.struct_size = sizeof record;
        record.target_count = static_cast<std::uint32_t>(targets.size());
        record.targets = targets.data();
        record.observation_count = static_cast<std::uint32_t>(observations.size());
        record.observations = observations.data();
        record.expected_count = static_cast<std::uint32_t>(expected.size());
        record.expected = expected.data();
        return record;
    }
};

} // namespace arhost::test
