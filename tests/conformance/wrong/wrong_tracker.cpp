// SPDX-License-Identifier: Apache-2.0
// All wrong trackers: tracker_apriltag with a defect that this library's file name selects. For example, a link
// tracker_metres.so reports metres instead of millimetres. Other names select no defect.
#include "defect.hpp"

#include <arhost/arhost.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <vector>

namespace {

using namespace arhost::test;

// ---- The modified tracker ---------------------------------------------------------------------------

const arhost_plugin &real() {
    static const arhost_plugin &plugin = open_plugin(ARHOST_PLUGIN_DIRECTORY "/tracker_apriltag.so");
    return plugin;
}
const arhost_tracker &real_functions() {
    return *static_cast<const arhost_tracker *>(real().functions);
}

// Shared by all instances.
bool was_started = false;
arhost_intrinsics first_camera{};

struct Wrong {
    arhost_instance *real = nullptr;
    const arhost_host *host = nullptr;
    bool start_failed = false;
    arhost_frame_format format{};
    std::vector<arhost_marker_config> listed;
    std::int64_t threads = 0; // the option
    std::unique_ptr<arhost_tracker_result> last = std::make_unique<arhost_tracker_result>();
    std::uint64_t last_sequence = 0;
    std::int64_t last_capture_ns = 0;
    unsigned tracks = 0;
    std::vector<std::uint8_t> copy; // of the grey plane
};
Wrong &wrong(arhost_instance *instance) {
    return *reinterpret_cast<Wrong *>(instance);
}

// ---- Modified input ----------------------------------------------------------------------------------

arhost_intrinsics modify(arhost_intrinsics in) {
    if (has("pixel_centres_at_half")) {
        in.cx += 0.5;
        in.cy += 0.5;
    }
    if (has("focal_1_percent"))
        in.fx *= 1.01, in.fy *= 1.01;
    if (has("fx_as_fy"))
        in.fy = in.fx;
    if (has("centred_principal_point")) {
        in.cx = (in.width - 1) / 2.0;
        in.cy = (in.height - 1) / 2.0;
    }
    if (has("no_lens") || (has("ignores_fisheye") && in.distortion == ARHOST_DISTORTION_FISHEYE)) {
        in.distortion = ARHOST_DISTORTION_NONE;
        in.coefficient_count = 0;
    }
    if (has("tangential_swapped") && in.distortion == ARHOST_DISTORTION_BROWN)
        std::swap(in.coefficients[2], in.coefficients[3]);
    if (has("four_coefficients"))
        in.coefficient_count = std::min(in.coefficient_count, 4u);
    return in;
}

std::vector<arhost_marker_config> listed_in(const arhost_tracker_setup &setup) {
    std::vector<arhost_marker_config> all;
    const std::size_t step = has("ignores_struct_size") ? sizeof(arhost_marker_config) : setup.markers->struct_size;
    for (std::uint32_t i = 0; i < setup.marker_count; ++i) {
        const auto *bytes = reinterpret_cast<const std::byte *>(setup.markers) + i * step;
        all.push_back(*reinterpret_cast<const arhost_marker_config *>(bytes));
        all.back().struct_size = sizeof(arhost_marker_config);
    }
    if (has("side_as_half_side"))
        for (arhost_marker_config &marker : all)
            marker.side_mm *= 2;
    if (has("one_side_for_all_markers"))
        for (arhost_marker_config &marker : all)
            marker.side_mm = all[0].side_mm;
    if (has("reports_unlisted_markers"))
        for (const int id : {31, 7, 586, 2})
            if (std::ranges::find(all, id, &arhost_marker_config::id) == all.end())
                all.push_back({sizeof(arhost_marker_config), id, 80});
    if (has("sorted_by_id"))
        std::ranges::sort(all, {}, &arhost_marker_config::id);
    return all;
}

// A writable copy of the frame's grey plane.
std::uint8_t *copied(Wrong &self, arhost_frame &frame) {
    const std::size_t size = std::size_t{frame.format->grey_stride} * frame.format->height;
    self.copy.assign(frame.grey, frame.grey + size);
    frame.grey = self.copy.data();
    return self.copy.data();
}

void mirror(Wrong &self, arhost_frame &frame) {
    std::uint8_t *row = copied(self, frame);
    for (std::uint32_t y = 0; y < frame.format->height; ++y, row += frame.format->grey_stride)
        std::reverse(row, row + frame.format->width);
}

// ---- Properties of the frame -------------------------------------------------------------------------

struct Pixels {
    explicit Pixels(const arhost_frame &f) : frame(f) {}
    template <class Function> void each_row(Function &&function) const {
        for (std::uint32_t y = 0; y < frame.format->height; ++y)
            function(std::span(frame.grey + std::size_t{frame.format->grey_stride} * y, frame.format->width));
    }
    int max_code() const {
        int max = 0;
        each_row([&](auto row) { max = std::max<int>(max, *std::ranges::max_element(row)); });
        return max;
    }
    int max_step() const { // difference between pixels two apart
        int max = 0;
        each_row([&](auto row) {
            for (std::size_t x = 2; x < row.size(); ++x)
                max = std::max(max, std::abs(row[x] - row[x - 2]));
        });
        return max;
    }
    bool is_noisy() const { // from the first row, which shows no print
        const std::span row(frame.grey, frame.format->width);
        std::size_t steps = 0;
        for (std::size_t x = 1; x < row.size(); ++x)
            steps += std::abs(row[x] - row[x - 1]) > 8;
        return steps > row.size() / 5;
    }
    const arhost_frame &frame;
};

// ---- Modified output ---------------------------------------------------------------------------------

double longest_side_px(const arhost_marker &marker) {
    double max = 0;
    for (int k = 0; k < 4; ++k)
        max = std::max(max, std::hypot(marker.corners_px[k][0] - marker.corners_px[(k + 1) % 4][0],
                                       marker.corners_px[k][1] - marker.corners_px[(k + 1) % 4][1]));
    return max;
}

void modify(Wrong &self, arhost_marker &marker, const arhost_marker_config &config) {
    double *m = marker.mt;
    const double cosine_of_tilt = m[10];
    const auto negate_rows = [&](std::initializer_list<int> rows) {
        for (int row : rows)
            for (int column = 0; column < 4; ++column)
                m[4 * column + row] *= -1;
    };
    const auto move_along = [&](double x, double y) { // the marker's axes
        for (int row = 0; row < 3; ++row)
            m[12 + row] += m[row] * x + m[4 + row] * y;
    };
    if (has("flipped_z"))
        negate_rows({2});
    if (has("opencv_axes"))
        negate_rows({1, 2});
    if (has("z_into_the_paper"))
        for (int i : {4, 5, 6, 8, 9, 10})
            m[i] *= -1;
    if (has("transposed_rotation"))
        std::swap(m[1], m[4]), std::swap(m[2], m[8]), std::swap(m[6], m[9]);
    if (has("row_major"))
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < i; ++j)
                std::swap(m[4 * i + j], m[4 * j + i]);
    if (has("metres"))
        std::for_each_n(m + 12, 3, [](double &x) { x /= 1000; });
    if (has("origin_at_corner"))
        move_along(-config.side_mm / 2, -config.side_mm / 2);
    if (has("single_precision"))
        std::for_each_n(m, 12, [](double &x) { x = static_cast<float>(x); });
    if (has("nan_pose"))
        m[12] = std::numeric_limits<double>::quiet_NaN();
    if (has("nan_alternative"))
        marker.mt_alternative[5] = std::numeric_limits<double>::quiet_NaN();
    if (has("no_struct_size"))
        marker.struct_size = 0;
    if (has("unterminated_family"))
        std::memset(marker.family, 'x', sizeof marker.family);
    if (has("age_counts_frames"))
        marker.age_frames = self.tracks + 1;
    if (has("corners_from_bottom_left"))
        std::rotate(&marker.corners_px[0][0], &marker.corners_px[3][0], &marker.corners_px[3][0] + 2);
    if (has("corners_at_half"))
        for (auto &corner : marker.corners_px)
            corner[0] += 0.5, corner[1] += 0.5;
    if (has("rounded_corners"))
        for (auto &corner : marker.corners_px)
            corner[0] = std::round(corner[0]), corner[1] = std::round(corner[1]);
    const bool has_other = marker.mt_alternative[15] != 0;
    if (has_other && has("flips_near_frontal") && cosine_of_tilt > std::cos(0.25))
        std::copy_n(marker.mt_alternative, 16, m);
    if (has_other && has("flips_to_the_side") && cosine_of_tilt < std::cos(0.6))
        std::copy_n(marker.mt_alternative, 16, m);
    if (has("nondeterministic"))
        m[12] += 1e-9 * (self.tracks % 2);
    if (has("depends_on_threads"))
        m[12] += 1e-9 * static_cast<double>(self.threads);
}

