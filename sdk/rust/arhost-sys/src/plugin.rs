// SPDX-License-Identifier: Apache-2.0
//! Exports a Rust type as a plugin.

use crate::abi::*;
use crate::views::*;
use std::ffi::{CStr, CString};
use std::os::raw::{c_char, c_void};
use std::panic::{catch_unwind, AssertUnwindSafe};

/// An error for the user: an `ARHOST_STATUS_ERROR_…`, and a message that says what to change.
#[derive(Debug)]
pub struct Failure {
    pub status: arhost_status,
    pub message: String,
}

impl Failure {
    pub fn new(status: arhost_status, message: impl Into<String>) -> Self {
        Failure { status, message: message.into() }
    }
}
impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Failure::new(ARHOST_STATUS_ERROR_IO, error.to_string())
    }
}

/// The host's callbacks; all functions may be called on any thread.
#[derive(Clone, Copy)]
pub struct Host(*const arhost_host);
unsafe impl Send for Host {}
unsafe impl Sync for Host {}

impl Host {
    pub fn log(&self, severity: arhost_severity, text: &str) {
        let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
        unsafe {
            if let Some(log) = (*self.0).log {
                log(self.0, severity, text.as_ptr());
            }
        }
    }
    pub fn info(&self, text: &str) {
        self.log(ARHOST_SEVERITY_INFO, text);
    }
    /// Tells what a frame shows instead of the targets; for trackers (`ARHOST_SEVERITY_HINT`).
    pub fn hint(&self, text: &str) {
        self.log(ARHOST_SEVERITY_HINT, text);
    }
    pub fn warn(&self, text: &str) {
        self.log(ARHOST_SEVERITY_WARNING, text);
    }
    /// Reports progress (0 to 1) and restarts the deadline of the running call. Call it at least every few seconds in
    /// a function that takes long or waits.
    pub fn progress(&self, fraction: f64, what: &str) {
        let what = CString::new(what.replace('\0', " ")).unwrap_or_default();
        unsafe {
            if let Some(progress) = (*self.0).progress {
                progress(self.0, fraction, what.as_ptr());
            }
        }
    }
    /// True if the running call must return soon, with `ARHOST_STATUS_ERROR_CANCELLED`.
    pub fn cancelled(&self) -> bool {
        unsafe { (*self.0).cancelled.map_or(false, |cancelled| cancelled(self.0) != 0) }
    }
}

/// The option values. Panics on a key that the plugin does not declare.
pub struct Options<'a>(Vec<&'a arhost_option>);

impl Options<'_> {
    fn find(&self, key: &str) -> &arhost_option {
        self.0
            .iter()
            .find(|option| unsafe { CStr::from_ptr(option.key) }.to_bytes() == key.as_bytes())
            .unwrap_or_else(|| panic!("the option '{}' is not declared", key))
    }
    pub fn boolean(&self, key: &str) -> bool {
        self.find(key).integer != 0
    }
    pub fn integer(&self, key: &str) -> i64 {
        self.find(key).integer
    }
    pub fn real(&self, key: &str) -> f64 {
        self.find(key).real
    }
    pub fn text(&self, key: &str) -> String {
        unsafe { CStr::from_ptr(self.find(key).text) }.to_string_lossy().into_owned()
    }
}

