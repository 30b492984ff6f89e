// SPDX-License-Identifier: Apache-2.0
//
// The tracker and the ray tracer of a pipeline. A swap creates a second stage of the same kind and then exchanges the
// two.
#pragma once

#include "camera/coordinates.hpp"
#include "host/contract_checks.hpp"
#include "host/quality.hpp"
#include "host/scene_loading.hpp"
#include "host/slots.hpp"
#include "model/control.hpp"
#include "run_config/configuration.hpp"

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

namespace arhost::host {

struct Stage {
    virtual ~Stage() = default;

    std::unique_ptr<supervise::Component> component;
    control::Done swapped;           // answers the command that started this stage as the successor of another one
    std::shared_ptr<SlotPool> slots; // of the current worker; null unless it is running

    bool running() const { return component->running(); }

    // In mode live: whether the stage usually takes less than three quarters of the time from frame to frame, so that
    // it catches up after a delay. True before the first result; false if the time from frame to frame is unknown.
    bool keeps_up(double frames_per_second) const {
        return frames_per_second > 0 && mean_s_.value_or(0) < 0.75 / frames_per_second;
    }
    void add_duration(std::chrono::nanoseconds duration) {
        const double seconds = std::chrono::duration<double>(duration).count();
        mean_s_ = mean_s_.value_or(seconds) + (seconds - mean_s_.value_or(seconds)) / 16;
    }

private:
    std::optional<double> mean_s_; // exponential moving average of the durations of its calls
};

struct TrackerStage : Stage {
    // Who can read a state: a restarted worker with the same plugin.
    struct StateOwner {
        std::size_t candidate = 0;
        std::string version;
        std::uint64_t size = 0;
        bool operator==(const StateOwner &) const = default;
    };
    StateOwner state_owner;               // the current worker
    Lease state;                          // what the last accepted call wrote; survives the worker
    bool state_is_of_solver_only = false; // another plugin wrote the rest (ipc::Command)
    std::shared_ptr<const run_config::TrackerConfiguration> configuration;
    // Continues with the poses of the stage that this one replaces.
    void inherit_state(TrackerStage &previous) {
        if (configuration->targets != previous.configuration->targets)
            return;
        state = std::move(previous.state);
        state_is_of_solver_only = true;
    }
    std::vector<std::string> families; // of the targets' markers
    std::map<std::pair<std::string, std::int32_t>, std::string>
        listed;                               // names of the targets' markers, by family and id
    std::optional<ipc::SharedMemory> targets; // those of the configuration, for its workers
};

struct LoadedScene {
    run_config::Scene source;
    std::set<std::filesystem::path> files; // as in SceneLoading::Callbacks
    ipc::SharedMemory arena;
    std::vector<Anchor> anchors;
    camera::Coordinates coordinates;             // from the configuration or from the scene's axes
    std::optional<OverlayChecks> overlay_checks; // only for `conform: true`
};

struct RaytracerStage : Stage {
    std::shared_ptr<const run_config::RaytracerConfiguration> configuration;
    std::shared_ptr<LoadedScene> scene;
    std::shared_ptr<SlotPool> anchor_slots;   // of AnchorPose; null if the scene has no anchors
    std::optional<QualityController> quality; // only with `live.target_fps`
    std::uint32_t samples_in_use = 0;         // the option of the current worker
};

} // namespace arhost::host