void modify_all(Wrong &self, const arhost_frame &frame, arhost_tracker_result &result) {
    const std::span markers(result.markers, result.marker_count);
    const auto drop_all = [&] {
        std::memset(result.markers, 0, sizeof result.markers);
        result.marker_count = 0;
    };
    for (arhost_marker &marker : markers)
        modify(self, marker, *std::ranges::find(self.listed, marker.id, &arhost_marker_config::id));
    if (has("swapped_ids") && markers.size() > 1)
        std::swap(markers[0].id, markers[1].id);
    if (has("finds_only_large_markers") && !markers.empty() && longest_side_px(markers[0]) < 60)
        drop_all();
    if (has("finds_nothing_when_tilted") && !markers.empty() && markers[0].mt[10] < std::cos(0.9))
        drop_all();
    const Pixels pixels(frame);
    if ((has("needs_sharp_edges") && pixels.max_step() < 90 && pixels.max_code() > 200) ||
        (has("needs_clean_frames") && pixels.is_noisy() && pixels.max_code() > 200) ||
        (has("needs_good_light") && (pixels.max_code() < 100 || pixels.max_code() > 250)))
        drop_all();
    if (has("invents_markers") && markers.empty()) {
        const double distance = 300;
        arhost_marker &marker = result.markers[result.marker_count++];
        marker = {};
        marker.struct_size = sizeof marker;
        marker.id = self.listed[0].id;
        std::strcpy(marker.family, "tag36h11");
        marker.state = ARHOST_MARKER_DETECTED;
        marker.mt[0] = marker.mt[5] = marker.mt[10] = marker.mt[15] = 1;
        marker.mt[14] = -distance;
    }
    const bool has_last = self.last->marker_count > 0;
    const bool predicts =
        has("predicts") || has("lost_age_is_1") || has("lost_without_pose") || has("remembers_in_its_heap");
    if ((has("smooths") || predicts) && !markers.empty() && has_last) {
        for (int i = 12; i < 15; ++i)
            markers[0].mt[i] = (markers[0].mt[i] + self.last->markers[0].mt[i]) / 2;
        if (predicts)
            markers[0].state = ARHOST_MARKER_PREDICTED;
    }
    if (predicts && markers.empty() && has_last) {
        result = *self.last;
        arhost_marker &lost = result.markers[0];
        lost.age_frames = has("lost_age_is_1") ? 1 : lost.age_frames + 1;
        lost.state = lost.age_frames > 5 ? ARHOST_MARKER_LOST : ARHOST_MARKER_PREDICTED;
        if (has("lost_without_pose") && lost.state == ARHOST_MARKER_LOST)
            std::fill_n(lost.mt, 12, 0.0);
    }
    if (has("never_updates_pose") && !markers.empty()) {
        if (!has_last)
            *self.last = result;
        std::copy_n(self.last->markers[0].mt, 16, markers[0].mt);
        markers[0].state = ARHOST_MARKER_PREDICTED;
        return;
    }
    const arhost_tracker_result now = result;
    if ((has("stale_pose") || (has("reports_lost_as_detected") && result.marker_count == 0)) && has_last)
        result = *self.last;
    if (has("ignores_repeated_frames") && frame.sequence == self.last_sequence && self.tracks > 0)
        drop_all();
    *self.last = now;
}

