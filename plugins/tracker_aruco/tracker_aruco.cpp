// SPDX-License-Identifier: Apache-2.0
//
// tracker_aruco: detects ArUco markers and AprilTags with OpenCV.
#include <fiducial/aruco.hpp>
#include <fiducial/frame_refinement.hpp>
#include <fiducial/marker_search.hpp>

#include <arhost-cpp/plugin.hpp>

#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace {

namespace aruco = arhost::aruco;
namespace fiducial = arhost::fiducial;
using arhost::Failure;
using arhost::aruco::dictionary_types;
using arhost::aruco::DictionaryType;
using arhost::aruco::Reading;
using arhost::fiducial::Corners;
using arhost::fiducial::Family;
using arhost::fiducial::take;

constexpr const char *refinements[] = {"edges", "none", "subpix", "contour", "apriltag", nullptr};

constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_INPUT_PATH, "dictionary_file", "",
                   "Path of a custom dictionary in OpenCV's YAML format. Targets name it by the file's name without "
                   "extension."),
    arhost::option(
        ARHOST_OPTION_TEXT, "corner_refinement", "edges",
        "Corner refinement: edges (arhost fits lines to the edges), or a method of OpenCV: none, subpix, contour, or "
        "apriltag, which also detects squares in a different way.",
        0, 0, refinements),
    arhost::option(ARHOST_OPTION_INTEGER, "subpix_window_px", "5",
                   "Half the side of the search window of subpix in px; must be smaller than a marker cell.", 1, 50),
    arhost::option(ARHOST_OPTION_INTEGER, "threshold_window_min_px", "3",
                   "Smallest window in px of the adaptive threshold (not with corner_refinement apriltag).", 3, 999),
    arhost::option(ARHOST_OPTION_INTEGER, "threshold_window_max_px", "23",
                   "Largest window in px of the adaptive threshold (not with corner_refinement apriltag).", 3, 999),
    arhost::option(ARHOST_OPTION_INTEGER, "threshold_window_step_px", "10",
                   "Step in px from the smallest to the largest window (not with corner_refinement apriltag).", 1,
                   999),
    arhost::option(
        ARHOST_OPTION_REAL, "min_perimeter_rate", "0.03",
        "Smallest marker perimeter relative to the longer image side (not with corner_refinement apriltag).", 0.001,
        4),
    arhost::option(
        ARHOST_OPTION_REAL, "min_distance_rate", "0.02",
        "Minimum distance between the corners of two candidate squares, as a fraction of their perimeter; of closer "
        "squares only the outer one is decoded. OpenCV's default of 0.05 misses prints with a narrow white margin.",
        0.001, 0.5),
    arhost::option(
        ARHOST_OPTION_REAL, "error_correction_rate", "-1",
        "Maximum number of bit errors to correct, as a fraction of the number that the dictionary can correct. "
        "Negative: 0.6, but at most 0 errors in dictionaries of 4x4 bits, 1 of 5x5 and 3 of 6x6.",
        -1, 1),
    arhost::option(
        ARHOST_OPTION_BOOL, "closer_look", "true",
        "If a target is not found, searches again, smoothed or at twice the resolution, with other thresholds: where "
        "the target is expected, otherwise by turns in the frame or a part of it. Finds more of the noisy, dim, "
        "blurred and small markers of dictionaries with more than 25 bits."),
    arhost::option(ARHOST_OPTION_INTEGER, "border_bits", "1", "Width of the black border in cells.", 1, 8),
    arhost::option(ARHOST_OPTION_BOOL, "inverted", "false", "Also detects white-on-black markers."),
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_TRACKER,
    .id = "org.arhost.tracker_aruco",
    .name = "ArUco tracker",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Detects ArUco markers and AprilTags with OpenCV.",
    .capabilities = 0,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

// Returns whether `root` is a valid dictionary. OpenCV does not check this, and reads past the end of strings that
// are too short.
bool is_dictionary(const cv::FileNode &root) {
    const cv::FileNode count = root["nmarkers"], size = root["markersize"];
    if (!count.isInt() || !size.isInt() || static_cast<int>(count) < 1 || static_cast<int>(size) < 1 ||
        static_cast<int>(size) > 32)
        return false;
    const auto side = static_cast<std::size_t>(static_cast<int>(size));
    for (int i = 0; i < static_cast<int>(count); ++i) {
        const cv::FileNode marker = root["marker_" + std::to_string(i)];
        if (!marker.isString())
            return false;
        const std::string bits = marker.string();
        if (bits.size() != side * side || bits.find_first_not_of("01") != std::string::npos)
            return false;
    }
    return true;
}

