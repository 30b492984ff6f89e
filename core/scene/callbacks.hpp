// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>

namespace arhost::scene {

// Progress, log and cancellation of a loader. Each may be empty. Called on the loading thread.
struct LoadCallbacks {
    std::function<void(double fraction, const std::string &what)> progress; // 0 to 1, several times a second
    std::function<bool()> cancelled;                                        // true: stop by throwing Cancelled
    std::function<void(const std::string &)> info, warning;                 // one sentence for the log
    std::function<void(const std::filesystem::path &)> reads;               // a file that is about to be opened
};

class Cancelled : public std::runtime_error {
public:
    Cancelled() : std::runtime_error("loading the scene was cancelled") {}
};

// Calls the callbacks on behalf of a reader of `what`, usually a file name. `callbacks` must outlive it.
class Reporter {
public:
    Reporter(const LoadCallbacks &callbacks, std::string what) : callbacks_(callbacks), what_(std::move(what)) {}

    // Negative: progress unknown. Throws Cancelled on request.
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
    void reads(const std::filesystem::path &file) const {
        if (callbacks_.reads)
            callbacks_.reads(file);
    }

private:
    const LoadCallbacks &callbacks_;
    std::string what_;
};

} // namespace arhost::scene
