// SPDX-License-Identifier: Apache-2.0
// The defect of a wrong plugin, selected by its file name: a link source_late.so selects the defect "late".
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <csignal>
#include <dlfcn.h>
#include <filesystem>
#include <string>
#include <string_view>
#include <unistd.h>
#include <utility>
#include <vector>

namespace arhost::test {

inline std::filesystem::path library_file() {
    Dl_info info{};
    ::dladdr(&arhost_entry, &info);
    return info.dli_fname;
}
inline const std::string &library_name() {
    static const std::string name = library_file().stem().string();
    return name;
}

inline const char *library_id() {
    static const std::string id = "org.arhost.test." + library_name();
    return id.c_str();
}

inline bool has(std::string_view defect) {
    return library_name().substr(library_name().find('_') + 1) == defect;
}

inline void crash() {
    std::signal(SIGSEGV, SIG_DFL); // a sanitizer may handle it
    std::raise(SIGSEGV);
}
inline void hang() {
    for (;;)
        ::pause();
}
// The defects "crash_in_…" and "hang_in_…". Call at the beginning of each function of the plugin.
inline void misbehave_in(const std::string &function) {
    if (has("crash_in_" + function))
        crash();
    if (has("hang_in_" + function))
        hang();
}
inline void leak_memory(std::size_t bytes) {
    static std::vector<std::vector<char>> kept;
    kept.emplace_back(bytes, 'x');
}

// Opens a shipped plugin, to modify its behaviour.
inline const arhost_plugin &open_plugin(const std::string &file) {
    void *library = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    const auto *entry = static_cast<const arhost_entry_point *>(::dlsym(library, "arhost_entry"));
    const arhost_offer offer{sizeof offer, ARHOST_ABI_VERSION, ARHOST_ABI_VERSION};
    arhost_answer answer{sizeof answer, 0, nullptr};
    entry->negotiate(&offer, &answer);
    return *answer.plugin;
}

// Negotiates for the class T with the file's name as id.
template <class T>
arhost_status negotiate_as(const arhost_offer *offer, arhost_answer *answer, const arhost_descriptor &descriptor,
                           const void *functions) {
    static arhost_descriptor named;
    named = descriptor;
    named.id = library_id();
    static const arhost_plugin plugin = {
        sizeof plugin, 0, &named, functions, detail::create<T>, detail::destroy<T>, detail::no_extension};
    return negotiate(offer, answer, plugin);
}

} // namespace arhost::test
