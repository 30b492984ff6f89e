// SPDX-License-Identifier: Apache-2.0
//
// Writing to where it can be held up for ever: a pipe that nobody reads, a terminal that is halted.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace arhost::base {

// A signal has come.
struct Interrupted : std::runtime_error {
    Interrupted(int signal, const std::string &what) : std::runtime_error(what), signal(signal) {}
    int signal;
};

// `signals`: a signalfd, what comes there ends it; -1: nothing does. Throws Interrupted, and std::system_error.
void write_all(int fd, std::string_view bytes, int signals = -1);

// Of what went there by stdio and streams: a full disk is told no sooner. True: all of it was taken.
bool stdout_is_written();

// Takes what has come there, and does not wait; 0: nothing has.
int take_signal(int signals);

} // namespace arhost::base
