// SPDX-License-Identifier: Apache-2.0
#include "conformance/source_run.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstring>

namespace arhost::conformance {

using ipc::Call;

PlaneShape shape_of(const arhost_frame_format &format, std::uint32_t plane) {
    if (plane == format.plane_count)
        return {2 * format.width, format.has_depth ? format.height : 0};
    switch (format.pixel_format) {
    case ARHOST_PIXEL_FORMAT_RGB8:
    case ARHOST_PIXEL_FORMAT_BGR8:
        return {3 * format.width, format.height};
    case ARHOST_PIXEL_FORMAT_YUYV:
        return {2 * format.width, format.height};
    case ARHOST_PIXEL_FORMAT_NV12:
        return plane == 0 ? PlaneShape{format.width, format.height} : PlaneShape{format.width, format.height / 2};
    case ARHOST_PIXEL_FORMAT_I420:
        return plane == 0 ? PlaneShape{format.width, format.height} : PlaneShape{format.width / 2, format.height / 2};
    default:
        return {format.width, format.height};
    }
}

std::string place_of(const arhost_frame_format &format, std::size_t index) {
    std::uint32_t plane = 0;
    PlaneShape shape = shape_of(format, plane);
    while (index >= std::size_t{shape.row_bytes} * shape.rows) {
        index -= std::size_t{shape.row_bytes} * shape.rows;
        shape = shape_of(format, ++plane);
    }
    const std::string name = plane == format.plane_count ? "the depth plane" : fmt::format("plane {}", plane);
    return fmt::format("{}, row {}, byte {}", name, index / shape.row_bytes, index % shape.row_bytes);
}

Slot::Slot(std::size_t size) : size_(size), lines_((2 * guard_size + size + sizeof(Line) - 1) / sizeof(Line)) {
    std::memset(lines_.front().bytes, guard, lines_.size() * sizeof(Line));
}

std::string Slot::damage() const {
    const std::uint8_t *begin = lines_.front().bytes, *end = begin + lines_.size() * sizeof(Line);
    for (const std::uint8_t *p = begin; p < data(); ++p)
        if (*p != guard)
            return fmt::format("a guard byte {} bytes before the slot", data() - p);
    for (const std::uint8_t *p = data() + size_; p < end; ++p)
        if (*p != guard)
            return fmt::format("a guard byte at offset {} of a slot of {} bytes", p - data(), size_);
    return {};
}

SourceRun::SourceRun(Context &context)
    : library_(context.library), instance_(context.library),
      functions_(*static_cast<const arhost_source *>(context.library.plugin().functions)) {
    instance_->create_or_fail();
}

arhost_status SourceRun::try_start(const Request &request) {
    stop();
    if (!std::exchange(fresh_, false)) {
        instance_.emplace(library_);
        instance_->create_or_fail();
    }
    const arhost_source_setup setup{sizeof setup,  0, request.first_sequence, request.fps,
                                    request.paced, 0, request.intrinsics};
    properties_ = {};
    properties_.struct_size = sizeof properties_;
    properties_.format.struct_size = sizeof properties_.format;
    properties_.intrinsics.struct_size = sizeof properties_.intrinsics;
    next_ = request.first_sequence;
    const arhost_status status = in_call(library_.calls(), Call::start,
                                         [&] { return functions_.start(instance_->get(), &setup, &properties_); });
    started_ = status == ARHOST_STATUS_OK;
    return status;
}

void SourceRun::accept(arhost_status started) {
    instance_->expect_ok("start", started);
    if (const std::string text = problem(); !text.empty())
        throw Failure(text);
    slot_.emplace(format().byte_size);
}

std::string SourceRun::problem() const {
    const arhost_frame_format &f = properties_.format;
    arhost_frame_format expected = f;
    if (f.pixel_format < ARHOST_PIXEL_FORMAT_GREY8 || f.pixel_format > ARHOST_PIXEL_FORMAT_I420)
        return fmt::format("its pixel format {} is invalid", f.pixel_format);
    if (!arhost_frame_layout(&expected))
        return fmt::format("{}×{} is not a valid size for its pixel format", f.width, f.height);
    for (std::uint32_t plane = 0; plane < ARHOST_MAX_PLANES; ++plane)
        if (f.stride[plane] != expected.stride[plane] || f.offset[plane] != expected.offset[plane])
            return fmt::format(
                "plane {} begins at byte {} and has a stride of {}; arhost_frame_layout gives {} and {}", plane,
                f.offset[plane], f.stride[plane], expected.offset[plane], expected.stride[plane]);
    if (f.plane_count != expected.plane_count || f.byte_size != expected.byte_size ||
        f.grey_offset != expected.grey_offset || f.grey_stride != expected.grey_stride ||
        f.depth_offset != expected.depth_offset || f.depth_stride != expected.depth_stride)
        return fmt::format("its slots have {} planes and {} bytes; arhost_frame_layout gives {} and {}",
                           f.plane_count, f.byte_size, expected.plane_count, expected.byte_size);
    const bool is_yuv = f.pixel_format >= ARHOST_PIXEL_FORMAT_YUYV;
    if (is_yuv && (f.yuv_matrix < ARHOST_YUV_MATRIX_BT601 || f.yuv_matrix > ARHOST_YUV_MATRIX_BT709))
        return fmt::format("its YUV matrix {} is invalid", f.yuv_matrix);
    if (is_yuv && (f.yuv_range < ARHOST_YUV_RANGE_LIMITED || f.yuv_range > ARHOST_YUV_RANGE_FULL))
        return fmt::format("its YUV range {} is invalid", f.yuv_range);
    if (f.transfer < ARHOST_TRANSFER_SRGB || f.transfer > ARHOST_TRANSFER_LINEAR)
        return fmt::format("its transfer {} is invalid", f.transfer);
    if (!std::isfinite(f.fps) || f.fps < 0)
        return fmt::format("its frame rate of {} is invalid", f.fps);
    return {};
}

void SourceRun::stop() {
    if (std::exchange(started_, false))
        in_call(library_.calls(), Call::stop, [&] { functions_.stop(instance_->get()); });
}

arhost_status SourceRun::try_read(bool filled) {
    if (!filled)
        std::memset(slot_->data(), 0, slot_->size());
    arhost_frame_buffer buffer{};
    buffer.struct_size = sizeof buffer;
    buffer.format = &properties_.format;
    for (std::uint32_t plane = 0; plane < format().plane_count; ++plane)
        buffer.plane[plane] = slot_->data() + format().offset[plane];
    buffer.grey = slot_->data() + format().grey_offset;
    if (format().has_depth)
        buffer.depth_mm = reinterpret_cast<std::uint16_t *>(slot_->data() + format().depth_offset);
    buffer.sequence = next_;
    info_ = {};
    info_.struct_size = sizeof info_;
    const arhost_status status = in_call(library_.calls(), Call::per_frame,
                                         [&] { return functions_.read(instance_->get(), &buffer, &info_); });
    if (status == ARHOST_STATUS_OK)
        next_ += std::uint64_t{1} + info_.skipped;
    return status;
}

std::optional<Frame> SourceRun::read(bool filled) {
    const arhost_status status = try_read(filled);
    if (status == ARHOST_STATUS_END || status == ARHOST_STATUS_END_TRUNCATED)
        return std::nullopt;
    instance_->expect_ok("read", status);
    return frame();
}

std::vector<Frame> SourceRun::read_up_to(std::size_t count) {
    std::vector<Frame> frames;
    while (frames.size() < count)
        if (std::optional<Frame> frame = read())
            frames.push_back(std::move(*frame));
        else
            break;
    return frames;
}

Frame SourceRun::frame() const {
    Frame frame{{}, info_};
    for (std::uint32_t plane = 0; plane <= format().plane_count; ++plane) {
        const PlaneShape shape = shape_of(format(), plane);
        const bool is_depth = plane == format().plane_count;
        const std::uint8_t *row = slot_->data() + (is_depth ? format().depth_offset : format().offset[plane]);
        const std::size_t stride = is_depth ? format().depth_stride : format().stride[plane];
        for (std::uint32_t y = 0; y < shape.rows; ++y, row += stride)
            frame.pixels.insert(frame.pixels.end(), row, row + shape.row_bytes);
    }
    return frame;
}

} // namespace arhost::conformance
