// SPDX-License-Identifier: Apache-2.0
//
// false-positives [--quick] [--only REGEX]: shows pictures without markers to the trackers, with all of their
// families or those whose name matches, and counts what they take for markers: sightings in a frame, and poses that
// the worker reports.
#include "solving_tracker.hpp"

#include "command_line/command_line.hpp"

#include <fiducial/artoolkit.hpp>
#include <fiducial/aruco.hpp>
#include <fiducial/clutter.hpp>

#include <opencv2/imgcodecs.hpp>

#include <cmath>
#include <cstdio>
#include <deque>
#include <filesystem>
#include <future>
#include <regex>

namespace {

using namespace arhost;
using test::Listed;

const cv::Size size(480, 360);
constexpr double side_mm = 80;
constexpr std::int64_t frame_ns = 33'333'333;

struct Counts {
    int frames = 0, sightings = 0, poses = 0, frames_with_poses = 0;
};
using CountsByFamily = std::map<std::string, Counts>;

// The largest mean of a Poisson distribution that gives at most `count` events with a probability of 5 %.
double upper_bound(int count) {
    double low = 0, high = 2 * count + 10;
    for (int step = 0; step < 60; ++step) {
        const double mean = (low + high) / 2;
        double probability = 0, term = std::exp(-mean);
        for (int k = 0; k <= count; ++k) {
            probability += term;
            term *= mean / (k + 1);
        }
        (probability > 0.05 ? low : high) = mean;
    }
    return high;
}

// One tracker and the families that it searches together.
struct Setup {
    std::string plugin;
    std::vector<Listed> listed;
};

// `only`: the names of families.
std::vector<Setup> setups(const std::regex &only) {
    const auto of = [](const std::string &plugin, const std::vector<std::pair<std::string, int>> &families) {
        Setup setup{plugin, {}};
        for (const auto &[family, count] : families)
            for (const Listed &one : bench::first_markers(count, side_mm, family))
                setup.listed.push_back(one);
        return setup;
    };
    std::vector<Setup> all{
        of("tracker_apriltag", {{"tag36h11", 587}, {"tag25h9", 35}, {"tag16h5", 30}, {"tagCircle21h7", 38}}),
        of("tracker_apriltag", {{"tag36h10", 600},
                                {"tagCircle49h12", 100},
                                {"tagCustom48h12", 100},
                                {"tagStandard41h12", 100},
                                {"tagStandard52h13", 100}}),
        of("tracker_aruco", {{"DICT_4X4_50", 50},
                             {"DICT_5X5_50", 50},
                             {"DICT_6X6_50", 50},
                             {"DICT_7X7_50", 50},
                             {"tag36h11", 587},
                             {"tag25h9", 35},
                             {"tag16h5", 30}}),
        of("tracker_aruco", {{"DICT_4X4_100", 100},
                             {"DICT_5X5_100", 100},
                             {"DICT_6X6_100", 100},
                             {"DICT_7X7_100", 100},
                             {"tag36h10", 600}}),
        of("tracker_aruco",
           {{"DICT_4X4_250", 250}, {"DICT_5X5_250", 250}, {"DICT_6X6_250", 250}, {"DICT_7X7_250", 250}})};
    for (const char *family :
         {"DICT_4X4_1000", "DICT_5X5_1000", "DICT_6X6_1000", "DICT_7X7_1000", "DICT_ARUCO_ORIGINAL"})
        all.push_back(of("tracker_aruco", {{family, 1000}}));
    for (const fiducial::MatrixFamily &family : fiducial::matrix_families())
        all.push_back(of("tracker_pattern", {{family.name, std::min(family.id_count, 1000)}}));
    for (Setup &setup : all)
        std::erase_if(setup.listed, [&](const Listed &one) { return !std::regex_search(one.family, only); });
    std::erase_if(all, [](const Setup &setup) { return setup.listed.empty(); });
    return all;
}

// Whether framed cells are a marker of one of the families with up to 6×6 bits that the trackers search.
bool is_marker(const cv::Mat_<std::uint8_t> &white) {
    static const std::vector<cv::aruco::Dictionary> dictionaries = [] {
        std::vector<cv::aruco::Dictionary> all;
        for (const aruco::DictionaryType &type : aruco::dictionary_types)
            all.push_back(aruco::predefined(type.name));
        return all;
    }();
    int id = 0, rotation = 0;
    return std::ranges::any_of(dictionaries, [&](const cv::aruco::Dictionary &dictionary) {
        return dictionary.markerSize == white.rows && dictionary.identify(white, id, rotation, 0);
    });
}

cv::Mat frame_of_clutter(cv::Size frame_size, int seed) {
    return test::clutter(frame_size, static_cast<std::uint64_t>(seed), is_marker);
}

// Shows frames of the same size to a tracker, one after the other.
class Watch {
public:
    Watch(const Setup &setup, cv::Size frame_size, CountsByFamily &counts)
        : tracker_(setup.plugin,
                   test::intrinsics_of(frame_size, frame_size.width, frame_size.width, 0.5 * (frame_size.width - 1),
                                       0.5 * (frame_size.height - 1)),
                   setup.listed),
          setup_(setup), counts_(counts) {
        for (const Listed &one : setup.listed)
            if (std::ranges::find(families_, one.family) == families_.end())
                families_.push_back(one.family);
    }

