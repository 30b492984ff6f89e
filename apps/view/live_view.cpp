// SPDX-License-Identifier: Apache-2.0
#include "view/live_view.hpp"

#include "view/interruption.hpp"
#include "view/picture.hpp"

#include <arhost-cpp/linear_pixel.hpp>

#include <chrono>
#include <utility>

namespace arhost::view {
namespace {

// The denoiser knows 32 images at most. An average of fewer images has more noise than a denoised one.
constexpr int denoised_images = 24, least_averaged_images = 32, most_averaged_images = 512;
constexpr double slow_ms = 50; // shade fewer pixels while something moves

} // namespace

LiveView::LiveView(Loader &loader, Stage stage, std::string ray_tracer, OptionSettings options, const Wanted &wanted)
    : loader_(loader), name_(std::move(ray_tracer)), options_(std::move(options)), stage_(std::move(stage)),
      shown_(wanted), wanted_(wanted), thread_([this] { run(); }) {}

LiveView::~LiveView() {
    {
        const std::lock_guard lock(mutex_);
        stops_ = true;
    }
    changed_.notify_one();
    thread_.join();
}

void LiveView::want(const Wanted &wanted) {
    {
        const std::lock_guard lock(mutex_);
        if (wanted == wanted_)
            return;
        wanted_ = wanted;
        is_finished_ = false;
    }
    changed_.notify_one();
}

std::optional<cv::Mat> LiveView::take_picture() {
    const std::lock_guard lock(mutex_);
    return std::exchange(picture_, std::nullopt);
}

std::optional<std::string> LiveView::take_message() {
    const std::lock_guard lock(mutex_);
    return std::exchange(message_, std::nullopt);
}

void LiveView::run() {
    std::unique_lock lock(mutex_);
    for (;;) {
        changed_.wait(lock, [this] { return stops_ || !is_finished_; });
        if (stops_ || interruption != 0)
            return;
        const Wanted wanted = wanted_;
        lock.unlock();
        std::string problem;
        cv::Mat picture;
        try {
            picture = render(wanted);
        } catch (const base::Interrupted &) { // the window closes
        } catch (const std::exception &error) {
            problem = error.what();
        }
        lock.lock();
        if (!picture.empty())
            picture_ = picture;
        if (!problem.empty())
            message_ = problem;
        if (wanted == wanted_)
            is_finished_ = !problem.empty() || average_.count() >= most_averaged_images ||
                           (still_images_ > denoised_images && average_.count() == 0);
    }
}

// Makes the ray tracer fit what is wanted.
void LiveView::prepare(const Wanted &wanted) {
    const bool is_other_selection = !(wanted.selection == shown_.selection);
    const bool is_other_image = !(wanted.lens == shown_.lens) || wanted.shows_normals != shown_.shows_normals;
    still_images_ = wanted == shown_ ? still_images_ + 1 : 0;
    shown_ = wanted; // also if an exception follows, so that the next image does not try it again
    if (is_other_selection || is_other_image) {
        moving_.reset();
        still_.reset();
    }
    if (is_other_selection)
        stage_ = stage_of(loader_.load(wanted.selection), loader_.is_model());
    if (!moving_) {
        const arhost_intrinsics intrinsics = wanted.orbit.camera(wanted.lens).intrinsics;
        backdrop_ = backdrop(Backdrop::grey, static_cast<int>(intrinsics.width), static_cast<int>(intrinsics.height));
        if (wanted.shows_normals) // without those of the ground
            moving_.emplace(name_, options_, Quality::normals, stage_.content.scene(), intrinsics, true);
        else
            moving_.emplace(name_, options_, Quality::moving, stage_.scene(), intrinsics);
    }
}

cv::Mat LiveView::render(const Wanted &wanted) {
    prepare(wanted);
    const arhost_camera camera = wanted.orbit.camera(wanted.lens);
    if (still_images_ <= denoised_images || wanted.shows_normals) {
        average_.clear();
        const auto start = std::chrono::steady_clock::now();
        const ImageView &image = moving_->render(camera, wanted.time_s, still_images_ == 0 && last_ms_ > slow_ms);
        if (still_images_ > 0)
            last_ms_ = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
        return composited(image, backdrop_);
    }
    const bool is_path = stage_.scene().integrator == ARHOST_INTEGRATOR_PATH;
    if (!still_)
        still_.emplace(name_, options_, is_path ? Quality::converging : Quality::still, stage_.scene(),
                       camera.intrinsics);
    const ImageView &image = still_->render(camera, wanted.time_s);
    if (!image.format.is_linear()) // without noise
        return composited(image, backdrop_);
    average_.add(image, wanted.lens.height);
    return average_.count() >= least_averaged_images && average_.count() % 8 == 0
               ? composited(average_.mean(), backdrop_)
               : cv::Mat();
}

void Average::add(const ImageView &image, std::uint32_t height) {
    const std::size_t row = image.stride / sizeof(std::uint16_t);
    if (sums_.empty()) {
        format_ = image;
        count_ = 0;
        sums_.resize(row * height);
        mean_.resize(sums_.size());
    }
    const auto *values = reinterpret_cast<const std::uint16_t *>(image.pixels);
    for (std::size_t i = 0; i < sums_.size(); ++i)
        sums_[i] += float_of(values[i]);
    ++count_;
}

ImageView Average::mean() {
    for (std::size_t i = 0; i < sums_.size(); ++i)
        mean_[i] = half_of(sums_[i] / static_cast<float>(count_));
    format_.pixels = reinterpret_cast<const std::uint8_t *>(mean_.data());
    return format_;
}

} // namespace arhost::view
