// SPDX-License-Identifier: Apache-2.0
//
// Draws text and lines over the picture in the window, with OpenGL.
#pragma once

#include "frame_texture.hpp"
#include "sink_common/canvas.hpp"

namespace sink_window {

class Overlay final : public arhost::drawing::Canvas {
public:
    Overlay(const Rectangle &window, const View &view);
    ~Overlay() override;

    arhost::drawing::Point at(arhost::drawing::Point pixel) const override { return view_.to_window(pixel); }

protected:
    void fill(std::span<const arhost::drawing::Point> corners, arhost::drawing::Colour colour,
              std::uint8_t alpha) const override;

private:
    View view_;
};

} // namespace sink_window
