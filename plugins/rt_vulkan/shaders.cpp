// SPDX-License-Identifier: Apache-2.0
#include "shaders.hpp"

#include "spirv/pipeline.rahit.h"
#include "spirv/pipeline.rchit.h"
#include "spirv/pipeline.rgen.h"
#include "spirv/pipeline.rint.h"
#include "spirv/pipeline.rmiss.h"
#include "spirv/pipeline_path.rgen.h"
#include "spirv/pipeline_photons.rgen.h"
#include "spirv/pipeline_taps.rgen.h"
#include "spirv/plain.comp.h"
#include "spirv/plain_path.comp.h"
#include "spirv/plain_photons.comp.h"
#include "spirv/plain_taps.comp.h"
#include "spirv/query.comp.h"
#include "spirv/query_path.comp.h"
#include "spirv/query_photons.comp.h"
#include "spirv/query_taps.comp.h"

namespace rt_vulkan {

using Words = std::span<const std::uint32_t>;

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

Shaders shaders_of(Path path, arhost_integrator integrator) {
    const bool is_path = integrator == ARHOST_INTEGRATOR_PATH;
    if (path == Path::plain)
        return {path, {{VK_SHADER_STAGE_COMPUTE_BIT, is_path ? Words(plain_path_comp) : Words(plain_comp)}}};
    if (path == Path::query)
        return {path, {{VK_SHADER_STAGE_COMPUTE_BIT, is_path ? Words(query_path_comp) : Words(query_comp)}}};
    return {path,
            {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, is_path ? Words(pipeline_path_rgen) : Words(pipeline_rgen)},
             {VK_SHADER_STAGE_MISS_BIT_KHR, pipeline_rmiss},
             {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, pipeline_rchit},
             {VK_SHADER_STAGE_ANY_HIT_BIT_KHR, pipeline_rahit},
             {VK_SHADER_STAGE_INTERSECTION_BIT_KHR, pipeline_rint}}};
}

Shaders photon_shaders_of(Path path) {
    Shaders shaders = shaders_of(path);
    shaders.stages[0].words = path == Path::plain   ? Words(plain_photons_comp)
                              : path == Path::query ? Words(query_photons_comp)
                                                    : Words(pipeline_photons_rgen);
    return shaders;
}

Shaders tap_shaders_of(Path path) {
    Shaders shaders = shaders_of(path);
    shaders.stages[0].words = path == Path::plain   ? Words(plain_taps_comp)
                              : path == Path::query ? Words(query_taps_comp)
                                                    : Words(pipeline_taps_rgen);
    return shaders;
}

} // namespace rt_vulkan