cv::aruco::Dictionary read_dictionary(const std::string &file) {
    const auto invalid = [&](const std::string &reason) {
        return Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "dictionary_file: '" + file + "' " + reason);
    };
    if (!std::ifstream(file))
        throw invalid("cannot be read");
    try {
        const cv::FileStorage storage(file, cv::FileStorage::READ);
        cv::aruco::Dictionary dictionary;
        if (storage.isOpened() && is_dictionary(storage.root())) {
            dictionary.readDictionary(storage.root());
            return dictionary;
        }
    } catch (const cv::Exception &) {
        // OpenCV's message does not help the user: it only names a line of OpenCV's source code.
    }
    throw invalid("is not a dictionary: it needs the keys nmarkers, markersize, and marker_0, marker_1, …; each "
                  "marker must be a "
                  "string of markersize² digits 0 or 1");
}

struct Dictionary {
    cv::aruco::Dictionary table;
    bool rotated_180 = false; // relative to AprilTag's own library
};

// The markers of a family, and the parameters of their detection.
struct Detectable {
    Family family;
    Dictionary dictionary;
    cv::aruco::DetectorParameters parameters;
};

// The parameters of a search: the normal look or a closer look. OpenCV's contrast thresholds suit bright pictures
// without noise.
struct Look {
    int scale = 1;
    double sigma_px = 0;                      // standard deviation of a Gaussian blur
    std::optional<double> threshold = {};     // adaptiveThreshConstant, in grey levels
    std::optional<double> min_deviation = {}; // minOtsuStdDev: standard deviation of the grey levels of a marker
    std::array<int, 2> windows_px = {}; // of the adaptive threshold: the smallest and the largest; 0: the options

    bool is_closer() const { return windows_px[0] > 0; }

    cv::Mat prepared(const cv::Mat &grey) const {
        cv::Mat scaled = grey, blurred; // copies, because `grey` is read-only
        if (scale > 1)
            cv::resize(grey, scaled, {}, scale, scale, cv::INTER_CUBIC);
        if (sigma_px == 0)
            return scaled;
        cv::GaussianBlur(scaled, blurred, {}, sigma_px);
        return blurred;
    }
};
// Each window takes a third of the time of a normal search. The small one of `enlarged` suits small and strongly
// tilted markers, the large one blurred markers. A lower threshold lets the noise of uniform surfaces through, whose
// outlines take longer than all else.
constexpr Look smoothed{1, 1, 2, 1, {23, 23}}, enlarged{2, 0, 5, 1, {13, 45}};

// Of the frame, that `enlarged` searches at expected places. If all contours of a picture are there, that takes as
// long as a normal search of the frame.
constexpr double max_part = 1 / 16.0;

// The budget of refinement. OpenCV takes about 10 ns for each pixel, refinement with all of the budget about as long.
constexpr double work_per_px = 0.12, work_of_closer_look_per_px = 0.08;

class ArucoTracker {
public:
    ArucoTracker(const arhost::Host &host, const arhost::Options &options) : host_(host) {
        if (const std::string file = options.text("dictionary_file"); !file.empty()) {
            file_table_ = read_dictionary(file);
            file_name_ = fiducial::april_tag_name(std::filesystem::path(file).stem().string());
        }
        const std::string refinement = options.text("corner_refinement");
        refine_edges_ = refinement == "edges";
        parameters_.cornerRefinementMethod = refinement == "subpix"     ? cv::aruco::CORNER_REFINE_SUBPIX
                                             : refinement == "contour"  ? cv::aruco::CORNER_REFINE_CONTOUR
                                             : refinement == "apriltag" ? cv::aruco::CORNER_REFINE_APRILTAG
                                                                        : cv::aruco::CORNER_REFINE_NONE;
        set(options);
        if (refinement == "apriltag")
            centre_shift_px_ = 0.5;
    }

