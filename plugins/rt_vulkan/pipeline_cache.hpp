// SPDX-License-Identifier: Apache-2.0
//
// The driver's compiled shaders, in a file from one start to the next: $XDG_CACHE_HOME/rt_vulkan-DEVICE.pipelines.
#pragma once

#include "device.hpp"

namespace rt_vulkan {

// Empty where there is no such file, or it is of no use.
PipelineCache read_pipeline_cache(const Device &device);

// Renamed into place, so that no one reads half of it. A cache that can't be written is no fault.
void keep_pipeline_cache(const Device &device, const PipelineCache &cache);

} // namespace rt_vulkan