/// A device that the plugin can run on: the fields of `arhost_device`, with "" for NULL.
#[derive(Clone, Debug)]
pub struct Device {
    pub index: u32,
    pub kind: arhost_device_kind,
    pub state: arhost_device_state,
    pub is_default: bool,
    pub name: String,
    pub path: String,
    pub serial: String,
    pub abilities: String,
    pub problem: String,
    /// Cameras.
    pub formats: Vec<DeviceFormat>,
    /// Cameras.
    pub controls: Vec<DeviceControl>,
    /// Displays: px.
    pub width: u32,
    /// Displays: px.
    pub height: u32,
    /// Displays: refreshes per second.
    pub rate: f64,
}
impl Default for Device {
    fn default() -> Self {
        Device {
            index: 0,
            kind: ARHOST_DEVICE_OTHER,
            state: ARHOST_DEVICE_STATE_USABLE,
            is_default: false,
            name: String::new(),
            path: String::new(),
            serial: String::new(),
            abilities: String::new(),
            problem: String::new(),
            formats: Vec::new(),
            controls: Vec::new(),
            width: 0,
            height: 0,
            rate: 0.0,
        }
    }
}
/// A pixel format of a camera: the fields of `arhost_device_format`.
#[derive(Clone, Debug, Default)]
pub struct DeviceFormat {
    pub pixel_format: String,
    pub sizes: Vec<DeviceSize>,
    pub is_size_range: bool,
}
/// A picture size of a camera: the fields of `arhost_device_size`.
#[derive(Clone, Debug, Default)]
pub struct DeviceSize {
    pub width: u32,
    pub height: u32,
    pub rates: Vec<f64>,
    pub is_rate_range: bool,
}
/// A control of a camera: the fields of `arhost_device_control`.
#[derive(Clone, Debug, Default)]
pub struct DeviceControl {
    pub name: String,
    pub type_: arhost_device_control_type,
    pub minimum: i64,
    pub maximum: i64,
    pub step: i64,
    pub default_value: i64,
    pub value: Option<i64>,
}

/// Lists the devices that a plugin can run on, before an instance exists (arhost/devices.h).
pub type ListDevices = fn(Host) -> Result<Vec<Device>, Failure>;

/// Common to all kinds of plugin.
pub trait Plugin: Sized {
    /// The extension "arhost.devices/2": `Some(list)` if the user can choose among devices.
    const DEVICES: Option<ListDevices> = None;
    fn new(host: Host, options: &Options) -> Result<Self, Failure>;
    fn stop(&mut self) -> Result<(), Failure> {
        Ok(())
    }
}

pub trait Source: Plugin {
    /// Set pixel_format, width, height and fps of `properties.format`; its layout is filled in afterwards.
    fn start(&mut self, setup: &arhost_source_setup, properties: &mut arhost_source_properties) -> Result<(), Failure>;
    /// Returns false at the end of the sequence.
    fn read(&mut self, buffer: &mut FrameBuffer, info: &mut arhost_frame_info) -> Result<bool, Failure>;
}

pub trait Tracker: Plugin {
    fn start(&mut self, setup: &arhost_tracker_setup) -> Result<(), Failure>;
    fn track(&mut self, request: &mut TrackRequest, result: &mut TrackResult) -> Result<(), Failure>;
    /// The size in bytes of `TrackRequest::state_before` and `state_after`.
    fn state_size(&self) -> u64 {
        0
    }
    /// The height of the picture of a marker of the family "image", divided by its width.
    fn aspect(&self, _marker: u32) -> f64 {
        1.0
    }
}

pub trait Raytracer: Plugin {
    fn start(&mut self, setup: &arhost_raytracer_setup) -> Result<(), Failure>;
    fn render(
        &mut self,
        request: &mut RenderRequest,
        image: &mut Image,
        info: &mut arhost_render_info,
    ) -> Result<(), Failure>;
    /// The size in bytes of `RenderRequest::state_before` and `state_after`.
    fn state_size(&self) -> u64 {
        0
    }
}

pub trait Sink: Plugin {
    fn start(&mut self, setup: &arhost_sink_setup) -> Result<(), Failure>;
    /// Returns false if the user closed the window: the host then closes this output.
    fn write(&mut self, output: &Output) -> Result<bool, Failure>;
}

