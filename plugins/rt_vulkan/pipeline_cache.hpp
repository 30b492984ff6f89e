// SPDX-License-Identifier: Apache-2.0
//
// Keeps the driver's compiled shaders between starts, in $XDG_CACHE_HOME/rt_vulkan-DEVICE.pipelines.
#pragma once

#include "device.hpp"

namespace rt_vulkan {

// Empty if the file is missing or unusable.
PipelineCache read_pipeline_cache(const Device &device);

// Replaces the file atomically. Failures are ignored: the cache only saves time.
void write_pipeline_cache(const Device &device, const PipelineCache &cache);

} // namespace rt_vulkan
