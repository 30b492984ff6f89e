/* Brute force: for each object whose bounding sphere a ray hits, tests the ray against every sphere or triangle of the
 * object. All positions are in world coordinates, mm. */
#include "tracer.h"

#include <stdlib.h>

/* Kinds of objects, as bits of a ray mask. Glass and solid objects cast different shadows. */
enum { SOLID = 1, GLASS = 2, CATCHER = 4, OCCLUDER = 8, ALL_KINDS = 15 };

typedef struct sphere {
    vec centre;
    double radius;
} sphere;

typedef struct triangle {
    vec corner, edge_1, edge_2;
    vec face_normal; /* geometric normal: outwards, unit length */
    vec normals[3];  /* shading normals at the corners */
} triangle;

typedef struct object {
    unsigned kind;
    int is_visible; /* rays pass through invisible objects */
    const arhost_material *material;
    const arhost_geometry *geometry;
    sphere bounds;
    sphere *spheres; /* an object has either spheres or triangles */
    uint32_t sphere_count;
    triangle *triangles;
    uint32_t triangle_count;
} object;

struct tracer {
    const arhost_scene *scene;
    const arhost_light *lights;
    object *objects;
};

/* ---- the scene ---- */

/* The elements of a buffer of the scene. arhost has validated all indices, counts and numbers. */
static const void *elements(const arhost_scene *scene, arhost_buffer buffer) {
    return buffer.count ? (const char *)scene + buffer.offset : NULL;
}

static vec to_world(const float m[12], const float p[3]) { /* columns: axes and origin */
    const vec rotated = add(add(scale(p[0], vec_of(m)), scale(p[1], vec_of(m + 3))), scale(p[2], vec_of(m + 6)));
    return add(rotated, vec_of(m + 9));
}

/* Normals transform by the inverse transpose. Its sign keeps the normals of a mirrored object pointing outwards. */
static double orientation(const float m[12]) {
    return dot(cross(vec_of(m), vec_of(m + 3)), vec_of(m + 6)) < 0 ? -1 : 1;
}
static vec normal_to_world(const float m[12], const float n[3]) {
    const vec x = vec_of(m), y = vec_of(m + 3), z = vec_of(m + 6);
    const vec rotated = add(add(scale(n[0], cross(y, z)), scale(n[1], cross(z, x))), scale(n[2], cross(x, y)));
    return scale(orientation(m), normalised(rotated));
}

/* Calls visit(sphere, context) for each sphere, and for each triangle corner as a sphere of radius 0. */
static void for_each_sphere(const object *o, void (*visit)(sphere part, void *context), void *context) {
    uint32_t i;
    for (i = 0; i < o->sphere_count; ++i)
        visit(o->spheres[i], context);
    for (i = 0; i < o->triangle_count; ++i) {
        const triangle *t = &o->triangles[i];
        visit((sphere){t->corner, 0}, context);
        visit((sphere){add(t->corner, t->edge_1), 0}, context);
        visit((sphere){add(t->corner, t->edge_2), 0}, context);
    }
}
typedef struct box {
    vec low, high;
} box;
static void grow_box(sphere part, void *context) {
    box *b = context;
    const vec r = {part.radius, part.radius, part.radius}, low = subtract(part.centre, r), high = add(part.centre, r);
    b->low = (vec){fmin(b->low.x, low.x), fmin(b->low.y, low.y), fmin(b->low.z, low.z)};
    b->high = (vec){fmax(b->high.x, high.x), fmax(b->high.y, high.y), fmax(b->high.z, high.z)};
}
static void grow_sphere(sphere part, void *context) {
    sphere *bounds = context;
    bounds->radius = fmax(bounds->radius, length(subtract(part.centre, bounds->centre)) + part.radius);
}

