// SPDX-License-Identifier: Apache-2.0
//
// The plugin's entry points and options.
#include "self_check.hpp"

#include <arhost-cpp/plugin.hpp>

#include <cstdio>
#include <limits>
#include <optional>

namespace rt_vulkan {
namespace {

using arhost::raytracer_common::View, arhost::raytracer_common::views;

arhost_device_kind kind_of(VkPhysicalDeviceType type) {
    switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
        return ARHOST_DEVICE_DISCRETE_GPU;
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
        return ARHOST_DEVICE_INTEGRATED_GPU;
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU:
        return ARHOST_DEVICE_VIRTUAL_GPU;
    case VK_PHYSICAL_DEVICE_TYPE_CPU:
        return ARHOST_DEVICE_CPU;
    default:
        return ARHOST_DEVICE_OTHER;
    }
}

// Returns the device that option `device` selects. For `auto`, also logs why devices are skipped, and warns if no GPU
// is usable.
PhysicalDevice chosen_device(const Instance &instance, const std::string &wanted, const arhost::Host &host) {
    const std::vector<PhysicalDevice> found = instance.devices();
    PhysicalDevice chosen = choose_device(found, wanted);
    if (wanted != "auto")
        return chosen;
    for (const PhysicalDevice &device : found)
        if (const std::string why = missing_requirement(device); !why.empty() && device.handle != chosen.handle)
            host.warn("Vulkan device '" + device.name + "' is skipped: it " + why);
    if (chosen.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU)
        host.warn("no Vulkan device is a usable GPU: rendering on the CPU with '" + chosen.name +
                  "'; rt_embree is faster on the CPU");
    return chosen;
}

class Plugin {
public:
    // Lists the choices of the option `device`, for `arhost devices`.
    static std::vector<arhost::Device> devices(const arhost::Host &host) {
        const Instance instance(host, false);
        const std::vector<PhysicalDevice> found = instance.devices();
        std::vector<arhost::Device> devices;
        devices.reserve(found.size());
        for (const PhysicalDevice &device : found) {
            const std::string why_not = missing_requirement(device);
            devices.push_back({.index = static_cast<std::uint32_t>(devices.size()),
                               .kind = kind_of(device.properties.deviceType),
                               .state = why_not.empty() ? ARHOST_DEVICE_STATE_USABLE : ARHOST_DEVICE_STATE_UNUSABLE,
                               .is_default = why_not.empty() && &device == &choose_device(found, "auto"),
                               .name = device.name,
                               .serial = device.uuid,
                               .abilities = why_not.empty() ? "paths: " + list_of(device.paths) : "",
                               .problem = why_not.empty() ? "" : "it " + why_not});
        }
        return devices;
    }

    Plugin(const arhost::Host &host, const arhost::Options &options)
        : host_(host), instance_(host, options.boolean("validate")),
          physical_(chosen_device(instance_, options.text("device"), host_)),
          paths_(choose_paths(physical_, options.text("path"))) {
        quality_ = options.text("quality");
        settings_.samples = samples_of(options);
        settings_.light_samples = static_cast<std::uint32_t>(options.integer("light_samples"));
        settings_.accumulate = options.boolean("accumulate");
        settings_.denoise = quality_ != "reference" && !settings_.accumulate;
        settings_.denoiser_threads = static_cast<unsigned>(options.integer("threads"));
        settings_.view = arhost::raytracer_common::view_of(options.text("show"), settings_.denoise);
        settings_.single_path = options.text("glass") == "path";
        settings_.photons = static_cast<std::uint32_t>(options.integer("photons"));
        if (const double bound = options.real("max_radiance"); bound > 0)
            settings_.max_radiance = static_cast<float>(bound);
        else
            settings_.max_radiance = std::numeric_limits<float>::infinity();
    }

    void start(const arhost_raytracer_setup &setup) {
        while (!try_start(setup))
            paths_.erase(paths_.begin());
        host_.info("Vulkan device '" + physical_.name + "' (" + physical_.uuid + "), path " + name_of(paths_[0]) +
                   ", " + std::to_string(setup.scene->objects.count) + " objects" +
                   (instance_.validates() ? ", with the validation layers" : ""));
        if (settings_.view != View::picture && renderer_->state_size() == 0)
            throw arhost::Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                                  "option 'show': images of this scene are not denoised; only 'picture' is possible");
    }

    void render(const arhost_render_request &request, const arhost_image &image, arhost_render_info &info) {
        renderer_->set_samples(arhost::raytracer_common::limited(settings_.samples, request), settings_.samples);
        // An older host's struct lacks fields.
        const auto has = [&](std::size_t field) { return request.struct_size > field; };
        const arhost_frame *video = has(offsetof(arhost_render_request, video)) ? request.video : nullptr;
        const auto state = arhost::raytracer_common::state_of(request, renderer_->state_size());
        const Rectangle drawn =
            renderer_->render(request.camera, image, request.motion, video, request.sequence, state);
        info.has_region = 1;
        info.region_x = drawn.x;
        info.region_y = drawn.y;
        info.region_width = drawn.width;
        info.region_height = drawn.height;
        if (info.struct_size >= sizeof info) { // an older host's struct lacks fields
            info.device_time_ns = renderer_->last_gpu_ns();
            info.full_samples = settings_.samples;
        }
    }

