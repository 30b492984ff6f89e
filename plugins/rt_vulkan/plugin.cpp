// SPDX-License-Identifier: Apache-2.0
//
// The plugin: options in, images out.
#include "renderer.hpp"

#include <arhost-cpp/plugin.hpp>

#include <dlfcn.h>

#include <cstdio>
#include <optional>

namespace rt_vulkan {
namespace {

// Shaders lie beside the plugin's own file.
std::filesystem::path own_folder() {
    static const char in_this_library = 0;
    Dl_info info{};
    if (!dladdr(&in_this_library, &info) || !info.dli_fname)
        throw arhost::Failure(ARHOST_STATUS_ERROR_INTERNAL, "the plugin's own file can't be found");
    return std::filesystem::weakly_canonical(info.dli_fname).parent_path();
}

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

// `auto` may choose another than the user expects, and says why.
PhysicalDevice chosen_device(const Instance &instance, const std::string &wanted, const arhost::Host &host) {
    const std::vector<PhysicalDevice> found = instance.devices();
    PhysicalDevice chosen = choose_device(found, wanted);
    if (wanted != "auto")
        return chosen;
    for (const PhysicalDevice &device : found)
        if (const std::string why = what_it_lacks(device); !why.empty() && device.handle != chosen.handle)
            host.warn("Vulkan device '" + device.name + "' is left out: it " + why);
    if (chosen.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU)
        host.warn("no GPU that can be used is among the Vulkan devices: '" + chosen.name +
                  "' traces on the processor, where rt_embree is faster");
    return chosen;
}

class Plugin {
public:
    // What option `device` chooses from.
    static std::vector<arhost::Device> devices(const arhost::Host &host) {
        const Instance instance(host, false);
        const std::vector<PhysicalDevice> found = instance.devices();
        std::vector<arhost::Device> devices;
        devices.reserve(found.size());
        for (const PhysicalDevice &device : found) {
            const std::string why_not = what_it_lacks(device);
            devices.push_back({static_cast<std::uint32_t>(devices.size()), kind_of(device.properties.deviceType),
                               why_not.empty() && &device == &choose_device(found, "auto"), device.name, device.uuid,
                               why_not.empty() ? "paths: " + list_of(device.paths) : why_not});
        }
        return devices;
    }

    Plugin(const arhost::Host &host, const arhost::Options &options)
        : host_(host), instance_(host, options.boolean("validate")),
          physical_(chosen_device(instance_, options.text("device"), host_)),
          paths_(choose_paths(physical_, options.text("path"))), shaders_(read_shaders(own_folder(), paths_[0])) {
        settings_.samples = static_cast<std::uint32_t>(options.integer("samples"));
        settings_.light_samples = static_cast<std::uint32_t>(options.integer("light_samples"));
        settings_.accumulate = options.boolean("accumulate");
        settings_.one_path = options.text("glass") == "path";
    }

    void start(const arhost_raytracer_setup &setup) {
        while (!try_start(setup)) {
            paths_.erase(paths_.begin());
            shaders_ = read_shaders(own_folder(), paths_[0]);
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
        if (info.struct_size >= sizeof info) // that of an older host ends before it
            info.device_time_ns = renderer_->last_gpu_ns();
    }

    void stop() {
        if (const std::uint64_t count = renderer_->image_count(); count && renderer_->gpu_ms() > 0) {
            char text[128];
            std::snprintf(text, sizeof text, "%llu images, %.3f ms each by the GPU's clock, %s",
                          static_cast<unsigned long long>(count), renderer_->gpu_ms() / static_cast<double>(count),
                          renderer_->wrote_in_place() ? "written in place" : "copied by the host");
            host_.info(text);
        }
        renderer_.reset();
    }

private:
    // False where the path failed, and there is another.
    bool try_start(const arhost_raytracer_setup &setup) {
        try {
            renderer_.emplace(setup, settings_, host_, instance_, physical_, shaders_);
            return true;
        } catch (const arhost::Failure &failure) {
            const arhost_status status = failure.status();
            if (paths_.size() == 1 || status == ARHOST_STATUS_ERROR_CANCELLED ||
                status == ARHOST_STATUS_ERROR_INVALID_ARGUMENT)
                throw;
            host_.warn("Vulkan device '" + physical_.name + "': path '" + name_of(paths_[0]) + "' is left for '" +
                       name_of(paths_[1]) + "', since it failed: " + failure.what());
            return false;
        }
    }

    arhost::Host host_;
    Instance instance_;
    PhysicalDevice physical_;
    std::vector<Path> paths_; // that are left to take, the one that is taken first
    Shaders shaders_;
    Settings settings_;
    std::optional<Renderer> renderer_;
};

constexpr const char *glass[] = {"tree", "path", nullptr};
constexpr const char *paths[] = {"auto", "plain", "query", "pipeline", nullptr};
constexpr const char *needs[] = {"gpu", nullptr};

constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_TEXT, "device", "auto",
                   "Which Vulkan device: its number, its UUID or a part of its name; auto: the fastest kind."),
    arhost::option(
        ARHOST_OPTION_TEXT, "path", "auto",
        "How rays find what they hit: 'plain' walks trees in a compute shader, 'query' and 'pipeline' have "
        "the device's units for ray tracing do it; auto: on a GPU the last of these that works, else 'plain'.",
        0, 0, paths),
    arhost::option(ARHOST_OPTION_INTEGER, "samples", "1", "Rays a pixel, spread evenly over it.", 1, max_samples),
    arhost::option(ARHOST_OPTION_INTEGER, "light_samples", "4",
                   "Shadow rays from each of these to a light that has an extent, or to the environment.", 1, 256),
    arhost::option(
        ARHOST_OPTION_BOOL, "accumulate", "false",
        "Average over frames while the camera and the scene stand still: an image then depends on the ones "
        "before."),
    arhost::option(ARHOST_OPTION_TEXT, "glass", "tree",
                   "Rays that glass sends on: 'tree' follows both, 'path' one that is chosen at random.", 0, 0,
                   glass),
    arhost::option(ARHOST_OPTION_BOOL, "validate", "false",
                   "Let Vulkan's validation layers watch, and log what they say: slow.")};

constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_RAYTRACER,
                                          "rt_vulkan",
                                          "Vulkan ray tracer",
                                          "0.1.0",
                                          "arhost",
                                          "Apache-2.0",
                                          "Ray tracer on any GPU of Vulkan 1.1, with rt_embree's picture.",
                                          ARHOST_CAPABILITY_LENS_DISTORTION,
                                          std::size(options),
                                          options,
                                          needs};

} // namespace
} // namespace rt_vulkan

ARHOST_RAYTRACER(rt_vulkan::Plugin, rt_vulkan::descriptor)
