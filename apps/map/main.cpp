// SPDX-License-Identifier: Apache-2.0
//
// arhost-map learns maps of markers from images (docs/maps.md). `arhost map` runs it, because the host itself links
// neither OpenCV nor Ceres.
#include "base/atomic_file.hpp"
#include "base/program.hpp"
#include "base/text.hpp"
#include "base/unique_fd.hpp"
#include "base/write_all.hpp"
#include "camera/calibration.hpp"
#include "command_line/command_line.hpp"
#include "detector.hpp"
#include "frames/frame_reader.hpp"
#include "map_file.hpp"

#include <fmt/format.h>
#include <opencv2/core/utils/logger.hpp>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <limits>
#include <numbers>
#include <unistd.h>

namespace {

using namespace arhost::map;
namespace base = arhost::base;
namespace camera = arhost::camera;
namespace fs = std::filesystem;
using arhost::marker::Family;

enum ExitStatus { success = 0, failed = 2 };

struct Arguments {
    std::vector<std::string> images, sides;
    std::string video, camera, family, ids, layout, output;
    std::optional<int> origin;
    unsigned every = 1;
    bool plane = false, skip_unconnected = false;
};

std::optional<double> length_in(std::string_view text) {
    double mm = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), mm);
    if (error != std::errc() || end != text.data() + text.size() || !(mm >= 1 && mm <= 10'000))
        return {};
    return mm;
}

// The sides of markers in mm, from --side and --layout.
class Sides {
public:
    Sides(const Arguments &arguments, const Family &family, const std::vector<Marker> &layout) {
        for (const Marker &marker : layout)
            by_id_[marker.id] = marker.side_mm;
        for (const std::string &text : arguments.sides) {
            const std::size_t equals = text.find('=');
            const auto mm = length_in(std::string_view(text).substr(equals == std::string::npos ? 0 : equals + 1));
            if (!mm)
                throw std::runtime_error("--side " + text +
                                         ": write a length from 1 to 10000 mm, or IDS=MM as in 7=40");
            if (equals == std::string::npos)
                default_mm_ = mm;
            else
                for (const int id : arhost::marker::parse_ids(text.substr(0, equals), family))
                    by_id_[id] = *mm;
        }
        if (!default_mm_ && by_id_.empty())
            throw std::runtime_error("--side is missing: the side of the markers in mm, as trackers measure it");
    }
    std::optional<double> operator[](int id) const {
        const auto found = by_id_.find(id);
        return found == by_id_.end() ? default_mm_ : found->second;
    }

private:
    std::map<int, double> by_id_;
    std::optional<double> default_mm_;
};

struct Picture {
    std::string name;
    cv::Mat grey;
};

// Reads images or a video.
class Input {
public:
    Input(const Arguments &arguments, int signals) : arguments_(arguments), signals_(signals) {
        if (!arguments.video.empty())
            open(arguments.video);
    }
    // The picture is valid until the next call.
    std::optional<Picture> next() {
        if (arguments_.video.empty()) {
            if (at_ == arguments_.images.size())
                return {};
            const std::string &name = arguments_.images[at_++];
            open(name);
            return Picture{name, reader_->only(name)};
        }
        std::optional<cv::Mat> grey;
        for (unsigned skipped = at_ == 0 ? 1 : arguments_.every; skipped > 0; --skipped, ++at_)
            if (grey = reader_->next(); !grey)
                return {};
        return Picture{fmt::format("frame {}", at_ - 1), *grey};
    }

private:
    void open(const std::string &file) { reader_.emplace(workers_, arhost::frames::file_input(file), signals_); }

    const Arguments &arguments_;
    int signals_;
    arhost::plugin_tools::Workers workers_;
    std::optional<arhost::frames::FrameReader> reader_;
    std::size_t at_ = 0;
};

class Progress {
public:
    explicit Progress(int signals) : signals_(signals) {}
    ~Progress() { clear(); }
    Progress(const Progress &) = delete;
    Progress &operator=(const Progress &) = delete;

    // Shows a line on a terminal. Throws base::Interrupted after a signal.
    void show(const std::string &text) {
        if (const int signal = base::take_signal(signals_))
            throw base::Interrupted(signal, "interrupted");
        if (!is_terminal_ || text.empty())
            return;
        std::fprintf(stderr, "\r%s\033[K", base::printable(text, 100).c_str());
        is_shown_ = true;
    }
    void clear() {
        if (is_shown_)
            std::fputs("\r\033[K", stderr);
        is_shown_ = false;
    }

private:
    int signals_;
    bool is_terminal_ = ::isatty(STDERR_FILENO) == 1, is_shown_ = false;
};

void warn(const std::string &text) {
    std::fprintf(stderr, "warning: %s\n", base::printable(text).c_str());
}

struct Observations {
    arhost_intrinsics camera;
    std::vector<Frame> frames;
    std::map<int, double> sides_mm; // sides of the markers that were seen
    std::set<int> unseen;           // markers of --ids that were not seen
};

Observations observe(const Arguments &arguments, const Family &family, const Sides &sides, int signals,
                     Progress &progress) {
    std::set<int> ids;
    if (!arguments.ids.empty())
        for (const int id : arhost::marker::parse_ids(arguments.ids, family))
            ids.insert(id);
    Input input(arguments, signals);
    Observations result{};
    std::vector<cv::Mat> first_pictures;
    Detector detect;
    while (const auto picture = input.next()) {
        const camera::Size size{static_cast<std::uint32_t>(picture->grey.cols),
                                static_cast<std::uint32_t>(picture->grey.rows)};
        if (!detect) {
            result.camera = camera::read_calibration(arguments.camera, size);
            if (const std::string doubt = camera::doubt_about_focal_length(result.camera); !doubt.empty())
                warn(arguments.camera + ": " + doubt);
            detect = detector_of(family, ids, result.camera);
        } else if (size != camera::Size{result.camera.width, result.camera.height}) {
            throw std::runtime_error(fmt::format("{}: is {}×{} px, but the images before it are {}×{} px",
                                                 picture->name, size.width, size.height, result.camera.width,
                                                 result.camera.height));
        }
        if (first_pictures.size() < 3)
            first_pictures.push_back(picture->grey.clone());
        Frame &frame = result.frames.emplace_back(Frame{picture->name, detect(picture->grey)});
        for (const Detection &detection : frame.detections) {
            const auto side = sides[detection.id];
            if (!side)
                throw std::runtime_error(
                    fmt::format("{}: shows marker {}, whose side is unknown; add --side {}=MM, or "
                                "list the markers of the map with --ids",
                                picture->name, detection.id, detection.id));
            result.sides_mm[detection.id] = *side;
        }
        progress.show(fmt::format("{} read, {} seen", base::count_of(result.frames.size(), "frame"),
                                  base::count_of(result.sides_mm.size(), "marker")));
    }
    if (result.frames.empty())
        throw std::runtime_error(arguments.video + ": has no frames");
    if (result.sides_mm.empty()) {
        const std::string other =
            seen_instead(first_pictures, result.camera, [&] { progress.show("searching for other families"); });
        progress.clear();
        throw std::runtime_error(fmt::format("none of the {} markers to find was seen in {}{}", family.name,
                                             base::count_of(result.frames.size(), "frame"),
                                             other.empty() ? "" : "; the first ones show " + other));
    }
    std::ranges::copy_if(ids, std::inserter(result.unseen, result.unseen.end()),
                         [&](int id) { return !result.sides_mm.contains(id); });
    return result;
}

// Returns a list such as "0-3, 7".
std::string ranges_of(const std::set<int> &ids) {
    std::string text;
    for (auto first = ids.begin(); first != ids.end();) {
        auto last = first, next = std::next(first);
        for (; next != ids.end() && *next == *last + 1; ++next)
            last = next;
        text += fmt::format("{}{}", text.empty() ? "" : ", ", *first);
        if (last != first)
            text += fmt::format("-{}", *last);
        first = next;
    }
    return text;
}

std::string table_of(const Map &map) {
    std::string text = fmt::format("{:>6} {:>8} {:>7} {:>8} {:>8} {:>9}\n", "id", "side mm", "frames", "RMS px",
                                   "± mm", "± degrees");
    for (const LearnedMarker &marker : map.markers) {
        text += fmt::format("{:>6} {:>8} {:>7} {:>8.3f}", marker.id, marker.side_mm, marker.views, marker.rms_px);
        text += marker.id == map.origin ? fmt::format(" {:>8} {:>9}\n", "fixed", "fixed")
                                        : fmt::format(" {:>8.3f} {:>9.3f}\n", marker.position_sigma_mm,
                                                      marker.rotation_sigma_rad * 180 / std::numbers::pi);
    }
    return text;
}

void warn_about(const Map &map) {
    for (const LearnedMarker &marker : map.markers) {
        if (marker.misfits >= 3 && 5 * marker.misfits > marker.views + marker.misfits)
            warn(fmt::format(
                "marker {} is elsewhere in {} of the {} frames that show it: it was moved, its side is wrong, or "
                "there are two of it; the map has the place where most frames show it",
                marker.id, marker.misfits, marker.views + marker.misfits));
        if (marker.is_ambiguous)
            warn(fmt::format("marker {}: the images permit two tilts; add images of it from nearer or from other "
                             "directions",
                             marker.id));
    }
    for (const std::string &name : map.misfits)
        warn(name + ": most of its markers do not fit to the other frames; they were ignored");
}

void run(const Arguments &arguments, int signals) {
    if (arguments.images.empty() == arguments.video.empty())
        throw std::runtime_error("give either --images or --video");
    if (fs::path(arguments.output).extension() != ".yaml")
        throw std::runtime_error(arguments.output + ": the file's name must end in .yaml, such as desk.map.yaml");
    if (arguments.plane && !arguments.layout.empty())
        throw std::runtime_error("--plane and --layout exclude each other: the layout gives the map's frame");
    for (const std::string &input : {arguments.camera, arguments.layout})
        if (std::error_code ignored; fs::equivalent(input, arguments.output, ignored))
            throw std::runtime_error(arguments.output + ": --output would overwrite an input");
    const Family family = arhost::marker::find_family(arguments.family);
    Settings settings;
    if (!arguments.layout.empty())
        settings.layout = read_map(arguments.layout, family);
    const Sides sides(arguments, family, settings.layout);
    base::AtomicFile output(arguments.output, signals);
    Progress progress(signals);
    const Observations seen = observe(arguments, family, sides, signals, progress);
    settings.sides_mm = seen.sides_mm;
    settings.origin = arguments.origin;
    settings.is_plane = arguments.plane;
    settings.progress = [&](const std::string &text) { progress.show(text); };
    const Map map = learn(seen.frames, seen.camera, settings);
    progress.clear();
    std::string refused;
    for (const Refusal &refusal : map.refused)
        refused += fmt::format("{}marker {} {}", refused.empty() ? "" : "; ", refusal.id, refusal.reason);
    if (!seen.unseen.empty())
        refused += fmt::format("{}not seen: {}", refused.empty() ? "" : "; ", ranges_of(seen.unseen));
    if (map.markers.size() < 2)
        throw std::runtime_error("a map needs at least two markers in the same frames" +
                                 (refused.empty() ? "" : ": " + refused));
    if (!refused.empty() && !arguments.skip_unconnected)
        throw std::runtime_error(refused + " (--skip-unconnected leaves such markers out)");
    if (!refused.empty())
        warn("left out: " + refused);
    warn_about(map);
    const std::string summary = fmt::format("{} markers from {} of {} frames; RMS reprojection error {:.3f} px",
                                            map.markers.size(), map.frames, seen.frames.size(), map.rms_px);
    const std::string frame =
        !arguments.layout.empty() && !arguments.origin ? "as in the layout"
        : arguments.plane ? fmt::format("z = 0 is the best plane, x as on marker {}", map.origin)
                          : fmt::format("that of marker {}: origin at its centre, x right, y up on the print, z "
                                        "out of the paper",
                                        map.origin);
    output.write(map_text(map.markers, family, fmt::format("# {}\n# Frame: {}.\n", summary, frame)));
    std::printf("%s: %s\n%s", base::printable(arguments.output).c_str(), summary.c_str(), table_of(map).c_str());
}

} // namespace