/* Transforms an object's geometry to world coordinates. `normals`, one per vertex, may be NULL. */
static void update_geometry(tracer *self, object *o, const float m[12], const float *positions,
                            const float *normals) {
    const uint32_t *indices = elements(self->scene, o->geometry->indices);
    box b = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    uint32_t i;
    int c;
    o->triangle_count = 0;
    for (i = 0; i < o->sphere_count; ++i) {
        o->spheres[i].centre = to_world(m, positions + 4 * (size_t)i);
        o->spheres[i].radius = positions[4 * (size_t)i + 3] * length(vec_of(m));
    }
    for (i = 0; i < o->geometry->indices.count; ++i) {
        triangle *t = &o->triangles[o->triangle_count];
        const float *corners[3];
        vec across;
        for (c = 0; c < 3; ++c)
            corners[c] = positions + 3 * (size_t)indices[3 * (size_t)i + c];
        t->corner = to_world(m, corners[0]);
        t->edge_1 = subtract(to_world(m, corners[1]), t->corner);
        t->edge_2 = subtract(to_world(m, corners[2]), t->corner);
        across = cross(t->edge_1, t->edge_2);
        if (length(across) == 0)
            continue; /* zero area: no normal */
        t->face_normal = scale(orientation(m), normalised(across));
        for (c = 0; c < 3; ++c)
            t->normals[c] = normals ? normal_to_world(m, normals + (corners[c] - positions)) : t->face_normal;
        ++o->triangle_count;
    }
    /* Bounding sphere around the centre of the bounding box. */
    for_each_sphere(o, grow_box, &b);
    o->bounds = (sphere){scale(0.5, add(b.low, b.high)), 0};
    for_each_sphere(o, grow_sphere, &o->bounds);
    o->bounds.radius *= 1 + 1e-9; /* margin for rounding */
}

/* Applies a new transform to the vertices stored in the scene. */
static void update_transform(tracer *self, object *o, const float m[12]) {
    update_geometry(self, o, m, elements(self->scene, o->geometry->positions),
                    elements(self->scene, o->geometry->normals));
}

tracer *tracer_new(const arhost_scene *scene) {
    const arhost_object *objects = elements(scene, scene->objects);
    const arhost_geometry *geometries = elements(scene, scene->geometries);
    const arhost_material *materials = elements(scene, scene->materials);
    tracer *self = calloc(1, sizeof *self);
    uint32_t i;
    if (!self)
        return NULL;
    self->scene = scene;
    self->lights = elements(scene, scene->lights);
    self->objects = calloc(scene->objects.count + 1, sizeof *self->objects);
    for (i = 0; self->objects && i < scene->objects.count; ++i) {
        object *o = &self->objects[i];
        o->is_visible = 1;
        o->geometry = &geometries[objects[i].geometry];
        o->material = &materials[objects[i].material];
        o->kind = objects[i].role == ARHOST_ROLE_CATCHER        ? CATCHER
                  : objects[i].role == ARHOST_ROLE_OCCLUDER     ? OCCLUDER
                  : o->material->model == ARHOST_MATERIAL_GLASS ? GLASS
                                                                : SOLID;
        o->sphere_count = o->geometry->type == ARHOST_GEOMETRY_SPHERES ? o->geometry->positions.count : 0;
        o->spheres = calloc(o->sphere_count + 1, sizeof *o->spheres);
        o->triangles = calloc((size_t)o->geometry->indices.count + 1, sizeof *o->triangles);
        if (!o->spheres || !o->triangles)
            break;
        update_transform(self, o, objects[i].world_from_object);
    }
    if (!self->objects || i < scene->objects.count) {
        tracer_free(self);
        return NULL;
    }
    return self;
}

void tracer_free(tracer *self) {
    uint32_t i;
    if (!self)
        return;
    for (i = 0; self->objects && i < self->scene->objects.count; ++i) {
        free(self->objects[i].spheres);
        free(self->objects[i].triangles);
    }
    free(self->objects);
    free(self);
}

void tracer_update(tracer *self, const arhost_motion *motion) {
    const arhost_object *objects = elements(self->scene, self->scene->objects);
    uint32_t i, k;
    for (i = 0; i < motion->moved_count; ++i) {
        object *o = &self->objects[motion->moved[i].object];
        o->is_visible = motion->moved[i].is_visible != 0;
        update_transform(self, o, motion->moved[i].world_from_object);
    }
    for (i = 0; i < motion->deformed_count; ++i) {
        const arhost_deformed_geometry *deformed = &motion->deformed[i];
        const float *m = objects[deformed->object].world_from_object;
        for (k = 0; k < motion->moved_count; ++k)
            if (motion->moved[k].object == deformed->object)
                m = motion->moved[k].world_from_object;
        self->objects[deformed->object].is_visible = deformed->is_visible != 0;
        update_geometry(self, &self->objects[deformed->object], m, deformed->positions, deformed->normals);
    }
}

