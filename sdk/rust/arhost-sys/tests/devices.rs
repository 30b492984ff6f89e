// SPDX-License-Identifier: Apache-2.0
//! A plugin with `DEVICES` provides the extension of `arhost/devices.h`.

use arhost_sys::*;
use std::ffi::{CStr, CString};
use std::os::raw::{c_char, c_void};

struct Window;

fn list(_: Host) -> Result<Vec<Device>, Failure> {
    let size = DeviceSize { width: 4, height: 3, rates: vec![30.0, 15.0], ..DeviceSize::default() };
    let first = Device {
        kind: ARHOST_DEVICE_CAMERA,
        name: "first".into(),
        formats: vec![DeviceFormat { pixel_format: "grey".into(), sizes: vec![size; 2], ..DeviceFormat::default() }],
        controls: vec![DeviceControl { name: "gain".into(), type_: 1, value: Some(7), ..DeviceControl::default() }],
        ..Device::default()
    };
    let second = Device {
        kind: ARHOST_DEVICE_CPU,
        index: 1,
        state: ARHOST_DEVICE_STATE_UNUSABLE,
        is_default: true,
        name: "second".into(),
        serial: "u-2".into(),
        problem: "too hot".into(),
        ..Device::default()
    };
    Ok(vec![first, second])
}

impl Plugin for Window {
    const DEVICES: Option<ListDevices> = Some(list);
    fn new(_: Host, _: &Options) -> Result<Self, Failure> {
        Ok(Window)
    }
}
impl Sink for Window {
    fn start(&mut self, _: &arhost_sink_setup) -> Result<(), Failure> {
        Ok(())
    }
    fn write(&mut self, _: &Output) -> Result<bool, Failure> {
        Ok(true)
    }
}

arhost_sys::plugin! { sink Window, "org.example", "window", "Shows nothing.", capabilities: 0, options: [] }

extern "C" {
    static arhost_entry: arhost_entry_point;
}

unsafe extern "C" fn take(context: *mut c_void, device: *const arhost_device) {
    let text = |at: *const c_char| {
        if at.is_null() {
            "none".to_string()
        } else {
            CStr::from_ptr(at).to_string_lossy().into_owned()
        }
    };
    let seen = &mut *context.cast::<Vec<String>>();
    let d = &*device;
    let (serial, problem) = (text(d.serial), text(d.problem));
    let mut line = format!("{} {} {} {} {} {}", d.index, d.state, d.is_default, text(d.name), serial, problem);
    for f in std::slice::from_raw_parts(d.formats, d.format_count as usize) {
        line += &format!(" {}", text(f.pixel_format));
        for s in std::slice::from_raw_parts(f.sizes, f.size_count as usize) {
            let rates = std::slice::from_raw_parts(s.rates, s.rate_count as usize);
            line += &format!(" {}x{} {:?}", s.width, s.height, rates);
        }
    }
    for c in std::slice::from_raw_parts(d.controls, d.control_count as usize) {
        line += &format!(" {} {} {} {}", text(c.name), c.type_, c.has_value, c.value);
    }
    seen.push(line);
}

#[test]
fn the_extension_lists_the_devices() {
    let offer = arhost_offer {
        struct_size: std::mem::size_of::<arhost_offer>() as u32,
        oldest_abi_version: ARHOST_ABI_VERSION,
        newest_abi_version: ARHOST_ABI_VERSION,
    };
    let mut answer = arhost_answer {
        struct_size: std::mem::size_of::<arhost_answer>() as u32,
        abi_version: 0,
        plugin: std::ptr::null(),
    };
    let mut seen: Vec<String> = Vec::new();
    unsafe {
        assert_eq!((arhost_entry.negotiate.unwrap())(&offer, &mut answer), ARHOST_STATUS_OK);
        let get_extension = (*answer.plugin).get_extension.unwrap();
        let unknown = CString::new("arhost.unknown/1").unwrap();
        assert!(get_extension(unknown.as_ptr()).is_null());
        let devices = get_extension(ARHOST_DEVICES_EXTENSION.as_ptr().cast()).cast::<arhost_devices>();
        let context = (&mut seen as *mut Vec<String>).cast();
        assert_eq!(((*devices).list.unwrap())(std::ptr::null(), Some(take), context), ARHOST_STATUS_OK);
    }
    assert_eq!(
        seen,
        ["0 1 0 first none none grey 4x3 [30.0, 15.0] 4x3 [30.0, 15.0] gain 1 1 7", "1 4 1 second u-2 too hot"]
    );
}
