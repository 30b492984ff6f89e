// SPDX-License-Identifier: Apache-2.0
#include "scene/referred_files.hpp"

#include "scene/mesh.hpp"

#include <algorithm>

namespace arhost::scene {
namespace {

bool is_below(const std::filesystem::path &file, const std::filesystem::path &folder) {
    return std::mismatch(folder.begin(), folder.end(), file.begin(), file.end()).first == folder.end();
}

} // namespace

ReferredFiles::ReferredFiles(const std::filesystem::path &file, std::span<const std::filesystem::path> reads)
    : name_(file.string()), readable_(reads.begin(), reads.end()) {
    const std::filesystem::path folder = file.parent_path();
    readable_.push_back(std::filesystem::canonical(folder.empty() ? "." : folder));
}

std::filesystem::path ReferredFiles::resolve(const std::filesystem::path &file) const {
    std::error_code unresolved;
    std::filesystem::path resolved = std::filesystem::canonical(file, unresolved);
    if (unresolved)
        return {};
    if (std::ranges::none_of(readable_, [&](const auto &folder) { return is_below(resolved, folder); }))
        throw MeshError(name_ + ": refers to '" + resolved.string() +
                        "', which is outside its folder; move that file there, or list it under 'reads' of the ray "
                        "tracer in the configuration");
    return resolved;
}

} // namespace arhost::scene
