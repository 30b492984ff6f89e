// SPDX-License-Identifier: Apache-2.0
//
// Writes that may block forever (an unread pipe, a stopped terminal) and can be interrupted.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace arhost::base {

// A signal arrived.
struct Interrupted : std::runtime_error {
    Interrupted(int signal, const std::string &what) : std::runtime_error(what), signal(signal) {}
    int signal;
};

// `signals`: a signalfd that interrupts the write; -1: none. Throws Interrupted or std::system_error.
void write_all(int fd, std::string_view bytes, int signals = -1);

// False if stdio output to stdout was lost, for example because the disk is full.
bool flush_stdout();

// The next pending signal, or 0; does not wait.
int take_signal(int signals);

} // namespace arhost::base
