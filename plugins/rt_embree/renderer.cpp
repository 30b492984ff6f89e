// SPDX-License-Identifier: Apache-2.0
#include "renderer.hpp"

#include "object_windows.hpp"
#include "raytracer_common/scene_geometry.hpp"
#include "raytracer_common/slow_image.hpp"
#include "raytracer_common/view.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <span>
#include <string>
#include <utility>

namespace rt_embree {
namespace {

using arhost::Failure;
using arhost::raytracer_common::Pose, arhost::raytracer_common::same_view;

Camera camera_of(const Pose &pose) {
    Camera camera;
    arhost::raytracer_common::write(pose.eye, camera.eye);
    arhost::raytracer_common::write(pose.right, camera.world_from_camera);
    arhost::raytracer_common::write(pose.down, camera.world_from_camera + 3);
    arhost::raytracer_common::write(pose.forward, camera.world_from_camera + 6);
    return camera;
}

// A pixel of a linear image that virtual objects do not affect.
constexpr std::uint16_t half_of_one = 0x3c00;
constexpr std::uint16_t untouched[8] = {0, 0, 0, 0, half_of_one, half_of_one, half_of_one, 0};

void clear(const arhost_image &image, const Rectangle &pixels) {
    for (std::int32_t y = pixels.y0; y < pixels.y1; ++y)
        if (image.linear)
            for (std::int32_t x = pixels.x0; x < pixels.x1; ++x)
                std::memcpy(reinterpret_cast<std::byte *>(image.linear) + std::size_t{image.stride} * y +
                                sizeof untouched * x,
                            untouched, sizeof untouched);
        else
            std::memset(image.rgba + std::size_t{image.stride} * y + std::size_t{4} * pixels.x0, 0,
                        std::size_t{4} * (pixels.x1 - pixels.x0));
}

// The progress of an image, reported from all threads.
class Progress {
public:
    Progress(const arhost::Host &host, std::size_t tiles)
        : host_(host), tiles_(static_cast<double>(tiles)), slow_image_(host) {}

