// SPDX-License-Identifier: Apache-2.0
//
// Renders an image: selects the tiles in which objects can be visible, and distributes them over threads.
#pragma once

#include "embree_scene.hpp"
#include "photon_sums.hpp"
#include "ray_table.hpp"
#include "raytracer_common/denoiser/denoiser.hpp"
#include "raytracer_common/photon_map.hpp"
#include "raytracer_common/thread_pool.hpp"
#include "raytracer_common/video.hpp"
#include "surroundings.hpp"

#include <arhost-cpp/plugin.hpp>

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace rt_embree {

struct Settings {
    std::uint32_t samples = 1; // per pixel
    unsigned threads = 0;      // 0: one per processor
    bool robust = false;
    std::int32_t light_samples = 4;  // per shaded point and area light, environment or background
    bool accumulate = false;         // average over frames while the camera and scene are static
    bool single_path = false;        // glass spawns one random ray instead of two
    float max_radiance = 100;        // path integrator: bound of each sample; infinity: none
    std::uint32_t photons = 1 << 14; // path integrator: light rays from lamps per frame and sample, for caustics
    InstructionSet instruction_set = choose_instruction_set("auto");
    bool denoise = false;      // path integrator
    View view = View::picture; // else it needs `denoise`
};

// Owns the memory of a thread's `Scratch`.
class ScratchMemory {
public:
    explicit ScratchMemory(std::uint32_t max_depth);
    Scratch &operator*() { return scratch_; }

private:
    std::vector<float> storage_;
    std::vector<RayQueue> queues_;
    Scratch scratch_{};
};

class Renderer {
public:
    Renderer(const arhost_raytracer_setup &setup, const Settings &settings, const arhost::Host &host);

    // Returns a rectangle that contains all pixels that virtual objects affect; if there are none, it has x1 <= x0.
    // `motion` is NULL if nothing has moved since the last call, `video` if the frame under the overlay is unknown.
    // `sequence`: number of the frame, for the random numbers of the path integrator. `state`: of state_size() bytes;
    // without it, there is no denoising. `shading_px`: as in arhost_render_request, for denoising only.
    Rectangle render(const arhost_camera &camera, const arhost_image &image, const arhost_motion *motion = nullptr,
                     const arhost_frame *video = nullptr, std::uint64_t sequence = 0, const StateSlots &state = {},
                     std::uint32_t shading_px = 1);
    std::uint64_t state_size() const {
        return (denoiser_ ? denoiser_->state_size() : 0) + (remembers_ ? surroundings_state_size() : 0);
    }
    const EmbreeScene &scene() const { return scene_; }
    // Both functions change the images of later calls as if the renderer had been created with the new setting.
    // `full_samples`: number of samples of an image without a limit (arhost_render_request.max_samples).
    void set_samples(std::uint32_t samples, std::uint32_t full_samples);
    void set_light_samples(std::int32_t samples);

    const char *kernel_name() const { return kernel_.name; }
    unsigned thread_count() const { return threads_.thread_count(); }

private:
    void set_size(const arhost_camera &camera);
    void place_lights();
    PathScene path_scene() const;
    bool finds_unchanged() const;
    void trace_photons(Frame &frame);

    arhost::Host host_;
    const arhost_intrinsics full_intrinsics_; // the intrinsics passed to start
    arhost_intrinsics intrinsics_;            // the intrinsics of the ray table
    Kernel kernel_;
    ThreadPool threads_;
    RayTable ray_table_;
    std::uint32_t samples_per_frame_;
    std::vector<arhost::raytracer_common::Sample> samples_; // sample positions of the current frame
    EmbreeScene scene_;
    std::vector<ScratchMemory> scratch_; // one per thread
    std::int32_t light_samples_;
    bool single_path_;

    // The path integrator; empty with another integrator.
    std::optional<arhost::raytracer_common::LightSources> lights_;
    std::array<float, arhost::raytracer_common::source_rows * most_few_sources> few_sources_{}; // of PathScene
    std::vector<float> irradiance_;                                                             // of the environment
    float brightest_texel_ = 0;                                                                 // of PathScene
    float max_radiance_;
    View view_;
    bool blends_codes_;          // as in Frame
    std::uint32_t full_samples_; // the random numbers of a frame begin at its number times this
    std::uint32_t photons_per_sample_;
    arhost::raytracer_common::PhotonTargets photon_targets_;
    std::vector<arhost::raytracer_common::Photon> photons_;
    std::vector<std::int8_t> photon_faces_; // see TracePhotons
    arhost::raytracer_common::PhotonMap photon_map_;
    // Of the scene as it is placed. Empty elements have not been traced.
    std::array<std::optional<PhotonSums>, 16> photon_sums_;
    std::uint32_t photons_per_set_ = 0;
    arhost::raytracer_common::VideoImage video_;
    bool has_video_ = false;           // of the current frame
    Video lens_;                       // of the largest image, without a video
    std::optional<Denoiser> denoiser_; // empty without denoising
    bool remembers_ = false;           // whether the state contains the surroundings, after the denoiser's part

    // State of the option `accumulate`.
    std::vector<float> history_;                  // sums of the samples so far; empty if the option is off
    std::uint32_t history_samples_ = 0;           // number of samples in the sums
    std::optional<arhost_camera> history_camera_; // the camera of the sums; empty: the sums are invalid
};

} // namespace rt_embree
