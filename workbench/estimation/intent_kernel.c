/* One update of the particles of one person's intents; the same arithmetic as NumpyUpdate.
   Arrays are row-major; the last intent is the unknown goal. */
#include <math.h>
#include <stddef.h>

static const double softening_m2 = 0.25;

typedef struct {
    long intents, particles, replaced, steps;
    double kick, free_kick, relax_s, deviation_m, floor, duration_s;
} sizes_t;

static void move(const sizes_t *s, double *place, double *velocity, const double *aim,
                 const double *speed, const double *kicks)
{
    const long each = s->particles, all = s->intents * each;
    const double h = s->duration_s / (double)s->steps;
    const double keep = exp(-h / s->relax_s), root = sqrt(h);
    for (long step = 0; step < s->steps; step++) {
        const double *kick = kicks + 2 * all * step;
        for (long i = 0; i < all; i++) {
            const int free_walk = i >= all - each;
            const double size = (free_walk ? s->free_kick : s->kick) * root;
            const double ax = aim[2 * i] - place[2 * i], ay = aim[2 * i + 1] - place[2 * i + 1];
            const double pace = speed[i] / sqrt(ax * ax + ay * ay + softening_m2);
            const double vx = velocity[2 * i], vy = velocity[2 * i + 1];
            const double wx = free_walk ? vx : ax * pace + keep * (vx - ax * pace);
            const double wy = free_walk ? vy : ay * pace + keep * (vy - ay * pace);
            const double nx = wx + size * kick[2 * i], ny = wy + size * kick[2 * i + 1];
            place[2 * i] += 0.5 * h * (vx + nx);
            place[2 * i + 1] += 0.5 * h * (vy + ny);
            velocity[2 * i] = nx;
            velocity[2 * i + 1] = ny;
        }
    }
}

static void copy(double *to, const double *from, long i, long k)
{
    to[2 * i] = from[2 * k];
    to[2 * i + 1] = from[2 * k + 1];
}

/* place, velocity and speed are overwritten; the result is in new_...; weight is scratch. */
void intent_update(const sizes_t *s, double *place, double *velocity, double *aim, double *speed,
                   const double *kicks, const double *speeds, const double *aims,
                   const double *comb, const double *sources, const double *members,
                   const double *measured, double *weights, const double *goals,
                   const double *spreads, double *new_place, double *new_velocity, double *new_aim,
                   double *new_speed, double *weight)
{
    const long n = s->particles, intents = s->intents, m = s->replaced;
    const double scale = -0.5 / (s->deviation_m * s->deviation_m);
    double sum = 0.0;
    move(s, place, velocity, aim, speed, kicks);
    for (long j = 0; j < intents; j++) {
        double *own = weight + j * n, total = 0.0, run = 0.0;
        for (long i = 0; i < n; i++) {
            const double dx = place[2 * (j * n + i)] - measured[0];
            const double dy = place[2 * (j * n + i) + 1] - measured[1];
            own[i] = exp(scale * (dx * dx + dy * dy)) + s->floor;
            total += own[i];
        }
        weights[j] *= total / (double)n;
        sum += weights[j];
        for (long i = 0, k = 0; i < n; i++) {
            const double mark = ((double)i + comb[j]) * (total / (double)n);
            while (k < n - 1 && run + own[k] <= mark) run += own[k++];
            copy(new_place, place, j * n + i, j * n + k);
            copy(new_velocity, velocity, j * n + i, j * n + k);
            copy(new_aim, aim, j * n + i, j * n + k);
            new_speed[j * n + i] = speed[j * n + k];
        }
    }
    for (long j = 0; j < intents; j++) weights[j] /= sum;
    /* What is replaced is read from a copy, as replaced particles are sources too. */
    for (long i = 0; i < intents * n; i++) {
        copy(place, new_place, i, i);
        copy(velocity, new_velocity, i, i);
        speed[i] = new_speed[i];
    }
    for (long r = 0; r < m; r++) {
        long from = 0;
        double run = weights[0];
        while (from < intents - 1 && run <= sources[r]) run += weights[++from];
        for (long j = 0; j < intents; j++) {
            long k = (long)(members[j * m + r] * (double)n);
            k = from * n + (k < n ? k : n - 1);
            copy(new_place, place, j * n + r, k);
            copy(new_velocity, velocity, j * n + r, k);
            new_speed[j * n + r] = speed[k];
            if (j < intents - 1)
                for (int axis = 0; axis < 2; axis++)
                    new_aim[2 * (j * n + r) + axis] = goals[2 * j + axis]
                        + spreads[j] / sqrt(2.0) * aims[2 * (j * m + r) + axis];
        }
    }
    for (long i = 0; i < intents * n; i++) {
        const double pace = new_speed[i] + 0.1 * sqrt(s->duration_s) * speeds[i];
        new_speed[i] = fmin(fmax(pace, 0.2), 2.5);
    }
}
