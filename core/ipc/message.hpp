// SPDX-License-Identifier: Apache-2.0
//
// A message received from a control channel. Separate from channel.hpp, because the full JSON header takes long to
// compile.
#pragma once

#include "base/unique_fd.hpp"

#include <nlohmann/json.hpp>

#include <vector>

namespace arhost::ipc {

struct Message {
    nlohmann::json body; // an object with a string "type"
    std::vector<base::UniqueFd> fds;
    std::size_t size = 0; // bytes received
};

} // namespace arhost::ipc
