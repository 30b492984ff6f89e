// SPDX-License-Identifier: Apache-2.0
//
// A logical device with one queue, and what is made of it: buffers and the other handles that end themselves.
#pragma once

#include "instance.hpp"

#include <cstddef>
#include <span>
#include <utility>

namespace rt_vulkan {

// clang-format off
#define RT_VULKAN_DEVICE_FUNCTIONS(use) \
    use(vkDestroyDevice) use(vkGetDeviceQueue) use(vkDeviceWaitIdle) use(vkQueueSubmit) use(vkCreateBuffer) \
    use(vkDestroyBuffer) use(vkGetBufferMemoryRequirements) use(vkAllocateMemory) use(vkFreeMemory) \
    use(vkBindBufferMemory) use(vkMapMemory) use(vkCreateDescriptorSetLayout) \
    use(vkDestroyDescriptorSetLayout) use(vkCreateDescriptorPool) use(vkDestroyDescriptorPool) \
    use(vkAllocateDescriptorSets) use(vkUpdateDescriptorSets) use(vkCreatePipelineLayout) \
    use(vkDestroyPipelineLayout) use(vkCreateShaderModule) use(vkDestroyShaderModule) \
    use(vkCreatePipelineCache) use(vkDestroyPipelineCache) use(vkGetPipelineCacheData) \
    use(vkCreateComputePipelines) use(vkDestroyPipeline) use(vkCreateCommandPool) use(vkDestroyCommandPool) \
    use(vkAllocateCommandBuffers) use(vkFreeCommandBuffers) use(vkBeginCommandBuffer) \
    use(vkEndCommandBuffer) use(vkCmdBindPipeline) use(vkCmdBindDescriptorSets) use(vkCmdDispatch) \
    use(vkCmdPushConstants) use(vkCmdCopyBuffer) use(vkCmdUpdateBuffer) use(vkCmdPipelineBarrier) \
    use(vkCmdResetQueryPool) use(vkCmdWriteTimestamp) use(vkCreateQueryPool) use(vkDestroyQueryPool) \
    use(vkGetQueryPoolResults) use(vkCreateFence) use(vkDestroyFence) use(vkWaitForFences) \
    use(vkResetFences)

// Of the paths by the device's own trees; NULL on the plain one.
#define RT_VULKAN_TRACING_FUNCTIONS(use) \
    use(vkGetBufferDeviceAddress) use(vkCreateAccelerationStructureKHR) \
    use(vkDestroyAccelerationStructureKHR) use(vkGetAccelerationStructureBuildSizesKHR) \
    use(vkGetAccelerationStructureDeviceAddressKHR) use(vkCmdBuildAccelerationStructuresKHR) \
    use(vkCmdCopyAccelerationStructureKHR) use(vkCmdWriteAccelerationStructuresPropertiesKHR)

// Of the pipeline path; NULL on the others.
#define RT_VULKAN_PIPELINE_FUNCTIONS(use) \
    use(vkCreateRayTracingPipelinesKHR) use(vkGetRayTracingShaderGroupHandlesKHR) use(vkCmdTraceRaysKHR)
// clang-format on

struct DeviceFunctions {
    RT_VULKAN_DEVICE_FUNCTIONS(RT_VULKAN_DECLARE)
    RT_VULKAN_TRACING_FUNCTIONS(RT_VULKAN_DECLARE)
    RT_VULKAN_PIPELINE_FUNCTIONS(RT_VULKAN_DECLARE)
    PFN_vkGetMemoryHostPointerPropertiesEXT vkGetMemoryHostPointerPropertiesEXT; // NULL: it can't import
};

class Device {
public:
    // With what `path` needs.
    Device(const Instance &instance, const PhysicalDevice &physical, Path path = Path::plain);
    ~Device();
    Device(const Device &) = delete;
    Device &operator=(const Device &) = delete;

