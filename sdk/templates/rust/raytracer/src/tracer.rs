//! Traces rays. FILL IN: replace this file; lib.rs uses only `new`, `update` and `trace`.
//!
//! Brute force: tests each ray against every object whose bounding sphere it hits, and there against every sphere or
//! triangle. All positions are in world coordinates, mm.

use crate::vec3::*;
use arhost_sys::*;

#[derive(Clone, Copy)]
pub struct Ray {
    pub origin: Vec3,
    pub direction: Vec3, // unit length
    pub end: f64,        // maximum distance of a hit, mm
}

/// The result of a ray.
pub enum Sample {
    /// A virtual object; its colour, linear light.
    Virtual(Vec3),
    /// The video; the shares of the light that opaque and translucent objects hide from a shadow catcher.
    Video { opaque: f64, translucent: f64 },
}

// Kinds of objects, as bits of a ray mask. Glass and solid objects cast different shadows.
type Kinds = u32;
const SOLID: Kinds = 1;
const GLASS: Kinds = 2;
const CATCHER: Kinds = 4;
const OCCLUDER: Kinds = 8;
const ALL_KINDS: Kinds = 15;

#[derive(Clone, Copy)]
struct Sphere {
    centre: Vec3,
    radius: f64,
}

struct Triangle {
    corner: Vec3,
    edge_1: Vec3,
    edge_2: Vec3,
    face_normal: Vec3,  // geometric normal: outwards, unit length
    normals: [Vec3; 3], // shading normals at the corners
}

/// The geometry of an object: either spheres or triangles.
struct Shape {
    bounds: Sphere,
    spheres: Vec<Sphere>,
    triangles: Vec<Triangle>,
}

struct Object {
    kind: Kinds,
    is_visible: bool, // rays pass through invisible objects
    material: arhost_material,
    shape: Shape,
}

pub struct Tracer {
    scene: Scene,
    lights: Vec<arhost_light>,
    objects: Vec<Object>,
}

// ---- The scene ----

// arhost has validated all indices, counts and numbers; arhost/scene.h documents the element types.
fn objects_of(scene: Scene) -> &'static [arhost_object] {
    unsafe { scene.elements(scene.objects) }
}
fn geometry_of(scene: Scene, object: u32) -> &'static arhost_geometry {
    unsafe { &scene.elements(scene.geometries)[objects_of(scene)[object as usize].geometry as usize] }
}

/// Applies a transform to the vertices stored in the scene.
fn shape_at(scene: Scene, object: u32, world_from_object: &[f32; 12]) -> Shape {
    let geometry = geometry_of(scene, object);
    if geometry.type_ == ARHOST_GEOMETRY_SPHERES {
        let x = vec3(&world_from_object[0..3]);
        let spheres: &[[f32; 4]] = unsafe { scene.elements(geometry.positions) };
        let transformed = |s: &[f32; 4]| Sphere {
            centre: to_world(world_from_object, [s[0], s[1], s[2]]),
            radius: f64::from(s[3]) * length(x),
        };
        return bounded(spheres.iter().map(transformed).collect(), Vec::new());
    }
    let (positions, normals) = unsafe { (scene.elements(geometry.positions), scene.elements(geometry.normals)) };
    mesh(scene, geometry, world_from_object, positions, normals)
}

fn to_world(m: &[f32; 12], p: [f32; 3]) -> Vec3 {
    let p = vec3(&p);
    let axes = p[0] * vec3(&m[0..3]) + p[1] * vec3(&m[3..6]) + p[2] * vec3(&m[6..9]);
    axes + vec3(&m[9..12])
}

