// SPDX-License-Identifier: Apache-2.0
//
// source_synthetic: a printed marker on a desk, filmed by a moving camera whose poses are known exactly.
#include "marker_cells.hpp"
#include "path.hpp"
#include "renderer.hpp"

#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <thread>

namespace {

using namespace arhost::synthetic;
using arhost::Failure;

constexpr const char *paths[] = {"orbit", "still", "approach", nullptr};

std::int64_t now_ns() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

// A small camera with mild distortion and an off-centre principal point.
arhost_intrinsics default_camera(std::int64_t width, std::int64_t height) {
    arhost_intrinsics camera{};
    camera.struct_size = sizeof camera;
    camera.width = static_cast<std::uint32_t>(width);
    camera.height = static_cast<std::uint32_t>(height);
    camera.distortion = ARHOST_DISTORTION_BROWN;
    const double x_scale = static_cast<double>(width) / 1280, y_scale = static_cast<double>(height) / 720;
    camera.fx = camera.fy = 1020 * x_scale;
    camera.cx = 645.5 * x_scale - 0.5;
    camera.cy = 355.5 * y_scale - 0.5;
    camera.coefficient_count = 5;
    const double coefficients[] = {-0.094, 0.061, 0.0006, -0.0004, -0.011};
    std::copy(std::begin(coefficients), std::end(coefficients), camera.coefficients);
    return camera;
}

// Returns the camera distance at which the marker appears as large as with the default lens, relative to the distance
// for the default lens.
double distance_scale_of(const arhost_intrinsics &camera) {
    const auto half_view = [](double centre, double size, double focal) {
        const double px = std::max(0.5, std::min(centre + 0.5, size - 0.5 - centre));
        return std::tan(std::min(px / focal, 1.0));
    };
    const double half =
        std::min(half_view(camera.cx, camera.width, camera.fx), half_view(camera.cy, camera.height, camera.fy));
    return std::clamp(std::tan(std::atan(355.5 / 1020)) / half, 0.6, 4.0);
}

class SyntheticSource {
public:
    SyntheticSource(const arhost::Host &host, const arhost::Options &options)
        : host_(host), width_(options.integer("width")), height_(options.integer("height")),
          period_s_(options.real("period")), frames_(static_cast<std::uint64_t>(options.integer("frames"))),
          fps_(options.real("fps")), motion_blur_(options.real("motion_blur")),
          occlude_from_(options.integer("occlude_from")), occlude_to_(options.integer("occlude_to")),
          threads_(static_cast<int>(options.integer("threads"))) {
        const std::string path = options.text("path");
        path_ = path == "still" ? PathKind::still : path == "approach" ? PathKind::approach : PathKind::orbit;
        sheet_.family = options.text("family");
        sheet_.id = static_cast<int>(options.integer("id"));
        sheet_.cells = marker_cells(sheet_.family, options.integer("id"));
        target_ = options.text("target");
        if (target_.empty()) // the host uses this name for a target without a name
            target_ = sheet_.family + "-" + std::to_string(sheet_.id);
        if (target_.size() >= ARHOST_MAX_NAME)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "target: has " + std::to_string(target_.size()) +
                                                                 " characters; the name of a target has at "
                                                                 "most " +
                                                                 std::to_string(ARHOST_MAX_NAME - 1));
        sheet_.side_mm = options.real("side_mm");
        sensor_ = {options.real("blur_px"), options.real("noise"), options.real("exposure_ev"),
                   static_cast<std::uint64_t>(options.integer("seed"))};
        if (!(sheet_.side_mm > 0))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "side_mm: must be greater than 0");
        if (!(period_s_ > 0))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "period: must be greater than 0 s");
        if (!(fps_ > 0))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "fps: must be greater than 0");
        if (occlude_from_ >= 0 && occlude_to_ <= occlude_from_)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "occlude_to: must be greater than occlude_from: it is the first frame in which the "
                          "postcard no longer covers the marker");
        if (threads_ < 1)
            threads_ = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    }

    void start(const arhost_source_setup &setup, arhost_source_properties &properties) {
        camera_ = setup.intrinsics ? *setup.intrinsics : default_camera(width_, height_);
        if (setup.fps > 0)
            fps_ = setup.fps;
        paced_ = setup.paced != 0;
        distance_scale_ = distance_scale_of(camera_);

        properties.has_intrinsics = 1;
        properties.intrinsics = camera_;
        properties.intrinsics.struct_size = sizeof(arhost_intrinsics);
        arhost_frame_format &format = properties.format;
        format.pixel_format = ARHOST_PIXEL_FORMAT_BGR8;
        format.width = camera_.width;
        format.height = camera_.height;
        format.fps = fps_;
        format.transfer = ARHOST_TRANSFER_LINEAR; // edges are filtered in codes (docs/adr/0007)
        if (!arhost_frame_layout(&format))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "the camera's image size of " + std::to_string(camera_.width) + "×" +
                              std::to_string(camera_.height) + " px is invalid; each side must be 1 to " +
                              std::to_string(ARHOST_MAX_IMAGE_SIDE) + " px");
        properties.frame_count = frames_;

        host_.progress(0, "preparing the desk");
        renderer_.emplace(make_desk(sheet_), camera_, sensor_, threads_);
        host_.progress(1, "ready");
    }

    arhost_status read(const arhost_frame_buffer &buffer, arhost_frame_info &info) {
        std::uint64_t frame = buffer.sequence;
        if (paced_)
            if (const arhost_status status = wait_for(frame, info); status != ARHOST_STATUS_OK)
                return status;
        if (frames_ && frame >= frames_)
            return ARHOST_STATUS_END;
        const double unit_mm = sheet_.side_mm / marker_side;
        std::vector<Mt> poses;
        const int count = motion_blur_ > 0 ? 5 : 1;
        poses.reserve(count);
        for (int i = 0; i < count; ++i)
            poses.push_back(pose_at(static_cast<double>(frame) + motion_blur_ * (i - (count - 1) / 2.0) / count, 1));
        const Shot shot{poses, card_at(frame), frame};
        renderer_->render(shot, buffer.plane[0], buffer.format->stride[0]);

        info.clock = ARHOST_CLOCK_MEDIA;
        info.capture_ns = time_ns(frame);
        info.has_truth = 1;
        target_.copy(info.truth_target, ARHOST_MAX_NAME - 1);
        std::ranges::copy(pose_at(static_cast<double>(frame), unit_mm), info.true_mt);
        return ARHOST_STATUS_OK;
    }

    void stop() { renderer_.reset(); }

