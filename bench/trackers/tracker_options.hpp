// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fiducial/tracker_support.hpp>

#include <map>
#include <stdexcept>
#include <string>

namespace arhost::test {

// Reads options of the plugins from arguments such as "aruco:key=value". Key: "aruco" or "apriltag".
inline std::map<std::string, Options> options_of_both(int argc, char **argv) {
    std::map<std::string, Options> options;
    for (int i = 1; i < argc; ++i) {
        const std::string argument = argv[i];
        const auto colon = argument.find(':'), equals = argument.find('=');
        const std::string plugin = argument.substr(0, colon);
        if ((plugin != "aruco" && plugin != "apriltag") || equals == std::string::npos || equals < colon)
            throw std::runtime_error("invalid argument '" + argument +
                                     "': must be aruco:key=value or apriltag:key=value");
        options[plugin][argument.substr(colon + 1, equals - colon - 1)] = argument.substr(equals + 1);
    }
    return options;
}

} // namespace arhost::test