fn mesh(
    scene: Scene,
    geometry: &arhost_geometry,
    m: &[f32; 12],
    positions: &[[f32; 3]],
    normals: &[[f32; 3]],
) -> Shape {
    let (x, y, z) = (vec3(&m[0..3]), vec3(&m[3..6]), vec3(&m[6..9]));
    // Normals transform by the inverse transpose. Its sign keeps the normals of a mirrored object pointing outwards.
    let sign = if dot(cross(x, y), z) < 0.0 { -1.0 } else { 1.0 };
    let rotated = |n: [f32; 3]| {
        let n = vec3(&n);
        sign * normalised(n[0] * cross(y, z) + n[1] * cross(z, x) + n[2] * cross(x, y))
    };
    let indices: &[[u32; 3]] = unsafe { scene.elements(geometry.indices) };
    let mut triangles = Vec::with_capacity(indices.len());
    for corners in indices {
        let [a, b, c] = corners.map(|i| to_world(m, positions[i as usize]));
        let across = cross(b - a, c - a);
        if length(across) == 0.0 {
            continue; // zero area: no normal
        }
        let face_normal = sign * normalised(across);
        let normals = corners.map(|i| normals.get(i as usize).map_or(face_normal, |n| rotated(*n)));
        triangles.push(Triangle { corner: a, edge_1: b - a, edge_2: c - a, face_normal, normals });
    }
    bounded(Vec::new(), triangles)
}

/// Adds a bounding sphere around the centre of the bounding box.
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
    let bounds = Sphere { centre, radius: radius * (1.0 + 1e-9) }; // margin for rounding
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
            let shape = shape_at(scene, number as u32, &from.world_from_object);
            Object { kind, is_visible: true, material, shape }
        };
        let objects = objects_of(scene).iter().enumerate().map(object).collect();
        Tracer { scene, lights: lights.to_vec(), objects }
    }

    /// Applies the animated state.
    pub fn update(&mut self, motion: &arhost_motion) {
        for moved in motion.moved() {
            let object = &mut self.objects[moved.object as usize];
            object.is_visible = moved.is_visible != 0;
            object.shape = shape_at(self.scene, moved.object, &moved.world_from_object);
        }
        for deformed in motion.deformed() {
            let moved = motion.moved().iter().find(|moved| moved.object == deformed.object);
            let m = moved.map_or(&objects_of(self.scene)[deformed.object as usize].world_from_object, |moved| {
                &moved.world_from_object
            });
            let geometry = geometry_of(self.scene, deformed.object);
            let object = &mut self.objects[deformed.object as usize];
            object.is_visible = deformed.is_visible != 0;
            object.shape = mesh(self.scene, geometry, m, deformed.positions(), deformed.normals());
        }
    }
}

// ---- Intersections ----

#[derive(Clone, Copy)]
struct Hit<'a> {
    distance: f64,
    object: Option<&'a Object>, // None: no hit
    face_normal: Vec3,          // geometric normal, unit length
    normal: Vec3,               // shading normal, unit length
    lift: Vec3,                 // from the hit to the origin of shadow rays
}

#[derive(Clone, Copy, PartialEq)]
enum Faces {
    All,
    Front,
}

/// Distances at which the ray's line enters and leaves a sphere; `None` if it misses.
fn sphere_interval(sphere: &Sphere, ray: &Ray) -> Option<(f64, f64)> {
    let to_centre = sphere.centre - ray.origin;
    let middle = dot(to_centre, ray.direction);
    let aside = to_centre - middle * ray.direction;
    let squared = sphere.radius * sphere.radius - dot(aside, aside);
    (squared > 0.0).then(|| (middle - squared.sqrt(), middle + squared.sqrt()))
}

/// Distance along the ray, geometric normal, shading normal, and vector from the hit to the origin of shadow rays (`lift`).
type Intersection = (f64, Vec3, Vec3, Vec3);

fn intersect_sphere(sphere: &Sphere, ray: &Ray, faces: Faces) -> Option<Intersection> {
    let (enters, leaves) = sphere_interval(sphere, ray)?;
    let distance = if enters > 0.0 || faces == Faces::Front { enters } else { leaves };
    let normal = 1.0 / sphere.radius * (ray.origin + distance * ray.direction - sphere.centre);
    Some((distance, normal, normal, Vec3([0.0; 3])))
}

