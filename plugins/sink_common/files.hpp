// SPDX-License-Identifier: Apache-2.0
//
// File operations of the sinks. On failure, they throw arhost::Failure with a message that names the file, the
// system's reason, and the required change. The status is ARHOST_STATUS_ERROR_CONFIGURATION if retrying cannot help,
// for example if permission is missing; otherwise it is ARHOST_STATUS_ERROR_IO.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <sys/types.h>

namespace arhost::files {

// Returns an error such as "cannot write 'out/video.mp4': No space left on device (free some space, or choose another
// path)".
Failure io_failure(const std::string &what, const std::filesystem::path &file, int error_number);

// Creates the parent folders of `file`.
void make_parent_folders(const std::filesystem::path &file);

// Throws if `file` cannot be opened for writing. Sinks call it at the start of a run, so the run does not fail later.
// Does not change the file.
void check_can_write(const std::filesystem::path &file);

// Deletes a file if it exists.
void remove_file(const std::filesystem::path &file);

// Returns the path of a hidden file in the same folder: `out/video.mp4` → `out/.video.mp4<suffix>`.
std::filesystem::path hidden_sibling(const std::filesystem::path &file, std::string_view suffix);

class File {
public:
    File(std::filesystem::path path, int open_flags);
    ~File();
    File(File &&other) noexcept;
    File &operator=(File &&) = delete;

    const std::filesystem::path &path() const { return path_; }
    std::uint64_t size() const;
    void append(std::span<const std::uint8_t> bytes); // one write(2), unless the system writes fewer bytes
    void write_at(std::uint64_t offset, std::span<const std::uint8_t> bytes);
    void read_at(std::uint64_t offset, std::span<std::uint8_t> bytes) const; // fills `bytes` completely or throws
    void truncate(std::uint64_t size);

private:
    std::filesystem::path path_;
    int fd_;
};

// Atomically replaces the contents of `target` with `bytes`: writes them to `scratch`, which must be in the same
// folder, and renames it to `target`.
void replace_file(const std::filesystem::path &target, const std::filesystem::path &scratch,
                  std::span<const std::uint8_t> bytes);

} // namespace arhost::files
