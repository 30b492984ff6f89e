//! What is seen along a ray. FILL IN: this is the part to replace; lib.rs needs no more of it than `move_to` and `look`.
//!
//! By brute force: each ray is tried on every object whose bounds it meets, and there on every triangle. All places are
//! in the world, in mm.

use crate::vec3::*;
use arhost_sys::*;

#[derive(Clone, Copy)]
pub struct Ray {
    pub origin: Vec3,
    pub direction: Vec3, // length 1
    pub end: f64,        // hits beyond do not count
}

/// What to lay over the video. Alpha is exactly 0 where the video shows, exactly 1 on virtual objects.
pub struct Seen {
    pub colour: Vec3, // linear light
    pub alpha: f64,
}

// What rays can hit, as bits. A shadow of glass is another than that of a solid body.
type Kinds = u32;
const SOLID: Kinds = 1;
const GLASS: Kinds = 2;
const CATCHER: Kinds = 4;
const OCCLUDER: Kinds = 8;
const ANYTHING: Kinds = 15;

#[derive(Clone, Copy)]
struct Sphere {
    centre: Vec3,
    radius: f64,
}

struct Triangle {
    corner: Vec3,
    edge_1: Vec3,
    edge_2: Vec3,
    facet: Vec3,        // out of the outside; length 1
    normals: [Vec3; 3], // at the corners
}

/// What an object is made of; one of the two is empty.
struct Shape {
    bounds: Sphere,
    spheres: Vec<Sphere>,
    triangles: Vec<Triangle>,
}

struct Object {
    kind: Kinds,
    material: arhost_material,
    shape: Shape,
}

pub struct Tracer {
    scene: Scene,
    lights: Vec<arhost_light>,
    objects: Vec<Object>,
}

// ---- The scene ----

// arhost has checked all of it: indices, counts, numbers. The buffers are what arhost/scene.h says.
fn objects_of(scene: Scene) -> &'static [arhost_object] {
    unsafe { scene.elements(scene.objects) }
}
fn geometry_of(scene: Scene, object: u32) -> &'static arhost_geometry {
    unsafe { &scene.elements(scene.geometries)[objects_of(scene)[object as usize].geometry as usize] }
}

/// The geometry as the scene has it, in another place.
fn shape_at(scene: Scene, object: u32, world_from_object: &[f32; 12]) -> Shape {
    let geometry = geometry_of(scene, object);
    if geometry.type_ == ARHOST_GEOMETRY_SPHERES {
        let x = vec3(&world_from_object[0..3]);
        let spheres: &[[f32; 4]] = unsafe { scene.elements(geometry.positions) };
        let placed = |s: &[f32; 4]| Sphere {
            centre: to_world(world_from_object, [s[0], s[1], s[2]]),
            radius: f64::from(s[3]) * length(x),
        };
        return bounded(spheres.iter().map(placed).collect(), Vec::new());
    }
    let (positions, normals) = unsafe { (scene.elements(geometry.positions), scene.elements(geometry.normals)) };
    mesh(scene, geometry, world_from_object, positions, normals)
}

fn to_world(m: &[f32; 12], p: [f32; 3]) -> Vec3 {
    let p = vec3(&p);
    let axes = p[0] * vec3(&m[0..3]) + p[1] * vec3(&m[3..6]) + p[2] * vec3(&m[6..9]);
    axes + vec3(&m[9..12])
}

fn mesh(scene: Scene, geometry: &arhost_geometry, m: &[f32; 12], positions: &[[f32; 3]], normals: &[[f32; 3]]) -> Shape {
    let (x, y, z) = (vec3(&m[0..3]), vec3(&m[3..6]), vec3(&m[6..9]));
    // Normals turn by the inverse's transpose. In a mirrored object its sign keeps the outside outside.
    let sign = if dot(cross(x, y), z) < 0.0 { -1.0 } else { 1.0 };
    let turned = |n: [f32; 3]| {
        let n = vec3(&n);
        sign * normalised(n[0] * cross(y, z) + n[1] * cross(z, x) + n[2] * cross(x, y))
    };
    let indices: &[[u32; 3]] = unsafe { scene.elements(geometry.indices) };
    let mut triangles = Vec::with_capacity(indices.len());
    for corners in indices {
        let [a, b, c] = corners.map(|i| to_world(m, positions[i as usize]));
        let across = cross(b - a, c - a);
        if length(across) == 0.0 {
            continue; // no area, no facet
        }
        let facet = sign * normalised(across);
        let normals = corners.map(|i| normals.get(i as usize).map_or(facet, |n| turned(*n)));
        triangles.push(Triangle { corner: a, edge_1: b - a, edge_2: c - a, facet, normals });
    }
    bounded(Vec::new(), triangles)
}

