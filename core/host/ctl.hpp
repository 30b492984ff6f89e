// SPDX-License-Identifier: Apache-2.0
//
// `arhost ctl`: sends a command to a running arhost whose configuration has the output sink_control.
#pragma once

#include <string>
#include <vector>

namespace arhost::host {

struct CtlArguments {
    std::string name = "arhost"; // of the run: its socket is $XDG_RUNTIME_DIR/arhost/NAME.sock
    std::string command;
    std::vector<std::string> values; // of the command's members
    bool json = false;               // print the answer as it is
};

// Returns the exit status. Prints the answer, or an error.
int ctl(const CtlArguments &arguments);

} // namespace arhost::host
