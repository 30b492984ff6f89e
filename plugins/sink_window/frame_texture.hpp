// SPDX-License-Identifier: Apache-2.0
//
// The frame in the window: a texture, and the area in which the window shows it.
#pragma once

#include "sink_common/canvas.hpp"
#include "window.hpp"

#include <arhost/sink.h>

#include <cstdint>
#include <vector>

namespace sink_window {

// The position and size of a frame in the window.
struct View {
    Rectangle area;    // px of the window
    int width, height; // size of the frame, px
    bool mirrored;

    // Converts pixel coordinates of the frame, whose pixel centres are at integers, to coordinates of the window.
    arhost::drawing::Point to_window(arhost::drawing::Point pixel) const {
        const double u = (pixel.x + 0.5) / width, v = (pixel.y + 0.5) / height;
        return {area.x + (mirrored ? 1 - u : u) * area.width, area.y + v * area.height};
    }
};

class FrameTexture {
public:
    // Creates a black picture in the current OpenGL context, which also owns the texture. `shows_overlay`: whether to
    // show only the overlay, over black, instead of the frame. Throws arhost::Failure if OpenGL does not support the
    // size.
    FrameTexture(int width, int height, bool shows_overlay);

    void upload(const arhost_output &output);
    void draw(const View &view, const Rectangle &window) const;

private:
    int width_, height_;
    bool shows_overlay_;
    std::vector<std::uint8_t> packed_;
};

} // namespace sink_window
