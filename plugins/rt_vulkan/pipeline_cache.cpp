// SPDX-License-Identifier: Apache-2.0
#include "pipeline_cache.hpp"

#include "file_bytes.hpp"

#include <cstdlib>
#include <fcntl.h>
#include <unistd.h>

namespace rt_vulkan {
namespace {

// Each scene adds to it: one that has more is begun anew.
constexpr std::uintmax_t largest_cache = std::uintmax_t{64} << 20;

// Where a device's are kept, of this version of its driver; empty: nowhere.
std::filesystem::path file_of(const Device &device) {
    const char *caches = std::getenv("XDG_CACHE_HOME"); // the sandbox gives each plugin its own
    if (!caches || *caches != '/') // a relative one is to be ignored (XDG Base Directory Specification)
        return {};
    const std::string which = hexadecimal(device.physical().properties.pipelineCacheUUID);
    return std::filesystem::path(caches) / ("rt_vulkan-" + which + ".pipelines");
}

} // namespace

PipelineCache read_pipeline_cache(const Device &device) {
    std::vector<char> data;
    if (const auto file = file_of(device); !file.empty())
        data = file_bytes(file, largest_cache);
    VkPipelineCacheCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO;
    info.initialDataSize = data.size(); // the driver looks at its header, and ignores another driver's
    info.pInitialData = data.data();
    return make<PipelineCache, VkPipelineCache>(device, device.functions().vkCreatePipelineCache, info,
                                                "making a pipeline cache");
}

void keep_pipeline_cache(const Device &device, const PipelineCache &cache) {
    const auto file = file_of(device);
    if (file.empty())
        return;
    std::size_t size = 0;
    const auto get = device.functions().vkGetPipelineCacheData;
    if (get(device.handle(), cache.get(), &size, nullptr) != VK_SUCCESS)
        return;
    std::vector<char> data(size);
    const VkResult result = get(device.handle(), cache.get(), &size, data.data());
    data.resize(size);
    if (result != VK_SUCCESS || data.size() > largest_cache || data == file_bytes(file, largest_cache))
        return;
    std::string temporary = file.string() + ".XXXXXX"; // each process has its own
    const int descriptor = ::mkostemp(temporary.data(), O_CLOEXEC);
    if (descriptor < 0)
        return;
    ::close(descriptor);
    std::ofstream stream(temporary, std::ios::binary);
    stream.write(data.data(), static_cast<std::streamsize>(data.size()));
    stream.close();
    std::error_code failed;
    if (stream)
        std::filesystem::rename(temporary, file, failed);
    if (!stream || failed)
        std::filesystem::remove(temporary, failed);
}

} // namespace rt_vulkan
