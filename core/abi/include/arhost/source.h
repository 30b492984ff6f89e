/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/source.h: gives frames: a camera, a file, a synthetic sequence.
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
    uint64_t first_sequence; /* the frame that is asked for first: 0, or where a restarted source goes on (see
                                arhost_frame_buffer.sequence); a live one ignores it */
    /* Asked for by the configuration; 0: the source's own. One that is not live gives its frames 1/fps apart or
     * refuses (UNSUPPORTED); a live one comes as near as it can. The format's fps tells what it gives. */
    double fps;
    int32_t paced; /* non-zero (mode live): a source that is no camera gives its frames in real
                      time, at its fps, and may leave out those that it is late for; 0
                      (lockstep): every frame, as fast as they are asked for */
    /* The camera that the configuration names, or NULL. A synthetic source takes it as its own; a real
     * one may check that its frames have that size. */
    const arhost_intrinsics *intrinsics;
} arhost_source_setup;

typedef struct arhost_source_properties {
    uint32_t struct_size;         /* set by the worker; all else comes zeroed */
    int32_t has_intrinsics;       /* non-zero where the source knows its own camera */
    arhost_frame_format format;   /* with its struct_size set; laid out by arhost_frame_layout */
    arhost_intrinsics intrinsics; /* of these frames: their size is its size */
    uint64_t frame_count;         /* of the whole sequence; 0: unknown or endless */
} arhost_source_properties;

/* Where `read` puts a frame. Every pixel of its planes is to be written: a byte that is not keeps some older
 * frame's value. Bytes of a row past its pixels may be left. */
typedef struct arhost_frame_buffer {
    uint32_t struct_size;
    uint32_t reserved;
    const arhost_frame_format *format;
    uint8_t *plane[ARHOST_MAX_PLANES];
    uint8_t *grey; /* full-range luma for trackers. The worker fills it after read, unless the source
                      sets has_grey, or it is plane 0 */
    /* The frame that is asked for, by the source's own count, which has no gaps: first_sequence, and after each
     * frame that was given that one's + 1 + what it told as skipped. A source that leaves frames out, being late,
     * gives the frame `sequence` + skipped; so after a restart it goes on behind what it has left out. The
     * video's frames bear numbers of the host's, in which nothing is left out. A live source ignores it. */
    uint64_t sequence;
} arhost_frame_buffer;

/* What `read` tells of the frame. Comes zeroed but for struct_size. */
typedef struct arhost_frame_info {
    uint32_t struct_size;
    arhost_clock clock; /* must be set, to the same for all frames */
    /* Never smaller than that of the frame before; of ARHOST_CLOCK_MONOTONIC never in the future: a frame of more
     * than a second ahead is refused, and the source is started anew. Where the format tells fps, frames are about
     * 1/fps apart on the mean, the skipped ones counted; live ones may be slower. */
    int64_t capture_ns;
    uint32_t skipped;   /* frames since the one before that the device lost, or that a paced source was late for */
    int32_t has_grey;   /* non-zero: `grey` has been written */
    int32_t has_truth;  /* non-zero: `true_mt` is set */
    int32_t truth_id;   /* the marker that true_mt belongs to */
    double true_mt[16]; /* the exact marker-to-camera matrix, as arhost_marker.mt (synthetic sources) */
} arhost_frame_info;

typedef struct arhost_source {
    uint32_t struct_size;

    /* [worker] Once after create: opens the device or file. A source that is not live gives the same frames
     * at the same times each time that it is started. */
    arhost_status (*start)(arhost_instance *instance, const arhost_source_setup *setup,
                           arhost_source_properties *properties);

    /* [worker] The next frame; waits for it, asking host->cancelled meanwhile. ARHOST_STATUS_OK, ARHOST_STATUS_END
     * (and the same if asked again), or an error. A file that is cut short gives ARHOST_STATUS_END_TRUNCATED
     * after what could be read, and a log message of severity WARNING that says where. */
    arhost_status (*read)(arhost_instance *instance, const arhost_frame_buffer *buffer, arhost_frame_info *info);

    /* [worker] Once before destroy, if start succeeded. */
    void (*stop)(arhost_instance *instance);
} arhost_source;

#ifdef __cplusplus
}
#endif
#endif
