// SPDX-License-Identifier: Apache-2.0
#include "jpeg_splitter.hpp"

#include <algorithm>

namespace arhost {

std::optional<std::string> JpegSplitter::next() {
    constexpr std::string_view start_of_image = "\xff\xd8\xff", end_of_image = "\xff\xd9", boundary = "--";
    if (searched_ == 0) {
        const std::size_t start = unparsed_.find(start_of_image);
        const std::size_t kept = std::min(unparsed_.size(), start_of_image.size() - 1); // may be a part of the start
        unparsed_.erase(0, start != std::string::npos ? start : unparsed_.size() - kept);
        if (start == std::string::npos)
            return std::nullopt;
        searched_ = start_of_image.size() - 1;
    }
    for (;; ++searched_) {
        searched_ = std::min(unparsed_.find(end_of_image, searched_), unparsed_.size() - 1);
        const std::size_t end = searched_ + end_of_image.size();
        const std::size_t next = unparsed_.find_first_not_of("\r\n", std::min(end, unparsed_.size()));
        if (next == std::string::npos || unparsed_.size() < next + boundary.size())
            return std::nullopt;
        if (unparsed_.compare(next, boundary.size(), boundary) != 0)
            continue;
        std::string picture = unparsed_.substr(0, end);
        unparsed_.erase(0, next);
        searched_ = 0;
        return picture;
    }
}

} // namespace arhost
