// SPDX-License-Identifier: Apache-2.0
//
// Checks at start whether a hardware path draws the scene as the path `plain` does. Some drivers announce paths that
// draw wrong pictures.
#pragma once

#include "renderer.hpp"

#include <string>

namespace rt_vulkan {

// Renders a small picture of the scene's virtual objects with `shaders` and with the path `plain`. Returns why the
// pictures differ too much, for example "37 of 812 drawn pixels differ …", or "" if they agree or if `plain` cannot
// render this scene. Throws arhost::Failure if the path of `shaders` fails or the host has cancelled the start.
std::string difference_from_plain(const arhost_raytracer_setup &setup, const Settings &settings,
                                  const arhost::Host &host, const PhysicalDevice &physical, const Shaders &shaders);

} // namespace rt_vulkan
