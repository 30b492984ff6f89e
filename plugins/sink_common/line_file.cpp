// SPDX-License-Identifier: Apache-2.0
#include "sink_common/line_file.hpp"

#include <fcntl.h>
#include <string>

namespace arhost::files {

void LineFile::open() {
    file_.emplace(path_, O_RDWR | O_CREAT | O_APPEND);
}

void LineFile::start(std::uint64_t first_sequence, const std::function<bool(std::string_view line)> &keep) {
    make_parent_folders(path_);
    if (first_sequence == 0)
        return check_can_write(path_);
    open();
    // The file has whole lines, sorted by frame. If the previous process was killed, it may end with a partial line.
    std::string text(file_->size(), '\0');
    file_->read_at(0, {reinterpret_cast<std::uint8_t *>(text.data()), text.size()});
    for (std::size_t next = 0; (next = text.find('\n', end_)) != std::string::npos; end_ = next + 1)
        if (!keep(std::string_view(text).substr(end_, next - end_)))
            break;
    if (end_ == 0)
        host_.warn("'" + path_.string() + "' has no frame before " + std::to_string(first_sequence) +
                   "; the lines from before the restart are lost");
    file_->truncate(end_);
}

void LineFile::append(std::string_view lines) {
    if (!file_) {
        open();
        file_->truncate(0);
    }
    try {
        file_->append({reinterpret_cast<const std::uint8_t *>(lines.data()), lines.size()});
    } catch (const Failure &) {
        file_->truncate(end_); // removes the partial line
        throw;
    }
    end_ += lines.size();
}

} // namespace arhost::files
