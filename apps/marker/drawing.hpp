// SPDX-License-Identifier: Apache-2.0
//
// Draws pages with cairo. Each function returns the bytes of a file, and throws std::runtime_error if cairo fails.
#pragma once

#include "sheet.hpp"

#include <cstddef>
#include <string>

namespace arhost::marker {

std::string as_pdf(const Document &document, const Family &family, const std::string &title);
std::string as_svg(const Document &document, std::size_t page, const Family &family);
// A grey image that contains its resolution. The edges of cells are at whole pixels, up to half a pixel from their
// exact position.
std::string as_png(const Document &document, std::size_t page, const Family &family, unsigned dpi);

} // namespace arhost::marker