    void finish_tile() { finished_.fetch_add(1, std::memory_order_relaxed); } // relaxed: no other data depends on it
    // Returns whether the image is still wanted.
    bool goes_on() const {
        slow_image_.report(static_cast<double>(finished_.load(std::memory_order_relaxed)) / tiles_);
        return !host_.cancelled();
    }

private:
    const arhost::Host &host_;
    const double tiles_;
    std::atomic<std::size_t> finished_ = 0;
    mutable arhost::raytracer_common::SlowImage slow_image_;
};

Rectangle united(const Rectangle &a, const Rectangle &b) {
    return {std::min(a.x0, b.x0), std::min(a.y0, b.y0), std::max(a.x1, b.x1), std::max(a.y1, b.y1)};
}

Kernel kernel_of(InstructionSet instructions) {
    switch (instructions) {
#if defined(__x86_64__)
    case InstructionSet::avx512:
        return avx512::kernel();
    case InstructionSet::avx2:
        return avx2::kernel();
#endif
    default:
        return base::kernel();
    }
}

// Whether there are virtual mirrors, glass or translucent objects.
bool has_specular(const EmbreeScene &scene) {
    return std::ranges::any_of(std::span(scene.view().objects, scene.placed_objects().size()),
                               [](const Object &object) {
                                   const arhost_material_model model = object.material->model;
                                   return object.role == ARHOST_ROLE_VIRTUAL &&
                                          (model == ARHOST_MATERIAL_MIRROR || model == ARHOST_MATERIAL_GLASS ||
                                           object.material->transmission > 0 || object.blends);
                               });
}

} // namespace

ScratchMemory::ScratchMemory(std::uint32_t max_depth) : queues_(max_depth + 1) {
    // The first queue holds up to three rays per pixel: one that passes a translucent surface, and two that glass
    // reflects and refracts or that glossy catchers scatter. Other queues get at most three rays for each ray of a
    // packet, and only while they hold no full packet (trace_queued_rays() in scatter.inl). Whole packets are read
    // even from partly filled queues.
    constexpr std::int32_t packet = 16, first_capacity = 3 * tile_pixels + packet, capacity = 4 * packet;
    constexpr int pixel_rows = plane_count * 3 + sum_rows + 3 + guide_rows;
    constexpr std::int32_t caught_capacity = tile_pixels / 4 + packet, deferred_capacity = tile_pixels + packet;
    storage_.resize(std::size_t{pixel_rows} * tile_pixels +
                    std::size_t{DeferredPixels::rows} * (caught_capacity + deferred_capacity) +
                    std::size_t{RayQueue::rows} * (first_capacity + std::size_t{max_depth} * capacity));
    float *next = storage_.data();
    const auto take = [&](std::int32_t count) { return std::exchange(next, next + count); };
    for (float *&row : scratch_.radiance)
        row = take(plane_count * tile_pixels);
    for (float *&row : scratch_.sum)
        row = take(tile_pixels);
    for (float *&row : scratch_.seen)
        row = take(tile_pixels);
    for (float *&row : scratch_.guide)
        row = take(tile_pixels);
    for (float *&row : scratch_.catchers.values)
        row = take(caught_capacity);
    for (float *&row : scratch_.objects.values)
        row = take(deferred_capacity);
    for (std::uint32_t depth = 0; depth <= max_depth; ++depth) {
        const std::int32_t size = depth == 0 ? first_capacity : capacity;
        queues_[depth] = {take(RayQueue::rows * size), 0, size};
    }
    scratch_.queues = queues_.data();
}

Renderer::Renderer(const arhost_raytracer_setup &setup, const Settings &settings, const arhost::Host &host)
    : host_(host), full_intrinsics_((arhost::raytracer_common::check_setup(setup), *setup.intrinsics)),
      intrinsics_(full_intrinsics_), kernel_(kernel_of(settings.instruction_set)), threads_(settings.threads),
      ray_table_(intrinsics_,
                 settings.samples > 1 || settings.accumulate || setup.scene->integrator == ARHOST_INTEGRATOR_PATH,
                 threads_),
      samples_per_frame_(settings.samples), samples_(arhost::raytracer_common::sample_positions(settings.samples)),
      scene_(*setup.scene, threads_.thread_count(), settings.robust, host), light_samples_(settings.light_samples),
      single_path_(settings.single_path), max_radiance_(settings.max_radiance), view_(settings.view),
      blends_codes_(setup.compositing != ARHOST_COMPOSITING_LINEAR), full_samples_(settings.samples),
      photons_per_sample_(settings.photons), lens_(video_through(full_intrinsics_, scene_.colour_tables())) {
    if (setup.form == ARHOST_IMAGE_FORM_LINEAR && setup.scene->integrator != ARHOST_INTEGRATOR_PATH)
        throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT,
                      "linear images need a scene with the path integrator; request straight ones");
    if (setup.scene->integrator == ARHOST_INTEGRATOR_PATH) {
        lights_.emplace(*setup.scene);
        irradiance_ = arhost::raytracer_common::environment_irradiance(*setup.scene);
        brightest_texel_ = arhost::raytracer_common::brightest_texel(*setup.scene);
        place_lights();
    }
    if (settings.denoise && lights_ && setup.scene->objects.count <= Denoising::most_objects)
        denoiser_.emplace(settings.instruction_set, full_intrinsics_.width, full_intrinsics_.height,
                          setup.scene->objects.count,
                          DenoisedScene{.has_sharp_shadows = lights_->casts_sharp_shadows(),
                                        .has_gloss = scene_.view().has_gloss,
                                        .has_specular = has_specular(scene_)});
    remembers_ = denoiser_ && setup.video_format && has_specular(scene_);
    for (unsigned i = 0; i < threads_.thread_count(); ++i)
        scratch_.emplace_back(setup.scene->max_depth);
    if (settings.accumulate)
        history_.resize(sum_rows * ray_table_.tiles().size() * tile_pixels);
}

void Renderer::set_samples(std::uint32_t samples, std::uint32_t full_samples) {
    full_samples_ = full_samples;
    if (samples == samples_per_frame_)
        return;
    if (samples > 1 && !ray_table_.rays().has_derivatives)
        ray_table_ = RayTable(intrinsics_, true, threads_);
    samples_per_frame_ = samples;
    samples_ = arhost::raytracer_common::sample_positions(samples);
    history_camera_.reset();
}