/// Defines `arhost_entry`, the symbol that a plugin exports:
///
/// ```ignore
/// arhost_sys::plugin! {
///     sink MySink, "org.example", "my_sink", "Counts frames.", // vendor and file name make the id "org.example.my_sink"
///     capabilities: 0,
///     options: [
///         option!(ARHOST_OPTION_INTEGER, "every", "1", "Counts every n-th frame.", 1.0, 1e6),
///         option!(ARHOST_OPTION_OUTPUT_PATH, "path", required, "The file to write."),
///     ],
///     needs: ["gpu"] // optional: permissions from the sandbox (arhost/plugin.h)
/// }
/// ```
#[macro_export]
macro_rules! plugin {
    ($kind:ident $type:ty, $vendor:literal, $name:literal, $description:literal, capabilities: $capabilities:expr,
     options: [$($option:expr),* $(,)?] $(, needs: [$($need:literal),* $(,)?])? $(,)?) => {
        const _: () = {
            const NEEDS: &[*const std::os::raw::c_char] = &[$($($crate::c_text!($need),)*)? std::ptr::null()];
            const OPTIONS: &[$crate::arhost_option_descriptor] = &[$($option),*];
            static DESCRIPTOR: $crate::arhost_descriptor = $crate::arhost_descriptor {
                struct_size: std::mem::size_of::<$crate::arhost_descriptor>() as u32,
                kind: $crate::kind::$kind,
                id: $crate::c_text!(concat!($vendor, ".", $name)),
                name: $crate::c_text!($name),
                version: $crate::c_text!(env!("CARGO_PKG_VERSION")),
                vendor: $crate::c_text!(env!("CARGO_PKG_AUTHORS")),
                licence: $crate::c_text!(env!("CARGO_PKG_LICENSE")),
                description: $crate::c_text!($description),
                capabilities: $capabilities,
                option_count: OPTIONS.len() as u64,
                options: OPTIONS.as_ptr(),
                needs: NEEDS.as_ptr(),
            };
            static FUNCTIONS: $crate::table::$kind = $crate::$kind::<$type>();
            static PLUGIN: $crate::arhost_plugin = $crate::plugin_of::<$type>(
                &DESCRIPTOR,
                &FUNCTIONS as *const $crate::table::$kind as *const std::os::raw::c_void,
            );
            unsafe extern "C" fn negotiate(
                offer: *const $crate::arhost_offer,
                answer: *mut $crate::arhost_answer,
            ) -> $crate::arhost_status {
                // Check the sizes before creating references: the structs may be truncated.
                if (*offer).struct_size < std::mem::size_of::<$crate::arhost_offer>() as u32
                    || (*answer).struct_size < std::mem::size_of::<$crate::arhost_answer>() as u32
                {
                    return $crate::ARHOST_STATUS_ERROR_UNSUPPORTED;
                }
                $crate::negotiate(&*offer, &mut *answer, &PLUGIN)
            }
            #[no_mangle]
            pub static arhost_entry: $crate::arhost_entry_point = $crate::arhost_entry_point {
                struct_size: std::mem::size_of::<$crate::arhost_entry_point>() as u32,
                reserved: 0,
                negotiate: Some(negotiate),
            };
        };
    };
}

/// One option of [`plugin!`]: type, key, default (in YAML syntax) or `required`, help, and the bounds of a number.
#[macro_export]
macro_rules! option {
    (@ $type:expr, $key:literal, $default:expr, $help:literal, $minimum:expr, $maximum:expr) => {
        $crate::arhost_option_descriptor {
            struct_size: std::mem::size_of::<$crate::arhost_option_descriptor>() as u32,
            type_: $type,
            key: $crate::c_text!($key),
            default_value: $default,
            minimum: $minimum,
            maximum: $maximum,
            choices: std::ptr::null(),
            help: $crate::c_text!($help),
        }
    };
    ($type:expr, $key:literal, required, $help:literal) => {
        $crate::option!(@ $type, $key, std::ptr::null(), $help, 0.0, 0.0)
    };
    ($type:expr, $key:literal, $default:literal, $help:literal) => {
        $crate::option!(@ $type, $key, $crate::c_text!($default), $help, 0.0, 0.0)
    };
    ($type:expr, $key:literal, $default:literal, $help:literal, $minimum:expr, $maximum:expr) => {
        $crate::option!(@ $type, $key, $crate::c_text!($default), $help, $minimum, $maximum)
    };
}

/// A NUL-terminated string literal.
#[doc(hidden)]
#[macro_export]
macro_rules! c_text {
    ($text:expr) => {
        concat!($text, "\0").as_ptr() as *const std::os::raw::c_char
    };
}

