// SPDX-License-Identifier: Apache-2.0
//
// The options with which the plugins of a run were created, and their later changes by the command `set`.
#pragma once

#include "run_config/configuration.hpp"
#include "supervise/component.hpp"

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace arhost::host {

class ComponentOptions {
public:
    struct InUse {
        std::string path;              // configuration path of the component
        std::string component, plugin; // name of the component, id of the plugin
        std::filesystem::path file;    // of the plugin
        std::vector<model::OptionValue> values;
        std::set<std::string> changed; // keys of the changed options
    };

    explicit ComponentOptions(const supervise::LogFunction &log) : log_(log) {}

    // Returns the options for creating a component's plugin: the configured ones, with the changes applied. Throws
    // the same exceptions as run_config::options_for, and if another component runs another plugin with the same id.
    std::vector<model::OptionValue> choose(const supervise::Component &component, arhost_kind kind,
                                           const run_config::ComponentConfiguration &configuration,
                                           std::size_t candidate);
    void change(const supervise::Component &component, const model::OptionValue &value);
    // Returns nullptr if the component's plugin was never created.
    const InUse *of(const supervise::Component &component) const;
    void copy(const supervise::Component &from, const supervise::Component &to) { in_use_[&to] = in_use_[&from]; }
    void forget(const supervise::Component &component) { in_use_.erase(&component); }

private:
    void expect_unique(const supervise::Component &component, const yaml::Node &node) const;

    const supervise::LogFunction &log_;
    std::map<const supervise::Component *, InUse> in_use_;
};

} // namespace arhost::host
