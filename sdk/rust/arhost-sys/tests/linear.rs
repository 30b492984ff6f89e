// SPDX-License-Identifier: Apache-2.0
//! A ray tracer that writes linear images and reads the video.

use arhost_sys::*;
use std::mem::{size_of, zeroed};
use std::ptr::{null, null_mut};

struct Mirror;

impl Plugin for Mirror {
    fn new(_: Host, _: &Options) -> Result<Self, Failure> {
        Ok(Mirror)
    }
}
impl Raytracer for Mirror {
    fn start(&mut self, _: &arhost_raytracer_setup) -> Result<(), Failure> {
        Ok(())
    }
    /// The first pixel of each row adds the code of the video's first pixel in this row, and lets half of it through.
    fn render(
        &mut self,
        request: &mut RenderRequest,
        image: &mut Image,
        _: &mut arhost_render_info,
    ) -> Result<(), Failure> {
        let video = request.video_frame().expect("there is video");
        let stride = video.format().stride[0] as usize;
        for row in 0..image.height() {
            let code = f32::from(video.plane(0)[row as usize * stride]);
            let pixels = image.linear_row_mut(row);
            pixels.fill(UNTOUCHED);
            pixels[0] = linear_pixel([code, 0.0, 0.0], [0.5; 3]);
        }
        Ok(())
    }
}

arhost_sys::plugin! {
    raytracer Mirror, "org.example", "mirror", "Mirrors the video.",
    capabilities: ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES | ARHOST_RAYTRACER_CAPABILITY_VIDEO,
    options: []
}

extern "C" {
    static arhost_entry: arhost_entry_point;
}

#[test]
fn a_plugin_writes_linear_images_and_reads_the_video() {
    let offer = arhost_offer {
        struct_size: size_of::<arhost_offer>() as u32,
        oldest_abi_version: ARHOST_ABI_VERSION,
        newest_abi_version: ARHOST_ABI_VERSION,
    };
    let mut answer = arhost_answer { struct_size: size_of::<arhost_answer>() as u32, abi_version: 0, plugin: null() };
    unsafe {
        assert_eq!((arhost_entry.negotiate.unwrap())(&offer, &mut answer), ARHOST_STATUS_OK);
        let plugin = &*answer.plugin;
        let mut instance = null_mut();
        assert_eq!((plugin.create.unwrap())(null(), null(), 0, &mut instance), ARHOST_STATUS_OK);
        let mut format: arhost_frame_format = zeroed();
        format.pixel_format = ARHOST_PIXEL_FORMAT_GREY8;
        (format.width, format.height) = (3, 2);
        assert!(format.lay_out());
        let mut codes = vec![0u8; format.byte_size as usize];
        codes[0] = 7;
        codes[format.stride[0] as usize] = 9;
        let mut video: arhost_frame = zeroed();
        video.format = &format;
        video.plane[0] = codes.as_ptr();
        let mut request: arhost_render_request = zeroed();
        request.video = &video;
        let (stride, padding) = (32, 0xa5a5);
        let mut halves = vec![padding; 2 * stride];
        let mut image: arhost_image = zeroed();
        (image.width, image.height, image.stride) = (3, 2, 2 * stride as u32);
        image.linear = halves.as_mut_ptr();
        let mut info: arhost_render_info = zeroed();
        let render = (*plugin.functions.cast::<arhost_raytracer>()).render.unwrap();
        assert_eq!(render(instance, &request, &image, &mut info), ARHOST_STATUS_OK);
        for (row, code) in [(0, 7.0), (1, 9.0)] {
            let row = &halves[row * stride..];
            assert_eq!(row[..8], [half_of(code), 0, 0, 0, 0x3800, 0x3800, 0x3800, 0]);
            assert_eq!(row[8..16], UNTOUCHED);
            assert_eq!(row[24], padding);
        }
        (plugin.destroy.unwrap())(instance);
    }
}

#[test]
fn halves_are_rounded_to_nearest_even() {
    for (number, half) in [
        (0.0, 0),
        (-0.0, 0x8000),
        (1.0, 0x3c00),
        (-2.0, 0xc000),
        (0.1, 0x2e66),
        (1.0 + 1.0 / 2048.0, 0x3c00), // ties to even
        (1.0 + 3.0 / 2048.0, 0x3c02),
        (65504.0, 0x7bff),
        (65519.0, 0x7bff),
        (65520.0, 0x7c00),
        (1e30, 0x7c00),
        (f32::INFINITY, 0x7c00),
        (6e-8, 1),        // subnormal
        (2.9e-8, 0),
        (6.104e-5, 0x0400), // the smallest normal number
        (f32::NAN, 0x7e00),
    ] {
        assert_eq!(half_of(number), half, "{number}");
    }
}
