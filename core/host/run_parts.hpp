// SPDX-License-Identifier: Apache-2.0
//
// The parts of a run that its components share.
#pragma once

#include "host/cameras.hpp"
#include "host/component_options.hpp"
#include "host/failures.hpp"
#include "host/frame_flow.hpp"
#include "host/message_log.hpp"

namespace arhost::host {

// The frames of the source. Known once it has started.
struct Video {
    arhost_frame_format format{};
    arhost_intrinsics intrinsics{}; // width 0: unknown
    std::uint64_t frame_count = 0;  // 0: unknown
    bool is_known() const { return format.width > 0; }
};

struct RunParts {
    RunParts(const run_config::Configuration &configuration, supervise::Context context);
    RunParts(const RunParts &) = delete;
    RunParts &operator=(const RunParts &) = delete;

    const run_config::Configuration &configuration; // the configuration with which the run began
    supervise::Context context;
    MessageLog messages;
    Statistics statistics;
    Failures failures;
    ComponentOptions options;
    ComponentTotals totals; // totals of the components that ended before the end of the run
    Cameras cameras;
    FrameFlow flow;
    Video video;

    bool live() const { return configuration.mode == run_config::Mode::live; }
    std::int64_t now_ns() const { return base::to_ns(context.reactor.now()); }
    // Returns whether the component has stopped or will not be restarted. If so, keeps its totals.
    bool take_if_ended(const supervise::Component &component);
    void log(arhost_severity severity, const std::string &text) const { context.log(severity, "arhost", text); }

    // Returns callbacks that report failures of the component `name`. The other callbacks do nothing.
    supervise::Component::Callbacks callbacks(const std::string &name, const yaml::Node &node);
};

// Returns the memory that a component's worker writes; null if there is none.
std::shared_ptr<SlotPool> slots_of(const supervise::Component &component);

std::vector<std::uint64_t> sequences_of(const std::vector<ipc::Command> &commands);

// Slots for frames, for the results of a stage, and for frames that an output has not written yet (mode live).
constexpr std::uint32_t source_slot_count = 8, stage_slot_count = 4;
// Slots of a ray tracer with state, which may be large: the previous state, the next one, and an image to composite.
constexpr std::uint32_t slot_count_with_state = 3;
// A worker gets no frames while frames or the state hold regions of so many dead workers. Otherwise, a plugin that
// dies after each frame would pin more and more memory.
constexpr std::size_t max_earlier_outputs = 2;
constexpr std::size_t live_sink_depth = 3;

} // namespace arhost::host
