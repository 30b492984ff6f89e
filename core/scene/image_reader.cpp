// SPDX-License-Identifier: Apache-2.0
#include "scene/image_reader.hpp"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <webp/decode.h>

#include <memory>
#include <vector>

namespace {

using arhost::scene::ImageRequest;

constexpr int side_limit = 16384; // the limit in arhost/scene.h

// Expands one to four channels to RGBA in place.
template <class T> void expand(T *texels, std::size_t count, bool grey, int alpha, T opaque) {
    for (T *texel = texels; texel != texels + 4 * count; texel += 4) {
        const T a = alpha < 0 ? opaque : texel[alpha];
        if (grey)
            texel[1] = texel[2] = texel[0];
        texel[3] = a;
    }
}

std::string size_error(int width, int height) {
    return width < 1 || height < 1 || width > side_limit || height > side_limit
               ? "has " + std::to_string(width) + " x " + std::to_string(height) + " pixels; the limit is " +
                     std::to_string(side_limit) + " per side, so scale it down"
               : "";
}

// OpenImageIO allocates the memory for a WebP image before the size can be checked.
std::string read_webp(const ImageRequest &request) {
    std::vector<unsigned char> file;
    std::span<const unsigned char> content = request.content;
    if (content.empty()) {
        OIIO::Filesystem::IOFile from(request.file, OIIO::Filesystem::IOProxy::Read);
        file.resize(from.size());
        if (from.read(file.data(), file.size()) != file.size())
            return "cannot be read";
        content = file;
    }
    WebPBitstreamFeatures features;
    if (WebPGetFeatures(content.data(), content.size(), &features) != VP8_STATUS_OK)
        return "cannot be loaded: it is not a WebP image, or is truncated";
    if (features.has_animation)
        return "is an animated WebP image, which cannot be a texture";
    if (std::string error = size_error(features.width, features.height); !error.empty())
        return error;
    const auto width = static_cast<std::uint32_t>(features.width),
               height = static_cast<std::uint32_t>(features.height);
    std::byte *texels = request.allocate(width, height, false);
    if (!WebPDecodeRGBAInto(content.data(), content.size(), reinterpret_cast<std::uint8_t *>(texels),
                            std::size_t(4) * width * height, features.width * 4))
        return "cannot be loaded: it is corrupt or truncated";
    return {};
}

std::string read(const ImageRequest &request) {
    if (std::string_view(request.format) == "webp")
        return read_webp(request);
    const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::create(request.format);
    if (!input)
        return "cannot be loaded: this build of OpenImageIO does not support the format '" +
               std::string(request.format) + "'";
    OIIO::Filesystem::IOMemReader memory(const_cast<unsigned char *>(request.content.data()), request.content.size());
    OIIO::ImageSpec wanted, spec;
    wanted["oiio:UnassociatedAlpha"] = 1;
    if (!request.content.empty() && !input->set_ioproxy(&memory))
        return "cannot be loaded: images of the format '" + std::string(request.format) +
               "' must be separate files, not embedded";
    if (!input->open(request.file, spec, wanted))
        return "cannot be loaded: " + input->geterror();
    if (spec.deep || spec.depth > 1 || spec.nchannels < 1)
        return "is a deep or volume image, which cannot be a texture";
    if (std::string error = size_error(spec.width, spec.height); !error.empty())
        return error;
    const bool is_float = spec.format.is_floating_point();
    // The image is grey, grey with alpha, RGB, or RGBA. Additional channels of EXR files are ignored.
    const bool grey = spec.nchannels < 3;
    const int alpha = spec.nchannels == 2 ? 1 : spec.nchannels > 3 && spec.alpha_channel == 3 ? 3 : -1;
    const int channels = grey ? spec.nchannels : alpha == 3 ? 4 : 3;
    std::byte *texels = request.allocate(spec.width, spec.height, is_float);
    const OIIO::stride_t texel_size = is_float ? 16 : 4;
    const auto progress = [](void *opaque, float done) {
        return !static_cast<const ImageRequest *>(opaque)->report(done);
    };
    if (!input->read_image(0, 0, 0, channels, is_float ? OIIO::TypeDesc::FLOAT : OIIO::TypeDesc::UINT8, texels,
                           texel_size, OIIO::AutoStride, OIIO::AutoStride, progress,
                           const_cast<ImageRequest *>(&request)))
        return "cannot be loaded: " + input->geterror();
    // For a truncated JPEG, the decoder fills in the missing part and only sets a warning. Other warnings are
    // harmless.
    if (const std::string warning = input->geterror(); warning.find("Premature end") != warning.npos)
        return "is truncated: " + warning;
    const std::size_t count = std::size_t(spec.width) * spec.height;
    if (is_float)
        expand(reinterpret_cast<float *>(texels), count, grey, alpha, 1.f);
    else
        expand(reinterpret_cast<unsigned char *>(texels), count, grey, alpha, static_cast<unsigned char>(255));
    return {};
}

} // namespace

extern "C" __attribute__((visibility("default"))) void arhost_read_image(const ImageRequest &request,
                                                                         std::string &error) {
    error = read(request);
}
