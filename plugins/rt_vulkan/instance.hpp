// SPDX-License-Identifier: Apache-2.0
//
// The Vulkan loader, a Vulkan instance and its devices. The loader is opened at run time with volk, so the plugin can
// report a clear error on machines without Vulkan.
#pragma once

#include <arhost-cpp/plugin.hpp>
#include <volk.h>

#include <memory>
#include <string>
#include <vector>

namespace rt_vulkan {

// The methods of intersecting rays with the scene.
enum class Path {
    plain,   // software BVH traversal in a compute shader
    query,   // hardware acceleration structures, ray queries in a compute shader (VK_KHR_ray_query)
    pipeline // hardware acceleration structures, a ray tracing pipeline (VK_KHR_ray_tracing_pipeline)
};
const char *name_of(Path path);

// Limits of the hardware paths. All are 0 if the device supports neither `query` nor `pipeline`.
struct TracingLimits {
    std::uint64_t max_objects, max_primitives;
    std::uint32_t scratch_alignment;                              // bytes
    std::uint32_t handle_size, handle_alignment, table_alignment; // bytes, for shader binding tables
};

// The properties of a Vulkan device, which can be queried without creating a logical device.
struct PhysicalDevice {
    VkPhysicalDevice handle;
    std::string name, uuid; // uuid: 32 hexadecimal digits
    VkPhysicalDeviceProperties properties;
    std::uint32_t queue_family; // a family with compute support, or VK_QUEUE_FAMILY_IGNORED if there is none
    std::uint32_t timestamp_bits;
    bool imports_host_memory;
    VkDeviceSize import_alignment;        // bytes
    std::vector<Path> paths{Path::plain}; // supported paths; `auto` prefers the last on a GPU
    TracingLimits tracing;
};

// Returns why the device cannot run any path, for example "has no compute queue"; empty if it can.
std::string missing_requirement(const PhysicalDevice &device);

class Instance {
public:
    // `validate`: enable the validation layers with synchronization validation, and log their messages as errors.
    Instance(const arhost::Host &host, bool validate, const std::string &loader = "libvulkan.so.1");
    ~Instance();
    Instance(const Instance &) = delete;
    Instance &operator=(const Instance &) = delete;

    bool validates() const { return messenger_ != VK_NULL_HANDLE; }
    std::vector<PhysicalDevice> devices() const;

private:
    struct CloseLibrary {
        void operator()(void *library) const;
    };
    void create(bool validate);

    arhost::Host host_;
    std::unique_ptr<void, CloseLibrary> library_;
    VkInstance instance_ = VK_NULL_HANDLE;
    VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
    PFN_vkDestroyDebugUtilsMessengerEXT destroy_messenger_ = nullptr;
};

// Returns the device that `wanted` selects: its index in `devices`, its UUID or a part of its name. "auto" selects a
// usable device of the fastest kind.
const PhysicalDevice &choose_device(const std::vector<PhysicalDevice> &devices, const std::string &wanted);

// Returns the path called `wanted`. For "auto", returns all paths worth trying, best first, because some drivers
// announce paths that then fail.
std::vector<Path> choose_paths(const PhysicalDevice &device, const std::string &wanted);

// Returns a UUID as 32 hexadecimal digits.
std::string hexadecimal(const std::uint8_t (&bytes)[VK_UUID_SIZE]);
// Returns a list for messages, for example "plain, query".
std::string list_of(const std::vector<Path> &paths);

// Throws arhost::Failure if `result` is an error; `what` names the attempted operation.
void check(VkResult result, const char *what);

} // namespace rt_vulkan
