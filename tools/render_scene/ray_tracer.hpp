// SPDX-License-Identifier: Apache-2.0
//
// Loads a ray tracer plugin into this process. arhost-worker does the same, but in a sandbox.
#pragma once

#include "yaml/yaml.hpp"

#include <arhost/arhost.h>

#include <opencv2/core.hpp>

#include <string>

class RayTracer {
public:
    // `name` is the name or the path of a plugin, as in a configuration. `options` is a map of plugin options.
    // Options that are not in the map get the plugin's default; only `samples` gets 16 if the plugin supports this
    // value. Throws std::runtime_error.
    RayTracer(const std::string &name, arhost::yaml::Node options);
    ~RayTracer() { plugin_->destroy(instance_); }
    RayTracer(const RayTracer &) = delete;
    RayTracer &operator=(const RayTracer &) = delete;

    // Returns an RGBA image with straight alpha. Throws std::runtime_error.
    cv::Mat render(const arhost_scene &scene, const arhost_camera &camera, double time_s) const;

private:
    void expect_ok(const char *call, arhost_status status) const;

    const arhost_plugin *plugin_;
    arhost_instance *instance_ = nullptr;
};