// ---- used by the macro ----

#[doc(hidden)]
#[allow(non_upper_case_globals)]
pub mod kind {
    pub const source: crate::arhost_kind = crate::ARHOST_KIND_SOURCE;
    pub const tracker: crate::arhost_kind = crate::ARHOST_KIND_TRACKER;
    pub const raytracer: crate::arhost_kind = crate::ARHOST_KIND_RAYTRACER;
    pub const sink: crate::arhost_kind = crate::ARHOST_KIND_SINK;
}
#[doc(hidden)]
pub mod table {
    pub type source = crate::arhost_source;
    pub type tracker = crate::arhost_tracker;
    pub type raytracer = crate::arhost_raytracer;
    pub type sink = crate::arhost_sink;
}

struct Instance<T> {
    host: Host,
    plugin: T,
    /// Trackers: of the setup.
    target_count: u32,
}

/// Runs `call`; logs an error or a panic and converts it to a status.
fn guarded(host: Host, call: impl FnOnce() -> Result<arhost_status, Failure>) -> arhost_status {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(Ok(status)) => status,
        Ok(Err(failure)) => {
            if failure.status != ARHOST_STATUS_ERROR_CANCELLED {
                host.log(ARHOST_SEVERITY_ERROR, &failure.message);
            }
            failure.status
        }
        Err(panic) => {
            let text = panic
                .downcast_ref::<String>()
                .cloned()
                .or_else(|| panic.downcast_ref::<&str>().map(|text| text.to_string()));
            host.log(ARHOST_SEVERITY_ERROR, &format!("panicked: {}", text.as_deref().unwrap_or("no message")));
            ARHOST_STATUS_ERROR_INTERNAL
        }
    }
}

unsafe fn with<T>(
    instance: *mut arhost_instance,
    call: impl FnOnce(&mut T) -> Result<arhost_status, Failure>,
) -> arhost_status {
    let instance = &mut *instance.cast::<Instance<T>>();
    let plugin = &mut instance.plugin;
    guarded(instance.host, || call(plugin))
}

fn ok_or_end(more: bool) -> arhost_status {
    if more {
        ARHOST_STATUS_OK
    } else {
        ARHOST_STATUS_END
    }
}

