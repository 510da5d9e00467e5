/* Joint torques of many rows, by the recursive Newton-Euler algorithm in link frames. See newton_euler.py. */

#include <stddef.h>
#include <string.h>

#define LANES 8
#define MOST_AXES 16
#define INLINE static inline __attribute__((always_inline))

typedef double vec __attribute__((vector_size(64)));

/* A joint as `rigid_body.py` packs it: 28 numbers. */
struct joint {
    double place[3];   /* m, of the joint's frame in the frame of the joint before it */
    double slide[3];   /* m/m: direction in that frame of a prismatic joint, 0 of others */
    double fixed[9];   /* from the frame in which the joint turns about z to the frame before it */
    double basis[9];   /* from that frame to the link's frame */
    double axis[3];    /* in the link's frame */
    double slides;     /* 1 of a prismatic joint */
};

/* A link with its motion, at LANES moments. */
struct link {
    vec place[3], cosine, sine;
    vec w[3], dw[3], dv[3]; /* angular velocity, angular and linear acceleration, in the link's frame */
};

INLINE void cross(const vec *a, const vec *b, vec *out)
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

INLINE void times(const double *m, const vec *v, vec *out)
{
    for (int i = 0; i < 3; i++)
        out[i] = m[3 * i] * v[0] + m[3 * i + 1] * v[1] + m[3 * i + 2] * v[2];
}

INLINE void times_transposed(const double *m, const vec *v, vec *out)
{
    for (int i = 0; i < 3; i++)
        out[i] = m[i] * v[0] + m[3 + i] * v[1] + m[6 + i] * v[2];
}

/* From the frame before the joint to the link's frame. */
INLINE void to_link(const struct joint *j, const struct link *l, const vec *v, vec *out)
{
    vec before[3], turned[3];
    times_transposed(j->fixed, v, before);
    turned[0] = l->cosine * before[0] + l->sine * before[1];
    turned[1] = l->cosine * before[1] - l->sine * before[0];
    turned[2] = before[2];
    times(j->basis, turned, out);
}

/* From the link's frame to the frame before the joint. */
INLINE void to_parent(const struct joint *j, const struct link *l, const vec *v, vec *out)
{
    vec before[3], turned[3];
    times_transposed(j->basis, v, turned);
    before[0] = l->cosine * turned[0] - l->sine * turned[1];
    before[1] = l->sine * turned[0] + l->cosine * turned[1];
    before[2] = turned[2];
    times(j->fixed, before, out);
}

/* What turning adds to the acceleration at a place: dw x p + w x (w x p). */
INLINE void turning(const struct link *l, const vec *p, vec *out)
{
    vec tangential[3], across[3], radial[3];
    cross(l->dw, p, tangential);
    cross(l->w, p, across);
    cross(l->w, across, radial);
    for (int i = 0; i < 3; i++)
        out[i] = tangential[i] + radial[i];
}

/* Links `first` on, from the base to the tip: rows begin at `q`, `qd`, `qdd`, `cosine`, `sine` [lanes, axes]. */
static void move(const struct joint *joints, int axes, double gravity, int lanes, const double *q, const double *qd,
                 const double *qdd, const double *cosine, const double *sine, struct link *links)
{
    struct link base;
    memset(&base, 0, sizeof base);
    base.dv[2] = (vec){0} + gravity;
    const struct link *before = &base;
    for (int k = 0; k < axes; k++) {
        const struct joint *j = &joints[k];
        struct link *l = &links[k];
        vec at, speed, acceleration, sum[3], relative[3];
        for (int n = 0; n < LANES; n++) { /* lanes behind the last row repeat that row */
            const int row = (n < lanes ? n : lanes - 1) * axes + k;
            at[n] = q[row], speed[n] = qd[row], acceleration[n] = qdd[row];
            l->cosine[n] = j->slides ? 1.0 : cosine[row];
            l->sine[n] = j->slides ? 0.0 : sine[row];
        }
        for (int i = 0; i < 3; i++)
            l->place[i] = j->place[i] + j->slide[i] * at;
        turning(before, l->place, sum);
        for (int i = 0; i < 3; i++)
            sum[i] += before->dv[i];
        to_link(j, l, before->w, l->w);
        to_link(j, l, before->dw, l->dw);
        to_link(j, l, sum, l->dv);
        const vec axis[3] = {(vec){0} + j->axis[0], (vec){0} + j->axis[1], (vec){0} + j->axis[2]};
        cross(l->w, axis, relative);
        for (int i = 0; i < 3; i++) {
            if (j->slides) { /* Coriolis and relative acceleration along the axis */
                l->dv[i] += 2.0 * speed * relative[i] + acceleration * axis[i];
            } else {
                l->dw[i] += speed * relative[i] + acceleration * axis[i];
                l->w[i] += speed * axis[i];
            }
        }
        before = l;
    }
}