private:
    Mt pose_at(double frame, double unit_mm) const {
        const double periods = frame / (fps_ * period_s_);
        return pose_on_path(path_, periods - std::floor(periods), distance_scale_, unit_mm);
    }

    // Returns the pose of the card if it is visible. The card covers the marker from frame occlude_from to the frame
    // before occlude_to. It slides in before these frames and slides out after them.
    std::optional<Card> card_at(std::uint64_t sequence) const {
        if (occlude_from_ < 0)
            return {};
        constexpr double slide_frames = 10;
        const auto frame = static_cast<double>(sequence);
        const double away =
            std::max(static_cast<double>(occlude_from_) - frame, frame - static_cast<double>(occlude_to_ - 1)) /
            slide_frames;
        if (away >= 1)
            return {};
        const float moved = away > 0 ? smoothstep(0, 1, static_cast<float>(away)) : 0;
        const float angle = (7 - 25 * moved) * std::numbers::pi_v<float> / 180;
        return Card{{1 + 210 * moved, -1 - 330 * moved}, {std::cos(angle), std::sin(angle)}};
    }

    std::int64_t time_ns(std::uint64_t frame) const { return std::llround(static_cast<double>(frame) * 1e9 / fps_); }

    // Waits until `frame` is due. If it is late by a frame period or more, first advances `frame` to the frame that
    // is due now.
    arhost_status wait_for(std::uint64_t &frame, arhost_frame_info &info) {
        if (!epoch_set_) {
            epoch_ns_ = now_ns() - time_ns(frame);
            epoch_set_ = true;
        }
        const std::int64_t late_ns = now_ns() - epoch_ns_ - time_ns(frame);
        // After a pause of weeks, the number of skipped frames may exceed 32 bits. The next call then skips the rest.
        constexpr double max_skipped = std::numeric_limits<std::uint32_t>::max();
        info.skipped =
            static_cast<std::uint32_t>(std::clamp(static_cast<double>(late_ns) * fps_ / 1e9, 0.0, max_skipped));
        frame += info.skipped;
        const std::chrono::steady_clock::time_point due(std::chrono::nanoseconds(epoch_ns_ + time_ns(frame)));
        return host_.wait_until(due) ? ARHOST_STATUS_OK : ARHOST_STATUS_ERROR_CANCELLED;
    }

    arhost::Host host_;
    std::int64_t width_, height_;
    double period_s_;
    std::uint64_t frames_; // 0: endless
    double fps_, motion_blur_;
    std::int64_t occlude_from_, occlude_to_;
    int threads_;
    PathKind path_;
    MarkerSheet sheet_;
    std::string target_; // the name of the marker in the configuration
    Sensor sensor_;

    arhost_intrinsics camera_{};
    double distance_scale_ = 1;
    std::optional<Renderer> renderer_;

    bool paced_ = false, epoch_set_ = false;
    std::int64_t epoch_ns_ = 0; // CLOCK_MONOTONIC at media time 0
};

