/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/tracker.h: a tracker finds targets in frames.
 *
 * A target is a rigid object with a name whose pose the application needs: a marker, a map of several markers (a
 * board, a box), or a body that the tracker knows by name.
 *
 * Most trackers are detectors: they report observations, the markers in a frame with their corners. The worker
 * computes the poses of the targets from them, with their covariances, and follows them from frame to frame. A
 * tracker with ARHOST_TRACKER_CAPABILITY_REPORTS_POSES, such as a motion-capture client, reports the poses of bodies
 * itself.
 *
 * Marker coordinates: origin at the centre; x right, y up on the upright print, z out of the paper; millimetres.
 * Corners are ordered top-left, top-right, bottom-right, bottom-left on the upright print; with s = half of the side
 * length, their coordinates are (−s, s, 0), (s, s, 0), (s, −s, 0), (−s, −s, 0). "Upright" is defined by the AprilTag
 * library for its families, and by OpenCV's drawing functions for ArUco dictionaries. The coordinates of a target
 * that consists of a single marker are those of the marker.
 */
#ifndef ARHOST_TRACKER_H
#define ARHOST_TRACKER_H

#include "camera.h"
#include "frame.h"
#include "plugin.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    ARHOST_MAX_TARGETS = 1024,
    ARHOST_MAX_MARKERS = 1024, /* maximum number of markers of all targets together */
    ARHOST_MAX_OBSERVATIONS = 1024,
    ARHOST_MAX_FAMILIES = 16,
    ARHOST_MAX_FAMILY = 32, /* name of a family, with the terminating NUL */
    ARHOST_MAX_STATE = 16777216
};

/* Bits of arhost_descriptor.capabilities. */
typedef uint64_t arhost_tracker_capabilities;
#define ARHOST_TRACKER_CAPABILITY_REPORTS_POSES 0x1ull /* reports the poses of bodies (arhost_body_pose) */

/* A target listed in the configuration. */
typedef struct arhost_target_config {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */
    const char *name;  /* unique */
    const char *body; /* the body that a tracker with ARHOST_TRACKER_CAPABILITY_REPORTS_POSES has to follow; NULL: the
                         target consists of markers */
} arhost_target_config;

/* A marker of a target. */
typedef struct arhost_marker_config {
    uint32_t struct_size;
    int32_t id;              /* unique within its family */
    uint32_t family;         /* index in arhost_tracker_setup.families */
    uint32_t target;         /* index in arhost_tracker_setup.targets */
    double corners_mm[4][3]; /* in the target's coordinates; they form a plane convex quadrilateral */
    const char *file;     /* path of the file that defines the print; NULL if the family defines the print by the id.
                             Family "pattern": an ARToolKit pattern file. Family "image": a picture; `corners_mm` then
                             describe a square as wide as the picture (see arhost_tracker.aspect) */
    double pattern_ratio; /* side of the pattern, without its black border, relative to that of the square; 0 if
                             `file` is NULL */
} arhost_marker_config;

typedef struct arhost_tracker_setup {
    uint32_t struct_size;
    uint32_t target_count; /* at least 1 */
    const arhost_frame_format *format;
    const arhost_intrinsics *intrinsics; /* intrinsics of the camera; width and height are those of the frames */
    const arhost_target_config *targets;
    const arhost_marker_config *markers;
    uint32_t marker_count;
    uint32_t family_count;
    const char *const *families; /* names of the markers' families and dictionaries: "tag36h11", "DICT_6X6_250" */
} arhost_tracker_setup;

/* A marker seen in a frame. */
typedef struct arhost_observation {
    uint32_t struct_size;
    int32_t id;
    uint32_t family;         /* index in arhost_tracker_setup.families */
    uint32_t hamming;        /* bits of the code that were corrected */
    double corners_px[4][2]; /* in pixels of the distorted frame */
    double decision_margin;  /* how clearly the bits were read, >= 0, on a scale that the tracker chooses: larger is
                                better; 0: unknown */
    double corner_sigma_px; /* standard deviation of the noise of each coordinate of corners_px, >= 0; 0: unknown. The
                               worker computes the covariance of a target with a single marker from it */
    double false_positive_rate; /* the probability that a square with random bits reads as this marker, with at most
                                   `hamming` corrected bits: 0 to 1; 0: negligible or unknown; 1: the sighting is no
                                   evidence. The worker reports a target only when it is very improbable that all its
                                   sightings are false */
    double projected_px[4][2];  /* set by the worker, for sinks: the projection of the marker's corners with the pose
                                   of its target; all 0 if there is no projection */
} arhost_observation;

typedef int32_t arhost_target_state;
enum {
    ARHOST_TARGET_DETECTED = 1, /* seen in this frame */
    /* The pose comes from the motion model of a tracker that reports poses: a smoothed pose if the target was seen in
     * this frame (age_frames 0), otherwise an extrapolated one. */
    ARHOST_TARGET_PREDICTED = 2,
    ARHOST_TARGET_LOST = 3 /* not seen, pose unknown; `mt` is the last known pose */
};

/* The pose of a body, from a tracker with ARHOST_TRACKER_CAPABILITY_REPORTS_POSES. The fields are those of
 * arhost_target. */
typedef struct arhost_body_pose {
    uint32_t struct_size;
    uint32_t target; /* index in arhost_tracker_setup.targets, of a target with a `body` */
    arhost_target_state state;
    uint32_t age_frames;
    double mt[16];
    double covariance[36];
} arhost_body_pose;

/* The buffers for the results of `track`. The `struct_size` of each element is set; write all other fields, except
 * `projected_px`. */
