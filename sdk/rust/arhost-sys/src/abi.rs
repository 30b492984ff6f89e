// SPDX-License-Identifier: Apache-2.0
//! The headers `arhost/*.h`, name by name. Each declaration's meaning, units and rules stand there; the test
//! `layout` compares sizes, offsets and values with what a C compiler makes of them.

use std::os::raw::{c_char, c_void};

/// One made plugin; what is in it is the plugin's own affair.
pub enum arhost_instance {}

pub type arhost_status = i32;
pub type arhost_kind = i32;
pub type arhost_severity = i32;
pub type arhost_option_type = i32;
pub type arhost_pixel_format = i32;
pub type arhost_yuv_matrix = i32;
pub type arhost_yuv_range = i32;
pub type arhost_clock = i32;
pub type arhost_distortion = i32;
pub type arhost_marker_state = i32;
pub type arhost_axes = i32;
pub type arhost_geometry_type = i32;
pub type arhost_texel_format = i32;
pub type arhost_wrap = i32;
pub type arhost_material_model = i32;
pub type arhost_role = i32;
pub type arhost_channel_target = i32;
pub type arhost_interpolation = i32;
pub type arhost_light_type = i32;
pub type arhost_falloff = i32;
pub type arhost_overlay = i32;
pub type arhost_device_kind = i32;

/// Takes one device, in `arhost_devices.list`.
pub type arhost_take_device = Option<unsafe extern "C" fn(*mut c_void, *const arhost_device)>;

/// The id of `arhost_devices`, for C: it ends with NUL.
pub const ARHOST_DEVICES_EXTENSION: &[u8] = b"arhost.devices/1\0";

// Declares constants, and lists them for the test.
macro_rules! abi_constants {
    ($(pub const $name:ident: $type:ty = $value:expr;)*) => {
        $(pub const $name: $type = $value;)*
        #[doc(hidden)]
        pub fn constants() -> Vec<(&'static str, i128)> {
            vec![$((stringify!($name), $name as i128)),*]
        }
    };
}

// Declares structs, and lists their sizes and their fields' offsets for the test.
macro_rules! abi_structs {
    ($(struct $name:ident { $($field:ident: $type:ty,)* })*) => {
        $(
            #[repr(C)]
            #[derive(Clone, Copy)]
            pub struct $name {
                $(pub $field: $type,)*
            }
            // What is static in a plugin never changes.
            unsafe impl Sync for $name {}
        )*
        #[doc(hidden)]
        #[allow(clippy::type_complexity)]
        pub fn layouts() -> Vec<(&'static str, usize, Vec<(&'static str, usize)>)> {
            vec![$({
                let one = std::mem::MaybeUninit::<$name>::uninit();
                let base = one.as_ptr();
                let fields = vec![$((
                    stringify!($field),
                    // Only addresses are taken; nothing is read.
                    unsafe { std::ptr::addr_of!((*base).$field) as usize - base as usize },
                )),*];
                (stringify!($name), std::mem::size_of::<$name>(), fields)
            }),*]
        }
    };
}

