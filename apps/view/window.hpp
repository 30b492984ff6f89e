// SPDX-License-Identifier: Apache-2.0
//
// The window of `arhost view`.
#pragma once

#include "view/live_view.hpp"

#include <filesystem>
#include <memory>

namespace arhost::view {

// Connects to the display, before files are loaded. Throws base::InvalidInput if there is none.
class Display {
public:
    Display();
    ~Display();
    Display(const Display &) = delete;
    Display &operator=(const Display &) = delete;
};

struct WindowSettings {
    std::filesystem::path file;
    std::string ray_tracer;
    OptionSettings options;
    bool plays = true; // the animation
    scene::Contents contents;
};

// Shows the stage until the user closes the window. Throws base::InvalidInput if no window can be opened, and
// base::Interrupted.
void show_window(const Display &display, const WindowSettings &settings, Loader &loader, Stage stage,
                 const Wanted &first);

} // namespace arhost::view
