// SPDX-License-Identifier: Apache-2.0
//
// The description of a run for the sinks that record it (docs/sessions.md).
#pragma once

#include "host/assembly.hpp"

#include <string>

namespace arhost::host {

// Returns session.json. `id`: of the sink. Throws std::runtime_error if the description is too long.
std::string run_description(const RunParts &parts, const Assembly &assembly, const std::string &id);

} // namespace arhost::host
