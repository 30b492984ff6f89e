// SPDX-License-Identifier: Apache-2.0
// All wrong trackers: tracker_apriltag with a defect that this library's file name selects. For example, a link
// tracker_corners_at_half.so reports corners with pixel centres at ½. Other names select no defect.
#include "defect.hpp"

#include <arhost-cpp/plugin.hpp>
#include <arhost/shading/lens.hpp>
#include <directories.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

namespace {

using namespace arhost::test;

// ---- The modified tracker ---------------------------------------------------------------------------

const arhost_plugin &real() {
    static const arhost_plugin &plugin = open_plugin(arhost::test::plugin_directory() + "/tracker_apriltag.so");
    return plugin;
}
const arhost_tracker &real_functions() {
    return *static_cast<const arhost_tracker *>(real().functions);
}

// Shared by all instances.
bool was_started = false;
std::vector<std::int32_t> first_ids; // of the markers of the first start

// A tracker's observations, as its state.
struct Seen {
    std::uint32_t count = 0;
    arhost_observation observations[ARHOST_MAX_OBSERVATIONS];
};

struct Wrong {
    arhost_instance *real = nullptr;
    const arhost_host *host = nullptr;
    bool start_failed = false;
    arhost_intrinsics camera{};
    std::uint32_t target_count = 0, family_count = 0;
    std::vector<arhost_marker_config> listed;
    std::int64_t threads = 0; // the option
    std::unique_ptr<Seen> last = std::make_unique<Seen>();
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
    if (has("no_lens") || (has("ignores_fisheye") && in.distortion == ARHOST_DISTORTION_FISHEYE)) {
        in.distortion = ARHOST_DISTORTION_NONE;
        in.coefficient_count = 0;
    }
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
    return all;
}

bool is_listed(const Wrong &self, std::int32_t id) {
    return std::ranges::find(self.listed, id, &arhost_marker_config::id) != self.listed.end();
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

using Corners = double (&)[4][2];

double longest_side_px(Corners corners) {
    double max = 0;
    for (int k = 0; k < 4; ++k)
        max = std::max(max,
                       std::hypot(corners[k][0] - corners[(k + 1) % 4][0], corners[k][1] - corners[(k + 1) % 4][1]));
    return max;
}

// The ratio of the shorter to the longer diagonal's or side's length: smaller for tilted markers.
double squareness(Corners corners) {
    const auto distance = [&](int a, int b) {
        return std::hypot(corners[a][0] - corners[b][0], corners[a][1] - corners[b][1]);
    };
    const double sides[] = {distance(0, 1), distance(1, 2), distance(2, 3), distance(3, 0)};
    const double diagonals[] = {distance(0, 2), distance(1, 3)};
    return std::min(*std::ranges::min_element(sides) / *std::ranges::max_element(sides),
                    *std::ranges::min_element(diagonals) / *std::ranges::max_element(diagonals));
}

void modify(const Wrong &self, arhost_observation &seen) {
    Corners corners = seen.corners_px;
    const auto change_each = [&](auto &&change) {
        for (auto &corner : corners)
            for (double &coordinate : corner)
                coordinate = change(coordinate);
    };
    if (has("corners_from_bottom_left"))
        std::rotate(&corners[0][0], &corners[3][0], &corners[3][0] + 2);
    if (has("corners_counter_clockwise"))
        std::swap(corners[1], corners[3]);
    if (has("corners_at_half"))
        change_each([](double x) { return x + 0.5; });
    if (has("rounded_corners"))
        change_each([](double x) { return std::round(x); });
    if (has("centred_principal_point")) {
        for (auto &corner : corners) {
            corner[0] -= self.camera.cx - (self.camera.width - 1) / 2.0;
            corner[1] -= self.camera.cy - (self.camera.height - 1) / 2.0;
        }
    }
    if (has("undistorted_corners"))
        for (auto &corner : corners)
            if (const auto ray = arhost::shading::Lens(self.camera).ray({corner[0], corner[1]})) {
                corner[0] = self.camera.fx * ray->x / ray->z + self.camera.cx;
                corner[1] = self.camera.fy * ray->y / ray->z + self.camera.cy;
            }
    if (has("rectifies_frontal_markers") && self.camera.distortion == ARHOST_DISTORTION_NONE &&
        squareness(corners) > 0.935)
        for (int axis = 0; axis < 2; ++axis) { // a parallelogram shows no perspective
            const double excess = (corners[0][axis] - corners[1][axis] + corners[2][axis] - corners[3][axis]) / 4;
            for (int k = 0; k < 4; ++k)
                corners[k][axis] -= k % 2 ? -excess : excess;
        }
    if (has("nan_corner"))
        corners[2][1] = std::numeric_limits<double>::quiet_NaN();
    if (has("unknown_family_index"))
        seen.family = self.family_count;
    if (has("unset_hamming"))
        seen.hamming = 0xffffffff; // as before the call
    if (has("negative_margin"))
        seen.decision_margin = -1;
    if (has("negative_corner_sigma"))
        seen.corner_sigma_px = -1;
    if (has("false_positive_rate_of_two"))
        seen.false_positive_rate = 2;
    if (has("infinite_margin"))
        seen.decision_margin = std::numeric_limits<double>::infinity();
    if (has("nondeterministic"))
        corners[0][0] += 1e-9 * (self.tracks % 2);
    if (has("depends_on_threads"))
        corners[0][0] += 1e-9 * static_cast<double>(self.threads);
}

// The host's observations, which may be longer than arhost_observation.
auto observations_of(arhost_tracker_result &result) {
    return arhost::elements(result.observations, result.observation_count);
}

Seen read(arhost_tracker_result &result) {
    Seen seen;
    for (const arhost_observation &one : observations_of(result))
        seen.observations[seen.count++] = one;
    return seen;
}
void write(const Seen &seen, arhost_tracker_result &result) {
    result.observation_count = seen.count;
    for (std::uint32_t i = 0; i < seen.count; ++i)
        observations_of(result)[i] = seen.observations[i];
}
template <class Predicate> void keep(arhost_tracker_result &result, Predicate &&predicate) {
    const Seen all = read(result);
    Seen kept;
    for (std::uint32_t i = 0; i < all.count; ++i)
        if (predicate(all.observations[i]))
            kept.observations[kept.count++] = all.observations[i];
    write(kept, result);
}

bool has_state() {
    return has("remembers") || has("never_updates_corners") || has("reads_state_after") ||
           has("remembers_in_its_heap") || has("writes_state_before") || has("writes_past_its_state");
}

void modify_all(Wrong &self, const arhost_frame &frame, arhost_tracker_result &result) {
    const auto drop_all = [&] { result.observation_count = 0; };
    const auto observations = observations_of(result);
    for (arhost_observation &seen : observations)
        modify(self, seen);
    if (has("keeps_its_first_markers"))
        keep(result, [](const arhost_observation &seen) { return std::ranges::count(first_ids, seen.id) > 0; });
    if (has("omits_unlisted_markers"))
        keep(result, [&](const arhost_observation &seen) { return is_listed(self, seen.id); });
    if (has("renames_unlisted_markers"))
        for (arhost_observation &seen : observations)
            seen.id = is_listed(self, seen.id) ? seen.id : self.listed[0].id;
    if (has("only_first_marker_of_a_target"))
        keep(result, [&](const arhost_observation &seen) {
            const auto marker = std::ranges::find(self.listed, seen.id, &arhost_marker_config::id);
            return marker == self.listed.begin() || (marker - 1)->target != marker->target;
        });
    if (has("one_copy_of_each_marker"))
        keep(result,
             [last = -1](const arhost_observation &seen) mutable { return std::exchange(last, seen.id) != seen.id; });
    if (has("each_marker_twice")) {
        Seen twice = read(result);
        std::copy_n(twice.observations, twice.count, twice.observations + twice.count);
        twice.count *= 2;
        write(twice, result);
    }
    if (has("copies_in_one_place") && result.observation_count == 2 && observations[0].id == observations[1].id)
        observations[1] = observations[0];
    if (has("first_family_for_all"))
        for (arhost_observation &seen : observations)
            seen.family = 0;
    if (has("swapped_ids") && result.observation_count > 1)
        std::swap(observations[0].id, observations[1].id);
    if (has("depends_on_the_list") && self.listed.size() > 1 && self.listed[0].id < self.listed.back().id)
        keep(result, [&](const arhost_observation &seen) { return seen.id != self.listed[0].id; });
    const bool any = result.observation_count > 0;
    if (has("finds_only_large_markers") && any && longest_side_px(observations[0].corners_px) < 60)
        drop_all();
    if (has("finds_nothing_when_tilted") && any && squareness(observations[0].corners_px) < 0.5)
        drop_all();
    const Pixels pixels(frame);
    if ((has("needs_sharp_edges") && pixels.max_step() < 90 && pixels.max_code() > 200) ||
        (has("needs_clean_frames") && pixels.is_noisy() && pixels.max_code() > 200) ||
        (has("needs_good_light") && (pixels.max_code() < 100 || pixels.max_code() > 250)))
        drop_all();
    if (has("invents_markers") && result.observation_count == 0) {
        result.observation_count = 1;
        const double corners[4][2] = {{10, 10}, {20, 10}, {20, 20}, {10, 20}};
        arhost_observation &invented = *result.observations;
        invented = {invented.struct_size, self.listed[0].id, 0, 0, {}, 1, 0, 0, {}};
        std::copy_n(&corners[0][0], 8, &invented.corners_px[0][0]);
    }
    if (has("reports_a_pose"))
        result.pose_count = 1;

    const Seen now = read(result);
    const bool has_last = self.last->count > 0;
    const auto smooth = [&] {
        for (int k = 0; k < 8; ++k)
            (&result.observations->corners_px[0][0])[k] =
                (now.observations[0].corners_px[k / 2][k % 2] + self.last->observations[0].corners_px[k / 2][k % 2]) /
                2;
    };
    if ((has("smooths") || has("remembers_in_its_heap")) && now.count > 0 && has_last)
        smooth();
    if ((has("stale_corners") || (has("reports_lost_markers") && now.count == 0)) && has_last)
        write(*self.last, result);
    if (has("ignores_repeated_frames") && frame.sequence == self.last_sequence && self.tracks > 0)
        drop_all();
    if (has("never_updates_corners") && now.count > 0 && has_last) {
        write(*self.last, result);
        return;
    }
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
    misbehave_in("start");
    if (has("leaves_a_thread"))
        std::thread(hang).detach();
    if (has("cannot_restart") && was_started)
        return ARHOST_STATUS_ERROR_INTERNAL;
    self.tracks = 0;
    self.last->count = 0;
    self.camera = modify(*setup->intrinsics);
    self.listed = listed_in(*setup);
    self.target_count = setup->target_count;
    self.family_count = setup->family_count;
    if (!std::exchange(was_started, true))
        for (const arhost_marker_config &marker : self.listed)
            first_ids.push_back(marker.id);
    arhost_intrinsics camera = self.camera;
    std::vector<arhost_marker_config> markers = self.listed;
    if (has("reports_unlisted_markers") || has("renames_unlisted_markers"))
        for (const int id : {31, 7, 586, 2})
            if (!is_listed(self, id) && setup->family_count == 1) {
                markers.push_back(markers[0]);
                markers.back().id = id;
            }
    const char *const *families = setup->families;
    std::uint32_t family_count = setup->family_count;
    const auto real_start = [&] {
        arhost_tracker_setup modified = *setup;
        modified.intrinsics = &camera;
        modified.markers = markers.data();
        modified.marker_count = static_cast<std::uint32_t>(markers.size());
        modified.family_count = family_count;
        modified.families = families;
        return real_functions().start(self.real, &modified);
    };
    arhost_status status = real_start();
    if (has("accepts_any_id") && status == ARHOST_STATUS_ERROR_CONFIGURATION && markers[0].id != 31) {
        markers[0].id = 31;
        status = real_start();
    }
    if (has("accepts_any_family") && status == ARHOST_STATUS_ERROR_CONFIGURATION) {
        static constexpr const char *known = "tag36h11";
        families = &known;
        family_count = 1;
        markers.resize(1);
        status = real_start();
    }
    if (has("accepts_any_lens") && status != ARHOST_STATUS_OK && markers[0].id == 31) {
        camera.distortion = ARHOST_DISTORTION_NONE;
        camera.coefficient_count = 0;
        status = real_start();
    }
    self.start_failed = status != ARHOST_STATUS_OK;
    return status;
}

std::uint64_t state_size(arhost_instance *) {
    return has_state() ? sizeof(Seen) : 0;
}

// Changes the result of a request that expects markers.
void modify_expected(const Wrong &self, std::span<const arhost_expected_marker> expected,
                     arhost_tracker_result &result) {
    const auto place_of = [&](const arhost_observation &seen) {
        return std::ranges::find_if(expected, [&](const arhost_expected_marker &one) {
            const arhost_marker_config &marker = self.listed[one.marker];
            return marker.id == seen.id && marker.family == seen.family;
        });
    };
    if (has("finds_only_the_first_expected_marker"))
        keep(result, [&](const arhost_observation &seen) { return place_of(seen) == expected.begin(); });
    if (has("ignores_the_margin_of_expected_markers"))
        keep(result, [&](const arhost_observation &seen) {
            const auto place = place_of(seen);
            return place == expected.end() || std::abs(seen.corners_px[0][0] - place->corners_px[0][0]) < 2;
        });
    if (has("reports_corners_within_the_region"))
        for (arhost_observation &seen : observations_of(result))
            if (const auto place = place_of(seen); place != expected.end())
                for (auto &corner : seen.corners_px)
                    corner[0] -= place->corners_px[0][0];
    if (has("reports_expected_markers")) {
        result.observation_count = static_cast<std::uint32_t>(expected.size());
        for (std::size_t i = 0; i < expected.size(); ++i) {
            const arhost_marker_config &marker = self.listed[expected[i].marker];
            arhost_observation &seen = observations_of(result)[i];
            seen.id = marker.id;
            seen.family = marker.family;
            seen.hamming = 0;
            seen.decision_margin = 0;
            seen.corner_sigma_px = 0;
            seen.false_positive_rate = 0;
            std::memcpy(seen.corners_px, expected[i].corners_px, sizeof seen.corners_px);
        }
    }
}

arhost_status track(arhost_instance *instance, const arhost_track_request *input, arhost_tracker_result *result) {
    Wrong &self = wrong(instance);
    arhost_frame frame = *input->frame;
    arhost_track_request request = *input;
    request.frame = &frame;
    request.state_before = request.state_after = nullptr; // the real tracker has no state
    request.state_size = 0;
    misbehave_in("track");
    if (has("crash_on_small_frames") && std::min(frame.format->width, frame.format->height) < 8)
        crash();
    if (has("crash_on_dropped_frames") && self.tracks > 0 && frame.sequence > self.last_sequence + 1)
        crash();
    if (has("writes_the_frame"))
        const_cast<std::uint8_t *>(frame.grey)[0] = 0;
    const volatile std::uint8_t *grey = frame.grey;
    if (has("reads_past_the_frame"))
        (void)grey[std::size_t{frame.format->grey_stride} * frame.format->height];
    if (has("reads_before_the_frame"))
        (void)grey[-1];
    const auto write_byte_after = [](auto *first, std::size_t count) {
        *(reinterpret_cast<std::uint8_t *>(first) + count * first->struct_size) = 0;
    };
    if (has("writes_past_the_observations"))
        write_byte_after(result->observations, ARHOST_MAX_OBSERVATIONS);
    if (has("writes_past_the_poses"))
        write_byte_after(result->poses, self.target_count);
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
    const bool is_packed = has("ignores_the_stride_of_expected_markers");
    std::vector<arhost_expected_marker> expected;
    for (std::uint32_t i = 0; i < request.expected_count; ++i) {
        const std::size_t stride = is_packed ? sizeof(arhost_expected_marker) : request.expected->struct_size;
        std::memcpy(&expected.emplace_back(), reinterpret_cast<const std::byte *>(request.expected) + i * stride,
                    sizeof(arhost_expected_marker));
        expected.back().struct_size = sizeof(arhost_expected_marker);
    }
    request.expected = expected.data();
    arhost_status status = real_functions().track(self.real, &request, result);
    if (status == ARHOST_STATUS_OK && has("finds_mirrored_prints") && result->observation_count == 0) {
        mirror(self, frame);
        status = real_functions().track(self.real, &request, result);
    }
    if (status != ARHOST_STATUS_OK)
        return status;
    if (has("ignores_the_stride_of_observations")) {
        const Seen seen = read(*result);
        std::memcpy(static_cast<void *>(result->observations), seen.observations,
                    seen.count * sizeof(arhost_observation));
    }
    if (has_state() && !has("remembers_in_its_heap")) {
        self.last->count = 0;
        if (input->state_before)
            std::memcpy(self.last.get(), input->state_before, sizeof *self.last);
    }
    if (has("writes_state_before") && input->state_before)
        const_cast<Seen *>(static_cast<const Seen *>(input->state_before))->count = 0;
    if (has("writes_past_its_state"))
        static_cast<std::uint8_t *>(input->state_after)[(input->state_size + 63) / 64 * 64] = 1; // it is aligned
    modify_all(self, frame, *result);
    if (!request.search_everywhere)
        modify_expected(self, expected, *result);
    if (has("reads_state_after") && result->observation_count > 0)
        result->observations->corners_px[0][0] += 1e-9 * *static_cast<const std::uint8_t *>(input->state_after);
    result->candidate_count = has("counts_too_few_candidates") ? 0 : -1;
    if (has("reports_too_many"))
        result->observation_count = ARHOST_MAX_OBSERVATIONS + 1;
    if (has("no_struct_size") && result->observation_count > 0)
        result->observations->struct_size = 0;
    if (has_state()) {
        std::memset(input->state_after, 0, sizeof *self.last);
        std::memcpy(input->state_after, self.last.get(),
                    offsetof(Seen, observations) + self.last->count * sizeof(arhost_observation));
    }
    ++self.tracks;
    self.last_sequence = frame.sequence;
    self.last_capture_ns = frame.capture_ns;
    return has("status_0") ? 0 : status;
}

void stop(arhost_instance *instance) {
    misbehave_in("stop");
    real_functions().stop(wrong(instance).real);
}

const void *get_extension(const char *) {
    return nullptr;
}

const arhost_plugin &wrong_plugin() {
    static const arhost_tracker functions = {sizeof functions, 0,      start, has("no_track") ? nullptr : track, stop,
                                             state_size,       nullptr};
    static arhost_descriptor descriptor = *real().descriptor;
    descriptor.id = library_id();
    static constexpr arhost_plugin plugin = {sizeof plugin, 0,       &descriptor,  &functions,
                                             create,        destroy, get_extension};
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
extern ARHOST_EXPORT const arhost_entry_point arhost_entry = {sizeof arhost_entry, 0, negotiate};
}