/// The vector from a point of a triangle to the curved surface that its normals describe. Shadow rays start there, so that the
/// facets of a smooth mesh do not shadow themselves (J. Hanika, Hacking the Shadow Terminator, Ray Tracing Gems II, 2021).
fn lift(t: &Triangle, u: f64, v: f64) -> Vec3 {
    let from_corner = u * t.edge_1 + v * t.edge_2;
    let part = |corner: Vec3, n: Vec3, weight: f64| weight * dot(corner - from_corner, n).max(0.0) * n;
    let [a, b, c] = t.normals;
    part(Vec3([0.0; 3]), a, 1.0 - u - v) + part(t.edge_1, b, u) + part(t.edge_2, c, v)
}

/// Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, Journal of Graphics Tools 2(1), 1997.
fn intersect_triangle(t: &Triangle, ray: &Ray, faces: Faces) -> Option<Intersection> {
    const EPSILON: f64 = 1e-9; // prevents gaps between triangles with a common edge
    if faces == Faces::Front && dot(t.face_normal, ray.direction) > 0.0 {
        return None;
    }
    let p = cross(ray.direction, t.edge_2);
    let inverse = 1.0 / dot(t.edge_1, p); // infinite if parallel, which fails the tests below
    let from_corner = ray.origin - t.corner;
    let u = inverse * dot(from_corner, p);
    if !(-EPSILON..=1.0 + EPSILON).contains(&u) {
        return None;
    }
    let q = cross(from_corner, t.edge_1);
    let v = inverse * dot(ray.direction, q);
    if !(v >= -EPSILON && u + v <= 1.0 + EPSILON) {
        return None;
    }
    let normal = (1.0 - u - v) * t.normals[0] + u * t.normals[1] + v * t.normals[2];
    Some((
        inverse * dot(t.edge_2, q),
        t.face_normal,
        if length(normal) > 0.0 { normalised(normal) } else { t.face_normal },
        lift(t, u, v),
    ))
}

impl Tracer {
    /// FILL IN: use a BVH, or a library such as Embree, to make this fast.
    fn nearest(&self, ray: &Ray, kinds: Kinds, faces: Faces) -> Hit<'_> {
        let nothing = Vec3([0.0; 3]);
        let mut nearest = Hit { distance: ray.end, object: None, face_normal: nothing, normal: nothing, lift: nothing };
        for object in self.objects.iter().filter(|object| object.is_visible && object.kind & kinds != 0) {
            match sphere_interval(&object.shape.bounds, ray) {
                Some((enters, leaves)) if enters < nearest.distance && leaves > 0.0 => {}
                _ => continue,
            }
            let spheres = object.shape.spheres.iter().filter_map(|sphere| intersect_sphere(sphere, ray, faces));
            let triangles =
                object.shape.triangles.iter().filter_map(|triangle| intersect_triangle(triangle, ray, faces));
            for (distance, face_normal, normal, lift) in spheres.chain(triangles) {
                if distance > 0.0 && distance < nearest.distance {
                    nearest = Hit { distance, object: Some(object), face_normal, normal, lift };
                }
            }
        }
        nearest
    }
}

// ---- Shading ----

/// A point hit by a ray.
struct Surface {
    position: Vec3, // offset along the geometric normal, so that secondary rays do not hit it again
    below: Vec3,    // offset to the other side
    lifted: Vec3,   // origin of shadow rays
    normal: Vec3,   // shading normal, facing the ray's origin; unit length
    is_real: bool,  // a catcher or occluder
}

