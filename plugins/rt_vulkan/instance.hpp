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

#define RT_VULKAN_INSTANCE_FUNCTIONS(use)                                                                            \
    use(vkDestroyInstance) use(vkEnumeratePhysicalDevices) use(vkGetPhysicalDeviceProperties2)                       \
        use(vkGetPhysicalDeviceMemoryProperties) use(vkGetPhysicalDeviceQueueFamilyProperties)                       \
            use(vkEnumerateDeviceExtensionProperties) use(vkCreateDevice) use(vkGetDeviceProcAddr)

struct InstanceFunctions {
#define RT_VULKAN_DECLARE(name) PFN_##name name;
    RT_VULKAN_INSTANCE_FUNCTIONS(RT_VULKAN_DECLARE)
};

// What is known of a device without making use of it.
struct PhysicalDevice {
    VkPhysicalDevice handle;
    std::string name, uuid; // the latter 32 hexadecimal digits
    VkPhysicalDeviceProperties properties;
    std::uint32_t queue_family; // one that computes; VK_QUEUE_FAMILY_IGNORED: it has none
    std::uint32_t timestamp_bits;
    bool imports_host_memory;
    VkDeviceSize import_alignment; // bytes
};

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
    void add_messenger();

    arhost::Host host_;
    std::unique_ptr<void, CloseLibrary> library_;
    PFN_vkGetInstanceProcAddr get_ = nullptr;
    VkInstance instance_ = VK_NULL_HANDLE;
    VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
    InstanceFunctions functions_{};
};

// The one that `wanted` names: its number in the list, its UUID, or a part of its name; "auto": the fastest kind.
const PhysicalDevice &choose_device(const std::vector<PhysicalDevice> &devices, const std::string &wanted);

// Throws what `result` means, naming what was tried.
void check(VkResult result, const char *what);

} // namespace rt_vulkan
