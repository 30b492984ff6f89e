// SPDX-License-Identifier: Apache-2.0
//
// The plugin's entry points and options.
#include "renderer.hpp"

#include <arhost-cpp/plugin.hpp>

#include <cstdio>
#include <optional>

namespace rt_vulkan {
namespace {

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

// Logs why `auto` skips devices that the user may expect.
PhysicalDevice chosen_device(const Instance &instance, const std::string &wanted, const arhost::Host &host) {
    const std::vector<PhysicalDevice> found = instance.devices();
    PhysicalDevice chosen = choose_device(found, wanted);
    if (wanted != "auto")
        return chosen;
    for (const PhysicalDevice &device : found)
        if (const std::string why = missing_requirement(device); !why.empty() && device.handle != chosen.handle)
            host.warn("Vulkan device '" + device.name + "' is skipped: it " + why);
    if (chosen.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU)
        host.warn("no usable GPU among the Vulkan devices: '" + chosen.name +
                  "' traces on the CPU, where rt_embree is faster");
    return chosen;
}

class Plugin {
public:
    // The choices of option `device`.
    static std::vector<arhost::Device> devices(const arhost::Host &host) {
        const Instance instance(host, false);
        const std::vector<PhysicalDevice> found = instance.devices();
        std::vector<arhost::Device> devices;
        devices.reserve(found.size());
        for (const PhysicalDevice &device : found) {
            const std::string why_not = missing_requirement(device);
            devices.push_back({static_cast<std::uint32_t>(devices.size()), kind_of(device.properties.deviceType),
                               why_not.empty() && &device == &choose_device(found, "auto"), device.name, device.uuid,
                               why_not.empty() ? "paths: " + list_of(device.paths) : why_not});
        }
        return devices;
    }

    Plugin(const arhost::Host &host, const arhost::Options &options)
        : host_(host), instance_(host, options.boolean("validate")),
          physical_(chosen_device(instance_, options.text("device"), host_)),
          paths_(choose_paths(physical_, options.text("path"))), shaders_(shaders_of(paths_[0])) {
        settings_.samples = static_cast<std::uint32_t>(options.integer("samples"));
        settings_.light_samples = static_cast<std::uint32_t>(options.integer("light_samples"));
        settings_.accumulate = options.boolean("accumulate");
        settings_.one_path = options.text("glass") == "path";
    }

    void start(const arhost_raytracer_setup &setup) {
        while (!try_start(setup)) {
            paths_.erase(paths_.begin());
            shaders_ = shaders_of(paths_[0]);
        }
        host_.info("Vulkan device '" + physical_.name + "' (" + physical_.uuid + "), path " + name_of(shaders_.path) +
                   ", " + std::to_string(setup.scene->objects.count) + " objects" +
                   (instance_.validates() ? ", with the validation layers" : ""));
    }

    void render(const arhost_render_request &request, const arhost_image &image, arhost_render_info &info) {
        const Rectangle drawn = renderer_->render(request.camera, image, request.motion);
        info.has_region = 1;
        info.region_x = drawn.x;
        info.region_y = drawn.y;
        info.region_width = drawn.width;
        info.region_height = drawn.height;
        if (info.struct_size >= sizeof info) // an older host's struct lacks the field
            info.device_time_ns = renderer_->last_gpu_ns();
    }

    void stop() {
        if (const std::uint64_t count = renderer_->image_count(); count && renderer_->gpu_ms() > 0) {
            char text[128];
            std::snprintf(text, sizeof text, "%llu images, %.3f ms each on the GPU, %s",
                          static_cast<unsigned long long>(count), renderer_->gpu_ms() / static_cast<double>(count),
                          renderer_->wrote_in_place() ? "written in place" : "copied by the host");
            host_.info(text);
        }
        renderer_.reset();
    }

private:
    // False if the path failed and another is left.
    bool try_start(const arhost_raytracer_setup &setup) {
        try {
            renderer_.emplace(setup, settings_, host_, physical_, shaders_);
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
    std::vector<Path> paths_; // not yet failed, best first
    Shaders shaders_;
    Settings settings_;
    std::optional<Renderer> renderer_;
};

constexpr const char *glass_modes[] = {"tree", "path", nullptr};
constexpr const char *paths[] = {"auto", "plain", "query", "pipeline", nullptr};
constexpr const char *needs[] = {"gpu", nullptr};

constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_TEXT, "device", "auto",
                   "The Vulkan device: its number, its UUID or a part of its name; auto: the fastest kind."),
    arhost::option(
        ARHOST_OPTION_TEXT, "path", "auto",
        "How rays are traced: 'plain' by software BVH traversal in a compute shader, 'query' and 'pipeline' by "
        "ray tracing hardware; auto: on a GPU the last of these that works, else 'plain'.",
        0, 0, paths),
    arhost::option(ARHOST_OPTION_INTEGER, "samples", "1", "Samples per pixel, evenly distributed.", 1, max_samples),
    arhost::option(ARHOST_OPTION_INTEGER, "light_samples", "4",
                   "Shadow rays per sample to each area light and to the environment.", 1, 256),
    arhost::option(
        ARHOST_OPTION_BOOL, "accumulate", "false",
        "Average over frames while camera and scene stand still: images then depend on the preceding ones."),
    arhost::option(ARHOST_OPTION_TEXT, "glass", "tree",
                   "Which rays continue at glass: 'tree' reflected and refracted, 'path' one of them at random.", 0,
                   0, glass_modes),
    arhost::option(ARHOST_OPTION_BOOL, "validate", "false",
                   "Enable Vulkan's validation layers and log their messages; slow.")};

constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_RAYTRACER,
                                          "rt_vulkan",
                                          "Vulkan ray tracer",
                                          "0.1.0",
                                          "arhost",
                                          "Apache-2.0",
                                          "Ray tracer for any Vulkan 1.1 GPU; matches rt_embree's images.",
                                          ARHOST_CAPABILITY_LENS_DISTORTION,
                                          std::size(options),
                                          options,
                                          needs};

} // namespace
} // namespace rt_vulkan

ARHOST_RAYTRACER(rt_vulkan::Plugin, rt_vulkan::descriptor)
