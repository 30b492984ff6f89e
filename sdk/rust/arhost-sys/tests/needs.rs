// SPDX-License-Identifier: Apache-2.0
//! The descriptor contains the `needs` given to `plugin!`.

use arhost_sys::*;
use std::ffi::CStr;

struct Window;

impl Plugin for Window {
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

arhost_sys::plugin! {
    sink Window, "org.example", "window", "Shows nothing.",
    capabilities: 0,
    options: [],
    needs: ["display", "gpu"]
}

extern "C" {
    static arhost_entry: arhost_entry_point;
}

#[test]
fn the_descriptor_lists_needs_and_ends_with_null() {
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
    unsafe {
        assert_eq!((arhost_entry.negotiate.unwrap())(&offer, &mut answer), ARHOST_STATUS_OK);
        let needs = (*(*answer.plugin).descriptor).needs;
        assert_eq!(CStr::from_ptr(*needs).to_str(), Ok("display"));
        assert_eq!(CStr::from_ptr(*needs.add(1)).to_str(), Ok("gpu"));
        assert!((*needs.add(2)).is_null());
    }
}
