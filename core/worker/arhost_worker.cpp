// SPDX-License-Identifier: Apache-2.0
//
// arhost-worker: started by the host's launcher with its control channel as descriptor 3 and its doorbell as
// descriptor 4; of no use by hand.
#include "worker/session.hpp"

#include <cstdio>
#include <fcntl.h>
#include <malloc.h>

namespace {

// What a plugin frees after a frame it wants again with the next one: giving it back to the system in between costs
// trackers a quarter of their time, in page faults. (glibc raises these thresholds by itself only in processes that
// have freed something large.)
void keep_freed_memory() {
#ifdef __GLIBC__
    constexpr int mib = 1 << 20;
    ::mallopt(M_MMAP_THRESHOLD, 32 * mib); // the most that it takes
    ::mallopt(M_TRIM_THRESHOLD, 64 * mib);
#endif
}

} // namespace

int main() {
    using namespace arhost;
    constexpr int control_fd = 3, doorbell_fd = 4;
    if (::fcntl(control_fd, F_GETFD) < 0 || ::fcntl(doorbell_fd, F_GETFD) < 0) {
        std::fprintf(stderr, "arhost-worker is started by arhost, not by hand: arhost --config FILE\n");
        return 2;
    }
    keep_freed_memory();
    worker::Link link{ring::Channel(ring::UniqueFd(control_fd)), ring::UniqueFd(doorbell_fd)};
    return worker::work(link);
}
