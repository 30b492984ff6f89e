/* By brute force: each ray is tried on every object whose bounds it meets, and there on every triangle. All places
 * are in the world, in mm. */
#include "tracer.h"

#include <stdlib.h>

/* What rays can hit, as bits. A shadow of glass is another than that of a solid body. */
enum { SOLID = 1, GLASS = 2, CATCHER = 4, OCCLUDER = 8, ANYTHING = 15 };

typedef struct sphere {
    vec centre;
    double radius;
} sphere;

typedef struct triangle {
    vec corner, edge_1, edge_2;
    vec facet;      /* out of the outside; length 1 */
    vec normals[3]; /* at the corners */
} triangle;

typedef struct object {
    unsigned kind;
    const arhost_material *material;
    const arhost_geometry *geometry;
    sphere bounds;
    sphere *spheres; /* one of the two is empty */
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

/* What a buffer of the scene holds. arhost has checked all of it: indices, counts, numbers. */
static const void *elements(const arhost_scene *scene, arhost_buffer buffer) {
    return buffer.count ? (const char *)scene + buffer.offset : NULL;
}

static vec to_world(const float m[12], const float p[3]) { /* its columns are the axes and the origin */
    const vec turned = add(add(scale(p[0], vec_of(m)), scale(p[1], vec_of(m + 3))), scale(p[2], vec_of(m + 6)));
    return add(turned, vec_of(m + 9));
}

/* Normals turn by the inverse's transpose. In a mirrored object its sign keeps the outside outside. */
static double sign_of(const float m[12]) {
    return dot(cross(vec_of(m), vec_of(m + 3)), vec_of(m + 6)) < 0 ? -1 : 1;
}
static vec normal_to_world(const float m[12], const float n[3]) {
    const vec x = vec_of(m), y = vec_of(m + 3), z = vec_of(m + 6);
    const vec turned = add(add(scale(n[0], cross(y, z)), scale(n[1], cross(z, x))), scale(n[2], cross(x, y)));
    return scale(sign_of(m), normalised(turned));
}

/* Calls use(part, context) for each sphere, and each corner as a sphere without extent. */
static void for_each_part(const object *o, void (*use)(sphere part, void *context), void *context) {
    uint32_t i;
    for (i = 0; i < o->sphere_count; ++i)
        use(o->spheres[i], context);
    for (i = 0; i < o->triangle_count; ++i) {
        const triangle *t = &o->triangles[i];
        use((sphere){t->corner, 0}, context);
        use((sphere){add(t->corner, t->edge_1), 0}, context);
        use((sphere){add(t->corner, t->edge_2), 0}, context);
    }
}
typedef struct box {
    vec low, high;
} box;
static void widen_box(sphere part, void *context) {
    box *b = context;
    const vec r = {part.radius, part.radius, part.radius}, low = subtract(part.centre, r), high = add(part.centre, r);
    b->low = (vec){fmin(b->low.x, low.x), fmin(b->low.y, low.y), fmin(b->low.z, low.z)};
    b->high = (vec){fmax(b->high.x, high.x), fmax(b->high.y, high.y), fmax(b->high.z, high.z)};
}
static void widen_ball(sphere part, void *context) {
    sphere *ball = context;
    ball->radius = fmax(ball->radius, length(subtract(part.centre, ball->centre)) + part.radius);
}

/* Puts an object's geometry into the world. `normals`, one a vertex, may be NULL. */
static void place(tracer *self, object *o, const float m[12], const float *positions, const float *normals) {
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
            continue; /* no area, no facet */
        t->facet = scale(sign_of(m), normalised(across));
        for (c = 0; c < 3; ++c)
            t->normals[c] = normals ? normal_to_world(m, normals + (corners[c] - positions)) : t->facet;
        ++o->triangle_count;
    }
    /* The bounds: about the middle of the box that holds all. */
    for_each_part(o, widen_box, &b);
    o->bounds = (sphere){scale(0.5, add(b.low, b.high)), 0};
    for_each_part(o, widen_ball, &o->bounds);
    o->bounds.radius *= 1 + 1e-9; /* rounding must not cut its rim off */
}

