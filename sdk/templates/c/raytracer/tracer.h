/* What is seen along a ray. FILL IN: this and tracer.c are the part to replace; @NAME@.c needs no more of it than
 * these functions. */
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
static inline vec multiply(vec a, vec b) { /* colours */
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
    vec origin, direction; /* length 1 */
    double end;            /* hits beyond do not count; INFINITY */
} ray;

/* What to lay over the video. Alpha is exactly 0 where the video shows, exactly 1 on virtual objects. */
typedef struct seen {
    vec colour; /* linear light */
    double alpha;
} seen;

typedef struct tracer tracer;

tracer *tracer_new(const arhost_scene *scene);            /* NULL: out of memory. The scene must live longer. */
void tracer_free(tracer *self);                           /* may be NULL */
void tracer_move(tracer *self, const arhost_motion *now); /* puts what moves where it is now */
seen tracer_look(const tracer *self, ray r);

#endif