fn surface_at(ray: &Ray, hit: &Hit, object: &Object) -> Surface {
    let at = ray.origin + hit.distance * ray.direction;
    let face_normal = if dot(hit.face_normal, ray.direction) > 0.0 { -1.0 * hit.face_normal } else { hit.face_normal };
    let inside = dot(hit.normal, face_normal) < 0.0;
    let normal = if inside { -1.0 * hit.normal } else { hit.normal };
    let gap = 1e-9 * (length(at) + hit.distance) * face_normal;
    Surface {
        position: at + gap,
        below: at - gap,
        lifted: if inside { at + gap } else { at + gap + hit.lift },
        normal,
        is_real: object.kind & (CATCHER | OCCLUDER) != 0,
    }
}

/// The light that arrives at a surface from one light source.
struct IncidentLight {
    direction: Vec3, // to the light; unit length
    distance: f64,   // mm
    cosine: f64,     // to the normal; 0 if the light is behind the surface
    irradiance: f64, // at normal incidence, for an intensity of 1
}

/// FILL IN: area lights emit from their centre only; sample many points on them for soft shadows.
fn incident(light: &arhost_light, surface: &Surface) -> IncidentLight {
    let beam = vec3(&light.direction);
    let mut incident = IncidentLight { direction: -1.0 * beam, distance: f64::INFINITY, cosine: 0.0, irradiance: 1.0 };
    if light.type_ != ARHOST_LIGHT_DIRECTIONAL {
        let to_light = vec3(&light.position) - surface.position;
        incident.distance = length(to_light);
        incident.direction = 1.0 / incident.distance * to_light;
        if light.falloff == ARHOST_FALLOFF_INVERSE_SQUARE {
            incident.irradiance = 1.0 / dot(to_light, to_light).max(1e-6);
        }
    }
    let along_beam = -dot(beam, incident.direction);
    if light.type_ == ARHOST_LIGHT_RECTANGLE {
        incident.irradiance *= along_beam.max(0.0);
    }
    if light.type_ == ARHOST_LIGHT_SPOT {
        let (inner, outer) = (f64::from(light.cosine_inner), f64::from(light.cosine_outer));
        let t = ((along_beam - outer) / (inner - outer).max(1e-6)).clamp(0.0, 1.0);
        incident.irradiance *= t * t * (3.0 - 2.0 * t);
    }
    incident.cosine = dot(surface.normal, incident.direction).max(0.0);
    incident
}

#[derive(PartialEq)]
enum Visibility {
    Clear,
    ThroughGlass,
    Blocked,
}

impl Tracer {
    /// Proxies for real objects cast no shadows on each other: the video already contains those.
    fn visibility(&self, light: &IncidentLight, surface: &Surface) -> Visibility {
        let mut ray = Ray { origin: surface.lifted, direction: light.direction, end: light.distance };
        if light.distance.is_finite() {
            let to_light = surface.position + light.distance * light.direction - surface.lifted;
            ray.end = length(to_light);
            ray.direction = (1.0 / ray.end) * to_light;
        }
        let opaque = if surface.is_real { SOLID } else { SOLID | CATCHER | OCCLUDER };
        if self.nearest(&ray, opaque, Faces::All).object.is_some() {
            return Visibility::Blocked;
        }
        match self.nearest(&ray, GLASS, Faces::All).object {
            Some(_) => Visibility::ThroughGlass,
            None => Visibility::Clear,
        }
    }

    /// Lambert and Phong.
    fn direct_light(&self, surface: &Surface, material: &arhost_material, to_eye: Vec3) -> Vec3 {
        let has_highlight = material.model == ARHOST_MATERIAL_SPECULAR || material.model == ARHOST_MATERIAL_METAL;
        let mut sum = vec3(&self.scene.ambient) * vec3(&material.ambient) + vec3(&material.emission);
        for light in &self.lights {
            let incident = incident(light, surface);
            if !(incident.cosine * incident.irradiance > 0.0)
                || self.visibility(&incident, surface) == Visibility::Blocked
            {
                continue;
            }
            let mut reflected = incident.cosine * vec3(&material.diffuse);
            if has_highlight {
                let mirrored = 2.0 * dot(surface.normal, incident.direction) * surface.normal - incident.direction;
                let lobe = dot(mirrored, to_eye).max(0.0).powf(f64::from(material.exponent));
                reflected = reflected + lobe * vec3(&material.specular);
            }
            sum = sum + incident.irradiance * (reflected * vec3(&light.intensity));
        }
        sum
    }

