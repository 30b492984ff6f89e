/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/sink.h: takes augmented frames: a film, images, a window, a log of the poses.
 */
#ifndef ARHOST_SINK_H
#define ARHOST_SINK_H

#include "camera.h"
#include "frame.h"
#include "plugin.h"
#include "tracker.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct arhost_sink_setup {
    uint32_t struct_size;
    uint32_t width, height; /* px, of the images */
    uint32_t reserved;      /* 0 */
    double fps;             /* nominal; 0 where unknown */
    /* 0 on a fresh start. After a restart, the sequence number of the frame that comes first: what was
     * written for it or later ones is to be replaced, what was written before is to be kept. */
    uint64_t first_sequence;
    const arhost_intrinsics *intrinsics; /* of every camera in the records; NULL where none is known */
} arhost_sink_setup;

/* How the overlay of this frame arose. */
typedef int32_t arhost_overlay;
enum {
    ARHOST_OVERLAY_RENDERED = 1, /* traced from this frame's own pose */
    ARHOST_OVERLAY_HELD = 2,     /* traced from the last known pose, within the configured grace */
    ARHOST_OVERLAY_NONE = 3      /* the plain video: no marker in view, or a backend is down */
};

/* All that is known of a frame. What is set is finite. */
typedef struct arhost_record {
    uint32_t struct_size;
    arhost_clock clock;
    uint64_t sequence;
    int64_t capture_ns;
    arhost_overlay overlay;
    int32_t has_camera; /* non-zero: `camera` is set */
    int32_t has_truth;  /* non-zero: `truth_id` and `true_mt` are set (arhost/source.h) */
    int32_t truth_id;
    double true_mt[16];
    arhost_camera camera;
    uint32_t marker_count;
    uint32_t reserved;
    arhost_marker markers[ARHOST_MAX_MARKERS];
} arhost_record;

/* An augmented frame to read: BGR8, `stride` bytes a row. */
typedef struct arhost_output {
    uint32_t struct_size;
    uint32_t stride;
    uint32_t width, height;
    const uint8_t *bgr;
    const arhost_record *record;
} arhost_output;

typedef struct arhost_sink {
    uint32_t struct_size;

    /* [worker] Once after create. Fails where nothing can be written, but harms no earlier file: that waits
     * for the first frame, since another component may yet refuse the run. What goes to a file goes to it at once or
     * can be finished after a kill; a file appears under its own name only when it is whole, or is whole at every
     * moment. */
    arhost_status (*start)(arhost_instance *instance, const arhost_sink_setup *setup);

    /* [worker] One frame, sequence numbers ascending. Once it has returned ARHOST_STATUS_OK the frame is not sent
     * again, so it must survive the death of this process. Frames in one file are in order; of files of a frame each
     * whose names differ in a number, the numbers ascend. ARHOST_STATUS_END: the user closed the window, the run is
     * to end. */
    arhost_status (*write)(arhost_instance *instance, const arhost_output *output);

    /* [worker] About 30 times a second while no frame comes, for windows' events; may be NULL. */
    arhost_status (*idle)(arhost_instance *instance);

    /* [worker] Once before destroy, if start succeeded: finishes the files. The status tells whether
     * they are whole. */
    arhost_status (*stop)(arhost_instance *instance);
} arhost_sink;

#ifdef __cplusplus
}
#endif
#endif
