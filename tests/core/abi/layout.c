/* SPDX-License-Identifier: Apache-2.0 */
/* Generated from the headers by tools/make-bindings; do not edit. */
/*
 * The ABI's binary layout on 64-bit Linux (x86-64 and AArch64 alike), checked by the C compiler. While version 1 is a
 * draft this file may change with the headers; once it is frozen, no existing line may change (docs/abi.md).
 */
#include <arhost/arhost.h>

#define VALUE(name, value) _Static_assert((name) == (value), #name)
#define STRUCT(type, size) _Static_assert(sizeof(type) == (size), #type)
#define FIELD(type, field, offset, size)                                                                             \
    _Static_assert(offsetof(type, field) == (offset) && sizeof(((type *)0)->field) == (size), #type "." #field)

/* arhost/plugin.h */
VALUE(ARHOST_ABI_VERSION, 0);
VALUE(ARHOST_STATUS_OK, 1);
VALUE(ARHOST_STATUS_END, 2);
VALUE(ARHOST_STATUS_END_TRUNCATED, 3);
VALUE(ARHOST_STATUS_ERROR_INVALID_ARGUMENT, -1);
VALUE(ARHOST_STATUS_ERROR_CONFIGURATION, -2);
VALUE(ARHOST_STATUS_ERROR_UNSUPPORTED, -3);
VALUE(ARHOST_STATUS_ERROR_IO, -4);
VALUE(ARHOST_STATUS_ERROR_OUT_OF_MEMORY, -5);
VALUE(ARHOST_STATUS_ERROR_DEVICE_LOST, -6);
VALUE(ARHOST_STATUS_ERROR_CANCELLED, -7);
VALUE(ARHOST_STATUS_ERROR_INTERNAL, -8);
VALUE(ARHOST_KIND_SOURCE, 1);
VALUE(ARHOST_KIND_TRACKER, 2);
VALUE(ARHOST_KIND_RAYTRACER, 3);
VALUE(ARHOST_KIND_SINK, 4);
VALUE(ARHOST_SEVERITY_DEBUG, 1);
VALUE(ARHOST_SEVERITY_INFO, 2);
VALUE(ARHOST_SEVERITY_HINT, 3);
VALUE(ARHOST_SEVERITY_WARNING, 4);
VALUE(ARHOST_SEVERITY_ERROR, 5);
VALUE(ARHOST_SEVERITY_HOST_MISBEHAVING, 6);
VALUE(ARHOST_SEVERITY_PLUGIN_MISBEHAVING, 7);

STRUCT(arhost_host, 64);
FIELD(arhost_host, struct_size, 0, 4);
FIELD(arhost_host, abi_version, 4, 4);
FIELD(arhost_host, name, 8, 8);
FIELD(arhost_host, version, 16, 8);
FIELD(arhost_host, context, 24, 8);
FIELD(arhost_host, log, 32, 8);
FIELD(arhost_host, progress, 40, 8);
FIELD(arhost_host, cancelled, 48, 8);
FIELD(arhost_host, get_extension, 56, 8);
VALUE(ARHOST_OPTION_BOOL, 1);
VALUE(ARHOST_OPTION_INTEGER, 2);
VALUE(ARHOST_OPTION_REAL, 3);
VALUE(ARHOST_OPTION_TEXT, 4);
VALUE(ARHOST_OPTION_INPUT_PATH, 5);
VALUE(ARHOST_OPTION_OUTPUT_PATH, 6);
VALUE(ARHOST_OPTION_LISTEN, 7);

STRUCT(arhost_option_descriptor, 56);
FIELD(arhost_option_descriptor, struct_size, 0, 4);
FIELD(arhost_option_descriptor, type, 4, 4);
FIELD(arhost_option_descriptor, key, 8, 8);
FIELD(arhost_option_descriptor, default_value, 16, 8);
FIELD(arhost_option_descriptor, minimum, 24, 8);
FIELD(arhost_option_descriptor, maximum, 32, 8);
FIELD(arhost_option_descriptor, choices, 40, 8);
FIELD(arhost_option_descriptor, help, 48, 8);

STRUCT(arhost_option, 40);
FIELD(arhost_option, struct_size, 0, 4);
FIELD(arhost_option, type, 4, 4);
FIELD(arhost_option, key, 8, 8);
FIELD(arhost_option, integer, 16, 8);
FIELD(arhost_option, real, 24, 8);
FIELD(arhost_option, text, 32, 8);
VALUE(ARHOST_CAPABILITY_SEEK, 1);
VALUE(ARHOST_CAPABILITY_LIVE, 2);
VALUE(ARHOST_CAPABILITY_LENS_DISTORTION, 4);
VALUE(ARHOST_CAPABILITY_NUMBERED_FILES, 8);
VALUE(ARHOST_CAPABILITY_REALTIME_SINK, 16);
VALUE(ARHOST_CAPABILITY_REFLECTION, 32);
VALUE(ARHOST_CAPABILITY_GLASS, 64);
VALUE(ARHOST_CAPABILITY_ROUGHNESS, 128);
VALUE(ARHOST_CAPABILITY_TEXTURES, 256);
VALUE(ARHOST_CAPABILITY_AREA_LIGHTS, 512);
VALUE(ARHOST_CAPABILITY_ENVIRONMENT, 1024);
VALUE(ARHOST_CAPABILITY_MOTION, 2048);
VALUE(ARHOST_CAPABILITY_EVERY_SCENE, 4064);
VALUE(ARHOST_CAPABILITY_STANDARD_OUTPUT, 4096);
VALUE(ARHOST_CAPABILITY_VIDEO_INPUT, 8192);
VALUE(ARHOST_CAPABILITY_OVERLAY_INPUT, 16384);
VALUE(ARHOST_CAPABILITY_SCALED_IMAGES, 32768);
VALUE(ARHOST_CAPABILITY_RUN_DESCRIPTION, 65536);
VALUE(ARHOST_CAPABILITY_REPORTS_POSES, 131072);

STRUCT(arhost_descriptor, 80);
FIELD(arhost_descriptor, struct_size, 0, 4);
FIELD(arhost_descriptor, kind, 4, 4);
FIELD(arhost_descriptor, id, 8, 8);
FIELD(arhost_descriptor, name, 16, 8);
FIELD(arhost_descriptor, version, 24, 8);
FIELD(arhost_descriptor, vendor, 32, 8);
FIELD(arhost_descriptor, licence, 40, 8);
FIELD(arhost_descriptor, description, 48, 8);
FIELD(arhost_descriptor, capabilities, 56, 4);
FIELD(arhost_descriptor, option_count, 60, 4);
FIELD(arhost_descriptor, options, 64, 8);
FIELD(arhost_descriptor, needs, 72, 8);

STRUCT(arhost_plugin, 48);
FIELD(arhost_plugin, struct_size, 0, 4);
FIELD(arhost_plugin, descriptor, 8, 8);
FIELD(arhost_plugin, functions, 16, 8);
FIELD(arhost_plugin, create, 24, 8);
FIELD(arhost_plugin, destroy, 32, 8);
FIELD(arhost_plugin, get_extension, 40, 8);

STRUCT(arhost_offer, 12);
FIELD(arhost_offer, struct_size, 0, 4);
FIELD(arhost_offer, oldest_abi_version, 4, 4);
FIELD(arhost_offer, newest_abi_version, 8, 4);

STRUCT(arhost_answer, 16);
FIELD(arhost_answer, struct_size, 0, 4);
FIELD(arhost_answer, abi_version, 4, 4);
FIELD(arhost_answer, plugin, 8, 8);

STRUCT(arhost_entry_point, 16);
FIELD(arhost_entry_point, struct_size, 0, 4);
FIELD(arhost_entry_point, negotiate, 8, 8);

/* arhost/devices.h */
VALUE(ARHOST_MAX_DEVICES, 64);
VALUE(ARHOST_MAX_DEVICE_FORMATS, 128);
VALUE(ARHOST_MAX_DEVICE_SIZES, 64);
VALUE(ARHOST_MAX_DEVICE_RATES, 64);
VALUE(ARHOST_MAX_DEVICE_CONTROLS, 256);
VALUE(ARHOST_DEVICE_DISCRETE_GPU, 1);
VALUE(ARHOST_DEVICE_INTEGRATED_GPU, 2);
VALUE(ARHOST_DEVICE_VIRTUAL_GPU, 3);
VALUE(ARHOST_DEVICE_CPU, 4);
VALUE(ARHOST_DEVICE_OTHER, 5);
VALUE(ARHOST_DEVICE_CAMERA, 6);
VALUE(ARHOST_DEVICE_DISPLAY, 7);
VALUE(ARHOST_DEVICE_STATE_USABLE, 1);
VALUE(ARHOST_DEVICE_STATE_BUSY, 2);
VALUE(ARHOST_DEVICE_STATE_FORBIDDEN, 3);
VALUE(ARHOST_DEVICE_STATE_UNUSABLE, 4);

STRUCT(arhost_device_size, 32);
FIELD(arhost_device_size, struct_size, 0, 4);
FIELD(arhost_device_size, width, 4, 4);
FIELD(arhost_device_size, height, 8, 4);
FIELD(arhost_device_size, rate_count, 12, 4);
FIELD(arhost_device_size, is_rate_range, 16, 4);
FIELD(arhost_device_size, rates, 24, 8);

STRUCT(arhost_device_format, 32);
FIELD(arhost_device_format, struct_size, 0, 4);
FIELD(arhost_device_format, size_count, 4, 4);
FIELD(arhost_device_format, is_size_range, 8, 4);
FIELD(arhost_device_format, pixel_format, 16, 8);
FIELD(arhost_device_format, sizes, 24, 8);
VALUE(ARHOST_DEVICE_CONTROL_INTEGER, 1);
VALUE(ARHOST_DEVICE_CONTROL_BOOLEAN, 2);
VALUE(ARHOST_DEVICE_CONTROL_MENU, 3);
VALUE(ARHOST_DEVICE_CONTROL_BITMASK, 4);
VALUE(ARHOST_DEVICE_CONTROL_BUTTON, 5);

STRUCT(arhost_device_control, 64);
FIELD(arhost_device_control, struct_size, 0, 4);
FIELD(arhost_device_control, type, 4, 4);
FIELD(arhost_device_control, has_value, 8, 4);
FIELD(arhost_device_control, name, 16, 8);
FIELD(arhost_device_control, minimum, 24, 8);
FIELD(arhost_device_control, maximum, 32, 8);
FIELD(arhost_device_control, step, 40, 8);
FIELD(arhost_device_control, default_value, 48, 8);
FIELD(arhost_device_control, value, 56, 8);

STRUCT(arhost_device, 104);
FIELD(arhost_device, struct_size, 0, 4);
FIELD(arhost_device, index, 4, 4);
FIELD(arhost_device, kind, 8, 4);
FIELD(arhost_device, state, 12, 4);
FIELD(arhost_device, is_default, 16, 4);
FIELD(arhost_device, format_count, 20, 4);
FIELD(arhost_device, control_count, 24, 4);
FIELD(arhost_device, width, 28, 4);
FIELD(arhost_device, height, 32, 4);
FIELD(arhost_device, rate, 40, 8);
FIELD(arhost_device, name, 48, 8);
FIELD(arhost_device, path, 56, 8);
FIELD(arhost_device, serial, 64, 8);
FIELD(arhost_device, abilities, 72, 8);
FIELD(arhost_device, problem, 80, 8);
FIELD(arhost_device, formats, 88, 8);
FIELD(arhost_device, controls, 96, 8);

STRUCT(arhost_devices, 16);
FIELD(arhost_devices, struct_size, 0, 4);
FIELD(arhost_devices, list, 8, 8);

/* arhost/control.h */

STRUCT(arhost_control, 16);
FIELD(arhost_control, struct_size, 0, 4);
FIELD(arhost_control, send, 8, 8);
VALUE(ARHOST_MAX_COMMAND_SIZE, 16384);
VALUE(ARHOST_MAX_PENDING_COMMANDS, 8);

STRUCT(arhost_set_option, 24);
FIELD(arhost_set_option, struct_size, 0, 4);
FIELD(arhost_set_option, keys, 8, 8);
FIELD(arhost_set_option, set, 16, 8);

/* arhost/counters.h */
VALUE(ARHOST_MAX_COUNTERS, 32);
VALUE(ARHOST_MAX_COUNTER_NAME, 63);

STRUCT(arhost_counters, 16);
FIELD(arhost_counters, struct_size, 0, 4);
FIELD(arhost_counters, list, 8, 8);

/* arhost/frame.h */
VALUE(ARHOST_PIXEL_FORMAT_GREY8, 1);
VALUE(ARHOST_PIXEL_FORMAT_RGB8, 2);
VALUE(ARHOST_PIXEL_FORMAT_BGR8, 3);
VALUE(ARHOST_PIXEL_FORMAT_YUYV, 4);
VALUE(ARHOST_PIXEL_FORMAT_NV12, 5);
VALUE(ARHOST_PIXEL_FORMAT_I420, 6);
VALUE(ARHOST_YUV_MATRIX_BT601, 1);
VALUE(ARHOST_YUV_MATRIX_BT709, 2);
VALUE(ARHOST_YUV_RANGE_LIMITED, 1);
VALUE(ARHOST_YUV_RANGE_FULL, 2);
VALUE(ARHOST_TRANSFER_SRGB, 0);
VALUE(ARHOST_TRANSFER_LINEAR, 1);
VALUE(ARHOST_CLOCK_MONOTONIC, 1);
VALUE(ARHOST_CLOCK_MEDIA, 2);
VALUE(ARHOST_MAX_PLANES, 3);
VALUE(ARHOST_MAX_IMAGE_SIDE, 16384);
VALUE(ARHOST_MAX_NAME, 64);

STRUCT(arhost_frame_format, 112);
FIELD(arhost_frame_format, struct_size, 0, 4);
FIELD(arhost_frame_format, pixel_format, 4, 4);
FIELD(arhost_frame_format, width, 8, 4);
FIELD(arhost_frame_format, height, 12, 4);
FIELD(arhost_frame_format, yuv_matrix, 16, 4);
FIELD(arhost_frame_format, yuv_range, 20, 4);
FIELD(arhost_frame_format, fps, 24, 8);
FIELD(arhost_frame_format, has_depth, 32, 4);
FIELD(arhost_frame_format, transfer, 36, 4);
FIELD(arhost_frame_format, plane_count, 40, 4);
FIELD(arhost_frame_format, stride, 44, 12);
FIELD(arhost_frame_format, offset, 56, 24);
FIELD(arhost_frame_format, grey_stride, 80, 4);
FIELD(arhost_frame_format, depth_stride, 84, 4);
FIELD(arhost_frame_format, grey_offset, 88, 8);
FIELD(arhost_frame_format, depth_offset, 96, 8);
FIELD(arhost_frame_format, byte_size, 104, 8);

STRUCT(arhost_frame, 72);
FIELD(arhost_frame, struct_size, 0, 4);
FIELD(arhost_frame, clock, 4, 4);
FIELD(arhost_frame, format, 8, 8);
FIELD(arhost_frame, plane, 16, 24);
FIELD(arhost_frame, grey, 40, 8);
FIELD(arhost_frame, depth_mm, 48, 8);
FIELD(arhost_frame, sequence, 56, 8);
FIELD(arhost_frame, capture_ns, 64, 8);

/* arhost/camera.h */
VALUE(ARHOST_DISTORTION_NONE, 1);
VALUE(ARHOST_DISTORTION_BROWN, 2);
VALUE(ARHOST_DISTORTION_FISHEYE, 3);
VALUE(ARHOST_MAX_DISTORTION, 12);

STRUCT(arhost_intrinsics, 152);
FIELD(arhost_intrinsics, struct_size, 0, 4);
FIELD(arhost_intrinsics, width, 4, 4);
FIELD(arhost_intrinsics, height, 8, 4);
FIELD(arhost_intrinsics, distortion, 12, 4);
FIELD(arhost_intrinsics, fx, 16, 8);
FIELD(arhost_intrinsics, fy, 24, 8);
FIELD(arhost_intrinsics, cx, 32, 8);
FIELD(arhost_intrinsics, cy, 40, 8);
FIELD(arhost_intrinsics, coefficient_count, 48, 4);
FIELD(arhost_intrinsics, reserved, 52, 4);
FIELD(arhost_intrinsics, coefficients, 56, 96);

STRUCT(arhost_camera, 232);
FIELD(arhost_camera, struct_size, 0, 4);
FIELD(arhost_camera, reserved, 4, 4);
FIELD(arhost_camera, eye, 8, 24);
FIELD(arhost_camera, look_at, 32, 24);
FIELD(arhost_camera, up, 56, 24);
FIELD(arhost_camera, intrinsics, 80, 152);

/* arhost/source.h */

STRUCT(arhost_source_setup, 40);
FIELD(arhost_source_setup, struct_size, 0, 4);
FIELD(arhost_source_setup, reserved, 4, 4);
FIELD(arhost_source_setup, first_sequence, 8, 8);
FIELD(arhost_source_setup, fps, 16, 8);
FIELD(arhost_source_setup, paced, 24, 4);
FIELD(arhost_source_setup, intrinsics, 32, 8);

STRUCT(arhost_source_properties, 280);
FIELD(arhost_source_properties, struct_size, 0, 4);
FIELD(arhost_source_properties, has_intrinsics, 4, 4);
FIELD(arhost_source_properties, format, 8, 112);
FIELD(arhost_source_properties, intrinsics, 120, 152);
FIELD(arhost_source_properties, frame_count, 272, 8);

STRUCT(arhost_frame_buffer, 64);
FIELD(arhost_frame_buffer, struct_size, 0, 4);
FIELD(arhost_frame_buffer, reserved, 4, 4);
FIELD(arhost_frame_buffer, format, 8, 8);
FIELD(arhost_frame_buffer, plane, 16, 24);
FIELD(arhost_frame_buffer, grey, 40, 8);
FIELD(arhost_frame_buffer, depth_mm, 48, 8);
FIELD(arhost_frame_buffer, sequence, 56, 8);

STRUCT(arhost_frame_info, 224);
FIELD(arhost_frame_info, struct_size, 0, 4);
FIELD(arhost_frame_info, clock, 4, 4);
FIELD(arhost_frame_info, capture_ns, 8, 8);
FIELD(arhost_frame_info, skipped, 16, 4);
FIELD(arhost_frame_info, has_grey, 20, 4);
FIELD(arhost_frame_info, has_truth, 24, 4);
FIELD(arhost_frame_info, reserved, 28, 4);
FIELD(arhost_frame_info, truth_target, 32, 64);
FIELD(arhost_frame_info, true_mt, 96, 128);

STRUCT(arhost_source, 32);
FIELD(arhost_source, struct_size, 0, 4);
FIELD(arhost_source, start, 8, 8);
FIELD(arhost_source, read, 16, 8);
FIELD(arhost_source, stop, 24, 8);

/* arhost/tracker.h */
VALUE(ARHOST_MAX_TARGETS, 1024);
VALUE(ARHOST_MAX_MARKERS, 1024);
VALUE(ARHOST_MAX_OBSERVATIONS, 1024);
VALUE(ARHOST_MAX_FAMILIES, 16);
VALUE(ARHOST_MAX_FAMILY, 32);
VALUE(ARHOST_MAX_STATE, 16777216);

STRUCT(arhost_target_config, 24);
FIELD(arhost_target_config, struct_size, 0, 4);
FIELD(arhost_target_config, reserved, 4, 4);
FIELD(arhost_target_config, name, 8, 8);
FIELD(arhost_target_config, body, 16, 8);

STRUCT(arhost_marker_config, 128);
FIELD(arhost_marker_config, struct_size, 0, 4);
FIELD(arhost_marker_config, id, 4, 4);
FIELD(arhost_marker_config, family, 8, 4);
FIELD(arhost_marker_config, target, 12, 4);
FIELD(arhost_marker_config, corners_mm, 16, 96);
FIELD(arhost_marker_config, file, 112, 8);
FIELD(arhost_marker_config, pattern_ratio, 120, 8);

STRUCT(arhost_tracker_setup, 56);
FIELD(arhost_tracker_setup, struct_size, 0, 4);
FIELD(arhost_tracker_setup, target_count, 4, 4);
FIELD(arhost_tracker_setup, format, 8, 8);
FIELD(arhost_tracker_setup, intrinsics, 16, 8);
FIELD(arhost_tracker_setup, targets, 24, 8);
FIELD(arhost_tracker_setup, markers, 32, 8);
FIELD(arhost_tracker_setup, marker_count, 40, 4);
FIELD(arhost_tracker_setup, family_count, 44, 4);
FIELD(arhost_tracker_setup, families, 48, 8);

STRUCT(arhost_observation, 168);
FIELD(arhost_observation, struct_size, 0, 4);
FIELD(arhost_observation, id, 4, 4);
FIELD(arhost_observation, family, 8, 4);
FIELD(arhost_observation, hamming, 12, 4);
FIELD(arhost_observation, corners_px, 16, 64);
FIELD(arhost_observation, decision_margin, 80, 8);
FIELD(arhost_observation, corner_sigma_px, 88, 8);
FIELD(arhost_observation, false_positive_rate, 96, 8);
FIELD(arhost_observation, projected_px, 104, 64);
VALUE(ARHOST_TARGET_DETECTED, 1);
VALUE(ARHOST_TARGET_PREDICTED, 2);
VALUE(ARHOST_TARGET_LOST, 3);

STRUCT(arhost_body_pose, 432);
FIELD(arhost_body_pose, struct_size, 0, 4);
FIELD(arhost_body_pose, target, 4, 4);
FIELD(arhost_body_pose, state, 8, 4);
FIELD(arhost_body_pose, age_frames, 12, 4);
FIELD(arhost_body_pose, mt, 16, 128);
FIELD(arhost_body_pose, covariance, 144, 288);

STRUCT(arhost_tracker_result, 32);
FIELD(arhost_tracker_result, struct_size, 0, 4);
FIELD(arhost_tracker_result, observation_count, 4, 4);
FIELD(arhost_tracker_result, observations, 8, 8);
FIELD(arhost_tracker_result, poses, 16, 8);
FIELD(arhost_tracker_result, pose_count, 24, 4);
FIELD(arhost_tracker_result, candidate_count, 28, 4);

STRUCT(arhost_target, 648);
FIELD(arhost_target, struct_size, 0, 4);
FIELD(arhost_target, state, 4, 4);
FIELD(arhost_target, name, 8, 64);
FIELD(arhost_target, age_frames, 72, 4);
FIELD(arhost_target, first_observation, 76, 4);
FIELD(arhost_target, observation_count, 80, 4);
FIELD(arhost_target, reserved, 84, 4);
FIELD(arhost_target, mt, 88, 128);
FIELD(arhost_target, mt_alternative, 216, 128);
FIELD(arhost_target, covariance, 344, 288);
FIELD(arhost_target, reprojection_px, 632, 8);
FIELD(arhost_target, ambiguity, 640, 8);

STRUCT(arhost_expected_marker, 80);
FIELD(arhost_expected_marker, struct_size, 0, 4);
FIELD(arhost_expected_marker, marker, 4, 4);
FIELD(arhost_expected_marker, corners_px, 8, 64);
FIELD(arhost_expected_marker, margin_px, 72, 8);

STRUCT(arhost_track_request, 56);
FIELD(arhost_track_request, struct_size, 0, 4);
FIELD(arhost_track_request, search_everywhere, 4, 4);
FIELD(arhost_track_request, frame, 8, 8);
FIELD(arhost_track_request, state_before, 16, 8);
FIELD(arhost_track_request, state_after, 24, 8);
FIELD(arhost_track_request, state_size, 32, 8);
FIELD(arhost_track_request, expected, 40, 8);
FIELD(arhost_track_request, expected_count, 48, 4);
FIELD(arhost_track_request, reserved, 52, 4);

STRUCT(arhost_tracker, 48);
FIELD(arhost_tracker, struct_size, 0, 4);
FIELD(arhost_tracker, start, 8, 8);
FIELD(arhost_tracker, track, 16, 8);
FIELD(arhost_tracker, stop, 24, 8);
FIELD(arhost_tracker, state_size, 32, 8);
FIELD(arhost_tracker, aspect, 40, 8);

/* arhost/scene.h */
VALUE(ARHOST_SCENE_MAGIC, 0x435354534f485241);
VALUE(ARHOST_SCENE_VERSION, 3);
VALUE(ARHOST_NONE, 0xffffffff);

STRUCT(arhost_buffer, 16);
FIELD(arhost_buffer, offset, 0, 8);
FIELD(arhost_buffer, count, 8, 4);
FIELD(arhost_buffer, stride, 12, 4);
VALUE(ARHOST_AXES_Z_UP, 1);
VALUE(ARHOST_AXES_Y_UP, 2);
VALUE(ARHOST_GEOMETRY_TRIANGLES, 1);
VALUE(ARHOST_GEOMETRY_SPHERES, 2);

STRUCT(arhost_geometry, 136);
FIELD(arhost_geometry, type, 0, 4);
FIELD(arhost_geometry, reserved, 4, 4);
FIELD(arhost_geometry, positions, 8, 16);
FIELD(arhost_geometry, normals, 24, 16);
FIELD(arhost_geometry, texcoords, 40, 16);
FIELD(arhost_geometry, indices, 56, 16);
FIELD(arhost_geometry, joints, 72, 16);
FIELD(arhost_geometry, weights, 88, 16);
FIELD(arhost_geometry, morph_positions, 104, 16);
FIELD(arhost_geometry, morph_normals, 120, 16);
VALUE(ARHOST_TEXEL_SRGB8, 1);
VALUE(ARHOST_TEXEL_RGBA8, 2);
VALUE(ARHOST_TEXEL_RGBA32F, 3);
VALUE(ARHOST_WRAP_REPEAT, 1);
VALUE(ARHOST_WRAP_CLAMP, 2);
VALUE(ARHOST_WRAP_MIRROR, 3);

STRUCT(arhost_texture, 40);
FIELD(arhost_texture, format, 0, 4);
FIELD(arhost_texture, width, 4, 4);
FIELD(arhost_texture, height, 8, 4);
FIELD(arhost_texture, wrap_u, 12, 4);
FIELD(arhost_texture, wrap_v, 16, 4);
FIELD(arhost_texture, name, 20, 4);
FIELD(arhost_texture, texels, 24, 16);
VALUE(ARHOST_MATERIAL_DIFFUSE, 1);
VALUE(ARHOST_MATERIAL_SPECULAR, 2);
VALUE(ARHOST_MATERIAL_MIRROR, 3);
VALUE(ARHOST_MATERIAL_METAL, 4);
VALUE(ARHOST_MATERIAL_GLASS, 5);
VALUE(ARHOST_MATERIAL_METALLIC_ROUGHNESS, 6);

STRUCT(arhost_material, 172);
FIELD(arhost_material, model, 0, 4);
FIELD(arhost_material, colour_texture, 4, 4);
FIELD(arhost_material, ambient, 8, 12);
FIELD(arhost_material, diffuse, 20, 12);
FIELD(arhost_material, specular, 32, 12);
FIELD(arhost_material, exponent, 44, 4);
FIELD(arhost_material, reflectivity, 48, 12);
FIELD(arhost_material, emission, 60, 12);
FIELD(arhost_material, alpha_cutoff, 72, 4);
FIELD(arhost_material, metallic, 76, 4);
FIELD(arhost_material, roughness, 80, 4);
FIELD(arhost_material, metallic_roughness_texture, 84, 4);
FIELD(arhost_material, normal_texture, 88, 4);
FIELD(arhost_material, emission_texture, 92, 4);
FIELD(arhost_material, index, 96, 4);
FIELD(arhost_material, fresnel_exponent, 100, 4);
FIELD(arhost_material, fresnel_minimum, 104, 4);
FIELD(arhost_material, fresnel_maximum, 108, 4);
FIELD(arhost_material, refraction, 112, 12);
FIELD(arhost_material, extinction, 124, 12);
FIELD(arhost_material, shadow_attenuation, 136, 12);
FIELD(arhost_material, cutoff_colour, 148, 12);
FIELD(arhost_material, importance_cutoff, 160, 4);
FIELD(arhost_material, reflection_depth, 164, 4);
FIELD(arhost_material, refraction_depth, 168, 4);
VALUE(ARHOST_ROLE_VIRTUAL, 1);
VALUE(ARHOST_ROLE_CATCHER, 2);
VALUE(ARHOST_ROLE_OCCLUDER, 3);

STRUCT(arhost_object, 80);
FIELD(arhost_object, geometry, 0, 4);
FIELD(arhost_object, material, 4, 4);
FIELD(arhost_object, role, 8, 4);
FIELD(arhost_object, name, 12, 4);
FIELD(arhost_object, world_from_object, 16, 48);
FIELD(arhost_object, moves, 64, 4);
FIELD(arhost_object, deforms, 68, 4);
FIELD(arhost_object, node, 72, 4);
FIELD(arhost_object, skin, 76, 4);

STRUCT(arhost_node, 112);
FIELD(arhost_node, parent, 0, 4);
FIELD(arhost_node, animated, 4, 4);
FIELD(arhost_node, parent_from_node, 8, 48);
FIELD(arhost_node, translation, 56, 12);
FIELD(arhost_node, rotation, 68, 16);
FIELD(arhost_node, scale, 84, 12);
FIELD(arhost_node, morph_weights, 96, 16);
VALUE(ARHOST_CHANNEL_TRANSLATION, 1);
VALUE(ARHOST_CHANNEL_ROTATION, 2);
VALUE(ARHOST_CHANNEL_SCALE, 3);
VALUE(ARHOST_CHANNEL_MORPH_WEIGHTS, 4);
VALUE(ARHOST_INTERPOLATION_STEP, 1);
VALUE(ARHOST_INTERPOLATION_LINEAR, 2);
VALUE(ARHOST_INTERPOLATION_CUBIC, 3);

STRUCT(arhost_channel, 48);
FIELD(arhost_channel, node, 0, 4);
FIELD(arhost_channel, target, 4, 4);
FIELD(arhost_channel, interpolation, 8, 4);
FIELD(arhost_channel, reserved, 12, 4);
FIELD(arhost_channel, times, 16, 16);
FIELD(arhost_channel, values, 32, 16);

STRUCT(arhost_skin, 32);
FIELD(arhost_skin, joints, 0, 16);
FIELD(arhost_skin, node_from_mesh, 16, 16);

STRUCT(arhost_anchor, 8);
FIELD(arhost_anchor, node, 0, 4);
FIELD(arhost_anchor, target, 4, 4);
VALUE(ARHOST_LIGHT_POINT, 1);
VALUE(ARHOST_LIGHT_DIRECTIONAL, 2);
VALUE(ARHOST_LIGHT_SPOT, 3);
VALUE(ARHOST_LIGHT_RECTANGLE, 4);
VALUE(ARHOST_LIGHT_SPHERE, 5);
VALUE(ARHOST_FALLOFF_NONE, 1);
VALUE(ARHOST_FALLOFF_INVERSE_SQUARE, 2);

STRUCT(arhost_light, 80);
FIELD(arhost_light, type, 0, 4);
FIELD(arhost_light, falloff, 4, 4);
FIELD(arhost_light, position, 8, 12);
FIELD(arhost_light, direction, 20, 12);
FIELD(arhost_light, intensity, 32, 12);
FIELD(arhost_light, axis_u, 44, 12);
FIELD(arhost_light, axis_v, 56, 12);
FIELD(arhost_light, radius, 68, 4);
FIELD(arhost_light, cosine_inner, 72, 4);
FIELD(arhost_light, cosine_outer, 76, 4);

STRUCT(arhost_environment, 80);
FIELD(arhost_environment, texture, 0, 4);
FIELD(arhost_environment, intensity, 4, 4);
FIELD(arhost_environment, environment_from_world, 8, 36);
FIELD(arhost_environment, rows, 48, 16);
FIELD(arhost_environment, columns, 64, 16);

STRUCT(arhost_scene, 336);
FIELD(arhost_scene, magic, 0, 8);
FIELD(arhost_scene, version, 8, 4);
FIELD(arhost_scene, struct_size, 12, 4);
FIELD(arhost_scene, byte_size, 16, 8);
FIELD(arhost_scene, axes, 24, 4);
FIELD(arhost_scene, max_depth, 28, 4);
FIELD(arhost_scene, ambient, 32, 12);
FIELD(arhost_scene, background, 44, 12);
FIELD(arhost_scene, bounds_min, 56, 12);
FIELD(arhost_scene, bounds_max, 68, 12);
FIELD(arhost_scene, shadow_alpha_opaque, 80, 4);
FIELD(arhost_scene, shadow_alpha_translucent, 84, 4);
FIELD(arhost_scene, coloured_shadows, 88, 4);
FIELD(arhost_scene, duration_s, 92, 4);
FIELD(arhost_scene, environment, 96, 80);
FIELD(arhost_scene, geometries, 176, 16);
FIELD(arhost_scene, textures, 192, 16);
FIELD(arhost_scene, materials, 208, 16);
FIELD(arhost_scene, objects, 224, 16);
FIELD(arhost_scene, lights, 240, 16);
FIELD(arhost_scene, nodes, 256, 16);
FIELD(arhost_scene, channels, 272, 16);
FIELD(arhost_scene, skins, 288, 16);
FIELD(arhost_scene, names, 304, 16);
FIELD(arhost_scene, anchors, 320, 16);

/* arhost/motion.h */

STRUCT(arhost_moved_object, 56);
FIELD(arhost_moved_object, object, 0, 4);
FIELD(arhost_moved_object, is_visible, 4, 4);
FIELD(arhost_moved_object, world_from_object, 8, 48);

STRUCT(arhost_deformed_geometry, 32);
FIELD(arhost_deformed_geometry, object, 0, 4);
FIELD(arhost_deformed_geometry, is_visible, 4, 4);
FIELD(arhost_deformed_geometry, vertex_count, 8, 4);
FIELD(arhost_deformed_geometry, reserved, 12, 4);
FIELD(arhost_deformed_geometry, positions, 16, 8);
FIELD(arhost_deformed_geometry, normals, 24, 8);

STRUCT(arhost_motion, 32);
FIELD(arhost_motion, struct_size, 0, 4);
FIELD(arhost_motion, moved_count, 4, 4);
FIELD(arhost_motion, moved, 8, 8);
FIELD(arhost_motion, deformed, 16, 8);
FIELD(arhost_motion, deformed_count, 24, 4);
FIELD(arhost_motion, reserved, 28, 4);

/* arhost/raytracer.h */

STRUCT(arhost_raytracer_setup, 32);
FIELD(arhost_raytracer_setup, struct_size, 0, 4);
FIELD(arhost_raytracer_setup, width, 4, 4);
FIELD(arhost_raytracer_setup, height, 8, 4);
FIELD(arhost_raytracer_setup, reserved, 12, 4);
FIELD(arhost_raytracer_setup, scene, 16, 8);
FIELD(arhost_raytracer_setup, intrinsics, 24, 8);

STRUCT(arhost_render_request, 264);
FIELD(arhost_render_request, struct_size, 0, 4);
FIELD(arhost_render_request, reserved, 4, 4);
FIELD(arhost_render_request, sequence, 8, 8);
FIELD(arhost_render_request, time_s, 16, 8);
FIELD(arhost_render_request, camera, 24, 232);
FIELD(arhost_render_request, motion, 256, 8);

STRUCT(arhost_image, 24);
FIELD(arhost_image, struct_size, 0, 4);
FIELD(arhost_image, stride, 4, 4);
FIELD(arhost_image, width, 8, 4);
FIELD(arhost_image, height, 12, 4);
FIELD(arhost_image, rgba, 16, 8);

STRUCT(arhost_render_info, 32);
FIELD(arhost_render_info, struct_size, 0, 4);
FIELD(arhost_render_info, has_region, 4, 4);
FIELD(arhost_render_info, region_x, 8, 4);
FIELD(arhost_render_info, region_y, 12, 4);
FIELD(arhost_render_info, region_width, 16, 4);
FIELD(arhost_render_info, region_height, 20, 4);
FIELD(arhost_render_info, device_time_ns, 24, 8);

STRUCT(arhost_raytracer, 40);
FIELD(arhost_raytracer, struct_size, 0, 4);
FIELD(arhost_raytracer, start, 8, 8);
FIELD(arhost_raytracer, render, 16, 8);
FIELD(arhost_raytracer, stop, 24, 8);
FIELD(arhost_raytracer, capabilities, 32, 8);

/* arhost/sink.h */

STRUCT(arhost_sink_setup, 56);
FIELD(arhost_sink_setup, struct_size, 0, 4);
FIELD(arhost_sink_setup, width, 4, 4);
FIELD(arhost_sink_setup, height, 8, 4);
FIELD(arhost_sink_setup, reserved, 12, 4);
FIELD(arhost_sink_setup, fps, 16, 8);
FIELD(arhost_sink_setup, first_sequence, 24, 8);
FIELD(arhost_sink_setup, intrinsics, 32, 8);
FIELD(arhost_sink_setup, video_format, 40, 8);
FIELD(arhost_sink_setup, run_description, 48, 8);
VALUE(ARHOST_OVERLAY_RENDERED, 1);
VALUE(ARHOST_OVERLAY_HELD, 2);
VALUE(ARHOST_OVERLAY_NONE, 3);

STRUCT(arhost_search, 24);
FIELD(arhost_search, everywhere, 0, 4);
FIELD(arhost_search, observation_count, 4, 4);
FIELD(arhost_search, unlisted_count, 8, 4);
FIELD(arhost_search, expected_count, 12, 4);
FIELD(arhost_search, missed_count, 16, 4);
FIELD(arhost_search, candidate_count, 20, 4);

STRUCT(arhost_record, 1048);
FIELD(arhost_record, struct_size, 0, 4);
FIELD(arhost_record, clock, 4, 4);
FIELD(arhost_record, sequence, 8, 8);
FIELD(arhost_record, capture_ns, 16, 8);
FIELD(arhost_record, overlay, 24, 4);
FIELD(arhost_record, has_camera, 28, 4);
FIELD(arhost_record, has_truth, 32, 4);
FIELD(arhost_record, target_count, 36, 4);
FIELD(arhost_record, truth_target, 40, 64);
FIELD(arhost_record, true_mt, 104, 128);
FIELD(arhost_record, camera, 232, 232);
FIELD(arhost_record, overlay_scale, 464, 8);
FIELD(arhost_record, overlay_samples, 472, 4);
FIELD(arhost_record, observation_count, 476, 4);
FIELD(arhost_record, targets, 480, 8);
FIELD(arhost_record, observations, 488, 8);
FIELD(arhost_record, families, 496, 512);
FIELD(arhost_record, search, 1008, 24);
FIELD(arhost_record, expected, 1032, 8);
FIELD(arhost_record, expected_count, 1040, 4);
FIELD(arhost_record, reserved, 1044, 4);

STRUCT(arhost_output, 80);
FIELD(arhost_output, struct_size, 0, 4);
FIELD(arhost_output, stride, 4, 4);
FIELD(arhost_output, width, 8, 4);
FIELD(arhost_output, height, 12, 4);
FIELD(arhost_output, bgr, 16, 8);
FIELD(arhost_output, record, 24, 8);
FIELD(arhost_output, video, 32, 24);
FIELD(arhost_output, depth_mm, 56, 8);
FIELD(arhost_output, overlay_rgba, 64, 8);
FIELD(arhost_output, overlay_stride, 72, 4);
FIELD(arhost_output, reserved, 76, 4);

STRUCT(arhost_sink, 48);
FIELD(arhost_sink, struct_size, 0, 4);
FIELD(arhost_sink, start, 8, 8);
FIELD(arhost_sink, write, 16, 8);
FIELD(arhost_sink, idle, 24, 8);
FIELD(arhost_sink, stop, 32, 8);
FIELD(arhost_sink, capabilities, 40, 8);
