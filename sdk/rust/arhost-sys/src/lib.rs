// SPDX-License-Identifier: Apache-2.0
//! The C ABI for plugins of arhost: the declarations of the C headers under their own names, a trait for each kind of
//! plugin ([`Source`], [`Tracker`], [`Raytracer`], [`Sink`]), and the macro [`plugin!`], which exports a Rust type as a
//! plugin. A panic does not cross the ABI: it becomes a logged message and `ARHOST_STATUS_ERROR_INTERNAL`.
#![allow(non_camel_case_types)]

mod abi;
mod plugin;
mod views;

pub use abi::*;
pub use plugin::*;
pub use views::*;
