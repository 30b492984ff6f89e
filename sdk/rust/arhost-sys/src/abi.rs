// SPDX-License-Identifier: Apache-2.0
// Generated from the headers by tools/make-bindings; do not edit.
//! The declarations of `arhost/*.h` under the same names. The headers document them.

use std::mem::size_of;
use std::os::raw::{c_char, c_void};

/// Defined by each plugin; the host only passes pointers to it.
pub enum arhost_instance {}

// ---- arhost/plugin.h ----

pub const ARHOST_ABI_VERSION: u32 = 0;
pub type arhost_status = i32;
pub const ARHOST_STATUS_OK: arhost_status = 1;
pub const ARHOST_STATUS_END: arhost_status = 2;
pub const ARHOST_STATUS_END_TRUNCATED: arhost_status = 3;
pub const ARHOST_STATUS_ERROR_INVALID_ARGUMENT: arhost_status = -1;
pub const ARHOST_STATUS_ERROR_CONFIGURATION: arhost_status = -2;
pub const ARHOST_STATUS_ERROR_UNSUPPORTED: arhost_status = -3;
pub const ARHOST_STATUS_ERROR_IO: arhost_status = -4;
pub const ARHOST_STATUS_ERROR_OUT_OF_MEMORY: arhost_status = -5;
pub const ARHOST_STATUS_ERROR_DEVICE_LOST: arhost_status = -6;
pub const ARHOST_STATUS_ERROR_CANCELLED: arhost_status = -7;
pub const ARHOST_STATUS_ERROR_INTERNAL: arhost_status = -8;
pub type arhost_kind = i32;
pub const ARHOST_KIND_SOURCE: arhost_kind = 1;
pub const ARHOST_KIND_TRACKER: arhost_kind = 2;
pub const ARHOST_KIND_RAYTRACER: arhost_kind = 3;
pub const ARHOST_KIND_SINK: arhost_kind = 4;
pub type arhost_severity = i32;
pub const ARHOST_SEVERITY_DEBUG: arhost_severity = 1;
pub const ARHOST_SEVERITY_INFO: arhost_severity = 2;
pub const ARHOST_SEVERITY_HINT: arhost_severity = 3;
pub const ARHOST_SEVERITY_WARNING: arhost_severity = 4;
pub const ARHOST_SEVERITY_ERROR: arhost_severity = 5;
pub const ARHOST_SEVERITY_HOST_MISBEHAVING: arhost_severity = 6;
pub const ARHOST_SEVERITY_PLUGIN_MISBEHAVING: arhost_severity = 7;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_host {
    pub struct_size: u32,
    pub abi_version: u32,
    pub name: *const c_char,
    pub version: *const c_char,
    pub context: *mut c_void,
    pub log: Option<unsafe extern "C" fn(*const arhost_host, arhost_severity, *const c_char)>,
    pub progress: Option<unsafe extern "C" fn(*const arhost_host, f64, *const c_char)>,
    pub cancelled: Option<unsafe extern "C" fn(*const arhost_host) -> i32>,
    pub get_extension: Option<unsafe extern "C" fn(*const arhost_host, *const c_char) -> *const c_void>,
}
const _: () = assert!(size_of::<arhost_host>() == 64);
unsafe impl Sync for arhost_host {} // a plugin's statics are immutable
pub type arhost_option_type = i32;
pub const ARHOST_OPTION_BOOL: arhost_option_type = 1;
pub const ARHOST_OPTION_INTEGER: arhost_option_type = 2;
pub const ARHOST_OPTION_REAL: arhost_option_type = 3;
pub const ARHOST_OPTION_TEXT: arhost_option_type = 4;
pub const ARHOST_OPTION_INPUT_PATH: arhost_option_type = 5;
pub const ARHOST_OPTION_OUTPUT_PATH: arhost_option_type = 6;
pub const ARHOST_OPTION_LISTEN: arhost_option_type = 7;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_option_descriptor {
    pub struct_size: u32,
    pub type_: arhost_option_type,
    pub key: *const c_char,
    pub default_value: *const c_char,
    pub minimum: f64,
    pub maximum: f64,
    pub choices: *const *const c_char,
    pub help: *const c_char,
}
const _: () = assert!(size_of::<arhost_option_descriptor>() == 56);
unsafe impl Sync for arhost_option_descriptor {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_option {
    pub struct_size: u32,
    pub type_: arhost_option_type,
    pub key: *const c_char,
    pub integer: i64,
    pub real: f64,
    pub text: *const c_char,
}
const _: () = assert!(size_of::<arhost_option>() == 40);
unsafe impl Sync for arhost_option {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_descriptor {
    pub struct_size: u32,
    pub kind: arhost_kind,
    pub id: *const c_char,
    pub name: *const c_char,
    pub version: *const c_char,
    pub vendor: *const c_char,
    pub licence: *const c_char,
    pub description: *const c_char,
    pub capabilities: u64,
    pub option_count: u64,
    pub options: *const arhost_option_descriptor,
    pub needs: *const *const c_char,
}
const _: () = assert!(size_of::<arhost_descriptor>() == 88);
unsafe impl Sync for arhost_descriptor {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_plugin {
    pub struct_size: u32,
    pub reserved: u32,
    pub descriptor: *const arhost_descriptor,
    pub functions: *const c_void,
    pub create: Option<unsafe extern "C" fn(*const arhost_host, *const arhost_option, u32, *mut *mut arhost_instance) -> arhost_status>,
    pub destroy: Option<unsafe extern "C" fn(*mut arhost_instance)>,
    pub get_extension: Option<unsafe extern "C" fn(*const c_char) -> *const c_void>,
}
const _: () = assert!(size_of::<arhost_plugin>() == 48);
unsafe impl Sync for arhost_plugin {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_offer {
    pub struct_size: u32,
    pub oldest_abi_version: u32,
    pub newest_abi_version: u32,
}
const _: () = assert!(size_of::<arhost_offer>() == 12);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_answer {
    pub struct_size: u32,
    pub abi_version: u32,
    pub plugin: *const arhost_plugin,
}
const _: () = assert!(size_of::<arhost_answer>() == 16);
unsafe impl Sync for arhost_answer {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_entry_point {
    pub struct_size: u32,
    pub reserved: u32,
    pub negotiate: Option<unsafe extern "C" fn(*const arhost_offer, *mut arhost_answer) -> arhost_status>,
}
const _: () = assert!(size_of::<arhost_entry_point>() == 16);
unsafe impl Sync for arhost_entry_point {} // a plugin's statics are immutable

// ---- arhost/devices.h ----

pub const ARHOST_DEVICES_EXTENSION: &[u8] = b"arhost.devices/2\0";
pub const ARHOST_MAX_DEVICES: usize = 64;
pub const ARHOST_MAX_DEVICE_FORMATS: usize = 128;
pub const ARHOST_MAX_DEVICE_SIZES: usize = 64;
pub const ARHOST_MAX_DEVICE_RATES: usize = 64;
pub const ARHOST_MAX_DEVICE_CONTROLS: usize = 256;
pub type arhost_device_kind = i32;
pub const ARHOST_DEVICE_DISCRETE_GPU: arhost_device_kind = 1;
pub const ARHOST_DEVICE_INTEGRATED_GPU: arhost_device_kind = 2;
pub const ARHOST_DEVICE_VIRTUAL_GPU: arhost_device_kind = 3;
pub const ARHOST_DEVICE_CPU: arhost_device_kind = 4;
pub const ARHOST_DEVICE_OTHER: arhost_device_kind = 5;
pub const ARHOST_DEVICE_CAMERA: arhost_device_kind = 6;
pub const ARHOST_DEVICE_DISPLAY: arhost_device_kind = 7;
pub type arhost_device_state = i32;
pub const ARHOST_DEVICE_STATE_USABLE: arhost_device_state = 1;
pub const ARHOST_DEVICE_STATE_BUSY: arhost_device_state = 2;
pub const ARHOST_DEVICE_STATE_FORBIDDEN: arhost_device_state = 3;
pub const ARHOST_DEVICE_STATE_UNUSABLE: arhost_device_state = 4;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_device_size {
    pub struct_size: u32,
    pub width: u32,
    pub height: u32,
    pub rate_count: u32,
    pub is_rate_range: i32,
    pub reserved: u32,
    pub rates: *const f64,
}
const _: () = assert!(size_of::<arhost_device_size>() == 32);
unsafe impl Sync for arhost_device_size {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_device_format {
    pub struct_size: u32,
    pub size_count: u32,
    pub is_size_range: i32,
    pub reserved: u32,
    pub pixel_format: *const c_char,
    pub sizes: *const arhost_device_size,
}
const _: () = assert!(size_of::<arhost_device_format>() == 32);
unsafe impl Sync for arhost_device_format {} // a plugin's statics are immutable
pub type arhost_device_control_type = i32;
pub const ARHOST_DEVICE_CONTROL_INTEGER: arhost_device_control_type = 1;
pub const ARHOST_DEVICE_CONTROL_BOOLEAN: arhost_device_control_type = 2;
pub const ARHOST_DEVICE_CONTROL_MENU: arhost_device_control_type = 3;
pub const ARHOST_DEVICE_CONTROL_BITMASK: arhost_device_control_type = 4;
pub const ARHOST_DEVICE_CONTROL_BUTTON: arhost_device_control_type = 5;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_device_control {
    pub struct_size: u32,
    pub type_: arhost_device_control_type,
    pub has_value: i32,
    pub reserved: u32,
    pub name: *const c_char,
    pub minimum: i64,
    pub maximum: i64,
    pub step: i64,
    pub default_value: i64,
    pub value: i64,
}
const _: () = assert!(size_of::<arhost_device_control>() == 64);
unsafe impl Sync for arhost_device_control {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_device {
    pub struct_size: u32,
    pub index: u32,
    pub kind: arhost_device_kind,
    pub state: arhost_device_state,
    pub is_default: i32,
    pub format_count: u32,
    pub control_count: u32,
    pub width: u32,
    pub height: u32,
    pub reserved: u32,
    pub rate: f64,
    pub name: *const c_char,
    pub path: *const c_char,
    pub serial: *const c_char,
    pub abilities: *const c_char,
    pub problem: *const c_char,
    pub formats: *const arhost_device_format,
    pub controls: *const arhost_device_control,
}
const _: () = assert!(size_of::<arhost_device>() == 104);
unsafe impl Sync for arhost_device {} // a plugin's statics are immutable
pub type arhost_take_device = Option<unsafe extern "C" fn(*mut c_void, *const arhost_device)>;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_devices {
    pub struct_size: u32,
    pub reserved: u32,
    pub list: Option<unsafe extern "C" fn(*const arhost_host, arhost_take_device, *mut c_void) -> arhost_status>,
}
const _: () = assert!(size_of::<arhost_devices>() == 16);
unsafe impl Sync for arhost_devices {} // a plugin's statics are immutable

// ---- arhost/control.h ----

pub const ARHOST_CONTROL_EXTENSION: &[u8] = b"arhost.host.control/1\0";
pub type arhost_take_answer = Option<unsafe extern "C" fn(*mut c_void, *const c_char)>;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_control {
    pub struct_size: u32,
    pub reserved: u32,
    pub send: Option<unsafe extern "C" fn(*const arhost_host, *const c_char, arhost_take_answer, *mut c_void) -> arhost_status>,
}
const _: () = assert!(size_of::<arhost_control>() == 16);
unsafe impl Sync for arhost_control {} // a plugin's statics are immutable
pub const ARHOST_MAX_COMMAND_SIZE: usize = 16384;
pub const ARHOST_MAX_PENDING_COMMANDS: usize = 8;
pub const ARHOST_SET_OPTION_EXTENSION: &[u8] = b"arhost.set_option/1\0";
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_set_option {
    pub struct_size: u32,
    pub reserved: u32,
    pub keys: *const *const c_char,
    pub set: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_option) -> arhost_status>,
}
const _: () = assert!(size_of::<arhost_set_option>() == 24);
unsafe impl Sync for arhost_set_option {} // a plugin's statics are immutable

// ---- arhost/counters.h ----

pub const ARHOST_COUNTERS_EXTENSION: &[u8] = b"arhost.counters/1\0";
pub const ARHOST_MAX_COUNTERS: usize = 32;
pub const ARHOST_MAX_COUNTER_NAME: usize = 63;
pub type arhost_take_counter = Option<unsafe extern "C" fn(*mut c_void, *const c_char, u64)>;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_counters {
    pub struct_size: u32,
    pub reserved: u32,
    pub list: Option<unsafe extern "C" fn(*mut arhost_instance, arhost_take_counter, *mut c_void)>,
}
const _: () = assert!(size_of::<arhost_counters>() == 16);
unsafe impl Sync for arhost_counters {} // a plugin's statics are immutable

// ---- arhost/frame.h ----

pub type arhost_pixel_format = i32;
pub const ARHOST_PIXEL_FORMAT_GREY8: arhost_pixel_format = 1;
pub const ARHOST_PIXEL_FORMAT_RGB8: arhost_pixel_format = 2;
pub const ARHOST_PIXEL_FORMAT_BGR8: arhost_pixel_format = 3;
pub const ARHOST_PIXEL_FORMAT_YUYV: arhost_pixel_format = 4;
pub const ARHOST_PIXEL_FORMAT_NV12: arhost_pixel_format = 5;
pub const ARHOST_PIXEL_FORMAT_I420: arhost_pixel_format = 6;
pub type arhost_yuv_matrix = i32;
pub const ARHOST_YUV_MATRIX_BT601: arhost_yuv_matrix = 1;
pub const ARHOST_YUV_MATRIX_BT709: arhost_yuv_matrix = 2;
pub type arhost_yuv_range = i32;
pub const ARHOST_YUV_RANGE_LIMITED: arhost_yuv_range = 1;
pub const ARHOST_YUV_RANGE_FULL: arhost_yuv_range = 2;
pub type arhost_transfer = i32;
pub const ARHOST_TRANSFER_SRGB: arhost_transfer = 0;
pub const ARHOST_TRANSFER_LINEAR: arhost_transfer = 1;
pub type arhost_clock = i32;
pub const ARHOST_CLOCK_MONOTONIC: arhost_clock = 1;
pub const ARHOST_CLOCK_MEDIA: arhost_clock = 2;
pub const ARHOST_MAX_PLANES: usize = 3;
pub const ARHOST_MAX_IMAGE_SIDE: usize = 16384;
pub const ARHOST_MAX_NAME: usize = 64;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_frame_format {
    pub struct_size: u32,
    pub pixel_format: arhost_pixel_format,
    pub width: u32,
    pub height: u32,
    pub yuv_matrix: arhost_yuv_matrix,
    pub yuv_range: arhost_yuv_range,
    pub fps: f64,
    pub has_depth: i32,
    pub transfer: arhost_transfer,
    pub plane_count: u32,
    pub stride: [u32; ARHOST_MAX_PLANES],
    pub offset: [u64; ARHOST_MAX_PLANES],
    pub grey_stride: u32,
    pub depth_stride: u32,
    pub grey_offset: u64,
    pub depth_offset: u64,
    pub byte_size: u64,
    pub reserved_for_growth: [u64; 8],
}
const _: () = assert!(size_of::<arhost_frame_format>() == 176);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_frame {
    pub struct_size: u32,
    pub clock: arhost_clock,
    pub format: *const arhost_frame_format,
    pub plane: [*const u8; ARHOST_MAX_PLANES],
    pub grey: *const u8,
    pub depth_mm: *const u16,
    pub sequence: u64,
    pub capture_ns: i64,
}
const _: () = assert!(size_of::<arhost_frame>() == 72);
unsafe impl Sync for arhost_frame {} // a plugin's statics are immutable

// ---- arhost/camera.h ----

pub type arhost_distortion = i32;
pub const ARHOST_DISTORTION_NONE: arhost_distortion = 1;
pub const ARHOST_DISTORTION_BROWN: arhost_distortion = 2;
pub const ARHOST_DISTORTION_FISHEYE: arhost_distortion = 3;
pub const ARHOST_MAX_DISTORTION: usize = 14;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_intrinsics {
    pub struct_size: u32,
    pub width: u32,
    pub height: u32,
    pub distortion: arhost_distortion,
    pub fx: f64,
    pub fy: f64,
    pub cx: f64,
    pub cy: f64,
    pub coefficient_count: u32,
    pub reserved: u32,
    pub coefficients: [f64; ARHOST_MAX_DISTORTION],
    pub reserved_for_growth: [u64; 8],
}
const _: () = assert!(size_of::<arhost_intrinsics>() == 232);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_camera {
    pub struct_size: u32,
    pub reserved: u32,
    pub eye: [f64; 3],
    pub look_at: [f64; 3],
    pub up: [f64; 3],
    pub intrinsics: arhost_intrinsics,
    pub reserved_for_growth: [u64; 8],
}
const _: () = assert!(size_of::<arhost_camera>() == 376);

// ---- arhost/source.h ----

pub type arhost_source_capabilities = u64;
pub const ARHOST_SOURCE_CAPABILITY_SEEK: u64 = 1;
pub const ARHOST_SOURCE_CAPABILITY_LIVE: u64 = 2;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_source_setup {
    pub struct_size: u32,
    pub reserved: u32,
    pub first_sequence: u64,
    pub fps: f64,
    pub paced: i32,
    pub reserved_2: u32,
    pub intrinsics: *const arhost_intrinsics,
}
const _: () = assert!(size_of::<arhost_source_setup>() == 40);
unsafe impl Sync for arhost_source_setup {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_source_properties {
    pub struct_size: u32,
    pub has_intrinsics: i32,
    pub format: arhost_frame_format,
    pub intrinsics: arhost_intrinsics,
    pub frame_count: u64,
}
const _: () = assert!(size_of::<arhost_source_properties>() == 424);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_frame_buffer {
    pub struct_size: u32,
    pub reserved: u32,
    pub format: *const arhost_frame_format,
    pub plane: [*mut u8; ARHOST_MAX_PLANES],
    pub grey: *mut u8,
    pub depth_mm: *mut u16,
    pub sequence: u64,
}
const _: () = assert!(size_of::<arhost_frame_buffer>() == 64);
unsafe impl Sync for arhost_frame_buffer {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_frame_info {
    pub struct_size: u32,
    pub clock: arhost_clock,
    pub capture_ns: i64,
    pub skipped: u32,
    pub has_grey: i32,
    pub has_truth: i32,
    pub reserved: u32,
    pub truth_target: [c_char; ARHOST_MAX_NAME],
    pub true_mt: [f64; 16],
}
const _: () = assert!(size_of::<arhost_frame_info>() == 224);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_source {
    pub struct_size: u32,
    pub reserved: u32,
    pub start: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_source_setup, *mut arhost_source_properties) -> arhost_status>,
    pub read: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_frame_buffer, *mut arhost_frame_info) -> arhost_status>,
    pub stop: Option<unsafe extern "C" fn(*mut arhost_instance)>,
}
const _: () = assert!(size_of::<arhost_source>() == 32);
unsafe impl Sync for arhost_source {} // a plugin's statics are immutable

// ---- arhost/tracker.h ----

pub const ARHOST_MAX_TARGETS: usize = 1024;
pub const ARHOST_MAX_MARKERS: usize = 1024;
pub const ARHOST_MAX_OBSERVATIONS: usize = 1024;
pub const ARHOST_MAX_FAMILIES: usize = 16;
pub const ARHOST_MAX_FAMILY: usize = 32;
pub const ARHOST_MAX_STATE: usize = 16777216;
pub type arhost_tracker_capabilities = u64;
pub const ARHOST_TRACKER_CAPABILITY_REPORTS_POSES: u64 = 1;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_target_config {
    pub struct_size: u32,
    pub reserved: u32,
    pub name: *const c_char,
    pub body: *const c_char,
}
const _: () = assert!(size_of::<arhost_target_config>() == 24);
unsafe impl Sync for arhost_target_config {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_marker_config {
    pub struct_size: u32,
    pub id: i32,
    pub family: u32,
    pub target: u32,
    pub corners_mm: [[f64; 3]; 4],
    pub file: *const c_char,
    pub pattern_ratio: f64,
}
const _: () = assert!(size_of::<arhost_marker_config>() == 128);
unsafe impl Sync for arhost_marker_config {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_tracker_setup {
    pub struct_size: u32,
    pub target_count: u32,
    pub format: *const arhost_frame_format,
    pub intrinsics: *const arhost_intrinsics,
    pub targets: *const arhost_target_config,
    pub markers: *const arhost_marker_config,
    pub marker_count: u32,
    pub family_count: u32,
    pub families: *const *const c_char,
}
const _: () = assert!(size_of::<arhost_tracker_setup>() == 56);
unsafe impl Sync for arhost_tracker_setup {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_observation {
    pub struct_size: u32,
    pub id: i32,
    pub family: u32,
    pub hamming: u32,
    pub corners_px: [[f64; 2]; 4],
    pub decision_margin: f64,
    pub corner_sigma_px: f64,
    pub false_positive_rate: f64,
    pub projected_px: [[f64; 2]; 4],
}
const _: () = assert!(size_of::<arhost_observation>() == 168);
pub type arhost_target_state = i32;
pub const ARHOST_TARGET_DETECTED: arhost_target_state = 1;
pub const ARHOST_TARGET_PREDICTED: arhost_target_state = 2;
pub const ARHOST_TARGET_LOST: arhost_target_state = 3;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_body_pose {
    pub struct_size: u32,
    pub target: u32,
    pub state: arhost_target_state,
    pub age_frames: u32,
    pub mt: [f64; 16],
    pub covariance: [f64; 36],
}
const _: () = assert!(size_of::<arhost_body_pose>() == 432);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_tracker_result {
    pub struct_size: u32,
    pub observation_count: u32,
    pub observations: *mut arhost_observation,
    pub poses: *mut arhost_body_pose,
    pub pose_count: u32,
    pub candidate_count: i32,
}
const _: () = assert!(size_of::<arhost_tracker_result>() == 32);
unsafe impl Sync for arhost_tracker_result {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_target {
    pub struct_size: u32,
    pub state: arhost_target_state,
    pub name: [c_char; ARHOST_MAX_NAME],
    pub age_frames: u32,
    pub first_observation: u32,
    pub observation_count: u32,
    pub reserved: u32,
    pub mt: [f64; 16],
    pub mt_alternative: [f64; 16],
    pub covariance: [f64; 36],
    pub reprojection_px: f64,
    pub ambiguity: f64,
}
const _: () = assert!(size_of::<arhost_target>() == 648);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_expected_marker {
    pub struct_size: u32,
    pub marker: u32,
    pub corners_px: [[f64; 2]; 4],
    pub margin_px: f64,
}
const _: () = assert!(size_of::<arhost_expected_marker>() == 80);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_track_request {
    pub struct_size: u32,
    pub search_everywhere: i32,
    pub frame: *const arhost_frame,
    pub state_before: *const c_void,
    pub state_after: *mut c_void,
    pub state_size: u64,
    pub expected: *const arhost_expected_marker,
    pub expected_count: u32,
    pub reserved: u32,
}
const _: () = assert!(size_of::<arhost_track_request>() == 56);
unsafe impl Sync for arhost_track_request {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_tracker {
    pub struct_size: u32,
    pub reserved: u32,
    pub start: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_tracker_setup) -> arhost_status>,
    pub track: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_track_request, *mut arhost_tracker_result) -> arhost_status>,
    pub stop: Option<unsafe extern "C" fn(*mut arhost_instance)>,
    pub state_size: Option<unsafe extern "C" fn(*mut arhost_instance) -> u64>,
    pub aspect: Option<unsafe extern "C" fn(*mut arhost_instance, u32) -> f64>,
}
const _: () = assert!(size_of::<arhost_tracker>() == 48);
unsafe impl Sync for arhost_tracker {} // a plugin's statics are immutable

// ---- arhost/scene.h ----

pub const ARHOST_SCENE_MAGIC: u64 = 0x435354534f485241;
pub const ARHOST_SCENE_VERSION: u32 = 6;
pub const ARHOST_NONE: u32 = 0xffffffff;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_buffer {
    pub offset: u64,
    pub count: u32,
    pub stride: u32,
}
const _: () = assert!(size_of::<arhost_buffer>() == 16);
pub type arhost_axes = i32;
pub const ARHOST_AXES_Z_UP: arhost_axes = 1;
pub const ARHOST_AXES_Y_UP: arhost_axes = 2;
pub type arhost_geometry_type = i32;
pub const ARHOST_GEOMETRY_TRIANGLES: arhost_geometry_type = 1;
pub const ARHOST_GEOMETRY_SPHERES: arhost_geometry_type = 2;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_geometry {
    pub type_: arhost_geometry_type,
    pub reserved: u32,
    pub positions: arhost_buffer,
    pub normals: arhost_buffer,
    pub texcoords: arhost_buffer,
    pub tangents: arhost_buffer,
    pub colours: arhost_buffer,
    pub indices: arhost_buffer,
    pub joints: arhost_buffer,
    pub weights: arhost_buffer,
    pub morph_positions: arhost_buffer,
    pub morph_normals: arhost_buffer,
}
const _: () = assert!(size_of::<arhost_geometry>() == 168);
pub type arhost_texel_format = i32;
pub const ARHOST_TEXEL_SRGB8: arhost_texel_format = 1;
pub const ARHOST_TEXEL_RGBA8: arhost_texel_format = 2;
pub const ARHOST_TEXEL_RGBA32F: arhost_texel_format = 3;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_texel_image {
    pub format: arhost_texel_format,
    pub width: u32,
    pub height: u32,
    pub name: u32,
    pub level_count: u32,
    pub reserved: u32,
    pub texels: arhost_buffer,
}
const _: () = assert!(size_of::<arhost_texel_image>() == 40);
pub type arhost_wrap = i32;
pub const ARHOST_WRAP_REPEAT: arhost_wrap = 1;
pub const ARHOST_WRAP_CLAMP: arhost_wrap = 2;
pub const ARHOST_WRAP_MIRROR: arhost_wrap = 3;
pub type arhost_texel_filter = i32;
pub const ARHOST_TEXEL_FILTER_LINEAR: arhost_texel_filter = 1;
pub const ARHOST_TEXEL_FILTER_NEAREST: arhost_texel_filter = 2;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_texture {
    pub image: u32,
    pub wrap_u: arhost_wrap,
    pub wrap_v: arhost_wrap,
    pub filter: arhost_texel_filter,
    pub texcoord_set: u32,
    pub image_from_texcoord: [f32; 6],
}
const _: () = assert!(size_of::<arhost_texture>() == 44);
pub type arhost_material_model = i32;
pub const ARHOST_MATERIAL_DIFFUSE: arhost_material_model = 1;
pub const ARHOST_MATERIAL_SPECULAR: arhost_material_model = 2;
pub const ARHOST_MATERIAL_MIRROR: arhost_material_model = 3;
pub const ARHOST_MATERIAL_METAL: arhost_material_model = 4;
pub const ARHOST_MATERIAL_GLASS: arhost_material_model = 5;
pub const ARHOST_MATERIAL_METALLIC_ROUGHNESS: arhost_material_model = 6;
pub const ARHOST_MATERIAL_UNLIT: arhost_material_model = 7;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_material {
    pub model: arhost_material_model,
    pub colour_texture: u32,
    pub ambient: [f32; 3],
    pub diffuse: [f32; 3],
    pub specular: [f32; 3],
    pub exponent: f32,
    pub reflectivity: [f32; 3],
    pub emission: [f32; 3],
    pub opacity: f32,
    pub alpha_cutoff: f32,
    pub blends: u32,
    pub metallic: f32,
    pub roughness: f32,
    pub metallic_roughness_texture: u32,
    pub normal_texture: u32,
    pub emission_texture: u32,
    pub normal_scale: f32,
    pub occlusion_texture: u32,
    pub occlusion_strength: f32,
    pub specular_weight: f32,
    pub specular_texture: u32,
    pub specular_colour_texture: u32,
    pub transmission: f32,
    pub transmission_texture: u32,
    pub thin_walled: u32,
    pub clearcoat: f32,
    pub clearcoat_roughness: f32,
    pub clearcoat_texture: u32,
    pub clearcoat_roughness_texture: u32,
    pub clearcoat_normal_texture: u32,
    pub clearcoat_normal_scale: f32,
    pub sheen: [f32; 3],
    pub sheen_roughness: f32,
    pub sheen_texture: u32,
    pub sheen_roughness_texture: u32,
    pub anisotropy: f32,
    pub anisotropy_direction: [f32; 2],
    pub anisotropy_texture: u32,
    pub iridescence: f32,
    pub iridescence_index: f32,
    pub iridescence_thickness_nm: [f32; 2],
    pub iridescence_texture: u32,
    pub iridescence_thickness_texture: u32,
    pub index: f32,
    pub fresnel_exponent: f32,
    pub fresnel_minimum: f32,
    pub fresnel_maximum: f32,
    pub refraction: [f32; 3],
    pub extinction: [f32; 3],
    pub shadow_attenuation: [f32; 3],
    pub cutoff_colour: [f32; 3],
    pub importance_cutoff: f32,
    pub reflection_depth: u32,
    pub refraction_depth: u32,
}
const _: () = assert!(size_of::<arhost_material>() == 304);
pub type arhost_role = i32;
pub const ARHOST_ROLE_VIRTUAL: arhost_role = 1;
pub const ARHOST_ROLE_CATCHER: arhost_role = 2;
pub const ARHOST_ROLE_OCCLUDER: arhost_role = 3;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_object {
    pub geometry: u32,
    pub material: u32,
    pub role: arhost_role,
    pub name: u32,
    pub world_from_object: [f32; 12],
    pub moves: u32,
    pub deforms: u32,
    pub node: u32,
    pub skin: u32,
    pub hides_back_faces: u32,
    pub reserved: u32,
}
const _: () = assert!(size_of::<arhost_object>() == 88);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_node {
    pub parent: u32,
    pub animated: u32,
    pub parent_from_node: [f32; 12],
    pub translation: [f32; 3],
    pub rotation: [f32; 4],
    pub scale: [f32; 3],
    pub morph_weights: arhost_buffer,
}
const _: () = assert!(size_of::<arhost_node>() == 112);
pub type arhost_channel_target = i32;
pub const ARHOST_CHANNEL_TRANSLATION: arhost_channel_target = 1;
pub const ARHOST_CHANNEL_ROTATION: arhost_channel_target = 2;
pub const ARHOST_CHANNEL_SCALE: arhost_channel_target = 3;
pub const ARHOST_CHANNEL_MORPH_WEIGHTS: arhost_channel_target = 4;
pub type arhost_interpolation = i32;
pub const ARHOST_INTERPOLATION_STEP: arhost_interpolation = 1;
pub const ARHOST_INTERPOLATION_LINEAR: arhost_interpolation = 2;
pub const ARHOST_INTERPOLATION_CUBIC: arhost_interpolation = 3;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_channel {
    pub node: u32,
    pub target: arhost_channel_target,
    pub interpolation: arhost_interpolation,
    pub period_s: f32,
    pub times: arhost_buffer,
    pub values: arhost_buffer,
}
const _: () = assert!(size_of::<arhost_channel>() == 48);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_skin {
    pub joints: arhost_buffer,
    pub node_from_mesh: arhost_buffer,
}
const _: () = assert!(size_of::<arhost_skin>() == 32);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_anchor {
    pub node: u32,
    pub target: u32,
}
const _: () = assert!(size_of::<arhost_anchor>() == 8);
pub type arhost_light_type = i32;
pub const ARHOST_LIGHT_POINT: arhost_light_type = 1;
pub const ARHOST_LIGHT_DIRECTIONAL: arhost_light_type = 2;
pub const ARHOST_LIGHT_SPOT: arhost_light_type = 3;
pub const ARHOST_LIGHT_RECTANGLE: arhost_light_type = 4;
pub const ARHOST_LIGHT_SPHERE: arhost_light_type = 5;
pub type arhost_falloff = i32;
pub const ARHOST_FALLOFF_NONE: arhost_falloff = 1;
pub const ARHOST_FALLOFF_INVERSE_SQUARE: arhost_falloff = 2;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_light {
    pub type_: arhost_light_type,
    pub falloff: arhost_falloff,
    pub position: [f32; 3],
    pub direction: [f32; 3],
    pub intensity: [f32; 3],
    pub axis_u: [f32; 3],
    pub axis_v: [f32; 3],
    pub radius: f32,
    pub cosine_inner: f32,
    pub cosine_outer: f32,
}
const _: () = assert!(size_of::<arhost_light>() == 80);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_environment {
    pub texture: u32,
    pub intensity: f32,
    pub environment_from_world: [f32; 9],
    pub follows_video: u32,
    pub rows: arhost_buffer,
    pub columns: arhost_buffer,
}
const _: () = assert!(size_of::<arhost_environment>() == 80);
pub type arhost_integrator = i32;
pub const ARHOST_INTEGRATOR_WHITTED: arhost_integrator = 1;
pub const ARHOST_INTEGRATOR_PATH: arhost_integrator = 2;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_scene {
    pub magic: u64,
    pub version: u32,
    pub struct_size: u32,
    pub byte_size: u64,
    pub axes: arhost_axes,
    pub max_depth: u32,
    pub ambient: [f32; 3],
    pub background: [f32; 3],
    pub bounds_min: [f32; 3],
    pub bounds_max: [f32; 3],
    pub shadow_alpha_opaque: f32,
    pub shadow_alpha_translucent: f32,
    pub coloured_shadows: u32,
    pub duration_s: f32,
    pub integrator: arhost_integrator,
    pub reserved: u32,
    pub environment: arhost_environment,
    pub geometries: arhost_buffer,
    pub images: arhost_buffer,
    pub textures: arhost_buffer,
    pub materials: arhost_buffer,
    pub objects: arhost_buffer,
    pub lights: arhost_buffer,
    pub nodes: arhost_buffer,
    pub channels: arhost_buffer,
    pub skins: arhost_buffer,
    pub names: arhost_buffer,
    pub anchors: arhost_buffer,
}
const _: () = assert!(size_of::<arhost_scene>() == 360);

// ---- arhost/motion.h ----

#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_moved_object {
    pub object: u32,
    pub is_visible: u32,
    pub world_from_object: [f32; 12],
}
const _: () = assert!(size_of::<arhost_moved_object>() == 56);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_deformed_geometry {
    pub object: u32,
    pub is_visible: u32,
    pub vertex_count: u32,
    pub reserved: u32,
    pub positions: *const f32,
    pub normals: *const f32,
}
const _: () = assert!(size_of::<arhost_deformed_geometry>() == 32);
unsafe impl Sync for arhost_deformed_geometry {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_motion {
    pub struct_size: u32,
    pub moved_count: u32,
    pub moved: *const arhost_moved_object,
    pub deformed: *const arhost_deformed_geometry,
    pub deformed_count: u32,
    pub reserved: u32,
}
const _: () = assert!(size_of::<arhost_motion>() == 32);
unsafe impl Sync for arhost_motion {} // a plugin's statics are immutable

// ---- arhost/raytracer.h ----

pub type arhost_raytracer_capabilities = u64;
pub const ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION: u64 = 1;
pub const ARHOST_RAYTRACER_CAPABILITY_SCALED_IMAGES: u64 = 2;
pub const ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES: u64 = 4;
pub const ARHOST_RAYTRACER_CAPABILITY_VIDEO: u64 = 8;
pub const ARHOST_RAYTRACER_CAPABILITY_DEPTH: u64 = 16;
pub const ARHOST_RAYTRACER_CAPABILITY_ESTIMATE: u64 = 32;
pub const ARHOST_RAYTRACER_CAPABILITY_REFLECTION: u64 = 256;
pub const ARHOST_RAYTRACER_CAPABILITY_GLASS: u64 = 512;
pub const ARHOST_RAYTRACER_CAPABILITY_ROUGHNESS: u64 = 1024;
pub const ARHOST_RAYTRACER_CAPABILITY_TEXTURES: u64 = 2048;
pub const ARHOST_RAYTRACER_CAPABILITY_AREA_LIGHTS: u64 = 4096;
pub const ARHOST_RAYTRACER_CAPABILITY_ENVIRONMENT: u64 = 8192;
pub const ARHOST_RAYTRACER_CAPABILITY_MOTION: u64 = 16384;
pub const ARHOST_RAYTRACER_CAPABILITY_EVERY_SCENE: u64 = 32512;
pub type arhost_image_form = i32;
pub const ARHOST_IMAGE_FORM_STRAIGHT: arhost_image_form = 1;
pub const ARHOST_IMAGE_FORM_LINEAR: arhost_image_form = 2;
pub type arhost_compositing = i32;
pub const ARHOST_COMPOSITING_SRGB: arhost_compositing = 1;
pub const ARHOST_COMPOSITING_LINEAR: arhost_compositing = 2;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_raytracer_setup {
    pub struct_size: u32,
    pub width: u32,
    pub height: u32,
    pub form: arhost_image_form,
    pub scene: *const arhost_scene,
    pub intrinsics: *const arhost_intrinsics,
    pub compositing: arhost_compositing,
    pub reserved: u32,
    pub video_format: *const arhost_frame_format,
}
const _: () = assert!(size_of::<arhost_raytracer_setup>() == 48);
unsafe impl Sync for arhost_raytracer_setup {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_render_request {
    pub struct_size: u32,
    pub max_samples: u32,
    pub sequence: u64,
    pub time_s: f64,
    pub camera: arhost_camera,
    pub motion: *const arhost_motion,
    pub video: *const arhost_frame,
    pub state_before: *const c_void,
    pub state_after: *mut c_void,
    pub state_size: u64,
    pub estimate: *const c_void,
    pub shading_px: u32,
    pub reserved: u32,
}
const _: () = assert!(size_of::<arhost_render_request>() == 456);
unsafe impl Sync for arhost_render_request {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_image {
    pub struct_size: u32,
    pub stride: u32,
    pub width: u32,
    pub height: u32,
    pub rgba: *mut u8,
    pub linear: *mut u16,
    pub depth_mm: *mut f32,
}
const _: () = assert!(size_of::<arhost_image>() == 40);
unsafe impl Sync for arhost_image {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_render_info {
    pub struct_size: u32,
    pub has_region: i32,
    pub region_x: u32,
    pub region_y: u32,
    pub region_width: u32,
    pub region_height: u32,
    pub device_time_ns: u64,
    pub full_samples: u32,
    pub coarsest_shading_px: u32,
}
const _: () = assert!(size_of::<arhost_render_info>() == 40);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_raytracer {
    pub struct_size: u32,
    pub reserved: u32,
    pub start: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_raytracer_setup) -> arhost_status>,
    pub render: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_render_request, *const arhost_image, *mut arhost_render_info) -> arhost_status>,
    pub stop: Option<unsafe extern "C" fn(*mut arhost_instance)>,
    pub capabilities: Option<unsafe extern "C" fn(*mut arhost_instance) -> arhost_raytracer_capabilities>,
    pub state_size: Option<unsafe extern "C" fn(*mut arhost_instance) -> u64>,
}
const _: () = assert!(size_of::<arhost_raytracer>() == 48);
unsafe impl Sync for arhost_raytracer {} // a plugin's statics are immutable

// ---- arhost/sink.h ----

pub type arhost_sink_capabilities = u64;
pub const ARHOST_SINK_CAPABILITY_NUMBERED_FILES: u64 = 1;
pub const ARHOST_SINK_CAPABILITY_REALTIME: u64 = 2;
pub const ARHOST_SINK_CAPABILITY_STANDARD_OUTPUT: u64 = 4;
pub const ARHOST_SINK_CAPABILITY_VIDEO_INPUT: u64 = 8;
pub const ARHOST_SINK_CAPABILITY_OVERLAY_INPUT: u64 = 16;
pub const ARHOST_SINK_CAPABILITY_RUN_DESCRIPTION: u64 = 32;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_sink_setup {
    pub struct_size: u32,
    pub width: u32,
    pub height: u32,
    pub reserved: u32,
    pub fps: f64,
    pub first_sequence: u64,
    pub intrinsics: *const arhost_intrinsics,
    pub video_format: *const arhost_frame_format,
    pub run_description: *const c_char,
}
const _: () = assert!(size_of::<arhost_sink_setup>() == 56);
unsafe impl Sync for arhost_sink_setup {} // a plugin's statics are immutable
pub type arhost_overlay = i32;
pub const ARHOST_OVERLAY_RENDERED: arhost_overlay = 1;
pub const ARHOST_OVERLAY_HELD: arhost_overlay = 2;
pub const ARHOST_OVERLAY_NONE: arhost_overlay = 3;
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_search {
    pub everywhere: i32,
    pub observation_count: u32,
    pub unlisted_count: u32,
    pub expected_count: u32,
    pub missed_count: u32,
    pub candidate_count: i32,
    pub reserved_for_growth: [u32; 16],
}
const _: () = assert!(size_of::<arhost_search>() == 88);
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_record {
    pub struct_size: u32,
    pub clock: arhost_clock,
    pub sequence: u64,
    pub capture_ns: i64,
    pub overlay: arhost_overlay,
    pub has_camera: i32,
    pub has_truth: i32,
    pub target_count: u32,
    pub truth_target: [c_char; ARHOST_MAX_NAME],
    pub true_mt: [f64; 16],
    pub camera: arhost_camera,
    pub overlay_scale: f64,
    pub overlay_samples: u32,
    pub observation_count: u32,
    pub targets: *const arhost_target,
    pub observations: *const arhost_observation,
    pub families: [[c_char; ARHOST_MAX_FAMILY]; ARHOST_MAX_FAMILIES],
    pub search: arhost_search,
    pub expected: *const arhost_expected_marker,
    pub expected_count: u32,
    pub overlay_shading_px: u32,
}
const _: () = assert!(size_of::<arhost_record>() == 1256);
unsafe impl Sync for arhost_record {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_output {
    pub struct_size: u32,
    pub stride: u32,
    pub width: u32,
    pub height: u32,
    pub bgr: *const u8,
    pub record: *const arhost_record,
    pub video: [*const u8; ARHOST_MAX_PLANES],
    pub depth_mm: *const u16,
    pub overlay_rgba: *const u8,
    pub overlay_stride: u32,
    pub reserved: u32,
}
const _: () = assert!(size_of::<arhost_output>() == 80);
unsafe impl Sync for arhost_output {} // a plugin's statics are immutable
#[repr(C)]
#[derive(Clone, Copy)]
pub struct arhost_sink {
    pub struct_size: u32,
    pub reserved: u32,
    pub start: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_sink_setup) -> arhost_status>,
    pub write: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_output) -> arhost_status>,
    pub idle: Option<unsafe extern "C" fn(*mut arhost_instance) -> arhost_status>,
    pub stop: Option<unsafe extern "C" fn(*mut arhost_instance) -> arhost_status>,
    pub capabilities: Option<unsafe extern "C" fn(*mut arhost_instance) -> arhost_sink_capabilities>,
}
const _: () = assert!(size_of::<arhost_sink>() == 48);
unsafe impl Sync for arhost_sink {} // a plugin's statics are immutable
