// SPDX-License-Identifier: Apache-2.0
//
// Ends long work when the user presses Ctrl-C or closes the window.
#pragma once

#include "base/write_all.hpp"

#include <atomic>

namespace arhost::view {

// The signal that has interrupted this process; 0: none. Any thread may poll it.
inline std::atomic<int> interruption{0};

inline void throw_if_interrupted() {
    if (const int signal = interruption)
        throw base::Interrupted(signal, "interrupted");
}

} // namespace arhost::view
