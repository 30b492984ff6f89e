// SPDX-License-Identifier: Apache-2.0
#include "base/runtime_folder.hpp"

#include <cerrno>
#include <cstdlib>
#include <string>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>

namespace arhost::base {

namespace fs = std::filesystem;

fs::path runtime_folder() {
    const char *runtime = std::getenv("XDG_RUNTIME_DIR");
    return runtime && *runtime == '/' ? fs::path(runtime) / "arhost"
                                      : fs::path("/tmp/arhost-" + std::to_string(::geteuid()));
}

void make_runtime_folder() {
    const fs::path folder = runtime_folder();
    if (::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST)
        throw std::system_error(errno, std::generic_category(), "cannot create the folder '" + folder.string() + "'");
    struct stat status {};
    if (::lstat(folder.c_str(), &status) != 0 || !S_ISDIR(status.st_mode) || status.st_uid != ::geteuid() ||
        (status.st_mode & 077) != 0)
        throw std::runtime_error("the folder '" + folder.string() +
                                 "' is not a folder of this user with mode 0700; remove it or correct its mode");
}

} // namespace arhost::base
