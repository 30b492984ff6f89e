// SPDX-License-Identifier: Apache-2.0
//
// The status document of a run (docs/control.md).
#pragma once

#include "host/assembly.hpp"
#include "host/outputs.hpp"

#include <nlohmann/json_fwd.hpp>

namespace arhost::host {

nlohmann::ordered_json status_json(const RunParts &parts, const Assembly &assembly, const Outputs &outputs);

} // namespace arhost::host
