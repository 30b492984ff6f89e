// SPDX-License-Identifier: Apache-2.0
#include "ipc/targets.hpp"

#include "ipc/messages.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstring>

namespace arhost::ipc {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(TargetMarker, id, family, corners_mm, file, pattern_ratio)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Target, name, markers, body)

std::vector<std::string> families_of(const std::vector<Target> &targets) {
    std::vector<std::string> families;
    for (const Target &target : targets)
        for (const TargetMarker &marker : target.markers)
            if (std::ranges::find(families, marker.family) == families.end())
                families.push_back(marker.family);
    return families;
}

SharedMemory to_memory(const std::vector<Target> &targets) {
    const std::string text = Json(targets).dump();
    SharedMemory memory = SharedMemory::create("arhost-targets", text.size());
    const Mapping mapping = memory.map(Access::read_write);
    memory.seal_future_writes();
    std::memcpy(mapping.bytes().data(), text.data(), text.size());
    return memory;
}

std::vector<Target> targets_from(const Mapping &memory) {
    try {
        const std::span<const std::byte> bytes = memory.bytes();
        const auto *text = reinterpret_cast<const char *>(bytes.data());
        return Json::parse(text, text + bytes.size()).get<std::vector<Target>>();
    } catch (const Json::exception &error) {
        throw ProtocolViolation(std::string("malformed targets: ") + error.what());
    }
}

} // namespace arhost::ipc
