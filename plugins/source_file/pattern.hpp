// SPDX-License-Identifier: Apache-2.0
//
// Numbered files: "frames/image_%04d.png". The pattern is parsed here and never handed to printf.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

namespace arhost {

class Pattern {
public:
    // None where the path has no percent sign. Throws Failure where it has anything but one %d or %0Nd.
    static std::optional<Pattern> parse(const std::filesystem::path &path);

    std::filesystem::path file(std::int64_t number) const;
    std::optional<std::int64_t> number(const std::string &file_name) const;
    const std::filesystem::path &folder() const { return folder_; }

    // The files that the folder has, by their number.
    std::map<std::int64_t, std::filesystem::path> scan() const;

private:
    std::filesystem::path folder_;
    std::string prefix_, suffix_; // of the file's name
    std::size_t digits_ = 1;      // at least so many
};

std::string quoted(const std::filesystem::path &path); // 'path', for messages

// "the folder '/x/frames' has 3 entries: a.png, b.png, c.png", for messages.
std::string describe_folder(const std::filesystem::path &folder);

} // namespace arhost
