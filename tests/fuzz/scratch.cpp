// SPDX-License-Identifier: Apache-2.0
#include "targets.hpp"

#include <chrono>
#include <fcntl.h>
#include <fstream>
#include <stdexcept>
#include <stdlib.h>
#include <string>
#include <sys/file.h>
#include <unistd.h>

namespace arhost::fuzz {
namespace {

namespace fs = std::filesystem;

class Folder {
public:
    Folder() {
        std::string pattern =
            ((fs::exists("/dev/shm") ? fs::path("/dev/shm") : fs::temp_directory_path()) / "arhost-fuzz-XXXXXX")
                .string();
        remove_abandoned(fs::path(pattern).parent_path());
        if (!::mkdtemp(pattern.data()))
            throw std::runtime_error("mkdtemp " + pattern);
        path = pattern;
        lock_ = lock(path);
    }
    ~Folder() {
        std::error_code ignored;
        fs::remove_all(path, ignored);
    }
    Folder(const Folder &) = delete;
    Folder &operator=(const Folder &) = delete;
    fs::path path;

private:
    // Takes a lock that is held until this process ends, for whatever reason. Returns -1 if another process holds it.
    static int lock(const fs::path &folder) {
        const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
        if (fd >= 0 && ::flock(fd, LOCK_EX | LOCK_NB) == 0)
            return fd;
        ::close(fd);
        return -1;
    }
    // Removes the folders of crashed processes. Skips recent folders, because their owner may not have locked them
    // yet.
    static void remove_abandoned(const fs::path &parent) {
        std::error_code ignored;
        for (const auto &entry : fs::directory_iterator(parent, ignored))
            if (entry.path().filename().string().starts_with("arhost-fuzz-") &&
                fs::last_write_time(entry, ignored) < fs::file_time_type::clock::now() - std::chrono::minutes(1))
                if (const int fd = lock(entry); fd >= 0) {
                    fs::remove_all(entry, ignored);
                    ::close(fd);
                }
    }

    int lock_ = -1;
};

} // namespace

const fs::path &scratch() {
    static const Folder folder;
    return folder.path;
}

fs::path write_scratch(const fs::path &name, Bytes content) {
    fs::path file = scratch() / name;
    fs::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char *>(content.data()), static_cast<std::streamsize>(content.size()));
    return file;
}

} // namespace arhost::fuzz
