// SPDX-License-Identifier: Apache-2.0
//
// Loads a plugin into this process. arhost-worker does the same, but in a sandbox.
#pragma once

#include "model/plugin_description.hpp"
#include "yaml/yaml.hpp"

#include <arhost/arhost.h>

#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace arhost::view {

// Plugin options of the command line.
struct OptionSettings {
    std::vector<std::pair<std::string, int>> numbers; // of options of their own: "samples" of --samples
    std::vector<std::string> settings;                // of --set: "key=value"
    yaml::Node node() const;                          // throws base::InvalidInput
};

class Plugin {
public:
    // Sets options that are not in the map, depending on what the plugin supports.
    using Defaults = std::function<void(yaml::Node &options, const model::PluginDescription &plugin)>;

    // `name` is the name or the path of a plugin, as in a configuration; `option` the command-line option that names
    // it. Throws std::runtime_error.
    Plugin(const std::string &name, const std::string &option, arhost_kind kind, const OptionSettings &settings,
           const Defaults &defaults = {});
    ~Plugin() { plugin_->destroy(instance_); }
    Plugin(const Plugin &) = delete;
    Plugin &operator=(const Plugin &) = delete;

    const model::PluginDescription &description() const { return description_; }
    const arhost_descriptor &descriptor() const { return *plugin_->descriptor; }
    template <class T> const T &functions() const { return *static_cast<const T *>(plugin_->functions); }
    arhost_instance *instance() const { return instance_; }
    // Throws std::runtime_error if a call has failed, or base::Interrupted.
    void expect_ok(const char *call, arhost_status status) const;

private:
    const arhost_plugin *plugin_;
    model::PluginDescription description_;
    arhost_instance *instance_ = nullptr;
};

} // namespace arhost::view
