// SPDX-License-Identifier: Apache-2.0
#include "cli/session_grants.hpp"

#include "base/file_identity.hpp"
#include "base/program.hpp"
#include "sandbox/sandbox.hpp"

#include <algorithm>
#include <array>
#include <set>

namespace arhost::cli {
namespace {

namespace fs = std::filesystem;
using base::real_path;

// The options of the adapters (plugins/python_adapter) that name code to run.
constexpr std::array<std::string_view, 2> code_options = {"script", "interpreter"};

class Check {
public:
    Check(const Session &session, const std::vector<std::string> &allowed)
        : own_{real_path(session.folder), real_path(base::own_prefix() / "share/arhost/config")} {
        for (const std::string &what : allowed)
            if (std::ranges::find(sandbox::allowances, what) != sandbox::allowances.end())
                permissions_.insert(what);
            else if (std::error_code ignored; fs::exists(what, ignored))
                paths_.push_back(real_path(fs::absolute(what)));
            else
                throw yaml::Error("--allow " + what + ": is neither a permission (" + list_of_permissions() +
                                  ") nor an existing file or folder");
    }

    void component(const yaml::Node &node) {
        if (const auto allow = of_session(node, "allow"))
            for (const yaml::Node &permission : allow->items())
                expect_permission(permission.text(), node);
        if (of_session(node, "usb"))
            expect_permission("usb", node);
        if (const auto reads = of_session(node, "reads"))
            for (const yaml::Node &path : reads->items())
                expect_path(path);
        for (const char *key : {"path", "scene"})
            if (const auto path = of_session(node, key))
                expect_path(*path);
        if (const auto options = node.find("options"); options && options->is_map())
            for (const auto &[name, value] : options->entries())
                if (value.is_scalar() && !is_users(value))
                    expect_path(value, std::ranges::find(code_options, name) != code_options.end());
    }

    // The files of targets: maps, patterns and pictures.
    void targets(const yaml::Node &tracker) {
        const auto targets = tracker.find("targets");
        for (const yaml::Node &target : targets ? targets->items() : std::vector<yaml::Node>())
            for (const char *key : {"map", "pattern", "image"})
                if (const auto file = of_session(target, key))
                    expect_path(*file);
    }

    void path(const yaml::Node &path) {
        if (!is_users(path))
            expect_path(path);
    }

    // Throws if something has not been granted.
    void finish(const Session &session) const {
        if (missing_.empty())
            return;
        std::string text = session.folder.string() + ": the session asks for ", options;
        for (std::size_t i = 0; i < missing_.size(); ++i) {
            text += (i ? ", " : "") + missing_[i].what;
            if (const std::string option = " --allow " + missing_[i].grant; options.find(option) == std::string::npos)
                options += option;
        }
        throw yaml::Error(text + "; a session grants nothing by itself. If you trust it, add" + options +
                          ", or choose your own configuration with --config");
    }

private:
    struct Missing {
        std::string what, grant;
    };

    static std::string list_of_permissions() {
        std::string list;
        for (const std::string_view permission : sandbox::allowances)
            list += (list.empty() ? "" : ", ") + std::string(permission);
        return list;
    }

    // Whether a value was set on the command line. Options that were changed during the recording are the session's.
    static bool is_users(const yaml::Node &node) { return node.is_overridden() && node.where() != replayed; }

    static std::optional<yaml::Node> of_session(const yaml::Node &node, const char *key) {
        const auto value = node.find(key);
        return value && !is_users(*value) ? value : std::nullopt;
    }

    void expect_permission(const std::string &permission, const yaml::Node &component) {
        if (!permissions_.contains(permission))
            missing_.push_back({"the permission '" + permission + "' for " + component.path(), permission});
    }

    // `is_code`: a script or program, which must be granted also if it is in the session's folder.
    void expect_path(const yaml::Node &node, bool is_code = false) {
        std::error_code ignored;
        fs::path path = node.input_path();
        if (!fs::exists(path, ignored) && path.filename().string().find('%') != std::string::npos)
            path = path.parent_path(); // a numbered file name, whose folder would be readable
        if (!fs::exists(path, ignored))
            return;
        const fs::path real = real_path(path);
        const auto has = [&](const fs::path &folder) { return sandbox::contains(folder, real); };
        if (!std::ranges::any_of(paths_, has) && (is_code || !std::ranges::any_of(own_, has)))
            missing_.push_back(
                {(is_code ? "the code '" : "the file '") + real.string() + "' (" + node.path() + ")", real.string()});
    }

    std::vector<fs::path> own_;
    std::set<std::string, std::less<>> permissions_{};
    std::vector<fs::path> paths_{};
    std::vector<Missing> missing_{};
};

} // namespace

void expect_granted(const yaml::Node &root, const Session &session, const std::vector<std::string> &allowed,
                    bool with_tracker) {
    Check check(session, allowed);
    const auto alternatives = root.find("alternatives");
    for (const char *kind : {"tracker", "raytracer"}) {
        if (kind == std::string_view("tracker") && !with_tracker)
            continue;
        if (const auto component = root.find(kind)) {
            check.component(*component);
            check.targets(*component);
        }
        if (const auto listed = alternatives ? alternatives->find(kind) : std::nullopt)
            for (const yaml::Node &component : listed->items())
                check.component(component);
    }
    if (const auto scenes = root.find("scenes"))
        for (const yaml::Node &scene : scenes->items())
            check.path(scene);
    if (const auto trajectory = root.find("trajectory"))
        check.path(*trajectory);
    if (const auto camera = root.find("camera"))
        if (const auto file = camera->is_map() ? camera->find("file") : std::nullopt)
            check.path(*file);
    check.finish(session);
}

} // namespace arhost::cli
