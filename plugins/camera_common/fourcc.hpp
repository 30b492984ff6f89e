// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace arhost {

// Returns the characters of a V4L2 pixel format, such as "YUYV".
inline std::string fourcc_text(std::uint32_t fourcc) {
    std::string text;
    for (int i = 0; i < 4; ++i)
        text += static_cast<char>(fourcc >> (8 * i) & 0x7f);
    return text;
}

} // namespace arhost
