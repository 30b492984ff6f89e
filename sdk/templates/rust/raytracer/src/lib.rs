//! @NAME@: a ray tracer for arhost. It draws one sphere that fills the scene's bounds.

use arhost_sys::*;

type Vec3 = [f64; 3];

fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
/// a + s·b
fn along(a: Vec3, s: f64, b: Vec3) -> Vec3 {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}
fn normalised(a: Vec3) -> Vec3 {
    along([0.0; 3], 1.0 / dot(a, a).sqrt(), a)
}

fn srgb_byte(linear: f64) -> u8 {
    let encoded = if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (255.0 * encoded.clamp(0.0, 1.0)).round() as u8
}

struct @CLASS@ {
    host: Host,
    colour: Vec3, // linear light
    centre: Vec3, // mm, as all of the scene
    radius: f64,
}

impl @CLASS@ {
    /// What is seen along a ray of unit direction, in linear light; nothing where it misses.
    fn trace(&self, origin: Vec3, direction: Vec3) -> Option<Vec3> {
        let from_centre = along(origin, -1.0, self.centre);
        let b = dot(from_centre, direction);
        let discriminant = b * b - dot(from_centre, from_centre) + self.radius * self.radius;
        let distance = -b - discriminant.sqrt(); // NaN where the ray misses
        if !(distance > 0.0) {
            return None;
        }
        // FILL IN: your shading. This is a lamp at the camera.
        let normal = normalised(along(from_centre, distance, direction));
        Some(along([0.0; 3], 0.1 - 0.9 * dot(normal, direction), self.colour))
    }
}

impl Plugin for @CLASS@ {
    fn new(host: Host, options: &Options) -> Result<Self, Failure> {
        let colour = [options.real("red"), options.real("green"), options.real("blue")];
        Ok(@CLASS@ { host, colour, centre: [0.0; 3], radius: 0.0 })
    }
}

impl Raytracer for @CLASS@ {
    fn start(&mut self, setup: &arhost_raytracer_setup) -> Result<(), Failure> {
        // FILL IN: read setup.scene().objects and geometries (arhost/scene.h), build what makes rays fast.
        let scene = setup.scene();
        self.radius = f64::INFINITY;
        for i in 0..3 {
            let (low, high) = (f64::from(scene.bounds_min[i]), f64::from(scene.bounds_max[i]));
            self.centre[i] = (low + high) / 2.0;
            self.radius = self.radius.min((high - low) / 2.0);
        }
        Ok(())
    }

    fn render(
        &mut self,
        request: &arhost_render_request,
        image: &mut Image,
        _info: &mut arhost_render_info, // it could tell a region outside of which every alpha is 0
    ) -> Result<(), Failure> {
        let camera = &request.camera;
        let lens = &camera.intrinsics;
        let back = normalised(along(camera.eye, -1.0, camera.look_at));
        let right = normalised(cross(camera.up, back));
        let up = cross(back, right);
        for row in 0..image.height() {
            if self.host.cancelled() {
                return Err(Failure::new(ARHOST_ERROR_CANCELLED, "")); // rows must not keep arhost waiting
            }
            for (column, pixel) in image.row_mut(row).iter_mut().enumerate() {
                // Pixel centres are at integers, rows run downwards, the camera looks along -back.
                let x = (column as f64 - lens.cx) / lens.fx;
                let y = (f64::from(row) - lens.cy) / lens.fy;
                let direction = normalised(along(along(along([0.0; 3], x, right), -y, up), -1.0, back));
                *pixel = match self.trace(camera.eye, direction) {
                    // Were alpha less than 255, the colour would still not be multiplied by it.
                    Some(colour) => [srgb_byte(colour[0]), srgb_byte(colour[1]), srgb_byte(colour[2]), 255],
                    None => [0; 4], // alpha exactly 0: the video shows
                };
            }
        }
        Ok(())
    }
}

plugin! {
    raytracer @CLASS@, "@NAME@", "Draws a sphere.",
    capabilities: 0,
    // arhost checks the configuration against these before `new` sees a value.
    options: [
        option!(ARHOST_OPTION_REAL, "red", "0.8", "Share of red light reflected.", 0.0, 1.0),
        option!(ARHOST_OPTION_REAL, "green", "0.3", "Likewise green.", 0.0, 1.0),
        option!(ARHOST_OPTION_REAL, "blue", "0.1", "Likewise blue.", 0.0, 1.0),
    ]
}
