// SPDX-License-Identifier: Apache-2.0
//
// A ray tracer's plugin, opened in this process by the rules of arhost-worker. Nothing keeps it from what this
// process may do.
#pragma once

#include "yaml/yaml.hpp"

#include <arhost/arhost.h>

#include <opencv2/core.hpp>

#include <string>

class RayTracer {
public:
    // `name`: as in a configuration, a plugin's name or a path. `options`: a map of the plugin's own; what it lacks
    // takes the plugin's default, but `samples` 16 where the plugin has that. Throws std::runtime_error.
    RayTracer(const std::string &name, arhost::yaml::Node options);
    ~RayTracer() { plugin_->destroy(instance_); }
    RayTracer(const RayTracer &) = delete;
    RayTracer &operator=(const RayTracer &) = delete;

    // One picture: RGBA, straight alpha. Throws std::runtime_error.
    cv::Mat render(const arhost_scene &scene, const arhost_camera &camera, double time_s) const;

private:
    void expect_ok(const char *call, arhost_status status) const;

    const arhost_plugin *plugin_;
    arhost_instance *instance_ = nullptr;
};