/* ---- intersections ---- */

typedef struct hit {
    double distance;
    const object *object;    /* NULL: no hit */
    vec face_normal, normal; /* geometric and shading normal, unit length */
    vec lift;                /* from the hit to the origin of shadow rays */
} hit;

/* Computes the distances at which the line of a ray enters and leaves a sphere. Returns 0 if it misses the sphere. */
static int sphere_interval(sphere s, ray r, double *enter, double *leave) {
    const vec to_centre = subtract(s.centre, r.origin);
    const double middle = dot(to_centre, r.direction);
    const vec aside = subtract(to_centre, scale(middle, r.direction));
    const double squared = s.radius * s.radius - dot(aside, aside);
    if (!(squared > 0))
        return 0;
    *enter = middle - sqrt(squared);
    *leave = middle + sqrt(squared);
    return 1;
}

static void intersect_sphere(const object *o, const sphere *s, ray r, int front_faces_only, hit *nearest) {
    double enter, leave, distance;
    if (!sphere_interval(*s, r, &enter, &leave))
        return;
    distance = enter > 0 || front_faces_only ? enter : leave;
    if (distance > 0 && distance < nearest->distance) {
        const vec at = add(r.origin, scale(distance, r.direction));
        const vec normal = scale(1 / s->radius, subtract(at, s->centre));
        *nearest = (hit){distance, o, normal, normal, {0, 0, 0}};
    }
}

/* Returns the vector from a point of a triangle to the curved surface that the triangle's shading normals describe.
 * Shadow rays start at this surface, so that the facets of a smooth mesh do not shadow themselves (J. Hanika, Hacking
 * the Shadow Terminator, Ray Tracing Gems II, 2021). */
static vec lift_at(const triangle *t, double u, double v) {
    const vec from_corner = add(scale(u, t->edge_1), scale(v, t->edge_2));
    const vec to_corners[3] = {scale(-1, from_corner), subtract(t->edge_1, from_corner),
                               subtract(t->edge_2, from_corner)};
    const double weights[3] = {1 - u - v, u, v};
    vec lift = {0, 0, 0};
    int c;
    for (c = 0; c < 3; ++c)
        lift = add(lift, scale(weights[c] * fmax(dot(to_corners[c], t->normals[c]), 0), t->normals[c]));
    return lift;
}

/* Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, Journal of Graphics Tools 2(1), 1997. */
static void intersect_triangle(const object *o, const triangle *t, ray r, int front_faces_only, hit *nearest) {
    const double epsilon = 1e-9; /* prevents gaps between triangles that share an edge */
    const vec p = cross(r.direction, t->edge_2), from_corner = subtract(r.origin, t->corner);
    const vec q = cross(from_corner, t->edge_1);
    const double inverse = 1 / dot(t->edge_1, p); /* infinite if parallel, which fails the tests below */
    const double u = inverse * dot(from_corner, p), v = inverse * dot(r.direction, q);
    const double distance = inverse * dot(t->edge_2, q);
    vec normal;
    if (front_faces_only && dot(t->face_normal, r.direction) > 0)
        return;
    if (!(u >= -epsilon && v >= -epsilon && u + v <= 1 + epsilon && distance > 0 && distance < nearest->distance))
        return;
    normal = add(add(scale(1 - u - v, t->normals[0]), scale(u, t->normals[1])), scale(v, t->normals[2]));
    *nearest = (hit){distance, o, t->face_normal, length(normal) > 0 ? normalised(normal) : t->face_normal,
                     lift_at(t, u, v)};
}

