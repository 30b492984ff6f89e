// SPDX-License-Identifier: Apache-2.0
#include "targets.hpp"

#include <fstream>
#include <stdexcept>
#include <stdlib.h>
#include <string>

namespace arhost::fuzz {
namespace {

namespace fs = std::filesystem;

class Folder {
public:
    Folder() {
        std::string pattern =
            ((fs::exists("/dev/shm") ? fs::path("/dev/shm") : fs::temp_directory_path()) / "arhost-fuzz-XXXXXX")
                .string();
        if (!::mkdtemp(pattern.data()))
            throw std::runtime_error("mkdtemp " + pattern);
        path = pattern;
    }
    ~Folder() {
        std::error_code ignored;
        fs::remove_all(path, ignored);
    }
    Folder(const Folder &) = delete;
    Folder &operator=(const Folder &) = delete;
    fs::path path;
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