    static constexpr const char *changeable[] = {"subpix_window_px",
                                                 "threshold_window_min_px",
                                                 "threshold_window_max_px",
                                                 "threshold_window_step_px",
                                                 "min_perimeter_rate",
                                                 "min_distance_rate",
                                                 "error_correction_rate",
                                                 "closer_look",
                                                 "border_bits",
                                                 "inverted",
                                                 nullptr};
    // Sets the options that `changed` contains.
    void set(const arhost::Options &changed) {
        cv::aruco::DetectorParameters parameters = parameters_;
        take(changed, "subpix_window_px", parameters.cornerRefinementWinSize);
        take(changed, "threshold_window_min_px", parameters.adaptiveThreshWinSizeMin);
        take(changed, "threshold_window_max_px", parameters.adaptiveThreshWinSizeMax);
        take(changed, "threshold_window_step_px", parameters.adaptiveThreshWinSizeStep);
        take(changed, "min_perimeter_rate", parameters.minMarkerPerimeterRate);
        take(changed, "min_distance_rate", parameters.minMarkerDistanceRate);
        double rate = correction_rate_;
        take(changed, "error_correction_rate", rate);
        take(changed, "border_bits", parameters.markerBorderBits);
        take(changed, "closer_look", looks_closer_);
        take(changed, "inverted", parameters.detectInvertedMarker);
        if (parameters.adaptiveThreshWinSizeMax < parameters.adaptiveThreshWinSizeMin)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "threshold_window_max_px: must not be less than threshold_window_min_px");
        parameters_ = parameters;
        correction_rate_ = rate;
        make_parameters();
    }

    void start(const arhost_tracker_setup &setup) {
        stop();
        for (Family &family : fiducial::families_of(
                 setup, [&](const std::string &name) { return dictionary_of(name).table.bytesList.rows; })) {
            Dictionary dictionary = dictionary_of(family.name);
            detectables_.push_back({std::move(family), std::move(dictionary), {}});
        }
        make_parameters();
        const auto traits_of = [&](const std::string &name) {
            const cv::aruco::Dictionary table = dictionary_of(name).table;
            return fiducial::FamilyTraits{1.0 / cells_of(table), table.markerSize * table.markerSize};
        };
        search_.emplace(host_, setup, traits_of, [families = predefined_families()](const cv::Mat &grey) {
            return fiducial::markers_of_other_families(grey, families);
        });
    }

    void track(const arhost_track_request &request, arhost::Observations &observations) {
        const cv::Mat grey = fiducial::grey_of(*request.frame);
        fiducial::FrameRefinement refinement(grey, request.frame->format->transfer, search_->lens(), work_per_px);
        const fiducial::SearchRegions &regions = search_->regions();
        const auto verification = [&](fiducial::FrameRefinement *by) {
            return [&, by](const arhost_expected_marker &expected, std::int32_t id, std::uint32_t family) {
                return verify_one(grey, expected, id, family, by);
            };
        };
        if (looks_closer_ && refine_edges_ && request.expected_count > 0 &&
            regions.needs_closer_look(request, regions.verified_markers(request, verification(nullptr))))
            refinement.reserve(work_of_closer_look_per_px);
        const fiducial::Verify verify = verification(&refinement);
        const auto verified = refine_edges_ ? regions.verified(request, verify) : fiducial::Verified();
        std::vector<fiducial::Pass> passes;
        for (const Detectable &detectable : detectables_) {
            const auto detection = [&](const Look &look) {
                return [&, look](const cv::Rect &region, auto &seen) {
                    observe(request, grey, region, look, detectable, verified, refinement, seen);
                };
            };
            fiducial::Pass &pass = passes.emplace_back(fiducial::Pass{&detectable.family, detection({})});
            if (looks_closer_)
                pass.closer_looks = {{detection(smoothed)}, {detection(enlarged), max_part}};
        }
        search_->track(request, observations, {}, passes, verified);
    }

    void stop() {
        if (search_)
            search_->finish();
        search_.reset();
        detectables_.clear();
    }

