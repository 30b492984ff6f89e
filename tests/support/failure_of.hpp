// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <string>
#include <utility>

namespace arhost::test {

// Returns the status and message of the Failure that `call` throws.
template <class Call> std::pair<arhost_status, std::string> failure_of(Call &&call) {
    try {
        call();
    } catch (const Failure &failure) {
        return {failure.status(), failure.what()};
    }
    return {ARHOST_STATUS_OK, "no Failure was thrown"};
}

} // namespace arhost::test
