// SPDX-License-Identifier: Apache-2.0
#include "cli/output_locks.hpp"

#include "base/file_identity.hpp"
#include "base/text.hpp"
#include "run_config/access.hpp"

#include <spdlog/fmt/fmt.h>

#include <cstdlib>
#include <fcntl.h>
#include <functional>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

namespace arhost::cli {
namespace {

namespace fs = std::filesystem;

// Returns the folder of the locks, or "" if it cannot be created or belongs to another user.
fs::path lock_folder() {
    const char *runtime = std::getenv("XDG_RUNTIME_DIR");
    const fs::path folder =
        runtime && *runtime ? fs::path(runtime) / "arhost" : fs::path("/tmp/arhost-" + std::to_string(::getuid()));
    (void)::mkdir(folder.c_str(), 0700);
    struct stat status {};
    const bool is_own = ::lstat(folder.c_str(), &status) == 0 && S_ISDIR(status.st_mode) &&
                        status.st_uid == ::getuid() && !(status.st_mode & 022);
    return is_own ? folder : fs::path();
}

// Opens a lock and takes it. Opens it again if the run that held it has removed its file in the meantime. Returns
// without a descriptor if the file cannot be opened; `is_taken`: another run holds the lock.
base::UniqueFd take(const fs::path &name, bool &is_taken) {
    for (;;) {
        base::UniqueFd lock(::open(name.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
        is_taken = lock && ::flock(lock.get(), LOCK_EX | LOCK_NB) != 0;
        struct stat opened {
        }, current{};
        if (!lock || is_taken || ::fstat(lock.get(), &opened) != 0 ||
            (::stat(name.c_str(), &current) == 0 && opened.st_ino == current.st_ino))
            return lock;
    }
}

// Whether an output to this path creates files.
bool creates_files(const yaml::Node &path) {
    std::error_code ignored;
    const auto type = fs::status(path.output_path(), ignored).type();
    return !run_config::is_standard_output(path) && type != fs::file_type::fifo && type != fs::file_type::character;
}

} // namespace

OutputLocks::OutputLocks(const run_config::Configuration &configuration) {
    const fs::path folder = lock_folder();
    if (folder.empty())
        return;
    for (const run_config::ComponentConfiguration &output : configuration.outputs) {
        const auto path = run_config::path_of(output.node);
        if (!path || !creates_files(*path))
            continue;
        const std::string file = base::real_path(path->output_path()).string();
        const fs::path name = folder / fmt::format("output-{:016x}", std::hash<std::string>()(file));
        bool is_taken = false;
        base::UniqueFd lock = take(name, is_taken);
        if (!lock)
            continue;
        if (is_taken) {
            char owner[512];
            const ssize_t size = ::pread(lock.get(), owner, sizeof owner, 0);
            path->fail("'" + base::printable(file) + "' is being written by another run (" +
                       base::printable(std::string(owner, size > 0 ? static_cast<std::size_t>(size) : 0)) +
                       "); end that run, or choose another path");
        }
        const std::string owner = fmt::format("process {}, {}", ::getpid(), configuration.node.file().string());
        if (::ftruncate(lock.get(), 0) == 0)
            (void)::pwrite(lock.get(), owner.data(), owner.size(), 0);
        locks_.push_back({name, std::move(lock)});
    }
}

OutputLocks::~OutputLocks() {
    for (const Lock &lock : locks_)
        (void)::unlink(lock.name.c_str());
}

} // namespace arhost::cli
