// SPDX-License-Identifier: Apache-2.0
#include "device.hpp"

#include <algorithm>
#include <cstring>

namespace rt_vulkan {
namespace {

using arhost::Failure;

constexpr VkMemoryPropertyFlags mappable = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;

// Of the first of `types` that has so much left: what is both the device's own and mapped can be little.
Memory allocated(const Device &device, VkDeviceSize size, std::span<const std::uint32_t> types, const void *next) {
    VkMemoryAllocateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
    info.pNext = next;
    info.allocationSize = size;
    VkResult result = VK_ERROR_OUT_OF_DEVICE_MEMORY;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    for (std::size_t i = 0; i < types.size() && result == VK_ERROR_OUT_OF_DEVICE_MEMORY; ++i) {
        info.memoryTypeIndex = types[i];
        result = device.functions().vkAllocateMemory(device.handle(), &info, nullptr, &memory);
    }
    check(result, "allocating GPU memory");
    return {device, memory};
}

} // namespace

Device::Device(const Instance &instance, const PhysicalDevice &physical, Path path) : physical_(physical) {
    const InstanceFunctions &from = instance.functions();
    from.vkGetPhysicalDeviceMemoryProperties(physical.handle, &memory_);
    const float priority = 1;
    VkDeviceQueueCreateInfo queue{};
    queue.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO;
    queue.queueFamilyIndex = physical.queue_family;
    queue.queueCount = 1;
    queue.pQueuePriorities = &priority;
    std::vector<const char *> extensions;
    if (physical.imports_host_memory)
        extensions.push_back(VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME);
    VkPhysicalDeviceRayTracingPipelineFeaturesKHR pipeline{};
    pipeline.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR;
    pipeline.rayTracingPipeline = VK_TRUE;
    VkPhysicalDeviceRayQueryFeaturesKHR query{};
    query.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR;
    query.rayQuery = VK_TRUE;
    VkPhysicalDeviceAccelerationStructureFeaturesKHR trees{};
    trees.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR;
    trees.accelerationStructure = VK_TRUE;
    VkPhysicalDeviceBufferDeviceAddressFeatures addresses{};
    addresses.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES;
    addresses.pNext = &trees;
    addresses.bufferDeviceAddress = VK_TRUE;
    VkDeviceCreateInfo info{};
    if (path != Path::plain) {
        extensions.push_back(VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME);
        extensions.push_back(VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME);
        extensions.push_back(path == Path::query ? VK_KHR_RAY_QUERY_EXTENSION_NAME
                                                 : VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME);
        trees.pNext = path == Path::query ? static_cast<void *>(&query) : &pipeline;
        info.pNext = &addresses;
    }
    info.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
    info.queueCreateInfoCount = 1;
    info.pQueueCreateInfos = &queue;
    info.enabledExtensionCount = static_cast<std::uint32_t>(extensions.size());
    info.ppEnabledExtensionNames = extensions.data();
    check(from.vkCreateDevice(physical.handle, &info, nullptr, &device_), "opening the Vulkan device");
    const auto refuse = [&](const char *name) {
        if (functions_.vkDestroyDevice)
            functions_.vkDestroyDevice(device_, nullptr);
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      "the driver of the Vulkan device '" + physical.name + "' lacks " + name + "; install it again");
    };
    const auto load = [&](const char *name) { return from.vkGetDeviceProcAddr(device_, name); };
#define RT_VULKAN_LOAD(name)                                                                                         \
    functions_.name = reinterpret_cast<PFN_##name>(load(#name));                                                     \
    if (!functions_.name)                                                                                            \
        refuse(#name);
    RT_VULKAN_DEVICE_FUNCTIONS(RT_VULKAN_LOAD)
    if (path != Path::plain) {
        RT_VULKAN_TRACING_FUNCTIONS(RT_VULKAN_LOAD)
    }
    if (path == Path::pipeline) {
        RT_VULKAN_PIPELINE_FUNCTIONS(RT_VULKAN_LOAD)
    }
    if (physical.imports_host_memory) {
        RT_VULKAN_LOAD(vkGetMemoryHostPointerPropertiesEXT)
    }
#undef RT_VULKAN_LOAD
    functions_.vkGetDeviceQueue(device_, physical.queue_family, 0, &queue_);
}

Device::~Device() {
    functions_.vkDestroyDevice(device_, nullptr);
}

std::vector<std::uint32_t> Device::memory_types(std::uint32_t allowed, VkMemoryPropertyFlags needed,
                                                VkMemoryPropertyFlags wished) const {
    std::vector<std::uint32_t> types;
    for (const bool is_wished : {true, false})
        for (std::uint32_t type = 0; type < memory_.memoryTypeCount; ++type) {
            const VkMemoryPropertyFlags flags = memory_.memoryTypes[type].propertyFlags;
            if (allowed >> type & 1 && (flags & needed) == needed && ((flags & wished) == wished) == is_wished)
                types.push_back(type);
        }
    return types;
}

Buffer::Buffer(const Device &device, VkDeviceSize size, VkBufferUsageFlags usage, Place place) : size_(size) {
    VkBufferCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
    info.size = size;
    info.usage = usage;
    const DeviceFunctions &vk = device.functions();
    buffer_ = make<decltype(buffer_), VkBuffer>(device, vk.vkCreateBuffer, info, "making a GPU buffer");
    VkMemoryRequirements needs;
    vk.vkGetBufferMemoryRequirements(device.handle(), get(), &needs);
    const VkMemoryPropertyFlags wished = place == Place::staging     ? 0
                                         : place == Place::host_read ? VK_MEMORY_PROPERTY_HOST_CACHED_BIT
                                                                     : VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
    // Of several the first has the fewest properties besides: to stage, none of the device's own.
    const std::vector<std::uint32_t> types =
        device.memory_types(needs.memoryTypeBits, place == Place::device ? 0 : mappable, wished);
    if (types.empty())
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "the Vulkan device '" + device.physical().name +
                                                           "' has no memory that the host can write; choose another");
    const bool has_address = usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
    VkMemoryAllocateFlagsInfo flags{};
    flags.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO;
    flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
    // What is to be the device's own would be slow elsewhere, and no one knew.
    const std::size_t tried = place == Place::device ? 1 : types.size();
    memory_ = allocated(device, needs.size, std::span(types).first(tried), has_address ? &flags : nullptr);
    check(vk.vkBindBufferMemory(device.handle(), get(), memory_.get(), 0), "binding GPU memory");
    if (has_address) {
        VkBufferDeviceAddressInfo which{};
        which.sType = VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO;
        which.buffer = get();
        address_ = vk.vkGetBufferDeviceAddress(device.handle(), &which);
    }
    if (place != Place::device) {
        void *mapped = nullptr;
        check(vk.vkMapMemory(device.handle(), memory_.get(), 0, VK_WHOLE_SIZE, 0, &mapped), "mapping GPU memory");
        mapped_ = static_cast<std::byte *>(mapped);
    }
}

