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

fs::path lock_of(const fs::path &file) {
    return base::runtime_folder() / fmt::format("output-{:016x}", std::hash<std::string>()(file.string()));
}

[[noreturn]] void fail(const yaml::Node &path, const fs::path &file, const base::UniqueFd &lock) {
    char owner[512];
    const ssize_t size = ::pread(lock.get(), owner, sizeof owner, 0);
    path.fail("'" + base::printable(file.string()) + "' is being written by another run (" +
              base::printable(std::string(owner, size > 0 ? static_cast<std::size_t>(size) : 0)) +
              "); end that run, or choose another path");
}

// Throws if another run writes a folder that contains `file`, such as a session.
void expect_free_folders(const yaml::Node &path, const fs::path &file) {
    for (fs::path folder = file.parent_path(); folder.has_relative_path(); folder = folder.parent_path()) {
        const base::UniqueFd lock(::open(lock_of(folder).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
        if (lock && ::flock(lock.get(), LOCK_SH | LOCK_NB) != 0)
            fail(path, folder, lock);
    }
}

} // namespace

OutputLocks::OutputLocks(const run_config::Configuration &configuration) {
    try {
        base::make_runtime_folder();
    } catch (const std::runtime_error &) {
        return; // a run must not fail because of a foreign folder
    }
    const std::string owner = fmt::format("process {}, {}", ::getpid(), configuration.node.file().string());
    std::vector<yaml::Node> paths;
    for (const run_config::ComponentConfiguration &output : configuration.outputs)
        if (const auto path = run_config::path_of(output.node))
            paths.push_back(*path);
    for (const run_config::OutputFile &report : configuration.report_files())
        paths.push_back(report.path);
    for (const yaml::Node &path : paths) {
        if (!creates_files(path))
            continue;
        const fs::path file = base::real_path(path.output_path());
        expect_free_folders(path, file);
        bool is_taken = false;
        base::UniqueFd lock = take(lock_of(file), is_taken);
        if (is_taken)
            fail(path, file, lock);
        if (lock && ::ftruncate(lock.get(), 0) == 0)
            (void)::pwrite(lock.get(), owner.data(), owner.size(), 0);
        if (lock)
            locks_.push_back({lock_of(file), std::move(lock)});
    }
}

OutputLocks::~OutputLocks() {
    for (const Lock &lock : locks_)
        (void)::unlink(lock.name.c_str());
}

} // namespace arhost::cli