unsafe extern "C" fn create<T: Plugin>(
    host: *const arhost_host,
    options: *const arhost_option,
    option_count: u32,
    instance: *mut *mut arhost_instance,
) -> arhost_status {
    guarded(Host(host), || {
        let plugin = T::new(Host(host), &Options(elements(options, option_count)))?;
        *instance = Box::into_raw(Box::new(Instance { host: Host(host), plugin, target_count: 0 })).cast();
        Ok(ARHOST_STATUS_OK)
    })
}
unsafe extern "C" fn destroy<T: Plugin>(instance: *mut arhost_instance) {
    let instance = Box::from_raw(instance.cast::<Instance<T>>());
    guarded(instance.host, || {
        drop(instance.plugin);
        Ok(ARHOST_STATUS_OK)
    });
}
unsafe extern "C" fn stop<T: Plugin>(instance: *mut arhost_instance) {
    stop_sink::<T>(instance);
}
unsafe extern "C" fn stop_sink<T: Plugin>(instance: *mut arhost_instance) -> arhost_status {
    with(instance, |plugin: &mut T| plugin.stop().map(|()| ARHOST_STATUS_OK))
}
struct Devices<T>(std::marker::PhantomData<T>);
impl<T: Plugin> Devices<T> {
    const TABLE: &'static arhost_devices =
        &arhost_devices {
            struct_size: std::mem::size_of::<arhost_devices>() as u32,
            reserved: 0,
            list: Some(list_devices::<T>),
        };
}
unsafe extern "C" fn get_extension<T: Plugin>(id: *const c_char) -> *const c_void {
    if T::DEVICES.is_some() && CStr::from_ptr(id).to_bytes_with_nul() == ARHOST_DEVICES_EXTENSION {
        Devices::<T>::TABLE as *const arhost_devices as *const c_void
    } else {
        std::ptr::null()
    }
}
unsafe extern "C" fn list_devices<T: Plugin>(
    host: *const arhost_host,
    take: arhost_take_device,
    context: *mut c_void,
) -> arhost_status {
    guarded(Host(host), || {
        let list = T::DEVICES.map_or(Ok(Vec::new()), |list| list(Host(host)))?;
        if let Some(take) = take {
            list.iter().for_each(|device| report(device, take, context));
        }
        Ok(ARHOST_STATUS_OK)
    })
}
unsafe fn report(d: &Device, take: unsafe extern "C" fn(*mut c_void, *const arhost_device), context: *mut c_void) {
    let c_text = |text: &str| CString::new(text.replace('\0', " ")).unwrap_or_default();
    let or_null = |text: &CString| {
        if text.as_bytes().is_empty() {
            std::ptr::null()
        } else {
            text.as_ptr()
        }
    };
    let c_size = |s: &DeviceSize| arhost_device_size {
        struct_size: std::mem::size_of::<arhost_device_size>() as u32,
        reserved: 0,
        width: s.width,
        height: s.height,
        rate_count: s.rates.len() as u32,
        is_rate_range: s.is_rate_range.into(),
        rates: s.rates.as_ptr(),
    };
    let sizes: Vec<Vec<arhost_device_size>> = d.formats.iter().map(|f| f.sizes.iter().map(c_size).collect()).collect();
    let format_names: Vec<CString> = d.formats.iter().map(|f| c_text(&f.pixel_format)).collect();
    let formats: Vec<arhost_device_format> = (0..d.formats.len())
        .map(|i| arhost_device_format {
            struct_size: std::mem::size_of::<arhost_device_format>() as u32,
            reserved: 0,
            size_count: sizes[i].len() as u32,
            is_size_range: d.formats[i].is_size_range.into(),
            pixel_format: format_names[i].as_ptr(),
            sizes: sizes[i].as_ptr(),
        })
        .collect();
    let control_names: Vec<CString> = d.controls.iter().map(|c| c_text(&c.name)).collect();
    let controls: Vec<arhost_device_control> = (d.controls.iter().zip(&control_names))
        .map(|(c, name)| arhost_device_control {
            struct_size: std::mem::size_of::<arhost_device_control>() as u32,
            reserved: 0,
            type_: c.type_,
            has_value: c.value.is_some().into(),
            name: name.as_ptr(),
            minimum: c.minimum,
            maximum: c.maximum,
            step: c.step,
            default_value: c.default_value,
            value: c.value.unwrap_or(0),
        })
        .collect();
    let (name, path, serial) = (c_text(&d.name), c_text(&d.path), c_text(&d.serial));
    let (abilities, problem) = (c_text(&d.abilities), c_text(&d.problem));
    let device = arhost_device {
        struct_size: std::mem::size_of::<arhost_device>() as u32,
        reserved: 0,
        index: d.index,
        kind: d.kind,
        state: d.state,
        is_default: d.is_default.into(),
        format_count: formats.len() as u32,
        control_count: controls.len() as u32,
        width: d.width,
        height: d.height,
        rate: d.rate,
        name: name.as_ptr(),
        path: or_null(&path),
        serial: or_null(&serial),
        abilities: or_null(&abilities),
        problem: or_null(&problem),
        formats: formats.as_ptr(),
        controls: controls.as_ptr(),
    };
    take(context, &device);
}

#[doc(hidden)]
pub const fn plugin_of<T: Plugin>(descriptor: &'static arhost_descriptor, functions: *const c_void) -> arhost_plugin {
    arhost_plugin {
        struct_size: std::mem::size_of::<arhost_plugin>() as u32,
        reserved: 0,
        descriptor,
        functions,
        create: Some(create::<T>),
        destroy: Some(destroy::<T>),
        get_extension: Some(get_extension::<T>),
    }
}

