// SPDX-License-Identifier: Apache-2.0
//
// A logical device with one queue, and RAII wrappers of the device's handles.
#pragma once

#include "instance.hpp"

#include <cstddef>
#include <functional>
#include <span>
#include <utility>

namespace rt_vulkan {

class Device {
public:
    // Enables the extensions that `path` needs. The Instance that listed `physical` must outlive this object.
    explicit Device(const PhysicalDevice &physical, Path path = Path::plain);
    ~Device();
    Device(const Device &) = delete;
    Device &operator=(const Device &) = delete;

    VkDevice handle() const { return device_; }
    VkQueue queue() const { return queue_; }
    const VolkDeviceTable &functions() const { return functions_; }
    const PhysicalDevice &physical() const { return physical_; }
    // Returns the indices of the memory types that are in the bit mask `allowed` and have all of the `required`
    // properties. Types that also have the `preferred` properties come first.
    std::vector<std::uint32_t> memory_types(std::uint32_t allowed, VkMemoryPropertyFlags required,
                                            VkMemoryPropertyFlags preferred) const;

private:
    PhysicalDevice physical_;
    VkPhysicalDeviceMemoryProperties memory_{};
    VkDevice device_ = VK_NULL_HANDLE;
    VkQueue queue_ = VK_NULL_HANDLE;
    VolkDeviceTable functions_{};
};

// Owns a handle that belongs to a device. The device must outlive this object. `destroy`: the member of
// VolkDeviceTable that destroys the handle.
template <class Handle, auto destroy> class Unique {
public:
    Unique() = default;
    Unique(const Device &device, Handle handle) : device_(&device), handle_(handle) {}
    // Creates the handle with `create`, which is a vkCreate… function. `what` names the operation in error messages.
    template <class Create, class Info>
    Unique(const Device &device, Create create, const Info &info, const char *what) : device_(&device) {
        check(create(device.handle(), &info, nullptr, &handle_), what);
    }
    Unique(Unique &&other) noexcept
        : device_(other.device_), handle_(std::exchange(other.handle_, Handle{VK_NULL_HANDLE})) {}
    Unique &operator=(Unique &&other) noexcept {
        std::swap(device_, other.device_);
        std::swap(handle_, other.handle_);
        return *this;
    }
    ~Unique() {
        if (handle_)
            (device_->functions().*destroy)(device_->handle(), handle_, nullptr);
    }
    Handle get() const { return handle_; }

private:
    const Device *device_ = nullptr;
    Handle handle_ = VK_NULL_HANDLE;
};

using Memory = Unique<VkDeviceMemory, &VolkDeviceTable::vkFreeMemory>;
using Fence = Unique<VkFence, &VolkDeviceTable::vkDestroyFence>;
using QueryPool = Unique<VkQueryPool, &VolkDeviceTable::vkDestroyQueryPool>;
using CommandPool = Unique<VkCommandPool, &VolkDeviceTable::vkDestroyCommandPool>;
using DescriptorSetLayout = Unique<VkDescriptorSetLayout, &VolkDeviceTable::vkDestroyDescriptorSetLayout>;
using DescriptorPool = Unique<VkDescriptorPool, &VolkDeviceTable::vkDestroyDescriptorPool>;
using PipelineLayout = Unique<VkPipelineLayout, &VolkDeviceTable::vkDestroyPipelineLayout>;
using ShaderModule = Unique<VkShaderModule, &VolkDeviceTable::vkDestroyShaderModule>;
using PipelineCache = Unique<VkPipelineCache, &VolkDeviceTable::vkDestroyPipelineCache>;
using Pipeline = Unique<VkPipeline, &VolkDeviceTable::vkDestroyPipeline>;
using AccelerationStructure = Unique<VkAccelerationStructureKHR, &VolkDeviceTable::vkDestroyAccelerationStructureKHR>;

// Rounds `size` up to a multiple of `alignment`. An alignment of 0 means that none is required.
inline VkDeviceSize aligned(VkDeviceSize size, VkDeviceSize alignment) {
    return alignment ? (size + alignment - 1) / alignment * alignment : size;
}

// A Vulkan buffer and its memory.
class Buffer {
public:
    enum class Place {
        device,       // not mapped; fastest for the device
        host_written, // mapped; the host writes, the device reads repeatedly
        staging,      // mapped; the host writes, the device copies from it
        host_read     // mapped; the device writes, the host reads
    };
    Buffer() = default;
    Buffer(const Device &device, VkDeviceSize size, VkBufferUsageFlags usage, Place place);
    // Returns a buffer in the given host memory, for use as a copy destination. If the device cannot import that
    // memory, returns an empty buffer.
    static Buffer imported(const Device &device, void *memory, VkDeviceSize size);

    VkBuffer get() const { return buffer_.get(); }
    VkDeviceSize size() const { return size_; }
    // Valid only if the buffer has VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT.
    VkDeviceAddress address() const { return address_; }
    explicit operator bool() const { return memory_.get() != VK_NULL_HANDLE; }
    std::span<std::byte> mapped() const { return {mapped_, static_cast<std::size_t>(size_)}; }

private:
    // The order of these two members matters: the buffer must be destroyed before its memory.
    Memory memory_;
    Unique<VkBuffer, &VolkDeviceTable::vkDestroyBuffer> buffer_;
    VkDeviceSize size_ = 0; // bytes
    VkDeviceAddress address_ = 0;
    std::byte *mapped_ = nullptr;
};

// Records command buffers, submits them and waits for completion.
class Submission {
public:
    explicit Submission(const Device &device);
    VkCommandBuffer new_commands() const;
    void free(VkCommandBuffer commands) const;
    void begin(VkCommandBuffer commands, VkCommandBufferUsageFlags flags = 0) const;
    void end(VkCommandBuffer commands) const;
    // Calls `waiting` every 100 ms until the work is complete.
    void run(
        std::span<const VkCommandBuffer> commands, const std::function<void()> &waiting = [] {}) const;
    void run(VkCommandBuffer commands) const { run({&commands, 1}); }

private:
    const Device &device_;
    CommandPool pool_;
    Fence fence_;
};

// Inserts a barrier: accesses `used` in stage `to` see the writes `written` in stage `from`.
void barrier(const VolkDeviceTable &vk, VkCommandBuffer commands, VkPipelineStageFlags from, VkAccessFlags written,
             VkPipelineStageFlags to, VkAccessFlags used);

// Concatenates `parts` and copies them to a device buffer via a staging buffer.
void upload(const Device &device, const Submission &submission, const Buffer &to,
            std::span<const std::span<const std::byte>> parts);

} // namespace rt_vulkan
