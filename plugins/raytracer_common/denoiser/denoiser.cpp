// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/denoiser/denoiser.hpp"

#include "raytracer_common/scene_geometry.hpp"

#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <utility>

namespace arhost::raytracer_common {
namespace {

// The state begins with this, followed by the objects and the rows of the history.
struct StateHeader {
    std::uint32_t version, width, height;
    std::uint32_t first, frames;  // number of the history's first frame, and of the frames since
    std::uint32_t sequence;       // of the frame, with gaps
    std::uint32_t frames_at_rest; // number of frames since an object has moved, at most frames_to_find_change
    Camera camera;
};
struct ObjectState {
    float world_from_object[12];
    std::uint32_t is_visible;
};
constexpr std::uint32_t state_version = 4;
constexpr std::size_t alignment = 64; // of the rows, bytes
// The history is of no use after so many missing frames in which objects have moved, for example because a marker was
// lost. A slow ray tracer misses fewer frames.
constexpr std::int32_t long_gap = 16;

std::size_t aligned(std::size_t size) {
    return (size + alignment - 1) / alignment * alignment;
}
std::size_t rows_offset(std::size_t objects) {
    return aligned(sizeof(StateHeader) + sizeof(ObjectState) * objects);
}
// Returns a layer without memory for an image of this size.
Layer make_layer(std::uint32_t width, std::uint32_t height, std::int32_t cell_px) {
    Layer layer{};
    layer.cell_px = cell_px;
    layer.width = (static_cast<std::int32_t>(width) + layer.cell_px - 1) / layer.cell_px;
    layer.height = (static_cast<std::int32_t>(height) + layer.cell_px - 1) / layer.cell_px;
    layer.stride = (layer.width + 15) / 16 * 16;
    return layer;
}
// Number of values in a row of the layer's history.
std::size_t history_plane(const Layer &layer) {
    return static_cast<std::size_t>(layer.stride) * static_cast<std::size_t>(layer.height);
}
std::size_t changes_of(const Layer &layer) {
    const std::int32_t lines = (layer.height + Layer::change_side - 1) / Layer::change_side;
    return static_cast<std::size_t>(lines) * static_cast<std::size_t>(layer.changes_per_row());
}
std::size_t guide_plane(const Layer &layer) {
    return static_cast<std::size_t>(layer.guide_stride()) * static_cast<std::size_t>(layer.height);
}
std::size_t size_of(std::uint32_t width, std::uint32_t height, std::size_t objects, std::int32_t catcher_cell_px,
                    const DenoisedScene &scene) {
    const std::size_t fine = history_plane(make_layer(width, height, 1)),
                      of_catchers = history_plane(make_layer(width, height, catcher_cell_px));
    const std::size_t of_objects = scene.has_specular ? history_rows : seen_history;
    const std::size_t values = of_objects * fine + seen_history * (of_catchers + (scene.has_gloss ? fine : 0));
    return rows_offset(objects) + sizeof(float) * values;
}

// Writes to · inverse(from): the motion from one placement to another.
void write_motion(const float *from, const float *to, float *motion) {
    const Cofactors cofactors(from);
    double linear[9]; // column-major
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) {
            double sum = 0;
            for (int i = 0; i < 3; ++i) // inverse(i, column) = cofactor(column, i) / determinant
                sum += to[3 * i + row] * cofactors.values[3 * i + column];
            linear[3 * column + row] = sum / cofactors.determinant;
            motion[3 * column + row] = static_cast<float>(linear[3 * column + row]);
        }
    for (int row = 0; row < 3; ++row) {
        double moved = to[9 + row];
        for (int i = 0; i < 3; ++i)
            moved -= linear[3 * i + row] * from[9 + i];
        motion[9 + row] = static_cast<float>(moved);
    }
}

} // namespace

StateSlots state_of(const arhost_render_request &request, std::uint64_t size) {
    // An older host's struct lacks the fields.
    if (request.struct_size <= offsetof(arhost_render_request, state_size) || request.state_size == 0)
        return {};
    if (request.state_size < size)
        throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT,
                      "the state has " + std::to_string(request.state_size) +
                          " bytes; the host must provide as many as state_size() returns, " + std::to_string(size));
    return {request.state_before, request.state_after};
}

View view_of(const std::string &show, bool denoises) {
    const auto view = static_cast<View>(std::ranges::find(views, show) - views);
    if (view != View::picture && !denoises)
        throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT,
                      "option 'show': '" + show +
                          "' is a view of the denoiser; use 'quality: realtime' or 'balanced', and not 'accumulate'");
    return view;
}

Steps steps_of(InstructionSet instructions) {
    switch (instructions) {
#if defined(__x86_64__)
    case InstructionSet::avx512:
        return avx512::steps();
    case InstructionSet::avx2:
        return avx2::steps();
#endif
    default:
        return base::steps();
    }
}