#[doc(hidden)]
pub fn negotiate(offer: &arhost_offer, answer: &mut arhost_answer, plugin: &'static arhost_plugin) -> arhost_status {
    if !(offer.oldest_abi_version..=offer.newest_abi_version).contains(&ARHOST_ABI_VERSION) {
        return ARHOST_STATUS_ERROR_UNSUPPORTED;
    }
    answer.abi_version = ARHOST_ABI_VERSION;
    answer.plugin = plugin;
    ARHOST_STATUS_OK
}

unsafe extern "C" fn start_source<T: Source>(
    instance: *mut arhost_instance,
    setup: *const arhost_source_setup,
    properties: *mut arhost_source_properties,
) -> arhost_status {
    with(instance, |plugin: &mut T| {
        plugin.start(&*setup, &mut *properties)?;
        if !(*properties).format.lay_out() {
            return Err(Failure::new(ARHOST_STATUS_ERROR_CONFIGURATION, "invalid frame format or size"));
        }
        Ok(ARHOST_STATUS_OK)
    })
}
unsafe extern "C" fn read<T: Source>(
    instance: *mut arhost_instance,
    buffer: *const arhost_frame_buffer,
    info: *mut arhost_frame_info,
) -> arhost_status {
    with(instance, |plugin: &mut T| plugin.read(&mut FrameBuffer(&*buffer), &mut *info).map(ok_or_end))
}
#[doc(hidden)]
pub const fn source<T: Source>() -> arhost_source {
    arhost_source {
        struct_size: std::mem::size_of::<arhost_source>() as u32,
        reserved: 0,
        start: Some(start_source::<T>),
        read: Some(read::<T>),
        stop: Some(stop::<T>),
    }
}

unsafe extern "C" fn start_tracker<T: Tracker>(
    instance: *mut arhost_instance,
    setup: *const arhost_tracker_setup,
) -> arhost_status {
    (*instance.cast::<Instance<T>>()).target_count = (*setup).target_count;
    with(instance, |plugin: &mut T| plugin.start(&*setup).map(|()| ARHOST_STATUS_OK))
}
unsafe extern "C" fn track<T: Tracker>(
    instance: *mut arhost_instance,
    request: *const arhost_track_request,
    result: *mut arhost_tracker_result,
) -> arhost_status {
    let target_count = (*instance.cast::<Instance<T>>()).target_count;
    with(instance, |plugin: &mut T| {
        let mut result = TrackResult { result: &mut *result, target_count };
        plugin.track(&mut TrackRequest(&*request), &mut result).map(|()| ARHOST_STATUS_OK)
    })
}
unsafe extern "C" fn state_size<T: Tracker>(instance: *mut arhost_instance) -> u64 {
    let mut size = 0;
    with(instance, |plugin: &mut T| {
        size = plugin.state_size();
        Ok(ARHOST_STATUS_OK)
    });
    size
}
unsafe extern "C" fn aspect<T: Tracker>(instance: *mut arhost_instance, marker: u32) -> f64 {
    let mut aspect = f64::NAN;
    with(instance, |plugin: &mut T| {
        aspect = plugin.aspect(marker);
        Ok(ARHOST_STATUS_OK)
    });
    aspect
}
#[doc(hidden)]
pub const fn tracker<T: Tracker>() -> arhost_tracker {
    arhost_tracker {
        struct_size: std::mem::size_of::<arhost_tracker>() as u32,
        reserved: 0,
        start: Some(start_tracker::<T>),
        track: Some(track::<T>),
        stop: Some(stop::<T>),
        state_size: Some(state_size::<T>),
        aspect: Some(aspect::<T>),
    }
}

