// SPDX-License-Identifier: Apache-2.0
//
// Differences between Embree 3 (Debian 12) and Embree 4.
#pragma once

#if __has_include(<embree4/rtcore.h>) && !defined(ARHOST_EMBREE_3)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <cstddef>
#include <type_traits>

// Always inline: the kernels are compiled for several instruction sets and must not share code.
#define RT_EMBREE_INLINE inline __attribute__((always_inline))

namespace rt_embree {

// Per-call context, passed through to the geometries' callbacks.
struct Query {
#if RTC_VERSION_MAJOR >= 4
    RTCRayQueryContext context;
    RTCRayQueryFlags flags;
#else
    RTCIntersectContext context;
#endif
    bool cull_catcher_back_faces;
};

enum class Coherence { coherent, incoherent };

RT_EMBREE_INLINE Query make_query(Coherence coherence, bool cull_catcher_back_faces = false) {
    Query query;
    query.cull_catcher_back_faces = cull_catcher_back_faces;
#if RTC_VERSION_MAJOR >= 4
    rtcInitRayQueryContext(&query.context);
    query.flags = coherence == Coherence::coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
#else
    rtcInitIntersectContext(&query.context);
    query.context.flags = coherence == Coherence::coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT
                                                           : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
#endif
    return query;
}

RT_EMBREE_INLINE const Query &query_of(const RTCFilterFunctionNArguments &arguments) {
    return *reinterpret_cast<const Query *>(arguments.context);
}

// Embree's packet width on this processor. It splits wider packets into single rays (Embree 4), or into streams that
// trace the invalid rays as well (Embree 3).
inline int native_packet_width(RTCDevice device) {
    return rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)  ? 16
           : rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) ? 8
                                                                                     : 4;
}

namespace detail {

// Calls rtcIntersect<n> or rtcOccluded<n>.
template <auto function, class Rays>
RT_EMBREE_INLINE void trace(const int *valid, RTCScene scene, Query &query, Rays &rays) {
#if RTC_VERSION_MAJOR >= 4
    std::conditional_t < requires {
        rays.hit;
    }
    , RTCIntersectArguments, RTCOccludedArguments > arguments;
    if constexpr (requires { rays.hit; })
        rtcInitIntersectArguments(&arguments);
    else
        rtcInitOccludedArguments(&arguments);
    arguments.flags = query.flags;
    arguments.context = &query.context;
    function(valid, scene, &rays, &arguments);
#else
    function(valid, scene, &query.context, &rays);
#endif
}

// The same for 16 rays in narrower packets. Packets are rows of 4-byte values, one per ray; only the rows that Embree
// reads (the ray, and the hit from geomID on) or writes (tfar, the hit) are copied. A row is copied as one register:
// the processor does not forward two stores to one load.
template <auto function, class Part, class Rays>
RT_EMBREE_INLINE void trace_in_parts(const int *valid, RTCScene scene, Query &query, Rays &rays) {
    constexpr int parts = sizeof(Rays) / sizeof(Part), width = 16 / parts;
    constexpr int row_count = sizeof(Rays) / (16 * sizeof(int)), ray_rows = sizeof(RTCRay16) / (16 * sizeof(int));
    constexpr int tfar = offsetof(RTCRay16, tfar) / (16 * sizeof(int));
    constexpr int geometry = (sizeof(RTCRay16) + offsetof(RTCHit16, geomID)) / (16 * sizeof(int));
    typedef int Row __attribute__((vector_size(width * sizeof(int))));
    static_assert(sizeof(Rays) == parts * sizeof(Part) && sizeof(Part) == row_count * sizeof(Row));
    for (int part = 0; part < parts; ++part, valid += width) {
        int any = 0;
        for (int i = 0; i < width; ++i)
            any |= valid[i];
        if (!any)
            continue;
        Part narrow;
        char *const from = reinterpret_cast<char *>(&rays) + part * sizeof(Row);
        char *const to = reinterpret_cast<char *>(&narrow);
        const auto copy = [](char *into, const char *row_of) __attribute__((always_inline)) {
            Row row;
            __builtin_memcpy(&row, row_of, sizeof row);
            __builtin_memcpy(into, &row, sizeof row);
        };
        for (int row = 0; row < row_count; ++row)
            if (row < ray_rows || row >= geometry)
                copy(to + row * sizeof(Row), from + row * parts * sizeof(Row));
        trace<function>(valid, scene, query, narrow);
        for (int row = tfar; row < row_count; ++row)
            if (row == tfar || row >= ray_rows)
                copy(from + row * parts * sizeof(Row), to + row * sizeof(Row));
    }
}

} // namespace detail

// `valid`: 16 ints, −1 for active rays; 64-byte aligned, like `rays`.
RT_EMBREE_INLINE void intersect16(const int *valid, RTCScene scene, int packet_width, Query &query,
                                  RTCRayHit16 &rays) {
    if (packet_width == 16)
        detail::trace<rtcIntersect16>(valid, scene, query, rays);
    else if (packet_width == 8)
        detail::trace_in_parts<rtcIntersect8, RTCRayHit8>(valid, scene, query, rays);
    else
        detail::trace_in_parts<rtcIntersect4, RTCRayHit4>(valid, scene, query, rays);
}

RT_EMBREE_INLINE void occluded16(const int *valid, RTCScene scene, int packet_width, Query &query, RTCRay16 &rays) {
    if (packet_width == 16)
        detail::trace<rtcOccluded16>(valid, scene, query, rays);
    else if (packet_width == 8)
        detail::trace_in_parts<rtcOccluded8, RTCRay8>(valid, scene, query, rays);
    else
        detail::trace_in_parts<rtcOccluded4, RTCRay4>(valid, scene, query, rays);
}

} // namespace rt_embree