void Renderer::set_light_samples(std::int32_t samples) {
    light_samples_ = samples;
    history_camera_.reset();
}

// Adapts the renderer to the image size of the camera. Does nothing if this size exceeds that of the setup.
void Renderer::set_size(const arhost_camera &camera) {
    const std::uint32_t width = camera.intrinsics.width, height = camera.intrinsics.height;
    if ((width == intrinsics_.width && height == intrinsics_.height) || width < 1 || height < 1 ||
        width > full_intrinsics_.width || height > full_intrinsics_.height)
        return;
    intrinsics_ = arhost_scaled_intrinsics(full_intrinsics_, width, height);
    ray_table_ = RayTable(intrinsics_, ray_table_.rays().has_derivatives, threads_);
    if (!history_.empty())
        history_.resize(sum_rows * ray_table_.tiles().size() * tile_pixels);
    history_camera_.reset();
}

void Renderer::place_lights() {
    lights_->place(scene_.placed_objects());
    scene_.set_emitters(lights_->emitters());
    const auto spheres = lights_->specular_spheres();
    photon_targets_.set(scene_.arena(), {spheres.begin(), spheres.end()});
    constexpr std::size_t rows = arhost::raytracer_common::source_rows;
    const auto records = lights_->records();
    for (std::size_t i = 0; i < std::min(records.size(), few_sources_.size()); ++i)
        few_sources_[i % rows * most_few_sources + i / rows] = records[i];
}

// Sends photons from the lamps to mirrors and glass. With denoising, frames take turns with a few sets of photons, so
// that a scene at rest soon needs no new ones.
void Renderer::trace_photons(Frame &frame) {
    constexpr std::uint32_t chunk = 1 << 12;
    const std::uint32_t count = arhost::raytracer_common::photon_count(photons_per_sample_, frame.sample_count);
    if (photon_targets_.empty() || count == 0)
        return;
    std::size_t set = 0;
    if (frame.denoising) {
        // Larger sets need less variety, and more memory.
        set = frame.denoising->number % std::clamp<std::size_t>((1u << 18) / count, 1, photon_sums_.size());
        if (count != std::exchange(photons_per_set_, count))
            photon_sums_ = {};
        if (photon_sums_[set]) {
            frame.path.photons = photon_sums_[set]->view();
            return;
        }
    }
    Caustics &caustics = frame.path.caustics;
    caustics.spheres = photon_targets_.spheres().data()->data();
    caustics.cumulative = photon_targets_.cumulative().data();
    caustics.chances = photon_targets_.chances().data();
    caustics.sphere_count = static_cast<std::int32_t>(photon_targets_.spheres().size());
    caustics.lamp_count = static_cast<std::int32_t>(frame.scene.light_count);
    caustics.scene_extent = arhost::raytracer_common::scene_extent(scene_.arena());
    caustics.photon_count = count;
    caustics.first_number =
        frame.denoising ? static_cast<std::uint32_t>(set) * count : frame.first_random * photons_per_sample_;
    photons_.resize(count);
    photon_faces_.resize(count);
    threads_.for_each((count + chunk - 1) / chunk, [&](std::size_t i, std::size_t) {
        const auto first = static_cast<std::uint32_t>(i) * chunk;
        if (frame.goes_on(frame.progress))
            kernel_.trace_photons(frame, first, std::min(chunk, count - first), photons_.data() + first,
                                  photon_faces_.data() + first);
    });
    if (!frame.goes_on(frame.progress))
        return;
    Photons &photons = frame.path.photons;
    if (frame.denoising) {
        // Light that is too weak to be seen is left out. Each set has its own grid, so that its steps are no edges of
        // the picture: powers of the inverse of the root of x⁴ = x + 1 (the R3 sequence: M. Roberts, The Unreasonable
        // Effectiveness of Quasirandom Sequences, 2018).
        const auto fraction = [&](double irrational) {
            const double at = static_cast<double>(set + 1) * irrational;
            return static_cast<float>(at - std::floor(at));
        };
        photon_map_.build(photons_,
                          {.sorts = false,
                           .negligible = lights_->faintest_light() / 1024,
                           .shift = {fraction(0.8191725134), fraction(0.6710436067), fraction(0.5497004779)}});
        photons = photon_sums_[set].emplace(photon_map_, photons_, photon_faces_).view();
        return;
    }
    photon_map_.build(photons_);
    if (photon_map_.photons().empty())
        return;
    photons.photons = photon_map_.photons().data()->position;
    photons.near = photon_map_.near().data();
    std::copy_n(photon_map_.low().data(), 3, photons.low);
    for (const arhost::raytracer_common::PhotonGrid &from : photon_map_.levels())
        photons.levels[photons.level_count++] = {from.numbers.data(), from.starts.data(),
                                                 static_cast<std::int32_t>(from.starts.size()) - 2, from.radius};
}