abi_constants! {
    // arhost/plugin.h
    pub const ARHOST_ABI_VERSION: u32 = 0;
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
    pub const ARHOST_KIND_SOURCE: arhost_kind = 1;
    pub const ARHOST_KIND_TRACKER: arhost_kind = 2;
    pub const ARHOST_KIND_RAYTRACER: arhost_kind = 3;
    pub const ARHOST_KIND_SINK: arhost_kind = 4;
    pub const ARHOST_SEVERITY_DEBUG: arhost_severity = 1;
    pub const ARHOST_SEVERITY_INFO: arhost_severity = 2;
    pub const ARHOST_SEVERITY_WARNING: arhost_severity = 3;
    pub const ARHOST_SEVERITY_ERROR: arhost_severity = 4;
    pub const ARHOST_SEVERITY_HOST_MISBEHAVING: arhost_severity = 5;
    pub const ARHOST_SEVERITY_PLUGIN_MISBEHAVING: arhost_severity = 6;
    pub const ARHOST_OPTION_BOOL: arhost_option_type = 1;
    pub const ARHOST_OPTION_INTEGER: arhost_option_type = 2;
    pub const ARHOST_OPTION_REAL: arhost_option_type = 3;
    pub const ARHOST_OPTION_TEXT: arhost_option_type = 4;
    pub const ARHOST_OPTION_INPUT_PATH: arhost_option_type = 5;
    pub const ARHOST_OPTION_OUTPUT_PATH: arhost_option_type = 6;
    pub const ARHOST_CAPABILITY_SEEK: u32 = 1 << 0;
    pub const ARHOST_CAPABILITY_LIVE: u32 = 1 << 1;
    pub const ARHOST_CAPABILITY_LENS_DISTORTION: u32 = 1 << 2;
    pub const ARHOST_CAPABILITY_REALTIME_SINK: u32 = 1 << 4;
    // arhost/devices.h
    pub const ARHOST_DEVICE_DISCRETE_GPU: arhost_device_kind = 1;
    pub const ARHOST_DEVICE_INTEGRATED_GPU: arhost_device_kind = 2;
    pub const ARHOST_DEVICE_VIRTUAL_GPU: arhost_device_kind = 3;
    pub const ARHOST_DEVICE_CPU: arhost_device_kind = 4;
    pub const ARHOST_DEVICE_OTHER: arhost_device_kind = 5;
    // arhost/frame.h
    pub const ARHOST_PIXEL_FORMAT_GREY8: arhost_pixel_format = 1;
    pub const ARHOST_PIXEL_FORMAT_RGB8: arhost_pixel_format = 2;
    pub const ARHOST_PIXEL_FORMAT_BGR8: arhost_pixel_format = 3;
    pub const ARHOST_PIXEL_FORMAT_YUYV: arhost_pixel_format = 4;
    pub const ARHOST_PIXEL_FORMAT_NV12: arhost_pixel_format = 5;
    pub const ARHOST_PIXEL_FORMAT_I420: arhost_pixel_format = 6;
    pub const ARHOST_YUV_MATRIX_BT601: arhost_yuv_matrix = 1;
    pub const ARHOST_YUV_MATRIX_BT709: arhost_yuv_matrix = 2;
    pub const ARHOST_YUV_RANGE_LIMITED: arhost_yuv_range = 1;
    pub const ARHOST_YUV_RANGE_FULL: arhost_yuv_range = 2;
    pub const ARHOST_CLOCK_MONOTONIC: arhost_clock = 1;
    pub const ARHOST_CLOCK_MEDIA: arhost_clock = 2;
    pub const ARHOST_MAX_PLANES: usize = 3;
    pub const ARHOST_MAX_IMAGE_SIDE: usize = 16384;
    // arhost/camera.h
    pub const ARHOST_DISTORTION_NONE: arhost_distortion = 1;
    pub const ARHOST_DISTORTION_BROWN: arhost_distortion = 2;
    pub const ARHOST_DISTORTION_FISHEYE: arhost_distortion = 3;
    pub const ARHOST_MAX_DISTORTION: usize = 12;
    // arhost/tracker.h
    pub const ARHOST_MAX_MARKERS: usize = 64;
    pub const ARHOST_MAX_FAMILY: usize = 32;
    pub const ARHOST_MARKER_DETECTED: arhost_marker_state = 1;
    pub const ARHOST_MARKER_PREDICTED: arhost_marker_state = 2;
    pub const ARHOST_MARKER_LOST: arhost_marker_state = 3;
    // arhost/scene.h
    pub const ARHOST_SCENE_MAGIC: u64 = 0x4353_5453_4f48_5241;
    pub const ARHOST_SCENE_VERSION: u32 = 2;
    pub const ARHOST_NONE: u32 = 0xffffffff;
    pub const ARHOST_AXES_Z_UP: arhost_axes = 1;
    pub const ARHOST_AXES_Y_UP: arhost_axes = 2;
    pub const ARHOST_GEOMETRY_TRIANGLES: arhost_geometry_type = 1;
    pub const ARHOST_GEOMETRY_SPHERES: arhost_geometry_type = 2;
    pub const ARHOST_TEXEL_SRGB8: arhost_texel_format = 1;
    pub const ARHOST_TEXEL_RGBA8: arhost_texel_format = 2;
    pub const ARHOST_TEXEL_RGBA32F: arhost_texel_format = 3;
    pub const ARHOST_WRAP_REPEAT: arhost_wrap = 1;
    pub const ARHOST_WRAP_CLAMP: arhost_wrap = 2;
    pub const ARHOST_WRAP_MIRROR: arhost_wrap = 3;
    pub const ARHOST_MATERIAL_DIFFUSE: arhost_material_model = 1;
    pub const ARHOST_MATERIAL_SPECULAR: arhost_material_model = 2;
    pub const ARHOST_MATERIAL_MIRROR: arhost_material_model = 3;
    pub const ARHOST_MATERIAL_METAL: arhost_material_model = 4;
    pub const ARHOST_MATERIAL_GLASS: arhost_material_model = 5;
    pub const ARHOST_MATERIAL_METALLIC_ROUGHNESS: arhost_material_model = 6;
    pub const ARHOST_ROLE_VIRTUAL: arhost_role = 1;
    pub const ARHOST_ROLE_CATCHER: arhost_role = 2;
    pub const ARHOST_ROLE_OCCLUDER: arhost_role = 3;
    pub const ARHOST_CHANNEL_TRANSLATION: arhost_channel_target = 1;
    pub const ARHOST_CHANNEL_ROTATION: arhost_channel_target = 2;
    pub const ARHOST_CHANNEL_SCALE: arhost_channel_target = 3;
    pub const ARHOST_CHANNEL_MORPH_WEIGHTS: arhost_channel_target = 4;
    pub const ARHOST_INTERPOLATION_STEP: arhost_interpolation = 1;
    pub const ARHOST_INTERPOLATION_LINEAR: arhost_interpolation = 2;
    pub const ARHOST_INTERPOLATION_CUBIC: arhost_interpolation = 3;
    pub const ARHOST_LIGHT_POINT: arhost_light_type = 1;
    pub const ARHOST_LIGHT_DIRECTIONAL: arhost_light_type = 2;
    pub const ARHOST_LIGHT_SPOT: arhost_light_type = 3;
    pub const ARHOST_LIGHT_RECTANGLE: arhost_light_type = 4;
    pub const ARHOST_LIGHT_SPHERE: arhost_light_type = 5;
    pub const ARHOST_FALLOFF_NONE: arhost_falloff = 1;
    pub const ARHOST_FALLOFF_INVERSE_SQUARE: arhost_falloff = 2;
    // arhost/sink.h
    pub const ARHOST_OVERLAY_RENDERED: arhost_overlay = 1;
    pub const ARHOST_OVERLAY_HELD: arhost_overlay = 2;
    pub const ARHOST_OVERLAY_NONE: arhost_overlay = 3;
}

