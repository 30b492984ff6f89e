// SPDX-License-Identifier: Apache-2.0
#include "pipeline.hpp"

#include "pipeline_cache.hpp"

#include <array>
#include <cstring>

namespace rt_vulkan {
namespace {

// Of the pipeline path, in the order of its stages; where a group has no such stage, VK_SHADER_UNUSED_KHR.
constexpr std::uint32_t generate_stage = 0, miss_stage = 1, nearest_stage = 2, any_stage = 3, sphere_stage = 4;
constexpr std::uint32_t group_count = 4; // a ray's beginning, its miss, hits of triangles, hits of spheres

} // namespace

ImagePipeline::ImagePipeline(const Device &device, const Shaders &shaders, VkPipelineLayout layout,
                             const Specialization &constants)
    : device_(device), layout_(layout), stage_flags_(shaders.stage_flags()) {
    std::array<VkSpecializationMapEntry, sizeof constants / 4> entries;
    for (std::uint32_t i = 0; i < entries.size(); ++i)
        entries[i] = {i, 4 * i, 4};
    const VkSpecializationInfo specialization{static_cast<std::uint32_t>(entries.size()), entries.data(),
                                              sizeof constants, &constants};
    std::vector<ShaderModule> modules;
    std::vector<VkPipelineShaderStageCreateInfo> stages;
    for (const Shader &shader : shaders.stages) {
        VkShaderModuleCreateInfo module{};
        module.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
        module.codeSize = shader.words.size() * sizeof shader.words[0];
        module.pCode = shader.words.data();
        modules.push_back(
            make<ShaderModule, VkShaderModule>(device, device.functions().vkCreateShaderModule, module,
                                               "reading a shader (damaged rt_vulkan_*.spv beside the plugin?)"));
        VkPipelineShaderStageCreateInfo stage{};
        stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
        stage.stage = shader.stage;
        stage.module = modules.back().get();
        stage.pName = "main";
        stage.pSpecializationInfo = &specialization;
        stages.push_back(stage);
    }
    const PipelineCache cache = read_pipeline_cache(device);
    compile(shaders, stages, cache);
    keep_pipeline_cache(device, cache);
    if (shaders.path == Path::pipeline)
        make_table();
}

void ImagePipeline::compile(const Shaders &shaders, std::span<const VkPipelineShaderStageCreateInfo> stages,
                            const PipelineCache &cache) {
    const DeviceFunctions &vk = device_.functions();
    VkPipeline pipeline = VK_NULL_HANDLE;
    if (shaders.path != Path::pipeline) {
        VkComputePipelineCreateInfo info{};
        info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
        info.stage = stages[0];
        info.layout = layout_;
        check(vk.vkCreateComputePipelines(device_.handle(), cache.get(), 1, &info, nullptr, &pipeline),
              "compiling the shader (damaged rt_vulkan_*.spv beside the plugin?)");
    } else {
        const auto group = [](VkRayTracingShaderGroupTypeKHR type, std::uint32_t general, std::uint32_t nearest,
                              std::uint32_t any, std::uint32_t intersection) {
            VkRayTracingShaderGroupCreateInfoKHR group{};
            group.sType = VK_STRUCTURE_TYPE_RAY_TRACING_SHADER_GROUP_CREATE_INFO_KHR;
            group.type = type;
            group.generalShader = general;
            group.closestHitShader = nearest;
            group.anyHitShader = any;
            group.intersectionShader = intersection;
            return group;
        };
        constexpr std::uint32_t none = VK_SHADER_UNUSED_KHR;
        const VkRayTracingShaderGroupCreateInfoKHR groups[group_count] = {
            group(VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR, generate_stage, none, none, none),
            group(VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR, miss_stage, none, none, none),
            group(VK_RAY_TRACING_SHADER_GROUP_TYPE_TRIANGLES_HIT_GROUP_KHR, none, nearest_stage, any_stage, none),
            group(VK_RAY_TRACING_SHADER_GROUP_TYPE_PROCEDURAL_HIT_GROUP_KHR, none, nearest_stage, none,
                  sphere_stage)};
        VkRayTracingPipelineCreateInfoKHR info{};
        info.sType = VK_STRUCTURE_TYPE_RAY_TRACING_PIPELINE_CREATE_INFO_KHR;
        info.stageCount = static_cast<std::uint32_t>(stages.size());
        info.pStages = stages.data();
        info.groupCount = group_count;
        info.pGroups = groups;
        info.maxPipelineRayRecursionDepth = 1;
        info.layout = layout_;
        check(vk.vkCreateRayTracingPipelinesKHR(device_.handle(), VK_NULL_HANDLE, cache.get(), 1, &info, nullptr,
                                                &pipeline),
              "compiling the shaders (damaged rt_vulkan_*.spv beside the plugin?)");
    }
    pipeline_ = Pipeline(device_, pipeline);
}

// Three parts, each at an aligned place: of beginnings, misses and hits, whose two groups instances choose from.
void ImagePipeline::make_table() {
    const TracingLimits &limits = device_.physical().tracing;
    const VkDeviceSize size = limits.handle_size, stride = aligned(size, limits.handle_alignment);
    const VkDeviceSize part = aligned(stride, limits.table_alignment);
    std::vector<std::byte> handles(group_count * size);
    check(device_.functions().vkGetRayTracingShaderGroupHandlesKHR(device_.handle(), pipeline_.get(), 0, group_count,
                                                                   handles.size(), handles.data()),
          "listing the shaders");
    table_ = Buffer(device_, limits.table_alignment + 2 * part + 2 * stride,
                    VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
                    Buffer::Place::host_written);
    const VkDeviceAddress first = aligned(table_.address(), limits.table_alignment);
    generate_ = {first, stride, stride};
    miss_ = {first + part, stride, stride};
    hit_ = {first + 2 * part, stride, 2 * stride};
    const VkDeviceAddress places[group_count] = {generate_.deviceAddress, miss_.deviceAddress, hit_.deviceAddress,
                                                 hit_.deviceAddress + stride};
    for (std::size_t i = 0; i < group_count; ++i)
        std::memcpy(table_.mapped().data() + (places[i] - table_.address()), handles.data() + i * size, size);
}

void ImagePipeline::record(VkCommandBuffer commands, VkDescriptorSet set, std::uint32_t width, Rows rows) const {
    const DeviceFunctions &vk = device_.functions();
    const VkPipelineBindPoint point =
        table_ ? VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR : VK_PIPELINE_BIND_POINT_COMPUTE;
    vk.vkCmdBindPipeline(commands, point, pipeline_.get());
    vk.vkCmdBindDescriptorSets(commands, point, layout_, 0, 1, &set, 0, nullptr);
    vk.vkCmdPushConstants(commands, layout_, stage_flags_, 0, pushed_size, &rows.first);
    if (table_) {
        const VkStridedDeviceAddressRegionKHR none{};
        vk.vkCmdTraceRaysKHR(commands, &generate_, &miss_, &hit_, &none, width, rows.count, 1);
    } else {
        vk.vkCmdDispatch(commands, (width + group_side - 1) / group_side, (rows.count + group_side - 1) / group_side,
                         1);
    }
}

} // namespace rt_vulkan
