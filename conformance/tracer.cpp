// SPDX-License-Identifier: Apache-2.0
#include "conformance/tracer.hpp"

#include "base/unique_fd.hpp"
#include "scene/capabilities.hpp"
#include "worker/library.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <sys/mman.h>
#include <tuple>
#include <type_traits>

namespace arhost::conformance {

using ipc::Call;

namespace {

// Memory for a state, whose address is aligned as in the worker.
std::unique_ptr<GuardedMemory> state_memory(std::uint64_t size) {
    return std::make_unique<GuardedMemory>((size + 4095) / 4096 * 4096);
}

bool same(const arhost_intrinsics &a, const arhost_intrinsics &b) {
    return std::tie(a.width, a.height, a.distortion, a.fx, a.fy, a.cx, a.cy) ==
               std::tie(b.width, b.height, b.distortion, b.fx, b.fy, b.cx, b.cy) &&
           std::equal(std::begin(a.coefficients), std::end(a.coefficients), std::begin(b.coefficients));
}

} // namespace

SealedScene::SealedScene(scene::ArenaBuilder builder) : memory_(nullptr), size_(builder.byte_size()) {
    memory_ = ::mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory_ == MAP_FAILED)
        base::throw_errno("mmap of a scene");
    const std::span<std::byte> bytes(static_cast<std::byte *>(memory_), size_);
    std::move(builder).write(bytes);
    if (const std::string problem = scene::validate(bytes); !problem.empty())
        throw std::runtime_error("the test's scene is invalid: " + problem);
    ::mprotect(memory_, size_, PROT_READ);
}

SealedScene::~SealedScene() {
    if (memory_)
        ::munmap(memory_, size_);
}

bool has_capability(Context &context, std::uint64_t capability) {
    Instance instance(context.library);
    instance.create_or_fail();
    const arhost_plugin &plugin = context.library.plugin();
    const auto &functions = *static_cast<const arhost_raytracer *>(plugin.functions);
    return (scene::capabilities_of(*plugin.descriptor, functions, instance.get()) & capability) != 0;
}

void need_capability(Context &context, std::uint64_t capability, const char *name) {
    if (!has_capability(context, capability))
        throw Skip(fmt::format("ARHOST_RAYTRACER_CAPABILITY_{} is not declared", name));
}

Settings with_samples(Context &context, int samples) {
    const arhost_option_descriptor *option = context.library.option("samples");
    return option && option->type == ARHOST_OPTION_INTEGER ? Settings{{"samples", std::to_string(samples)}}
                                                           : Settings{};
}

Tracer::Tracer(Context &context, scene::ArenaBuilder builder, Settings overrides)
    : instance_(context.library, std::move(overrides)), scene_(std::move(builder)),
      functions_(*static_cast<const arhost_raytracer *>(context.library.plugin().functions)) {
    instance_.create_or_fail();
}

arhost_status Tracer::try_start(const arhost_intrinsics &intrinsics) {
    stop();
    const arhost_raytracer_setup setup{sizeof setup,
                                       intrinsics.width,
                                       intrinsics.height,
                                       form_,
                                       &scene_->get(),
                                       &intrinsics,
                                       compositing_,
                                       0,
                                       video_ ? &video_->format() : nullptr};
    const arhost_status status =
        in_call(instance_.library().calls(), Call::start, [&] { return functions_.start(instance_.get(), &setup); });
    if (status != ARHOST_STATUS_OK)
        return status;
    started_ = intrinsics;
    state_size_ = in_call(instance_.library().calls(), Call::start,
                          [&] { return worker::state_size_of(functions_, instance_.get()); });
    state_after_.reset();
    return status;
}

void Tracer::start(const arhost_intrinsics &intrinsics) {
    instance_.expect_ok("start", try_start(intrinsics));
}

void Tracer::stop() {
    if (std::exchange(started_, std::nullopt))
        in_call(instance_.library().calls(), Call::stop, [&] { functions_.stop(instance_.get()); });
}

void Tracer::change_scene(scene::ArenaBuilder builder) {
    stop();
    scene_.emplace(std::move(builder));
}

void Tracer::set_compositing(arhost_compositing compositing) {
    if (compositing != std::exchange(compositing_, compositing))
        stop();
}

void Tracer::set_video(const Video *video) {
    const auto format_of = [](const Video *of) { return of ? of->format().pixel_format : 0; };
    if (format_of(video) != format_of(std::exchange(video_, video)))
        stop();
}

template <class Image>
arhost_status Tracer::try_render(const arhost_camera &camera, std::optional<Image> &slot, Image &picture,
                                 arhost_render_info &info, const arhost_motion *motion) {
    arhost_render_request request{
        sizeof request, max_samples_, sequence_, 0,       camera,      motion, video_ ? &video_->frame() : nullptr,
        nullptr,        nullptr,      0,         nullptr, shading_px_, 0};
    if (state_before_ && state_before_size_ != state_size_)
        throw std::logic_error("the state is of another setup");
    if (state_size_ > 0) {
        state_after_ = state_memory(state_size_);
        std::fill_n(state_after_->data(), state_size_, state_filler_);
        request.state_before = state_before_ ? state_before_->data() : nullptr;
        request.state_after = state_after_->data();
        request.state_size = state_size_;
    }
    slot = picture; // keeps its address, because the size is the same
    const arhost_image image = slot->image();
    info = {};
    info.struct_size = sizeof info;
    const auto begin = std::chrono::steady_clock::now();
    const arhost_status status = in_call(instance_.library().calls(), Call::per_frame,
                                         [&] { return functions_.render(instance_.get(), &request, &image, &info); });
    duration_ = std::chrono::steady_clock::now() - begin;
    picture = *slot;
    return status;
}
template arhost_status Tracer::try_render(const arhost_camera &, std::optional<Picture> &, Picture &,
                                          arhost_render_info &, const arhost_motion *);

template <class Image>
void Tracer::render(const arhost_camera &camera, std::optional<Image> &slot, Image &picture,
                    const arhost_motion *motion) {
    const arhost_image_form form =
        std::is_same_v<Image, Picture> ? ARHOST_IMAGE_FORM_STRAIGHT : ARHOST_IMAGE_FORM_LINEAR;
    const arhost_intrinsics &setup = full_size_ ? *full_size_ : camera.intrinsics;
    if (form != std::exchange(form_, form) || !started_ || !same(*started_, setup))
        start(setup);
    instance_.expect_ok("render", try_render(camera, slot, picture, info_, motion));
}

void Tracer::set_state(const std::vector<std::byte> &state, std::uint64_t sequence, std::byte filler) {
    sequence_ = sequence;
    state_filler_ = filler;
    state_before_.reset();
    if (state.empty())
        return;
    state_before_size_ = state.size();
    state_before_ = state_memory(state.size());
    std::ranges::copy(state, state_before_->data());
    state_before_->seal();
}

std::vector<std::byte> Tracer::state_after() const {
    if (!state_after_)
        return {};
    return {state_after_->data(), state_after_->data() + state_size_};
}

Picture Tracer::render(const arhost_camera &camera, const arhost_motion *motion, std::uint8_t fill) {
    Picture picture(camera.intrinsics.width, camera.intrinsics.height, fill);
    render(camera, straight_slot_, picture, motion);
    return picture;
}

LinearPicture Tracer::render_linear(const arhost_camera &camera, std::uint8_t fill) {
    LinearPicture picture(camera.intrinsics.width, camera.intrinsics.height, fill);
    render(camera, linear_slot_, picture, nullptr);
    return picture;
}

} // namespace arhost::conformance