Buffer Buffer::imported(const Device &device, void *memory, VkDeviceSize size) {
    constexpr auto kind = VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT;
    constexpr VkDeviceSize page = 4096; // of what is mapped behind the image (arhost/raytracer.h)
    const DeviceFunctions &vk = device.functions();
    const VkDeviceSize alignment = device.physical().import_alignment;
    if (!vk.vkGetMemoryHostPointerPropertiesEXT || alignment > page ||
        reinterpret_cast<std::uintptr_t>(memory) % page)
        return {};
    VkMemoryHostPointerPropertiesEXT properties{};
    properties.sType = VK_STRUCTURE_TYPE_MEMORY_HOST_POINTER_PROPERTIES_EXT;
    if (vk.vkGetMemoryHostPointerPropertiesEXT(device.handle(), kind, memory, &properties) != VK_SUCCESS)
        return {};
    VkExternalMemoryBufferCreateInfo external{};
    external.sType = VK_STRUCTURE_TYPE_EXTERNAL_MEMORY_BUFFER_CREATE_INFO;
    external.handleTypes = kind;
    VkBufferCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
    info.pNext = &external;
    info.size = (size + page - 1) / page * page;
    info.usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    Buffer buffer;
    buffer.size_ = size;
    buffer.buffer_ = make<decltype(buffer_), VkBuffer>(device, vk.vkCreateBuffer, info, "making a GPU buffer");
    VkMemoryRequirements needs;
    vk.vkGetBufferMemoryRequirements(device.handle(), buffer.get(), &needs);
    const std::vector<std::uint32_t> types = device.memory_types(needs.memoryTypeBits & properties.memoryTypeBits,
                                                                 mappable, VK_MEMORY_PROPERTY_HOST_CACHED_BIT);
    if (types.empty() || needs.size > info.size)
        return {};
    VkImportMemoryHostPointerInfoEXT import{};
    import.sType = VK_STRUCTURE_TYPE_IMPORT_MEMORY_HOST_POINTER_INFO_EXT;
    import.handleType = kind;
    import.pHostPointer = memory;
    VkMemoryAllocateInfo allocation{};
    allocation.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
    allocation.pNext = &import;
    allocation.allocationSize = info.size;
    allocation.memoryTypeIndex = types[0];
    VkDeviceMemory handle = VK_NULL_HANDLE;
    // A driver may refuse memory of some kinds.
    if (vk.vkAllocateMemory(device.handle(), &allocation, nullptr, &handle) != VK_SUCCESS)
        return {};
    buffer.memory_ = Memory(device, handle);
    check(vk.vkBindBufferMemory(device.handle(), buffer.get(), handle, 0), "binding the image's memory");
    return buffer;
}

