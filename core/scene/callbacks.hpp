// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>

namespace arhost::scene {

// What the loader tells and asks while it works; each may be empty. Called on the loading thread.
struct LoadCallbacks {
    std::function<void(double fraction, const std::string &what)> progress; // 0 to 1, several times a second
    std::function<bool()> cancelled;                                        // true: stop, throwing Cancelled
    std::function<void(const std::string &)> info, warning;                 // one sentence for the log
    std::function<void(const std::filesystem::path &)> reads;               // a file that is about to be opened
};

class Cancelled : public std::runtime_error {
public:
    Cancelled() : std::runtime_error("loading the scene was cancelled") {}
};

} // namespace arhost::scene
