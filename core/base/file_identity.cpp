// SPDX-License-Identifier: Apache-2.0
#include "base/file_identity.hpp"

#include <sys/stat.h>

namespace arhost::base {

namespace fs = std::filesystem;

FileIdentity identity_of(const fs::path &file) {
    std::string path = real_path(file);
    struct stat status {};
    std::string node = ::stat(file.c_str(), &status) == 0
                           ? std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino)
                           : path;
    return {std::move(path), std::move(node)};
}

fs::path real_path(const fs::path &file) {
    std::error_code error;
    fs::path path = fs::absolute(file);
    constexpr int max_links = 40; // same limit as in the kernel
    for (int i = 0; i < max_links && !fs::exists(path, error) && fs::is_symlink(path, error); ++i)
        path = path.parent_path() / fs::read_symlink(path, error); // weakly_canonical does not resolve dangling links
    const fs::path canonical = fs::weakly_canonical(path, error);
    return error ? path.lexically_normal() : canonical;
}

} // namespace arhost::base
