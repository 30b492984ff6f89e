/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/tracker.h: finds markers in frames.
 *
 * A marker's frame of reference is at its centre: x right, y up along the print, z out of the paper, as
 * seen when the print is upright; millimetres. Its corners are in the order top-left, top-right,
 * bottom-right, bottom-left of the upright print, so with half side s they lie at
 * (−s, s, 0), (s, s, 0), (s, −s, 0), (−s, −s, 0). For AprilTag families "upright" is as AprilTag's
 * own library has it; for ArUco dictionaries as OpenCV draws them.
 */
#ifndef ARHOST_TRACKER_H
#define ARHOST_TRACKER_H

#include "camera.h"
#include "frame.h"
#include "plugin.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { ARHOST_MAX_MARKERS = 64, ARHOST_MAX_FAMILY = 32 };

/* A marker that the configuration lists. */
typedef struct arhost_marker_config {
    uint32_t struct_size;
    int32_t id;
    double side_mm; /* outer side of the black square (of the part that the corners bound), > 0 */
} arhost_marker_config;

typedef int32_t arhost_marker_state;
enum {
    ARHOST_MARKER_DETECTED = 1,  /* seen in this frame, and all that is told of it is of this frame alone */
    ARHOST_MARKER_PREDICTED = 2, /* its pose is a motion model's: smoothed where it is seen (age_frames 0),
                                    carried forward where it is not */
    ARHOST_MARKER_LOST = 3       /* not seen, no pose: `mt` is the last one known */
};

typedef struct arhost_marker {
    uint32_t struct_size;
    int32_t id;
    char family[ARHOST_MAX_FAMILY]; /* "tag36h11", "DICT_6X6_250" */
    arhost_marker_state state;
    uint32_t age_frames; /* since it was last seen; 0 where state is DETECTED */
    double corners_px[4][2];
    /* Marker-to-camera, column-major, GL eye space: x right, y up, looking along −z; millimetres.
     * Rotation orthonormal to 1e-9, last row 0 0 0 1. */
    double mt[16];
    double mt_alternative[16]; /* the other solution of the planar pose, all 0 where there is none */
    double reprojection_px;    /* RMS over the corners, distorted pixels */
    double ambiguity;          /* reprojection_px / that of mt_alternative, 0 (sure) to 1 (either) */
} arhost_marker;

typedef struct arhost_tracker_setup {
    uint32_t struct_size;
    uint32_t marker_count; /* at least 1 */
    const arhost_frame_format *format;
    const arhost_intrinsics *intrinsics; /* of the frames: same width and height */
    const arhost_marker_config *markers; /* marker_count of them, ids unique */
} arhost_tracker_setup;

typedef struct arhost_tracker_result {
    uint32_t struct_size;
    uint32_t marker_count; /* set by the tracker */
    arhost_marker markers[ARHOST_MAX_MARKERS];
} arhost_tracker_result;

typedef struct arhost_tracker {
    uint32_t struct_size;

    /* [worker] Once after create. ARHOST_STATUS_ERROR_CONFIGURATION where an id is not in the dictionary; that or
     * ARHOST_STATUS_ERROR_UNSUPPORTED where the lens is of a model, or of a count of coefficients, that it can't do.
     */
    arhost_status (*start)(arhost_instance *instance, const arhost_tracker_setup *setup);

    /* [worker] Finds the listed markers and no others, in the order of the setup's list. Those not
     * found are left out. The frame is read-only and may be gone after the call. `result` comes zeroed
     * but for struct_size. ARHOST_STATUS_OK also when none is found.
     * What is DETECTED, and the bytes of its record, depend on the frame's pixels alone: not on frames before,
     * its number, its time, or threads. So a tracker that is killed and started again goes on as if nothing
     * had happened. One that smooths or predicts tells that as PREDICTED, which depends on the frames since
     * start, and has settled once a marker stands still for 60 frames; the same frames give the same bytes.
     * Frames may be missing, come twice, or be older than the last. */
    arhost_status (*track)(arhost_instance *instance, const arhost_frame *frame, arhost_tracker_result *result);

    /* [worker] Once before destroy, if start succeeded. */
    void (*stop)(arhost_instance *instance);
} arhost_tracker;

#ifdef __cplusplus
}
#endif
#endif