// ---- The plugin --------------------------------------------------------------------------------------

arhost_status create(const arhost_host *host, const arhost_option *options, std::uint32_t count,
                     arhost_instance **instance) {
    auto created = std::make_unique<Wrong>();
    created->host = host;
    created->threads = arhost_find_option(options, count, "threads")->integer;
    std::vector<arhost_option> modified;
    for (const auto &declared : std::span(real().descriptor->options, real().descriptor->option_count)) {
        modified.push_back(*arhost_find_option(options, count, declared.key));
        modified.back().struct_size = sizeof(arhost_option);
        if (declared.key == std::string_view("corner_refinement") && has("uses_occluder_edges"))
            modified.back().text = "none";
        if (declared.key == std::string_view("quad_decimate") && has("uses_occluder_edges"))
            modified.back().real = 1.5;
    }
    const arhost_status status = real().create(host, modified.data(), count, &created->real);
    if (status == ARHOST_STATUS_OK)
        *instance = reinterpret_cast<arhost_instance *>(created.release());
    return status;
}

void destroy(arhost_instance *instance) {
    if (wrong(instance).start_failed && has("crash_after_a_failed_start"))
        crash();
    real().destroy(wrong(instance).real);
    delete &wrong(instance);
}

arhost_status start(arhost_instance *instance, const arhost_tracker_setup *setup) {
    Wrong &self = wrong(instance);
    if (has("crash_in_start"))
        crash();
    if (has("leaves_a_thread"))
        std::thread(hang).detach();
    const bool again = std::exchange(was_started, true);
    if (has("cannot_restart") && again)
        return ARHOST_STATUS_ERROR_INTERNAL;
    if (!again)
        first_camera = *setup->intrinsics;
    self.format = *setup->format;
    self.tracks = 0;
    self.last->marker_count = 0;
    arhost_intrinsics camera = modify(has("keeps_the_first_camera") ? first_camera : *setup->intrinsics);
    arhost_tracker_setup modified = *setup;
    modified.intrinsics = &camera;
    const auto real_start = [&] {
        modified.markers = self.listed.data();
        modified.marker_count = static_cast<std::uint32_t>(self.listed.size());
        return real_functions().start(self.real, &modified);
    };
    self.listed = listed_in(*setup);
    arhost_status status = real_start();
    if (has("accepts_any_id") && status == ARHOST_STATUS_ERROR_CONFIGURATION && self.listed[0].id != 31) {
        self.listed[0].id = 31;
        status = real_start();
    }
    if (has("accepts_any_lens") && status == ARHOST_STATUS_ERROR_CONFIGURATION && self.listed[0].id == 31) {
        camera = first_camera;
        camera.distortion = ARHOST_DISTORTION_NONE;
        camera.fx = camera.fy = 300;
        status = real_start();
    }
    self.start_failed = status != ARHOST_STATUS_OK;
    return status;
}