// Whether the kernel can tell where virtual objects do not change the light of a catcher.
bool Renderer::finds_unchanged() const {
    constexpr std::uint32_t most_lamps = 64; // the time is proportional to their number
    const auto shines = [](const Object &object) {
        return object.role == ARHOST_ROLE_VIRTUAL &&
               std::ranges::any_of(object.material->emission, [](float channel) { return channel > 0; });
    };
    const Scene &scene = scene_.view();
    return scene.light_count <= most_lamps && !scene.has_gloss &&
           std::ranges::none_of(std::span(scene.objects, scene_.placed_objects().size()), shines);
}

PathScene Renderer::path_scene() const {
    PathScene path{};
    path.wide_catcher = -1;
    if (!lights_)
        return path;
    path.sources = lights_->records().data();
    path.cumulative = lights_->cumulative().data();
    path.source_count = static_cast<std::int32_t>(lights_->cumulative().size());
    if (path.source_count <= most_few_sources)
        path.few_sources = few_sources_.data();
    path.lamp_chances = lights_->lamp_chances().data();
    path.environment_chance = lights_->environment_chance();
    path.irradiance = {irradiance_.data(),
                       arhost::raytracer_common::irradiance_width,
                       arhost::raytracer_common::irradiance_height,
                       ARHOST_TEXEL_RGBA32F,
                       ARHOST_WRAP_REPEAT,
                       ARHOST_WRAP_CLAMP};
    path.spheres = reinterpret_cast<const float *>(lights_->spheres().data()); // there may be none
    path.sphere_count = static_cast<std::int32_t>(lights_->spheres().size());
    path.max_radiance = max_radiance_;
    path.least_irradiance = lights_->least_irradiance(has_video_ ? &video_ : nullptr);
    path.brightest_texel = brightest_texel_;
    path.video = lens_;
    if (has_video_)
        path.video.image.texels = video_.texels();
    path.video.pixel_width = 1 / static_cast<float>(intrinsics_.width);
    path.video.pixel_height = 1 / static_cast<float>(intrinsics_.height);
    return path;
}

