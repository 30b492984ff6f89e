// SPDX-License-Identifier: Apache-2.0
#include "worker/library.hpp"

#include "ipc/protocol.hpp"
#include "model/plugin_description.hpp"
#include "sandbox/sandbox.hpp"

#include <algorithm>
#include <cstddef>
#include <dlfcn.h>
#include <initializer_list>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

namespace arhost::worker {
namespace {

std::string joined(std::span<const std::string_view> list) {
    std::string text;
    for (const std::string_view word : list)
        text.append(text.empty() ? "" : ", ").append(word);
    return text;
}

[[noreturn]] void reject(const std::filesystem::path &file, const std::string &why) {
    throw std::runtime_error(file.string() + ": " + why);
}

using NamedFunctions = std::initializer_list<std::pair<const char *, bool>>; // name; whether it is not NULL

void check_functions(const std::filesystem::path &file, NamedFunctions functions, const std::string &owner) {
    for (const auto &[name, is_present] : functions)
        if (!is_present)
            reject(file, "its function '" + std::string(name) + "' is NULL, but " + owner + " must have it");
}

// Minimum sizes of the structs: their sizes in ABI version 1 (docs/abi.md).
#define ARHOST_SIZE_UP_TO(type, last) (offsetof(type, last) + sizeof(type::last))
constexpr std::size_t entry_point_size = ARHOST_SIZE_UP_TO(arhost_entry_point, negotiate),
                      plugin_size = ARHOST_SIZE_UP_TO(arhost_plugin, get_extension),
                      descriptor_size = ARHOST_SIZE_UP_TO(arhost_descriptor, needs),
                      option_size = ARHOST_SIZE_UP_TO(arhost_option_descriptor, help);
template <class Functions> constexpr std::size_t functions_size = ARHOST_SIZE_UP_TO(Functions, stop);

template <class Functions, class PerFrame>
void check_kind(const std::filesystem::path &file, const void *functions, PerFrame per_frame, const char *name,
                const std::string &owner) {
    const auto &f = *static_cast<const Functions *>(functions);
    if (f.struct_size < functions_size<Functions>)
        reject(file, "its function table is too small for " + owner + "; build it against this arhost's headers");
    check_functions(file, {{"start", f.start}, {name, f.*per_frame}, {"stop", f.stop}}, owner);
}

void check_kind(const std::filesystem::path &file, const arhost_plugin &plugin) {
    if (!plugin.functions)
        reject(file, "its function table (arhost_plugin.functions) is NULL");
    switch (plugin.descriptor->kind) {
    case ARHOST_KIND_SOURCE:
        return check_kind<arhost_source>(file, plugin.functions, &arhost_source::read, "read", "a source");
    case ARHOST_KIND_TRACKER:
        return check_kind<arhost_tracker>(file, plugin.functions, &arhost_tracker::track, "track", "a tracker");
    case ARHOST_KIND_RAYTRACER:
        return check_kind<arhost_raytracer>(file, plugin.functions, &arhost_raytracer::render, "render",
                                            "a ray tracer");
    case ARHOST_KIND_SINK:
        return check_kind<arhost_sink>(file, plugin.functions, &arhost_sink::write, "write", "a sink");
    default:
        reject(file, "its kind is " + std::to_string(plugin.descriptor->kind) + ", which is invalid");
    }
}

// Substrings of dlopen's out-of-memory messages; the message depends on the step that failed.
constexpr const char *dlopen_memory_errors[] = {"annot allocate ", "cannot create ", "cannot map zero-fill pages",
                                                "cannot change memory protections", "failed to map segment"};

} // namespace

const arhost_entry_point &open_library(const std::filesystem::path &file) {
    void *library = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        const std::string reason = ::dlerror();
        const auto mentions = [&](const char *words) { return reason.find(words) != std::string::npos; };
        const char *hint = "";
        if (mentions("cannot open shared object file"))
            hint =
                " (if the sandbox hides the folder of that file, set 'reads: [FOLDER]' in the configuration or pass "
                "'--reads FOLDER' to plugins and conform)";
        else if (mentions("Operation not permitted")) // an executable stack, relocations in code, a writable folder
            hint = " (the sandbox executes no memory and no file that the plugin may write: set 'allow: [jit]', or "
                   "link with -z noexecstack -z text, and install the library in another folder)";
        else if (std::ranges::any_of(dlopen_memory_errors, mentions))
            hint = " (out of memory: 'memory_mb' may be too small)";
        reject(file, "cannot be loaded: " + reason + hint);
    }
    const auto *entry = static_cast<const arhost_entry_point *>(::dlsym(library, "arhost_entry"));
    if (!entry)
        reject(file, "is not an arhost plugin: it exports no symbol 'arhost_entry'");
    if (entry->struct_size < entry_point_size)
        reject(file, "its arhost_entry is too small; build it against this arhost's headers");
    if (!entry->negotiate)
        reject(file, "its arhost_entry has no negotiate function");
    return *entry;
}