    void show(const cv::Mat &picture, const std::string &shown_family = "") {
        tracker_.track(test::GreyFrame(picture, ARHOST_TRANSFER_SRGB, sequence_++), capture_ns_ += frame_ns);
        std::map<std::string, int> poses;
        for (std::size_t i = 0; i < setup_.listed.size(); ++i) {
            const arhost_target &target = tracker_.targets()[i];
            poses[setup_.listed[i].family] += target.state == ARHOST_TARGET_DETECTED;
        }
        for (const std::string &family : families_) {
            if (family == shown_family)
                continue;
            Counts &counts = counts_[setup_.plugin + " " + family];
            ++counts.frames;
            counts.poses += poses[family];
            counts.frames_with_poses += poses[family] > 0;
        }
        for (const arhost_observation &seen : tracker_.seen()) {
            const std::string &family = families_.at(seen.family);
            if (family != shown_family && std::ranges::any_of(setup_.listed, [&](const Listed &one) {
                    return one.family == family && one.id == seen.id;
                }))
                ++counts_[setup_.plugin + " " + family].sightings;
        }
    }

private:
    bench::SolvingTracker tracker_;
    const Setup &setup_;
    CountsByFamily &counts_;
    std::vector<std::string> families_;
    std::int64_t capture_ns_ = 0;
    std::uint64_t sequence_ = 0;
};

// Pictures that have nothing in common.
void show_pictures(const std::vector<Setup> &setups, int first, int last, CountsByFamily &counts) {
    std::deque<Watch> watches;
    for (const Setup &setup : setups)
        watches.emplace_back(setup, size, counts);
    for (int i = first; i < last; ++i) {
        const cv::Mat picture = frame_of_clutter(size, i + 1000);
        for (Watch &watch : watches)
            watch.show(picture);
    }
}

constexpr int scene_frames = 50;

// A video of scenes, across each of which the camera pans by `step_px` per frame.
void show_video(const std::vector<Setup> &setups, double step_px, int first, int last, CountsByFamily &counts) {
    std::deque<Watch> watches;
    for (const Setup &setup : setups)
        watches.emplace_back(setup, size, counts);
    for (int i = first; i < last; ++i) {
        const double margin_px = step_px * scene_frames;
        cv::RNG random(static_cast<std::uint64_t>(i) + 1);
        const cv::Size wide(size.width + static_cast<int>(margin_px) + 1, size.height);
        const cv::Mat scene = frame_of_clutter(wide, i / scene_frames + 100'000);
        const double x = step_px * (i % scene_frames);
        cv::Mat picture, noise(size, CV_16S);
        cv::getRectSubPix(
            scene, size,
            cv::Point2f(static_cast<float>(x + 0.5 * (size.width - 1)), 0.5F * static_cast<float>(size.height - 1)),
            picture);
        random.fill(noise, cv::RNG::NORMAL, 0, 2);
        cv::add(picture, noise, picture, cv::noArray(), CV_8U);
        for (Watch &watch : watches)
            watch.show(picture);
    }
}

// Frames of a real camera that show only markers of tag36h11.
int show_real(const std::vector<Setup> &setups, CountsByFamily &counts) {
    const std::filesystem::path folder = test::shared_data("markers/rbt_sequence");
    std::vector<cv::Mat> pictures;
    for (int i = 0; i < 40; ++i)
        if (const cv::Mat picture =
                cv::imread((folder / cv::format("color_image_%04d.png", i)).string(), cv::IMREAD_GRAYSCALE);
            !picture.empty())
            pictures.push_back(picture);
    for (const Setup &setup : setups) {
        if (pictures.empty())
            break;
        Watch watch(setup, pictures.front().size(), counts);
        for (const cv::Mat &picture : pictures)
            watch.show(picture, "tag36h11");
    }
    return static_cast<int>(pictures.size());
}

void print(const char *frames, const CountsByFamily &counts) {
    std::printf("%s\n%-38s %8s %10s %8s %22s\n", frames, "tracker, family", "frames", "sightings", "poses",
                "bound per 10,000");
    for (const auto &[name, count] : counts)
        std::printf("%-38s %8d %10d %8d %22.1f\n", name.c_str(), count.frames, count.sightings, count.poses,
                    1e4 * upper_bound(count.frames_with_poses) / count.frames);
}

// Divides the frames among two threads.
template <class Show> CountsByFamily in_parallel(int count, int unit, const Show &show) {
    const int half = count / unit / 2 * unit;
    CountsByFamily first, second;
    auto other = std::async(std::launch::async, [&] { show(0, half, first); });
    show(half, count, second);
    other.get();
    for (const auto &[name, counts] : second) {
        first[name].frames += counts.frames;
        first[name].sightings += counts.sightings;
        first[name].poses += counts.poses;
        first[name].frames_with_poses += counts.frames_with_poses;
    }
    return first;
}

} // namespace

int main(int argc, char **argv) try {
    bool is_quick = false;
    std::string only = ".*";
    arhost::command_line::CommandLine line(
        "Counts sightings and poses in pictures without markers; takes over an hour.");
    line.flag("--quick", is_quick, "Measure with fewer frames; the figures are less precise");
    line.option("--only", only, "Regular expression for the names of families (default: all)");
    if (const auto status = line.parse(argc, argv))
        return *status;
    const int pictures = is_quick ? 200 : 6000, video_frames = is_quick ? 400 : 4000;
    cv::setNumThreads(1);
    const std::vector<Setup> all = setups(std::regex(only));
    const CountsByFamily in_pictures = in_parallel(
        pictures, 1, [&](int first, int last, CountsByFamily &counts) { show_pictures(all, first, last, counts); });
    print("independent pictures of generated clutter", in_pictures);
    std::fflush(stdout);
    const auto video = [&](double step_px, int frames) {
        return in_parallel(frames, scene_frames, [&](int first, int last, CountsByFamily &counts) {
            show_video(all, step_px, first, last, counts);
        });
    };
    const CountsByFamily in_video = video(2.3, video_frames);
    print("video of generated clutter, panned", in_video);
    std::fflush(stdout);
    print("video of generated clutter, camera at rest (no target: the same squares again and again)",
          video(0, video_frames / 4));
    CountsByFamily in_real;
    if (show_real(all, in_real) == 0)
        std::printf("skipped: the real frames are not in shared/data/markers/rbt_sequence\n");
    else
        print("real frames (rbt_sequence)", in_real);
    std::printf("columns: markers seen in a frame; poses reported after confirmation; upper bound (95 %%) of the "
                "frames with a pose, per 10,000. Target: no pose\n");
    const auto has_poses = [](const CountsByFamily &counts) {
        return std::ranges::any_of(counts, [](const auto &one) { return one.second.poses > 0; });
    };
    return has_poses(in_pictures) || has_poses(in_video) || has_poses(in_real) ? 1 : 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "false-positives: %s\n", error.what());
    return 1;
}
