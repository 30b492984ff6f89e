// SPDX-License-Identifier: Apache-2.0
//
// A Vulkan layer that injects failures. The environment variable ARHOST_TEST_VULKAN_FAILS selects the failure. The
// layer reads it at each call that can fail; N counts the calls on one device, from 1:
//   submit:N    The Nth vkQueueSubmit reports that the device is lost, without submitting the work.
//   wait:N      The Nth vkWaitForFences waits for the work and then reports that the device is lost.
//   slow        The first three vkWaitForFences last until their timeouts.
//   allocate:N  The Nth and all later calls of vkAllocateMemory report that the device is out of memory.
//   pipelines:N The Nth and all later calls that create a ray tracing pipeline fail.
//   device-with:EXTENSION  vkCreateDevice fails if it enables EXTENSION.
//   lacks:FUNCTION  vkGetDeviceProcAddr returns NULL for FUNCTION.
//
// Two more variables change what the devices report about themselves:
//   ARHOST_TEST_VULKAN_IS_A_GPU=query     All devices are discrete GPUs that do not support the path "pipeline".
//   ARHOST_TEST_VULKAN_IS_A_GPU=pipeline  All devices are discrete GPUs.
//   ARHOST_TEST_VULKAN_IS_OLD=all         All devices support only Vulkan 1.0.
//   ARHOST_TEST_VULKAN_IS_OLD=first       The device that is queried first supports only Vulkan 1.0.
#include <vulkan/vk_layer.h>

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <string>
#include <thread>

