// SPDX-License-Identifier: Apache-2.0
//
// Vulkan's loader, which is opened and not linked, so that a machine without it gets a message; an instance, and the
// devices that it has.
#pragma once

#define VK_NO_PROTOTYPES
#include <arhost-cpp/plugin.hpp>
#include <vulkan/vulkan.h>

#include <memory>
#include <string>
#include <vector>

namespace rt_vulkan {

// clang-format off
#define RT_VULKAN_INSTANCE_FUNCTIONS(use) \
    use(vkDestroyInstance) use(vkEnumeratePhysicalDevices) use(vkGetPhysicalDeviceProperties2) \
    use(vkGetPhysicalDeviceFeatures2) use(vkGetPhysicalDeviceMemoryProperties) \
    use(vkGetPhysicalDeviceQueueFamilyProperties) use(vkGetPhysicalDeviceExternalBufferProperties) \
    use(vkEnumerateDeviceExtensionProperties) use(vkCreateDevice) use(vkGetDeviceProcAddr)
// clang-format on

struct InstanceFunctions {
#define RT_VULKAN_DECLARE(name) PFN_##name name;
    RT_VULKAN_INSTANCE_FUNCTIONS(RT_VULKAN_DECLARE)
};

// How rays find what they hit.
enum class Path {
    plain,   // trees of ours, walked in a compute shader
    query,   // the device's own trees, asked in a compute shader (VK_KHR_ray_query)
    pipeline // the same by a pipeline for ray tracing (VK_KHR_ray_tracing_pipeline)
};
const char *name_of(Path path);

// What the device says of its tracing of rays; all 0 where it has neither path for it.
struct TracingLimits {
    std::uint64_t max_objects, max_primitives;
    std::uint32_t scratch_alignment;                              // bytes
    std::uint32_t handle_size, handle_alignment, table_alignment; // bytes, of shader binding tables
};

// What is known of a device without making use of it.
struct PhysicalDevice {
    VkPhysicalDevice handle;
    std::string name, uuid; // the latter 32 hexadecimal digits
    VkPhysicalDeviceProperties properties;
    std::uint32_t queue_family; // one that computes; VK_QUEUE_FAMILY_IGNORED: it has none
    std::uint32_t timestamp_bits;
    bool imports_host_memory;
    VkDeviceSize import_alignment;        // bytes
    std::vector<Path> paths{Path::plain}; // the one that a GPU is to take last
    TracingLimits tracing;
};

// What all paths need and it does not have, as "can't compute"; empty: nothing.
std::string what_it_lacks(const PhysicalDevice &device);

class Instance {
public:
    // `validate`: with the validation layers, synchronization validation included; what they say is logged as errors.
    Instance(const arhost::Host &host, bool validate, const std::string &loader = "libvulkan.so.1");
    ~Instance();
    Instance(const Instance &) = delete;
    Instance &operator=(const Instance &) = delete;

    VkInstance handle() const { return instance_; }
    const InstanceFunctions &functions() const { return functions_; }
    bool validates() const { return messenger_ != VK_NULL_HANDLE; }
    std::vector<PhysicalDevice> devices() const;

private:
    struct CloseLibrary {
        void operator()(void *library) const;
    };
    void create(bool validate);
    bool add_messenger();

    arhost::Host host_;
    std::unique_ptr<void, CloseLibrary> library_;
    PFN_vkGetInstanceProcAddr get_ = nullptr;
    VkInstance instance_ = VK_NULL_HANDLE;
    VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
    InstanceFunctions functions_{};
};

// The one that `wanted` names: its number in the list, its UUID, or a part of its name; "auto": of those that lack
// nothing, one of the fastest kind.
const PhysicalDevice &choose_device(const std::vector<PhysicalDevice> &devices, const std::string &wanted);

// The one that `wanted` names; "auto": those that the device says it has, the best first. Drivers have said so of
// what they can't do.
std::vector<Path> choose_paths(const PhysicalDevice &device, const std::string &wanted);

// 32 digits
std::string hexadecimal(const std::uint8_t (&bytes)[VK_UUID_SIZE]);
// "plain, query"
std::string list_of(const std::vector<Path> &paths);

// Throws what `result` means, naming what was tried.
void check(VkResult result, const char *what);

} // namespace rt_vulkan
