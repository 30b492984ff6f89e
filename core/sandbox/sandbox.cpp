// SPDX-License-Identifier: Apache-2.0
#include "sandbox/layers.hpp"

#include <algorithm>
#include <cstdlib>
#include <stdexcept>
#include <sys/prctl.h>

namespace arhost::sandbox {
namespace {

Layer set_no_new_privileges() {
    if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0)
        return {"no_new_privs", "", error_text("prctl")};
    return {"no_new_privs", "yes", ""};
}

// Gives each plugin a separate folder for the shader cache of the GPU driver.
void add_shader_cache(Policy &policy, const std::filesystem::path &plugin) {
    const char *caches = std::getenv("XDG_CACHE_HOME"), *home = std::getenv("HOME");
    if (policy.mode == Mode::none || !policy.allows("gpu") || (!caches && !home))
        return;
    const auto folder =
        (caches ? std::filesystem::path(caches) : std::filesystem::path(home) / ".cache") / "arhost" / plugin.stem();
    policy.writable.push_back(folder);
    for (const char *variable : {"XDG_CACHE_HOME", "MESA_SHADER_CACHE_DIR", "__GL_SHADER_DISK_CACHE_PATH",
                                 "CUDA_CACHE_PATH", "OPTIX_CACHE_PATH"})
        ::setenv(variable, folder.c_str(), 1);
}

// Returns the folder of the plugins that are installed with this program, which are trusted.
std::filesystem::path own_plugin_folder() {
    std::error_code ignored;
    return std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path().parent_path() /
           "lib/arhost/plugins";
}

} // namespace

bool complete(const Level &level) {
    return std::all_of(level.begin(), level.end(), [](const Layer &layer) { return layer.missing.empty(); });
}

std::string to_text(const Level &level) {
    std::string active, missing;
    for (const Layer &layer : level) {
        if (!layer.active.empty())
            active += (active.empty() ? "" : "; ") + layer.name + ": " + layer.active;
        if (!layer.missing.empty())
            missing += (missing.empty() ? "" : "; ") + layer.name + ": " + layer.missing;
    }
    if (level.empty())
        return "none";
    return active + (missing.empty() ? "" : "; MISSING " + missing);
}

Level enter(Policy policy) {
    Level level;
    if (policy.mode == Mode::none)
        return level;
    for (const std::filesystem::path &folder : policy.writable) {
        std::error_code ignored; // a later write to the folder reports the error
        std::filesystem::create_directories(folder, ignored);
    }
    // The other layers hide the folder where the device is found. A device that is connected later has another node,
    // so the worker must then be restarted.
    if (!policy.usb_device.empty())
        if (const auto device = base::find_usb_device(policy.usb_device))
            policy.usb_node = device->node;
    drop_environment(policy);
    level.push_back(raise_oom_score());
    level.push_back(report_control_group());
    level.push_back(enter_namespaces(policy));
    if (!level.back().confines_files) // without a mount namespace, nothing would limit and delete the folder's files
        policy.scratch.clear();
    level.push_back(set_limits(policy));
    level.push_back(drop_capabilities());
    level.push_back(set_no_new_privileges());
    level.push_back(enter_landlock(policy));
    level.push_back(filter_system_calls(policy));
    if (!policy.scratch.empty())
        point_to_scratch(policy);
    if (policy.mode == Mode::strict && !complete(level))
        throw std::runtime_error("sandbox: " + to_text(level) +
                                 "; 'sandbox: strict' requires all layers: fix this or set 'permissive'");
    return level;
}

Level enter_for(const std::filesystem::path &plugin, Policy policy) {
    std::error_code ignored;
    const auto own_folder = own_plugin_folder();
    const bool is_own = contains(own_folder, std::filesystem::weakly_canonical(plugin, ignored));
    policy.readable.push_back(plugin);
    policy.readable.push_back(own_folder);
    add_shader_cache(policy, plugin);
    policy.scratch = "/arhost-scratch"; // in the sandbox's own root folder, so other paths cannot contain it
    Level level = enter(policy);
    if (policy.mode == Mode::standard && !is_own && std::ranges::none_of(level, &Layer::confines_files))
        throw std::runtime_error("sandbox: " + to_text(level) +
                                 "; this machine can confine no files, so only the plugins in " +
                                 own_folder.string() + " may run: fix this or set 'sandbox: permissive'");
    return level;
}

} // namespace arhost::sandbox