typedef struct arhost_tracker_result {
    uint32_t struct_size;
    uint32_t observation_count;       /* 0; set by the tracker, at most ARHOST_MAX_OBSERVATIONS */
    arhost_observation *observations; /* ARHOST_MAX_OBSERVATIONS elements */
    arhost_body_pose *poses;          /* arhost_tracker_setup.target_count elements */
    uint32_t pose_count;              /* 0; set by a tracker with ARHOST_TRACKER_CAPABILITY_REPORTS_POSES */
    /* -1: unknown; set by the tracker. Number of quadrilaterals that the tracker has examined, including those that
     * turned out not to be markers; at least observation_count. From this number, the host can tell the user whether
     * the tracker saw no quadrilateral or recognised none as a marker. */
    int32_t candidate_count;
} arhost_tracker_result;

/* A target as the outputs receive it (arhost/sink.h). */
typedef struct arhost_target {
    uint32_t struct_size;
    arhost_target_state state;
    char name[ARHOST_MAX_NAME];
    uint32_t age_frames;        /* frames since the target was last seen; 0 if DETECTED */
    uint32_t first_observation; /* index of the target's first observation in arhost_record.observations */
    uint32_t observation_count; /* number of the target's observations in this frame; they are consecutive */
    uint32_t reserved;          /* 0 */
    /* Target-to-camera matrix, column-major, OpenGL eye space: x right, y up, looking along −z; millimetres. The
     * rotation is orthonormal to 1e-9, the last row is 0 0 0 1. */
    double mt[16]; /* with tracker.filter, mt and projected_px are filtered; the fields below are not */
    /* The second solution of the planar pose problem; all 0 if there is none. `mt` is the solution that continues the
     * motion of the earlier frames; in the first frame, the solution with the smaller error. */
    double mt_alternative[16];
    /* Covariance of translation (mm) and rotation (rad), row-major, in the axes of `mt`: the true pose is
     * {exp(r)·R, t + d} with (d, r) from this distribution. All 0: unknown. */
    double covariance[36];
    double reprojection_px; /* RMS reprojection error of the corners, in pixels of the distorted frame, without
                               outliers; 0 for a body */
    double ambiguity;       /* reprojection error of `mt` divided by that of `mt_alternative`, at most 1; 0 if `mt` is
                               unambiguous */
} arhost_target;

/* Where a marker is expected in a frame. */
typedef struct arhost_expected_marker {
    uint32_t struct_size;
    uint32_t marker;         /* index in arhost_tracker_setup.markers */
    double corners_px[4][2]; /* may be outside of the frame */
    double margin_px;        /* probable upper bound of the error of corners_px */
} arhost_expected_marker;

/* The input of `track`. */
typedef struct arhost_track_request {
    uint32_t struct_size;
    /* 0: to save time, a detector may search only where markers are expected. Non-zero: search the whole frame. The
     * worker requests this if no marker is expected, after a target was lost, and at regular intervals. */
    int32_t search_everywhere;
    const arhost_frame *frame; /* read-only */
    /* Memory of the tracker that survives the end of the worker process, because the host keeps it. Both pointers are
     * aligned to 64 bytes; both are NULL if `state_size` is 0. `state_before`, read-only: the `state_after` of the
     * last accepted call, even if another worker process made that call. NULL in the first frame, and after a swap to
     * another tracker, a fallback, or a restart with another version or another state_size. `state_after`: its
     * initial content is undefined; write it completely, even if nothing is detected. The host discards it if the
     * call fails, and may discard it even if the call succeeds. */
    const void *state_before;
    void *state_after;
    uint64_t state_size; /* bytes of each; 0 if both are NULL */
    /* The markers that the worker expects in this frame, from the motion of their targets in earlier frames. */
    const arhost_expected_marker *expected;
    uint32_t expected_count;
    uint32_t reserved; /* 0 */
} arhost_track_request;

typedef struct arhost_tracker {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */

    /* [worker, created] Called once. Returns ARHOST_STATUS_ERROR_CONFIGURATION if the tracker does not know a family
     * or body, or if a family has no marker with a listed id. Returns ARHOST_STATUS_ERROR_CONFIGURATION or
     * ARHOST_STATUS_ERROR_UNSUPPORTED if the tracker does not support the lens model or its number of coefficients.
     */
    arhost_status (*start)(arhost_instance *instance, const arhost_tracker_setup *setup);

    /* [worker, started] Reports each visible marker of the setup's families once. If several markers with the same id
     * are visible, reports all of them. Markers that no target lists may be omitted; if they are reported, the host
     * can tell the user which markers are visible instead of the listed ones. Returns ARHOST_STATUS_OK even if no
     * marker is visible. The result and `state_after` depend only on the request, not on earlier calls or the number
     * of threads, so a restarted tracker continues with identical results. Frames may be missing or repeated, and a
     * frame may be older than the previous one. */
    arhost_status (*track)(arhost_instance *instance, const arhost_track_request *request,
                           arhost_tracker_result *result);

    /* [worker, started] Called once, after a successful `start`. */
    void (*stop)(arhost_instance *instance);

    /* [worker, started] Optional; NULL: no memory. Called once, after `start`. Returns the size in bytes of the
     * memory that the tracker needs from frame to frame (arhost_track_request.state_before), at most
     * ARHOST_MAX_STATE. */
    uint64_t (*state_size)(arhost_instance *instance);

    /* [worker, started] Optional; NULL: all pictures are square. Called after `start` for each marker of the family
     * "image". Returns the height of the picture divided by its width. The worker scales the marker's corners_mm
     * along y accordingly. */
    double (*aspect)(arhost_instance *instance, uint32_t marker);
} arhost_tracker;

#ifdef __cplusplus
}
#endif
#endif