Submission::Submission(const Device &device) : device_(device) {
    VkCommandPoolCreateInfo pool{};
    pool.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
    pool.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
    pool.queueFamilyIndex = device.physical().queue_family;
    pool_ = make<CommandPool, VkCommandPool>(device, device.functions().vkCreateCommandPool, pool,
                                             "making a pool of GPU commands");
    VkFenceCreateInfo fence{};
    fence.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
    fence_ = make<Fence, VkFence>(device, device.functions().vkCreateFence, fence, "making a fence");
}

VkCommandBuffer Submission::new_commands() const {
    VkCommandBufferAllocateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
    info.commandPool = pool_.get();
    info.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
    info.commandBufferCount = 1;
    VkCommandBuffer commands = VK_NULL_HANDLE;
    check(device_.functions().vkAllocateCommandBuffers(device_.handle(), &info, &commands), "making GPU commands");
    return commands;
}

void Submission::free(VkCommandBuffer commands) const {
    device_.functions().vkFreeCommandBuffers(device_.handle(), pool_.get(), 1, &commands);
}

void Submission::begin(VkCommandBuffer commands, VkCommandBufferUsageFlags flags) const {
    VkCommandBufferBeginInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    info.flags = flags;
    check(device_.functions().vkBeginCommandBuffer(commands, &info), "recording GPU commands");
}

void Submission::end(VkCommandBuffer commands) const {
    check(device_.functions().vkEndCommandBuffer(commands), "recording GPU commands");
}

void Submission::run(std::span<const VkCommandBuffer> commands) const {
    const DeviceFunctions &vk = device_.functions();
    const VkFence fence = fence_.get();
    check(vk.vkResetFences(device_.handle(), 1, &fence), "resetting a fence");
    VkSubmitInfo info{};
    info.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
    info.commandBufferCount = static_cast<std::uint32_t>(commands.size());
    info.pCommandBuffers = commands.data();
    check(vk.vkQueueSubmit(device_.queue(), 1, &info, fence), "starting the GPU's work");
    const VkResult waited = vk.vkWaitForFences(device_.handle(), 1, &fence, VK_TRUE, UINT64_MAX);
    if (waited != VK_SUCCESS)
        vk.vkDeviceWaitIdle(device_.handle()); // what is under way makes use of what ends now
    check(waited, "waiting for the GPU");
}

void barrier(const DeviceFunctions &vk, VkCommandBuffer commands, VkPipelineStageFlags from, VkAccessFlags written,
             VkPipelineStageFlags to, VkAccessFlags used) {
    VkMemoryBarrier memory{};
    memory.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
    memory.srcAccessMask = written;
    memory.dstAccessMask = used;
    vk.vkCmdPipelineBarrier(commands, from, to, 0, 1, &memory, 0, nullptr, 0, nullptr);
}

void upload(const Device &device, const Submission &submission, const Buffer &to,
            std::span<const std::span<const std::byte>> parts) {
    constexpr std::size_t most = std::size_t{16} << 20;
    std::size_t total = 0;
    for (const auto &part : parts)
        total += part.size();
    if (total == 0)
        return;
    const Buffer staging(device, std::min(total, most), VK_BUFFER_USAGE_TRANSFER_SRC_BIT, Buffer::Place::staging);
    const VkCommandBuffer commands = submission.new_commands();
    std::size_t filled = 0, written = 0;
    const auto flush = [&] {
        submission.begin(commands, VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT);
        const VkBufferCopy copy{0, written, filled};
        device.functions().vkCmdCopyBuffer(commands, staging.get(), to.get(), 1, &copy);
        submission.end(commands);
        submission.run(commands);
        written += filled;
        filled = 0;
    };
    for (auto part : parts)
        while (!part.empty()) {
            const std::size_t count = std::min(part.size(), staging.mapped().size() - filled);
            std::memcpy(staging.mapped().data() + filled, part.data(), count);
            part = part.subspan(count);
            filled += count;
            if (filled == staging.mapped().size())
                flush();
        }
    if (filled)
        flush();
    submission.free(commands);
}

} // namespace rt_vulkan