/* FILL IN: use a BVH, or a library such as Embree, to make this fast. */
static hit nearest_hit(const tracer *self, ray r, unsigned kinds, int front_faces_only) {
    hit nearest = {r.end, NULL, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    uint32_t i, k;
    for (i = 0; i < self->scene->objects.count; ++i) {
        const object *o = &self->objects[i];
        double enter, leave;
        if (!o->is_visible || !(o->kind & kinds) || !sphere_interval(o->bounds, r, &enter, &leave) || enter > nearest.distance ||
            leave < 0)
            continue;
        for (k = 0; k < o->sphere_count; ++k)
            intersect_sphere(o, &o->spheres[k], r, front_faces_only, &nearest);
        for (k = 0; k < o->triangle_count; ++k)
            intersect_triangle(o, &o->triangles[k], r, front_faces_only, &nearest);
    }
    return nearest;
}

/* ---- shading ---- */

/* A point hit by a ray. */
typedef struct surface {
    vec position; /* offset along the geometric normal, so that secondary rays do not hit it again */
    vec below;    /* offset to the other side */
    vec lifted;   /* origin of shadow rays */
    vec normal;   /* shading normal, facing the ray's origin; unit length */
    int is_real;  /* a catcher or occluder */
} surface;

static surface surface_at(ray r, const hit *h) {
    const vec at = add(r.origin, scale(h->distance, r.direction));
    const vec face_normal = dot(h->face_normal, r.direction) > 0 ? scale(-1, h->face_normal) : h->face_normal;
    const vec normal = dot(h->normal, face_normal) < 0 ? scale(-1, h->normal) : h->normal;
    const vec gap = scale(1e-9 * (length(at) + h->distance), face_normal), above = add(at, gap);
    const vec lifted = dot(h->normal, face_normal) < 0 ? above : add(above, h->lift); /* no lift inside an object */
    return (surface){above, subtract(at, gap), lifted, normal, (h->object->kind & (CATCHER | OCCLUDER)) != 0};
}

/* The light that arrives at a surface from one light source. */
typedef struct incident_light {
    vec direction;     /* to the light; unit length */
    double distance;   /* mm */
    double cosine;     /* to the normal; 0 if the light is behind the surface */
    double irradiance; /* at normal incidence, for an intensity of 1 */
} incident_light;

/* FILL IN: area lights emit from their centre only; sample many points on them for soft shadows. */
static incident_light incident_from(const arhost_light *light, const surface *s) {
    const vec beam = vec_of(light->direction);
    incident_light in = {scale(-1, beam), INFINITY, 0, 1};
    double along_beam;
    if (light->type != ARHOST_LIGHT_DIRECTIONAL) {
        const vec to_light = subtract(vec_of(light->position), s->position);
        in.distance = length(to_light);
        in.direction = scale(1 / in.distance, to_light);
        if (light->falloff == ARHOST_FALLOFF_INVERSE_SQUARE)
            in.irradiance = 1 / fmax(dot(to_light, to_light), 1e-6);
    }
    along_beam = -dot(beam, in.direction);
    if (light->type == ARHOST_LIGHT_RECTANGLE)
        in.irradiance *= fmax(along_beam, 0);
    if (light->type == ARHOST_LIGHT_SPOT) {
        const double outer = light->cosine_outer, inner = light->cosine_inner;
        const double t = fmin(fmax((along_beam - outer) / fmax(inner - outer, 1e-6), 0), 1);
        in.irradiance *= t * t * (3 - 2 * t);
    }
    in.cosine = fmax(dot(s->normal, in.direction), 0);
    return in;
}

/* Returns SOLID if an opaque object blocks the light, GLASS if only glass blocks it, otherwise 0. Proxies for real
 * objects cast no shadows on each other, because the video already shows these shadows. */
static unsigned blocked_by(const tracer *self, const incident_light *light, const surface *s) {
    ray shadow_ray = {s->lifted, light->direction, light->distance};
    if (isfinite(light->distance)) {
        const vec light_position = add(s->position, scale(light->distance, light->direction));
        const vec to_light = subtract(light_position, s->lifted);
        shadow_ray.end = length(to_light);
        shadow_ray.direction = normalised(to_light);
    }
    if (nearest_hit(self, shadow_ray, s->is_real ? SOLID : SOLID | CATCHER | OCCLUDER, 0).object)
        return SOLID;
    return nearest_hit(self, shadow_ray, GLASS, 0).object ? GLASS : 0;
}

/* Shades with the models of Lambert and Phong. */
static vec direct_light(const tracer *self, const surface *s, const arhost_material *material, vec to_eye) {
    const int has_highlight = material->model == ARHOST_MATERIAL_SPECULAR || material->model == ARHOST_MATERIAL_METAL;
    vec sum = add(multiply(vec_of(self->scene->ambient), vec_of(material->ambient)), vec_of(material->emission));
    uint32_t i;
    for (i = 0; i < self->scene->lights.count; ++i) {
        const incident_light in = incident_from(&self->lights[i], s);
        vec reflected = scale(in.cosine, vec_of(material->diffuse));
        if (!(in.cosine * in.irradiance > 0) || blocked_by(self, &in, s) == SOLID)
            continue;
        if (has_highlight) {
            const vec mirrored = subtract(scale(2 * dot(s->normal, in.direction), s->normal), in.direction);
            const double lobe = pow(fmax(dot(mirrored, to_eye), 0), material->exponent);
            reflected = add(reflected, scale(lobe, vec_of(material->specular)));
        }
        sum = add(sum, scale(in.irradiance, multiply(reflected, vec_of(self->lights[i].intensity))));
    }
    return sum;
}

static vec radiance(const tracer *self, ray r, const hit *h, uint32_t bounces);

static vec trace_secondary(const tracer *self, vec origin, vec direction, uint32_t bounces) {
    const ray r = {origin, direction, INFINITY};
    hit h;
    if (bounces > self->scene->max_depth)
        return (vec){0, 0, 0};
    h = nearest_hit(self, r, ALL_KINDS, 0);
    return radiance(self, r, &h, bounces);
}

/* FILL IN: not implemented: textures, environment maps, microfacets (metallic-roughness is shaded as Lambert), and
 * refraction, reflection and absorption of glass. */
static vec radiance(const tracer *self, ray r, const hit *h, uint32_t bounces) {
    const arhost_material *material;
    surface s;
    vec mirrored, reflectance;
    double cosine, schlick;
    if (!h->object)
        return vec_of(self->scene->background);
    material = h->object->material;
    s = surface_at(r, h);
    cosine = -dot(r.direction, s.normal);
    mirrored = add(r.direction, scale(2 * cosine, s.normal));
    switch (material->model) {
    case ARHOST_MATERIAL_MIRROR:
        return multiply(vec_of(material->reflectivity), trace_secondary(self, s.position, mirrored, bounces + 1));
    case ARHOST_MATERIAL_METAL:
        schlick = pow(1 - fmin(fmax(cosine, 0), 1), 5);
        reflectance = add(scale(1 - schlick, vec_of(material->reflectivity)), (vec){schlick, schlick, schlick});
        return add(direct_light(self, &s, material, scale(-1, r.direction)),
                   multiply(reflectance, trace_secondary(self, s.position, mirrored, bounces + 1)));
    case ARHOST_MATERIAL_GLASS:
        return multiply(vec_of(material->refraction), trace_secondary(self, s.below, r.direction, bounces + 1));
    default:
        return direct_light(self, &s, material, scale(-1, r.direction));
    }
}

/* ---- overlay ---- */

/* The shares of a catcher's light that virtual objects hide. */
static sample shadow_at(const tracer *self, const surface *s) {
    double total = 0, blocked = 0, through_glass = 0;
    uint32_t i;
    for (i = 0; i < self->scene->lights.count; ++i) {
        const incident_light in = incident_from(&self->lights[i], s);
        const vec intensity = vec_of(self->lights[i].intensity);
        const double light = in.cosine * in.irradiance * (intensity.x + intensity.y + intensity.z);
        unsigned by;
        if (!(light > 0))
            continue;
        by = blocked_by(self, &in, s);
        total += light;
        blocked += by == SOLID ? light : 0;
        through_glass += by == GLASS ? light : 0;
    }
    if (!(total > 0))
        return (sample){0};
    return (sample){.opaque = blocked / total, .translucent = through_glass / total};
}

sample tracer_trace(const tracer *self, ray r) {
    const hit nearest = nearest_hit(self, r, SOLID | GLASS | OCCLUDER, 0);
    hit catcher;
    surface s;
    if (nearest.object && nearest.object->kind != OCCLUDER)
        return (sample){.is_virtual = 1, .colour = radiance(self, r, &nearest, 0)};
    /* The video shows the real surface; the overlay adds only the shadow. */
    r.end = nearest.distance;
    catcher = nearest_hit(self, r, CATCHER, 1);
    if (!catcher.object)
        return (sample){0};
    s = surface_at(r, &catcher);
    return shadow_at(self, &s);
}
