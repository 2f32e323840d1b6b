/* A kernel with the real interface and closed-form tubes.
 *
 * Under TRACK the vehicle keeps its speed interval, in the stop tube it may accelerate; BRAKE takes 2 to
 * 3 m/s^2 at once. The body is a disc about the rear axle, and people are where they are at the end of a
 * row. The parameter "mischief" makes it answer wrongly in one chosen way.
 */
#include <fenv.h>
#include <math.h>
#include <string.h>
enum { TRACK, STOP, BRAKE, INTENT = 0, GUARD = 1 };
long long wb_query_size(void) { return QUERY_SIZE; }
long long wb_result_size(void) { return RESULT_SIZE; }
long long wb_work_size(void) { return 4; }

static double position(const double *q, const double *column, double station) {
    double at = (station - q[Q_path_start_m]) / q[Q_path_spacing_m];
    double node = floor(fmin(fmax(at, 0.0), q[Q_path_count] - 2.0));
    int j = (int)node;
    return column[j] + (at - node) * (column[j + 1] - column[j]);
}

static void nearer(double *best, double gap, double when, double who, double tube, double cause) {
    if (gap >= best[0]) return;
    best[0] = gap; best[1] = when; best[2] = who; best[3] = tube; best[4] = cause;
}

/* People's tubes of one kind at an instant of their clock, against a disc. */
static void compare(const double *q, int kind, const double *box, double to, double *best) {
    double seen = -1.0, tube = 0.0;
    int has = 0;
    for (int i = 0; i <= (int)q[Q_tubes_count]; i++) {
        const double *t = q + Q_people_tubes + 5 * i;
        double gap = -1e300, at = to + q[Q_skew_s + 1];
        int last = i == (int)q[Q_tubes_count];
        if (last || t[0] != seen) {
            if (seen >= 0.0 && !has) nearer(best, -1e300, 0.0, seen, -1.0, 1.0);
            if (last) return;
            seen = t[0]; tube = 0.0; has = 0;
        }
        if ((int)t[1] == kind) {
            has = 1;
            for (int b = (int)t[3]; b < (int)(t[3] + t[4]); b++) {
                const double *p = q + Q_people_pieces + 9 * b;
                double s = at - p[1];
                int current = b + 1 == (int)(t[3] + t[4]) || p[9] != p[0] || p[10] > at;
                if (p[1] > at || !current) continue;
                gap = fmax(gap, hypot(p[2] + p[4] * s - box[0], p[3] + p[5] * s - box[1])
                    - hypot(box[3], box[4]) - p[6] - p[7] * s - 0.5 * p[8] * s * s);
            }
            if (t[2] < at) nearer(best, -1e300, to, seen, tube, 1.0);
            else nearer(best, gap, to, seen, tube, 0.0);
        }
        tube += 1.0;
    }
}

/* One tube of one level; its fields from r on, of which the verdict is returned. */
static int tube(const double *q, int level, int order, double *r) {
    const double *c = q + Q_initial_center + 7 * level, *d = q + Q_initial_radius + 7 * level;
    const double *command = q + (order == STOP ? Q_switch_s : Q_brake_s);
    double slow = c[3] - d[3], fast = c[3] + d[3], low = c[0] - d[0], high = c[0] + d[0];
    double end = q[Q_path_start_m] + q[Q_path_spacing_m] * (q[Q_path_count] - 1.0);
    double body = hypot(fmax(q[Q_front_m], q[Q_rear_m]), q[Q_half_width_m]);
    int k, kind, status = order == TRACK ? 0 : 5, near = 0, stands = 0;
    for (kind = INTENT; kind <= GUARD; kind++) {
        double *best = r + (kind == INTENT ? T_intent : T_guard);
        int asked = order == BRAKE || (order == STOP) == (kind == GUARD);
        best[0] = asked ? 1e300 : -1e300; best[1] = 0.0; best[2] = best[3] = -1.0;
        best[4] = asked ? 0.0 : 3.0;
    }
    for (k = 0; k < STEPS && !stands; k++) {
        double from = k * STEP_S, to = from + STEP_S, box[5], bottom, top;
        double *lo = r + T_lower + 7 * k, *hi = r + T_upper + 7 * k;
        if (order != TRACK && from >= command[1] && fast <= 0.0) stands = 1;
        bottom = slow; top = fast;
        if (order == STOP && from < command[1]) top += q[Q_acceleration_bound] * STEP_S;
        if (order != TRACK && to > command[0]) bottom -= 3.0 * STEP_S;
        if (order != TRACK && from >= command[1]) top -= 2.0 * STEP_S;
        for (int i = 0; i < 7; i++) { lo[i] = c[i] - d[i]; hi[i] = c[i] + d[i]; }
        lo[0] = low + (stands ? 0.0 : fmin(0.0, fmin(slow, bottom) * STEP_S));
        hi[0] = high + (stands ? 0.0 : fmax(0.0, fmax(fast, top) * STEP_S));
        lo[3] = stands ? 0.0 : fmin(slow, bottom); hi[3] = stands ? 0.0 : fmax(fast, top);
        if (lo[0] < q[Q_path_start_m] || hi[0] > end) { status = 1; break; }
        double mid = 0.5 * (lo[0] + hi[0]);
        box[2] = position(q, q + Q_path_heading, mid);
        box[0] = position(q, q + Q_path_x, mid) - c[1] * sin(box[2]);
        box[1] = position(q, q + Q_path_y, mid) + c[1] * cos(box[2]);
        box[3] = body + 0.5 * (hi[0] - lo[0]);
        box[4] = body + d[1];
        memcpy(r + T_occupancy + 5 * k, box, sizeof box);
        if (order != STOP) compare(q, INTENT, box, to, r + T_intent);
        if (order != TRACK) compare(q, GUARD, box, to, r + T_guard);
        low += STEP_S * (order == TRACK ? slow : fmax(bottom, 0.0));
        high += STEP_S * (order == TRACK ? fast : fmax(fmax(fast, top), 0.0));
        slow = order == TRACK ? slow : fmax(bottom, 0.0); fast = order == TRACK ? fast : fmax(top, 0.0);
    }
    if (stands) status = 0;
    if (order != STOP) near |= !(r[T_intent] >= q[Q_clearance_required_m]);
    if (order != TRACK) near |= !(r[T_guard] >= q[Q_clearance_required_m]);
    r[T_status] = status; r[T_rows] = k; r[T_level] = level; r[T_cells] = 1.0;
    return status || near;
}