int main(int argc, char **argv) {
    arhost::base::prepare_process();
    arhost::command_line::CommandLine app(
        "Learns where markers are relative to each other, from images of a calibrated camera, and "
        "writes a map. See docs/maps.md.\n"
        "Exit status: 0 success; 2 failure, without any output file.",
        "arhost map");
    Arguments arguments;
    app.option("--images", arguments.images, "Images from different directions; each shows two markers or more")
        .type_name("FILE");
    app.option("--video", arguments.video, "A video instead of images").type_name("FILE");
    app.option("--every", arguments.every, "Use every Nth frame of the video")
        .type_name("N")
        .range(1, 10'000)
        .show_default();
    app.option("--camera", arguments.camera, "Calibration of the camera, as for the key camera.file")
        .type_name("FILE")
        .required();
    app.option("--family,--dictionary", arguments.family,
               "Family or dictionary of the markers; 'arhost marker --help' lists them")
        .type_name("NAME")
        .required();
    app.option("--side", arguments.sides,
               "Side of the markers, as trackers measure it; also IDS=MM for some of them (repeatable)")
        .type_name("MM")
        .one_value_each();
    app.option("--ids", arguments.ids,
               "The markers of the map, all of which must be seen, such as 0-19,25 (default: all that are seen)")
        .type_name("IDS");
    app.option("--origin", arguments.origin, "The map's frame is that of this marker (default: the smallest id)")
        .type_name("ID")
        .range(0, std::numeric_limits<int>::max());
    app.flag("--plane", arguments.plane, "Turn the map's frame so that z = 0 is the plane of the markers");
    app.option("--layout", arguments.layout, "Begin with the places in this map, and keep its frame and its sides")
        .type_name("FILE");
    app.flag("--skip-unconnected", arguments.skip_unconnected,
             "Leave out markers that were not seen, too rarely, or not together with the others");
    app.option("-o,--output", arguments.output, "The map to write, such as desk.map.yaml")
        .type_name("FILE")
        .required();
    if (const auto status = app.parse(argc, argv))
        return base::flush_stdout() ? *status : failed;
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT); // the messages below name the file
    try {
        run(arguments, base::watch_signals().get());
        return base::flush_stdout() ? success : failed;
    } catch (const base::Interrupted &interrupted) {
        base::end_by_signal(interrupted.signal);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "error: %s\n", base::printable(error.what()).c_str());
        return failed;
    }
}
