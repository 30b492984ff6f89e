/* SPDX-License-Identifier: Apache-2.0 */
/*
 * arhost/frame.h: video frames as they lie in shared memory.
 *
 * Pixels: centres at integer coordinates, the first pixel of the first row (top left) is (0, 0), as in
 * OpenCV's calibrations. Rows run downwards.
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
    ARHOST_PIXEL_FORMAT_YUYV = 4,  /* 1 plane: Y0 U Y1 V; width is even */
    ARHOST_PIXEL_FORMAT_NV12 = 5,  /* 2 planes: Y, then U V interleaved at half size; width and height are even */
    ARHOST_PIXEL_FORMAT_I420 = 6   /* 3 planes: Y, U, V, the last two at half size; width and height are even */
};

/* How Y, U and V were made from R'G'B'. Set for YUYV, NV12 and I420; ignored otherwise. */
typedef int32_t arhost_yuv_matrix;
enum { ARHOST_YUV_MATRIX_BT601 = 1, ARHOST_YUV_MATRIX_BT709 = 2 };
typedef int32_t arhost_yuv_range;
enum { ARHOST_YUV_RANGE_LIMITED = 1, ARHOST_YUV_RANGE_FULL = 2 };

/* What a capture time counts. */
typedef int32_t arhost_clock;
enum {
    ARHOST_CLOCK_MONOTONIC = 1, /* CLOCK_MONOTONIC of this machine: cameras */
    ARHOST_CLOCK_MEDIA = 2      /* from the start of the file or of the synthetic sequence */
};

enum { ARHOST_MAX_PLANES = 3, ARHOST_MAX_IMAGE_SIDE = 16384 };

/* The layout of every frame of a source, fixed from its start to its stop. The source sets the fields
 * of the first group and calls arhost_frame_layout for the second. */
typedef struct arhost_frame_format {
    uint32_t struct_size;
    arhost_pixel_format pixel_format;
    uint32_t width, height; /* px, 1 to ARHOST_MAX_IMAGE_SIDE */
    arhost_yuv_matrix yuv_matrix;
    arhost_yuv_range yuv_range;
    double fps; /* nominal frames a second; 0 where unknown */

    uint32_t plane_count;
    uint32_t stride[ARHOST_MAX_PLANES]; /* bytes from a row to the next, a multiple of 64 */
    uint64_t offset[ARHOST_MAX_PLANES]; /* bytes from the slot's start, a multiple of 64 */
    uint32_t grey_stride;
    uint64_t grey_offset; /* of the grey plane: plane 0 where that is luma already, else a plane of its
                             own which the worker fills once for all trackers */
    uint64_t byte_size;   /* of a slot */
} arhost_frame_format;

/* Fills the second group from the first. Returns 0 where the first group is not valid. */
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
    format->byte_size = end;
    return 1;
}

/* A frame to read. Bytes of a row past its pixels are undefined. */
typedef struct arhost_frame {
    uint32_t struct_size;
    arhost_clock clock;
    const arhost_frame_format *format;
    const uint8_t *plane[ARHOST_MAX_PLANES]; /* NULL past format->plane_count */
    const uint8_t *grey;                     /* full-range luma, rows of format->grey_stride bytes */
    uint64_t sequence;                       /* counts up by one a frame from 0 */
    int64_t capture_ns;                      /* middle of the exposure where known */
} arhost_frame;

#ifdef __cplusplus
}
#endif
#endif
