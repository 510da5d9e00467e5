/* Rigid-body dynamics of a serial arm, for one number or for LANES at once: define T (double or lanes_t), ZERO
   (its zero) and BODY(name) (the suffix of names), then include this file. Recursive Newton-Euler in link frames: Luh, Walker, Paul,
   On-line computational scheme for mechanical manipulators (1980). */

typedef struct {
    T at[3][3];
} BODY(frame_t);

/* Rotations to the parent's frame, angular velocity and acceleration, linear acceleration with gravity. */
typedef struct {
    BODY(frame_t) R[AXES];
    T w[AXES][3], dw[AXES][3], dv[AXES][3];
} BODY(posture_t);

INLINE void BODY(cross)(const T *a, const T *b, T *out)
{
    const T x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    out[0] = x, out[1] = y, out[2] = z;
}

INLINE void BODY(cross_constant)(const T *a, const double *b, T *out)
{
    const T x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    out[0] = x, out[1] = y, out[2] = z;
}

/* w x (w x v) */
INLINE void BODY(cross_twice)(const T *w, const double *v, T *out)
{
    const T along = w[0] * v[0] + w[1] * v[1] + w[2] * v[2], size = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
    for (int i = 0; i < 3; i++)
        out[i] = w[i] * along - v[i] * size;
}

/* Coordinates of the parent to coordinates of the link. */
INLINE void BODY(into)(const BODY(frame_t) * R, const T *v, T *out)
{
    for (int i = 0; i < 3; i++)
        out[i] = R->at[0][i] * v[0] + R->at[1][i] * v[1] + R->at[2][i] * v[2];
}

INLINE void BODY(out_of)(const BODY(frame_t) * R, const T *v, T *out)
{
    T turned[3];
    for (int i = 0; i < 3; i++)
        turned[i] = R->at[i][0] * v[0] + R->at[i][1] * v[1] + R->at[i][2] * v[2];
    for (int i = 0; i < 3; i++)
        out[i] = turned[i];
}

/* The joint's frame turned by the joint's angle (Rodrigues): R + sin R K + (1 - cos) R K K. */
INLINE void BODY(turn)(int joint, T sine, T cosine, BODY(frame_t) * R)
{
    const T versine = 1.0 - cosine;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            R->at[i][j] = JOINT_TURN[joint][0][i][j] + sine * JOINT_TURN[joint][1][i][j] +
                          versine * JOINT_TURN[joint][2][i][j];
}

static inline void BODY(posture_of)(const T *sine, const T *cosine, const T *qd, const T *qdd, BODY(posture_t) * p)
{
    T w0[3], dw0[3], dv0[3];
    for (int i = 0; i < 3; i++)
        w0[i] = dw0[i] = ZERO, dv0[i] = ZERO + (i == 2 ? GRAVITY : 0.0);
    for (int k = 0; k < AXES; k++) {
        const double *axis = JOINT_AXIS[k];
        T a[3], b[3], sum[3];
        BODY(turn)(k, sine[k], cosine[k], &p->R[k]);
        BODY(cross_constant)(dw0, JOINT_XYZ[k], a);
        BODY(cross_twice)(w0, JOINT_XYZ[k], b);
        for (int i = 0; i < 3; i++)
            sum[i] = dv0[i] + a[i] + b[i];
        BODY(into)(&p->R[k], sum, dv0);
        BODY(into)(&p->R[k], w0, sum);
        BODY(into)(&p->R[k], dw0, a);
        BODY(cross_constant)(sum, axis, b);
        for (int i = 0; i < 3; i++) {
            p->dv[k][i] = dv0[i];
            p->dw[k][i] = dw0[i] = a[i] + qd[k] * b[i] + axis[i] * qdd[k];
            p->w[k][i] = w0[i] = sum[i] + axis[i] * qd[k];
        }
    }
}

/* Force and moment that accelerate a link with inertial parameters [10]: m, first moments, xx xy yy xz yz zz. */
static inline void BODY(accelerate)(const BODY(posture_t) * p, int k, const double *link, T *force, T *moment)
{
    const double *first = link + 1;
    const double I[3][3] = {{link[4], link[5], link[7]}, {link[5], link[6], link[8]}, {link[7], link[8], link[9]}};
    const T *w = p->w[k], *dw = p->dw[k], *dv = p->dv[k];
    T a[3], b[3], c[3], spin[3];
    BODY(cross_constant)(dw, first, a);
    BODY(cross_twice)(w, first, b);
    for (int i = 0; i < 3; i++) {
        force[i] += link[0] * dv[i] + a[i] + b[i];
        spin[i] = I[i][0] * w[0] + I[i][1] * w[1] + I[i][2] * w[2];
    }
    BODY(cross)(w, spin, c);
    BODY(cross_constant)(dv, first, a); /* first x dv = -(dv x first) */
    for (int i = 0; i < 3; i++)
        moment[i] += (I[i][0] * dw[0] + I[i][1] * dw[1] + I[i][2] * dw[2]) + c[i] - a[i];
}

