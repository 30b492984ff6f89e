// SPDX-License-Identifier: Apache-2.0
//
// What differs between Embree 3 (Debian 12) and Embree 4.
#pragma once

#if __has_include(<embree4/rtcore.h>) && !defined(ARHOST_EMBREE_3)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

// Always, since the kernels are compiled for several instruction sets and must not share a copy.
#define RT_EMBREE_INLINE inline __attribute__((always_inline))

namespace rt_embree {

// What goes along with the rays of one call. The callbacks of geometries get it back.
struct Query {
#if RTC_VERSION_MAJOR >= 4
    RTCRayQueryContext context;
    RTCRayQueryFlags flags;
#else
    RTCIntersectContext context;
#endif
    bool cull_catchers_facing_away;
};

enum class Coherence { coherent, incoherent };

RT_EMBREE_INLINE Query make_query(Coherence coherence, bool cull_catchers_facing_away = false) {
    Query query;
    query.cull_catchers_facing_away = cull_catchers_facing_away;
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

// valid: 16 ints, −1 for the rays that are to be traced.
RT_EMBREE_INLINE void intersect16(const int *valid, RTCScene scene, Query &query, RTCRayHit16 &rays) {
#if RTC_VERSION_MAJOR >= 4
    RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    arguments.flags = query.flags;
    arguments.context = &query.context;
    rtcIntersect16(valid, scene, &rays, &arguments);
#else
    rtcIntersect16(valid, scene, &query.context, &rays);
#endif
}

RT_EMBREE_INLINE void occluded16(const int *valid, RTCScene scene, Query &query, RTCRay16 &rays) {
#if RTC_VERSION_MAJOR >= 4
    RTCOccludedArguments arguments;
    rtcInitOccludedArguments(&arguments);
    arguments.flags = query.flags;
    arguments.context = &query.context;
    rtcOccluded16(valid, scene, &rays, &arguments);
#else
    rtcOccluded16(valid, scene, &query.context, &rays);
#endif
}

} // namespace rt_embree
