// SPDX-License-Identifier: Apache-2.0
// The result of a test, and the exceptions by which it ends.
#pragma once

#include "conformance/picture.hpp"
#include "model/plugin_description.hpp"

#include <array>
#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
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

// The plugin violates the requirement: a sentence with numbers, and images that show the violation. Any other
// std::exception is an error of the suite.
class Failure : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
    Failure with(std::string label, const Picture &picture) && {
        pictures.emplace_back(std::move(label), picture);
        return std::move(*this);
    }
    Failure at(unsigned x, unsigned y) && {
        wrong_pixel = {x, y};
        return std::move(*this);
    }
    std::vector<std::pair<std::string, Picture>> pictures;
    std::optional<std::array<unsigned, 2>> wrong_pixel;
};
struct Skip : std::runtime_error {
    using std::runtime_error::runtime_error;
};
struct Warning : std::runtime_error {
    using std::runtime_error::runtime_error;
};

// An image for the report.
struct ReportImage {
    std::string label;
    std::string png; // base64
    unsigned width = 0, height = 0;
};

// Facts about the plugin, which the test abi.load sets.
struct Facts {
    model::PluginDescription descriptor;
    std::string sandbox; // active and missing layers, from sandbox::to_text
};

struct Result {
    std::string test;
    Verdict verdict = Verdict::error;
    std::string message; // a sentence, or empty
    double seconds = 0;
    std::vector<ReportImage> images{};
    std::optional<std::array<unsigned, 2>> wrong_pixel{}; // of the images
    std::optional<Facts> facts{};
};

} // namespace arhost::conformance
