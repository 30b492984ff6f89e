/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/source.h: produces video frames: a camera, a file, a synthetic sequence.
 */
#ifndef ARHOST_SOURCE_H
#define ARHOST_SOURCE_H

#include "camera.h"
#include "frame.h"
#include "plugin.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct arhost_source_setup {
    uint32_t struct_size;
    uint32_t reserved;       /* 0 */
    uint64_t first_sequence; /* the first requested frame: 0, or where a restarted source continues (see
                                arhost_frame_buffer.sequence); live sources ignore it */
    /* Requested frame rate, 1/s; 0: the source's default. A source that is not live delivers frames exactly 1/fps
     * apart or fails with UNSUPPORTED; a live one approximates it. The actual rate is format.fps. */
    double fps;
    int32_t paced; /* non-zero (mode live): a source other than a camera delivers frames in real time at its fps
                      and may drop late ones; 0 (lockstep): every frame, as fast as requested */
    /* The configured camera, or NULL. A synthetic source renders with it; others may check that their frames match
     * its size. */
    const arhost_intrinsics *intrinsics;
} arhost_source_setup;

typedef struct arhost_source_properties {
    uint32_t struct_size;         /* set by the worker; everything else is zeroed */
    int32_t has_intrinsics;       /* non-zero: `intrinsics` is set, the source knows its camera */
    arhost_frame_format format;   /* struct_size is set; fill in with arhost_frame_layout */
    arhost_intrinsics intrinsics; /* for frames of the format's size */
    uint64_t frame_count;         /* of the whole sequence; 0: unknown or endless */
} arhost_source_properties;

/* The buffer for a frame. Write every pixel of every plane: the buffer holds the data of an older frame. Row padding
 * may be left unwritten. */
typedef struct arhost_frame_buffer {
    uint32_t struct_size;
    uint32_t reserved;
    const arhost_frame_format *format;
    uint8_t *plane[ARHOST_MAX_PLANES];
    uint8_t *grey; /* full-range luma for trackers. The worker fills it in after `read`, unless the source sets
                      has_grey or this is plane 0 */
    /* The requested frame, as an index into the source's full sequence: first_sequence at first, then `sequence` +
     * skipped + 1 of the previous call. A late source that drops `skipped` frames delivers frame `sequence` +
     * skipped, so after a restart it continues after the dropped frames. The host numbers the video's frames
     * separately, without gaps. Live sources ignore this field. */
    uint64_t sequence;
} arhost_frame_buffer;

/* Results of `read`. Zeroed by the worker except for struct_size. */
typedef struct arhost_frame_info {
    uint32_t struct_size;
    arhost_clock clock; /* required; the same for all frames */
    /* Capture time, ns of `clock`; never decreases. With ARHOST_CLOCK_MONOTONIC never in the future: the host rejects
     * a frame more than 1 s ahead and restarts the source. If format.fps is set, the mean interval is about 1/fps,
     * counting skipped frames; live sources may be slower. */
    int64_t capture_ns;
    uint32_t skipped;   /* frames lost by the device or dropped as late since the previous frame */
    int32_t has_grey;   /* non-zero: the source has written `grey` */
    int32_t has_truth;  /* non-zero: `true_mt` is set */
    int32_t truth_id;   /* id of the marker of true_mt */
    double true_mt[16]; /* ground truth marker-to-camera matrix, as arhost_marker.mt (synthetic sources) */
} arhost_frame_info;

typedef struct arhost_source {
    uint32_t struct_size;

    /* [worker, created] Called once; opens the device or file. A source that is not live delivers identical frames
     * and capture times in every run. */
    arhost_status (*start)(arhost_instance *instance, const arhost_source_setup *setup,
                           arhost_source_properties *properties);

    /* [worker, started] Waits for the next frame, polling host->cancelled, and writes it. Returns ARHOST_STATUS_OK,
     * an error, or ARHOST_STATUS_END after the last frame and in every later call. A truncated file ends with
     * ARHOST_STATUS_END_TRUNCATED after the last readable frame, and a warning in the log that says where. */
    arhost_status (*read)(arhost_instance *instance, const arhost_frame_buffer *buffer, arhost_frame_info *info);

    /* [worker, started] Called once, after a successful `start`. */
    void (*stop)(arhost_instance *instance);
} arhost_source;

#ifdef __cplusplus
}
#endif
#endif