/* Force and moment from link k + 1 to link k. */
static inline void BODY(pass_down)(const BODY(posture_t) * p, int k, T *force, T *moment)
{
    T a[3];
    BODY(out_of)(&p->R[k + 1], force, force);
    BODY(out_of)(&p->R[k + 1], moment, moment);
    BODY(cross_constant)(force, JOINT_XYZ[k + 1], a); /* xyz x force = -(force x xyz) */
    for (int i = 0; i < 3; i++)
        moment[i] -= a[i];
}

INLINE T BODY(about_axis)(int k, const T *moment)
{
    return moment[0] * JOINT_AXIS[k][0] + moment[1] * JOINT_AXIS[k][1] + moment[2] * JOINT_AXIS[k][2];
}

/* Torque [AXES] Nm of the links with inertial parameters [AXES][10]. */
static inline void BODY(joint_torque)(const BODY(posture_t) * p, const double (*links)[10], T *tau)
{
    T force[3], moment[3];
    for (int i = 0; i < 3; i++)
        force[i] = moment[i] = ZERO;
    for (int k = AXES - 1; k >= 0; k--) {
        if (k < AXES - 1)
            BODY(pass_down)(p, k, force, moment);
        BODY(accelerate)(p, k, links[k], force, moment);
        tau[k] = BODY(about_axis)(k, moment);
    }
}

/* Torque [AXES] Nm of a body with inertial parameters [10] on the last link of an arm without mass. */
static inline void BODY(last_link_torque)(const BODY(posture_t) * p, const double *body, T *tau)
{
    T force[3], moment[3];
    for (int i = 0; i < 3; i++)
        force[i] = moment[i] = ZERO;
    BODY(accelerate)(p, AXES - 1, body, force, moment);
    for (int k = AXES - 1; k >= 0; k--) {
        if (k < AXES - 1)
            BODY(pass_down)(p, k, force, moment);
        tau[k] = BODY(about_axis)(k, moment);
    }
}

/* Torque [AXES] Nm that holds 1 kg at a point (m, in the link's frame) against gravity. */
static inline void BODY(weight_torque)(const BODY(posture_t) * p, int link, const double *point, T *tau)
{
    T at[3], origin[AXES][3], axis[AXES][3], column[3];
    BODY(frame_t) turn;
    for (int i = 0; i < 3; i++) {
        at[i] = ZERO;
        for (int j = 0; j < 3; j++)
            turn.at[i][j] = ZERO + (i == j ? 1.0 : 0.0);
    }
    for (int k = 0; k <= link; k++) {
        BODY(frame_t) next;
        for (int i = 0; i < 3; i++)
            at[i] += turn.at[i][0] * JOINT_XYZ[k][0] + turn.at[i][1] * JOINT_XYZ[k][1] +
                     turn.at[i][2] * JOINT_XYZ[k][2];
        for (int j = 0; j < 3; j++) {
            for (int i = 0; i < 3; i++)
                column[i] = p->R[k].at[i][j];
            for (int i = 0; i < 3; i++)
                next.at[i][j] = turn.at[i][0] * column[0] + turn.at[i][1] * column[1] + turn.at[i][2] * column[2];
        }
        turn = next;
        for (int i = 0; i < 3; i++) {
            origin[k][i] = at[i];
            axis[k][i] = turn.at[i][0] * JOINT_AXIS[k][0] + turn.at[i][1] * JOINT_AXIS[k][1] +
                         turn.at[i][2] * JOINT_AXIS[k][2];
        }
    }
    for (int i = 0; i < 3; i++)
        at[i] += turn.at[i][0] * point[0] + turn.at[i][1] * point[1] + turn.at[i][2] * point[2];
    for (int k = 0; k < AXES; k++)
        tau[k] = k > link ? ZERO
                          : GRAVITY * (axis[k][0] * (at[1] - origin[k][1]) - axis[k][1] * (at[0] - origin[k][0]));
}
