// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <vector>

namespace rt_vulkan {

// Of a whole file; empty where there is none, or it has more than `most`.
inline std::vector<char> file_bytes(const std::filesystem::path &file, std::uintmax_t most) {
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

} // namespace rt_vulkan
