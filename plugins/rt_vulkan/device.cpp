// SPDX-License-Identifier: Apache-2.0
#include "device.hpp"

#include <algorithm>
#include <cstring>

namespace rt_vulkan {
namespace {

using arhost::Failure;

constexpr VkMemoryPropertyFlags mappable = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;

// Allocates memory. Tries the memory types in order, because memory that is both device-local and mappable can be
// scarce.
Memory allocated(const Device &device, VkDeviceSize size, std::span<const std::uint32_t> types, const void *next) {
    VkMemoryAllocateInfo info{.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, .pNext = next, .allocationSize = size};
    VkResult result = VK_ERROR_OUT_OF_DEVICE_MEMORY;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    for (std::size_t i = 0; i < types.size() && result == VK_ERROR_OUT_OF_DEVICE_MEMORY; ++i) {
        info.memoryTypeIndex = types[i];
        result = device.functions().vkAllocateMemory(device.handle(), &info, nullptr, &memory);
    }
    check(result, "allocating GPU memory");
    return {device, memory};
}

// Returns the name of a function that `path` needs but the driver lacks, although it announces the function's
// extension; nullptr if there is none.
const char *missing_function(const VolkDeviceTable &functions, Path path, bool imports_host_memory) {
    const struct {
        const char *name;
        bool is_needed, is_present;
    } of_extensions[] = {
        {"vkGetMemoryHostPointerPropertiesEXT", imports_host_memory,
         functions.vkGetMemoryHostPointerPropertiesEXT != nullptr},
        {"vkCreateAccelerationStructureKHR", path != Path::plain,
         functions.vkCreateAccelerationStructureKHR != nullptr},
        {"vkGetAccelerationStructureBuildSizesKHR", path != Path::plain,
         functions.vkGetAccelerationStructureBuildSizesKHR != nullptr},
        {"vkCmdBuildAccelerationStructuresKHR", path != Path::plain,
         functions.vkCmdBuildAccelerationStructuresKHR != nullptr},
        {"vkCreateRayTracingPipelinesKHR", path == Path::pipeline,
         functions.vkCreateRayTracingPipelinesKHR != nullptr},
        {"vkGetRayTracingShaderGroupHandlesKHR", path == Path::pipeline,
         functions.vkGetRayTracingShaderGroupHandlesKHR != nullptr},
        {"vkCmdTraceRaysKHR", path == Path::pipeline, functions.vkCmdTraceRaysKHR != nullptr},
    };
    for (const auto &function : of_extensions)
        if (function.is_needed && !function.is_present)
            return function.name;
    return nullptr;
}

} // namespace

Device::Device(const PhysicalDevice &physical, Path path) : physical_(physical) {
    vkGetPhysicalDeviceMemoryProperties(physical.handle, &memory_);
    const float priority = 1;
    const VkDeviceQueueCreateInfo queue{.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
                                        .queueFamilyIndex = physical.queue_family,
                                        .queueCount = 1,
                                        .pQueuePriorities = &priority};
    VkPhysicalDeviceRayTracingPipelineFeaturesKHR pipeline{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR, .rayTracingPipeline = VK_TRUE};
    VkPhysicalDeviceRayQueryFeaturesKHR query{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR,
                                              .rayQuery = VK_TRUE};
    VkPhysicalDeviceAccelerationStructureFeaturesKHR structures{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR,
        .pNext = path == Path::query ? static_cast<void *>(&query) : &pipeline,
        .accelerationStructure = VK_TRUE};
    const VkPhysicalDeviceBufferDeviceAddressFeatures addresses{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES,
        .pNext = &structures,
        .bufferDeviceAddress = VK_TRUE};
    std::vector<const char *> extensions;
    if (physical.imports_host_memory)
        extensions.push_back(VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME);
    if (path != Path::plain)
        extensions.insert(
            extensions.end(),
            {VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME, VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
             path == Path::query ? VK_KHR_RAY_QUERY_EXTENSION_NAME : VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME});
    const VkDeviceCreateInfo info{.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
                                  .pNext = path == Path::plain ? nullptr : &addresses,
                                  .queueCreateInfoCount = 1,
                                  .pQueueCreateInfos = &queue,
                                  .enabledExtensionCount = static_cast<std::uint32_t>(extensions.size()),
                                  .ppEnabledExtensionNames = extensions.data()};
    check(vkCreateDevice(physical.handle, &info, nullptr, &device_), "opening the Vulkan device");
    volkLoadDeviceTable(&functions_, device_);
    if (const char *missing = missing_function(functions_, path, physical.imports_host_memory)) {
        functions_.vkDestroyDevice(device_, nullptr);
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      "the Vulkan driver lacks " + std::string(missing) + "; reinstall or update the driver");
    }
    functions_.vkGetDeviceQueue(device_, physical.queue_family, 0, &queue_);
}