Denoiser::Denoiser(InstructionSet instructions, std::uint32_t width, std::uint32_t height, std::size_t objects,
                   const DenoisedScene &scene)
    : steps_(steps_of(instructions)), objects_(objects), has_gloss_(scene.has_gloss),
      has_specular_(scene.has_specular), catcher_cell_px_(scene.has_sharp_shadows || scene.has_gloss ? 1 : 2),
      state_size_(size_of(width, height, objects, catcher_cell_px_, scene)), motion_(12 * objects) {}

std::vector<Layer *> Denoiser::layers() {
    std::vector<Layer *> layers{&denoising_.objects, &denoising_.catchers};
    if (has_gloss_)
        layers.push_back(&denoising_.gloss);
    return layers;
}

void Denoiser::resize(std::uint32_t width, std::uint32_t height) {
    denoising_.objects = make_layer(width, height, 1);
    denoising_.objects.keeps_seen = has_specular_;
    denoising_.catchers = make_layer(width, height, catcher_cell_px_);
    denoising_.catchers.holds = LayerLight::change;
    denoising_.gloss = make_layer(width, height, 1);
    denoising_.gloss.holds = LayerLight::gloss;
    const auto planes_of = [](const Layer &layer) { // `gloss` has no guides of its own
        return (layer.holds == LayerLight::gloss ? 0 : std::size_t{guide_rows}) + 2 * light_rows;
    };
    std::size_t size = 0, changes = 0;
    for (const Layer *layer : layers()) {
        size += planes_of(*layer) * guide_plane(*layer);
        changes += changes_of(*layer);
    }
    planes_.assign(size, 0);
    changes_.assign(changes, Change{});
    taps_.assign(history_plane(denoising_.objects), 0);
    float *next = planes_.data();
    Change *next_changes = changes_.data();
    for (Layer *layer : layers()) {
        layer->changes = std::exchange(next_changes, next_changes + changes_of(*layer));
        const auto take = [&] { return std::exchange(next, next + guide_plane(*layer)); };
        if (layer->holds == LayerLight::gloss)
            std::ranges::copy(denoising_.catchers.guides, layer->guides);
        else
            std::ranges::generate(layer->guides, take);
        for (auto &light : layer->light)
            std::ranges::generate(light, take);
    }
    denoising_.taps = taps_.data();
}

const Denoising &Denoiser::begin(const StateSlots &slots, const NewFrame &frame) {
    const arhost_intrinsics &intrinsics = frame.intrinsics;
    if (static_cast<std::uint32_t>(denoising_.objects.width) != intrinsics.width ||
        static_cast<std::uint32_t>(denoising_.objects.height) != intrinsics.height)
        resize(intrinsics.width, intrinsics.height);
    auto *state = static_cast<std::byte *>(slots.after);
    std::memset(state, 0, rows_offset(objects_));
    StateHeader header{state_version, intrinsics.width, intrinsics.height, frame.sequence, 0, frame.sequence, 0,
                       frame.camera},
        earlier{};
    const auto *before = static_cast<const std::byte *>(slots.before);
    if (before)
        std::memcpy(&earlier, before, sizeof earlier);
    if (earlier.version != state_version || earlier.width != header.width || earlier.height != header.height)
        before = nullptr;
    auto *now = reinterpret_cast<ObjectState *>(state + sizeof header);
    for (std::size_t i = 0; i < frame.objects.size(); ++i) {
        std::copy_n(frame.objects[i].world_from_object, 12, now[i].world_from_object);
        now[i].is_visible = frame.objects[i].is_visible;
    }
    const auto *then = before ? reinterpret_cast<const ObjectState *>(before + sizeof header) : nullptr;
    if (then && std::memcmp(then, now, sizeof(ObjectState) * objects_) == 0)
        then = nullptr; // nothing has moved
    const bool moves = then || frame.deforms;
    if (moves && before && static_cast<std::int32_t>(frame.sequence - earlier.sequence) > long_gap)
        before = nullptr, then = nullptr;
    if (before)
        header.first = earlier.first, header.frames = earlier.frames + 1;
    std::size_t next = rows_offset(objects_);
    for (Layer *layer : layers())
        for (int i = 0; i < layer->history_count(); ++i, next += sizeof(float) * history_plane(*layer)) {
            layer->after[i] = reinterpret_cast<float *>(state + next);
            layer->before[i] = before ? reinterpret_cast<const float *>(before + next) : nullptr;
        }
    std::memset(state + next, 0, state_size_ - next); // of a smaller image

    denoising_.has_gloss = has_gloss_;
    denoising_.camera = frame.camera;
    denoising_.video = frame.video;
    denoising_.image = frame.image;
    denoising_.view = frame.view;
    denoising_.before_from_now = nullptr;
    denoising_.camera_moved = false;
    denoising_.objects_moved = moves;
    denoising_.pixel_angle = static_cast<float>(1 / intrinsics.fx);
    denoising_.flat_surface = frame.flat_catcher < 0 ? 0 : surface_number(frame.flat_catcher, real_surface);
    // The numbers of frames may have gaps, such as three of four.
    constexpr std::array<std::int32_t, 4> phases{0, 3, 1, 2};
    denoising_.number = header.first + header.frames;
    const std::int32_t phase = phases[denoising_.number % 4];
    denoising_.first_random_in_turn = (header.first + header.frames / 4) * frame.samples;
    if (before) {
        denoising_.camera_before = earlier.camera;
        denoising_.camera_moved =
            !std::ranges::equal(earlier.camera.eye, frame.camera.eye) ||
            !std::ranges::equal(earlier.camera.world_from_camera, frame.camera.world_from_camera);
    }
    if (then) {
        for (std::size_t i = 0; i < objects_; ++i)
            write_motion(now[i].world_from_object, then[i].world_from_object, motion_.data() + 12 * i);
        denoising_.before_from_now = motion_.data();
    }
    // Shadows and reflections of what has moved change the light of what has not. Where the change is smaller than
    // the noise, it is found in the frames that follow.
    constexpr std::uint32_t frames_to_find_change = 8;
    if (!before)
        header.frames_at_rest = frames_to_find_change;
    else if (!moves)
        header.frames_at_rest = std::min(earlier.frames_at_rest + 1, frames_to_find_change);
    const bool is_coarse = frame.takes_turns && frame.shading_px > 1;
    const bool sharp_shadows_are_new =
        catcher_cell_px_ == 1 && (header.frames_at_rest == 0 || header.frames < frames_to_find_change);
    denoising_.object_phase = is_coarse ? phase : -1;
    denoising_.catcher_phase = frame.takes_turns && !has_gloss_ && (is_coarse || !sharp_shadows_are_new) ? phase : -1;
    denoising_.objects.takes_turns = denoising_.object_phase >= 0;
    denoising_.catchers.takes_turns = denoising_.catcher_phase >= 0 && denoising_.catchers.cell_px == 1;
    denoising_.finds_change = header.frames_at_rest < frames_to_find_change;
    if (denoising_.finds_change)
        std::ranges::fill(changes_, Change{});
    std::memcpy(state, &header, sizeof header);
    return denoising_;
}

