//! @NAME@: a ray tracer for arhost. Here is the plugin, from cameras to images; what is seen along a ray is in tracer.rs.

mod tracer;
mod vec3;

use arhost_sys::*;
use tracer::{Ray, Tracer};
use vec3::*;

fn byte(share: f64) -> u8 {
    (255.0 * share.clamp(0.0, 1.0)).round() as u8
}
fn srgb(linear: f64) -> f64 {
    if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Pixel centres are at integers, rows run downwards, the camera looks along -back.
struct View<'a> {
    lens: &'a arhost_intrinsics,
    eye: Vec3,
    right: Vec3, // these three of length 1
    up: Vec3,
    back: Vec3,
}

impl View<'_> {
    fn new(camera: &arhost_camera) -> Result<View<'_>, Failure> {
        let (eye, up) = (vec3(&camera.eye), vec3(&camera.up));
        let back = eye - vec3(&camera.look_at);
        let right = cross(up, back);
        // Nor is it longer where a number is not finite.
        if !(length(right) > 1e-9 * length(up) * length(back)) {
            return Err(Failure::new(ARHOST_STATUS_ERROR_INVALID_ARGUMENT, "the camera's up is parallel to its view"));
        }
        let (right, back) = (normalised(right), normalised(back));
        Ok(View { lens: &camera.intrinsics, eye, right, up: cross(back, right), back })
    }

    fn ray(&self, column: f64, row: f64) -> Ray {
        let x = (column - self.lens.cx) / self.lens.fx;
        let y = (row - self.lens.cy) / self.lens.fy;
        let direction = normalised(x * self.right - y * self.up - self.back);
        Ray { origin: self.eye, direction, end: f64::INFINITY }
    }
}

/// The mean over a grid of rays, `side` to a side. Alpha is straight: the colour is that of what was seen, not
/// multiplied by how much of the pixel it covers.
fn pixel(tracer: &Tracer, view: &View, side: u32, column: f64, row: f64) -> [u8; 4] {
    let mut sum = Vec3([0.0; 3]); // of colours times alphas
    let mut alphas = 0.0;
    let place = |i: u32| (f64::from(i) + 0.5) / f64::from(side) - 0.5;
    for i in 0..side * side {
        let seen = tracer.look(&view.ray(column + place(i % side), row + place(i / side)));
        sum = sum + seen.alpha * seen.colour;
        alphas += seen.alpha;
    }
    let colour = if alphas > 0.0 { 1.0 / alphas * sum } else { sum };
    [byte(srgb(colour[0])), byte(srgb(colour[1])), byte(srgb(colour[2])), byte(alphas / f64::from(side * side))]
}

struct @CLASS@ {
    host: Host,
    side: u32, // of the grid of rays through a pixel
    tracer: Option<Tracer>,
}

impl Plugin for @CLASS@ {
    fn new(host: Host, options: &Options) -> Result<Self, Failure> {
        let side = (options.integer("samples") as f64).sqrt() as u32;
        Ok(@CLASS@ { host, side, tracer: None })
    }
    fn stop(&mut self) -> Result<(), Failure> {
        self.tracer = None; // the scene is no longer there
        Ok(())
    }
}

impl Raytracer for @CLASS@ {
    fn start(&mut self, setup: &arhost_raytracer_setup) -> Result<(), Failure> {
        self.tracer = Some(Tracer::new(setup.scene()));
        Ok(())
    }

    fn render(
        &mut self,
        request: &arhost_render_request,
        image: &mut Image,
        _info: &mut arhost_render_info, // it could tell a region outside of which every alpha is 0
    ) -> Result<(), Failure> {
        let view = View::new(&request.camera)?;
        let tracer = self.tracer.as_mut().expect("started");
        if let Some(now) = request.motion() {
            tracer.move_to(now);
        }
        for row in 0..image.height() {
            if self.host.cancelled() {
                return Err(Failure::new(ARHOST_STATUS_ERROR_CANCELLED, "")); // rows must not keep arhost waiting
            }
            for (column, rgba) in image.row_mut(row).iter_mut().enumerate() {
                *rgba = pixel(tracer, &view, self.side, column as f64, f64::from(row));
            }
        }
        Ok(())
    }
}

plugin! {
    raytracer @CLASS@, "@NAME@", "Traces rays by brute force.",
    capabilities: 0, // FILL IN: ARHOST_CAPABILITY_LENS_DISTORTION, once rays go through the lens
    // arhost checks the configuration against these before `new` sees a value.
    options: [
        option!(ARHOST_OPTION_INTEGER, "samples", "1", "Rays a pixel: the largest square number up to it.", 1.0, 64.0),
    ]
}
