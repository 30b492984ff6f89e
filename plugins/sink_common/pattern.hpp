// SPDX-License-Identifier: Apache-2.0
//
// File names with a frame's number in them: "out/frame_%05d.png".
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace arhost::files {

class FramePattern {
public:
    // Nothing where the file's name has no '%'. "%%" stands for one '%', folders are taken as they are.
    // Throws a Failure of ARHOST_STATUS_ERROR_CONFIGURATION unless there is exactly one %d or %0<width>d.
    static std::optional<FramePattern> parse(const std::filesystem::path &path);

    std::filesystem::path file(std::uint64_t number) const;
    // Whether `name`, without a folder, is one that this pattern gives.
    bool matches(const std::string &name) const;

private:
    FramePattern(std::filesystem::path folder, std::string before, std::size_t width, std::string after);
    std::string name(std::uint64_t number) const;

    std::filesystem::path folder_;
    std::string before_, after_;
    std::size_t width_;
};

} // namespace arhost::files