Device::~Device() {
    functions_.vkDestroyDevice(device_, nullptr);
}

std::vector<std::uint32_t> Device::memory_types(std::uint32_t allowed, VkMemoryPropertyFlags required,
                                                VkMemoryPropertyFlags preferred) const {
    std::vector<std::uint32_t> types;
    for (const bool is_preferred : {true, false})
        for (std::uint32_t type = 0; type < memory_.memoryTypeCount; ++type) {
            const VkMemoryPropertyFlags flags = memory_.memoryTypes[type].propertyFlags;
            if (allowed >> type & 1 && (flags & required) == required &&
                ((flags & preferred) == preferred) == is_preferred)
                types.push_back(type);
        }
    return types;
}

Buffer::Buffer(const Device &device, VkDeviceSize size, VkBufferUsageFlags usage, Place place) : size_(size) {
    const VolkDeviceTable &vk = device.functions();
    const VkBufferCreateInfo info{.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, .size = size, .usage = usage};
    buffer_ = {device, vk.vkCreateBuffer, info, "creating a GPU buffer"};
    VkMemoryRequirements requirements;
    vk.vkGetBufferMemoryRequirements(device.handle(), get(), &requirements);
    const VkMemoryPropertyFlags preferred = place == Place::staging     ? 0
                                            : place == Place::host_read ? VK_MEMORY_PROPERTY_HOST_CACHED_BIT
                                                                        : VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
    // Drivers list memory types with fewer properties first, so staging buffers do not use device-local memory.
    const std::vector<std::uint32_t> types =
        device.memory_types(requirements.memoryTypeBits, place == Place::device ? 0 : mappable, preferred);
    if (types.empty())
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      "the Vulkan device '" + device.physical().name +
                          "' has no memory that the host can write; choose another device");
    const bool has_address = usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
    const VkMemoryAllocateFlagsInfo flags{.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO,
                                          .flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT};
    // Device buffers do not fall back to host memory: rendering would be slow and the user would not learn why.
    const std::size_t tried = place == Place::device ? 1 : types.size();
    memory_ = allocated(device, requirements.size, std::span(types).first(tried), has_address ? &flags : nullptr);
    check(vk.vkBindBufferMemory(device.handle(), get(), memory_.get(), 0), "binding GPU memory");
    if (has_address) {
        const VkBufferDeviceAddressInfo which{.sType = VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO, .buffer = get()};
        address_ = vk.vkGetBufferDeviceAddress(device.handle(), &which);
    }
    if (place != Place::device) {
        void *mapped = nullptr;
        check(vk.vkMapMemory(device.handle(), memory_.get(), 0, VK_WHOLE_SIZE, 0, &mapped), "mapping GPU memory");
        mapped_ = static_cast<std::byte *>(mapped);
    }
}

Buffer Buffer::imported(const Device &device, void *memory, VkDeviceSize size) {
    constexpr auto type = VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT;
    constexpr VkDeviceSize page = 4096; // an image's memory extends to the end of its last page (arhost/raytracer.h)
    const VolkDeviceTable &vk = device.functions();
    if (!device.physical().imports_host_memory || device.physical().import_alignment > page ||
        reinterpret_cast<std::uintptr_t>(memory) % page)
        return {};
    VkMemoryHostPointerPropertiesEXT properties{.sType = VK_STRUCTURE_TYPE_MEMORY_HOST_POINTER_PROPERTIES_EXT};
    if (vk.vkGetMemoryHostPointerPropertiesEXT(device.handle(), type, memory, &properties) != VK_SUCCESS)
        return {};
    const VkExternalMemoryBufferCreateInfo external{.sType = VK_STRUCTURE_TYPE_EXTERNAL_MEMORY_BUFFER_CREATE_INFO,
                                                    .handleTypes = type};
    const VkBufferCreateInfo info{.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO,
                                  .pNext = &external,
                                  .size = (size + page - 1) / page * page,
                                  .usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT};
    Buffer buffer;
    buffer.size_ = size;
    buffer.buffer_ = {device, vk.vkCreateBuffer, info, "creating a GPU buffer"};
    VkMemoryRequirements requirements;
    vk.vkGetBufferMemoryRequirements(device.handle(), buffer.get(), &requirements);
    const std::vector<std::uint32_t> types = device.memory_types(
        requirements.memoryTypeBits & properties.memoryTypeBits, mappable, VK_MEMORY_PROPERTY_HOST_CACHED_BIT);
    if (types.empty() || requirements.size > info.size)
        return {};
    const VkImportMemoryHostPointerInfoEXT import{
        .sType = VK_STRUCTURE_TYPE_IMPORT_MEMORY_HOST_POINTER_INFO_EXT, .handleType = type, .pHostPointer = memory};
    const VkMemoryAllocateInfo allocation{.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO,
                                          .pNext = &import,
                                          .allocationSize = info.size,
                                          .memoryTypeIndex = types[0]};
    VkDeviceMemory handle = VK_NULL_HANDLE;
    // Some drivers cannot import every kind of host memory.
    if (vk.vkAllocateMemory(device.handle(), &allocation, nullptr, &handle) != VK_SUCCESS)
        return {};
    buffer.memory_ = Memory(device, handle);
    check(vk.vkBindBufferMemory(device.handle(), buffer.get(), handle, 0), "binding the image's memory");
    return buffer;
}

