// SPDX-License-Identifier: Apache-2.0
#include "pipeline_cache.hpp"

#include <cstdlib>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <unistd.h>

namespace rt_vulkan {
namespace {

namespace fs = std::filesystem;

// Maximum size of the file. Larger files are ignored; the cache grows with each new scene.
constexpr std::uintmax_t max_size = std::uintmax_t{64} << 20; // bytes

// Returns the path of the cache file, which is specific to a device and driver version; empty if there is no cache
// folder.
fs::path file_of(const Device &device) {
    const char *caches = std::getenv("XDG_CACHE_HOME"); // the sandbox sets it to a folder of the plugin's own
    if (!caches || *caches != '/') // relative paths are ignored (XDG Base Directory Specification)
        return {};
    return fs::path(caches) /
           ("rt_vulkan-" + hexadecimal(device.physical().properties.pipelineCacheUUID) + ".pipelines");
}

std::vector<char> read(const fs::path &file) {
    std::error_code failed;
    if (!fs::is_regular_file(file, failed)) // reading a folder would throw
        return {};
    const std::uintmax_t size = fs::file_size(file, failed);
    if (failed || size > max_size)
        return {};
    std::vector<char> bytes(size);
    std::ifstream stream(file, std::ios::binary);
    if (!stream.read(bytes.data(), static_cast<std::streamsize>(size)))
        return {};
    return bytes;
}

} // namespace

PipelineCache read_pipeline_cache(const Device &device) {
    const std::vector<char> data = read(file_of(device));
    const VkPipelineCacheCreateInfo info{
        .sType = VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO,
        .initialDataSize = data.size(), // the driver checks the header and ignores data of other drivers
        .pInitialData = data.data()};
    return {device, device.functions().vkCreatePipelineCache, info, "creating a pipeline cache"};
}

void write_pipeline_cache(const Device &device, const PipelineCache &cache) {
    const fs::path file = file_of(device);
    if (file.empty())
        return;
    std::size_t size = 0;
    const auto get = device.functions().vkGetPipelineCacheData;
    if (get(device.handle(), cache.get(), &size, nullptr) != VK_SUCCESS)
        return;
    std::vector<char> data(size);
    const VkResult result = get(device.handle(), cache.get(), &size, data.data());
    data.resize(size);
    if (result != VK_SUCCESS || data.size() > max_size || data == read(file))
        return;
    std::string temporary = file.string() + ".XXXXXX"; // a unique name for each process
    const int descriptor = ::mkostemp(temporary.data(), O_CLOEXEC);
    if (descriptor < 0)
        return;
    ::close(descriptor);
    std::ofstream stream(temporary, std::ios::binary);
    stream.write(data.data(), static_cast<std::streamsize>(data.size()));
    stream.close();
    std::error_code failed;
    if (stream)
        fs::rename(temporary, file, failed);
    if (!stream || failed)
        fs::remove(temporary, failed);
}

} // namespace rt_vulkan