static void settle(const double *q, int order, double *r) {
    static double kept[T_SIZE];
    int proved = 0;
    for (int level = 0; level < LEVELS; level++) {
        if (!proved) {
            int found;
            memset(kept, 0, sizeof kept);
            found = tube(q, level, order, kept);
            if (level <= DECIDING) memcpy(r + LEVELS, kept + LEVELS, sizeof kept - LEVELS * sizeof *r);
            proved = !found;
        }
        r[level] = proved ? 0.0 : 1.0;
    }
}

int wb_decide(const double *q, double *result, double *work) {
    int kind = (int)q[Q_parameters + 1];
    double *r = result + R_track_verdicts, *stop = result + R_stop_verdicts;
    if (kind == 1) return 7;
    if (kind == 2) return 0;
    for (int i = 0; i < RESULT_SIZE; i++) result[i] = 0.0;
    for (int i = 0; i < QUERY_SIZE; i++)
        if (!isfinite(q[i])) { result[R_status] = 4.0; return 0; }
    for (int order = TRACK; order <= BRAKE; order++) settle(q, order, r + order * T_SIZE);
    result[R_spent] = 3.0 * STEPS;
    work[0] = r[T_intent];
    switch (kind) {
        case 3: r[0] = 7.0; break;
        case 4: r[1] = 0.5; break;
        case 5: r[T_status] = 9.0; break;
        case 6: r[T_rows] = 2.5; break;
        case 7: r[T_rows] = STEPS + 1; break;
        case 8: r[T_lower + 24] = -INFINITY; break;
        case 9: r[T_upper + 7 * STEPS - 1] = NAN; break;
        case 10: r[T_occupancy + 12] = NAN; break;
        case 11: r[T_lower + 7] = r[T_upper + 7] + 1.0; break;
        case 12: r[T_lower + 3] = r[T_upper + 3]; break;
        case 13: r[T_occupancy + 8] = -0.1; break;
        case 14: r[T_status] = 1.0; break;
        case 15: r[T_rows] = STEPS - 1; break;
        case 16: r[0] = r[1] = r[2] = 0.0; r[T_intent] = q[Q_clearance_required_m] - 0.01; break;
        case 17: r[T_intent + 2] = -1.0; r[T_intent] = 1e300; break;
        case 18: r[T_intent + 2] = q[Q_people_count]; break;
        case 19: r[T_intent + 1] = -0.1; break;
        case 20: r[T_intent + 1] = NAN; break;
        case 21: r[T_intent] = NAN; break;
        case 22: r[T_intent + 2] = -1.0; break;
        case 23: r[0] = r[1] = r[2] = 1.0; r[T_status] = 2.0; r[T_rows] = 0.0; break;
        case 24: r[0] = r[1] = r[2] = 1.0; r[T_status] = 3.0; r[T_rows] = 10.0; break;
        case 25: r[0] = r[1] = r[2] = 2.0; break;
        case 26: r[T_status] = 4.0; break;
        case 27: fesetround(FE_UPWARD); break;
        case 28: r[0] = r[1] = r[2] = 1.0; break;
        case 29: r[T_occupancy + 9] = -0.1; break;
        case 30: r[T_upper + 3] = r[T_lower + 3]; break;
        case 31: r[0] = 0.0; r[1] = 1.0; break;
        case 32: r[T_level] = -1.0; break;
        case 33: r[T_level] = DECIDING + 1; break;
        case 34: r[T_cells] = 0.0; break;
        case 35: result[R_spent] = 1e9; break;
        case 36: result[R_status] = 1.0; break;
        case 37: result[R_status] = 4.0; break;
        case 38: stop[T_rows] -= 1.0; break;
        case 39: stop[T_rows] = 0.0; break;
        case 40: r[T_intent + 4] = 1.0; break;
        case 41: r[T_intent + 4] = 4.0; break;
        case 42: r[T_intent + 3] = 4.0; break;
        case 43: stop[T_upper + 7 * ((int)stop[T_rows] - 1) + 3] = 1e-9; break;
        case 44: r[T_intent] = -1e300; r[T_intent + 4] = 3.0; break;
        case 45: stop[0] = stop[1] = stop[2] = 1.0; break;
        case 46: stop[T_lower] = stop[T_upper]; break;
        case 47: r[2 * T_SIZE] = r[2 * T_SIZE + 1] = r[2 * T_SIZE + 2] = 1.0; break;
        case 48: r[2 * T_SIZE] = r[2 * T_SIZE + 1] = r[2 * T_SIZE + 2] = 0.0; break;
        case 49: r[T_intent] = -1e300; r[T_intent + 4] = 2.0; r[0] = r[1] = r[2] = 1.0; break;
        case 50: r[T_lower + 3] += 0.05; break;
        default: break;
    }
    return 0;
}
