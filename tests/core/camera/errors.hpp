// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "yaml/yaml.hpp"

#include <string>

namespace arhost::test {

// Returns the message of the yaml::Error that `call` throws.
template <class Call> std::string error_of(const Call &call) {
    try {
        call();
    } catch (const yaml::Error &error) {
        return error.what();
    }
    return "no error";
}

} // namespace arhost::test
