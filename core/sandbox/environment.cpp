// SPDX-License-Identifier: Apache-2.0
//
// Removes environment variables: some contain secrets (tokens, keys); others are kept because libraries and drivers
// need them.
#include "sandbox/layers.hpp"

#include <algorithm>
#include <fnmatch.h>
#include <unistd.h>

namespace arhost::sandbox {
namespace {

// Variables that common libraries read and that are not secret. The wildcards match no known variable with a secret.
constexpr const char *kept[] = {
    // the user and the system
    "HOME", "LANG", "LANGUAGE", "LC_*", "LD_*", "LOGNAME", "PATH", "SHELL", "TERM", "TMPDIR", "TZ", "TZDIR", "USER",
    "XDG_*_DIR", "XDG_*_DIRS", "XDG_*_HOME", "XDG_CURRENT_DESKTOP", "XDG_SESSION_TYPE", "GLIBC_TUNABLES", "MALLOC_*",
    "SSL_CERT_DIR", "SSL_CERT_FILE",
    // windows
    "DISPLAY", "WAYLAND_DISPLAY", "XAUTHORITY", "XLOCALEDIR", "GDK_*", "QT_*", "SDL_*",
    // GPUs and software renderers
    "VK_*", "MESA_*", "LIBGL_*", "GALLIUM_*", "GALLIVM_*", "LP_*", "EGL_*", "GBM_*", "DRI_*", "__EGL_*", "__GL*",
    "__NV_*", "__VK_*", "RADV_*", "ACO_*", "AMD_DEBUG", "ANV_*", "INTEL_DEBUG", "ZINK_*", "LIBVA_*", "VDPAU_*",
    "CUDA_*", "NVIDIA_DRIVER_CAPABILITIES", "NVIDIA_VISIBLE_DEVICES", "OPTIX_*", "OCL_*", "ROCR_VISIBLE_DEVICES",
    "HIP_VISIBLE_DEVICES", "HSA_*",
    // computing
    "OMP_*", "GOMP_*", "KMP_*", "MKL_*", "OPENBLAS_*", "TBB_*", "EMBREE_*", "OPENCV_*", "HWY_*",
    // language runtimes and tools
    "PYTHON*", "VIRTUAL_ENV", "CONDA_PREFIX", "RUST_BACKTRACE", "RUST_LOG", "ASAN_*", "LSAN_*", "MSAN_*", "TSAN_*",
    "UBSAN_*", "LLVM_PROFILE_FILE", "GCOV_*",
    // variables of arhost
    "ARHOST_*"};

bool is_kept(const Policy &policy, std::string_view entry) {
    const std::string name(entry.substr(0, entry.find('=')));
    return policy.environment.contains(name) ||
           std::any_of(std::begin(kept), std::end(kept),
                       [&](const char *pattern) { return ::fnmatch(pattern, name.c_str(), 0) == 0; });
}

} // namespace

bool is_variable_name(std::string_view name) {
    return !name.empty() &&
           std::none_of(name.begin(), name.end(), [](unsigned char c) { return c <= ' ' || c == '=' || c == 0x7f; });
}

void drop_environment(const Policy &policy) {
    char **next = environ;
    for (char **entry = environ; entry && *entry; ++entry)
        if (is_kept(policy, *entry))
            *next++ = *entry;
        else
            ::explicit_bzero(*entry, std::strlen(*entry)); // /proc/self/environ shows this memory
    if (next)
        *next = nullptr;
}

} // namespace arhost::sandbox
