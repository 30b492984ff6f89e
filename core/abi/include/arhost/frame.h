/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/frame.h: layout of video frames in shared memory.
 *
 * Pixel coordinates follow OpenCV's calibration: pixel centres are at integers, (0, 0) is the centre of the top left
 * pixel, y points down. The first row is the top one.
 */
#ifndef ARHOST_FRAME_H
#define ARHOST_FRAME_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef int32_t arhost_pixel_format;
enum {
    ARHOST_PIXEL_FORMAT_GREY8 = 1, /* 1 plane: Y */
    ARHOST_PIXEL_FORMAT_RGB8 = 2,  /* 1 plane: R G B */
    ARHOST_PIXEL_FORMAT_BGR8 = 3,  /* 1 plane: B G R */
    ARHOST_PIXEL_FORMAT_YUYV = 4,  /* 1 plane: Y0 U Y1 V; even width */
    ARHOST_PIXEL_FORMAT_NV12 = 5,  /* 2 planes: Y; U V interleaved, subsampled 2×2. Even width and height */
    ARHOST_PIXEL_FORMAT_I420 = 6   /* 3 planes: Y, U, V; U and V subsampled 2×2. Even width and height */
};

/* R'G'B' to Y'CbCr conversion. Required for YUYV, NV12 and I420, ignored otherwise. */
typedef int32_t arhost_yuv_matrix;
enum { ARHOST_YUV_MATRIX_BT601 = 1, ARHOST_YUV_MATRIX_BT709 = 2 };
typedef int32_t arhost_yuv_range;
enum { ARHOST_YUV_RANGE_LIMITED = 1, ARHOST_YUV_RANGE_FULL = 2 };

/* Relation between pixel codes and light. Only trackers use it, to locate blurred edges. Composites and outputs treat
 * the codes as sRGB. */
typedef int32_t arhost_transfer;
enum {
    ARHOST_TRANSFER_SRGB = 0, /* sRGB's curve, or a similar one: BT.601, BT.709; most cameras */
    /* Proportional to the light, as from some machine-vision cameras or from a renderer that averages codes. */
    ARHOST_TRANSFER_LINEAR = 1
};

/* The clock that measured a capture time. */
typedef int32_t arhost_clock;
enum {
    ARHOST_CLOCK_MONOTONIC = 1, /* this machine's CLOCK_MONOTONIC; for cameras */
    ARHOST_CLOCK_MEDIA = 2      /* time since the start of the file or synthetic sequence */
};

enum {
    ARHOST_MAX_PLANES = 3,
    ARHOST_MAX_IMAGE_SIDE = 16384,
    ARHOST_MAX_NAME = 64 /* bytes of the name of a target or body (arhost/tracker.h), with the terminating NUL */
};

/* The layout of all frames of a source, constant from `start` to `stop`. The source sets the fields up to `fps` and
 * calls arhost_frame_layout, which computes the fields from `plane_count` on. */
typedef struct arhost_frame_format {
    uint32_t struct_size;
    arhost_pixel_format pixel_format;
    uint32_t width, height; /* px, 1 to ARHOST_MAX_IMAGE_SIDE */
    arhost_yuv_matrix yuv_matrix;
    arhost_yuv_range yuv_range;
    double fps;        /* nominal frame rate, 1/s; 0: unknown */
    int32_t has_depth; /* non-zero: frames have a depth plane */
    arhost_transfer transfer;

    uint32_t plane_count;
    uint32_t stride[ARHOST_MAX_PLANES]; /* bytes per row, a multiple of 64 */
    uint64_t offset[ARHOST_MAX_PLANES]; /* bytes from the start of the slot, a multiple of 64 */
    uint32_t grey_stride;
    uint32_t depth_stride;           /* bytes per row, a multiple of 64; 0 without depth */
    uint64_t grey_offset;            /* offset of the grey plane: plane 0 if that is luma, otherwise a separate plane,
                                       which the worker fills once for all trackers */
    uint64_t depth_offset;           /* bytes from the start of the slot, a multiple of 64; 0 without depth */
    uint64_t byte_size;              /* size of a slot */
    uint64_t reserved_for_growth[8]; /* 0: other structs contain this one by value */
} arhost_frame_format;

/* Computes `plane_count` and all later fields from the fields before `plane_count`. Returns 1, or 0 if one of the
 * input fields is invalid. */
static inline int32_t arhost_frame_layout(arhost_frame_format *format) {
    const uint64_t w = format->width, h = format->height;
    uint64_t row[ARHOST_MAX_PLANES] = {0, 0, 0};
    uint64_t rows[ARHOST_MAX_PLANES] = {0, 0, 0};
    uint64_t end = 0;
    uint32_t count = 1, grey_is_plane_0 = 0, i;
    if (w < 1 || h < 1 || w > ARHOST_MAX_IMAGE_SIDE || h > ARHOST_MAX_IMAGE_SIDE)
        return 0;
    rows[0] = h;
    switch (format->pixel_format) {
    case ARHOST_PIXEL_FORMAT_GREY8:
        row[0] = w;
        grey_is_plane_0 = 1;
        break;
    case ARHOST_PIXEL_FORMAT_RGB8:
    case ARHOST_PIXEL_FORMAT_BGR8:
        row[0] = 3 * w;
        break;
    case ARHOST_PIXEL_FORMAT_YUYV:
        if (w % 2)
            return 0;
        row[0] = 2 * w;
        break;
    case ARHOST_PIXEL_FORMAT_NV12:
    case ARHOST_PIXEL_FORMAT_I420:
        if (w % 2 || h % 2)
            return 0;
        count = format->pixel_format == ARHOST_PIXEL_FORMAT_NV12 ? 2 : 3;
        row[0] = w;
        row[1] = row[2] = format->pixel_format == ARHOST_PIXEL_FORMAT_NV12 ? w : w / 2;
        rows[1] = rows[2] = h / 2;
        grey_is_plane_0 = 1;
        break;
    default:
        return 0;
    }
    format->plane_count = count;
    for (i = 0; i < ARHOST_MAX_PLANES; ++i) {
        const uint64_t stride = i < count ? (row[i] + 63) / 64 * 64 : 0;
        format->stride[i] = (uint32_t)stride;
        format->offset[i] = i < count ? end : 0;
        if (i < count)
            end += stride * rows[i];
    }
    if (grey_is_plane_0) {
        format->grey_stride = format->stride[0];
        format->grey_offset = 0;
    } else {
        format->grey_stride = (uint32_t)((w + 63) / 64 * 64);
        format->grey_offset = end;
        end += (uint64_t)format->grey_stride * h;
    }
    format->depth_stride = format->has_depth ? (uint32_t)((2 * w + 63) / 64 * 64) : 0;
    format->depth_offset = format->has_depth ? end : 0;
    end += format->depth_stride * h;
    format->byte_size = end;
    return 1;
}

/* A frame to read. The padding at the end of each row is undefined. */
typedef struct arhost_frame {
    uint32_t struct_size;
    arhost_clock clock;
    const arhost_frame_format *format;
    const uint8_t *plane[ARHOST_MAX_PLANES]; /* elements from format->plane_count on are NULL */
    const uint8_t *grey;                     /* full-range luma, format->grey_stride bytes per row */
    const uint16_t *depth_mm;                /* NULL if !format->has_depth; see arhost_frame_buffer.depth_mm */
    uint64_t sequence;                       /* frame number: 0, 1, 2, … */
    int64_t capture_ns;                      /* capture time in ns of `clock`; the middle of the exposure, if known */
} arhost_frame;

#ifdef __cplusplus
}
#endif
#endif
