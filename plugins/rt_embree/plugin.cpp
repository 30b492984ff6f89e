// SPDX-License-Identifier: Apache-2.0
//
// The plugin's entry points and options.
#include "renderer.hpp"

#include <arhost-cpp/plugin.hpp>

#include <limits>
#include <optional>

namespace rt_embree {
namespace {

class Plugin {
public:
    Plugin(const arhost::Host &host, const arhost::Options &options) : host_(host) {
        quality_ = options.text("quality");
        settings_.samples = samples_of(options);
        settings_.threads = static_cast<unsigned>(options.integer("threads"));
        settings_.robust = options.boolean("robust");
        settings_.light_samples = static_cast<std::int32_t>(options.integer("light_samples"));
        settings_.accumulate = options.boolean("accumulate");
        settings_.denoise = quality_ != "reference" && !settings_.accumulate;
        settings_.view = view_of(options.text("show"), settings_.denoise);
        settings_.single_path = options.text("glass") == "path";
        settings_.photons = static_cast<std::uint32_t>(options.integer("photons"));
        if (const double bound = options.real("max_radiance"); bound > 0)
            settings_.max_radiance = static_cast<float>(bound);
        else
            settings_.max_radiance = std::numeric_limits<float>::infinity();
        settings_.instruction_set = choose_instruction_set(options.text("instruction_set"));
    }

    void start(const arhost_raytracer_setup &setup) {
        renderer_.emplace(setup, settings_, host_);
        host_.info("Embree " + std::to_string(RTC_VERSION_MAJOR) + "." + std::to_string(RTC_VERSION_MINOR) + ", " +
                   std::to_string(setup.scene->objects.count) + " objects, " +
                   std::to_string(renderer_->thread_count()) + " threads, instruction set " +
                   renderer_->kernel_name());
        if (settings_.view != View::picture && renderer_->state_size() == 0)
            throw arhost::Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                                  "option 'show': images of this scene are not denoised; only 'picture' is possible");
        if (settings_.denoise && setup.scene->integrator == ARHOST_INTEGRATOR_PATH && renderer_->state_size() == 0)
            host_.info("images are not denoised: the scene has too many objects");
    }

    void render(const arhost_render_request &request, const arhost_image &image, arhost_render_info &info) {
        renderer_->set_samples(arhost::raytracer_common::limited(settings_.samples, request), settings_.samples);
        // An older host's struct lacks fields.
        const auto has = [&](std::size_t field) { return request.struct_size > field; };
        const StateSlots state = state_of(request, renderer_->state_size());
        const Rectangle drawn =
            renderer_->render(request.camera, image, request.motion,
                              has(offsetof(arhost_render_request, video)) ? request.video : nullptr, request.sequence,
                              state, has(offsetof(arhost_render_request, shading_px)) ? request.shading_px : 1);
        info.has_region = 1;
        if (drawn.x0 < drawn.x1) {
            info.region_x = static_cast<std::uint32_t>(drawn.x0);
            info.region_y = static_cast<std::uint32_t>(drawn.y0);
            info.region_width = static_cast<std::uint32_t>(drawn.x1 - drawn.x0);
            info.region_height = static_cast<std::uint32_t>(drawn.y1 - drawn.y0);
        }
        if (info.struct_size > offsetof(arhost_render_info, full_samples)) // an older host's struct lacks the fields
            info.full_samples = settings_.samples;
        if (info.struct_size > offsetof(arhost_render_info, coarsest_shading_px))
            info.coarsest_shading_px = renderer_->state_size() > 0 && state.after ? 2 : 0;
    }

    static constexpr const char *changeable[] = {"samples", "light_samples", nullptr};
    void set(const arhost::Options &changed) {
        if (changed.contains("samples"))
            settings_.samples = samples_of(changed);
        else
            renderer_->set_light_samples(static_cast<std::int32_t>(changed.integer("light_samples")));
    }

    std::uint64_t state_size() const { return renderer_->state_size(); }

    void stop() { renderer_.reset(); }

private:
    std::uint32_t samples_of(const arhost::Options &options) const {
        const auto samples = static_cast<std::uint32_t>(options.integer("samples"));
        return samples > 0 ? samples : arhost::raytracer_common::samples_of(quality_);
    }

    arhost::Host host_;
    Settings settings_;
    std::string quality_;
    std::optional<Renderer> renderer_;
};

constexpr const char *glass[] = {"tree", "path", nullptr};

constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_TEXT, "quality", "realtime",
                   "'realtime': 1 sample per pixel; 'balanced': 4; 'reference': 64. The path integrator denoises the "
                   "first two, with the light of earlier frames.",
                   0, 0, arhost::raytracer_common::qualities),
    arhost::option(ARHOST_OPTION_INTEGER, "samples", "0",
                   "Primary rays per pixel, evenly spread over the pixel; 0: as many as 'quality' says.", 0, 256),
    arhost::option(ARHOST_OPTION_INTEGER, "light_samples", "4",
                   "Shadow rays from each shaded point to each area light and to the environment.", 1, 256),
    arhost::option(
        ARHOST_OPTION_BOOL, "accumulate", "false",
        "Average over frames while the camera and scene are static, instead of denoising; each image then depends on "
        "earlier frames."),
    arhost::option(ARHOST_OPTION_TEXT, "glass", "tree",
                   "Rays traced at glass; 'tree': both the reflected and the refracted ray; 'path': one of them, "
                   "chosen at random.",
                   0, 0, glass),
    arhost::option(ARHOST_OPTION_REAL, "max_radiance", "100",
                   "Path integrator: bound of each sample's radiance, in multiples of white, so that single bright "
                   "paths make no fireflies; 0: none.",
                   0, 1e6),
    arhost::option(ARHOST_OPTION_INTEGER, "photons", "16384",
                   "Path integrator: light rays from lamps to mirrors and glass per frame and sample, for caustics; "
                   "0: none.",
                   0, arhost::raytracer_common::max_photons),
    arhost::option(
        ARHOST_OPTION_TEXT, "show", "picture",
        "What images show: the picture, or a part of it for inspection. Of the change of a catcher's light: "
        "'shadow' (grey: none), 'bounce' or 'caustics'. Of the denoiser: the length of the 'history' (white: "
        "32 frames), the standard deviation that is left ('variance'; white: 0.1), or 'normals'.",
        0, 0, views),
    arhost::option(ARHOST_OPTION_INTEGER, "threads", "0", "Render threads; 0: one per processor.", 0, 256),
    arhost::option(ARHOST_OPTION_BOOL, "robust", "false",
                   "Prevent rays from passing between triangles that share an edge (watertight); about 10 % slower."),
    arhost::option(ARHOST_OPTION_TEXT, "instruction_set", "auto",
                   "Vector instructions used for shading; 'auto': the widest that the processor supports.", 0, 0,
                   instruction_sets)};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_RAYTRACER,
    .id = "org.arhost.rt_embree",
    .name = "Embree ray tracer",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "CPU ray tracer that traces packets of 16 rays with Intel Embree.",
    .capabilities = ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION | ARHOST_RAYTRACER_CAPABILITY_EVERY_SCENE |
                    ARHOST_RAYTRACER_CAPABILITY_SCALED_IMAGES | ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES |
                    ARHOST_RAYTRACER_CAPABILITY_VIDEO,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

} // namespace
} // namespace rt_embree

ARHOST_RAYTRACER(rt_embree::Plugin, rt_embree::descriptor)
