// SPDX-License-Identifier: Apache-2.0
#include "newest_frame.hpp"

#include "sink_common/record_line.hpp"

#include <turbojpeg.h>

namespace arhost::web {

void NewestFrame::Free::operator()(void *compressor) const {
    tjDestroy(compressor);
}

NewestFrame::NewestFrame(int quality) : quality_(quality), compressor_(tjInitCompress()) {
    if (!compressor_)
        throw std::bad_alloc();
}

void NewestFrame::put(const arhost_output &output) {
    const std::size_t row = std::size_t{3} * output.width;
    written_.number = number_.load() + 1;
    written_.received = std::chrono::steady_clock::now().time_since_epoch();
    written_.width = output.width;
    written_.height = output.height;
    written_.bgr.resize(row * output.height);
    for (std::size_t y = 0; y < output.height; ++y)
        std::copy_n(output.bgr + y * output.stride, row, written_.bgr.data() + y * row);
    std::string line;
    record::append_line(line, *output.record);
    const std::lock_guard lock(mutex_);
    std::swap(written_, newest_);
    poses_ = {newest_.number, std::move(line)};
    number_ = newest_.number;
}

NewestFrame::Poses NewestFrame::newest_poses() const {
    const std::lock_guard lock(mutex_);
    return poses_;
}

std::shared_ptr<const Jpeg> NewestFrame::newest() {
    {
        const std::lock_guard lock(mutex_);
        if (newest_.number <= encoding_.number)
            return jpeg_;
        std::swap(newest_, encoding_);
    }
    const int width = static_cast<int>(encoding_.width), height = static_cast<int>(encoding_.height);
    auto jpeg = std::make_shared<Jpeg>();
    jpeg->number = encoding_.number;
    jpeg->received = encoding_.received;
    std::vector<std::uint8_t> file(tjBufSize(width, height, TJSAMP_420));
    unsigned char *bytes = file.data();
    unsigned long size = file.size();
    if (tjCompress2(compressor_.get(), encoding_.bgr.data(), width, 0, height, TJPF_BGR, &bytes, &size, TJSAMP_420,
                    quality_, TJFLAG_NOREALLOC | TJFLAG_FASTDCT) != 0)
        throw std::runtime_error(std::string("cannot encode the picture: ") + tjGetErrorStr2(compressor_.get()));
    jpeg->bytes.assign(bytes, bytes + size); // omits the unused part of the buffer, because viewers keep the JPEG
    jpeg_ = std::move(jpeg);
    ++encoded_;
    return jpeg_;
}

} // namespace arhost::web
