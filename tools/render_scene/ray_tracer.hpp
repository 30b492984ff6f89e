// SPDX-License-Identifier: Apache-2.0
//
// A ray tracer plugin, loaded into this process like in arhost-worker, but without a sandbox.
#pragma once

#include "yaml/yaml.hpp"

#include <arhost/arhost.h>

#include <opencv2/core.hpp>

#include <string>

class RayTracer {
public:
    // `name`: plugin name or path, as in a configuration. `options`: map of plugin options; missing ones get the
    // plugin's default, except `samples`, which defaults to 16 if supported. Throws std::runtime_error.
    RayTracer(const std::string &name, arhost::yaml::Node options);
    ~RayTracer() { plugin_->destroy(instance_); }
    RayTracer(const RayTracer &) = delete;
    RayTracer &operator=(const RayTracer &) = delete;

    // RGBA, straight alpha. Throws std::runtime_error.
    cv::Mat render(const arhost_scene &scene, const arhost_camera &camera, double time_s) const;

private:
    void expect_ok(const char *call, arhost_status status) const;

    const arhost_plugin *plugin_;
    arhost_instance *instance_ = nullptr;
};
