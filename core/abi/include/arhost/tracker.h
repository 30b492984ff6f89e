/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/tracker.h: detects markers in frames and estimates their poses.
 *
 * Marker coordinates: origin at the centre; x right, y up on the upright print, z out of the paper; millimetres.
 * Corners are ordered top-left, top-right, bottom-right, bottom-left on the upright print; for a half side s they are
 * (−s, s, 0), (s, s, 0), (s, −s, 0), (−s, −s, 0). "Upright" is defined by the AprilTag library for its families, and
 * by OpenCV's drawing functions for ArUco dictionaries.
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

/* A marker listed in the configuration. */
typedef struct arhost_marker_config {
    uint32_t struct_size;
    int32_t id;
    double side_mm; /* side of the black square, between the reported corners; > 0 */
} arhost_marker_config;

typedef int32_t arhost_marker_state;
enum {
    ARHOST_MARKER_DETECTED = 1,  /* detected in this frame; the record depends on this frame alone */
    ARHOST_MARKER_PREDICTED = 2, /* pose from a motion model: smoothed if detected in this frame
                                    (age_frames 0), extrapolated otherwise */
    ARHOST_MARKER_LOST = 3       /* not detected, no pose; `mt` is the last known one */
};

typedef struct arhost_marker {
    uint32_t struct_size;
    int32_t id;
    char family[ARHOST_MAX_FAMILY]; /* "tag36h11", "DICT_6X6_250" */
    arhost_marker_state state;
    uint32_t age_frames; /* frames since the last detection; 0 if DETECTED */
    double corners_px[4][2];
    /* Marker-to-camera matrix, column-major, OpenGL eye space: x right, y up, looking along −z; millimetres. The
     * rotation is orthonormal to 1e-9, the last row is 0 0 0 1. */
    double mt[16];
    double mt_alternative[16]; /* the second solution of the planar pose; all 0 if there is none */
    double reprojection_px;    /* RMS over the corners, in distorted pixels */
    double ambiguity;          /* reprojection_px / that of mt_alternative: 0 unambiguous, 1 equally likely */
} arhost_marker;

typedef struct arhost_tracker_setup {
    uint32_t struct_size;
    uint32_t marker_count; /* at least 1 */
    const arhost_frame_format *format;
    const arhost_intrinsics *intrinsics; /* of the frames, with their width and height */
    const arhost_marker_config *markers; /* marker_count elements, unique ids */
} arhost_tracker_setup;

typedef struct arhost_tracker_result {
    uint32_t struct_size;
    uint32_t marker_count; /* set by the tracker */
    arhost_marker markers[ARHOST_MAX_MARKERS];
} arhost_tracker_result;

typedef struct arhost_tracker {
    uint32_t struct_size;

    /* [worker, created] Called once. Fails with ARHOST_STATUS_ERROR_CONFIGURATION if an id is not in the dictionary;
     * with that or ARHOST_STATUS_ERROR_UNSUPPORTED if the lens model or its number of coefficients is not supported.
     */
    arhost_status (*start)(arhost_instance *instance, const arhost_tracker_setup *setup);

    /* [worker, started] Reports the listed markers that it finds, in the order of the setup's list, and no others.
     * `result` is zeroed except for struct_size. The frame is read-only and valid only during the call. Returns
     * ARHOST_STATUS_OK even if no marker is found.
     * A DETECTED record depends on the frame's pixels alone, not on earlier frames, sequence number, time or threads,
     * so a tracker that is killed and restarted continues with identical results. A tracker that smooths or predicts
     * reports PREDICTED records, which may depend on all frames since `start`; they are deterministic too, and
     * converge within 60 frames once a marker stands still. Frames may be missing, repeated, or older than the
     * previous one. */
    arhost_status (*track)(arhost_instance *instance, const arhost_frame *frame, arhost_tracker_result *result);

    /* [worker, started] Called once, after a successful `start`. */
    void (*stop)(arhost_instance *instance);
} arhost_tracker;

#ifdef __cplusplus
}
#endif
#endif