private:
    // Adds the markers of a dictionary in a region of the frame to `seen`, except the verified ones.
    void observe(const arhost_track_request &request, const cv::Mat &grey, const cv::Rect &region, const Look &look,
                 const Detectable &detectable, const fiducial::Verified &verified,
                 fiducial::FrameRefinement &refinement, fiducial::Seen &seen) const {
        const cv::aruco::Dictionary &table = detectable.dictionary.table;
        cv::aruco::DetectorParameters parameters = detectable.parameters;
        parameters.adaptiveThreshConstant = look.threshold.value_or(parameters.adaptiveThreshConstant);
        parameters.minOtsuStdDev = look.min_deviation.value_or(parameters.minOtsuStdDev);
        if (look.is_closer()) {
            parameters.adaptiveThreshWinSizeMin = look.windows_px[0];
            parameters.adaptiveThreshWinSizeMax = look.windows_px[1];
            parameters.adaptiveThreshWinSizeStep = std::max(look.windows_px[1] - look.windows_px[0], 1);
        }
        // OpenCV divides the perimeter by the longer side of the image that it receives.
        parameters.minMarkerPerimeterRate *=
            static_cast<double>(std::max(grey.cols, grey.rows)) / std::max(region.width, region.height);
        const cv::Mat pixels = look.prepared(grey(region));
        const aruco::DetectedMarkers found = aruco::detect(pixels, table, parameters);
        seen.candidates += found.ids.size() + found.rejected.size();
        const std::span<const arhost_observation> known = fiducial::markers_of(verified);
        const cv::Point2d half(0.5, 0.5), shift = half - cv::Point2d(centre_shift_px_, centre_shift_px_),
                                          origin = cv::Point2d(region.tl()) - half;
        struct Marker {
            int id;
            bool is_listed;
            fiducial::MeasuredCorners corners;
        };
        std::vector<Marker> markers; // those that are listed begin
        std::vector<fiducial::RoughMarker> rough;
        std::vector<arhost_observation> listed(known.begin(), known.end());
        for (const bool is_listed : {true, false})
            for (std::size_t i = 0; i < found.ids.size(); ++i) {
                Marker marker{found.ids[i], detectable.family.lists(found.ids[i]), {}};
                if (marker.is_listed != is_listed)
                    continue;
                for (std::size_t corner = 0; corner < 4; ++corner) {
                    const cv::Point2d at =
                        found.corners[i][detectable.dictionary.rotated_180 ? (corner + 2) % 4 : corner];
                    marker.corners.corners_px[corner] = (at + shift) / look.scale + origin;
                }
                const arhost_observation seen_roughly = detectable.family.observation(marker.id, marker.corners);
                const auto is_same = [&](const arhost_observation &one) {
                    return fiducial::are_of_one_print(one, seen_roughly);
                };
                if (is_listed)
                    listed.push_back(seen_roughly);
                if (is_listed && (std::ranges::any_of(known, is_same) ||
                                  (seen.wants && !seen.wants(marker.id, seen_roughly.family))))
                    continue;
                if (refine_edges_ && is_listed)
                    rough.push_back(rough_marker(detectable.dictionary, marker.id, marker.corners.corners_px));
                markers.push_back(marker);
            }
        if (looks_closer_ && !look.is_closer() && request.search_everywhere &&
            search_->regions().needs_closer_look(request, listed, &detectable.family))
            refinement.reserve(work_of_closer_look_per_px);
        const auto refined = refinement.refine(rough);
        std::vector<std::optional<arhost_observation>> observations(markers.size());
        const auto observe_one = [&](std::size_t i) {
            fiducial::MeasuredCorners &corners = markers[i].corners;
            if (i < refined.size())
                corners = refined[i].value_or(corners);
            Corners in_pixels;
            for (std::size_t corner = 0; corner < 4; ++corner)
                in_pixels[corner] = (corners.corners_px[corner] - origin) * look.scale - half;
            const Reading reading =
                aruco::read(pixels, in_pixels, table, markers[i].id, parameters.markerBorderBits, false);
            // An unlisted marker with wrong bits or with a high false-positive rate may be clutter.
            if (markers[i].is_listed || (reading.wrong_bits == 0 && reading.false_positive_rate < 1))
                observations[i] = detectable.family.observation(markers[i].id, corners, decoding_of(reading));
        };
        cv::parallel_for_({0, static_cast<int>(markers.size())}, [&](const cv::Range &range) {
            for (int i = range.start; i < range.end; ++i)
                observe_one(static_cast<std::size_t>(i));
        });
        for (const std::optional<arhost_observation> &one : observations)
            if (one)
                seen.markers.push_back(*one);
    }

    // Reads an expected marker at its expected place, without detection, and refines its corners if `refinement` is
    // set. Returns std::nullopt if this fails.
    std::optional<arhost_observation> verify_one(const cv::Mat &grey, const arhost_expected_marker &expected,
                                                 std::int32_t id, std::uint32_t family,
                                                 fiducial::FrameRefinement *refinement) const {
        const auto found =
            std::ranges::find_if(detectables_, [&](const Detectable &one) { return one.family.lists(id, family); });
        if (found == detectables_.end())
            return std::nullopt;
        Corners corners;
        for (int i = 0; i < 4; ++i)
            corners[i] = {expected.corners_px[i][0], expected.corners_px[i][1]};
        // A correct reading also proves that the errors of the corners are below half a cell.
        const auto is_there = [](const Reading &reading) {
            return reading.wrong_bits == 0 && reading.has_whole_border && reading.false_positive_rate < 1;
        };
        const cv::Rect2d frame(0, 0, grey.cols, grey.rows); // does not contain NaN
        if (!std::ranges::all_of(corners, [&](const cv::Point2d &corner) { return frame.contains(corner); }) ||
            !is_there(read_upright(grey, corners, found->dictionary, id)))
            return std::nullopt;
        if (!refinement)
            return found->family.observation(id, {corners});
        const std::array rough = {rough_marker(found->dictionary, id, corners)};
        const auto measured = refinement->refine(rough).front();
        if (!measured)
            return std::nullopt;
        const Reading reading = read_upright(grey, measured->corners_px, found->dictionary, id);
        return is_there(reading) ? std::optional(found->family.observation(id, *measured, decoding_of(reading)))
                                 : std::nullopt;
    }

    // `corners_px`: the corners in the order in which the tracker reports them.
    Reading read_upright(const cv::Mat &grey, Corners corners_px, const Dictionary &dictionary, int id) const {
        if (dictionary.rotated_180)
            std::rotate(corners_px.begin(), corners_px.begin() + 2, corners_px.end());
        return aruco::read(grey, corners_px, dictionary.table, id, parameters_.markerBorderBits, true);
    }

    static fiducial::Decoding decoding_of(const Reading &reading) {
        return {reading.wrong_bits, reading.contrast, reading.false_positive_rate};
    }

    // The dictionary must outlive the result.
    fiducial::RoughMarker rough_marker(const Dictionary &dictionary, int id, const Corners &corners_px) const {
        return {corners_px, cells_of(dictionary.table), [this, &dictionary, id] { return print_of(dictionary, id); }};
    }

    fiducial::Print print_of(const Dictionary &dictionary, int id) const {
        fiducial::Print print = aruco::print_of(dictionary.table, id, parameters_.markerBorderBits);
        if (dictionary.rotated_180)
            cv::rotate(print.cells, print.cells, cv::ROTATE_180);
        return print;
    }

    // Returns the side of a marker's square in cells.
    int cells_of(const cv::aruco::Dictionary &table) const {
        return table.markerSize + 2 * parameters_.markerBorderBits;
    }

    static Dictionary predefined(const DictionaryType &type) {
        Dictionary dictionary{aruco::predefined(type.name), type.is_april_tag()};
        if (type.is_april_tag())
            dictionary.table.maxCorrectionBits = type.april_tag_bits;
        return dictionary;
    }

    Dictionary dictionary_of(const std::string &name) const {
        if (!file_name_.empty() && name == file_name_)
            return {file_table_};
        std::string names;
        for (const DictionaryType &type : dictionary_types) {
            if (name == type.family)
                return predefined(type);
            names += std::string(names.empty() ? "" : ", ") + type.family;
        }
        fiducial::reject_prints_without_ids(name, "tracker_aruco");
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "unknown dictionary '" + name + "': tracker_aruco has " +
                          (file_name_.empty() ? "" : file_name_ + " (dictionary_file), ") + names +
                          (name.starts_with("tag")
                               ? "; tracker_apriltag has more families of AprilTag"
                               : "; 'dictionary_file' loads others, also those of newer versions of OpenCV"));
    }

    std::vector<Family> predefined_families() const {
        std::vector<Family> families;
        for (const Detectable &detectable : detectables_)
            if (detectable.family.name != file_name_)
                families.push_back(detectable.family);
        return families;
    }

    void make_parameters() {
        for (Detectable &detectable : detectables_) {
            detectable.parameters = parameters_;
            detectable.parameters.errorCorrectionRate =
                correction_rate_ < 0 ? aruco::default_correction_rate(detectable.dictionary.table) : correction_rate_;
        }
    }

    arhost::Host host_;
    cv::aruco::Dictionary file_table_;
    std::string file_name_; // the name of the file from which file_table_ was read; empty: none
    bool refine_edges_ = false, looks_closer_ = true;
    cv::aruco::DetectorParameters parameters_;
    double correction_rate_ = -1;
    double centre_shift_px_ = 0; // needed for CORNER_REFINE_APRILTAG, whose pixel centres are at +0.5

    std::optional<fiducial::MarkerSearch> search_;
    std::vector<Detectable> detectables_;
};

} // namespace

ARHOST_TRACKER(ArucoTracker, descriptor)