    VkDevice handle() const { return device_; }
    VkQueue queue() const { return queue_; }
    const DeviceFunctions &functions() const { return functions_; }
    const PhysicalDevice &physical() const { return physical_; }
    // Those in `allowed` that have all of `needed`, first those that have `wished`, too.
    std::vector<std::uint32_t> memory_types(std::uint32_t allowed, VkMemoryPropertyFlags needed,
                                            VkMemoryPropertyFlags wished) const;

private:
    PhysicalDevice physical_;
    VkPhysicalDeviceMemoryProperties memory_{};
    VkDevice device_ = VK_NULL_HANDLE;
    VkQueue queue_ = VK_NULL_HANDLE;
    DeviceFunctions functions_{};
};

// A handle that `Destroy` ends with the device.
template <class Handle, auto destroy> class Owned {
public:
    Owned() = default;
    Owned(const Device &device, Handle handle) : device_(&device), handle_(handle) {}
    Owned(Owned &&other) noexcept
        : device_(other.device_), handle_(std::exchange(other.handle_, Handle{VK_NULL_HANDLE})) {}
    Owned &operator=(Owned &&other) noexcept {
        std::swap(device_, other.device_);
        std::swap(handle_, other.handle_);
        return *this;
    }
    ~Owned() {
        if (handle_)
            (device_->functions().*destroy)(device_->handle(), handle_, nullptr);
    }
    Handle get() const { return handle_; }

private:
    const Device *device_ = nullptr;
    Handle handle_ = VK_NULL_HANDLE;
};

using Memory = Owned<VkDeviceMemory, &DeviceFunctions::vkFreeMemory>;
using Fence = Owned<VkFence, &DeviceFunctions::vkDestroyFence>;
using QueryPool = Owned<VkQueryPool, &DeviceFunctions::vkDestroyQueryPool>;
using CommandPool = Owned<VkCommandPool, &DeviceFunctions::vkDestroyCommandPool>;
using DescriptorSetLayout = Owned<VkDescriptorSetLayout, &DeviceFunctions::vkDestroyDescriptorSetLayout>;
using DescriptorPool = Owned<VkDescriptorPool, &DeviceFunctions::vkDestroyDescriptorPool>;
using PipelineLayout = Owned<VkPipelineLayout, &DeviceFunctions::vkDestroyPipelineLayout>;
using ShaderModule = Owned<VkShaderModule, &DeviceFunctions::vkDestroyShaderModule>;
using PipelineCache = Owned<VkPipelineCache, &DeviceFunctions::vkDestroyPipelineCache>;
using Pipeline = Owned<VkPipeline, &DeviceFunctions::vkDestroyPipeline>;
using AccelerationStructure = Owned<VkAccelerationStructureKHR, &DeviceFunctions::vkDestroyAccelerationStructureKHR>;

// Calls a vkCreate… and owns what it makes.
template <class Owner, class Handle, class Create, class Info>
Owner make(const Device &device, Create create, const Info &info, const char *what) {
    Handle handle = VK_NULL_HANDLE;
    check(create(device.handle(), &info, nullptr, &handle), what);
    return Owner(device, handle);
}

// The next multiple of `alignment`, where there is such a demand.
inline VkDeviceSize aligned(VkDeviceSize size, VkDeviceSize alignment) {
    return alignment ? (size + alignment - 1) / alignment * alignment : size;
}

// A buffer and its memory.
class Buffer {
public:
    enum class Place {
        device,       // fastest for the device
        host_written, // mapped, for what the host writes and the device reads again and again
        staging,      // mapped, for what the host writes and is copied from there
        host_read     // mapped, for what the device writes and the host reads
    };
    Buffer() = default;
    Buffer(const Device &device, VkDeviceSize size, VkBufferUsageFlags usage, Place place);
    // Memory of the host's as a buffer to copy to; empty where the device does not take it.
    static Buffer imported(const Device &device, void *memory, VkDeviceSize size);

    VkBuffer get() const { return buffer_.get(); }
    VkDeviceSize size() const { return size_; }
    // For the device, of one that was made with VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT.
    VkDeviceAddress address() const { return address_; }
    explicit operator bool() const { return memory_.get() != VK_NULL_HANDLE; }
    std::span<std::byte> mapped() const { return {mapped_, static_cast<std::size_t>(size_)}; }

private:
    // In this order: the buffer ends before its memory.
    Memory memory_;
    Owned<VkBuffer, &DeviceFunctions::vkDestroyBuffer> buffer_;
    VkDeviceSize size_ = 0; // bytes
    VkDeviceAddress address_ = 0;
    std::byte *mapped_ = nullptr;
};

// Records commands, runs them and waits for their end.
class Submission {
public:
    explicit Submission(const Device &device);
    VkCommandBuffer new_commands() const;
    void free(VkCommandBuffer commands) const;
    void begin(VkCommandBuffer commands, VkCommandBufferUsageFlags flags = 0) const;
    void end(VkCommandBuffer commands) const;
    void run(std::span<const VkCommandBuffer> commands) const;
    void run(VkCommandBuffer commands) const { run({&commands, 1}); }

private:
    const Device &device_;
    CommandPool pool_;
    Fence fence_;
};

// What is written by one step is there for another.
void barrier(const DeviceFunctions &vk, VkCommandBuffer commands, VkPipelineStageFlags from, VkAccessFlags written,
             VkPipelineStageFlags to, VkAccessFlags used);

// Writes parts, one behind the other, to a device buffer by way of a small one that the host can write.
void upload(const Device &device, const Submission &submission, const Buffer &to,
            std::span<const std::span<const std::byte>> parts);

} // namespace rt_vulkan
