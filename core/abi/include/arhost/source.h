/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/source.h: a source produces video frames from a camera, a file or a synthetic sequence.
 */
#ifndef ARHOST_SOURCE_H
#define ARHOST_SOURCE_H

#include "camera.h"
#include "frame.h"
#include "plugin.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Bits of arhost_descriptor.capabilities. */
typedef uint64_t arhost_source_capabilities;
#define ARHOST_SOURCE_CAPABILITY_SEEK 0x1ull /* can start at any frame; frame N is the same for every start */
#define ARHOST_SOURCE_CAPABILITY_LIVE 0x2ull /* a camera; frames not read in time are lost */

typedef struct arhost_source_setup {
    uint32_t struct_size;
    uint32_t reserved;       /* 0 */
    uint64_t first_sequence; /* the first requested frame: 0, or the frame at which a restarted source continues
                                (see arhost_frame_buffer.sequence); live sources ignore it */
    /* Requested frame rate, 1/s; 0: the source's default. A source that is not live delivers frames exactly 1/fps
     * apart or fails with UNSUPPORTED; a live source approximates the rate. The source reports the actual rate in
     * format.fps. */
    double fps;
    int32_t paced; /* Matters only for sources that are not cameras. Non-zero (mode live): deliver frames in real
                      time and drop late frames if necessary. 0 (mode lockstep): deliver every frame, as fast as
                      requested */
    uint32_t reserved_2; /* 0 */
    /* The configured camera, or NULL. A synthetic source renders with this camera; other sources may check that
     * their frames have its size. */
    const arhost_intrinsics *intrinsics;
} arhost_source_setup;

typedef struct arhost_source_properties {
    uint32_t struct_size;         /* set by the worker, which zeroes the other fields */
    int32_t has_intrinsics;       /* non-zero: the source knows its camera and has set `intrinsics` */
    arhost_frame_format format;   /* struct_size is set; fill in with arhost_frame_layout */
    arhost_intrinsics intrinsics; /* for frames with the width and height of `format` */
    uint64_t frame_count;         /* number of frames of the whole sequence; 0: unknown or endless */
} arhost_source_properties;

/* The buffer for a frame. Write every pixel of every plane: the buffer still contains an older frame. Row padding
 * may be left unwritten. */
typedef struct arhost_frame_buffer {
    uint32_t struct_size;
    uint32_t reserved;
    const arhost_frame_format *format;
    uint8_t *plane[ARHOST_MAX_PLANES];
    uint8_t *grey; /* full-range luma for trackers. After `read`, the worker computes it from the planes, unless
                      the source has set has_grey or `grey` is plane 0 */
    /* NULL if !format->has_depth. The rows are format->depth_stride bytes apart. Element x of row y is the depth at
     * pixel (x, y) of the picture: the distance in mm along the camera's optical axis. 0: unknown; 65535: 65,535 mm
     * or more. */
    uint16_t *depth_mm;
    /* The requested frame, as an index into the full sequence of the source. In the first call it is first_sequence;
     * in each later call it is `sequence` + `skipped` + 1 of the previous call. A source that is late may drop
     * frames: it sets `skipped` to their number and delivers frame `sequence` + `skipped`. A restarted source
     * continues after the dropped frames. The host numbers the frames of the video separately, without gaps. Live
     * sources ignore this field. */
    uint64_t sequence;
} arhost_frame_buffer;

/* Results of `read`. Zeroed by the worker except for struct_size. */
typedef struct arhost_frame_info {
    uint32_t struct_size;
    arhost_clock clock; /* required; the same clock for all frames. Cameras use ARHOST_CLOCK_MONOTONIC: the host then
                           measures latency from the capture, otherwise from the arrival of the frame */
    /* Capture time in ns of `clock`; never decreases. With ARHOST_CLOCK_MONOTONIC it is never in the future: if it is
     * more than 1 s ahead, the host rejects the frame and restarts the source. If format.fps is set, frames are on
     * average 1/fps apart, counting skipped frames; live sources may be slower. */
    int64_t capture_ns;
    uint32_t skipped;                   /* frames lost by the device or dropped as late since the previous frame */
    int32_t has_grey;                   /* non-zero: the source has written `grey` */
    int32_t has_truth;                  /* non-zero: `true_mt` is set */
    uint32_t reserved;                  /* 0 */
    char truth_target[ARHOST_MAX_NAME]; /* name of the target of true_mt */
    double true_mt[16]; /* ground truth of the target-to-camera matrix, in the form of arhost_target.mt; set by
                           synthetic sources */
} arhost_frame_info;

typedef struct arhost_source {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */

    /* [worker, created] Called once; opens the device or file. A source that is not live must deliver the same
     * frames and capture times in every run. */
    arhost_status (*start)(arhost_instance *instance, const arhost_source_setup *setup,
                           arhost_source_properties *properties);

    /* [worker, started] Waits for the next frame, polls host->cancelled meanwhile, and writes the frame to `buffer`.
     * Returns ARHOST_STATUS_OK or an error; after the last frame, this call and every later one return
     * ARHOST_STATUS_END. If the input is truncated, returns ARHOST_STATUS_END_TRUNCATED after the last readable frame
     * and logs a warning with the position of the damage. */
    arhost_status (*read)(arhost_instance *instance, const arhost_frame_buffer *buffer, arhost_frame_info *info);

    /* [worker, started] Called once, after a successful `start`. */
    void (*stop)(arhost_instance *instance);
} arhost_source;

#ifdef __cplusplus
}
#endif
#endif
