/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/sink.h: a sink receives augmented frames. It writes a video, images or poses, or shows a window.
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

/* Bits of arhost_descriptor.capabilities. */
typedef uint64_t arhost_sink_capabilities;
/* If the option `path` contains %d or %0Nd, the sink writes one numbered file per frame. Without this capability, the
 * host treats the path as the name of a single file. */
#define ARHOST_SINK_CAPABILITY_NUMBERED_FILES 0x1ull
#define ARHOST_SINK_CAPABILITY_REALTIME 0x2ull /* needs only the latest frame */
/* Accepts "-" as the option `path`, and then writes to standard output, descriptor 1. Without this capability, the
 * host rejects "-" as the path of an output. */
#define ARHOST_SINK_CAPABILITY_STANDARD_OUTPUT 0x4ull
#define ARHOST_SINK_CAPABILITY_VIDEO_INPUT 0x8ull      /* reads arhost_output.video and depth_mm */
#define ARHOST_SINK_CAPABILITY_OVERLAY_INPUT 0x10ull   /* reads arhost_output.overlay_rgba */
#define ARHOST_SINK_CAPABILITY_RUN_DESCRIPTION 0x20ull /* reads arhost_sink_setup.run_description */

typedef struct arhost_sink_setup {
    uint32_t struct_size;
    uint32_t width, height; /* size of the frames, px */
    uint32_t reserved;      /* 0 */
    double fps;             /* nominal frame rate, 1/s; 0: unknown */
    /* Sequence number of the first frame: 0 on a fresh start, higher after a restart. Keep the output for earlier
     * frames; replace the output for this frame and later ones. */
    uint64_t first_sequence;
    const arhost_intrinsics *intrinsics;     /* the same for every camera in the records; NULL if unknown */
    const arhost_frame_format *video_format; /* format of arhost_output.video */
    /* Description of the run, a JSON object (docs/sessions.md): configuration, versions, camera, scene files. NULL
     * without ARHOST_SINK_CAPABILITY_RUN_DESCRIPTION, and if the host does not describe the run. */
    const char *run_description;
} arhost_sink_setup;

/* The origin of a frame's overlay. */
typedef int32_t arhost_overlay;
enum {
    ARHOST_OVERLAY_RENDERED = 1, /* rendered from this frame's pose */
    ARHOST_OVERLAY_HELD = 2,     /* rendered from the last known pose; used for the configured hold time */
    ARHOST_OVERLAY_NONE = 3      /* no overlay, only video: no target in view, or a component is not running */
};

/* Statistics of the tracker's search for markers in a frame. All 0 if the tracker has not processed the frame. */
typedef struct arhost_search {
    int32_t everywhere;               /* arhost_track_request.search_everywhere */
    uint32_t observation_count;       /* markers that the tracker has reported */
    uint32_t unlisted_count;          /* reported markers that no target lists */
    uint32_t expected_count;          /* markers that were expected */
    uint32_t missed_count;            /* expected markers that the tracker has not reported */
    int32_t candidate_count;          /* arhost_tracker_result.candidate_count */
    uint32_t reserved_for_growth[16]; /* 0: arhost_record contains this struct by value */
} arhost_search;

