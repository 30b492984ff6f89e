//! @NAME@: a ray tracer for arhost. This file is the plugin: it turns cameras into rays and samples into images.
//! tracer.rs traces the rays.

mod tracer;
mod vec3;

use arhost_sys::*;
use tracer::{Ray, Sample, Tracer};
use vec3::*;

fn to_byte(value: f64) -> u8 {
    (255.0 * value.clamp(0.0, 1.0)).round() as u8
}
fn srgb(linear: f64) -> f64 {
    match linear.clamp(0.0, 1.0) {
        dark if dark <= 0.0031308 => 12.92 * dark,
        bright => 1.055 * bright.powf(1.0 / 2.4) - 0.055,
    }
}
fn linear_light(srgb: f64) -> f64 {
    if srgb <= 0.04045 {
        srgb / 12.92
    } else {
        ((srgb + 0.055) / 1.055).powf(2.4)
    }
}

/// Alphas of fully hidden light.
struct ShadowAlpha {
    opaque: f64,
    translucent: f64,
}

impl ShadowAlpha {
    /// Alpha of a shadow. The host composites in sRGB, but a shadow hides a share of the linear light: alpha is exact for
    /// mid-grey video, the sRGB value 0.5. `opaque`, `translucent`: the shares of the light that such objects hide.
    fn alpha(&self, opaque: f64, translucent: f64) -> f64 {
        let hidden = |alpha: f64| linear_light(0.5) - linear_light(0.5 * (1.0 - alpha));
        let light = linear_light(0.5) - opaque * hidden(self.opaque) - translucent * hidden(self.translucent);
        1.0 - 2.0 * srgb(light)
    }
}

/// Pixel centres are at integer coordinates, rows go downwards, the camera looks along -back.
struct View<'a> {
    lens: &'a arhost_intrinsics,
    eye: Vec3,
    right: Vec3, // axes: unit length
    up: Vec3,
    back: Vec3,
}

impl View<'_> {
    fn new(camera: &arhost_camera) -> Result<View<'_>, Failure> {
        let (eye, up) = (vec3(&camera.eye), vec3(&camera.up));
        let back = eye - vec3(&camera.look_at);
        let right = cross(up, back);
        // False for NaN too.
        if !(length(right) > 1e-9 * length(up) * length(back)) {
            return Err(Failure::new(
                ARHOST_STATUS_ERROR_INVALID_ARGUMENT,
                "the camera's up vector is parallel to its viewing direction",
            ));
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

/// Averages a grid of `side` × `side` rays in linear light. Objects and shadows are averaged apart and then blended by
/// their shares of the alpha. Alpha is straight: the colour is not multiplied by it.
fn pixel(tracer: &Tracer, shadow: &ShadowAlpha, view: &View, side: u32, column: f64, row: f64) -> [u8; 4] {
    let count = f64::from(side * side);
    let (mut hits, mut colour, mut opaque, mut translucent) = (0.0, Vec3([0.0; 3]), 0.0, 0.0);
    let offset = |i: u32| (f64::from(i) + 0.5) / f64::from(side) - 0.5;
    for i in 0..side * side {
        match tracer.trace(&view.ray(column + offset(i % side), row + offset(i / side))) {
            Sample::Virtual(more) => {
                hits += 1.0;
                colour = colour + more;
            }
            Sample::Video { opaque: o, translucent: t } => {
                opaque += o;
                translucent += t;
            }
        }
    }
    let (coverage, others) = (hits / count, (count - hits).max(1.0));
    let alpha = coverage + (1.0 - coverage) * shadow.alpha(opaque / others, translucent / others);
    let share = if alpha > 0.0 { coverage / alpha } else { 0.0 }; // shadows are black
    let code = |sum: f64| to_byte(share * srgb(sum / hits.max(1.0)));
    [code(colour[0]), code(colour[1]), code(colour[2]), to_byte(alpha)]
}

struct @CLASS@ {
    host: Host,
    side: u32, // rays per pixel: side × side
    shadow: ShadowAlpha,
    tracer: Option<Tracer>,
}

impl Plugin for @CLASS@ {
    fn new(host: Host, options: &Options) -> Result<Self, Failure> {
        let side = (options.integer("samples") as f64).sqrt() as u32;
        let shadow = ShadowAlpha { opaque: 0.0, translucent: 0.0 };
        Ok(@CLASS@ { host, side, shadow, tracer: None })
    }
    fn stop(&mut self) -> Result<(), Failure> {
        self.tracer = None; // the scene becomes invalid
        Ok(())
    }
}

impl Raytracer for @CLASS@ {
    fn start(&mut self, setup: &arhost_raytracer_setup) -> Result<(), Failure> {
        let scene = setup.scene();
        self.shadow = ShadowAlpha {
            opaque: scene.shadow_alpha_opaque.into(),
            translucent: scene.shadow_alpha_translucent.into(),
        };
        self.tracer = Some(Tracer::new(scene));
        Ok(())
    }

    fn render(
        &mut self,
        request: &mut RenderRequest,
        image: &mut Image,
        _info: &mut arhost_render_info, // optional: set a region outside of which every alpha is 0
    ) -> Result<(), Failure> {
        let view = View::new(&request.camera)?;
        let tracer = self.tracer.as_mut().expect("started");
        if let Some(motion) = request.motion() {
            tracer.update(motion);
        }
        for row in 0..image.height() {
            if self.host.cancelled() {
                return Err(Failure::new(ARHOST_STATUS_ERROR_CANCELLED, "")); // arhost wants this call to return soon
            }
            for (column, rgba) in image.row_mut(row).iter_mut().enumerate() {
                *rgba = pixel(tracer, &self.shadow, &view, self.side, column as f64, f64::from(row));
            }
        }
        Ok(())
    }
}

plugin! {
    // FILL IN: your domain in reverse order.
    raytracer @CLASS@, "org.example", "@NAME@", "Brute-force ray tracer.",
    // FILL IN: what you implement, such as ARHOST_RAYTRACER_CAPABILITY_TEXTURES or ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION. arhost warns if
    // a scene needs more.
    capabilities: ARHOST_RAYTRACER_CAPABILITY_REFLECTION | ARHOST_RAYTRACER_CAPABILITY_MOTION,
    // arhost validates the configuration against these before it calls `new`.
    options: [
        option!(ARHOST_OPTION_INTEGER, "samples", "1", "Rays per pixel, rounded down to a square number.", 1.0, 64.0),
    ]
}
