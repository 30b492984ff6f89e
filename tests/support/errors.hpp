// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "yaml/yaml.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <span>
#include <string>

namespace arhost::test {

// Returns the message of the `Error` that `call` throws.
template <class Error = yaml::Error, class Call> std::string error_of(const Call &call) {
    try {
        call();
    } catch (const Error &error) {
        return error.what();
    }
    return "no error";
}

// Returns `text` with paths below `folder` relative to it.
inline std::string without_folder(std::string text, const std::filesystem::path &folder) {
    const std::string prefix = folder.string() + "/";
    for (std::size_t at; (at = text.find(prefix)) != std::string::npos;)
        text.erase(at, prefix.size());
    return text;
}

// Returns `error` without `start`, with which every error must begin.
inline std::string after(const std::string &start, const std::string &error) {
    if (error == "no error")
        return error;
    EXPECT_THAT(error, testing::StartsWith(start));
    return error.substr(std::min(error.size(), start.size()));
}

// An input, and the message of the error that it causes.
struct ErrorCase {
    std::string input;
    testing::Matcher<std::string> error;
};

template <class ErrorIn> void expect_errors(const ErrorIn &error_in, std::span<const ErrorCase> cases) {
    for (const ErrorCase &expected : cases)
        EXPECT_THAT(error_in(expected.input), expected.error) << expected.input;
}

} // namespace arhost::test