Rectangle Renderer::render(const arhost_camera &camera, const arhost_image &image, const arhost_motion *motion,
                           const arhost_frame *video, std::uint64_t sequence, const StateSlots &state,
                           std::uint32_t shading_px) {
    set_size(camera);
    arhost::raytracer_common::check_render(camera, image, intrinsics_);
    const Pose pose(camera);
    if (motion) {
        photon_sums_ = {};
        scene_.move(*motion);
        if (lights_)
            place_lights();
    }
    has_video_ = lights_ && video && video->format->width == full_intrinsics_.width &&
                 video->format->height == full_intrinsics_.height;
    if (has_video_)
        video_.set(*video);
    scene_.set_environment_scale(
        arhost::raytracer_common::environment_scale(scene_.arena().environment, has_video_ ? &video_ : nullptr));

    const ObjectWindows windows(scene_, pose, ray_table_.rays().dimensions == 2);
    const std::vector<Tile> &tiles = ray_table_.tiles();
    if (!history_.empty()) {
        if (motion || !history_camera_ || !same_view(*history_camera_, camera))
            history_samples_ = 0;
        history_camera_ = camera;
        samples_ = arhost::raytracer_common::sample_positions(
            history_samples_,
            history_samples_ < arhost::raytracer_common::max_accumulated_samples ? samples_per_frame_ : 0);
    }
    // The random numbers of successive frames continue one sequence.
    std::uint32_t first_random = history_samples_;
    if (lights_ && history_.empty()) {
        first_random = static_cast<std::uint32_t>(sequence) * full_samples_;
        samples_ = arhost::raytracer_common::sample_positions(first_random % (1u << 16), samples_per_frame_);
    }
    Progress progress(host_, tiles.size());
    Frame frame{scene_.view(),
                ray_table_.rays(),
                camera_of(pose),
                samples_.data(),
                static_cast<std::int32_t>(samples_.size()),
                history_samples_,
                {},
                light_samples_,
                single_path_,
                {image.rgba, image.stride, image.linear, blends_codes_, &scene_.colour_tables().srgb8},
                first_random,
                path_scene(),
                nullptr,
                nullptr,
                View::picture,
                [](const void *of) { return static_cast<const Progress *>(of)->goes_on(); },
                &progress};
    frame.scene.random_seed = first_random;
    if (lights_ && frame.scene.has_image_levels) // with the path integrator
        frame.scene.ray_angle = arhost::raytracer_common::ray_angle(intrinsics_, samples_.size());
    if (!history_.empty())
        for (std::size_t i = 0; i < sum_rows; ++i)
            frame.history[i] = history_.data() + i * tiles.size() * tile_pixels;
    if (denoiser_ && state.after) {
        frame.view = view_;
        frame.denoising = &denoiser_->begin(state, {.intrinsics = intrinsics_,
                                                    .camera = frame.camera,
                                                    .video = frame.path.video,
                                                    .image = frame.image,
                                                    .view = view_,
                                                    .objects = scene_.placed_objects(),
                                                    .deforms = motion && motion->deformed_count > 0,
                                                    .sequence = static_cast<std::uint32_t>(sequence),
                                                    .samples = full_samples_,
                                                    .flat_catcher = windows.wide_catcher(),
                                                    .takes_turns = true,
                                                    .shading_px = shading_px});
    }
    std::optional<Surroundings> surroundings;
    if (frame.denoising && remembers_) {
        frame.surroundings = &surroundings.emplace(
            surroundings_in(state.from(denoiser_->state_size()), scene_, windows.wide_catcher(), frame.camera));
        constexpr std::int32_t rows = 16;
        threads_.for_each(Surroundings::height / rows, [&](std::size_t i, std::size_t) {
            for (std::int32_t row = 0; row < rows; ++row)
                kernel_.remember_row(frame, static_cast<std::int32_t>(i) * rows + row);
        });
    }
    if (frame.denoising && finds_unchanged() && view_ == View::picture)
        frame.path.wide_catcher = windows.wide_catcher();
    if (lights_)
        trace_photons(frame);
    const RenderTile render_tile = lights_ ? kernel_.render_path_tile : kernel_.render_tile;
    Rectangle drawn{std::numeric_limits<std::int32_t>::max(), std::numeric_limits<std::int32_t>::max(), 0, 0};
    std::mutex drawn_mutex;
    threads_.for_each(tiles.size(), [&](std::size_t i, std::size_t thread) {
        const Tile &tile = tiles[i];
        const Window &window = ray_table_.window(i);
        if (!windows.may_affect(window) || host_.cancelled())
            return frame.denoising ? denoiser_->clear(tile.pixels) : clear(image, tile.pixels);
        Scratch &scratch = *scratch_[thread];
        windows.select(window, scratch);
        const Rectangle part = render_tile(frame, tile, scratch);
        progress.finish_tile();
        if (part.x0 < part.x1) {
            std::lock_guard lock(drawn_mutex);
            drawn = united(drawn, part);
        }
    });
    if (host_.cancelled()) {
        history_camera_.reset(); // the sums are incomplete
        throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled while tracing the image");
    }
    if (frame.denoising) {
        threads_.for_each(tiles.size(), [&](std::size_t i, std::size_t) {
            if (frame.goes_on(frame.progress))
                kernel_.find_taps(frame, tiles[i]);
        });
        drawn = denoiser_->run(threads_);
        if (host_.cancelled())
            throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled while denoising the image");
        return drawn;
    }
    if (!history_.empty())
        history_samples_ += static_cast<std::uint32_t>(samples_.size());
    return drawn;
}

} // namespace rt_embree
