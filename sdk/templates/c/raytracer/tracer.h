/* Traces rays. FILL IN: replace this and tracer.c; @NAME@.c uses only the functions at the end. */
#ifndef TRACER_H
#define TRACER_H

#include <arhost/arhost.h>

#include <math.h>

typedef struct vec {
    double x, y, z;
} vec;

static inline vec add(vec a, vec b) {
    return (vec){a.x + b.x, a.y + b.y, a.z + b.z};
}
static inline vec scale(double s, vec a) {
    return (vec){s * a.x, s * a.y, s * a.z};
}
static inline vec subtract(vec a, vec b) {
    return add(a, scale(-1, b));
}
static inline vec multiply(vec a, vec b) { /* per channel */
    return (vec){a.x * b.x, a.y * b.y, a.z * b.z};
}
static inline double dot(vec a, vec b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
static inline vec cross(vec a, vec b) {
    return (vec){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static inline double length(vec a) {
    return sqrt(dot(a, a));
}
static inline vec normalised(vec a) {
    return scale(1 / length(a), a);
}
static inline vec vec_of(const float a[3]) {
    return (vec){a[0], a[1], a[2]};
}

typedef struct ray {
    vec origin, direction; /* mm; unit length */
    double end;            /* maximum distance of a hit, mm */
} ray;

/* The result of a ray that hits a virtual object or a shadow catcher. All members are 0 if only the video is visible. */
typedef struct sample {
    int is_virtual;
    vec colour;                 /* of the virtual object, linear light */
    double opaque, translucent; /* shares of the catcher's light that opaque and translucent objects hide */
} sample;

typedef struct tracer tracer;

tracer *tracer_new(const arhost_scene *scene);                 /* NULL: out of memory. The scene must outlive it. */
void tracer_free(tracer *self);                                /* may be NULL */
void tracer_update(tracer *self, const arhost_motion *motion); /* applies the animated state */
sample tracer_trace(const tracer *self, ray r);

#endif