/* Force and moment that a body with inertial parameters [10] (m, mx, my, mz, xx, xy, yy, xz, yz, zz) needs. */
INLINE void add_load(const double *body, const struct link *l, vec *force, vec *moment)
{
    const double tensor[9] = {body[4], body[5], body[7], body[5], body[6], body[8], body[7], body[8], body[9]};
    const vec first[3] = {(vec){0} + body[1], (vec){0} + body[2], (vec){0} + body[3]};
    vec turned[3], change[3], momentum[3], gyroscopic[3], lever[3];
    turning(l, first, turned);
    times(tensor, l->dw, change);
    times(tensor, l->w, momentum);
    cross(l->w, momentum, gyroscopic);
    cross(first, l->dv, lever);
    for (int i = 0; i < 3; i++) {
        force[i] += body[0] * l->dv[i] + turned[i];
        moment[i] += change[i] + gyroscopic[i] + lever[i];
    }
}

/* Torques [lanes, axes] of bodies [axes, 10] on the moving links, from the tip to the base. */
static void carry(const struct joint *joints, const struct link *links, int axes, int lanes, const double *bodies,
                  double *tau)
{
    vec force[3] = {{0}}, moment[3] = {{0}};
    int loaded = 0;
    for (int k = axes - 1; k >= 0; k--) {
        const double *body = bodies + 10 * k;
        if (loaded) {
            const struct joint *after = &joints[k + 1];
            const struct link *link = &links[k + 1];
            vec carried[3], turned[3], lever[3];
            to_parent(after, link, force, carried);
            to_parent(after, link, moment, turned);
            cross(link->place, carried, lever);
            for (int i = 0; i < 3; i++)
                force[i] = carried[i], moment[i] = turned[i] + lever[i];
        }
        for (int i = 0; i < 10 && !loaded; i++)
            loaded = body[i] != 0.0;
        if (loaded)
            add_load(body, &links[k], force, moment);
        const vec *felt = joints[k].slides ? force : moment;
        const vec torque = joints[k].axis[0] * felt[0] + joints[k].axis[1] * felt[1] + joints[k].axis[2] * felt[2];
        for (int n = 0; n < lanes; n++)
            tau[n * axes + k] = torque[n];
    }
}

/* tau [sets, rows, axes] of `sets` of bodies [sets, axes, 10] at a motion [rows, axes]; at most MOST_AXES axes. */
void acqd_joint_torques(ptrdiff_t rows, ptrdiff_t axes, const double *packed, double gravity, const double *q,
                        const double *qd, const double *qdd, const double *cosine, const double *sine, ptrdiff_t sets,
                        const double *bodies, double *tau)
{
    const struct joint *joints = (const struct joint *)packed;
    struct link links[MOST_AXES];
    for (ptrdiff_t row = 0; row < rows; row += LANES) {
        const int lanes = rows - row < LANES ? (int)(rows - row) : LANES;
        const ptrdiff_t at = row * axes;
        move(joints, (int)axes, gravity, lanes, q + at, qd + at, qdd + at, cosine + at, sine + at, links);
        for (ptrdiff_t set = 0; set < sets; set++)
            carry(joints, links, (int)axes, lanes, bodies + set * axes * 10, tau + set * rows * axes + at);
    }
}