/// With bounds about the middle of the box that holds all.
fn bounded(spheres: Vec<Sphere>, triangles: Vec<Triangle>) -> Shape {
    let corners = triangles.iter().flat_map(|t| [t.corner, t.corner + t.edge_1, t.corner + t.edge_2]);
    let mut parts: Vec<Sphere> = corners.map(|centre| Sphere { centre, radius: 0.0 }).collect();
    parts.extend(&spheres);
    let (mut low, mut high) = ([f64::INFINITY; 3], [-f64::INFINITY; 3]);
    for part in &parts {
        for i in 0..3 {
            low[i] = low[i].min(part.centre[i] - part.radius);
            high[i] = high[i].max(part.centre[i] + part.radius);
        }
    }
    let centre = 0.5 * (Vec3(low) + Vec3(high));
    let radius = parts.iter().map(|part| length(part.centre - centre) + part.radius).fold(0.0, f64::max);
    let bounds = Sphere { centre, radius: radius * (1.0 + 1e-9) }; // rounding must not cut its rim off
    Shape { bounds, spheres, triangles }
}

impl Tracer {
    pub fn new(scene: Scene) -> Self {
        let (materials, lights): (&[arhost_material], &[arhost_light]) =
            unsafe { (scene.elements(scene.materials), scene.elements(scene.lights)) };
        let object = |(number, from): (usize, &arhost_object)| {
            let material = materials[from.material as usize];
            let kind = match from.role {
                ARHOST_ROLE_CATCHER => CATCHER,
                ARHOST_ROLE_OCCLUDER => OCCLUDER,
                _ if material.model == ARHOST_MATERIAL_GLASS => GLASS,
                _ => SOLID,
            };
            Object { kind, material, shape: shape_at(scene, number as u32, &from.world_from_object) }
        };
        let objects = objects_of(scene).iter().enumerate().map(object).collect();
        Tracer { scene, lights: lights.to_vec(), objects }
    }

    /// Puts what moves where it is now.
    pub fn move_to(&mut self, now: &arhost_motion) {
        for moved in now.moved() {
            self.objects[moved.object as usize].shape = shape_at(self.scene, moved.object, &moved.world_from_object);
        }
        for deformed in now.deformed() {
            let moved = now.moved().iter().find(|moved| moved.object == deformed.object);
            let m = moved.map_or(&objects_of(self.scene)[deformed.object as usize].world_from_object, |moved| {
                &moved.world_from_object
            });
            let geometry = geometry_of(self.scene, deformed.object);
            self.objects[deformed.object as usize].shape =
                mesh(self.scene, geometry, m, deformed.positions(), deformed.normals());
        }
    }
}

// ---- Rays and what they hit ----

#[derive(Clone, Copy)]
struct Hit<'a> {
    distance: f64,
    object: Option<&'a Object>, // none: the ray missed
    facet: Vec3,                // flat
    normal: Vec3,               // and interpolated; length 1
}

#[derive(Clone, Copy, PartialEq)]
enum Sides {
    Both,
    Outside,
}

/// Where a line is inside a sphere, as distances along it; `None` where it misses.
fn inside(sphere: &Sphere, ray: &Ray) -> Option<(f64, f64)> {
    let to_centre = sphere.centre - ray.origin;
    let middle = dot(to_centre, ray.direction);
    let aside = to_centre - middle * ray.direction;
    let squared = sphere.radius * sphere.radius - dot(aside, aside);
    (squared > 0.0).then(|| (middle - squared.sqrt(), middle + squared.sqrt()))
}

fn hit_sphere(sphere: &Sphere, ray: &Ray, sides: Sides) -> Option<(f64, Vec3, Vec3)> {
    let (enters, leaves) = inside(sphere, ray)?;
    let distance = if enters > 0.0 || sides == Sides::Outside { enters } else { leaves };
    let normal = 1.0 / sphere.radius * (ray.origin + distance * ray.direction - sphere.centre);
    Some((distance, normal, normal))
}

/// Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, Journal of Graphics Tools 2(1), 1997.
fn hit_triangle(t: &Triangle, ray: &Ray, sides: Sides) -> Option<(f64, Vec3, Vec3)> {
    const SLACK: f64 = 1e-9; // no ray may slip through between two triangles that share an edge
    if sides == Sides::Outside && dot(t.facet, ray.direction) > 0.0 {
        return None;
    }
    let p = cross(ray.direction, t.edge_2);
    let share = 1.0 / dot(t.edge_1, p); // infinite along the plane, which the comparisons refuse
    let from_corner = ray.origin - t.corner;
    let u = share * dot(from_corner, p);
    if !(-SLACK..=1.0 + SLACK).contains(&u) {
        return None;
    }
    let q = cross(from_corner, t.edge_1);
    let v = share * dot(ray.direction, q);
    if !(v >= -SLACK && u + v <= 1.0 + SLACK) {
        return None;
    }
    let normal = (1.0 - u - v) * t.normals[0] + u * t.normals[1] + v * t.normals[2];
    Some((share * dot(t.edge_2, q), t.facet, if length(normal) > 0.0 { normalised(normal) } else { t.facet }))
}

