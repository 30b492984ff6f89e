// SPDX-License-Identifier: Apache-2.0
#include "image_encoder.hpp"

#include <arhost-cpp/plugin.hpp>

#include <turbojpeg.h>

#include <vector>

namespace arhost::images {
namespace {

class JpegEncoder final : public Encoder {
public:
    explicit JpegEncoder(int quality) : compressor_(tjInitCompress()), quality_(quality) {
        if (!compressor_)
            throw std::bad_alloc();
    }

    std::span<const std::uint8_t> encode(const Image &image) override {
        const int width = static_cast<int>(image.width), height = static_cast<int>(image.height);
        // Chroma subsampling blurs coloured edges, so do not use it at high quality.
        const int subsampling = quality_ >= 90 ? TJSAMP_444 : TJSAMP_420;
        file_.resize(tjBufSize(width, height, subsampling));
        unsigned char *bytes = file_.data();
        unsigned long size = file_.size();
        if (tjCompress2(compressor_.get(), image.pixels, width, static_cast<int>(image.stride), height, TJPF_BGR,
                        &bytes, &size, subsampling, quality_, TJFLAG_NOREALLOC | TJFLAG_ACCURATEDCT) != 0)
            throw Failure(ARHOST_STATUS_ERROR_INTERNAL,
                          std::string("cannot encode the JPEG image: ") + tjGetErrorStr2(compressor_.get()));
        return std::span(file_).first(size);
    }

private:
    struct Free {
        void operator()(tjhandle p) const { tjDestroy(p); }
    };
    std::unique_ptr<void, Free> compressor_;
    int quality_;
    std::vector<std::uint8_t> file_;
};

} // namespace

std::unique_ptr<Encoder> make_jpeg_encoder(int quality) {
    return std::make_unique<JpegEncoder>(quality);
}

} // namespace arhost::images