Submission::Submission(const Device &device) : device_(device) {
    const VkCommandPoolCreateInfo pool{.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
                                       .flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT,
                                       .queueFamilyIndex = device.physical().queue_family};
    pool_ = {device, device.functions().vkCreateCommandPool, pool, "creating a command pool"};
    const VkFenceCreateInfo fence{.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
    fence_ = {device, device.functions().vkCreateFence, fence, "creating a fence"};
}

VkCommandBuffer Submission::new_commands() const {
    const VkCommandBufferAllocateInfo info{.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
                                           .commandPool = pool_.get(),
                                           .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
                                           .commandBufferCount = 1};
    VkCommandBuffer commands = VK_NULL_HANDLE;
    check(device_.functions().vkAllocateCommandBuffers(device_.handle(), &info, &commands),
          "allocating a command buffer");
    return commands;
}

void Submission::free(VkCommandBuffer commands) const {
    device_.functions().vkFreeCommandBuffers(device_.handle(), pool_.get(), 1, &commands);
}

void Submission::begin(VkCommandBuffer commands, VkCommandBufferUsageFlags flags) const {
    const VkCommandBufferBeginInfo info{.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, .flags = flags};
    check(device_.functions().vkBeginCommandBuffer(commands, &info), "recording GPU commands");
}

void Submission::end(VkCommandBuffer commands) const {
    check(device_.functions().vkEndCommandBuffer(commands), "recording GPU commands");
}

void Submission::run(std::span<const VkCommandBuffer> commands, const std::function<void()> &waiting) const {
    const VolkDeviceTable &vk = device_.functions();
    const VkFence fence = fence_.get();
    check(vk.vkResetFences(device_.handle(), 1, &fence), "resetting a fence");
    const VkSubmitInfo info{.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO,
                            .commandBufferCount = static_cast<std::uint32_t>(commands.size()),
                            .pCommandBuffers = commands.data()};
    check(vk.vkQueueSubmit(device_.queue(), 1, &info, fence), "submitting GPU commands");
    constexpr std::uint64_t interval_ns = 100'000'000;
    VkResult result = VK_TIMEOUT;
    while ((result = vk.vkWaitForFences(device_.handle(), 1, &fence, VK_TRUE, interval_ns)) == VK_TIMEOUT)
        waiting();
    if (result != VK_SUCCESS)
        vk.vkDeviceWaitIdle(device_.handle()); // the caller will destroy objects that the commands may still use
    check(result, "waiting for the GPU");
}

void barrier(const VolkDeviceTable &vk, VkCommandBuffer commands, VkPipelineStageFlags from, VkAccessFlags written,
             VkPipelineStageFlags to, VkAccessFlags used) {
    const VkMemoryBarrier memory{
        .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER, .srcAccessMask = written, .dstAccessMask = used};
    vk.vkCmdPipelineBarrier(commands, from, to, 0, 1, &memory, 0, nullptr, 0, nullptr);
}

void upload(const Device &device, const Submission &submission, const Buffer &to,
            std::span<const std::span<const std::byte>> parts) {
    constexpr std::size_t max_staging_size = std::size_t{16} << 20; // bytes
    std::size_t total = 0;
    for (const auto &part : parts)
        total += part.size();
    if (total == 0)
        return;
    const Buffer staging(device, std::min(total, max_staging_size), VK_BUFFER_USAGE_TRANSFER_SRC_BIT,
                         Buffer::Place::staging);
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