impl Tracer {
    /// FILL IN: a hierarchy of bounds, or a library that has one, makes this fast.
    fn nearest(&self, ray: &Ray, kinds: Kinds, sides: Sides) -> Hit<'_> {
        let mut nearest = Hit { distance: ray.end, object: None, facet: ray.direction, normal: ray.direction };
        for object in self.objects.iter().filter(|object| object.kind & kinds != 0) {
            match inside(&object.shape.bounds, ray) {
                Some((enters, leaves)) if enters < nearest.distance && leaves > 0.0 => {}
                _ => continue,
            }
            let spheres = object.shape.spheres.iter().filter_map(|sphere| hit_sphere(sphere, ray, sides));
            let triangles = object.shape.triangles.iter().filter_map(|triangle| hit_triangle(triangle, ray, sides));
            for (distance, facet, normal) in spheres.chain(triangles) {
                if distance > 0.0 && distance < nearest.distance {
                    nearest = Hit { distance, object: Some(object), facet, normal };
                }
            }
        }
        nearest
    }
}

// ---- Light ----

/// Where a ray has hit.
struct Surface {
    position: Vec3, // a little above the facet, so that rays that go on do not hit it again
    below: Vec3,    // and a little below
    facet: Vec3,    // to where the ray came from
    normal: Vec3,   // likewise; length 1
    is_real: bool,  // a catcher or occluder
}

fn surface_at(ray: &Ray, hit: &Hit, object: &Object) -> Surface {
    let at = ray.origin + hit.distance * ray.direction;
    let facet = if dot(hit.facet, ray.direction) > 0.0 { -1.0 * hit.facet } else { hit.facet };
    let normal = if dot(hit.normal, facet) < 0.0 { -1.0 * hit.normal } else { hit.normal };
    let gap = 1e-9 * (length(at) + hit.distance) * facet;
    Surface { position: at + gap, below: at - gap, facet, normal, is_real: object.kind & (CATCHER | OCCLUDER) != 0 }
}

/// A light as a surface has it.
struct Incoming {
    direction: Vec3, // to the light; length 1
    distance: f64,   // mm
    cosine: f64,     // of the surface's inclination; 0: the light is behind it
    irradiance: f64, // of what faces the light, for an intensity of 1
}

/// FILL IN: rectangles and spheres shine from their middle alone. Many points of theirs make soft shadows.
fn incoming(light: &arhost_light, surface: &Surface) -> Incoming {
    let beam = vec3(&light.direction);
    let mut of = Incoming { direction: -1.0 * beam, distance: f64::INFINITY, cosine: 0.0, irradiance: 1.0 };
    if light.type_ != ARHOST_LIGHT_DIRECTIONAL {
        let way = vec3(&light.position) - surface.position;
        of.distance = length(way);
        of.direction = 1.0 / of.distance * way;
        if light.falloff == ARHOST_FALLOFF_INVERSE_SQUARE {
            of.irradiance = 1.0 / dot(way, way).max(1e-6);
        }
    }
    let along_beam = -dot(beam, of.direction);
    if light.type_ == ARHOST_LIGHT_RECTANGLE {
        of.irradiance *= along_beam.max(0.0);
    }
    if light.type_ == ARHOST_LIGHT_SPOT {
        let (inner, outer) = (f64::from(light.cosine_inner), f64::from(light.cosine_outer));
        let t = ((along_beam - outer) / (inner - outer).max(1e-6)).clamp(0.0, 1.0);
        of.irradiance *= t * t * (3.0 - 2.0 * t);
    }
    if dot(surface.facet, of.direction) > 0.0 {
        of.cosine = dot(surface.normal, of.direction).max(0.0);
    }
    of
}

#[derive(PartialEq)]
enum Way {
    Clear,
    ThroughGlass,
    Blocked,
}

impl Tracer {
    /// Real things cast no shadows on each other: those are in the video.
    fn way_to(&self, light: &Incoming, surface: &Surface) -> Way {
        let ray = Ray { origin: surface.position, direction: light.direction, end: light.distance };
        let opaque = if surface.is_real { SOLID } else { SOLID | CATCHER | OCCLUDER };
        if self.nearest(&ray, opaque, Sides::Both).object.is_some() {
            return Way::Blocked;
        }
        match self.nearest(&ray, GLASS, Sides::Both).object {
            Some(_) => Way::ThroughGlass,
            None => Way::Clear,
        }
    }