abi_structs! {
    // arhost/plugin.h
    struct arhost_host {
        struct_size: u32,
        abi_version: u32,
        name: *const c_char,
        version: *const c_char,
        context: *mut c_void,
        log: Option<unsafe extern "C" fn(*const arhost_host, arhost_severity, *const c_char)>,
        progress: Option<unsafe extern "C" fn(*const arhost_host, f64, *const c_char)>,
        cancelled: Option<unsafe extern "C" fn(*const arhost_host) -> i32>,
        get_extension: Option<unsafe extern "C" fn(*const arhost_host, *const c_char) -> *const c_void>,
    }
    struct arhost_option_descriptor {
        struct_size: u32,
        type_: arhost_option_type,
        key: *const c_char,
        default_value: *const c_char,
        minimum: f64,
        maximum: f64,
        choices: *const *const c_char,
        help: *const c_char,
    }
    struct arhost_option {
        struct_size: u32,
        type_: arhost_option_type,
        key: *const c_char,
        integer: i64,
        real: f64,
        text: *const c_char,
    }
    struct arhost_descriptor {
        struct_size: u32,
        kind: arhost_kind,
        id: *const c_char,
        name: *const c_char,
        version: *const c_char,
        vendor: *const c_char,
        licence: *const c_char,
        description: *const c_char,
        capabilities: u32,
        option_count: u32,
        options: *const arhost_option_descriptor,
        needs: *const *const c_char,
    }
    struct arhost_plugin {
        struct_size: u32,
        descriptor: *const arhost_descriptor,
        functions: *const c_void,
        create: Option<unsafe extern "C" fn(*const arhost_host, *const arhost_option, u32, *mut *mut arhost_instance) -> arhost_status>,
        destroy: Option<unsafe extern "C" fn(*mut arhost_instance)>,
        get_extension: Option<unsafe extern "C" fn(*const c_char) -> *const c_void>,
    }
    struct arhost_offer {
        struct_size: u32,
        oldest_abi_version: u32,
        newest_abi_version: u32,
    }
    struct arhost_answer {
        struct_size: u32,
        abi_version: u32,
        plugin: *const arhost_plugin,
    }
    struct arhost_entry_point {
        struct_size: u32,
        negotiate: Option<unsafe extern "C" fn(*const arhost_offer, *mut arhost_answer) -> arhost_status>,
    }
    // arhost/devices.h
    struct arhost_device {
        struct_size: u32,
        index: u32,
        kind: arhost_device_kind,
        is_default: i32,
        name: *const c_char,
        uuid: *const c_char,
        abilities: *const c_char,
    }
    struct arhost_devices {
        struct_size: u32,
        list: Option<unsafe extern "C" fn(*const arhost_host, arhost_take_device, *mut c_void) -> arhost_status>,
    }
    // arhost/frame.h
    struct arhost_frame_format {
        struct_size: u32,
        pixel_format: arhost_pixel_format,
        width: u32,
        height: u32,
        yuv_matrix: arhost_yuv_matrix,
        yuv_range: arhost_yuv_range,
        fps: f64,
        plane_count: u32,
        stride: [u32; ARHOST_MAX_PLANES],
        offset: [u64; ARHOST_MAX_PLANES],
        grey_stride: u32,
        grey_offset: u64,
        byte_size: u64,
    }
    struct arhost_frame {
        struct_size: u32,
        clock: arhost_clock,
        format: *const arhost_frame_format,
        plane: [*const u8; ARHOST_MAX_PLANES],
        grey: *const u8,
        sequence: u64,
        capture_ns: i64,
    }
    // arhost/camera.h
    struct arhost_intrinsics {
        struct_size: u32,
        width: u32,
        height: u32,
        distortion: arhost_distortion,
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        coefficient_count: u32,
        reserved: u32,
        coefficients: [f64; ARHOST_MAX_DISTORTION],
    }
    struct arhost_camera {
        struct_size: u32,
        reserved: u32,
        eye: [f64; 3],
        look_at: [f64; 3],
        up: [f64; 3],
        intrinsics: arhost_intrinsics,
    }
    // arhost/source.h
    struct arhost_source_setup {
        struct_size: u32,
        reserved: u32,
        first_sequence: u64,
        fps: f64,
        paced: i32,
        intrinsics: *const arhost_intrinsics,
    }
    struct arhost_source_properties {
        struct_size: u32,
        has_intrinsics: i32,
        format: arhost_frame_format,
        intrinsics: arhost_intrinsics,
        frame_count: u64,
    }
    struct arhost_frame_buffer {
        struct_size: u32,
        reserved: u32,
        format: *const arhost_frame_format,
        plane: [*mut u8; ARHOST_MAX_PLANES],
        grey: *mut u8,
        sequence: u64,
    }
    struct arhost_frame_info {
        struct_size: u32,
        clock: arhost_clock,
        capture_ns: i64,
        skipped: u32,
        has_grey: i32,
        has_truth: i32,
        truth_id: i32,
        true_mt: [f64; 16],
    }
    struct arhost_source {
        struct_size: u32,
        start: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_source_setup, *mut arhost_source_properties) -> arhost_status>,
        read: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_frame_buffer, *mut arhost_frame_info) -> arhost_status>,
        stop: Option<unsafe extern "C" fn(*mut arhost_instance)>,
    }
    // arhost/tracker.h
    struct arhost_marker_config {
        struct_size: u32,
        id: i32,
        side_mm: f64,
    }
    struct arhost_marker {
        struct_size: u32,
        id: i32,
        family: [c_char; ARHOST_MAX_FAMILY],
        state: arhost_marker_state,
        age_frames: u32,
        corners_px: [[f64; 2]; 4],
        mt: [f64; 16],
        mt_alternative: [f64; 16],
        reprojection_px: f64,
        ambiguity: f64,
    }
    struct arhost_tracker_setup {
        struct_size: u32,
        marker_count: u32,
        format: *const arhost_frame_format,
        intrinsics: *const arhost_intrinsics,
        markers: *const arhost_marker_config,
    }
    struct arhost_tracker_result {
        struct_size: u32,
        marker_count: u32,
        markers: [arhost_marker; ARHOST_MAX_MARKERS],
    }
    struct arhost_tracker {
        struct_size: u32,
        start: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_tracker_setup) -> arhost_status>,
        track: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_frame, *mut arhost_tracker_result) -> arhost_status>,
        stop: Option<unsafe extern "C" fn(*mut arhost_instance)>,
    }
    // arhost/scene.h
    struct arhost_buffer {
        offset: u64,
        count: u32,
        stride: u32,
    }
    struct arhost_geometry {
        type_: arhost_geometry_type,
        reserved: u32,
        positions: arhost_buffer,
        normals: arhost_buffer,
        texcoords: arhost_buffer,
        indices: arhost_buffer,
        joints: arhost_buffer,
        weights: arhost_buffer,
        morph_positions: arhost_buffer,
        morph_normals: arhost_buffer,
    }
    struct arhost_texture {
        format: arhost_texel_format,
        width: u32,
        height: u32,
        wrap_u: arhost_wrap,
        wrap_v: arhost_wrap,
        name: u32,
        texels: arhost_buffer,
    }
    struct arhost_material {
        model: arhost_material_model,
        colour_texture: u32,
        ambient: [f32; 3],
        diffuse: [f32; 3],
        specular: [f32; 3],
        exponent: f32,
        reflectivity: [f32; 3],
        emission: [f32; 3],
        alpha_cutoff: f32,
        metallic: f32,
        roughness: f32,
        metallic_roughness_texture: u32,
        normal_texture: u32,
        emission_texture: u32,
        index: f32,
        fresnel_exponent: f32,
        fresnel_minimum: f32,
        fresnel_maximum: f32,
        refraction: [f32; 3],
        extinction: [f32; 3],
        shadow_attenuation: [f32; 3],
        cutoff_colour: [f32; 3],
        importance_cutoff: f32,
        reflection_depth: u32,
        refraction_depth: u32,
    }
    struct arhost_object {
        geometry: u32,
        material: u32,
        role: arhost_role,
        name: u32,
        world_from_object: [f32; 12],
        moves: u32,
        deforms: u32,
        node: u32,
        skin: u32,
    }
    struct arhost_node {
        parent: u32,
        animated: u32,
        parent_from_node: [f32; 12],
        translation: [f32; 3],
        rotation: [f32; 4],
        scale: [f32; 3],
        morph_weights: arhost_buffer,
    }
    struct arhost_channel {
        node: u32,
        target: arhost_channel_target,
        interpolation: arhost_interpolation,
        reserved: u32,
        times: arhost_buffer,
        values: arhost_buffer,
    }
    struct arhost_skin {
        joints: arhost_buffer,
        node_from_mesh: arhost_buffer,
    }
    struct arhost_light {
        type_: arhost_light_type,
        falloff: arhost_falloff,
        position: [f32; 3],
        direction: [f32; 3],
        intensity: [f32; 3],
        axis_u: [f32; 3],
        axis_v: [f32; 3],
        radius: f32,
        cosine_inner: f32,
        cosine_outer: f32,
    }
    struct arhost_environment {
        texture: u32,
        intensity: f32,
        environment_from_world: [f32; 9],
        rows: arhost_buffer,
        columns: arhost_buffer,
    }
    struct arhost_scene {
        magic: u64,
        version: u32,
        struct_size: u32,
        byte_size: u64,
        axes: arhost_axes,
        max_depth: u32,
        ambient: [f32; 3],
        background: [f32; 3],
        bounds_min: [f32; 3],
        bounds_max: [f32; 3],
        shadow_alpha_opaque: f32,
        shadow_alpha_translucent: f32,
        coloured_shadows: u32,
        duration_s: f32,
        environment: arhost_environment,
        geometries: arhost_buffer,
        textures: arhost_buffer,
        materials: arhost_buffer,
        objects: arhost_buffer,
        lights: arhost_buffer,
        nodes: arhost_buffer,
        channels: arhost_buffer,
        skins: arhost_buffer,
        names: arhost_buffer,
    }
    // arhost/motion.h
    struct arhost_moved_object {
        object: u32,
        world_from_object: [f32; 12],
    }
    struct arhost_deformed_geometry {
        object: u32,
        vertex_count: u32,
        positions: *const f32,
        normals: *const f32,
    }
    struct arhost_motion {
        struct_size: u32,
        moved_count: u32,
        moved: *const arhost_moved_object,
        deformed: *const arhost_deformed_geometry,
        deformed_count: u32,
        reserved: u32,
    }
    // arhost/raytracer.h
    struct arhost_raytracer_setup {
        struct_size: u32,
        width: u32,
        height: u32,
        reserved: u32,
        scene: *const arhost_scene,
        intrinsics: *const arhost_intrinsics,
    }
    struct arhost_render_request {
        struct_size: u32,
        reserved: u32,
        sequence: u64,
        time_s: f64,
        camera: arhost_camera,
        motion: *const arhost_motion,
    }
    struct arhost_image {
        struct_size: u32,
        stride: u32,
        width: u32,
        height: u32,
        rgba: *mut u8,
    }
    struct arhost_render_info {
        struct_size: u32,
        has_region: i32,
        region_x: u32,
        region_y: u32,
        region_width: u32,
        region_height: u32,
        device_time_ns: u64,
    }
    struct arhost_raytracer {
        struct_size: u32,
        start: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_raytracer_setup) -> arhost_status>,
        render: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_render_request, *const arhost_image, *mut arhost_render_info) -> arhost_status>,
        stop: Option<unsafe extern "C" fn(*mut arhost_instance)>,
    }
    // arhost/sink.h
    struct arhost_sink_setup {
        struct_size: u32,
        width: u32,
        height: u32,
        reserved: u32,
        fps: f64,
        first_sequence: u64,
        intrinsics: *const arhost_intrinsics,
    }
    struct arhost_record {
        struct_size: u32,
        clock: arhost_clock,
        sequence: u64,
        capture_ns: i64,
        overlay: arhost_overlay,
        has_camera: i32,
        has_truth: i32,
        truth_id: i32,
        true_mt: [f64; 16],
        camera: arhost_camera,
        marker_count: u32,
        reserved: u32,
        markers: [arhost_marker; ARHOST_MAX_MARKERS],
    }
    struct arhost_output {
        struct_size: u32,
        stride: u32,
        width: u32,
        height: u32,
        bgr: *const u8,
        record: *const arhost_record,
    }
    struct arhost_sink {
        struct_size: u32,
        start: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_sink_setup) -> arhost_status>,
        write: Option<unsafe extern "C" fn(*mut arhost_instance, *const arhost_output) -> arhost_status>,
        idle: Option<unsafe extern "C" fn(*mut arhost_instance) -> arhost_status>,
        stop: Option<unsafe extern "C" fn(*mut arhost_instance) -> arhost_status>,
    }
}
