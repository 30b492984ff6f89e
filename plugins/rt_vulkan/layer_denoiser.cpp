// SPDX-License-Identifier: Apache-2.0
#include "layer_denoiser.hpp"

#include <algorithm>
#include <cstring>

namespace rt_vulkan {

namespace common = arhost::raytracer_common;

LayerDenoiser::LayerDenoiser(const arhost_intrinsics &intrinsics, std::size_t objects, bool has_catchers,
                             bool has_gloss, bool has_specular, common::View view, unsigned threads)
    : intrinsics_(intrinsics), has_catchers_(has_catchers), view_(view),
      lens_(common::video_through(intrinsics, colour_tables_)), threads_(threads),
      // The device samples catchers in all pixels, so they need no larger cells.
      denoiser_(common::choose_instruction_set("auto"), intrinsics.width, intrinsics.height, objects,
                {.has_sharp_shadows = true, .has_gloss = has_gloss, .has_specular = has_specular}) {}

const common::Denoising &LayerDenoiser::begin(const StateSlots &state, const NewFrame &frame) {
    common::Video video = lens_;
    if (frame.video)
        video.image.texels = frame.video->texels();
    const arhost_image &image = frame.image;
    denoising_ = &denoiser_.begin(
        state, {.intrinsics = intrinsics_,
                .camera = frame.camera,
                .video = video,
                .image = {image.rgba, image.stride, image.linear, frame.blends_codes, &colour_tables_.srgb8},
                .view = view_,
                .objects = frame.objects,
                .deforms = frame.deforms,
                .sequence = frame.sequence,
                .samples = frame.samples,
                .flat_catcher = -1,
                .takes_turns = false,
                .shading_px = 1});
    return *denoising_;
}

// Copies a row of the image from the planes to the layers. A layer uses only the surfaces of its kind, so virtual
// objects and catchers may have the same rows.
void LayerDenoiser::read(const std::uint32_t *planes, std::size_t row) const {
    const std::size_t width = intrinsics_.width, plane_size = width * intrinsics_.height;
    const auto copy = [&](std::size_t plane, void *to) {
        std::memcpy(to, planes + plane * plane_size + row * width, width * sizeof *planes);
    };
    const auto read_light = [&](const common::Layer &layer, std::size_t first_plane) {
        const std::size_t at = row * static_cast<std::size_t>(layer.guide_stride()) + common::Layer::margin;
        for (std::size_t i = 0; i < 3; ++i)
            copy(first_plane + i, layer.light[0][i] + at);
        std::fill_n(layer.light[0][common::variance_light] + at, width, common::sampled);
    };
    const auto read_layer = [&](const common::Layer &layer) {
        const std::size_t at = row * static_cast<std::size_t>(layer.guide_stride()) + common::Layer::margin;
        for (std::size_t i = 0; i < common::guide_rows; ++i)
            copy(i, layer.guides[i] + at);
        read_light(layer, light_plane);
    };
    read_layer(denoising_->objects);
    if (has_catchers_)
        read_layer(denoising_->catchers);
    if (denoising_->has_gloss)
        read_light(denoising_->gloss, gloss_plane);
    copy(taps_plane, denoising_->taps + row * static_cast<std::size_t>(denoising_->objects.stride));
}

common::Rectangle LayerDenoiser::run(const std::uint32_t *planes) {
    threads_.for_each(intrinsics_.height, [&](std::size_t row, std::size_t) { read(planes, row); });
    return denoiser_.run(threads_);
}

} // namespace rt_vulkan