    /// Lambert, and Phong's highlight.
    fn lit(&self, surface: &Surface, material: &arhost_material, to_eye: Vec3) -> Vec3 {
        let shines = material.model == ARHOST_MATERIAL_SPECULAR || material.model == ARHOST_MATERIAL_METAL;
        let mut sum = vec3(&self.scene.ambient) * vec3(&material.ambient) + vec3(&material.emission);
        for light in &self.lights {
            let of = incoming(light, surface);
            if !(of.cosine * of.irradiance > 0.0) || self.way_to(&of, surface) == Way::Blocked {
                continue;
            }
            let mut reflected = of.cosine * vec3(&material.diffuse);
            if shines {
                let mirrored = 2.0 * dot(surface.normal, of.direction) * surface.normal - of.direction;
                let lobe = dot(mirrored, to_eye).max(0.0).powf(f64::from(material.exponent));
                reflected = reflected + lobe * vec3(&material.specular);
            }
            sum = sum + of.irradiance * (reflected * vec3(&light.intensity));
        }
        sum
    }

    fn light_from(&self, origin: Vec3, direction: Vec3, bounces: u32) -> Vec3 {
        if bounces > self.scene.max_depth {
            return Vec3([0.0; 3]);
        }
        let onwards = Ray { origin, direction, end: f64::INFINITY };
        let hit = self.nearest(&onwards, ANYTHING, Sides::Both);
        match hit.object {
            Some(object) => self.colour(&onwards, &hit, object, bounces),
            None => vec3(&self.scene.background),
        }
    }

    /// FILL IN: there are no textures, no environment, no microfacets (metallic-roughness is drawn as Lambert), and
    /// glass does not bend light, nor reflect or colour any.
    fn colour(&self, ray: &Ray, hit: &Hit, object: &Object, bounces: u32) -> Vec3 {
        let material = &object.material;
        let surface = surface_at(ray, hit, object);
        let cosine = -dot(ray.direction, surface.normal);
        let mirrored = || self.light_from(surface.position, ray.direction + 2.0 * cosine * surface.normal, bounces + 1);
        match material.model {
            ARHOST_MATERIAL_MIRROR => vec3(&material.reflectivity) * mirrored(),
            ARHOST_MATERIAL_METAL => {
                let rim = (1.0 - cosine.clamp(0.0, 1.0)).powi(5); // Schlick
                let reflectance = (1.0 - rim) * vec3(&material.reflectivity) + Vec3([rim; 3]);
                self.lit(&surface, material, -1.0 * ray.direction) + reflectance * mirrored()
            }
            ARHOST_MATERIAL_GLASS => vec3(&material.refraction) * self.light_from(surface.below, ray.direction, bounces + 1),
            _ => self.lit(&surface, material, -1.0 * ray.direction),
        }
    }

    // ---- What lies over the video ----

    /// The share of a catcher's light that virtual objects hide decides how dark it becomes.
    fn shadow_alpha(&self, surface: &Surface) -> f64 {
        let (mut all, mut blocked, mut through_glass) = (0.0, 0.0, 0.0);
        for light in &self.lights {
            let of = incoming(light, surface);
            let power = of.cosine * of.irradiance * light.intensity.iter().map(|i| f64::from(*i)).sum::<f64>();
            if !(power > 0.0) {
                continue;
            }
            all += power;
            match self.way_to(&of, surface) {
                Way::Blocked => blocked += power,
                Way::ThroughGlass => through_glass += power,
                Way::Clear => {}
            }
        }
        if all == 0.0 {
            return 0.0;
        }
        let (opaque, translucent) = (self.scene.shadow_alpha_opaque, self.scene.shadow_alpha_translucent);
        blocked / all * f64::from(opaque) + through_glass / all * f64::from(translucent)
    }

    pub fn look(&self, ray: &Ray) -> Seen {
        let drawn = self.nearest(ray, SOLID | GLASS | OCCLUDER, Sides::Both);
        match drawn.object {
            Some(object) if object.kind != OCCLUDER => {
                return Seen { colour: self.colour(ray, &drawn, object, 0), alpha: 1.0 };
            }
            _ => {}
        }
        // A catcher is in the video already. Only the shadow on it is missing there.
        let before_it = Ray { end: drawn.distance, ..*ray };
        let caught = self.nearest(&before_it, CATCHER, Sides::Outside);
        let alpha = caught.object.map_or(0.0, |object| self.shadow_alpha(&surface_at(&before_it, &caught, object)));
        Seen { colour: Vec3([0.0; 3]), alpha }
    }
}
