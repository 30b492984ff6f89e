// SPDX-License-Identifier: Apache-2.0
//
// File operations of the sinks. They throw arhost::Failure (ARHOST_STATUS_ERROR_IO) with a message that names the
// file, the system's reason and what to change.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <sys/types.h>

namespace arhost::files {

// "cannot write 'out/film.mp4': No space left on device (free some space, or choose another path)".
Failure io_failure(const std::string &what, const std::filesystem::path &file, int error_number);

// Creates the parent folders of `file`.
void make_parent_folders(const std::filesystem::path &file);

// Throws if `file` cannot be opened for writing, so that a run fails at its start. Does not change the file.
void check_can_write(const std::filesystem::path &file);

// Deletes a file if it exists.
void remove_file(const std::filesystem::path &file);

// `out/film.mp4` → `out/.film.mp4<suffix>`: a hidden temporary file in the same folder.
std::filesystem::path hidden_sibling(const std::filesystem::path &file, std::string_view suffix);

class File {
public:
    File(std::filesystem::path path, int open_flags);
    ~File();
    File(File &&other) noexcept;
    File &operator=(File &&) = delete;

    const std::filesystem::path &path() const { return path_; }
    std::uint64_t size() const;
    void append(std::span<const std::uint8_t> bytes); // in one write(2) unless the system writes less
    void write_at(std::uint64_t offset, std::span<const std::uint8_t> bytes);
    void read_at(std::uint64_t offset, std::span<std::uint8_t> bytes) const; // all bytes, or throws
    void truncate(std::uint64_t size);

private:
    std::filesystem::path path_;
    int fd_;
};

// Replaces `target` by `bytes` atomically: writes `scratch`, in the same folder, and renames it.
void replace_file(const std::filesystem::path &target, const std::filesystem::path &scratch,
                  std::span<const std::uint8_t> bytes);

} // namespace arhost::files
