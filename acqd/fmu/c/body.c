/* The rigid body: inverse dynamics and where the links are. */
#include "acqd_model.h"

#if HAS_BODY
#include <math.h>

#define GRAVITY 9.81
#define SIGN_SPEED 0.02 /* rad/s within which dry friction turns round */
#define SMALL_TORQUE 0.5 /* Nm within which the magnitude of a torque is rounded off */

double direction(double speed) { return tanh(speed / SIGN_SPEED); }

double magnitude(double torque) { return sqrt(torque * torque + SMALL_TORQUE * SMALL_TORQUE) - SMALL_TORQUE; }

static void cross(const double *a, const double *b, double *out)
{
    const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    out[0] = x, out[1] = y, out[2] = z;
}

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Coordinates of the parent to those of the link. */
static void into(const frame_t *R, const double *v, double *out)
{
    for (int i = 0; i < 3; i++)
        out[i] = R->at[0][i] * v[0] + R->at[1][i] * v[1] + R->at[2][i] * v[2];
}

static void out_of(const frame_t *R, const double *v, double *out)
{
    double kept[3];
    for (int i = 0; i < 3; i++)
        kept[i] = dot(R->at[i], v);
    for (int i = 0; i < 3; i++)
        out[i] = kept[i];
}

/* w x (w x v) */
static void twice(const double *w, const double *v, double *out)
{
    const double along = dot(w, v), size = dot(w, w);
    for (int i = 0; i < 3; i++)
        out[i] = w[i] * along - v[i] * size;
}

/* The link's frame in its parent's: the joint's own, turned by the angle (Rodrigues). */
static void turned(int joint, double angle, frame_t *R)
{
    const double sine = sin(angle), rest = 1.0 - cos(angle);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            R->at[i][j] =
                JOINT_TURN[joint][0][i][j] + sine * JOINT_TURN[joint][1][i][j] + rest * JOINT_TURN[joint][2][i][j];
}

void posture_of(const double *q, const double *qd, const double *qdd, posture_t *p)
{
    const double still[3] = {0, 0, 0}, lifted[3] = {0, 0, GRAVITY};
    for (int k = 0; k < AXES; k++) {
        const double *w0 = k ? p->w[k - 1] : still, *dw0 = k ? p->dw[k - 1] : still, *dv0 = k ? p->dv[k - 1] : lifted;
        const double *place = JOINT_XYZ[k], *axis = JOINT_AXIS[k];
        double a[3], b[3], sum[3];
        turned(k, q[k], &p->R[k]);
        cross(dw0, place, a);
        twice(w0, place, b);
        for (int i = 0; i < 3; i++)
            sum[i] = dv0[i] + a[i] + b[i];
        into(&p->R[k], sum, p->dv[k]);
        into(&p->R[k], w0, p->w[k]);
        into(&p->R[k], dw0, p->dw[k]);
        cross(p->w[k], axis, a);
        for (int i = 0; i < 3; i++) {
            p->dw[k][i] += qd[k] * a[i] + axis[i] * qdd[k];
            p->w[k][i] += axis[i] * qd[k];
        }
    }
}

/* Force and moment that a link's own inertia takes. */
static void carry(const posture_t *p, int k, const double *link, double *force, double *moment)
{
    const double *first = link + 1, *w = p->w[k], *dw = p->dw[k], *dv = p->dv[k];
    const double I[3][3] = {{link[4], link[5], link[7]}, {link[5], link[6], link[8]}, {link[7], link[8], link[9]}};
    double a[3], b[3], c[3], d[3], spin[3];
    cross(dw, first, a);
    twice(w, first, b);
    for (int i = 0; i < 3; i++) {
        force[i] += link[0] * dv[i] + a[i] + b[i];
        spin[i] = dot(I[i], w);
    }
    cross(w, spin, c);
    cross(first, dv, d);
    for (int i = 0; i < 3; i++)
        moment[i] += dot(I[i], dw) + c[i] + d[i];
}

void joint_torque(const posture_t *p, const double (*links)[10], int first, double *tau)
{
    double force[3] = {0, 0, 0}, moment[3] = {0, 0, 0};
    for (int k = AXES - 1; k >= 0; k--) {
        if (k < AXES - 1) {
            double a[3];
            out_of(&p->R[k + 1], force, force);
            out_of(&p->R[k + 1], moment, moment);
            cross(JOINT_XYZ[k + 1], force, a);
            for (int i = 0; i < 3; i++)
                moment[i] += a[i];
        }
        if (k >= first)
            carry(p, k, links[k - first], force, moment);
        tau[k] = dot(moment, JOINT_AXIS[k]);
    }
}

void weight_torque(const double *q, int link, const double *point, double *tau)
{
    double at[3] = {0, 0, 0}, origin[AXES][3], axis[AXES][3];
    double place[3] = {0, 0, 0};
    frame_t turn = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    for (int k = 0; k <= link; k++) {
        double moved[3];
        frame_t R, next;
        out_of(&turn, JOINT_XYZ[k], moved);
        turned(k, q[k], &R);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                next.at[i][j] =
                    turn.at[i][0] * R.at[0][j] + turn.at[i][1] * R.at[1][j] + turn.at[i][2] * R.at[2][j];
        for (int i = 0; i < 3; i++) {
            at[i] += moved[i];
            origin[k][i] = at[i];
        }
        turn = next;
        out_of(&turn, JOINT_AXIS[k], axis[k]);
    }
    out_of(&turn, point, place);
    for (int i = 0; i < 3; i++)
        place[i] += at[i];
    for (int k = 0; k < AXES; k++)
        tau[k] = k > link ? 0.0
                          : GRAVITY * (axis[k][0] * (place[1] - origin[k][1]) - axis[k][1] * (place[0] - origin[k][0]));
}
#endif
