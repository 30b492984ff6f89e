// SPDX-License-Identifier: Apache-2.0
#include "frame_texture.hpp"

#include <arhost-cpp/plugin.hpp>

#include <cstring>
#include <string>
#include <utility>

namespace sink_window {

FrameTexture::FrameTexture(int width, int height, bool shows_overlay)
    : width_(width), height_(height), shows_overlay_(shows_overlay) {
    GLint largest = 0;
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &largest);
    if (width > largest || height > largest)
        throw arhost::Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "OpenGL on this machine supports images of up to " +
                                                                   std::to_string(largest) +
                                                                   " px per side; use smaller frames");
    GLuint texture = 0;
    glGenTextures(1, &texture);
    glBindTexture(GL_TEXTURE_2D, texture);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    const std::vector<std::uint8_t> black(4 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    glTexImage2D(GL_TEXTURE_2D, 0, shows_overlay ? GL_RGBA8 : GL_RGB8, width, height, 0, GL_RGBA, GL_UNSIGNED_BYTE,
                 black.data());
    glTexEnvi(GL_TEXTURE_ENV, GL_TEXTURE_ENV_MODE, GL_REPLACE);
    glDisable(GL_DITHER);
}

void FrameTexture::upload(const arhost_output &output) {
    if (shows_overlay_) {
        glPixelStorei(GL_UNPACK_ROW_LENGTH, static_cast<GLint>(output.overlay_stride / 4));
        glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width_, height_, GL_RGBA, GL_UNSIGNED_BYTE, output.overlay_rgba);
        return;
    }
    const std::size_t row_size = 3 * std::size_t{output.width};
    const std::uint8_t *pixels = output.bgr;
    if (output.stride != row_size) { // the stride may not be a multiple of the pixel size, which OpenGL requires
        packed_.resize(row_size * output.height);
        for (std::size_t y = 0; y < output.height; ++y)
            std::memcpy(packed_.data() + y * row_size, output.bgr + y * output.stride, row_size);
        pixels = packed_.data();
    }
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width_, height_, GL_BGR, GL_UNSIGNED_BYTE, pixels);
}

void FrameTexture::draw(const View &view, const Rectangle &window) const {
    const Rectangle &r = view.area;
    glViewport(r.x, window.height - r.y - r.height, r.width, r.height); // OpenGL has its origin at the bottom
    glEnable(GL_TEXTURE_2D);
    if (shows_overlay_) {
        glEnable(GL_BLEND);
        glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
    }
    glBegin(GL_TRIANGLE_STRIP);
    for (const auto &[u, v] : {std::pair{0, 0}, {1, 0}, {0, 1}, {1, 1}}) {
        glTexCoord2i(view.mirrored ? 1 - u : u, v);
        glVertex2i(2 * u - 1, 1 - 2 * v); // the first row is at the top
    }
    glEnd();
    glDisable(GL_BLEND);
    glDisable(GL_TEXTURE_2D);
}

} // namespace sink_window
