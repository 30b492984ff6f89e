// SPDX-License-Identifier: Apache-2.0
//
// Starts `arhost conform` of this build in a scratch folder.
#pragma once

#include "arhost_run.hpp"

#include <directories.hpp>

namespace arhost::test {

class ConformRun {
public:
    // `prepare` is called in the child, which becomes arhost.
    void start(
        std::vector<std::string> arguments, const std::function<void()> &prepare = [] {}) {
        arguments.insert(arguments.begin(), "conform");
        run_.start(std::move(arguments), prepare);
    }
    int wait() { return run_.wait(std::chrono::minutes(3)); }
    int run(std::vector<std::string> arguments) {
        start(std::move(arguments));
        return wait();
    }
    pid_t pid() const { return run_.pid(); }
    bool running() const { return run_.running(); }
    template <class Condition> bool eventually(const Condition &condition) const {
        return run_.eventually(condition);
    }
    void write(const std::string &name, const std::string &text) const { run_.write(name, text); }
    bool exists(const std::string &name) const { return run_.exists(name); }
    std::string output() const { return run_.output(); }
    std::string read(const std::string &name) const { return run_.read(name); }
    nlohmann::json json(const std::string &name) const { return nlohmann::json::parse(read(name)); }
    std::filesystem::path path(const std::string &name) const { return run_.path(name); }

    // The plugin whose file name selects a defect.
    static std::filesystem::path wrong_library(const std::string &defect, const std::string &kind) {
        return wrong_plugin_directory() + (defect == "exports_more" ? "/wrong_exports_more.so"
                                           : kind == "rt"           ? "/wrong.so"
                                                                    : "/wrong_" + kind + ".so");
    }
    std::filesystem::path link_wrong(const std::string &defect, const std::string &kind = "rt") const {
        const std::filesystem::path link = path(kind + "_" + defect + ".so");
        std::filesystem::create_symlink(wrong_library(defect, kind), link);
        return link;
    }

private:
    ArhostRun run_;
};

} // namespace arhost::test
