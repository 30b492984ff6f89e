// SPDX-License-Identifier: Apache-2.0
#include "base/program.hpp"

#include "base/text.hpp"
#include "base/write_all.hpp"

#include <csignal>
#include <cstdio>
#include <fcntl.h>
#include <unistd.h>
#include <utility>

namespace arhost::base {

void prepare_process() {
    // open() returns the lowest free descriptor.
    for (const auto &[stream, file] : {std::pair{0, "/dev/null"}, {1, "/dev/full"}, {2, "/dev/null"}})
        if (::fcntl(stream, F_GETFD) < 0 && ::open(file, O_RDWR) < 0) // a minimal /dev may lack /dev/full
            (void)::open("/dev/null", O_RDWR);
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGXFSZ, SIG_IGN);
    std::signal(SIGCHLD, SIG_DFL); // waitpid() fails if SIGCHLD is ignored
}

int print_error(const std::string &why, ExitStatus status) {
    std::fprintf(stderr, "error: %s\n", printable(why).c_str());
    return status;
}

int exit_status_of(const std::function<int()> &command) {
    try {
        const int status = command();
        return flush_stdout() ? status : failed;
    } catch (const InvalidInput &error) {
        return print_error(error.what(), invalid_input);
    } catch (const std::filesystem::filesystem_error
                 &error) { // for example: a file name is too long, or a folder is unreadable
        return print_error(error.path1().string() + ": " + error.code().message(), invalid_input);
    } catch (const std::exception &error) {
        return print_error(error.what(), failed);
    }
}

std::filesystem::path own_prefix() {
    return own_folder().parent_path();
}

std::filesystem::path own_folder() {
    std::filesystem::path folder = std::filesystem::read_symlink("/proc/self/exe").parent_path();
    if (!is_utf8(folder.native())) // the protocol of the workers requires UTF-8 paths
        throw std::runtime_error("arhost is in a folder whose path is not UTF-8: " + folder.string());
    return folder;
}

} // namespace arhost::base