bool has_state() {
    return has("predicts") || has("lost_age_is_1") || has("lost_without_pose") || has("never_updates_pose") ||
           has("reads_state_after");
}
std::uint64_t state_size(arhost_instance *) {
    return has_state() ? sizeof(arhost_tracker_result) : 0;
}

arhost_status track(arhost_instance *instance, const arhost_track_request *input, arhost_tracker_result *result) {
    Wrong &self = wrong(instance);
    arhost_frame frame = *input->frame;
    arhost_track_request request = *input;
    request.frame = &frame;
    request.state_before = request.state_after = nullptr; // the real tracker has no state
    request.state_size = 0;
    if (has("crash_in_track") ||
        (has("crash_on_small_frames") && std::min(frame.format->width, frame.format->height) < 8))
        crash();
    if (has("hang_in_track"))
        hang();
    if (has("crash_on_dropped_frames") && self.tracks > 0 && frame.sequence > self.last_sequence + 1)
        crash();
    if (has("writes_the_frame"))
        const_cast<std::uint8_t *>(frame.grey)[0] = 0;
    const volatile std::uint8_t *grey = frame.grey;
    if (has("reads_past_the_frame"))
        (void)grey[std::size_t{frame.format->grey_stride} * frame.format->height];
    if (has("reads_before_the_frame"))
        (void)grey[-1];
    if (has("writes_past_the_result"))
        *reinterpret_cast<std::uint8_t *>(result + 1) = 0;
    if (has("slow"))
        std::this_thread::sleep_for(std::chrono::milliseconds(frame.format->width >= 640 ? 60 : 0));
    if (has("leaks_descriptors"))
        (void)::dup(0);
    if (has("leaks_memory"))
        leak_memory(4096);
    if (has("cancelled_is_internal") && self.host->cancelled(self.host))
        return ARHOST_STATUS_ERROR_INTERNAL;
    if (has("rejects_older_frames") && self.tracks > 0 && frame.capture_ns < self.last_capture_ns)
        return ARHOST_STATUS_ERROR_INVALID_ARGUMENT;
    if (has("finds_nothing"))
        return ARHOST_STATUS_OK;

    arhost_frame_format format = *frame.format;
    frame.format = &format;
    if (has("ignores_the_stride"))
        format.grey_stride = format.width;
    if (has("first_plane_is_grey")) {
        frame.grey = frame.plane[0];
        format.grey_stride = format.stride[0];
    }
    arhost_status status = real_functions().track(self.real, &request, result);
    if (status == ARHOST_STATUS_OK && has("finds_mirrored_prints") && result->marker_count == 0) {
        mirror(self, frame);
        status = real_functions().track(self.real, &request, result);
    }
    if (status == ARHOST_STATUS_OK && has("one_record_per_detection") && result->marker_count == 1) {
        const arhost_marker first = result->markers[0];
        std::uint8_t *copy = copied(self, frame);
        const auto [left, right] = std::ranges::minmax(
            {first.corners_px[0][0], first.corners_px[1][0], first.corners_px[2][0], first.corners_px[3][0]});
        for (std::uint32_t y = 0; y < format.height; ++y)
            std::memset(copy + std::size_t{format.grey_stride} * y + std::lround(left), 140,
                        static_cast<std::size_t>(std::lround(right - left)));
        std::memset(result->markers, 0, sizeof result->markers);
        status = real_functions().track(self.real, &request, result);
        result->markers[result->marker_count++] = first;
    }
    if (status != ARHOST_STATUS_OK)
        return status;
    if (has_state() && input->state_before)
        std::memcpy(self.last.get(), input->state_before, sizeof *self.last);
    else if (has_state())
        *self.last = {};
    modify_all(self, frame, *result);
    if (has("reads_state_after") && result->marker_count > 0)
        result->markers[0].mt[12] += 1e-9 * *static_cast<const std::uint8_t *>(input->state_after);
    if (has_state())
        std::memcpy(input->state_after, self.last.get(), sizeof *self.last);
    ++self.tracks;
    self.last_sequence = frame.sequence;
    self.last_capture_ns = frame.capture_ns;
    return has("status_0") ? 0 : status;
}

