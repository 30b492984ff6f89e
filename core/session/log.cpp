// SPDX-License-Identifier: Apache-2.0
#include "session/log.hpp"

#include "base/text.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <stdexcept>
#include <type_traits>

namespace arhost::session {
namespace {

bool all_finite(std::initializer_list<std::span<const double>> arrays) {
    return std::ranges::all_of(arrays, [](std::span<const double> array) {
        return std::ranges::all_of(array, [](double number) { return std::isfinite(number); });
    });
}

std::string problem_with(const arhost_target &target, std::size_t observation_count) {
    const std::size_t length = ::strnlen(target.name, sizeof target.name);
    if (length == 0 || length == sizeof target.name)
        return "name: must have 1 to 63 bytes";
    if (!base::is_utf8({target.name, length}))
        return "name: must be UTF-8";
    if (target.state < ARHOST_TARGET_DETECTED || target.state > ARHOST_TARGET_LOST)
        return "state: is out of range";
    if (!all_finite({target.mt,
                     target.mt_alternative,
                     target.covariance,
                     {&target.reprojection_px, 1},
                     {&target.ambiguity, 1}}))
        return "targets: has a number that is not finite";
    if (target.first_observation > observation_count ||
        target.observation_count > observation_count - target.first_observation)
        return "observations: are out of range";
    return "";
}

// ---- packed form ----------------------------------------------------------------------------------------
//
// The values one after the other, as `transfer` lists them. A Writer and a Reader go through the same list, so they
// cannot differ. Fields that are not in the list, because the log does not have them, keep their defaults in the
// host.

class Writer {
public:
    // Only counts the bytes if `to` is null.
    explicit Writer(std::byte *to) : to_(to) {}
    std::size_t size() const { return size_; }

    template <class T> void operator()(const T &value) { write(&value, sizeof value); }
    void text(const std::string &value) {
        (*this)(std::uint64_t{value.size()});
        write(value.data(), value.size());
    }
    template <class T> void optional(const std::optional<T> &value, const auto &transfer_value) {
        (*this)(std::uint8_t{value.has_value()});
        if (value)
            transfer_value(*value);
    }
    template <class T> void array(const std::vector<T> &values, std::size_t, const auto &transfer_value) {
        (*this)(std::uint64_t{values.size()});
        std::ranges::for_each(values, transfer_value);
    }

private:
    void write(const void *from, std::size_t size) {
        if (to_)
            std::memcpy(to_ + size_, from, size);
        size_ += size;
    }

    std::byte *to_;
    std::size_t size_ = 0;
};

class Reader {
public:
    explicit Reader(std::span<const std::byte> bytes) : rest_(bytes) {}
    bool at_end() const { return rest_.empty(); }

    template <class T> void operator()(T &value) {
        static_assert(std::is_trivially_copyable_v<T> && !std::is_same_v<T, bool>, "not every byte is a bool");
        std::memcpy(&value, take(sizeof value).data(), sizeof value);
    }
    void text(std::string &value) {
        const auto bytes = take(number<std::uint64_t>());
        value.assign(reinterpret_cast<const char *>(bytes.data()), bytes.size());
    }
    template <class T> void optional(std::optional<T> &value, const auto &transfer_value) {
        if (number<std::uint8_t>() != 0)
            transfer_value(value.emplace());
    }
    template <class T> void array(std::vector<T> &values, std::size_t max_count, const auto &transfer_value) {
        const auto count = number<std::uint64_t>();
        if (count > max_count)
            throw std::runtime_error("it has an array of " + std::to_string(count) + " elements; the maximum is " +
                                     std::to_string(max_count));
        values.resize(count);
        std::ranges::for_each(values, transfer_value);
    }

private:
    std::span<const std::byte> take(std::uint64_t size) {
        if (size > rest_.size())
            throw std::runtime_error("it ends in the middle of a frame");
        const auto taken = rest_.first(size);
        rest_ = rest_.subspan(size);
        return taken;
    }
    template <class T> T number() {
        T value;
        (*this)(value);
        return value;
    }

