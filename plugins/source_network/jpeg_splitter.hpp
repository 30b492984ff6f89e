// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace arhost {

// Finds the pictures of Motion-JPEG without their lengths: from a picture's first bytes to the boundary after it,
// which begins with "--" on a new line. Searches each byte once, however few of them arrive at a time.
class JpegSplitter {
public:
    void append(std::string_view bytes) { unparsed_ += bytes; }
    // Returns the next picture, or nullopt if it is not complete.
    std::optional<std::string> next();
    std::size_t size() const { return unparsed_.size(); } // of the data that next() has not returned

private:
    std::string unparsed_;
    std::size_t searched_ = 0; // before this position in unparsed_, no picture ends
};

} // namespace arhost
