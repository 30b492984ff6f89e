// SPDX-License-Identifier: Apache-2.0
#include "overlay.hpp"

#include <algorithm>

namespace sink_window {

using arhost::drawing::Colour;
using arhost::drawing::Point;

Overlay::Overlay(const Rectangle &window, const View &view)
    : Canvas(window.width, window.height, std::min(window.width / 340.0, window.height / 255.0)), view_(view) {
    glViewport(0, 0, window.width, window.height);
    glPushMatrix();
    glOrtho(0, window.width, window.height, 0, -1, 1);
    glEnable(GL_BLEND);
    glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
}

Overlay::~Overlay() {
    glDisable(GL_BLEND);
    glPopMatrix();
}

void Overlay::fill(std::span<const Point> corners, Colour colour, std::uint8_t alpha) const {
    glColor4ub(colour.red, colour.green, colour.blue, alpha);
    glEnableClientState(GL_VERTEX_ARRAY);
    glVertexPointer(2, GL_DOUBLE, sizeof(Point), corners.data());
    glDrawArrays(GL_QUADS, 0, static_cast<GLsizei>(corners.size()));
    glDisableClientState(GL_VERTEX_ARRAY);
}

} // namespace sink_window