    static constexpr const char *changeable[] = {"samples", "light_samples", nullptr};
    void set(const arhost::Options &changed) {
        if (changed.contains("samples"))
            settings_.samples = samples_of(changed);
        else
            renderer_->set_light_samples(static_cast<std::uint32_t>(changed.integer("light_samples")));
    }

    std::uint64_t state_size() const { return renderer_->state_size(); }

    void stop() {
        if (const std::uint64_t count = renderer_->image_count(); count && renderer_->gpu_ms() > 0) {
            char text[128];
            std::snprintf(text, sizeof text, "%llu images, mean GPU time %.3f ms; %s",
                          static_cast<unsigned long long>(count), renderer_->gpu_ms() / static_cast<double>(count),
                          renderer_->wrote_in_place() ? "the device wrote them directly to host memory"
                                                      : "the host copied them from a mapped buffer");
            host_.info(text);
        }
        renderer_.reset();
    }

private:
    std::uint32_t samples_of(const arhost::Options &options) const {
        const auto samples = static_cast<std::uint32_t>(options.integer("samples"));
        return samples > 0 ? samples : arhost::raytracer_common::samples_of(quality_);
    }

    // Tries to start with the first of `paths_`. If that fails and trying another path makes sense, returns false;
    // otherwise throws.
    bool try_start(const arhost_raytracer_setup &setup) {
        const Shaders shaders = shaders_of(paths_[0], setup.scene->integrator);
        try {
            if (paths_.size() > 1) // another path can be used instead
                if (const std::string why = difference_from_plain(setup, settings_, host_, physical_, shaders);
                    !why.empty())
                    throw arhost::Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, why);
            renderer_.emplace(setup, settings_, host_, physical_, shaders);
            return true;
        } catch (const arhost::Failure &failure) {
            const arhost_status status = failure.status();
            if (paths_.size() == 1 || status == ARHOST_STATUS_ERROR_CANCELLED ||
                status == ARHOST_STATUS_ERROR_INVALID_ARGUMENT)
                throw;
            host_.warn("Vulkan device '" + physical_.name + "': path '" + name_of(paths_[0]) + "' failed, trying '" +
                       name_of(paths_[1]) + "': " + failure.what());
            return false;
        }
    }

    arhost::Host host_;
    Instance instance_;
    PhysicalDevice physical_;
    std::vector<Path> paths_; // paths that have not failed yet, best first
    Settings settings_;
    std::string quality_;
    std::optional<Renderer> renderer_;
};

constexpr const char *glass_modes[] = {"tree", "path", nullptr};
constexpr const char *paths[] = {"auto", "plain", "query", "pipeline", nullptr};
constexpr const char *needs[] = {"gpu", nullptr};

constexpr arhost_option_descriptor options[] = {
    arhost::option(
        ARHOST_OPTION_TEXT, "device", "auto",
        "Vulkan device: its number, its UUID or a part of its name; 'auto': the fastest kind of usable device."),
    arhost::option(
        ARHOST_OPTION_TEXT, "path", "auto",
        "How rays are traced; 'plain': software BVH traversal; 'query' and 'pipeline': hardware acceleration "
        "structures; 'auto': on a GPU the first of 'pipeline', 'query' and 'plain' that works, on a CPU 'plain'.",
        0, 0, paths),
    arhost::option(ARHOST_OPTION_TEXT, "quality", "realtime",
                   "'realtime': 1 sample per pixel; 'balanced': 4; 'reference': 64. The path integrator denoises the "
                   "first two, with the light of earlier frames.",
                   0, 0, arhost::raytracer_common::qualities),
    arhost::option(ARHOST_OPTION_INTEGER, "samples", "0",
                   "Primary rays per pixel, evenly spread over the pixel; 0: as many as 'quality' says.", 0,
                   max_samples),
    arhost::option(ARHOST_OPTION_INTEGER, "light_samples", "4",
                   "Shadow rays from each shaded point to each area light and to the environment.", 1, 256),
    arhost::option(
        ARHOST_OPTION_BOOL, "accumulate", "false",
        "Average over frames while the camera and scene are static, instead of denoising; each image then depends on "
        "earlier frames."),
    arhost::option(ARHOST_OPTION_TEXT, "glass", "tree",
                   "Rays traced at glass; 'tree': both the reflected and the refracted ray; 'path': one of them, "
                   "chosen at random.",
                   0, 0, glass_modes),
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
    arhost::option(ARHOST_OPTION_INTEGER, "threads", "0", "Threads of the denoiser; 0: one per processor.", 0, 256),
    arhost::option(ARHOST_OPTION_BOOL, "validate", "false",
                   "Enable Vulkan's validation layers and log their messages; slow.")};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_RAYTRACER,
    .id = "org.arhost.rt_vulkan",
    .name = "Vulkan ray tracer",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Ray tracer for any Vulkan 1.1 GPU; renders the same images as rt_embree.",
    .capabilities = ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION | ARHOST_RAYTRACER_CAPABILITY_EVERY_SCENE |
                    ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES | ARHOST_RAYTRACER_CAPABILITY_VIDEO,
    .option_count = std::size(options),
    .options = options,
    .needs = needs,
};

} // namespace
} // namespace rt_vulkan

ARHOST_RAYTRACER(rt_vulkan::Plugin, rt_vulkan::descriptor)
