// SPDX-License-Identifier: Apache-2.0
#include "cli/output_locks.hpp"

#include "base/file_identity.hpp"
#include "base/runtime_folder.hpp"
#include "base/text.hpp"
#include "run_config/access.hpp"

#include <spdlog/fmt/fmt.h>

#include <fcntl.h>
#include <functional>
#include <stdexcept>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

namespace arhost::cli {
namespace {

namespace fs = std::filesystem;

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
    try {
        base::make_runtime_folder();
    } catch (const std::runtime_error &) {
        return; // a run must not fail because of a foreign folder
    }
    for (const run_config::ComponentConfiguration &output : configuration.outputs) {
        const auto path = run_config::path_of(output.node);
        if (!path || !creates_files(*path))
            continue;
        const std::string file = base::real_path(path->output_path()).string();
        const fs::path name = base::runtime_folder() / fmt::format("output-{:016x}", std::hash<std::string>()(file));
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