unsafe extern "C" fn raytracer_state_size<T: Raytracer>(instance: *mut arhost_instance) -> u64 {
    let mut size = 0;
    with(instance, |plugin: &mut T| {
        size = plugin.state_size();
        Ok(ARHOST_STATUS_OK)
    });
    size
}
unsafe extern "C" fn start_raytracer<T: Raytracer>(
    instance: *mut arhost_instance,
    setup: *const arhost_raytracer_setup,
) -> arhost_status {
    with(instance, |plugin: &mut T| plugin.start(&*setup).map(|()| ARHOST_STATUS_OK))
}
unsafe extern "C" fn render<T: Raytracer>(
    instance: *mut arhost_instance,
    request: *const arhost_render_request,
    image: *const arhost_image,
    info: *mut arhost_render_info,
) -> arhost_status {
    with(instance, |plugin: &mut T| {
        plugin.render(&mut RenderRequest(&*request), &mut Image(&*image), &mut *info).map(|()| ARHOST_STATUS_OK)
    })
}
#[doc(hidden)]
pub const fn raytracer<T: Raytracer>() -> arhost_raytracer {
    arhost_raytracer {
        struct_size: std::mem::size_of::<arhost_raytracer>() as u32,
        reserved: 0,
        start: Some(start_raytracer::<T>),
        render: Some(render::<T>),
        stop: Some(stop::<T>),
        capabilities: None,
        state_size: Some(raytracer_state_size::<T>),
    }
}

