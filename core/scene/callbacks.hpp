// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>

namespace arhost::scene {

// Functions that a loader calls to report progress, to log, and to check for cancellation. Each may be empty. They
// run on the thread that loads.
struct LoadCallbacks {
    std::function<void(double fraction, const std::string &what)> progress; // 0 to 1; called several times a second
    std::function<bool()> cancelled;                                        // true: stop by throwing Cancelled
    std::function<void(const std::string &)> info, warning;                 // logs one sentence
    std::function<void(const std::filesystem::path &)> reads;               // called before a file is opened
};

class Cancelled : public std::runtime_error {
public:
    Cancelled() : std::runtime_error("loading the scene was cancelled") {}
};

// Calls the callbacks for one item, usually a file; `what` names it in progress messages. `callbacks` must outlive
// the Reporter.
class Reporter {
public:
    Reporter(const LoadCallbacks &callbacks, std::string what) : callbacks_(callbacks), what_(std::move(what)) {}

    // A negative `fraction` means that the progress is unknown. Throws Cancelled if the callback requests it.
    void report(double fraction) const {
        if (callbacks_.progress)
            callbacks_.progress(fraction, what_);
        if (callbacks_.cancelled && callbacks_.cancelled())
            throw Cancelled();
    }
    void info(const std::string &text) const {
        if (callbacks_.info)
            callbacks_.info(text);
    }
    void warning(const std::string &text) const {
        if (callbacks_.warning)
            callbacks_.warning(text);
    }
    void reads(const std::filesystem::path &file) const {
        if (callbacks_.reads)
            callbacks_.reads(file);
    }

private:
    const LoadCallbacks &callbacks_;
    std::string what_;
};

} // namespace arhost::scene
