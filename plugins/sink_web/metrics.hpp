// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace arhost::web {

struct OwnCounts {
    std::uint64_t frames, encoded;
    std::size_t viewers, connections;
};

// Returns the metrics in Prometheus' text format. `answer`: the host's answer to the command "status". If it contains
// no status, the result contains only the counts of this output.
std::string metrics(const std::string &answer, const OwnCounts &own);

} // namespace arhost::web