namespace {

struct NextInstance {
    VkInstance handle;
    PFN_vkGetInstanceProcAddr get;
    // Functions of the next layer. They are looked up when the instance is created, because a later look-up may
    // return the functions of the topmost layer.
    PFN_vkDestroyInstance destroy;
    PFN_vkGetPhysicalDeviceProperties2 get_properties;
    PFN_vkEnumerateDeviceExtensionProperties list_extensions;
    VkPhysicalDevice first_queried = VK_NULL_HANDLE;
};
struct NextDevice {
    VkDevice handle;
    PFN_vkGetDeviceProcAddr get;
    std::uint64_t submits = 0, waits = 0, slow_waits = 0, allocations = 0, pipelines = 0;
    bool lost = false;
};

std::mutex mutex;
std::map<void *, NextInstance>
    instances; // the key is the first word of each handle, which is the same for all handles of an instance
std::map<void *, NextDevice> devices;

void *key_of(const void *handle) {
    return *static_cast<void *const *>(handle);
}

NextInstance instance_of(VkPhysicalDevice physical) {
    const std::lock_guard lock(mutex);
    return instances.at(key_of(physical));
}

template <class Function> Function next(VkInstance instance, PFN_vkGetInstanceProcAddr get, const char *name) {
    return reinterpret_cast<Function>(get(instance, name));
}
template <class Function> Function next(const NextDevice &device, const char *name) {
    return reinterpret_cast<Function>(device.get(device.handle, name));
}

// Whether the call number `count` of the kind `what` must fail, according to ARHOST_TEST_VULKAN_FAILS.
bool fails(const char *what, std::uint64_t count) {
    const char *failure = std::getenv("ARHOST_TEST_VULKAN_FAILS");
    const std::string prefix = std::string(what) + ":";
    return failure && !std::strncmp(failure, prefix.c_str(), prefix.size()) &&
           count >= std::strtoull(failure + prefix.size(), nullptr, 10);
}

bool fails_with(const char *extension) {
    const char *failure = std::getenv("ARHOST_TEST_VULKAN_FAILS");
    return failure && failure == std::string("device-with:") + extension;
}

// Finds the structure in the create info's chain in which the loader passes the link to the next layer or the driver.
template <class Link> Link *link_of(const void *chain, VkStructureType type) {
    for (auto *info = static_cast<const Link *>(chain); info; info = static_cast<const Link *>(info->pNext))
        if (info->sType == type && info->function == VK_LAYER_LINK_INFO)
            return const_cast<Link *>(info); // mutable, because each layer must advance the link
    return nullptr;
}

VKAPI_ATTR VkResult VKAPI_CALL create_instance(const VkInstanceCreateInfo *info,
                                               const VkAllocationCallbacks *allocator, VkInstance *instance) {
    auto *link = link_of<VkLayerInstanceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
    if (!link)
        return VK_ERROR_INITIALIZATION_FAILED;
    const PFN_vkGetInstanceProcAddr get = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const VkResult result =
        next<PFN_vkCreateInstance>(VK_NULL_HANDLE, get, "vkCreateInstance")(info, allocator, instance);
    if (result == VK_SUCCESS) {
        const std::lock_guard lock(mutex);
        const auto load = [&](const char *name) { return get(*instance, name); };
        instances[key_of(*instance)] = {
            *instance, get, reinterpret_cast<PFN_vkDestroyInstance>(load("vkDestroyInstance")),
            reinterpret_cast<PFN_vkGetPhysicalDeviceProperties2>(load("vkGetPhysicalDeviceProperties2")),
            reinterpret_cast<PFN_vkEnumerateDeviceExtensionProperties>(load("vkEnumerateDeviceExtensionProperties"))};
    }
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroy_instance(VkInstance instance, const VkAllocationCallbacks *allocator) {
    if (!instance)
        return;
    std::unique_lock lock(mutex);
    const auto known = instances.extract(key_of(instance));
    lock.unlock();
    known.mapped().destroy(instance, allocator);
}

VKAPI_ATTR VkResult VKAPI_CALL create_device(VkPhysicalDevice physical, const VkDeviceCreateInfo *info,
                                             const VkAllocationCallbacks *allocator, VkDevice *device) {
    auto *link = link_of<VkLayerDeviceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
    if (!link)
        return VK_ERROR_INITIALIZATION_FAILED;
    const VkLayerDeviceLink down = *link->u.pLayerInfo;
    link->u.pLayerInfo = down.pNext;
    for (std::uint32_t i = 0; i < info->enabledExtensionCount; ++i)
        if (fails_with(info->ppEnabledExtensionNames[i]))
            return VK_ERROR_INITIALIZATION_FAILED;
    const VkResult result = next<PFN_vkCreateDevice>(instance_of(physical).handle, down.pfnNextGetInstanceProcAddr,
                                                     "vkCreateDevice")(physical, info, allocator, device);
    const std::lock_guard lock(mutex);
    if (result == VK_SUCCESS)
        devices[key_of(*device)] = {*device, down.pfnNextGetDeviceProcAddr};
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroy_device(VkDevice device, const VkAllocationCallbacks *allocator) {
    if (!device)
        return;
    std::unique_lock lock(mutex);
    const auto known = devices.extract(key_of(device));
    lock.unlock();
    next<PFN_vkDestroyDevice>(known.mapped(), "vkDestroyDevice")(device, allocator);
}

VKAPI_ATTR VkResult VKAPI_CALL queue_submit(VkQueue queue, std::uint32_t count, const VkSubmitInfo *submits,
                                            VkFence fence) {
    const std::lock_guard lock(mutex);
    NextDevice &device = devices.at(key_of(queue));
    device.lost = device.lost || fails("submit", ++device.submits);
    return device.lost ? VK_ERROR_DEVICE_LOST
                       : next<PFN_vkQueueSubmit>(device, "vkQueueSubmit")(queue, count, submits, fence);
}

VKAPI_ATTR VkResult VKAPI_CALL wait_for_fences(VkDevice handle, std::uint32_t count, const VkFence *fences,
                                               VkBool32 all, std::uint64_t timeout_ns) {
    const std::lock_guard lock(mutex);
    NextDevice &device = devices.at(key_of(handle));
    if (device.lost)
        return VK_ERROR_DEVICE_LOST;
    const char *failure = std::getenv("ARHOST_TEST_VULKAN_FAILS");
    if (failure && !std::strcmp(failure, "slow") && timeout_ns != UINT64_MAX && ++device.slow_waits <= 3) {
        std::this_thread::sleep_for(std::chrono::nanoseconds(timeout_ns));
        return VK_TIMEOUT;
    }
    // Only simulates the loss, so the device continues to work. Waits for it, so that the caller does not destroy
    // objects in use.
    const VkResult result =
        next<PFN_vkWaitForFences>(device, "vkWaitForFences")(handle, count, fences, all, timeout_ns);
    device.lost = fails("wait", ++device.waits);
    return device.lost ? VK_ERROR_DEVICE_LOST : result;
}

VKAPI_ATTR VkResult VKAPI_CALL allocate_memory(VkDevice handle, const VkMemoryAllocateInfo *info,
                                               const VkAllocationCallbacks *allocator, VkDeviceMemory *memory) {
    const std::lock_guard lock(mutex);
    NextDevice &device = devices.at(key_of(handle));
    return fails("allocate", ++device.allocations)
               ? VK_ERROR_OUT_OF_DEVICE_MEMORY
               : next<PFN_vkAllocateMemory>(device, "vkAllocateMemory")(handle, info, allocator, memory);
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL get_device_function(VkDevice device, const char *name);
VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL get_instance_function(VkInstance instance, const char *name);

VKAPI_ATTR VkResult VKAPI_CALL create_pipelines(VkDevice handle, VkDeferredOperationKHR operation,
                                                VkPipelineCache cache, std::uint32_t count,
                                                const VkRayTracingPipelineCreateInfoKHR *infos,
                                                const VkAllocationCallbacks *allocator, VkPipeline *pipelines) {
    const std::lock_guard lock(mutex);
    NextDevice &device = devices.at(key_of(handle));
    return fails("pipelines", ++device.pipelines)
               ? VK_ERROR_INITIALIZATION_FAILED
               : next<PFN_vkCreateRayTracingPipelinesKHR>(device, "vkCreateRayTracingPipelinesKHR")(
                     handle, operation, cache, count, infos, allocator, pipelines);
}

VKAPI_ATTR void VKAPI_CALL get_properties(VkPhysicalDevice physical, VkPhysicalDeviceProperties2 *properties) {
    instance_of(physical).get_properties(physical, properties);
    if (std::getenv("ARHOST_TEST_VULKAN_IS_A_GPU"))
        properties->properties.deviceType = VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU;
    const std::lock_guard lock(mutex);
    VkPhysicalDevice &first_queried = instances.at(key_of(physical)).first_queried;
    if (!first_queried)
        first_queried = physical;
    const char *old = std::getenv("ARHOST_TEST_VULKAN_IS_OLD");
    if (old && (first_queried == physical || !std::strcmp(old, "all")))
        properties->properties.apiVersion = VK_API_VERSION_1_0;
}

VKAPI_ATTR VkResult VKAPI_CALL list_extensions(VkPhysicalDevice physical, const char *layer, std::uint32_t *count,
                                               VkExtensionProperties *extensions) {
    const VkResult result = instance_of(physical).list_extensions(physical, layer, count, extensions);
    const char *last_path = std::getenv("ARHOST_TEST_VULKAN_IS_A_GPU");
    for (std::uint32_t i = 0; extensions && i < *count && last_path && !std::strcmp(last_path, "query"); ++i)
        if (!std::strcmp(extensions[i].extensionName, VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
            std::strcpy(extensions[i].extensionName, "VK_ARHOST_hidden");
    return result;
}

VKAPI_ATTR void VKAPI_CALL trace_rays(VkCommandBuffer commands, const VkStridedDeviceAddressRegionKHR *generate,
                                      const VkStridedDeviceAddressRegionKHR *miss,
                                      const VkStridedDeviceAddressRegionKHR *hit,
                                      const VkStridedDeviceAddressRegionKHR *callable, std::uint32_t width,
                                      std::uint32_t height, std::uint32_t depth) {
    const char *failure = std::getenv("ARHOST_TEST_VULKAN_FAILS");
    if (failure && !std::strcmp(failure, "no-picture"))
        return;
    const std::lock_guard lock(mutex);
    next<PFN_vkCmdTraceRaysKHR>(devices.at(key_of(commands)), "vkCmdTraceRaysKHR")(commands, generate, miss, hit,
                                                                                   callable, width, height, depth);
}

PFN_vkVoidFunction intercepted(const char *name, bool of_instance) {
    const struct {
        const char *name;
        PFN_vkVoidFunction function;
        bool of_instance;
    } all[] = {
        {"vkGetInstanceProcAddr", reinterpret_cast<PFN_vkVoidFunction>(get_instance_function), true},
        {"vkCreateInstance", reinterpret_cast<PFN_vkVoidFunction>(create_instance), true},
        {"vkDestroyInstance", reinterpret_cast<PFN_vkVoidFunction>(destroy_instance), true},
        {"vkCreateDevice", reinterpret_cast<PFN_vkVoidFunction>(create_device), true},
        {"vkGetPhysicalDeviceProperties2", reinterpret_cast<PFN_vkVoidFunction>(get_properties), true},
        {"vkEnumerateDeviceExtensionProperties", reinterpret_cast<PFN_vkVoidFunction>(list_extensions), true},
        {"vkCreateRayTracingPipelinesKHR", reinterpret_cast<PFN_vkVoidFunction>(create_pipelines), false},
        {"vkGetDeviceProcAddr", reinterpret_cast<PFN_vkVoidFunction>(get_device_function), false},
        {"vkDestroyDevice", reinterpret_cast<PFN_vkVoidFunction>(destroy_device), false},
        {"vkQueueSubmit", reinterpret_cast<PFN_vkVoidFunction>(queue_submit), false},
        {"vkWaitForFences", reinterpret_cast<PFN_vkVoidFunction>(wait_for_fences), false},
        {"vkCmdTraceRaysKHR", reinterpret_cast<PFN_vkVoidFunction>(trace_rays), false},
        {"vkAllocateMemory", reinterpret_cast<PFN_vkVoidFunction>(allocate_memory), false},
    };
    for (const auto &one : all)
        if ((of_instance || !one.of_instance) && !std::strcmp(one.name, name))
            return one.function;
    return nullptr;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL get_device_function(VkDevice device, const char *name) {
    const char *failure = std::getenv("ARHOST_TEST_VULKAN_FAILS");
    if (failure && failure == std::string("lacks:") + name)
        return nullptr;
    if (const PFN_vkVoidFunction function = intercepted(name, false))
        return function;
    const std::lock_guard lock(mutex);
    return devices.at(key_of(device)).get(device, name);
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL get_instance_function(VkInstance instance, const char *name) {
    if (const PFN_vkVoidFunction function = intercepted(name, true))
        return function;
    if (!instance)
        return nullptr;
    const std::lock_guard lock(mutex);
    return instances.at(key_of(instance)).get(instance, name);
}

} // namespace

extern "C" VK_LAYER_EXPORT VKAPI_ATTR VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface *interface) {
    if (interface->sType != LAYER_NEGOTIATE_INTERFACE_STRUCT || interface->loaderLayerInterfaceVersion < 2)
        return VK_ERROR_INITIALIZATION_FAILED;
    interface->loaderLayerInterfaceVersion = 2;
    interface->pfnGetInstanceProcAddr = get_instance_function;
    interface->pfnGetDeviceProcAddr = get_device_function;
    interface->pfnGetPhysicalDeviceProcAddr = nullptr;
    return VK_SUCCESS;
}
