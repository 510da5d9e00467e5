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
static void into(double R[3][3], const double *v, double *out)
{
    for (int i = 0; i < 3; i++)
        out[i] = R[0][i] * v[0] + R[1][i] * v[1] + R[2][i] * v[2];
}

static void out_of(double R[3][3], const double *v, double *out)
{
    double kept[3];
    for (int i = 0; i < 3; i++)
        kept[i] = dot(R[i], v);
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
static void turned(int joint, double angle, double R[3][3])
{
    const double *a = JOINT_AXIS[joint], sine = sin(angle), rest = 1.0 - cos(angle);
    const double K[3][3] = {{0, -a[2], a[1]}, {a[2], 0, -a[0]}, {-a[1], a[0], 0}};
    double about[3][3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double square = 0;
            for (int k = 0; k < 3; k++)
                square += K[i][k] * K[k][j];
            about[i][j] = (i == j) + sine * K[i][j] + rest * square;
        }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            R[i][j] = 0;
            for (int k = 0; k < 3; k++)
                R[i][j] += JOINT_ROTATION[joint][i][k] * about[k][j];
        }
}

void joint_torque(const double (*links)[10], const double *q, const double *qd, const double *qdd, double *tau)
{
    double R[AXES][3][3], w[AXES][3], dw[AXES][3], dv[AXES][3];
    const double still[3] = {0, 0, 0}, lifted[3] = {0, 0, GRAVITY};
    for (int k = 0; k < AXES; k++) {
        const double *w0 = k ? w[k - 1] : still, *dw0 = k ? dw[k - 1] : still, *dv0 = k ? dv[k - 1] : lifted;
        const double *p = JOINT_XYZ[k], *axis = JOINT_AXIS[k];
        double a[3], b[3], sum[3];
        turned(k, q[k], R[k]);
        cross(dw0, p, a);
        twice(w0, p, b);
        for (int i = 0; i < 3; i++)
            sum[i] = dv0[i] + a[i] + b[i];
        into(R[k], sum, dv[k]);
        into(R[k], w0, w[k]);
        into(R[k], dw0, dw[k]);
        cross(w[k], axis, a);
        for (int i = 0; i < 3; i++) {
            dw[k][i] += qd[k] * a[i] + axis[i] * qdd[k];
            w[k][i] += axis[i] * qd[k];
        }
    }
    double force[3] = {0, 0, 0}, moment[3] = {0, 0, 0};
    for (int k = AXES - 1; k >= 0; k--) {
        const double *link = links[k], *first = link + 1;
        const double I[3][3] = {{link[4], link[5], link[7]}, {link[5], link[6], link[8]}, {link[7], link[8], link[9]}};
        double a[3], b[3], c[3], d[3], spin[3];
        if (k < AXES - 1) {
            out_of(R[k + 1], force, force);
            out_of(R[k + 1], moment, moment);
            cross(JOINT_XYZ[k + 1], force, a);
            for (int i = 0; i < 3; i++)
                moment[i] += a[i];
        }
        cross(dw[k], first, a);
        twice(w[k], first, b);
        for (int i = 0; i < 3; i++) {
            force[i] += link[0] * dv[k][i] + a[i] + b[i];
            spin[i] = dot(I[i], w[k]);
        }
        cross(w[k], spin, c);
        cross(first, dv[k], d);
        for (int i = 0; i < 3; i++)
            moment[i] += dot(I[i], dw[k]) + c[i] + d[i];
        tau[k] = dot(moment, JOINT_AXIS[k]);
    }
}

void weight_torque(const double *q, int link, const double *point, double *tau)
{
    double at[3] = {0, 0, 0}, turn[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, origin[AXES][3], axis[AXES][3];
    double place[3] = {0, 0, 0};
    for (int k = 0; k <= link; k++) {
        double R[3][3], next[3][3], moved[3];
        out_of(turn, JOINT_XYZ[k], moved);
        turned(k, q[k], R);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                next[i][j] = turn[i][0] * R[0][j] + turn[i][1] * R[1][j] + turn[i][2] * R[2][j];
        for (int i = 0; i < 3; i++) {
            at[i] += moved[i];
            origin[k][i] = at[i];
            for (int j = 0; j < 3; j++)
                turn[i][j] = next[i][j];
        }
        out_of(turn, JOINT_AXIS[k], axis[k]);
    }
    out_of(turn, point, place);
    for (int i = 0; i < 3; i++)
        place[i] += at[i];
    for (int k = 0; k < AXES; k++)
        tau[k] = k > link ? 0.0
                          : GRAVITY * (axis[k][0] * (place[1] - origin[k][1]) - axis[k][1] * (place[0] - origin[k][0]));
}
#endif
