// SPDX-License-Identifier: Apache-2.0
#include "image_pipeline.hpp"

#include "pipeline_cache.hpp"

#include <array>
#include <cstring>

namespace rt_vulkan {
namespace {

// Indices of the shaders of Path::pipeline in Shaders::stages.
constexpr std::uint32_t raygen_stage = 0, miss_stage = 1, closest_hit_stage = 2, any_hit_stage = 3,
                        intersection_stage = 4;
constexpr std::uint32_t group_count = 4; // raygen, miss, triangle hits, sphere hits

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
        const VkShaderModuleCreateInfo info{.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO,
                                            .codeSize = shader.words.size_bytes(),
                                            .pCode = shader.words.data()};
        modules.emplace_back(device, device.functions().vkCreateShaderModule, info, "loading a shader");
        stages.push_back({.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
                          .stage = shader.stage,
                          .module = modules.back().get(),
                          .pName = "main",
                          .pSpecializationInfo = &specialization});
    }
    const PipelineCache cache = read_pipeline_cache(device);
    compile(shaders.path, stages, cache);
    write_pipeline_cache(device, cache);
    if (shaders.path == Path::pipeline)
        make_binding_table();
}

void ImagePipeline::compile(Path path, std::span<const VkPipelineShaderStageCreateInfo> stages,
                            const PipelineCache &cache) {
    const VolkDeviceTable &vk = device_.functions();
    VkPipeline pipeline = VK_NULL_HANDLE;
    if (path != Path::pipeline) {
        const VkComputePipelineCreateInfo info{
            .sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO, .stage = stages[0], .layout = layout_};
        check(vk.vkCreateComputePipelines(device_.handle(), cache.get(), 1, &info, nullptr, &pipeline),
              "compiling the shader");
    } else {
        const auto group = [](VkRayTracingShaderGroupTypeKHR type, std::uint32_t general, std::uint32_t closest_hit,
                              std::uint32_t any_hit, std::uint32_t intersection) {
            return VkRayTracingShaderGroupCreateInfoKHR{
                .sType = VK_STRUCTURE_TYPE_RAY_TRACING_SHADER_GROUP_CREATE_INFO_KHR,
                .type = type,
                .generalShader = general,
                .closestHitShader = closest_hit,
                .anyHitShader = any_hit,
                .intersectionShader = intersection};
        };
        constexpr std::uint32_t none = VK_SHADER_UNUSED_KHR;
        const VkRayTracingShaderGroupCreateInfoKHR groups[group_count] = {
            group(VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR, raygen_stage, none, none, none),
            group(VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR, miss_stage, none, none, none),
            group(VK_RAY_TRACING_SHADER_GROUP_TYPE_TRIANGLES_HIT_GROUP_KHR, none, closest_hit_stage, any_hit_stage,
                  none),
            group(VK_RAY_TRACING_SHADER_GROUP_TYPE_PROCEDURAL_HIT_GROUP_KHR, none, closest_hit_stage, none,
                  intersection_stage)};
        const VkRayTracingPipelineCreateInfoKHR info{.sType = VK_STRUCTURE_TYPE_RAY_TRACING_PIPELINE_CREATE_INFO_KHR,
                                                     .stageCount = static_cast<std::uint32_t>(stages.size()),
                                                     .pStages = stages.data(),
                                                     .groupCount = group_count,
                                                     .pGroups = groups,
                                                     .maxPipelineRayRecursionDepth = 1,
                                                     .layout = layout_};
        check(vk.vkCreateRayTracingPipelinesKHR(device_.handle(), VK_NULL_HANDLE, cache.get(), 1, &info, nullptr,
                                                &pipeline),
              "compiling the shaders");
    }
    pipeline_ = Pipeline(device_, pipeline);
}

// Writes the shader binding table, which consists of three aligned regions: raygen, miss and hit. Each instance
// selects one of the two hit groups.
void ImagePipeline::make_binding_table() {
    const TracingLimits &limits = device_.physical().tracing;
    const VkDeviceSize size = limits.handle_size, stride = aligned(size, limits.handle_alignment);
    const VkDeviceSize region = aligned(stride, limits.table_alignment);
    std::vector<std::byte> handles(group_count * size);
    check(device_.functions().vkGetRayTracingShaderGroupHandlesKHR(device_.handle(), pipeline_.get(), 0, group_count,
                                                                   handles.size(), handles.data()),
          "querying the shader group handles");
    binding_table_ = Buffer(device_, limits.table_alignment + 2 * region + 2 * stride,
                            VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
                            Buffer::Place::host_written);
    const VkDeviceAddress first = aligned(binding_table_.address(), limits.table_alignment);
    raygen_ = {first, stride, stride};
    miss_ = {first + region, stride, stride};
    hit_ = {first + 2 * region, stride, 2 * stride};
    const VkDeviceAddress addresses[group_count] = {raygen_.deviceAddress, miss_.deviceAddress, hit_.deviceAddress,
                                                    hit_.deviceAddress + stride};
    for (std::size_t i = 0; i < group_count; ++i)
        std::memcpy(binding_table_.mapped().data() + (addresses[i] - binding_table_.address()),
                    handles.data() + i * size, size);
}

void ImagePipeline::record(VkCommandBuffer commands, VkDescriptorSet set, std::uint32_t width, Rows rows) const {
    const VolkDeviceTable &vk = device_.functions();
    const VkPipelineBindPoint point =
        binding_table_ ? VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR : VK_PIPELINE_BIND_POINT_COMPUTE;
    vk.vkCmdBindPipeline(commands, point, pipeline_.get());
    vk.vkCmdBindDescriptorSets(commands, point, layout_, 0, 1, &set, 0, nullptr);
    vk.vkCmdPushConstants(commands, layout_, stage_flags_, 0, push_constants_size, &rows.first);
    if (binding_table_) {
        const VkStridedDeviceAddressRegionKHR none{};
        vk.vkCmdTraceRaysKHR(commands, &raygen_, &miss_, &hit_, &none, width, rows.count, 1);
    } else {
        vk.vkCmdDispatch(commands, (width + group_side - 1) / group_side, (rows.count + group_side - 1) / group_side,
                         1);
    }
}

} // namespace rt_vulkan
