// SPDX-License-Identifier: Apache-2.0
// The result of a test.
#pragma once

#include "ipc/channel.hpp"

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::conformance {

enum class Verdict {
    pass = 1,
    fail,
    crashed, // killed by a signal, or the plugin ended the process
    timeout,
    skip, // a capability is not declared, or a needed test has not passed
    warn, // slow
    error // of the suite; says nothing about the plugin
};
inline constexpr std::array<std::string_view, 8> verdict_texts = {"",        "pass", "fail", "crashed",
                                                                  "timeout", "skip", "warn", "error"};
inline std::string_view to_text(Verdict verdict) {
    return verdict_texts[static_cast<std::size_t>(verdict)];
}

// An image for the report.
struct ReportImage {
    std::string label;
    std::string png; // base64
    unsigned width = 0, height = 0;
};

struct Result {
    std::string test;
    Verdict verdict = Verdict::error;
    std::string message; // a sentence, or empty
    double seconds = 0;
    std::vector<ReportImage> images{};
    std::optional<std::array<unsigned, 2>> wrong_pixel{}; // of the images
    ipc::Json facts = ipc::Json::object();                // set by abi.load: the descriptor
};

} // namespace arhost::conformance