using arhost::option;
const arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_TEXT, "family", "tag36h11", "Marker family: an AprilTag family or an OpenCV dictionary.", 0,
           0, marker_families().data()),
    option(ARHOST_OPTION_INTEGER, "id", "0", "Marker id.", 0, 100'000),
    option(ARHOST_OPTION_TEXT, "target", "",
           "Name of the target whose true pose is reported; empty: the marker's default name, FAMILY-ID."),
    option(ARHOST_OPTION_REAL, "side_mm", "80",
           "Outer side of the black square in mm; the whole scene scales with it.", 0.001, 100'000),
    option(ARHOST_OPTION_TEXT, "path", "orbit",
           "Camera path: orbit (once around the sheet), still, or approach (towards the sheet and back).", 0, 0,
           paths),
    option(ARHOST_OPTION_REAL, "period", "10", "Duration of one round of the camera path in s.", 0.01, 100'000),
    option(ARHOST_OPTION_INTEGER, "frames", "150", "Number of frames; 0: endless.", 0, 2'147'483'647),
    option(ARHOST_OPTION_REAL, "fps", "30", "Frames per second, unless the configuration sets a rate.", 0.001, 1000),
    option(ARHOST_OPTION_INTEGER, "width", "1280",
           "Width in px of the default camera, which is used if the configuration names none.", 1,
           ARHOST_MAX_IMAGE_SIDE),
    option(ARHOST_OPTION_INTEGER, "height", "720", "Height in px of the default camera.", 1, ARHOST_MAX_IMAGE_SIDE),
    option(ARHOST_OPTION_REAL, "noise", "1", "Sensor noise; 1: like a small camera indoors, 0: none.", 0, 20),
    option(ARHOST_OPTION_REAL, "blur_px", "0.5", "Lens blur: sigma in px; 0: none.", 0, 20),
    option(ARHOST_OPTION_REAL, "motion_blur", "0",
           "Shutter time as a fraction of the frame period (motion blur). Any value above 0 makes rendering take "
           "five times as "
           "long.",
           0, 1),
    option(ARHOST_OPTION_REAL, "exposure_ev", "0", "Exposure in stops; 1 is twice as bright.", -10, 10),
    option(ARHOST_OPTION_INTEGER, "occlude_from", "-1",
           "First frame in which a postcard covers the marker; -1: never.", -1, 2'147'483'647),
    option(ARHOST_OPTION_INTEGER, "occlude_to", "-1",
           "First frame in which the postcard no longer covers the marker.", -1, 2'147'483'647),
    option(ARHOST_OPTION_INTEGER, "seed", "1", "Seed of the noise.", 0, 2'147'483'647),
    option(ARHOST_OPTION_INTEGER, "threads", "1",
           "Number of rendering threads; 0: one per core. The frames do not depend on it.", 0, 256),
};

const arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SOURCE,
    .id = "org.arhost.source_synthetic",
    .name = "Synthetic marker scene",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "A printed marker on a desk, filmed by a moving camera whose poses are known exactly.",
    .capabilities = ARHOST_SOURCE_CAPABILITY_SEEK,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

} // namespace

ARHOST_SOURCE(SyntheticSource, descriptor)
