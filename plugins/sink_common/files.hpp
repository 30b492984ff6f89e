// SPDX-License-Identifier: Apache-2.0
//
// Files as the sinks write them. Every failure is an arhost::Failure of ARHOST_STATUS_ERROR_IO whose message
// names the file, the system's reason and what to try.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <sys/types.h>

namespace arhost::files {

// "can't write 'out/film.mp4': No space left on device (free some space, or choose another path)".
Failure io_failure(const std::string &what, const std::filesystem::path &file, int error_number);

// Makes the folders that `file` is to lie in.
void make_parent_folders(const std::filesystem::path &file);

// Fails now, rather than at the first frame, where `file` can't be written. Leaves it as it is.
void check_can_write(const std::filesystem::path &file);

// Deletes a file if it is there.
void remove_file(const std::filesystem::path &file);

// `out/film.mp4` → `out/.film.mp4<suffix>`: a hidden name beside the file, for what is not yet it.
std::filesystem::path hidden_beside(const std::filesystem::path &file, std::string_view suffix);

// An open file.
class File {
public:
    File(std::filesystem::path path, int open_flags);
    ~File();
    File(File &&other) noexcept;
    File &operator=(File &&) = delete;

    const std::filesystem::path &path() const { return path_; }
    std::uint64_t size() const;
    void append(std::span<const std::uint8_t> bytes); // in one write(2) where the system takes it so
    void write_at(std::uint64_t offset, std::span<const std::uint8_t> bytes);
    void read_at(std::uint64_t offset, std::span<std::uint8_t> bytes) const; // all of them, or it throws
    void truncate(std::uint64_t size);

private:
    std::filesystem::path path_;
    int fd_;
};

// Puts `bytes` in place of `target` through the file `scratch` in the same folder: under its own name
// the file is the old one or the whole new one, never a part.
void replace_file(const std::filesystem::path &target, const std::filesystem::path &scratch,
                  std::span<const std::uint8_t> bytes);

} // namespace arhost::files
