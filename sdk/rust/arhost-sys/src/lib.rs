// SPDX-License-Identifier: Apache-2.0
//! The C ABI for plugins of arhost. The declarations are those of the headers, under the same names; on top of them
//! are four traits ([`Source`], [`Tracker`], [`Raytracer`], [`Sink`]) and one macro ([`plugin!`]) that turn a Rust
//! type into a plugin. No panic leaves a function: it becomes a logged message and `ARHOST_STATUS_ERROR_INTERNAL`.
#![allow(non_camel_case_types)]

mod abi;
mod plugin;
mod views;

pub use abi::*;
pub use plugin::*;
pub use views::*;
