// SPDX-License-Identifier: Apache-2.0
#include "calibrate/input.hpp"

#include <arhost/frame.h>

#include <fmt/format.h>
#include <opencv2/highgui.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

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
    if (std::max(size.width, size.height) > ARHOST_MAX_IMAGE_SIDE)
        throw std::runtime_error(fmt::format("{}: {} x {} px; arhost supports at most {} px on each side", name,
                                             size.width, size.height, static_cast<int>(ARHOST_MAX_IMAGE_SIDE)));
}

// Reads an image and turns it as its metadata requests, as source_file does.
cv::Mat read_image(const fs::path &file) {
    std::error_code error;
    if (!fs::exists(file, error))
        throw std::runtime_error(fmt::format("{}: there is no such file", file.string()));
    cv::Mat image;
    try {
        image = cv::imread(file, cv::IMREAD_GRAYSCALE);
    } catch (const cv::Exception &) { // too large for OpenCV
    }
    if (image.empty())
        throw std::runtime_error(
            fmt::format("{}: OpenCV cannot read this file as an image; use PNG or JPEG", file.string()));
    check_size(image.size(), file.string());
    return image;
}

cv::Mat grey_of(const cv::Mat &frame) {
    cv::Mat grey = frame;
    if (frame.channels() == 3)
        cv::cvtColor(frame, grey, cv::COLOR_BGR2GRAY);
    return grey;
}

class Frames {
public:
    Frames(cv::VideoCapture &capture, std::string name) : capture_(capture), name_(std::move(name)) {}

    // Returns false at the end.
    bool next(cv::Mat &frame) {
        if (!capture_.read(frame) || frame.empty())
            return false;
        if (frame.depth() != CV_8U || (frame.channels() != 1 && frame.channels() != 3))
            throw std::runtime_error(name_ + ": its pixel format is not supported; convert it to 8 bits per channel");
        if (count_ == 0) {
            check_size(frame.size(), name_);
            size_ = frame.size();
        } else if (frame.size() != size_) {
            throw std::runtime_error(fmt::format("{}: frame {} has {} x {} px, but the first one has {} x {} px",
                                                 name_, count_ + 1, frame.cols, frame.rows, size_.width,
                                                 size_.height));
        }
        ++count_;
        return true;
    }

