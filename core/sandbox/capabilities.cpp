// SPDX-License-Identifier: Apache-2.0
#include "sandbox/layers.hpp"

#include <linux/capability.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace arhost::sandbox {

// Root keeps CAP_DAC_OVERRIDE, because a process in a container may have to write files of other users in mounted
// volumes. Landlock and the mounts limit the files that it can write. Other users keep no capability.
Layer drop_capabilities() {
    const unsigned kept = CAP_DAC_OVERRIDE, mask = ::geteuid() == 0 ? 1u << kept : 0;
    for (unsigned capability = 0; ::prctl(PR_CAPBSET_READ, capability, 0, 0, 0) >= 0; ++capability)
        if (capability != kept || !mask)
            ::prctl(PR_CAPBSET_DROP, capability, 0, 0, 0); // may fail; the call of capset below is decisive
    __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
    __user_cap_data_struct data[2] = {};
    if (::syscall(SYS_capget, &header, data) != 0)
        return {"capabilities", "", error_text("capget")};
    data[0].effective &= mask;
    data[0].permitted &= mask;
    data[0].inheritable = 0;
    data[1] = {};
    ::prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL, 0, 0, 0);
    if (::syscall(SYS_capset, &header, data) != 0)
        return {"capabilities", "", error_text("capset")};
    return {"capabilities", "dropped", ""};
}

} // namespace arhost::sandbox
