/* SPDX-License-Identifier: Apache-2.0 */
/* Generated from the headers by tools/make-bindings; do not edit. */
/*
 * The ABI's binary layout on 64-bit Linux (x86-64 and AArch64 alike), checked by the C compiler. While version 1 is a
 * draft this file may change with the headers; once it is frozen, no existing VALUE, STRUCT or FIELD may change
 * (docs/abi.md).
 */
#include <arhost/arhost.h>

#define VALUE(name, value) _Static_assert((name) == (value), #name)
/* Within `fields`, FIELD refers to the struct as `type`. */
#define STRUCT(name, size, fields)                                                                                   \
    void check_##name(void) {                                                                                        \
        typedef name type;                                                                                           \
        _Static_assert(sizeof(type) == (size), #name);                                                               \
        fields                                                                                                       \
    }
#define FIELD(field, offset, size)                                                                                   \
    _Static_assert(offsetof(type, field) == (offset) && sizeof(((type *)0)->field) == (size), #field);

/* clang-format off */

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

STRUCT(arhost_host, 64,
       FIELD(struct_size, 0, 4) FIELD(abi_version, 4, 4) FIELD(name, 8, 8) FIELD(version, 16, 8)
       FIELD(context, 24, 8) FIELD(log, 32, 8) FIELD(progress, 40, 8) FIELD(cancelled, 48, 8)
       FIELD(get_extension, 56, 8))
VALUE(ARHOST_OPTION_BOOL, 1);
VALUE(ARHOST_OPTION_INTEGER, 2);
VALUE(ARHOST_OPTION_REAL, 3);
VALUE(ARHOST_OPTION_TEXT, 4);
VALUE(ARHOST_OPTION_INPUT_PATH, 5);
VALUE(ARHOST_OPTION_OUTPUT_PATH, 6);
VALUE(ARHOST_OPTION_LISTEN, 7);

STRUCT(arhost_option_descriptor, 56,
       FIELD(struct_size, 0, 4) FIELD(type, 4, 4) FIELD(key, 8, 8) FIELD(default_value, 16, 8) FIELD(minimum, 24, 8)
       FIELD(maximum, 32, 8) FIELD(choices, 40, 8) FIELD(help, 48, 8))

STRUCT(arhost_option, 40,
       FIELD(struct_size, 0, 4) FIELD(type, 4, 4) FIELD(key, 8, 8) FIELD(integer, 16, 8) FIELD(real, 24, 8)
       FIELD(text, 32, 8))

STRUCT(arhost_descriptor, 88,
       FIELD(struct_size, 0, 4) FIELD(kind, 4, 4) FIELD(id, 8, 8) FIELD(name, 16, 8) FIELD(version, 24, 8)
       FIELD(vendor, 32, 8) FIELD(licence, 40, 8) FIELD(description, 48, 8) FIELD(capabilities, 56, 8)
       FIELD(option_count, 64, 8) FIELD(options, 72, 8) FIELD(needs, 80, 8))

STRUCT(arhost_plugin, 48,
       FIELD(struct_size, 0, 4) FIELD(reserved, 4, 4) FIELD(descriptor, 8, 8) FIELD(functions, 16, 8)
       FIELD(create, 24, 8) FIELD(destroy, 32, 8) FIELD(get_extension, 40, 8))

STRUCT(arhost_offer, 12,
       FIELD(struct_size, 0, 4) FIELD(oldest_abi_version, 4, 4) FIELD(newest_abi_version, 8, 4))

STRUCT(arhost_answer, 16,
       FIELD(struct_size, 0, 4) FIELD(abi_version, 4, 4) FIELD(plugin, 8, 8))

STRUCT(arhost_entry_point, 16,
       FIELD(struct_size, 0, 4) FIELD(reserved, 4, 4) FIELD(negotiate, 8, 8))

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

STRUCT(arhost_device_size, 32,
       FIELD(struct_size, 0, 4) FIELD(width, 4, 4) FIELD(height, 8, 4) FIELD(rate_count, 12, 4)
       FIELD(is_rate_range, 16, 4) FIELD(reserved, 20, 4) FIELD(rates, 24, 8))

STRUCT(arhost_device_format, 32,
       FIELD(struct_size, 0, 4) FIELD(size_count, 4, 4) FIELD(is_size_range, 8, 4) FIELD(reserved, 12, 4)
       FIELD(pixel_format, 16, 8) FIELD(sizes, 24, 8))
VALUE(ARHOST_DEVICE_CONTROL_INTEGER, 1);
VALUE(ARHOST_DEVICE_CONTROL_BOOLEAN, 2);
VALUE(ARHOST_DEVICE_CONTROL_MENU, 3);
VALUE(ARHOST_DEVICE_CONTROL_BITMASK, 4);
VALUE(ARHOST_DEVICE_CONTROL_BUTTON, 5);

STRUCT(arhost_device_control, 64,
       FIELD(struct_size, 0, 4) FIELD(type, 4, 4) FIELD(has_value, 8, 4) FIELD(reserved, 12, 4) FIELD(name, 16, 8)
       FIELD(minimum, 24, 8) FIELD(maximum, 32, 8) FIELD(step, 40, 8) FIELD(default_value, 48, 8) FIELD(value, 56, 8))

STRUCT(arhost_device, 104,
       FIELD(struct_size, 0, 4) FIELD(index, 4, 4) FIELD(kind, 8, 4) FIELD(state, 12, 4) FIELD(is_default, 16, 4)
       FIELD(format_count, 20, 4) FIELD(control_count, 24, 4) FIELD(width, 28, 4) FIELD(height, 32, 4)
       FIELD(reserved, 36, 4) FIELD(rate, 40, 8) FIELD(name, 48, 8) FIELD(path, 56, 8) FIELD(serial, 64, 8)
       FIELD(abilities, 72, 8) FIELD(problem, 80, 8) FIELD(formats, 88, 8) FIELD(controls, 96, 8))

STRUCT(arhost_devices, 16,
       FIELD(struct_size, 0, 4) FIELD(reserved, 4, 4) FIELD(list, 8, 8))

/* arhost/control.h */

STRUCT(arhost_control, 16,
       FIELD(struct_size, 0, 4) FIELD(reserved, 4, 4) FIELD(send, 8, 8))
VALUE(ARHOST_MAX_COMMAND_SIZE, 16384);
VALUE(ARHOST_MAX_PENDING_COMMANDS, 8);

STRUCT(arhost_set_option, 24,
       FIELD(struct_size, 0, 4) FIELD(reserved, 4, 4) FIELD(keys, 8, 8) FIELD(set, 16, 8))

/* arhost/counters.h */
VALUE(ARHOST_MAX_COUNTERS, 32);
VALUE(ARHOST_MAX_COUNTER_NAME, 63);

STRUCT(arhost_counters, 16,
       FIELD(struct_size, 0, 4) FIELD(reserved, 4, 4) FIELD(list, 8, 8))

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

STRUCT(arhost_frame_format, 176,
       FIELD(struct_size, 0, 4) FIELD(pixel_format, 4, 4) FIELD(width, 8, 4) FIELD(height, 12, 4)
       FIELD(yuv_matrix, 16, 4) FIELD(yuv_range, 20, 4) FIELD(fps, 24, 8) FIELD(has_depth, 32, 4)
       FIELD(transfer, 36, 4) FIELD(plane_count, 40, 4) FIELD(stride, 44, 12) FIELD(offset, 56, 24)
       FIELD(grey_stride, 80, 4) FIELD(depth_stride, 84, 4) FIELD(grey_offset, 88, 8) FIELD(depth_offset, 96, 8)
       FIELD(byte_size, 104, 8) FIELD(reserved_for_growth, 112, 64))

STRUCT(arhost_frame, 72,
       FIELD(struct_size, 0, 4) FIELD(clock, 4, 4) FIELD(format, 8, 8) FIELD(plane, 16, 24) FIELD(grey, 40, 8)
       FIELD(depth_mm, 48, 8) FIELD(sequence, 56, 8) FIELD(capture_ns, 64, 8))

/* arhost/camera.h */
VALUE(ARHOST_DISTORTION_NONE, 1);
VALUE(ARHOST_DISTORTION_BROWN, 2);
VALUE(ARHOST_DISTORTION_FISHEYE, 3);
VALUE(ARHOST_MAX_DISTORTION, 14);

STRUCT(arhost_intrinsics, 232,
       FIELD(struct_size, 0, 4) FIELD(width, 4, 4) FIELD(height, 8, 4) FIELD(distortion, 12, 4) FIELD(fx, 16, 8)
       FIELD(fy, 24, 8) FIELD(cx, 32, 8) FIELD(cy, 40, 8) FIELD(coefficient_count, 48, 4) FIELD(reserved, 52, 4)
       FIELD(coefficients, 56, 112) FIELD(reserved_for_growth, 168, 64))

STRUCT(arhost_camera, 376,
       FIELD(struct_size, 0, 4) FIELD(reserved, 4, 4) FIELD(eye, 8, 24) FIELD(look_at, 32, 24) FIELD(up, 56, 24)
       FIELD(intrinsics, 80, 232) FIELD(reserved_for_growth, 312, 64))

/* arhost/source.h */
VALUE(ARHOST_SOURCE_CAPABILITY_SEEK, 1);
VALUE(ARHOST_SOURCE_CAPABILITY_LIVE, 2);

STRUCT(arhost_source_setup, 40,
       FIELD(struct_size, 0, 4) FIELD(reserved, 4, 4) FIELD(first_sequence, 8, 8) FIELD(fps, 16, 8)
       FIELD(paced, 24, 4) FIELD(reserved_2, 28, 4) FIELD(intrinsics, 32, 8))

STRUCT(arhost_source_properties, 424,
       FIELD(struct_size, 0, 4) FIELD(has_intrinsics, 4, 4) FIELD(format, 8, 176) FIELD(intrinsics, 184, 232)
       FIELD(frame_count, 416, 8))

STRUCT(arhost_frame_buffer, 64,
       FIELD(struct_size, 0, 4) FIELD(reserved, 4, 4) FIELD(format, 8, 8) FIELD(plane, 16, 24) FIELD(grey, 40, 8)
       FIELD(depth_mm, 48, 8) FIELD(sequence, 56, 8))

STRUCT(arhost_frame_info, 224,
       FIELD(struct_size, 0, 4) FIELD(clock, 4, 4) FIELD(capture_ns, 8, 8) FIELD(skipped, 16, 4)
       FIELD(has_grey, 20, 4) FIELD(has_truth, 24, 4) FIELD(reserved, 28, 4) FIELD(truth_target, 32, 64)
       FIELD(true_mt, 96, 128))

STRUCT(arhost_source, 32,
       FIELD(struct_size, 0, 4) FIELD(reserved, 4, 4) FIELD(start, 8, 8) FIELD(read, 16, 8) FIELD(stop, 24, 8))

/* arhost/tracker.h */
VALUE(ARHOST_MAX_TARGETS, 1024);
VALUE(ARHOST_MAX_MARKERS, 1024);
VALUE(ARHOST_MAX_OBSERVATIONS, 1024);
VALUE(ARHOST_MAX_FAMILIES, 16);
VALUE(ARHOST_MAX_FAMILY, 32);
VALUE(ARHOST_MAX_STATE, 16777216);
VALUE(ARHOST_TRACKER_CAPABILITY_REPORTS_POSES, 1);

STRUCT(arhost_target_config, 24,
       FIELD(struct_size, 0, 4) FIELD(reserved, 4, 4) FIELD(name, 8, 8) FIELD(body, 16, 8))

STRUCT(arhost_marker_config, 128,
       FIELD(struct_size, 0, 4) FIELD(id, 4, 4) FIELD(family, 8, 4) FIELD(target, 12, 4) FIELD(corners_mm, 16, 96)
       FIELD(file, 112, 8) FIELD(pattern_ratio, 120, 8))

STRUCT(arhost_tracker_setup, 56,
       FIELD(struct_size, 0, 4) FIELD(target_count, 4, 4) FIELD(format, 8, 8) FIELD(intrinsics, 16, 8)
       FIELD(targets, 24, 8) FIELD(markers, 32, 8) FIELD(marker_count, 40, 4) FIELD(family_count, 44, 4)
       FIELD(families, 48, 8))

STRUCT(arhost_observation, 168,
       FIELD(struct_size, 0, 4) FIELD(id, 4, 4) FIELD(family, 8, 4) FIELD(hamming, 12, 4) FIELD(corners_px, 16, 64)
       FIELD(decision_margin, 80, 8) FIELD(corner_sigma_px, 88, 8) FIELD(false_positive_rate, 96, 8)
       FIELD(projected_px, 104, 64))
VALUE(ARHOST_TARGET_DETECTED, 1);
VALUE(ARHOST_TARGET_PREDICTED, 2);
VALUE(ARHOST_TARGET_LOST, 3);

STRUCT(arhost_body_pose, 432,
       FIELD(struct_size, 0, 4) FIELD(target, 4, 4) FIELD(state, 8, 4) FIELD(age_frames, 12, 4) FIELD(mt, 16, 128)
       FIELD(covariance, 144, 288))

STRUCT(arhost_tracker_result, 32,
       FIELD(struct_size, 0, 4) FIELD(observation_count, 4, 4) FIELD(observations, 8, 8) FIELD(poses, 16, 8)
       FIELD(pose_count, 24, 4) FIELD(candidate_count, 28, 4))

STRUCT(arhost_target, 648,
       FIELD(struct_size, 0, 4) FIELD(state, 4, 4) FIELD(name, 8, 64) FIELD(age_frames, 72, 4)
       FIELD(first_observation, 76, 4) FIELD(observation_count, 80, 4) FIELD(reserved, 84, 4) FIELD(mt, 88, 128)
       FIELD(mt_alternative, 216, 128) FIELD(covariance, 344, 288) FIELD(reprojection_px, 632, 8)
       FIELD(ambiguity, 640, 8))

STRUCT(arhost_expected_marker, 80,
       FIELD(struct_size, 0, 4) FIELD(marker, 4, 4) FIELD(corners_px, 8, 64) FIELD(margin_px, 72, 8))

STRUCT(arhost_track_request, 56,
       FIELD(struct_size, 0, 4) FIELD(search_everywhere, 4, 4) FIELD(frame, 8, 8) FIELD(state_before, 16, 8)
       FIELD(state_after, 24, 8) FIELD(state_size, 32, 8) FIELD(expected, 40, 8) FIELD(expected_count, 48, 4)
       FIELD(reserved, 52, 4))

STRUCT(arhost_tracker, 48,
       FIELD(struct_size, 0, 4) FIELD(reserved, 4, 4) FIELD(start, 8, 8) FIELD(track, 16, 8) FIELD(stop, 24, 8)
       FIELD(state_size, 32, 8) FIELD(aspect, 40, 8))

/* arhost/scene.h */
VALUE(ARHOST_SCENE_MAGIC, 0x435354534f485241);
VALUE(ARHOST_SCENE_VERSION, 6);
VALUE(ARHOST_NONE, 0xffffffff);

STRUCT(arhost_buffer, 16,
       FIELD(offset, 0, 8) FIELD(count, 8, 4) FIELD(stride, 12, 4))
VALUE(ARHOST_AXES_Z_UP, 1);
VALUE(ARHOST_AXES_Y_UP, 2);
VALUE(ARHOST_GEOMETRY_TRIANGLES, 1);
VALUE(ARHOST_GEOMETRY_SPHERES, 2);

STRUCT(arhost_geometry, 168,
       FIELD(type, 0, 4) FIELD(reserved, 4, 4) FIELD(positions, 8, 16) FIELD(normals, 24, 16)
       FIELD(texcoords, 40, 16) FIELD(tangents, 56, 16) FIELD(colours, 72, 16) FIELD(indices, 88, 16)
       FIELD(joints, 104, 16) FIELD(weights, 120, 16) FIELD(morph_positions, 136, 16) FIELD(morph_normals, 152, 16))
VALUE(ARHOST_TEXEL_SRGB8, 1);
VALUE(ARHOST_TEXEL_RGBA8, 2);
VALUE(ARHOST_TEXEL_RGBA32F, 3);

STRUCT(arhost_texel_image, 40,
       FIELD(format, 0, 4) FIELD(width, 4, 4) FIELD(height, 8, 4) FIELD(name, 12, 4) FIELD(level_count, 16, 4)
       FIELD(reserved, 20, 4) FIELD(texels, 24, 16))
VALUE(ARHOST_WRAP_REPEAT, 1);
VALUE(ARHOST_WRAP_CLAMP, 2);
VALUE(ARHOST_WRAP_MIRROR, 3);
VALUE(ARHOST_TEXEL_FILTER_LINEAR, 1);
VALUE(ARHOST_TEXEL_FILTER_NEAREST, 2);

STRUCT(arhost_texture, 44,
       FIELD(image, 0, 4) FIELD(wrap_u, 4, 4) FIELD(wrap_v, 8, 4) FIELD(filter, 12, 4) FIELD(texcoord_set, 16, 4)
       FIELD(image_from_texcoord, 20, 24))
VALUE(ARHOST_MATERIAL_DIFFUSE, 1);
VALUE(ARHOST_MATERIAL_SPECULAR, 2);
VALUE(ARHOST_MATERIAL_MIRROR, 3);
VALUE(ARHOST_MATERIAL_METAL, 4);
VALUE(ARHOST_MATERIAL_GLASS, 5);
VALUE(ARHOST_MATERIAL_METALLIC_ROUGHNESS, 6);
VALUE(ARHOST_MATERIAL_UNLIT, 7);

STRUCT(arhost_material, 304,
       FIELD(model, 0, 4) FIELD(colour_texture, 4, 4) FIELD(ambient, 8, 12) FIELD(diffuse, 20, 12)
       FIELD(specular, 32, 12) FIELD(exponent, 44, 4) FIELD(reflectivity, 48, 12) FIELD(emission, 60, 12)
       FIELD(opacity, 72, 4) FIELD(alpha_cutoff, 76, 4) FIELD(blends, 80, 4) FIELD(metallic, 84, 4)
       FIELD(roughness, 88, 4) FIELD(metallic_roughness_texture, 92, 4) FIELD(normal_texture, 96, 4)
       FIELD(emission_texture, 100, 4) FIELD(normal_scale, 104, 4) FIELD(occlusion_texture, 108, 4)
       FIELD(occlusion_strength, 112, 4) FIELD(specular_weight, 116, 4) FIELD(specular_texture, 120, 4)
       FIELD(specular_colour_texture, 124, 4) FIELD(transmission, 128, 4) FIELD(transmission_texture, 132, 4)
       FIELD(thin_walled, 136, 4) FIELD(clearcoat, 140, 4) FIELD(clearcoat_roughness, 144, 4)
       FIELD(clearcoat_texture, 148, 4) FIELD(clearcoat_roughness_texture, 152, 4)
       FIELD(clearcoat_normal_texture, 156, 4) FIELD(clearcoat_normal_scale, 160, 4) FIELD(sheen, 164, 12)
       FIELD(sheen_roughness, 176, 4) FIELD(sheen_texture, 180, 4) FIELD(sheen_roughness_texture, 184, 4)
       FIELD(anisotropy, 188, 4) FIELD(anisotropy_direction, 192, 8) FIELD(anisotropy_texture, 200, 4)
       FIELD(iridescence, 204, 4) FIELD(iridescence_index, 208, 4) FIELD(iridescence_thickness_nm, 212, 8)
       FIELD(iridescence_texture, 220, 4) FIELD(iridescence_thickness_texture, 224, 4) FIELD(index, 228, 4)
       FIELD(fresnel_exponent, 232, 4) FIELD(fresnel_minimum, 236, 4) FIELD(fresnel_maximum, 240, 4)
       FIELD(refraction, 244, 12) FIELD(extinction, 256, 12) FIELD(shadow_attenuation, 268, 12)
       FIELD(cutoff_colour, 280, 12) FIELD(importance_cutoff, 292, 4) FIELD(reflection_depth, 296, 4)
       FIELD(refraction_depth, 300, 4))
VALUE(ARHOST_ROLE_VIRTUAL, 1);
VALUE(ARHOST_ROLE_CATCHER, 2);
VALUE(ARHOST_ROLE_OCCLUDER, 3);

STRUCT(arhost_object, 88,
       FIELD(geometry, 0, 4) FIELD(material, 4, 4) FIELD(role, 8, 4) FIELD(name, 12, 4)
       FIELD(world_from_object, 16, 48) FIELD(moves, 64, 4) FIELD(deforms, 68, 4) FIELD(node, 72, 4)
       FIELD(skin, 76, 4) FIELD(hides_back_faces, 80, 4) FIELD(reserved, 84, 4))

STRUCT(arhost_node, 112,
       FIELD(parent, 0, 4) FIELD(animated, 4, 4) FIELD(parent_from_node, 8, 48) FIELD(translation, 56, 12)
       FIELD(rotation, 68, 16) FIELD(scale, 84, 12) FIELD(morph_weights, 96, 16))
VALUE(ARHOST_CHANNEL_TRANSLATION, 1);
VALUE(ARHOST_CHANNEL_ROTATION, 2);
VALUE(ARHOST_CHANNEL_SCALE, 3);
VALUE(ARHOST_CHANNEL_MORPH_WEIGHTS, 4);
VALUE(ARHOST_INTERPOLATION_STEP, 1);
VALUE(ARHOST_INTERPOLATION_LINEAR, 2);
VALUE(ARHOST_INTERPOLATION_CUBIC, 3);

STRUCT(arhost_channel, 48,
       FIELD(node, 0, 4) FIELD(target, 4, 4) FIELD(interpolation, 8, 4) FIELD(period_s, 12, 4) FIELD(times, 16, 16)
       FIELD(values, 32, 16))

STRUCT(arhost_skin, 32,
       FIELD(joints, 0, 16) FIELD(node_from_mesh, 16, 16))

STRUCT(arhost_anchor, 8,
       FIELD(node, 0, 4) FIELD(target, 4, 4))
VALUE(ARHOST_LIGHT_POINT, 1);
VALUE(ARHOST_LIGHT_DIRECTIONAL, 2);
VALUE(ARHOST_LIGHT_SPOT, 3);
VALUE(ARHOST_LIGHT_RECTANGLE, 4);
VALUE(ARHOST_LIGHT_SPHERE, 5);
VALUE(ARHOST_FALLOFF_NONE, 1);
VALUE(ARHOST_FALLOFF_INVERSE_SQUARE, 2);

STRUCT(arhost_light, 80,
       FIELD(type, 0, 4) FIELD(falloff, 4, 4) FIELD(position, 8, 12) FIELD(direction, 20, 12)
       FIELD(intensity, 32, 12) FIELD(axis_u, 44, 12) FIELD(axis_v, 56, 12) FIELD(radius, 68, 4)
       FIELD(cosine_inner, 72, 4) FIELD(cosine_outer, 76, 4))

STRUCT(arhost_environment, 80,
       FIELD(texture, 0, 4) FIELD(intensity, 4, 4) FIELD(environment_from_world, 8, 36) FIELD(follows_video, 44, 4)
       FIELD(rows, 48, 16) FIELD(columns, 64, 16))
VALUE(ARHOST_INTEGRATOR_WHITTED, 1);
VALUE(ARHOST_INTEGRATOR_PATH, 2);

STRUCT(arhost_scene, 360,
       FIELD(magic, 0, 8) FIELD(version, 8, 4) FIELD(struct_size, 12, 4) FIELD(byte_size, 16, 8) FIELD(axes, 24, 4)
       FIELD(max_depth, 28, 4) FIELD(ambient, 32, 12) FIELD(background, 44, 12) FIELD(bounds_min, 56, 12)
       FIELD(bounds_max, 68, 12) FIELD(shadow_alpha_opaque, 80, 4) FIELD(shadow_alpha_translucent, 84, 4)
       FIELD(coloured_shadows, 88, 4) FIELD(duration_s, 92, 4) FIELD(integrator, 96, 4) FIELD(reserved, 100, 4)
       FIELD(environment, 104, 80) FIELD(geometries, 184, 16) FIELD(images, 200, 16) FIELD(textures, 216, 16)
       FIELD(materials, 232, 16) FIELD(objects, 248, 16) FIELD(lights, 264, 16) FIELD(nodes, 280, 16)
       FIELD(channels, 296, 16) FIELD(skins, 312, 16) FIELD(names, 328, 16) FIELD(anchors, 344, 16))

/* arhost/motion.h */

STRUCT(arhost_moved_object, 56,
       FIELD(object, 0, 4) FIELD(is_visible, 4, 4) FIELD(world_from_object, 8, 48))

STRUCT(arhost_deformed_geometry, 32,
       FIELD(object, 0, 4) FIELD(is_visible, 4, 4) FIELD(vertex_count, 8, 4) FIELD(reserved, 12, 4)
       FIELD(positions, 16, 8) FIELD(normals, 24, 8))

STRUCT(arhost_motion, 32,
       FIELD(struct_size, 0, 4) FIELD(moved_count, 4, 4) FIELD(moved, 8, 8) FIELD(deformed, 16, 8)
       FIELD(deformed_count, 24, 4) FIELD(reserved, 28, 4))

/* arhost/raytracer.h */
VALUE(ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION, 1);
VALUE(ARHOST_RAYTRACER_CAPABILITY_SCALED_IMAGES, 2);
VALUE(ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES, 4);
VALUE(ARHOST_RAYTRACER_CAPABILITY_VIDEO, 8);
VALUE(ARHOST_RAYTRACER_CAPABILITY_DEPTH, 16);
VALUE(ARHOST_RAYTRACER_CAPABILITY_ESTIMATE, 32);
VALUE(ARHOST_RAYTRACER_CAPABILITY_REFLECTION, 256);
VALUE(ARHOST_RAYTRACER_CAPABILITY_GLASS, 512);
VALUE(ARHOST_RAYTRACER_CAPABILITY_ROUGHNESS, 1024);
VALUE(ARHOST_RAYTRACER_CAPABILITY_TEXTURES, 2048);
VALUE(ARHOST_RAYTRACER_CAPABILITY_AREA_LIGHTS, 4096);
VALUE(ARHOST_RAYTRACER_CAPABILITY_ENVIRONMENT, 8192);
VALUE(ARHOST_RAYTRACER_CAPABILITY_MOTION, 16384);
VALUE(ARHOST_RAYTRACER_CAPABILITY_EVERY_SCENE, 32512);
VALUE(ARHOST_IMAGE_FORM_STRAIGHT, 1);
VALUE(ARHOST_IMAGE_FORM_LINEAR, 2);
VALUE(ARHOST_COMPOSITING_SRGB, 1);
VALUE(ARHOST_COMPOSITING_LINEAR, 2);

STRUCT(arhost_raytracer_setup, 48,
       FIELD(struct_size, 0, 4) FIELD(width, 4, 4) FIELD(height, 8, 4) FIELD(form, 12, 4) FIELD(scene, 16, 8)
       FIELD(intrinsics, 24, 8) FIELD(compositing, 32, 4) FIELD(reserved, 36, 4) FIELD(video_format, 40, 8))

STRUCT(arhost_render_request, 456,
       FIELD(struct_size, 0, 4) FIELD(max_samples, 4, 4) FIELD(sequence, 8, 8) FIELD(time_s, 16, 8)
       FIELD(camera, 24, 376) FIELD(motion, 400, 8) FIELD(video, 408, 8) FIELD(state_before, 416, 8)
       FIELD(state_after, 424, 8) FIELD(state_size, 432, 8) FIELD(estimate, 440, 8) FIELD(shading_px, 448, 4)
       FIELD(reserved, 452, 4))

STRUCT(arhost_image, 40,
       FIELD(struct_size, 0, 4) FIELD(stride, 4, 4) FIELD(width, 8, 4) FIELD(height, 12, 4) FIELD(rgba, 16, 8)
       FIELD(linear, 24, 8) FIELD(depth_mm, 32, 8))

STRUCT(arhost_render_info, 40,
       FIELD(struct_size, 0, 4) FIELD(has_region, 4, 4) FIELD(region_x, 8, 4) FIELD(region_y, 12, 4)
       FIELD(region_width, 16, 4) FIELD(region_height, 20, 4) FIELD(device_time_ns, 24, 8) FIELD(full_samples, 32, 4)
       FIELD(coarsest_shading_px, 36, 4))

STRUCT(arhost_raytracer, 48,
       FIELD(struct_size, 0, 4) FIELD(reserved, 4, 4) FIELD(start, 8, 8) FIELD(render, 16, 8) FIELD(stop, 24, 8)
       FIELD(capabilities, 32, 8) FIELD(state_size, 40, 8))

/* arhost/sink.h */
VALUE(ARHOST_SINK_CAPABILITY_NUMBERED_FILES, 1);
VALUE(ARHOST_SINK_CAPABILITY_REALTIME, 2);
VALUE(ARHOST_SINK_CAPABILITY_STANDARD_OUTPUT, 4);
VALUE(ARHOST_SINK_CAPABILITY_VIDEO_INPUT, 8);
VALUE(ARHOST_SINK_CAPABILITY_OVERLAY_INPUT, 16);
VALUE(ARHOST_SINK_CAPABILITY_RUN_DESCRIPTION, 32);

STRUCT(arhost_sink_setup, 56,
       FIELD(struct_size, 0, 4) FIELD(width, 4, 4) FIELD(height, 8, 4) FIELD(reserved, 12, 4) FIELD(fps, 16, 8)
       FIELD(first_sequence, 24, 8) FIELD(intrinsics, 32, 8) FIELD(video_format, 40, 8) FIELD(run_description, 48, 8))
VALUE(ARHOST_OVERLAY_RENDERED, 1);
VALUE(ARHOST_OVERLAY_HELD, 2);
VALUE(ARHOST_OVERLAY_NONE, 3);

STRUCT(arhost_search, 88,
       FIELD(everywhere, 0, 4) FIELD(observation_count, 4, 4) FIELD(unlisted_count, 8, 4)
       FIELD(expected_count, 12, 4) FIELD(missed_count, 16, 4) FIELD(candidate_count, 20, 4)
       FIELD(reserved_for_growth, 24, 64))

STRUCT(arhost_record, 1256,
       FIELD(struct_size, 0, 4) FIELD(clock, 4, 4) FIELD(sequence, 8, 8) FIELD(capture_ns, 16, 8)
       FIELD(overlay, 24, 4) FIELD(has_camera, 28, 4) FIELD(has_truth, 32, 4) FIELD(target_count, 36, 4)
       FIELD(truth_target, 40, 64) FIELD(true_mt, 104, 128) FIELD(camera, 232, 376) FIELD(overlay_scale, 608, 8)
       FIELD(overlay_samples, 616, 4) FIELD(observation_count, 620, 4) FIELD(targets, 624, 8)
       FIELD(observations, 632, 8) FIELD(families, 640, 512) FIELD(search, 1152, 88) FIELD(expected, 1240, 8)
       FIELD(expected_count, 1248, 4) FIELD(overlay_shading_px, 1252, 4))

STRUCT(arhost_output, 80,
       FIELD(struct_size, 0, 4) FIELD(stride, 4, 4) FIELD(width, 8, 4) FIELD(height, 12, 4) FIELD(bgr, 16, 8)
       FIELD(record, 24, 8) FIELD(video, 32, 24) FIELD(depth_mm, 56, 8) FIELD(overlay_rgba, 64, 8)
       FIELD(overlay_stride, 72, 4) FIELD(reserved, 76, 4))

STRUCT(arhost_sink, 48,
       FIELD(struct_size, 0, 4) FIELD(reserved, 4, 4) FIELD(start, 8, 8) FIELD(write, 16, 8) FIELD(idle, 24, 8)
       FIELD(stop, 32, 8) FIELD(capabilities, 40, 8))