void Denoiser::clear(const Rectangle &pixels) {
    for (Layer *layer : {&denoising_.objects, &denoising_.catchers}) {
        const auto cell = [&](std::int32_t px) { return (px + layer->cell_px - 1) / layer->cell_px; };
        for (std::int32_t y = cell(pixels.y0); y < cell(pixels.y1); ++y) {
            float *row = layer->guides[surface_guide] + std::ptrdiff_t{y} * layer->guide_stride() + Layer::margin;
            std::fill(row + cell(pixels.x0), row + cell(pixels.x1), 0.0f);
        }
    }
}

Rectangle Denoiser::run(ThreadPool &threads) {
    constexpr std::int32_t chunk = Layer::change_side; // rows; a square of Layer::changes has one thread
    const std::vector<Layer *> all = layers();
    // Calls step(layer, row) for all rows of the layers that have more than `pass` passes.
    const auto for_each_row = [&](int pass, auto step) {
        struct Rows {
            const Layer &layer;
            std::int32_t first;
        };
        std::vector<Rows> chunks;
        for (const Layer *layer : all)
            if (layer == all.front() || pass < layer->filter_passes())
                for (std::int32_t row = 0; row < layer->height; row += chunk)
                    chunks.push_back({*layer, row});
        threads.for_each(chunks.size(), [&](std::size_t i, std::size_t) {
            const auto [layer, first] = chunks[i];
            for (std::int32_t row = first; row < std::min(first + chunk, layer.height); ++row)
                step(layer, row);
        });
    };
    if (denoising_.finds_change)
        for_each_row(0, [&](const Layer &layer, std::int32_t row) { steps_.find_change(denoising_, layer, row); });
    for_each_row(0, [&](const Layer &layer, std::int32_t row) { steps_.accumulate(denoising_, layer, row); });
    const int passes = denoising_.objects.filter_passes();
    for (int pass = 0; pass < passes; ++pass)
        for_each_row(pass,
                     [&](const Layer &layer, std::int32_t row) { steps_.filter(denoising_, layer, row, pass); });
    Rectangle drawn{std::numeric_limits<std::int32_t>::max(), std::numeric_limits<std::int32_t>::max(), 0, 0};
    std::mutex mutex;
    for_each_row(passes, [&](const Layer &, std::int32_t row) {
        const Rectangle part = steps_.resolve(denoising_, row);
        if (part.x0 >= part.x1)
            return;
        const std::lock_guard lock(mutex);
        drawn = {std::min(drawn.x0, part.x0), std::min(drawn.y0, part.y0), std::max(drawn.x1, part.x1),
                 std::max(drawn.y1, part.y1)};
    });
    return drawn;
}

} // namespace arhost::raytracer_common
