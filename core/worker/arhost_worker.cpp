// SPDX-License-Identifier: Apache-2.0
//
// arhost-worker: runs one plugin, loads one scene, or reads the log of one session. The launcher starts it with the
// control channel as descriptor 3 and the doorbell as descriptor 4.
#include "worker/session.hpp"

#include <cstdio>
#include <fcntl.h>

int main() {
    using namespace arhost;
    constexpr int control_fd = 3, doorbell_fd = 4;
    if (::fcntl(control_fd, F_GETFD) < 0 || ::fcntl(doorbell_fd, F_GETFD) < 0) {
        std::fprintf(stderr, "arhost-worker is started by arhost, not by hand: arhost --config FILE\n");
        return 2;
    }
    worker::retain_freed_memory();
    worker::Link link{ipc::Channel(base::UniqueFd(control_fd)), base::UniqueFd(doorbell_fd)};
    return worker::run(link);
}
