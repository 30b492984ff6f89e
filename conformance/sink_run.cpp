// SPDX-License-Identifier: Apache-2.0
#include "conformance/sink_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <random>
#include <sstream>

namespace arhost::conformance {

using ipc::Call;
namespace fs = std::filesystem;

namespace {

constexpr double fps = 25;

arhost_intrinsics lens(const Size &size) {
    arhost_intrinsics in{};
    in.struct_size = sizeof in;
    in.width = size.width;
    in.height = size.height;
    in.distortion = ARHOST_DISTORTION_NONE;
    in.fx = in.fy = 1.2 * size.width;
    in.cx = (size.width - 1) / 2.0;
    in.cy = (size.height - 1) / 2.0;
    return in;
}

// Copies the elements to the end of guarded memory. Without elements, there is no accessible byte.
template <class T>
const T *put(std::optional<GuardedMemory> &memory, const std::vector<T> &elements, std::size_t extra) {
    const std::size_t stride = sizeof(T) + extra;
    std::byte *const bytes = memory.emplace(stride * elements.size()).data();
    std::fill_n(bytes, stride * elements.size(), std::byte{0xa5});
    for (std::size_t i = 0; i < elements.size(); ++i) {
        T element = elements[i];
        element.struct_size = static_cast<std::uint32_t>(stride);
        std::memcpy(bytes + stride * i, &element, sizeof element);
    }
    memory->seal();
    return reinterpret_cast<const T *>(bytes);
}

} // namespace

arhost_target detected_target(const std::string &name, double z_mm, std::uint32_t first, std::uint32_t count) {
    arhost_target t{};
    t.struct_size = sizeof t;
    t.state = ARHOST_TARGET_DETECTED;
    name.copy(t.name, sizeof t.name - 1);
    t.first_observation = first;
    t.observation_count = count;
    t.mt[0] = t.mt[5] = t.mt[10] = t.mt[15] = 1;
    t.mt[14] = z_mm;
    for (int i = 0; i < 6; ++i)
        t.covariance[7 * i] = i < 3 ? 0.25 : 1e-4;
    t.reprojection_px = 0.125;
    t.ambiguity = 0.25;
    std::copy_n(t.mt, 16, t.mt_alternative);
    return t;
}

arhost_observation observation(int id) {
    arhost_observation o{};
    o.struct_size = sizeof o;
    o.id = id;
    o.hamming = 1;
    o.decision_margin = 62.5;
    for (int corner = 0; corner < 4; ++corner) {
        o.corners_px[corner][0] = corner == 1 || corner == 2 ? 40.25 : 20.5;
        o.corners_px[corner][1] = corner >= 2 ? 30.75 : 10;
    }
    return o;
}

arhost_frame_format video_format(const Size &size) {
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = ARHOST_PIXEL_FORMAT_BGR8;
    format.width = size.width;
    format.height = size.height;
    format.fps = fps;
    format.has_depth = 1;
    arhost_frame_layout(&format);
    return format;
}

SealedOutput::SealedOutput(const Content &content)
    : stride_(ipc::OutputSlot::stride(content.size.width) + content.padding),
      video_format_(video_format(content.size)), record_(sizeof(arhost_record)),
      pixels_(std::size_t{stride_} * content.size.height), video_(video_format_.byte_size),
      overlay_(std::size_t{ipc::overlay_stride(content.size.width)} * content.size.height) {
    const Size &size = content.size;
    auto *bgr = reinterpret_cast<std::uint8_t *>(pixels_.data());
    std::mt19937 noise(static_cast<std::uint32_t>(2 * content.sequence + content.other));
    for (std::uint32_t y = 0; y < size.height; ++y) {
        std::uint8_t *row = bgr + std::size_t{stride_} * y;
        std::memset(row, content.in_padding, stride_);
        std::generate_n(row, 3 * size.width, [&] { return static_cast<std::uint8_t>(noise() >> 24); });
    }

    arhost_record &r = *new (record_.data()) arhost_record{};
    r.struct_size = sizeof r;
    r.clock = ARHOST_CLOCK_MEDIA;
    r.sequence = content.sequence;
    r.capture_ns = static_cast<std::int64_t>(1e9 * static_cast<double>(content.sequence) / fps);
    r.overlay = ARHOST_OVERLAY_RENDERED;
    r.has_camera = 1;
    const double eye[] = {0, 0, content.other ? 400.5 : 500.5}, look_at[] = {0, 0, eye[2] - 1}, up[] = {0, 1, 0};
    r.camera.struct_size = sizeof r.camera;
    std::copy_n(eye, 3, r.camera.eye);
    std::copy_n(look_at, 3, r.camera.look_at);
    std::copy_n(up, 3, r.camera.up);
    r.camera.intrinsics = lens(size);
    std::strcpy(r.families[0], "tag36h11");
    set_tracked({detected_target("cup", -eye[2], 0, 1)}, {observation(3)});
    const auto fill = [&](const GuardedMemory &memory, std::size_t size) {
        std::generate_n(memory.data(), size, [&] { return static_cast<std::byte>(noise() >> 24); });
    };
    fill(video_, video_format_.byte_size);
    fill(overlay_, std::size_t{ipc::overlay_stride(size.width)} * size.height);
    output_ = {sizeof output_, stride_, size.width, size.height, bgr, &r, {}, nullptr, nullptr, 0, 0};
    output_.video[0] = reinterpret_cast<const std::uint8_t *>(video_.data());
    output_.depth_mm = reinterpret_cast<const std::uint16_t *>(video_.data() + video_format_.depth_offset);
    output_.overlay_rgba = reinterpret_cast<const std::uint8_t *>(overlay_.data());
    output_.overlay_stride = ipc::overlay_stride(size.width);
    for (GuardedMemory *memory : {&record_, &pixels_, &video_, &overlay_})
        memory->seal();
}

void SealedOutput::set_tracked(const std::vector<arhost_target> &targets,
                               const std::vector<arhost_observation> &observations, std::size_t extra) {
    change([&](arhost_record &r) {
        r.target_count = static_cast<std::uint32_t>(targets.size());
        r.targets = put(targets_, targets, extra);
        r.observation_count = static_cast<std::uint32_t>(observations.size());
        r.observations = put(observations_, observations, extra);
    });
}

Files files_in(const fs::path &folder) {
    Files files;
    for (const fs::directory_entry &entry : fs::recursive_directory_iterator(folder)) {
        if (!entry.is_regular_file())
            continue;
        std::ostringstream bytes;
        bytes << std::ifstream(entry.path(), std::ios::binary).rdbuf();
        files[entry.path().lexically_relative(folder)] = bytes.str();
    }
    return files;
}

SinkRun::SinkRun(Context &context, const std::string &folder)
    : library_(context.library), folder_(folder),
      functions_(*static_cast<const arhost_sink *>(context.library.plugin().functions)) {
    fs::create_directories(library_.scratch() / folder_);
    create();
}

void SinkRun::create() {
    instance_.emplace(library_, Settings{}, folder_);
    instance_->create_or_fail();
}

SinkRun::~SinkRun() {
    try_stop();
}

arhost_status SinkRun::try_start(std::uint64_t first_sequence, const Size &size) {
    try_stop();
    if (!std::exchange(fresh_, false))
        create();
    const arhost_intrinsics intrinsics = lens(size);
    const arhost_frame_format format = video_format(size);
    const bool describes = (library_.plugin().descriptor->capabilities & ARHOST_SINK_CAPABILITY_RUN_DESCRIPTION) != 0;
    const arhost_sink_setup setup{sizeof setup,
                                  size.width,
                                  size.height,
                                  0,
                                  fps,
                                  first_sequence,
                                  &intrinsics,
                                  &format,
                                  describes ? R"({"format": "arhost-session", "version": 1, "id": "conform"})"
                                            : nullptr};
    const arhost_status status =
        in_call(library_.calls(), Call::start, [&] { return functions_.start(instance_->get(), &setup); });
    started_ = status == ARHOST_STATUS_OK;
    instance_->host().accept_commands(started_);
    size_ = size;
    return status;
}

void SinkRun::start(std::uint64_t first_sequence, const Size &size) {
    instance_->expect_ok("start", try_start(first_sequence, size));
}

arhost_status SinkRun::try_write(const SealedOutput &frame) {
    arhost_output output = frame.output();
    const std::uint64_t capabilities =
        library_.plugin().descriptor->capabilities &
        (functions_.capabilities ? functions_.capabilities(instance_->get()) : ~std::uint64_t{0});
    if (!(capabilities & ARHOST_SINK_CAPABILITY_VIDEO_INPUT)) {
        std::fill(std::begin(output.video), std::end(output.video), nullptr);
        output.depth_mm = nullptr;
    }
    if (!(capabilities & ARHOST_SINK_CAPABILITY_OVERLAY_INPUT)) {
        output.overlay_rgba = nullptr;
        output.overlay_stride = 0;
    }
    instance_->host().answer_commands();
    return in_call(library_.calls(), Call::per_frame, [&] { return functions_.write(instance_->get(), &output); });
}

void SinkRun::write(const SealedOutput &frame) {
    instance_->expect_ok(fmt::format("write of frame {}", frame.output().record->sequence).c_str(), try_write(frame));
}

void SinkRun::write(std::uint64_t first, std::uint64_t end) {
    for (std::uint64_t sequence = first; sequence < end; ++sequence)
        write(SealedOutput({sequence, size_}));
}

Files SinkRun::run(std::uint64_t frames) {
    start();
    write(0, frames);
    stop();
    return files();
}

arhost_status SinkRun::try_idle() {
    instance_->host().answer_commands();
    return in_call(library_.calls(), Call::idle, [&] { return functions_.idle(instance_->get()); });
}

arhost_status SinkRun::try_stop() {
    if (!std::exchange(started_, false))
        return ARHOST_STATUS_OK;
    const arhost_status status =
        in_call(library_.calls(), Call::stop, [&] { return functions_.stop(instance_->get()); });
    instance_->host().accept_commands(false);
    return status;
}

void SinkRun::stop() {
    instance_->expect_ok("stop", try_stop());
}

} // namespace arhost::conformance