    std::span<const std::byte> rest_;
};

// `Frame` is RecordedFrame, const for a Writer.
template <class Archive, class Frame> void transfer(Archive &archive, Frame &frame) {
    archive(frame.number);
    archive(frame.capture_ns);
    archive(frame.clock);
    archive(frame.overlay);
    archive(frame.scale);
    archive(frame.samples);
    archive(frame.shading_px);
    archive.array(frame.targets, ARHOST_MAX_TARGETS, [&](auto &target) {
        archive(target.name);
        archive(target.state);
        archive(target.age_frames);
        archive(target.first_observation);
        archive(target.observation_count);
        archive(target.mt);
        archive(target.mt_alternative);
        archive(target.covariance);
        archive(target.reprojection_px);
        archive(target.ambiguity);
    });
    archive.array(frame.observations, ARHOST_MAX_OBSERVATIONS, [&](auto &observation) {
        archive(observation.id);
        archive(observation.hamming);
        archive(observation.corners_px);
        archive(observation.decision_margin);
        archive(observation.corner_sigma_px);
    });
    archive(frame.search);
    archive.optional(frame.view, [&](auto &view) { archive(view); });
    archive.optional(frame.truth, [&](auto &truth) {
        archive.text(truth.first);
        archive(truth.second);
    });
}

std::size_t write(const Log &log, std::byte *to) {
    Writer writer(to);
    writer(log.lacking);
    writer(std::uint8_t{log.is_complete});
    for (const RecordedFrame &frame : log.frames)
        transfer(writer, frame);
    return writer.size();
}

} // namespace

std::string problem_with(const RecordedFrame &frame, const RecordedFrame *before) {
    if (frame.clock != ARHOST_CLOCK_MEDIA && frame.clock != ARHOST_CLOCK_MONOTONIC)
        return "clock: is out of range";
    if (frame.overlay < ARHOST_OVERLAY_RENDERED || frame.overlay > ARHOST_OVERLAY_NONE)
        return "overlay: is out of range";
    if (!(frame.scale >= 0.01 && frame.scale <= 1))
        return "overlay_scale: must be 0.01 to 1";
    if (frame.shading_px < 1 || frame.shading_px > 2)
        return "overlay_shading_px: must be 1 or 2";
    for (const arhost_target &target : frame.targets)
        if (std::string problem = problem_with(target, frame.observations.size()); !problem.empty())
            return problem;
    for (const arhost_observation &observation : frame.observations)
        if (const auto &corners = observation.corners_px; !all_finite({corners[0],
                                                                       corners[1],
                                                                       corners[2],
                                                                       corners[3],
                                                                       {&observation.decision_margin, 1},
                                                                       {&observation.corner_sigma_px, 1}}))
            return "observations: has a number that is not finite";
    if (frame.targets.size() > ARHOST_MAX_TARGETS || frame.observations.size() > ARHOST_MAX_OBSERVATIONS)
        return "targets: has more targets or observations than a frame can have";
    if (frame.view) {
        if (const std::string problem = camera::problem_with(*frame.view); !problem.empty())
            return "camera: " + problem;
    } else if (frame.overlay != ARHOST_OVERLAY_NONE) {
        return "camera: is null, but the frame has an overlay";
    }
    if (frame.truth && !(base::is_utf8(frame.truth->first) && all_finite({frame.truth->second})))
        return "truth: is not UTF-8, or has a number that is not finite";
    if (frame.search.candidate_count < -1 || frame.search.missed_count > frame.search.expected_count)
        return "search: has a count that is out of range";
    if (before && frame.number <= before->number)
        return "frame: must be greater than in the line before, " + std::to_string(before->number);
    if (before && frame.capture_ns < before->capture_ns)
        return "capture_ns: must not be less than in the line before";
    return "";
}

std::size_t packed_size(const Log &log) {
    return write(log, nullptr);
}

void pack(const Log &log, std::span<std::byte> memory) {
    write(log, memory.data());
}

Log unpack(std::span<const std::byte> memory, std::uint64_t max_frames) {
    Reader reader(memory);
    Log log;
    std::uint8_t is_complete = 0;
    reader(log.lacking);
    reader(is_complete);
    log.is_complete = is_complete != 0;
    do {
        if (log.frames.size() == max_frames)
            throw std::runtime_error("it has more frames than a log of this size can have");
        RecordedFrame frame{};
        transfer(reader, frame);
        for (arhost_target &target : frame.targets)
            target.struct_size = sizeof target;
        for (arhost_observation &observation : frame.observations)
            observation.struct_size = sizeof observation;
        const RecordedFrame *before = log.frames.empty() ? nullptr : &log.frames.back();
        if (const std::string problem = problem_with(frame, before); !problem.empty())
            throw std::runtime_error("its frame " + std::to_string(frame.number) + " is invalid: " + problem);
        log.frames.push_back(std::move(frame));
    } while (!reader.at_end());
    return log;
}

} // namespace arhost::session
