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

enum { ARHOST_MAX_MARKERS = 64, ARHOST_MAX_FAMILY = 32, ARHOST_MAX_STATE = 16777216 };

/* A marker listed in the configuration. */
typedef struct arhost_marker_config {
    uint32_t struct_size;
    int32_t id;
    double side_mm; /* side of the black square, the distance between adjacent reported corners; > 0 */
} arhost_marker_config;

typedef int32_t arhost_marker_state;
enum {
    ARHOST_MARKER_DETECTED = 1,  /* detected in this frame; both poses computed from this frame alone */
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
    double mt_alternative[16]; /* the second solution of the planar pose problem; all 0 if there is none. A tracker
                                  reports the one with the smaller error as `mt`. Afterwards its worker may exchange
                                  the two, if motion and errors of several frames speak for the other one. */
    double reprojection_px;    /* RMS reprojection error of the corners, in pixels of the distorted frame */
    double ambiguity; /* reprojection error of `mt` divided by that of `mt_alternative`, at most 1: 0 if `mt` is
                         unambiguous, 1 if both are equally likely, or exchanged */
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

/* The input of `track`. */
typedef struct arhost_track_request {
    uint32_t struct_size;
    uint32_t reserved;         /* 0 */
    const arhost_frame *frame; /* read-only */
    /* The memory of a tracker whose `state_size` is not 0; otherwise both are NULL. The host keeps it, so it survives
     * the end of the worker process. Both are aligned to 64 bytes.
     * `state_before`, read-only: the `state_after` of the last accepted call, also by a worker that has ended. NULL
     * in the first frame, and after a swap to another tracker, a fallback, or a restart with another version or
     * another state_size. `state_after`: to be written completely, also if nothing is detected. Its initial content
     * is undefined. It is discarded if the call fails, and may be discarded even if it succeeds. */
    const void *state_before;
    void *state_after;
    uint64_t state_size; /* bytes of each; 0 if both are NULL */
} arhost_track_request;

typedef struct arhost_tracker {
    uint32_t struct_size;

    /* [worker, created] Called once. Returns ARHOST_STATUS_ERROR_CONFIGURATION if a marker id is not in the
     * dictionary. Returns ARHOST_STATUS_ERROR_CONFIGURATION or ARHOST_STATUS_ERROR_UNSUPPORTED if the tracker does
     * not support the lens model or its number of coefficients. */
    arhost_status (*start)(arhost_instance *instance, const arhost_tracker_setup *setup);

    /* [worker, started] Reports the markers of the setup's list that it finds, in the order of that list, and no
     * others. `result` is zeroed except for struct_size. Returns ARHOST_STATUS_OK even if no marker is found.
     * The result and `state_after` depend only on the frame and `state_before`, not on earlier calls or the number of
     * threads, so a restarted tracker continues with identical results. A DETECTED record depends only on the pixels
     * of the frame. A tracker that smooths or predicts poses reports PREDICTED records, which must converge within 60
     * frames after a marker has come to rest. Frames may be missing or repeated, and a frame may be older than the
     * previous one. */
    arhost_status (*track)(arhost_instance *instance, const arhost_track_request *request,
                           arhost_tracker_result *result);

    /* [worker, started] Called once, after a successful `start`. */
    void (*stop)(arhost_instance *instance);

    /* [worker, started] Optional; NULL: 0. Called once, after `start`. Returns the size in bytes of the memory that
     * the tracker needs from frame to frame (arhost_track_request.state_before), at most ARHOST_MAX_STATE. */
    uint64_t (*state_size)(arhost_instance *instance);
} arhost_tracker;

#ifdef __cplusplus
}
#endif
#endif
