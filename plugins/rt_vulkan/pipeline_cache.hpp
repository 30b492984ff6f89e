// SPDX-License-Identifier: Apache-2.0
//
// Keeps the driver's compiled shaders between starts, in $XDG_CACHE_HOME/rt_vulkan-DEVICE.pipelines.
#pragma once

#include "device.hpp"

namespace rt_vulkan {

// Reads the cache from its file. The cache is empty if the file is missing or unusable.
PipelineCache read_pipeline_cache(const Device &device);

// Atomically replaces the file with the contents of `cache`. Ignores failures, because the cache only saves time.
void write_pipeline_cache(const Device &device, const PipelineCache &cache);

} // namespace rt_vulkan