const arhost_plugin &negotiate(const std::filesystem::path &file, const arhost_entry_point &entry) {
    const arhost_offer offer{sizeof offer, ARHOST_ABI_VERSION, ARHOST_ABI_VERSION};
    arhost_answer answer{.struct_size = sizeof answer, .abi_version = 0xffffffffu, .plugin = nullptr};
    const arhost_status status = entry.negotiate(&offer, &answer);
    const std::string versions = "this arhost supports only ABI version " + std::to_string(ARHOST_ABI_VERSION);
    if (status != ARHOST_STATUS_OK)
        reject(file,
               "does not support the offered ABI version; " + versions + ": build the plugin against its headers");
    if (answer.abi_version < offer.oldest_abi_version || answer.abi_version > offer.newest_abi_version)
        reject(file, "chose ABI version " + std::to_string(answer.abi_version) + "; " + versions +
                         ": build the plugin against its headers");
    const arhost_plugin *plugin = answer.plugin;
    if (!plugin)
        reject(file, "its negotiate returned no arhost_plugin");
    if (plugin->struct_size < plugin_size)
        reject(file, "its arhost_plugin is too small; build it against this arhost's headers");
    if (!plugin->descriptor)
        reject(file, "its arhost_plugin has no descriptor");
    if (plugin->descriptor->struct_size < descriptor_size)
        reject(file, "its arhost_descriptor is too small; build it against this arhost's headers");
    if (!plugin->descriptor->id)
        reject(file, "its arhost_descriptor has no id");
    if (const std::string problem = model::problem_with_id(plugin->descriptor->id, file); !problem.empty())
        reject(file, problem);
    for (const char *const *need = plugin->descriptor->needs; need && *need; ++need)
        if (std::ranges::find(sandbox::allowances, *need) == sandbox::allowances.end())
            reject(file, std::string("it needs '") + *need +
                             "', which this arhost cannot allow; a plugin may "
                             "need " +
                             joined(sandbox::allowances));
    check_functions(
        file, {{"create", plugin->create}, {"destroy", plugin->destroy}, {"get_extension", plugin->get_extension}},
        "every plugin");
    if (plugin->descriptor->option_count > 0 && !plugin->descriptor->options)
        reject(file, "its arhost_descriptor.option_count is not 0, but its options are NULL");
    if (plugin->descriptor->option_count > 0 &&
        (plugin->descriptor->options->struct_size < option_size ||
         plugin->descriptor->options->struct_size % alignof(arhost_option_descriptor) != 0))
        reject(file, "the struct_size of its options does not match arhost_option_descriptor");
    const auto options = model::options_of(*plugin->descriptor);
    if (const auto found = std::ranges::find(options, nullptr, &arhost_option_descriptor::key);
        found != options.end())
        reject(file, "its option " + std::to_string(found - options.begin()) + " has no key");
    check_kind(file, *plugin);
    return *plugin;
}

std::uint64_t state_size_of(const arhost_tracker &tracker, arhost_instance *instance) {
    if (tracker.struct_size < ARHOST_SIZE_UP_TO(arhost_tracker, state_size) || !tracker.state_size)
        return 0;
    const std::uint64_t size = tracker.state_size(instance);
    if (size > ARHOST_MAX_STATE)
        throw std::runtime_error("the tracker's state_size is " + std::to_string(size) + " bytes; the limit is " +
                                 std::to_string(ARHOST_MAX_STATE));
    return size;
}

std::uint64_t state_size_of(const arhost_raytracer &raytracer, arhost_instance *instance) {
    if (raytracer.struct_size < ARHOST_SIZE_UP_TO(arhost_raytracer, state_size) || !raytracer.state_size)
        return 0;
    const std::uint64_t size = raytracer.state_size(instance);
    if (size > ipc::max_raytracer_state)
        throw std::runtime_error("the ray tracer's state_size is " + std::to_string(size) + " bytes; the limit is " +
                                 std::to_string(ipc::max_raytracer_state));
    return size;
}

double aspect_of(const arhost_tracker &tracker, arhost_instance *instance, std::uint32_t marker) {
    if (tracker.struct_size < ARHOST_SIZE_UP_TO(arhost_tracker, aspect) || !tracker.aspect)
        return 1;
    const double aspect = tracker.aspect(instance, marker);
    if (!(aspect >= 0.01 && aspect <= 100))
        throw std::runtime_error("the aspect of the tracker's marker " + std::to_string(marker) + " is " +
                                 std::to_string(aspect) + "; it must be 0.01 to 100");
    return aspect;
}

} // namespace arhost::worker