    std::size_t count() const { return count_; }
    cv::Size size() const { return size_; }

private:
    cv::VideoCapture &capture_;
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
        return fmt::format("{}: {} frames, {} views taken; {} frames without the board, {} in motion, {} blurred, {} "
                           "without a new position or tilt",
                           name, frames, count(taken), count(no_board), count(moving), count(blurred),
                           count(similar));
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

volatile std::sig_atomic_t is_interrupted = 0;

class Interruptible {
public:
    Interruptible() : previous_(std::signal(SIGINT, [](int) { is_interrupted = 1; })) {}
    ~Interruptible() { std::signal(SIGINT, previous_); }
    Interruptible(const Interruptible &) = delete;
    Interruptible &operator=(const Interruptible &) = delete;

private:
    void (*previous_)(int);
};

constexpr const char *window = "arhost calibrate";

// Shows the frame with the corners of the board, the covered cells and the advice. Returns whether the user wants to
// stop.
bool show(const cv::Mat &frame, const std::optional<View> &view, const Collector &collector,
          const std::string &advice) {
    cv::Mat picture;
    if (frame.channels() == 1)
        cv::cvtColor(frame, picture, cv::COLOR_GRAY2BGR);
    else
        frame.copyTo(picture);
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

Views views_of_images(const std::vector<fs::path> &files, const Board &board) {
    Views found;
    for (const fs::path &file : files) {
        const cv::Mat image = read_image(file);
        if (found.image.empty())
            found.image = image.size();
        if (image.size() != found.image)
            throw std::runtime_error(
                fmt::format("{} has {} x {} px, but {} has {} x {} px; all images must be of one "
                            "camera and size",
                            file.string(), image.cols, image.rows, files.front().string(), found.image.width,
                            found.image.height));
        if (std::optional<View> view = board.find(image)) {
            view->name = file.filename();
            found.views.push_back(*view);
        } else {
            found.without_board.push_back(file.filename());
        }
    }
    constexpr std::size_t enough = 3; // images; the search for other boards is slow
    for (std::size_t i = 0; found.views.empty() && found.seen_instead.empty() && i < std::min(files.size(), enough);
         ++i)
        found.seen_instead = board.seen_instead(read_image(files[i]));
    return found;
}

Views views_of_video(const fs::path &file, const Board &board, Model model, std::size_t limit) {
    std::error_code error;
    if (!fs::exists(file, error))
        throw std::runtime_error(fmt::format("{}: there is no such file", file.string()));
    cv::VideoCapture capture(file.string());
    if (!capture.isOpened())
        throw std::runtime_error(fmt::format(
            "{}: OpenCV cannot read this file as a video; convert it, for example to MP4", file.string()));
    Frames frames(capture, file.string());
    Counts counts;
    std::optional<Collector> collector;
    cv::Mat frame, middle;
    while (frames.next(frame)) {
        const cv::Mat grey = grey_of(frame);
        if (!collector)
            collector.emplace(frames.size(), model, 3 * limit); // the best views are chosen later
        std::optional<View> view;
        counts.add(offer(*collector, board, grey, frames.count(), view));
        if (frames.count() % 100 == 1 && collector->views().empty())
            middle = grey.clone();
    }
    if (!collector)
        throw std::runtime_error(fmt::format("{}: the video has no frame that OpenCV can read", file.string()));
    const std::vector<View> &views = collector->views();
    Views found{frames.size(), {}, {}, counts.summary(file.filename().string(), frames.count()), ""};
    for (const std::size_t index : select(views, frames.size(), collector->lens(), limit))
        found.views.push_back(views[index]);
    if (found.views.empty())
        found.seen_instead = board.seen_instead(middle);
    return found;
}

Views views_of_camera(const CameraOptions &camera, const Board &board, Model model, std::size_t limit) {
    // Before any threads start, because only the calling thread survives a fork.
    const bool with_window = camera.with_window && can_open_window();
    cv::VideoCapture capture(camera.name, camera.name.starts_with("/dev/") ? cv::CAP_V4L2 : cv::CAP_ANY);
    if (!capture.isOpened())
        throw std::runtime_error(fmt::format(
            "{}: the camera cannot be opened; 'arhost devices' lists the cameras and says why", camera.name));
    capture.set(cv::CAP_PROP_BUFFERSIZE, 1); // otherwise the images are several frames old
    if (!camera.size.empty()) {
        capture.set(cv::CAP_PROP_FRAME_WIDTH, camera.size.width);
        capture.set(cv::CAP_PROP_FRAME_HEIGHT, camera.size.height);
    }
    const Interruptible interruptible;
    Frames frames(capture, camera.name);
    Counts counts;
    std::optional<Collector> collector;
    cv::Mat frame, grey;
    std::string last_line;
    for (bool is_stopped = false; !is_stopped && !is_interrupted && frames.next(frame);) {
        if (!camera.size.empty() && frames.size() != camera.size)
            throw std::runtime_error(
                fmt::format("--size {}x{}: the camera delivers {} x {} px; 'arhost devices' lists "
                            "its sizes",
                            camera.size.width, camera.size.height, frames.size().width, frames.size().height));
        grey = grey_of(frame);
        if (!collector)
            collector.emplace(frames.size(), model, limit);
        std::optional<View> view;
        const Collector::Verdict verdict = offer(*collector, board, grey, frames.count(), view);
        counts.add(verdict);
        const std::string line = fmt::format("{} view{}: {}", collector->views().size(),
                                             collector->views().size() == 1 ? "" : "s", collector->advice());
        if (line != last_line) {
            std::printf("%s\n", line.c_str());
            std::fflush(stdout);
            last_line = line;
        }
        is_stopped = (with_window && show(frame, view, *collector, line)) || collector->is_full();
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
        found.seen_instead = board.seen_instead(grey);
    return found;
}

} // namespace arhost::calibrate
