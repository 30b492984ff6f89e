// SPDX-License-Identifier: Apache-2.0
//
// Renders what the user wants to see in a thread of its own, so that the window stays responsive.
#pragma once

#include "view/orbit.hpp"
#include "view/ray_tracer.hpp"
#include "view/stage.hpp"

#include <opencv2/core.hpp>

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace arhost::view {

struct Wanted {
    Orbit orbit;
    Lens lens;
    double time_s = 0;
    Selection selection;
    bool shows_normals = false;
    bool operator==(const Wanted &) const = default;
};

// The mean of linear images.
class Average {
public:
    void clear() { sums_.clear(); }
    void add(const ImageView &image, std::uint32_t height);
    int count() const { return sums_.empty() ? 0 : count_; }
    ImageView mean(); // valid until the next call; at least one image must have been added

private:
    ImageView format_;
    int count_ = 0;
    std::vector<float> sums_;
    std::vector<std::uint16_t> mean_;
};

class LiveView {
public:
    // `stage` shows `wanted.selection`. The loader is used only by the thread of the LiveView from now on.
    LiveView(Loader &loader, Stage stage, std::string ray_tracer, OptionSettings options, const Wanted &wanted);
    ~LiveView(); // ends the thread after the image that it renders
    LiveView(const LiveView &) = delete;
    LiveView &operator=(const LiveView &) = delete;

    void want(const Wanted &wanted);
    // Returns a picture (BGR) or message that has not been returned yet.
    std::optional<cv::Mat> take_picture();
    std::optional<std::string> take_message();

private:
    void run();
    cv::Mat render(const Wanted &wanted); // empty: the last picture is better
    void prepare(const Wanted &wanted);

    Loader &loader_;
    std::string name_;
    OptionSettings options_;

    // Used by the thread only.
    Stage stage_;
    Wanted shown_;                            // in the last image
    std::optional<RayTracer> moving_, still_; // the latter while nothing moves
    cv::Mat backdrop_;
    int still_images_ = 0;
    Average average_;
    double last_ms_ = 0;

    std::mutex mutex_; // for the following
    std::condition_variable changed_;
    Wanted wanted_;
    std::optional<cv::Mat> picture_;
    std::optional<std::string> message_;
    bool is_finished_ = false; // nothing improves the last picture
    bool stops_ = false;

    std::thread thread_;
};

} // namespace arhost::view
