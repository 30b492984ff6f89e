// SPDX-License-Identifier: Apache-2.0
#include "shaders.hpp"

#include "file_bytes.hpp"

#include <algorithm>
#include <cstring>
#include <span>

namespace rt_vulkan {
namespace {

using arhost::Failure;

constexpr std::uintmax_t largest_shader = std::uintmax_t{16} << 20; // ours have 0.2 MiB at most

// Of the pipeline path, in the order that pipeline.cpp puts into groups.
constexpr VkShaderStageFlagBits pipeline_stages[] = {
    VK_SHADER_STAGE_RAYGEN_BIT_KHR, VK_SHADER_STAGE_MISS_BIT_KHR, VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR,
    VK_SHADER_STAGE_ANY_HIT_BIT_KHR, VK_SHADER_STAGE_INTERSECTION_BIT_KHR};
constexpr const char *pipeline_files[] = {"pipeline.rgen", "pipeline.rmiss", "pipeline.rchit", "pipeline.rahit",
                                          "pipeline.rint"};

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
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
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
    const std::vector<char> bytes = file_bytes(file, largest_shader);
    if (bytes.empty())
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "the shader '" + file.string() + "' is missing or can't be read; install arhost again");
    std::vector<std::uint32_t> words(bytes.size() / 4);
    std::memcpy(words.data(), bytes.data(), words.size() * 4);
    const ShaderKind kind = kind_of(file, words, bytes.size() % 4 == 0);
    if (kind.model != model_of(stage) || kind.asks_rays != (path == Path::query))
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
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

} // namespace rt_vulkan