unsafe extern "C" fn start_sink<T: Sink>(
    instance: *mut arhost_instance,
    setup: *const arhost_sink_setup,
) -> arhost_status {
    with(instance, |plugin: &mut T| plugin.start(&*setup).map(|()| ARHOST_STATUS_OK))
}
unsafe extern "C" fn write<T: Sink>(instance: *mut arhost_instance, output: *const arhost_output) -> arhost_status {
    with(instance, |plugin: &mut T| plugin.write(&Output(&*output)).map(ok_or_end))
}
#[doc(hidden)]
pub const fn sink<T: Sink>() -> arhost_sink {
    arhost_sink {
        struct_size: std::mem::size_of::<arhost_sink>() as u32,
        reserved: 0,
        start: Some(start_sink::<T>),
        write: Some(write::<T>),
        idle: None,
        stop: Some(stop_sink::<T>),
        capabilities: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::size_of;

    /// A struct as extended by a newer host.
    #[repr(C)]
    #[derive(Clone, Copy)]
    struct Longer<T>(T, [u64; 2]);

    #[test]
    fn steps_through_extended_elements() {
        let option = |key: &'static [u8], integer| {
            let struct_size = size_of::<Longer<arhost_option>>() as u32;
            let (key, text) = (key.as_ptr().cast(), b"\0".as_ptr().cast());
            Longer(arhost_option { struct_size, type_: ARHOST_OPTION_INTEGER, key, integer, real: 0.0, text }, [!0; 2])
        };
        let passed = [option(b"a\0", 1), option(b"b\0", 2), option(b"c\0", 3)];
        let options = Options(unsafe { elements(passed.as_ptr().cast(), 3) });
        assert_eq!((options.integer("a"), options.integer("b"), options.integer("c")), (1, 2, 3));

        let marker = |id, target| {
            let struct_size = size_of::<Longer<arhost_marker_config>>() as u32;
            let corners_mm = [[f64::from(id), 1.0, 2.0]; 4];
            let (file, pattern_ratio) = (std::ptr::null(), 0.0);
            let marker =
                arhost_marker_config { struct_size, id, family: 0, target, corners_mm, file, pattern_ratio };
            Longer(marker, [!0; 2])
        };
        let listed = [marker(4, 0), marker(7, 1)];
        let target = |name: &'static [u8], body: Option<&'static [u8]>| {
            let struct_size = size_of::<Longer<arhost_target_config>>() as u32;
            let body = body.map_or(std::ptr::null(), |body| body.as_ptr().cast());
            Longer(arhost_target_config { struct_size, reserved: 0, name: name.as_ptr().cast(), body }, [!0; 2])
        };
        let targets = [target(b"cup\0", None), target(b"head\0", Some(b"rig\0"))];
        let families = [b"tag36h11\0".as_ptr().cast::<c_char>()];
        let mut setup: arhost_tracker_setup = unsafe { std::mem::zeroed() };
        setup.target_count = 2;
        setup.targets = targets.as_ptr().cast();
        setup.marker_count = 2;
        setup.markers = listed.as_ptr().cast();
        setup.family_count = 1;
        setup.families = families.as_ptr();
        let read: Vec<_> = setup.markers().iter().map(|m| (m.id, m.target, m.corners_mm[3][0])).collect();
        assert_eq!(read, [(4, 0, 4.0), (7, 1, 7.0)]);
        let read: Vec<_> = setup.targets().iter().map(|t| (t.name(), t.body())).collect();
        assert_eq!(read, [("cup".into(), None), ("head".into(), Some("rig".into()))]);
        assert_eq!(setup.families(), ["tag36h11"]);
    }

    #[test]
    fn a_result_takes_no_more_than_its_capacity() {
        let empty = Longer(arhost_observation::default(), [!0; 2]);
        let mut observations = vec![empty; ARHOST_MAX_OBSERVATIONS + 1];
        for each in &mut observations {
            each.0.struct_size = size_of::<Longer<arhost_observation>>() as u32;
        }
        let pose = arhost_body_pose {
            struct_size: size_of::<arhost_body_pose>() as u32,
            target: 1,
            state: ARHOST_TARGET_DETECTED,
            age_frames: 0,
            mt: [0.0; 16],
            covariance: [0.0; 36],
        };
        let mut poses = [arhost_body_pose { target: 0, ..pose }; 3];
        let mut raw: arhost_tracker_result = unsafe { std::mem::zeroed() };
        raw.observations = observations.as_mut_ptr().cast();
        raw.poses = poses.as_mut_ptr();
        let mut result = TrackResult { result: &mut raw, target_count: 2 };
        for id in 0..ARHOST_MAX_OBSERVATIONS as i32 {
            assert!(result.observe(arhost_observation { id, family: 1, ..Default::default() }));
        }
        assert!(!result.observe(arhost_observation { family: 1, ..Default::default() }));
        assert!(result.report_pose(pose) && result.report_pose(pose) && !result.report_pose(pose));
        result.set_candidate_count(u32::MAX);
        assert_eq!((raw.observation_count, raw.pose_count), (ARHOST_MAX_OBSERVATIONS as u32, 2));
        assert_eq!(raw.candidate_count, i32::MAX);
        let last = &observations[ARHOST_MAX_OBSERVATIONS - 1];
        assert_eq!((last.0.id, last.0.family), (ARHOST_MAX_OBSERVATIONS as i32 - 1, 1));
        assert_eq!(last.0.struct_size, size_of::<Longer<arhost_observation>>() as u32);
        assert_eq!((last.1, observations[ARHOST_MAX_OBSERVATIONS].0.family), ([!0; 2], 0));
        assert_eq!(poses.map(|p| p.target), [1, 1, 0]);
    }

    #[test]
    fn a_record_names_targets_and_families() {
        fn put(to: &mut [c_char], name: &[u8]) {
            to.iter_mut().zip(name).for_each(|(to, &from)| *to = from as c_char);
        }
        let mut target: arhost_target = unsafe { std::mem::zeroed() };
        target.struct_size = size_of::<arhost_target>() as u32;
        put(&mut target.name, b"cup");
        let seen = arhost_observation { id: 3, family: 1, ..Default::default() };
        let mut record: arhost_record = unsafe { std::mem::zeroed() };
        assert!(record.targets().is_empty() && record.observations().is_empty() && record.truth_target().is_none());
        (record.target_count, record.targets) = (1, &target);
        (record.observation_count, record.observations) = (1, &seen);
        put(&mut record.families[1], &[b'f'; ARHOST_MAX_FAMILY]); // without a NUL
        record.has_truth = 1;
        put(&mut record.truth_target, b"desk");
        assert_eq!(record.targets()[0].name(), "cup");
        assert_eq!(record.family(record.observations()[0]), "f".repeat(ARHOST_MAX_FAMILY));
        assert_eq!(record.truth_target().unwrap(), "desk");
    }

    #[test]
    fn accepts_a_null_array_without_elements() {
        assert!(unsafe { elements::<arhost_option>(std::ptr::null(), 0) }.is_empty());
    }
}
