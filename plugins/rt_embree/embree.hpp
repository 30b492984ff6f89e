// SPDX-License-Identifier: Apache-2.0
//
// Hides the differences between the interfaces of Embree 3 (in Debian 12) and Embree 4.
#pragma once

#if __has_include(<embree4/rtcore.h>) && !defined(ARHOST_EMBREE_3)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <cstddef>
#include <cstdint>
#include <type_traits>

// These functions must always be inlined: the kernel is compiled once per instruction set, and the copies must not
// share code.
#define RT_EMBREE_INLINE inline __attribute__((always_inline))

namespace rt_embree {

// The context of one call of Embree, which passes it to the geometries' filter callbacks.
struct Query {
#if RTC_VERSION_MAJOR >= 4
    RTCRayQueryContext context;
    RTCRayQueryFlags flags;
#else
    RTCIntersectContext context;
#endif
    bool cull_catcher_back_faces;
    std::uint32_t random_seed; // see random_of() in hit_filter.cpp
};

// Bits of RTCRay::flags.
enum RayFlag : unsigned {
    ray_of_eye = 1 // from the eye, scattered only by mirrors and glass
};
// The eye does not see points of a lower opacity.
inline constexpr float least_opacity = 1.0f / 512;

enum class Coherence { coherent, incoherent };

RT_EMBREE_INLINE Query make_query(Coherence coherence, bool cull_catcher_back_faces = false) {
    Query query;
    query.cull_catcher_back_faces = cull_catcher_back_faces;
    query.random_seed = 0;
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

// Returns the number of rays in Embree's native packets on this processor. Wider packets are slow: Embree 4 splits
// them into single rays, and Embree 3 into streams that also trace the inactive rays.
inline int native_packet_width(RTCDevice device) {
    return rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)  ? 16
           : rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) ? 8
                                                                                     : 4;
}

namespace detail {

// Calls `function`, which is an rtcIntersect<n> or rtcOccluded<n>.
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

// Traces a packet of 16 rays in narrower packets of type Part. A packet consists of rows of 4-byte values, with one
// value per ray. Only the rows that Embree reads (the ray, and the hit from geomID on) are copied to the narrow
// packet, and only the rows that it writes (tfar and the hit) are copied back. Each row is copied as one register,
// because the processor cannot forward two stores to one load.
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

// Finds the closest hits of 16 rays. `valid`: 16 ints, −1 for active rays and 0 for others. Both `valid` and `rays`
// must be aligned to 64 bytes.
RT_EMBREE_INLINE void intersect16(const int *valid, RTCScene scene, int packet_width, Query &query,
                                  RTCRayHit16 &rays) {
    if (packet_width == 16)
        detail::trace<rtcIntersect16>(valid, scene, query, rays);
    else if (packet_width == 8)
        detail::trace_in_parts<rtcIntersect8, RTCRayHit8>(valid, scene, query, rays);
    else
        detail::trace_in_parts<rtcIntersect4, RTCRayHit4>(valid, scene, query, rays);
}

// Sets `tfar` of the active rays that hit anything to −∞.
RT_EMBREE_INLINE void occluded16(const int *valid, RTCScene scene, int packet_width, Query &query, RTCRay16 &rays) {
    if (packet_width == 16)
        detail::trace<rtcOccluded16>(valid, scene, query, rays);
    else if (packet_width == 8)
        detail::trace_in_parts<rtcOccluded8, RTCRay8>(valid, scene, query, rays);
    else
        detail::trace_in_parts<rtcOccluded4, RTCRay4>(valid, scene, query, rays);
}

} // namespace rt_embree
