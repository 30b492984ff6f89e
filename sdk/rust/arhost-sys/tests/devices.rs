// SPDX-License-Identifier: Apache-2.0
//! A plugin with `DEVICES` provides the extension of `arhost/devices.h`.

use arhost_sys::*;
use std::ffi::{CStr, CString};
use std::os::raw::{c_char, c_void};

struct Window;

fn list(_: Host) -> Result<Vec<Device>, Failure> {
    let first = Device { kind: ARHOST_DEVICE_CPU, name: "first".into(), ..Device::default() };
    let second = Device { index: 1, is_default: true, name: "second".into(), uuid: "u-2".into(), ..first.clone() };
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

arhost_sys::plugin! { sink Window, "window", "Shows nothing.", capabilities: 0, options: [] }

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
    seen.push(format!("{} {} {} {}", d.index, d.is_default, text(d.name), text(d.uuid)));
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
    assert_eq!(seen, ["0 0 first none", "1 1 second u-2"]);
}
