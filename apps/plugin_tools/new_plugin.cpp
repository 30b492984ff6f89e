// SPDX-License-Identifier: Apache-2.0
#include "plugin_tools/new_plugin.hpp"

#include "base/program.hpp"
#include "base/text.hpp"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>

namespace arhost::plugin_tools {
namespace {

namespace fs = std::filesystem;
using Words = std::map<std::string, std::string>; // maps placeholders such as "@NAME@" to their replacements

// The words of the templates that depend on the kind of plugin.
struct Kind {
    const char *section; // the configuration key of such a component
    const char *python;  // the plugin that runs Python classes of this kind
    const char *count;   // the statistics' counter of frames that passed through such a component
};
const std::map<std::string, Kind> kinds = {{"raytracer", {"raytracer", "rt_python", "augmented"}},
                                           {"tracker", {"tracker", "tracker_python", "tracked"}},
                                           {"source", {"source", "source_python", "in"}},
                                           {"sink", {"outputs[0]", "sink_python", "composited"}}};

[[noreturn]] void refuse(const std::string &name, const std::string &why) {
    throw std::runtime_error("the name '" + name + "' " + why);
}
[[noreturn]] void refuse_taken(const std::string &name, const std::string &by) {
    refuse(name, by + "; choose another, as 'my_" + name + "'");
}

void check_name(const std::string &name, const std::string &language, const fs::path &prefix) {
    const auto fits = [](unsigned char c) { return std::islower(c) || std::isdigit(c) || c == '_'; };
    if (name.empty() || name.size() > 64 || !std::islower(static_cast<unsigned char>(name[0])) ||
        !std::all_of(name.begin(), name.end(), fits))
        refuse(
            name,
            "must be 1 to 64 lower-case letters, digits and underscores, starting with a letter, as in 'my_tracer'");
    // Names of CMake targets, libraries, Rust crates and build folders.
    for (const char *taken :
         {"all",   "alloc",  "arhost",  "arhost_sys",     "build",      "clean",         "core",
          "crate", "depend", "deps",    "edit_cache",     "help",       "install",       "list_install_components",
          "m",     "out",    "package", "package_source", "preinstall", "rebuild_cache", "self",
          "std",   "super",  "test"})
        if (name == taken)
            refuse_taken(name, "is reserved by a build tool or a language");
    // A script with the name of a standard module would hide the module. Names with an underscore cannot clash,
    // except those listed below.
    if (language == "python" && name.find('_') == std::string::npos)
        refuse_taken(name, "has no underscore; a Python plugin needs one, so that it cannot hide a standard module");
    for (const char *module : {"py_compile", "pydoc_data", "sre_compile", "sre_constants", "sre_parse"})
        if (language == "python" && name == module)
            refuse_taken(name, "is a standard Python module");
    if (fs::exists(prefix / "lib/arhost/plugins" / (name + ".so")))
        refuse_taken(name, "is the name of a built-in plugin");
}

std::string camel_case(const std::string &name) {
    std::string result;
    bool begins = true;
    for (const char c : name) {
        if (c != '_')
            result += begins ? static_cast<char>(std::toupper(static_cast<unsigned char>(c))) : c;
        begins = c == '_';
    }
    return result;
}

Words words_for(const NewPlugin &plugin, const fs::path &prefix) {
    const Kind &kind = kinds.at(plugin.kind);
    std::string component = "plugin: ./build/" + plugin.name + ".so";
    if (plugin.language == "rust")
        component = "plugin: ./target/debug/lib" + plugin.name + ".so";
    else if (plugin.language == "python")
        component = std::string("plugin: ") + kind.python + ", options: {script: " + plugin.name + ".py}";
    return {{"@NAME@", plugin.name},      {"@CLASS@", camel_case(plugin.name)},
            {"@KIND@", plugin.kind},      {"@SECTION@", kind.section},
            {"@COUNT@", kind.count},      {"@PLUGIN@", component},
            {"@PREFIX@", prefix.string()}};
}

std::string filled_in(std::string text, const Words &words) {
    for (const auto &[word, value] : words)
        for (std::size_t at = 0; (at = text.find(word, at)) != std::string::npos; at += value.size())
            text.replace(at, word.size(), value);
    return text;
}

bool has_word(const std::string &text, const std::string &word) {
    const auto is_word_char = [&](std::size_t at) {
        return at < text.size() && (std::isalnum(static_cast<unsigned char>(text[at])) || text[at] == '_');
    };
    for (std::size_t at = 0; (at = text.find(word, at)) != std::string::npos; ++at)
        if ((at == 0 || !is_word_char(at - 1)) && !is_word_char(at + word.size()))
            return true;
    return false;
}

void copy_file(const fs::path &from, const fs::path &to, const Words &words) {
    std::ostringstream text;
    text << std::ifstream(from, std::ios::binary).rdbuf();
    const std::string &name = words.at("@NAME@"), &type = words.at("@CLASS@");
    if (text.str().find("@CLASS@") != std::string::npos && has_word(text.str(), type))
        refuse_taken(name, "results in the class name '" + type + "', which the skeleton already uses");
    if (fs::exists(to))
        refuse_taken(name, "is the name of another file of the skeleton");
    fs::create_directories(to.parent_path());
    std::ofstream file(to, std::ios::binary);
    file << filled_in(text.str(), words) << std::flush;
    if (!file)
        throw std::runtime_error("cannot write " + to.string());
}

// Copies recursively, except for top-level folders named after plugin kinds.
void copy_folder(const fs::path &from, const fs::path &to, const Words &words) {
    for (auto it = fs::recursive_directory_iterator(from); it != fs::recursive_directory_iterator(); ++it) {
        const bool is_kind = it.depth() == 0 && kinds.contains(it->path().filename().string());
        if (it->is_directory() && is_kind)
            it.disable_recursion_pending();
        else if (!it->is_directory())
            copy_file(it->path(), to / filled_in(it->path().lexically_relative(from).string(), words), words);
    }
}

} // namespace

int new_plugin(const NewPlugin &plugin, const fs::path &prefix) {
    check_name(plugin.name, plugin.language, prefix);
    const fs::path folder = plugin.into / plugin.name;
    if (fs::symlink_status(folder).type() != fs::file_type::not_found)
        throw std::runtime_error(folder.string() + " already exists; choose another name or --into");
    if (!base::is_utf8(fs::absolute(folder).native()))
        throw std::runtime_error(folder.string() + ": the path is not UTF-8, which arhost requires");
    const fs::path templates = prefix / "share/arhost/templates";
    if (!fs::is_directory(templates))
        throw std::runtime_error("the SDK's templates are missing: " + templates.string() + "; reinstall arhost");

    const Words words = words_for(plugin, prefix);
    fs::create_directories(plugin.into);
    std::string pattern = folder.string() + ".XXXXXX";
    if (!::mkdtemp(pattern.data()))
        throw std::runtime_error("cannot create a folder in " + plugin.into.string() + ": " + std::strerror(errno));
    const fs::path temporary = pattern;
    try {
        for (const fs::path &part :
             {fs::path(plugin.kind), fs::path(plugin.language), fs::path(plugin.language) / plugin.kind})
            copy_folder(templates / part, temporary / plugin.name, words);
        fs::rename(temporary / plugin.name, folder);
        fs::remove_all(temporary);
    } catch (...) {
        std::error_code ignored;
        fs::remove_all(temporary, ignored);
        throw;
    }
    std::printf("%s: a working %s in %s. Its README.md explains how to build, run and extend it.\n",
                base::printable(folder.string()).c_str(), plugin.kind.c_str(), plugin.language.c_str());
    return base::success;
}

} // namespace arhost::plugin_tools