/* Puts it where the scene has it, but for its place. */
static void place_at(tracer *self, object *o, const float m[12]) {
    place(self, o, m, elements(self->scene, o->geometry->positions), elements(self->scene, o->geometry->normals));
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
        o->geometry = &geometries[objects[i].geometry];
        o->material = &materials[objects[i].material];
        o->kind = objects[i].role == ARHOST_ROLE_CATCHER    ? CATCHER
                  : objects[i].role == ARHOST_ROLE_OCCLUDER ? OCCLUDER
                  : o->material->model == ARHOST_MATERIAL_GLASS ? GLASS
                                                       : SOLID;
        o->sphere_count = o->geometry->type == ARHOST_GEOMETRY_SPHERES ? o->geometry->positions.count : 0;
        o->spheres = calloc(o->sphere_count + 1, sizeof *o->spheres);
        o->triangles = calloc((size_t)o->geometry->indices.count + 1, sizeof *o->triangles);
        if (!o->spheres || !o->triangles)
            break;
        place_at(self, o, objects[i].world_from_object);
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

void tracer_move(tracer *self, const arhost_motion *now) {
    const arhost_object *objects = elements(self->scene, self->scene->objects);
    uint32_t i, k;
    for (i = 0; i < now->moved_count; ++i)
        place_at(self, &self->objects[now->moved[i].object], now->moved[i].world_from_object);
    for (i = 0; i < now->deformed_count; ++i) {
        const arhost_deformed_geometry *deformed = &now->deformed[i];
        const float *m = objects[deformed->object].world_from_object;
        for (k = 0; k < now->moved_count; ++k)
            if (now->moved[k].object == deformed->object)
                m = now->moved[k].world_from_object;
        place(self, &self->objects[deformed->object], m, deformed->positions, deformed->normals);
    }
}

/* ---- rays and what they hit ---- */

typedef struct hit {
    double distance;
    const object *object; /* NULL: the ray missed */
    vec facet, normal;    /* the flat one and the interpolated one; length 1 */
} hit;

/* Where a line is inside a sphere, as distances along it; false where it misses. */
static int inside(sphere s, ray r, double *in, double *out) {
    const vec to_centre = subtract(s.centre, r.origin);
    const double middle = dot(to_centre, r.direction);
    const vec aside = subtract(to_centre, scale(middle, r.direction));
    const double squared = s.radius * s.radius - dot(aside, aside);
    if (!(squared > 0))
        return 0;
    *in = middle - sqrt(squared);
    *out = middle + sqrt(squared);
    return 1;
}

static void try_sphere(const object *o, const sphere *s, ray r, int from_outside, hit *nearest) {
    double in, out, distance;
    if (!inside(*s, r, &in, &out))
        return;
    distance = in > 0 || from_outside ? in : out;
    if (distance > 0 && distance < nearest->distance) {
        const vec at = add(r.origin, scale(distance, r.direction));
        const vec normal = scale(1 / s->radius, subtract(at, s->centre));
        *nearest = (hit){distance, o, normal, normal};
    }
}

/* Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, Journal of Graphics Tools 2(1), 1997. */
static void try_triangle(const object *o, const triangle *t, ray r, int from_outside, hit *nearest) {
    const double slack = 1e-9; /* no ray may slip through between two triangles that share an edge */
    const vec p = cross(r.direction, t->edge_2), from_corner = subtract(r.origin, t->corner);
    const vec q = cross(from_corner, t->edge_1);
    const double share = 1 / dot(t->edge_1, p); /* infinite along the plane, which the comparisons refuse */
    const double u = share * dot(from_corner, p), v = share * dot(r.direction, q);
    const double distance = share * dot(t->edge_2, q);
    vec normal;
    if (from_outside && dot(t->facet, r.direction) > 0)
        return;
    if (!(u >= -slack && v >= -slack && u + v <= 1 + slack && distance > 0 && distance < nearest->distance))
        return;
    normal = add(add(scale(1 - u - v, t->normals[0]), scale(u, t->normals[1])), scale(v, t->normals[2]));
    *nearest = (hit){distance, o, t->facet, length(normal) > 0 ? normalised(normal) : t->facet};
}

/* FILL IN: a hierarchy of bounds, or a library that has one, makes this fast. */
static hit nearest_hit(const tracer *self, ray r, unsigned kinds, int from_outside) {
    hit nearest = {r.end, NULL, {0, 0, 0}, {0, 0, 0}};
    uint32_t i, k;
    for (i = 0; i < self->scene->objects.count; ++i) {
        const object *o = &self->objects[i];
        double in, out;
        if (!(o->kind & kinds) || !inside(o->bounds, r, &in, &out) || in > nearest.distance || out < 0)
            continue;
        for (k = 0; k < o->sphere_count; ++k)
            try_sphere(o, &o->spheres[k], r, from_outside, &nearest);
        for (k = 0; k < o->triangle_count; ++k)
            try_triangle(o, &o->triangles[k], r, from_outside, &nearest);
    }
    return nearest;
}

/* ---- light ---- */

/* Where a ray has hit. */
typedef struct surface {
    vec position;      /* a little above the facet, so that rays that go on do not hit it again */
    vec below;         /* and a little below */
    vec facet, normal; /* to where the ray came from; length 1 */
    int is_real;       /* a catcher or occluder */
} surface;

static surface surface_at(ray r, const hit *h) {
    const vec at = add(r.origin, scale(h->distance, r.direction));
    const vec facet = dot(h->facet, r.direction) > 0 ? scale(-1, h->facet) : h->facet;
    const vec normal = dot(h->normal, facet) < 0 ? scale(-1, h->normal) : h->normal;
    const vec gap = scale(1e-9 * (length(at) + h->distance), facet);
    return (surface){add(at, gap), subtract(at, gap), facet, normal, (h->object->kind & (CATCHER | OCCLUDER)) != 0};
}

/* A light as a surface has it. */
typedef struct incoming {
    vec direction;     /* to the light; length 1 */
    double distance;   /* mm */
    double cosine;     /* of the surface's inclination; 0: the light is behind it */
    double irradiance; /* of what faces the light, for an intensity of 1 */
} incoming;

/* FILL IN: rectangles and spheres shine from their middle alone. Many points of theirs make soft shadows. */
static incoming incoming_of(const arhost_light *light, const surface *s) {
    const vec beam = vec_of(light->direction);
    incoming in = {scale(-1, beam), INFINITY, 0, 1};
    double along_beam;
    if (light->type != ARHOST_LIGHT_DIRECTIONAL) {
        const vec way = subtract(vec_of(light->position), s->position);
        in.distance = length(way);
        in.direction = scale(1 / in.distance, way);
        if (light->falloff == ARHOST_FALLOFF_INVERSE_SQUARE)
            in.irradiance = 1 / fmax(dot(way, way), 1e-6);
    }
    along_beam = -dot(beam, in.direction);
    if (light->type == ARHOST_LIGHT_RECTANGLE)
        in.irradiance *= fmax(along_beam, 0);
    if (light->type == ARHOST_LIGHT_SPOT) {
        const double outer = light->cosine_outer, inner = light->cosine_inner;
        const double t = fmin(fmax((along_beam - outer) / fmax(inner - outer, 1e-6), 0), 1);
        in.irradiance *= t * t * (3 - 2 * t);
    }
    if (dot(s->facet, in.direction) > 0)
        in.cosine = fmax(dot(s->normal, in.direction), 0);
    return in;
}

/* Which kind is on the way to a light: SOLID for whatever lets nothing through, GLASS, or 0. Real things cast no
 * shadows on each other: those are in the video. */
static unsigned blocked_by(const tracer *self, const incoming *light, const surface *s) {
    const ray way = {s->position, light->direction, light->distance};
    if (nearest_hit(self, way, s->is_real ? SOLID : SOLID | CATCHER | OCCLUDER, 0).object)
        return SOLID;
    return nearest_hit(self, way, GLASS, 0).object ? GLASS : 0;
}

/* Lambert, and Phong's highlight. */
static vec lit(const tracer *self, const surface *s, const arhost_material *material, vec to_eye) {
    const int shines = material->model == ARHOST_MATERIAL_SPECULAR || material->model == ARHOST_MATERIAL_METAL;
    vec sum = add(multiply(vec_of(self->scene->ambient), vec_of(material->ambient)), vec_of(material->emission));
    uint32_t i;
    for (i = 0; i < self->scene->lights.count; ++i) {
        const incoming in = incoming_of(&self->lights[i], s);
        vec reflected = scale(in.cosine, vec_of(material->diffuse));
        if (!(in.cosine * in.irradiance > 0) || blocked_by(self, &in, s) == SOLID)
            continue;
        if (shines) {
            const vec mirrored = subtract(scale(2 * dot(s->normal, in.direction), s->normal), in.direction);
            const double lobe = pow(fmax(dot(mirrored, to_eye), 0), material->exponent);
            reflected = add(reflected, scale(lobe, vec_of(material->specular)));
        }
        sum = add(sum, scale(in.irradiance, multiply(reflected, vec_of(self->lights[i].intensity))));
    }
    return sum;
}

static vec colour_of(const tracer *self, ray r, const hit *h, uint32_t bounces);

static vec light_from(const tracer *self, vec origin, vec direction, uint32_t bounces) {
    const ray onwards = {origin, direction, INFINITY};
    hit h;
    if (bounces > self->scene->max_depth)
        return (vec){0, 0, 0};
    h = nearest_hit(self, onwards, ANYTHING, 0);
    return colour_of(self, onwards, &h, bounces);
}

/* FILL IN: there are no textures, no environment, no microfacets (metallic-roughness is drawn as Lambert), and glass
 * does not bend light, nor reflect or colour any. */
static vec colour_of(const tracer *self, ray r, const hit *h, uint32_t bounces) {
    const arhost_material *material;
    surface s;
    vec mirrored, reflectance;
    double cosine, rim;
    if (!h->object)
        return vec_of(self->scene->background);
    material = h->object->material;
    s = surface_at(r, h);
    cosine = -dot(r.direction, s.normal);
    mirrored = add(r.direction, scale(2 * cosine, s.normal));
    switch (material->model) {
    case ARHOST_MATERIAL_MIRROR:
        return multiply(vec_of(material->reflectivity), light_from(self, s.position, mirrored, bounces + 1));
    case ARHOST_MATERIAL_METAL:
        rim = pow(1 - fmin(fmax(cosine, 0), 1), 5); /* Schlick */
        reflectance = add(scale(1 - rim, vec_of(material->reflectivity)), (vec){rim, rim, rim});
        return add(lit(self, &s, material, scale(-1, r.direction)),
                   multiply(reflectance, light_from(self, s.position, mirrored, bounces + 1)));
    case ARHOST_MATERIAL_GLASS:
        return multiply(vec_of(material->refraction), light_from(self, s.below, r.direction, bounces + 1));
    default:
        return lit(self, &s, material, scale(-1, r.direction));
    }
}

/* ---- what lies over the video ---- */

/* The share of a catcher's light that virtual objects hide decides how dark it becomes. */
static double shadow_alpha(const tracer *self, const surface *s) {
    double all = 0, blocked = 0, through_glass = 0;
    uint32_t i;
    for (i = 0; i < self->scene->lights.count; ++i) {
        const incoming in = incoming_of(&self->lights[i], s);
        const vec intensity = vec_of(self->lights[i].intensity);
        const double light = in.cosine * in.irradiance * (intensity.x + intensity.y + intensity.z);
        unsigned by;
        if (!(light > 0))
            continue;
        by = blocked_by(self, &in, s);
        all += light;
        blocked += by == SOLID ? light : 0;
        through_glass += by == GLASS ? light : 0;
    }
    if (!(all > 0))
        return 0;
    return blocked / all * self->scene->shadow_alpha_opaque +
           through_glass / all * self->scene->shadow_alpha_translucent;
}

seen tracer_look(const tracer *self, ray r) {
    const hit drawn = nearest_hit(self, r, SOLID | GLASS | OCCLUDER, 0);
    seen what = {{0, 0, 0}, 0};
    hit caught;
    surface s;
    if (drawn.object && drawn.object->kind != OCCLUDER)
        return (seen){colour_of(self, r, &drawn, 0), 1};
    /* A catcher is in the video already. Only the shadow on it is missing there. */
    r.end = drawn.distance;
    caught = nearest_hit(self, r, CATCHER, 1);
    if (caught.object) {
        s = surface_at(r, &caught);
        what.alpha = shadow_alpha(self, &s);
    }
    return what;
}