    fn trace_secondary(&self, origin: Vec3, direction: Vec3, bounces: u32) -> Vec3 {
        if bounces > self.scene.max_depth {
            return Vec3([0.0; 3]);
        }
        let ray = Ray { origin, direction, end: f64::INFINITY };
        let hit = self.nearest(&ray, ALL_KINDS, Faces::All);
        match hit.object {
            Some(object) => self.radiance(&ray, &hit, object, bounces),
            None => vec3(&self.scene.background),
        }
    }

    /// FILL IN: not implemented: textures, environment maps, microfacets (metallic-roughness is shaded as Lambert), and
    /// refraction, reflection and absorption of glass.
    fn radiance(&self, ray: &Ray, hit: &Hit, object: &Object, bounces: u32) -> Vec3 {
        let material = &object.material;
        let surface = surface_at(ray, hit, object);
        let cosine = -dot(ray.direction, surface.normal);
        let mirrored =
            || self.trace_secondary(surface.position, ray.direction + 2.0 * cosine * surface.normal, bounces + 1);
        match material.model {
            ARHOST_MATERIAL_MIRROR => vec3(&material.reflectivity) * mirrored(),
            ARHOST_MATERIAL_METAL => {
                let schlick = (1.0 - cosine.clamp(0.0, 1.0)).powi(5);
                let reflectance = (1.0 - schlick) * vec3(&material.reflectivity) + Vec3([schlick; 3]);
                self.direct_light(&surface, material, -1.0 * ray.direction) + reflectance * mirrored()
            }
            ARHOST_MATERIAL_GLASS => {
                vec3(&material.refraction) * self.trace_secondary(surface.below, ray.direction, bounces + 1)
            }
            _ => self.direct_light(&surface, material, -1.0 * ray.direction),
        }
    }

    // ---- Overlay ----

    /// The shares of a catcher's light that virtual objects hide.
    fn shadow(&self, surface: &Surface) -> Sample {
        let (mut total, mut blocked, mut through_glass) = (0.0, 0.0, 0.0);
        for light in &self.lights {
            let incident = incident(light, surface);
            let power =
                incident.cosine * incident.irradiance * light.intensity.iter().map(|i| f64::from(*i)).sum::<f64>();
            if !(power > 0.0) {
                continue;
            }
            total += power;
            match self.visibility(&incident, surface) {
                Visibility::Blocked => blocked += power,
                Visibility::ThroughGlass => through_glass += power,
                Visibility::Clear => {}
            }
        }
        total = total.max(f64::MIN_POSITIVE);
        Sample::Video { opaque: blocked / total, translucent: through_glass / total }
    }

    pub fn trace(&self, ray: &Ray) -> Sample {
        let hit = self.nearest(ray, SOLID | GLASS | OCCLUDER, Faces::All);
        match hit.object {
            Some(object) if object.kind != OCCLUDER => {
                return Sample::Virtual(self.radiance(ray, &hit, object, 0));
            }
            _ => {}
        }
        // The video shows the real surface; the overlay adds only the shadow.
        let catcher_ray = Ray { end: hit.distance, ..*ray };
        let shadowed = self.nearest(&catcher_ray, CATCHER, Faces::Front);
        match shadowed.object {
            Some(object) => self.shadow(&surface_at(&catcher_ray, &shadowed, object)),
            None => Sample::Video { opaque: 0.0, translucent: 0.0 },
        }
    }
}
