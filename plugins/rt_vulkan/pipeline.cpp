// SPDX-License-Identifier: Apache-2.0
#include "pipeline.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <unistd.h>

namespace rt_vulkan {
namespace {

using arhost::Failure;

// Of the pipeline path, in the order of its stages; where a group has no such stage, VK_SHADER_UNUSED_KHR.
constexpr std::uint32_t generate_stage = 0, miss_stage = 1, nearest_stage = 2, any_stage = 3, sphere_stage = 4;
constexpr std::uint32_t group_count = 4; // a ray's beginning, its miss, hits of triangles, hits of spheres

constexpr VkShaderStageFlagBits pipeline_stages[] = {
    VK_SHADER_STAGE_RAYGEN_BIT_KHR, VK_SHADER_STAGE_MISS_BIT_KHR, VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR,
    VK_SHADER_STAGE_ANY_HIT_BIT_KHR, VK_SHADER_STAGE_INTERSECTION_BIT_KHR};
constexpr const char *pipeline_files[] = {"pipeline.rgen", "pipeline.rmiss", "pipeline.rchit", "pipeline.rahit",
                                          "pipeline.rint"};

// Where the driver's compiled shaders are kept; empty: nowhere.
std::filesystem::path pipeline_cache_file() {
    const char *caches = std::getenv("XDG_CACHE_HOME"); // the sandbox gives each plugin its own
    // A relative one is to be ignored (XDG Base Directory Specification).
    return caches && *caches == '/' ? std::filesystem::path(caches) / "rt_vulkan.pipelines" : std::filesystem::path();
}

// Empty where there is no such file, or it is too large to be what it should.
std::vector<char> contents(const std::filesystem::path &file) {
    constexpr std::uintmax_t most = std::uintmax_t{256} << 20;
    std::error_code failed;
    if (!std::filesystem::is_regular_file(file, failed)) // reading a folder would throw
        return {};
    const std::uintmax_t size = std::filesystem::file_size(file, failed);
    if (failed || size > most)
        return {};
    std::vector<char> bytes(size);
    std::ifstream stream(file, std::ios::binary);
    if (!stream.read(bytes.data(), static_cast<std::streamsize>(size)))
        return {};
    return bytes;
}

PipelineCache read_pipeline_cache(const Device &device) {
    std::vector<char> data;
    if (const auto file = pipeline_cache_file(); !file.empty())
        data = contents(file);
    VkPipelineCacheCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO;
    info.initialDataSize = data.size(); // the driver looks at its header, and ignores another driver's
    info.pInitialData = data.data();
    return make<PipelineCache, VkPipelineCache>(device, device.functions().vkCreatePipelineCache, info,
                                                "making a pipeline cache");
}

// Renamed into place, so that no one reads half of it. A cache that can't be written is no fault.
void keep_pipeline_cache(const Device &device, const PipelineCache &cache) {
    const auto file = pipeline_cache_file();
    if (file.empty())
        return;
    std::size_t size = 0;
    const auto get = device.functions().vkGetPipelineCacheData;
    if (get(device.handle(), cache.get(), &size, nullptr) != VK_SUCCESS)
        return;
    std::vector<char> data(size);
    if (get(device.handle(), cache.get(), &size, data.data()) != VK_SUCCESS || data == contents(file))
        return;
    std::string temporary = file.string() + ".XXXXXX"; // each process has its own
    const int descriptor = ::mkostemp(temporary.data(), O_CLOEXEC);
    if (descriptor < 0)
        return;
    ::close(descriptor);
    std::ofstream stream(temporary, std::ios::binary);
    stream.write(data.data(), static_cast<std::streamsize>(size));
    stream.close();
    std::error_code failed;
    if (stream)
        std::filesystem::rename(temporary, file, failed);
    if (!stream || failed)
        std::filesystem::remove(temporary, failed);
}

// What a shader's beginning says of it (SPIR-V 1.5, sections 2.3, 3.3 and 3.42).
struct ShaderKind {
    std::uint32_t model = ~0u; // SPIR-V's execution model, of the function `main`
    bool asks_rays = false;    // its capability RayQueryKHR
};

// Throws where it is no whole SPIR-V: drivers crash on that.
ShaderKind kind_of(const std::filesystem::path &file, std::span<const std::uint32_t> words, bool is_whole) {
    constexpr std::uint32_t magic = 0x07230203, header_words = 5;
    constexpr std::uint32_t entry_point = 15, capability = 17, end_of_function = 56, ray_query = 4472;
    constexpr std::uint32_t main_words[] = {0x6e69616d, 0}; // "main", ended
    ShaderKind kind;
    // Its instructions must follow one another up to the last function's end.
    std::size_t at = header_words;
    std::uint32_t last = 0;
    bool sound = is_whole && words.size() > header_words && words[0] == magic;
    while (sound && at < words.size()) {
        const std::uint32_t length = words[at] >> 16;
        last = words[at] & 0xffff;
        sound = length > 0 && length <= words.size() - at;
        if (sound && last == entry_point && length >= 5 &&
            std::equal(std::begin(main_words), std::end(main_words), &words[at + 3]))
            kind.model = words[at + 1];
        kind.asks_rays |= sound && last == capability && length == 2 && words[at + 1] == ray_query;
        at += length;
    }
    if (!sound || last != end_of_function)
        throw Failure(ARHOST_ERROR_CONFIGURATION,
                      "the shader '" + file.string() + "' is damaged: no whole SPIR-V; install arhost again");
    return kind;
}

std::uint32_t model_of(VkShaderStageFlagBits stage) {
    switch (stage) {
    case VK_SHADER_STAGE_RAYGEN_BIT_KHR:
        return 5313;
    case VK_SHADER_STAGE_INTERSECTION_BIT_KHR:
        return 5314;
    case VK_SHADER_STAGE_ANY_HIT_BIT_KHR:
        return 5315;
    case VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR:
        return 5316;
    case VK_SHADER_STAGE_MISS_BIT_KHR:
        return 5317;
    default:
        return 5; // GLCompute
    }
}

Shader read_shader(const std::filesystem::path &file, VkShaderStageFlagBits stage, Path path) {
    const std::vector<char> bytes = contents(file);
    if (bytes.empty())
        throw Failure(ARHOST_ERROR_CONFIGURATION,
                      "the shader '" + file.string() + "' is missing or can't be read; install arhost again");
    std::vector<std::uint32_t> words(bytes.size() / 4);
    std::memcpy(words.data(), bytes.data(), words.size() * 4);
    const ShaderKind kind = kind_of(file, words, bytes.size() % 4 == 0);
    if (kind.model != model_of(stage) || kind.asks_rays != (path == Path::query))
        throw Failure(ARHOST_ERROR_CONFIGURATION,
                      "the shader '" + file.string() + "' is another one than its name says; install arhost again");
    return {stage, std::move(words)};
}

} // namespace

VkShaderStageFlags Shaders::stage_flags() const {
    VkShaderStageFlags flags = 0;
    for (const Shader &shader : stages)
        flags |= shader.stage;
    return flags;
}

VkPipelineStageFlags Shaders::pipeline_stage() const {
    return path == Path::pipeline ? VK_PIPELINE_STAGE_RAY_TRACING_SHADER_BIT_KHR
                                  : VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT;
}

Shaders read_shaders(const std::filesystem::path &folder, Path path) {
    Shaders shaders{path, {}};
    const auto read = [&](VkShaderStageFlagBits stage, const std::string &name) {
        shaders.stages.push_back(read_shader(folder / ("rt_vulkan_" + name + ".spv"), stage, path));
    };
    if (path == Path::pipeline)
        for (std::size_t i = 0; i < std::size(pipeline_files); ++i)
            read(pipeline_stages[i], pipeline_files[i]);
    else
        read(VK_SHADER_STAGE_COMPUTE_BIT, std::string(name_of(path)) + ".comp");
    return shaders;
}

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
