// SPDX-License-Identifier: Apache-2.0
//
// The ray tracer of a run, and the quality of the images that are requested from it.
#pragma once

#include "compositor/compositor.hpp"
#include "contracts/contract_checks.hpp"
#include "host/scene_loading.hpp"
#include "host/stage.hpp"

namespace arhost::host {

struct LoadedScene {
    run_config::Scene source;
    std::set<std::filesystem::path> files; // as in SceneLoading::Callbacks
    ipc::SharedMemory arena;
    std::vector<Anchor> anchors;
    arhost_integrator integrator = ARHOST_INTEGRATOR_WHITTED;
    camera::Coordinates coordinates;                        // from the configuration or from the scene's axes
    std::optional<contracts::OverlayChecks> overlay_checks; // only for `conform: true`
};

// Returns the width and the height in px of an overlay for frames of this format.
std::pair<std::uint32_t, std::uint32_t> overlay_size(const arhost_frame_format &format, const Quality &quality);
// Returns the overlay in the frame's slot of the ray tracer.
ImageView overlay_of(const Frame &frame, const arhost_frame_format &format);
// Returns the bytes of the frame's overlay, without the ray tracer's state; empty without an overlay.
std::span<const std::byte> overlay_bytes(const Frame &frame, const arhost_frame_format &format);

class Raytracer final : public Stage {
public:
    using Configuration = std::shared_ptr<const run_config::RaytracerConfiguration>;

    Raytracer(RunParts &parts, Configuration configuration, std::shared_ptr<LoadedScene> scene, Abandon abandon);

    FrameFlow::Intake intake() const override;
    void render(Frame &frame);
    // Makes this stage the current one. `previous`: the stage that it replaces, or null.
    void take_over(const Raytracer *previous);

    const Configuration &configuration() const { return configuration_; }
    const std::shared_ptr<LoadedScene> &scene() const { return scene_; }

private:
    supervise::Component::Create on_hello(const model::PluginDescription &plugin, std::size_t candidate) override;
    ipc::SlotLayout on_ready(const ipc::messages::Ready &ready) override;
    void on_running() override { start_quality(); }
    void on_result(const ipc::Command &command, const ipc::Result &result) override;
    void on_disabled(const std::string &reason, bool is_configuration_error) override;
    bool warps_images(const model::PluginDescription &plugin) const;
    OverlayFormat choose_format(const model::PluginDescription &plugin) const;
    void start_quality();
    void add_report(const Adaptable &report);
    void write_anchors(const Frame &frame) const;

    const Configuration configuration_;
    const std::shared_ptr<LoadedScene> scene_;
    std::shared_ptr<SlotPool> anchor_slots_; // slots for AnchorPose; null if the scene has no anchors
    // Of the current worker.
    OverlayFormat overlay_format_;
    bool reads_video_ = false, has_state_ = false;
    std::optional<QualityController> quality_; // only with `live.target_fps`
    std::string adapted_plugin_;               // the plugin whose quality is adapted
    AdaptableReports reports_;                 // of that plugin
};

} // namespace arhost::host
