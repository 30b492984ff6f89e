// SPDX-License-Identifier: Apache-2.0
#include "frame_refinement.hpp"

#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <tuple>

namespace arhost::fiducial {

FrameRefinement::FrameRefinement(const cv::Mat &grey, arhost_transfer transfer, const Lens &lens, double work_per_px)
    : grey_(grey), transfer_(transfer), lens_(lens), work_left_(work_per_px * static_cast<double>(grey.total())) {}

std::vector<std::optional<MeasuredCorners>> FrameRefinement::refine(std::span<const RoughMarker> markers,
                                                                    int threads) {
    constexpr double work_of_edges = 1'300;
    // More than the work of most prints: as many as the budget suffices for are fitted before it is checked again.
    constexpr double max_work = 10'000;
    const auto in_parallel = [&](std::size_t count, const auto &step) {
        cv::parallel_for_(
            {0, static_cast<int>(count)},
            [&](const cv::Range &range) {
                for (int i = range.start; i < range.end; ++i)
                    step(static_cast<std::size_t>(i));
            },
            threads > 0 ? threads : -1);
    };
    work_left_ -= work_of_edges * static_cast<double>(markers.size());
    std::vector<CornersByEdges> by_edges(markers.size());
    in_parallel(markers.size(), [&](std::size_t i) {
        const RoughMarker &marker = markers[i];
        by_edges[i] = refine_by_edges(grey_, transfer_, marker.corners_px, lens_, marker.cells, marker.is_subpixel);
    });
    std::vector<std::optional<MeasuredCorners>> refined;
    std::vector<std::size_t> order; // the largest first
    for (std::size_t i = 0; i < markers.size(); ++i) {
        refined.push_back(by_edges[i].edges);
        if (by_edges[i].need_print())
            order.push_back(i);
    }
    std::ranges::sort(order, {}, [&](std::size_t i) {
        const Corners &corners = markers[i].corners_px; // unlike the index, they do not depend on threads
        const double area_px = (corners[2] - corners[0]).cross(corners[3] - corners[1]) / 2;
        return std::tuple(-area_px, corners[0].x, corners[0].y, i);
    });
    for (std::span<const std::size_t> rest = order; !rest.empty() && work_left_ > reserved_;) {
        const auto affordable = static_cast<std::size_t>((work_left_ - reserved_) / max_work);
        const auto part = rest.first(std::min(std::max<std::size_t>(affordable, 1), rest.size()));
        rest = rest.subspan(part.size());
        std::vector<std::uint64_t> work(part.size());
        in_parallel(part.size(), [&](std::size_t i) {
            const RoughMarker &marker = markers[part[i]];
            refined[part[i]] = refine_by_print(grey_, transfer_, marker.corners_px, lens_, marker.cells,
                                               marker.print(), by_edges[part[i]], work[i]);
        });
        work_left_ -= static_cast<double>(std::accumulate(work.begin(), work.end(), std::uint64_t{0}));
    }
    return refined;
}

} // namespace arhost::fiducial
