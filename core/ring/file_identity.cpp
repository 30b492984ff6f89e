// SPDX-License-Identifier: Apache-2.0
#include "ring/file_identity.hpp"

#include <sys/stat.h>

namespace arhost::ring {

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
    const fs::path canonical = fs::weakly_canonical(fs::absolute(file), error);
    return error ? fs::absolute(file).lexically_normal() : canonical;
}

} // namespace arhost::ring
