// SPDX-License-Identifier: Apache-2.0
#include "calibrate/input.hpp"

#include "base/text.hpp"
#include "base/write_all.hpp"
#include "frames/frame_reader.hpp"

#include <fmt/format.h>
#include <opencv2/highgui.hpp>
#include <opencv2/imgproc.hpp>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace arhost::calibrate {
namespace {

namespace fs = std::filesystem;

constexpr int fewest_pixels = 64; // per side

void check_size(const cv::Size &size, const std::string &name) {
    if (std::min(size.width, size.height) < fewest_pixels)
        throw std::runtime_error(fmt::format("{}: {} x {} px are too few to calibrate with; use images with at least "
                                             "{} px on each side",
                                             name, size.width, size.height, fewest_pixels));
}

// The frames of a video or a camera.
class Frames {
public:
    Frames(const Reading &reading, const frames::Input &input, std::string name)
        : reader_(reading.workers, input, reading.signals), name_(std::move(name)) {}

    // Returns nullopt at the end.
    std::optional<cv::Mat> next() {
        std::optional<cv::Mat> frame = reader_.next();
        if (frame && count_++ == 0) {
            check_size(frame->size(), name_);
            size_ = frame->size();
        }
        return frame;
    }

    std::size_t count() const { return count_; }
    cv::Size size() const { return size_; }

private:
    frames::FrameReader reader_;
    std::string name_;
    cv::Size size_;
    std::size_t count_ = 0;
};

// Counts of frames with each verdict.
class Counts {
public:
    void add(Collector::Verdict verdict) { ++counts_[static_cast<std::size_t>(verdict)]; }
    std::string summary(const std::string &name, std::size_t frames) const {
        using enum Collector::Verdict;
        const auto count = [&](Collector::Verdict verdict) { return counts_[static_cast<std::size_t>(verdict)]; };
        return fmt::format("{}: {}, {} taken; {} without the board, {} in motion, {} blurred, {} without a new "
                           "position or tilt",
                           name, base::count_of(frames, "frame"), base::count_of(count(taken), "view"),
                           base::count_of(count(no_board), "frame"), count(moving), count(blurred), count(similar));
    }

private:
    std::array<std::size_t, 5> counts_{};
};

Collector::Verdict offer(Collector &collector, const Board &board, const cv::Mat &grey, std::size_t number,
                         std::optional<View> &view) {
    view = board.find(grey);
    if (view)
        view->name = fmt::format("frame {}", number);
    return collector.offer(view, view ? edge_width_px(grey, *view) : 0);
}

constexpr const char *window = "arhost calibrate";

// Shows the frame with the corners of the board, the covered cells and the advice. Returns whether the user wants to
// stop.
bool show(const cv::Mat &frame, const std::optional<View> &view, const Collector &collector,
          const std::string &advice) {
    cv::Mat picture;
    cv::cvtColor(frame, picture, cv::COLOR_GRAY2BGR);
    const cv::Mat original = picture.clone();
    for (int row = 0; row < Coverage::rows; ++row)
        for (int column = 0; column < Coverage::columns; ++column)
            if (collector.coverage().is_covered(column, row))
                cv::rectangle(
                    picture, cv::Point(frame.cols * column / Coverage::columns, frame.rows * row / Coverage::rows),
                    cv::Point(frame.cols * (column + 1) / Coverage::columns, frame.rows * (row + 1) / Coverage::rows),
                    {80, 200, 80}, cv::FILLED);
    cv::addWeighted(original, 0.75, picture, 0.25, 0, picture);
    if (view)
        for (const cv::Point2f &corner : view->image_px)
            cv::circle(picture, corner, 4, {0, 0, 255}, 2, cv::LINE_AA);
    const double size = std::max(picture.cols / 1200.0, 0.4);
    const cv::Point at(10, picture.rows - 12);
    cv::putText(picture, advice, at, cv::FONT_HERSHEY_SIMPLEX, size, {0, 0, 0}, 4, cv::LINE_AA);
    cv::putText(picture, advice, at, cv::FONT_HERSHEY_SIMPLEX, size, {255, 255, 255}, 1, cv::LINE_AA);
    cv::imshow(window, picture);
    const int key = cv::waitKey(1);
    return key == 'q' || key == 27;
}

// Returns whether there is a display. If OpenCV's window library cannot open the display that the environment names,
// it aborts the process. Therefore a child process tries to open it first.
bool can_open_window() {
    const auto is_set = [](const char *name) {
        const char *value = std::getenv(name);
        return value && *value;
    };
    if (!is_set("DISPLAY") && !is_set("WAYLAND_DISPLAY"))
        return false;
    const pid_t child = ::fork();
    if (child == 0) {
        const rlimit no_core_file{0, 0};
        ::setrlimit(RLIMIT_CORE, &no_core_file);
        const int null = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
        ::dup2(null, STDOUT_FILENO);
        ::dup2(null, STDERR_FILENO);
        try {
            cv::namedWindow(window);
        } catch (const cv::Exception &) {
            ::_exit(1);
        }
        ::_exit(0);
    }
    int status = -1;
    if (child < 0 || ::waitpid(child, &status, 0) != child || status != 0) {
        std::fputs("warning: the display cannot be opened, so there is no window (--no-window omits it)\n", stderr);
        return false;
    }
    return true;
}

} // namespace