/* Metadata of a frame. All numbers that are set are finite. */
typedef struct arhost_record {
    uint32_t struct_size;
    arhost_clock clock;
    uint64_t sequence;
    int64_t capture_ns;
    arhost_overlay overlay;
    int32_t has_camera; /* non-zero: `camera` is set */
    int32_t has_truth;  /* non-zero: `truth_target` and `true_mt` are set (arhost/source.h) */
    uint32_t target_count;
    char truth_target[ARHOST_MAX_NAME];
    double true_mt[16];
    arhost_camera camera;
    /* The quality to which the host has adapted the overlay (`live.target_fps`). */
    double overlay_scale;     /* size of the rendered image relative to the frame; 0: as large as the frame */
    uint32_t overlay_samples; /* samples per pixel, if they are adapted; 0: they are not */
    uint32_t observation_count;
    /* The targets that have been seen so far, in the order of the configuration. */
    const arhost_target *targets;
    /* The markers seen in this frame: first those of the targets, then those that no target lists. */
    const arhost_observation *observations;
    /* Names of the families. arhost_observation.family is an index into this array. */
    char families[ARHOST_MAX_FAMILIES][ARHOST_MAX_FAMILY];
    arhost_search search;
    /* The markers that were expected in this frame: first those that the tracker has reported, then those that it has
     * missed. Their `marker` is an index into the setup of the tracker, which a sink does not have. The replay of a
     * session provides the counts in `search`, but not this array, nor observations of markers that no target lists,
     * nor `projected_px` and `false_positive_rate` of other observations. */
    const arhost_expected_marker *expected;
    uint32_t expected_count;
    uint32_t overlay_shading_px; /* as overlay_samples: `shading_px` of arhost_render_request; 0: all pixels */
} arhost_record;

/* An augmented frame to read: B, G, R bytes, top row first, `stride` bytes per row. */
typedef struct arhost_output {
    uint32_t struct_size;
    uint32_t stride;
    uint32_t width, height;
    const uint8_t *bgr;
    const arhost_record *record;
    /* The frame under the overlay, as the source delivered it: one pointer per plane of
     * arhost_sink_setup.video_format. NULL without ARHOST_SINK_CAPABILITY_VIDEO_INPUT. */
    const uint8_t *video[ARHOST_MAX_PLANES];
    const uint16_t *depth_mm; /* the frame's depth plane (arhost_frame.depth_mm); NULL also without
                                 ARHOST_SINK_CAPABILITY_VIDEO_INPUT */
    /* The overlay: R, G, B, A bytes with straight alpha, top row first, transparent where there is no overlay. NULL
     * without ARHOST_SINK_CAPABILITY_OVERLAY_INPUT. */
    const uint8_t *overlay_rgba;
    uint32_t overlay_stride; /* bytes per row of overlay_rgba */
    uint32_t reserved;       /* 0 */
} arhost_output;

typedef struct arhost_sink {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */

    /* [worker, created] Fails if the output cannot be written. Must leave existing files unchanged until the first
     * `write`, because another component may still reject the run. The output must survive a kill of the process: the
     * sink writes it immediately, or completes it after a restart. A file gets its final name only when it is
     * complete, unless it is a valid file at every moment. */
    arhost_status (*start)(arhost_instance *instance, const arhost_sink_setup *setup);

    /* [worker, started] Takes one frame; sequence numbers ascend. After ARHOST_STATUS_OK the host does not send the
     * frame again, so the written frame must survive a kill of the process. The frames in a file are in ascending
     * order; if each frame has its own numbered file, the numbers ascend. Returns ARHOST_STATUS_END if the user has
     * closed the window or the program that receives the frames. The host then closes this output and, if the
     * configuration allows it (`control: [quit]`), ends the run. After ARHOST_STATUS_ERROR_DEVICE_LOST the host
     * restarts the sink and sends the frame again; after other errors it closes this output. */
    arhost_status (*write)(arhost_instance *instance, const arhost_output *output);

    /* [worker, started] Called about 30 times per second while no frame arrives, to process window events. Returns
     * the same values as `write`. Optional: may be NULL. */
    arhost_status (*idle)(arhost_instance *instance);

    /* [worker, started] Called once, after a successful `start`; completes the files. Returns an error if a file
     * remains incomplete. */
    arhost_status (*stop)(arhost_instance *instance);

    /* [worker, created] Optional: may be NULL. Returns the capabilities of this instance, if they depend on its
     * options: the descriptor's capabilities, of which it may clear only ARHOST_SINK_CAPABILITY_VIDEO_INPUT and
     * ARHOST_SINK_CAPABILITY_OVERLAY_INPUT. The host copies only the images that its sinks read. */
    arhost_sink_capabilities (*capabilities)(arhost_instance *instance);
} arhost_sink;

#ifdef __cplusplus
}
#endif
#endif