void stop(arhost_instance *instance) {
    if (has("crash_in_stop"))
        crash();
    real_functions().stop(wrong(instance).real);
}

const void *get_extension(const char *) {
    return nullptr;
}

const arhost_plugin &wrong_plugin() {
    static const arhost_tracker functions = {sizeof functions, start, has("no_track") ? nullptr : track, stop,
                                             state_size};
    static arhost_descriptor descriptor = *real().descriptor;
    descriptor.id = library_name().c_str();
    static constexpr arhost_plugin plugin = {sizeof plugin, &descriptor, &functions, create, destroy, get_extension};
    return plugin;
}

arhost_status negotiate(const arhost_offer *offer, arhost_answer *answer) {
    if (offer->struct_size < sizeof *offer || answer->struct_size < sizeof *answer)
        return ARHOST_STATUS_ERROR_INVALID_ARGUMENT;
    if (offer->oldest_abi_version > ARHOST_ABI_VERSION)
        return ARHOST_STATUS_ERROR_UNSUPPORTED;
    answer->abi_version = ARHOST_ABI_VERSION;
    answer->plugin = &wrong_plugin();
    return ARHOST_STATUS_OK;
}

} // namespace

extern "C" {
extern ARHOST_EXPORT const arhost_entry_point arhost_entry = {sizeof arhost_entry, negotiate};
}
