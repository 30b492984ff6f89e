/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/tracker.h: a tracker detects markers in frames and estimates their poses.
 *
 * Marker coordinates: origin at the centre; x right, y up on the upright print, z out of the paper; millimetres.
 * Corners are ordered top-left, top-right, bottom-right, bottom-left on the upright print; with s = half of the side
 * length, their coordinates are (−s, s, 0), (s, s, 0), (s, −s, 0), (−s, −s, 0). "Upright" is defined by the AprilTag
 * library for its families, and by OpenCV's drawing functions for ArUco dictionaries.
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
    double side_mm; /* side of the black square, the distance between adjacent reported corners; > 0 */
} arhost_marker_config;

typedef int32_t arhost_marker_state;
enum {
    ARHOST_MARKER_DETECTED = 1,  /* detected in this frame; pose computed from this frame alone */
    ARHOST_MARKER_PREDICTED = 2, /* pose from a motion model: smoothed if the marker was detected in this
                                    frame (age_frames 0), extrapolated otherwise */
    ARHOST_MARKER_LOST = 3       /* not detected, pose unknown; `mt` is the last known pose */
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
    double mt_alternative[16]; /* the second solution of the planar pose problem; all 0 if there is none */
    double reprojection_px;    /* RMS reprojection error of the corners, in pixels of the distorted frame */
    double ambiguity;          /* reprojection error of `mt` divided by that of `mt_alternative`: 0 if `mt` is
                                  unambiguous, 1 if both are equally likely */
} arhost_marker;

typedef struct arhost_tracker_setup {
    uint32_t struct_size;
    uint32_t marker_count; /* at least 1 */
    const arhost_frame_format *format;
    const arhost_intrinsics *intrinsics; /* of the camera; width and height are those of the frames */
    const arhost_marker_config *markers; /* marker_count elements, unique ids */
} arhost_tracker_setup;

typedef struct arhost_tracker_result {
    uint32_t struct_size;
    uint32_t marker_count; /* set by the tracker */
    arhost_marker markers[ARHOST_MAX_MARKERS];
} arhost_tracker_result;

typedef struct arhost_tracker {
    uint32_t struct_size;

    /* [worker, created] Called once. Returns ARHOST_STATUS_ERROR_CONFIGURATION if a marker id is not in the
     * dictionary. Returns ARHOST_STATUS_ERROR_CONFIGURATION or ARHOST_STATUS_ERROR_UNSUPPORTED if the tracker does
     * not support the lens model or its number of coefficients. */
    arhost_status (*start)(arhost_instance *instance, const arhost_tracker_setup *setup);

    /* [worker, started] Reports the markers of the setup's list that it finds, in the order of that list, and no
     * others. `result` is zeroed except for struct_size. The frame is read-only and valid only during the call.
     * Returns ARHOST_STATUS_OK even if no marker is found. A DETECTED record depends only on the pixels of the frame,
     * not on earlier frames, sequence number, time or number of threads, so a restarted tracker continues with
     * identical results. A tracker that smooths or predicts poses reports PREDICTED records. These may depend on all
     * frames since `start`, but must be deterministic, too, and converge within 60 frames after a marker has come to
     * rest. Frames may be missing or repeated, and a frame may be older than the previous one. */
    arhost_status (*track)(arhost_instance *instance, const arhost_frame *frame, arhost_tracker_result *result);

    /* [worker, started] Called once, after a successful `start`. */
    void (*stop)(arhost_instance *instance);
} arhost_tracker;

#ifdef __cplusplus
}
#endif
#endif