Views views_of_images(const Reading &reading, const std::vector<fs::path> &files, const Board &board) {
    Views found;
    std::vector<cv::Mat> first_images; // in which to search for other boards, which is slow
    for (const fs::path &file : files) {
        frames::FrameReader reader(reading.workers, frames::file_input(file), reading.signals);
        const cv::Mat image = reader.only(file.string());
        check_size(image.size(), file.string());
        if (found.image.empty())
            found.image = image.size();
        if (image.size() != found.image)
            throw std::runtime_error(
                fmt::format("{} has {} x {} px, but {} has {} x {} px; all images must be of one "
                            "camera and size",
                            file.string(), image.cols, image.rows, files.front().string(), found.image.width,
                            found.image.height));
        if (first_images.size() < 3)
            first_images.push_back(image);
        if (std::optional<View> view = board.find(image)) {
            view->name = file.filename();
            found.views.push_back(*view);
        } else {
            found.without_board.push_back(file.filename());
        }
    }
    for (std::size_t i = 0; found.views.empty() && found.seen_instead.empty() && i < first_images.size(); ++i)
        found.seen_instead = board.seen_instead(first_images[i]);
    return found;
}

Views views_of_video(const Reading &reading, const fs::path &file, const Board &board, Model model,
                     std::size_t limit) {
    Frames frames(reading, frames::file_input(file), file.string());
    Counts counts;
    std::optional<Collector> collector;
    cv::Mat middle;
    while (const std::optional<cv::Mat> grey = frames.next()) {
        if (!collector)
            collector.emplace(frames.size(), model, 3 * limit); // the best views are chosen later
        std::optional<View> view;
        counts.add(offer(*collector, board, *grey, frames.count(), view));
        if (frames.count() % 100 == 1 && collector->views().empty())
            middle = grey->clone();
    }
    if (!collector)
        throw std::runtime_error(fmt::format("{}: the video has no frames", file.string()));
    const std::vector<View> &views = collector->views();
    Views found{frames.size(), {}, {}, counts.summary(file.filename().string(), frames.count()), ""};
    for (const std::size_t index : select(views, frames.size(), collector->lens(), limit))
        found.views.push_back(views[index]);
    if (found.views.empty())
        found.seen_instead = board.seen_instead(middle);
    return found;
}

Views views_of_camera(const Reading &reading, const CameraOptions &camera, const Board &board, Model model,
                      std::size_t limit) {
    const bool with_window = camera.with_window && can_open_window();
    Frames frames(reading, frames::camera_input(camera.name, camera.size.width, camera.size.height), camera.name);
    Counts counts;
    std::optional<Collector> collector;
    cv::Mat last;
    std::string last_line;
    const auto next = [&]() -> std::optional<cv::Mat> {
        try {
            return frames.next();
        } catch (const base::Interrupted &interrupted) {
            if (interrupted.signal != SIGINT || !collector)
                throw;
            return std::nullopt;
        }
    };
    for (bool is_stopped = false; !is_stopped;) {
        const std::optional<cv::Mat> grey = next();
        if (!grey)
            break;
        if (!camera.size.empty() && frames.size() != camera.size)
            throw std::runtime_error(
                fmt::format("--size {}x{}: the camera delivers {} x {} px; 'arhost devices' lists "
                            "its sizes",
                            camera.size.width, camera.size.height, frames.size().width, frames.size().height));
        if (!collector)
            collector.emplace(frames.size(), model, limit);
        std::optional<View> view;
        const Collector::Verdict verdict = offer(*collector, board, *grey, frames.count(), view);
        counts.add(verdict);
        const std::string line = base::count_of(collector->views().size(), "view") + ": " + collector->advice();
        if (collector->views().empty())
            grey->copyTo(last);
        if (line != last_line) {
            std::printf("%s\n", line.c_str());
            std::fflush(stdout);
            last_line = line;
        }
        is_stopped = (with_window && show(*grey, view, *collector, line)) || collector->is_full();
        // The calibration may fail or omit views; then more views are needed.
        if (verdict == Collector::Verdict::taken && collector->is_complete()) {
            try {
                const Calibration calibration = calibrate(collector->views(), frames.size(), model);
                is_stopped = is_stopped || Coverage(calibration).missing().empty();
            } catch (const std::runtime_error &) { // the last calibration reports it
            }
        }
    }
    if (with_window)
        cv::destroyAllWindows();
    if (!collector)
        throw std::runtime_error(fmt::format("{}: the camera delivers no images", camera.name));
    Views found{frames.size(), collector->views(), {}, counts.summary(camera.name, frames.count()), ""};
    if (found.views.empty())
        found.seen_instead = board.seen_instead(last);
    return found;
}

} // namespace arhost::calibrate
