/* What the car is told, and the tube of everything it can then do.
 *
 * TRACK is the loop itself. From the first instant at which BRAKE may be commanded the speed is no longer
 * integrated but bounded in closed form: until the last such instant it may change as fast as TRACK can
 * make it; the earliest braking is the strongest one after a command at the first instant, the latest is
 * the weakest one after a command at the last. These bounds, and those of the share of the steering that
 * is left (1 in TRACK), enter the tube as disturbances. Theory: docs/stopping-tube.md.
 */

enum { WB_UNFINISHED = 5 }; /* rows or budget were used up */
enum wb_brake { WB_BRAKE_LEAST, WB_BRAKE_MOST, WB_BRAKE_DELAY, WB_BRAKE_BUILD_UP, WB_BRAKE_STOP_SPEED };

/* Rounding of the few operations that bound a speed, whose terms are below 2^10 m/s. */
#define WB_SPEED_ROUNDING 0x1p-40

typedef struct {
  int brakes;                          /* 0: TRACK to the end */
  int mask;                            /* kinds of people's tubes that count */
  double switch_lower, switch_upper;   /* BRAKE is commanded between, in time since the motion began */
  double held_lower, held_upper;       /* the motion begins between, in time since the stamp */
  int rows;                            /* of `step` each, but that the last one ends at `until` */
  double step, until;
} wb_order;

typedef struct {
  wb_set s;
  const double *q;
  const wb_path *path;
  const wb_order *order;
  int prepared, braking;
  int free; /* whether the steering may do anything within its limits */
  double brake_from, brake_lower, brake_upper; /* speeds at the first instant of the switch */
  double push[2], misread[2], turn[2];         /* what disturbs acceleration, speed reading, steering rate */
  double low, high;                            /* speeds during the step */
} wb_drive;

/* How long after a command the car has been braked, at most (side 1) or at least (-1), as if fully: the
 * integral t^2 / (2 build-up) of the build-up lies above t - build-up / 2 and below t / 2. */
static double wb_braked(const wb_drive *d, double t, int side) {
  const double *brake = d->q + WB_Q_BRAKE;
  const double acting = wb_max(t - brake[WB_BRAKE_DELAY], 0.0), lost = brake[WB_BRAKE_BUILD_UP] / 2;
  if (side > 0) return wb_max(acting - lost, wb_min(acting, 2 * lost) / 2);
  return wb_max(acting - lost, 0.0);
}

/* How slow the car can be at t, if it could also roll back. */
static double wb_slowest(const wb_drive *d, double t) {
  const double tracked = wb_min(t, d->order->switch_upper) - d->brake_from;
  const double braked = wb_braked(d, t - d->order->switch_lower, 1);
  const double least = wb_min(d->q[WB_Q_PARAMETERS + WB_ACCEL_MIN], 0.0);
  const double commanded = least * tracked - d->q[WB_Q_BRAKE + WB_BRAKE_MOST] * braked;
  return d->brake_lower + commanded + wb_min(d->push[0], 0.0) * (t - d->brake_from) - WB_SPEED_ROUNDING;
}

/* How fast the car can be at t. */
static double wb_fastest(const wb_drive *d, double t) {
  const double tracked = wb_min(t, d->order->switch_upper) - d->brake_from;
  const double braked = wb_braked(d, t - d->order->switch_upper, -1);
  const double most = wb_max(d->q[WB_Q_PARAMETERS + WB_ACCEL_MAX], 0.0);
  const double commanded = most * tracked - d->q[WB_Q_BRAKE + WB_BRAKE_LEAST] * braked;
  const double v = d->brake_upper + commanded + wb_max(d->push[1], 0.0) * (t - d->brake_from);
  return wb_max(v + WB_SPEED_ROUNDING, 0.0);
}

/* From when on the car cannot become faster any more: what pushes it does so until the brake holds it. */
static double wb_peak(const wb_drive *d) {
  const double *brake = d->q + WB_Q_BRAKE;
  const double held = brake[WB_BRAKE_DELAY] + 0.5 * brake[WB_BRAKE_BUILD_UP];
  return d->order->switch_upper + (d->push[1] > 0.0 ? held : 0.0);
}

/* Whether the car stands from t on, whenever it was told to brake. */
static int wb_stands(const wb_drive *d, double t) {
  return d->braking && t >= wb_peak(d) && wb_fastest(d, t) <= 0.0;
}

/* Share of the steering that BRAKE leaves at speed v. */
static double wb_steering_share(const wb_drive *d, double v) {
  return wb_min(wb_max(v / d->q[WB_Q_BRAKE + WB_BRAKE_STOP_SPEED] - 1.0, 0.0), 1.0);
}

static void wb_switch(wb_drive *d, int parameter, double value) {
  double *p = d->s.p + parameter;
  if (*p >= value && *p <= value) return;
  *p = value;
  d->s.bounded = d->s.derived = 0;
}

/* The loop's mode over [t, t + h], and bounds of its speed and of its share of the steering. */
static void wb_obey(wb_drive *d, double t, double h, double *share) {
  const wb_order *order = d->order;
  const int waits = t < order->switch_upper; /* it may not have been told to brake yet */
  share[0] = share[1] = 1.0;
  if (!d->braking && !(order->brakes && t + h > order->switch_lower)) {
    d->low = d->s.now->lower[WB_SPEED];
    d->high = d->s.now->upper[WB_SPEED];
    return;
  }
  if (!d->braking) {
    d->braking = 1;
    d->brake_from = t;
    d->brake_lower = d->s.now->lower[WB_SPEED];
    d->brake_upper = wb_max(d->s.now->upper[WB_SPEED], 0.0); /* a car that is pushed starts from 0 at least */
    wb_switch(d, WB_TRACKING, 0.0);
    wb_switch(d, WB_BRAKING, 1.0);
  }
  wb_switch(d, WB_INTEGRATING, waits ? 1.0 : 0.0);
  d->low = wb_slowest(d, t + h);
  if (!waits) d->low = wb_max(d->low, 0.0);
  d->high = wb_fastest(d, wb_max(t, wb_min(wb_peak(d), t + h)));
  share[0] = wb_max(wb_steering_share(d, d->low + d->misread[0]) - WB_SPEED_ROUNDING, 0.0);
  if (!waits) share[1] = wb_min(wb_steering_share(d, d->high + d->misread[1]) + WB_SPEED_ROUNDING, 1.0);
}

#define WB_LETS_GO 0.5 /* chosen by width: between 0.25 and 1 it makes little difference */

/* From when on a feedback that is known badly widens the set more than none at all would: once the steering's
 * own uncertainty exceeds half of what its rate can still add before the standstill. */
static int wb_lets_go(const wb_drive *d, double t) {
  const double *p = d->q + WB_Q_PARAMETERS, radius = d->s.now->linear[WB_STEERING] + d->s.now->rest[WB_STEERING];
  const double rate = wb_max(-p[WB_RATE_MIN], p[WB_RATE_MAX]);
  const double left = wb_fastest(d, t) / d->q[WB_Q_BRAKE + WB_BRAKE_LEAST];
  return t >= d->order->switch_upper && WB_LETS_GO * rate * left <= radius;
}

#if WB_REFERENCE_CHANGE >= 0
enum wb_ramp { WB_RAMP_LEAST, WB_RAMP_MOST, WB_RAMP_SLACK };

/* Cuts the range of the reference speed's change to what a ramp makes of it during [t, t + h]: it leaves 0 no
 * faster than `most`, begun `slack` early, and, where it has one end to go to, no slower than `least`, begun
 * as much late. */
static void wb_ramp(const wb_drive *d, double t, double h, double *low, double *high) {
  const double *ramp = d->q + WB_Q_REFERENCE_RAMP, from = *low, to = *high;
  const double gone = ramp[WB_RAMP_LEAST] * wb_max(t - ramp[WB_RAMP_SLACK], 0.0) - WB_SPEED_ROUNDING;
  const double most = ramp[WB_RAMP_MOST] * (t + h + ramp[WB_RAMP_SLACK]) + WB_SPEED_ROUNDING;
  *low = from < 0.0 ? wb_max(from, -most) : wb_min(to, wb_max(gone, 0.0));
  *high = to > 0.0 ? wb_min(to, most) : wb_max(from, -wb_max(gone, 0.0));
}
#endif

/* Sets the disturbances of the next step; the stations reached lie in [*from, *to]. */
static int wb_disturb_drive(wb_drive *d, double t, double h, double *from, double *to) {
  wb_set *s = &d->s;
  double share[2];
  int i;
  wb_obey(d, t, h, share);
  *from = s->now->lower[WB_STATION] + WB_REACH * h * wb_min(d->low, 0.0) - WB_SLACK;
  *to = s->now->upper[WB_STATION] + WB_REACH * h * wb_max(d->high, 0.0) + WB_SLACK;
  for (i = 0; i < WB_NW; ++i) {
    double low = d->q[WB_Q_DISTURBANCE_LOWER + i], high = d->q[WB_Q_DISTURBANCE_UPPER + i];
    if (i == WB_CURVATURE && !wb_curvature(d->path, *from, *to, &low, &high)) return 0;
#if WB_REFERENCE_CHANGE >= 0
    if (i == WB_REFERENCE_CHANGE) wb_ramp(d, t, h, &low, &high);
#endif
    if (i == WB_BRAKE_SPEED) {
      low = d->braking ? d->low : 0.0;
      high = d->braking ? d->high : 0.0;
    } else if (i == WB_INTEGRAL_SHARE || (i == WB_STEERING_SHARE && !d->free)) {
      low = share[0];
      high = share[1];
    } else if (i == WB_STEERING_SHARE) {
      low = high = 0.0;
    } else if (i == WB_FREE_STEERING) {
      low = d->free ? wb_min(d->q[WB_Q_PARAMETERS + WB_RATE_MIN], 0.0) * share[1] : 0.0;
      high = d->free ? wb_max(d->q[WB_Q_PARAMETERS + WB_RATE_MAX], 0.0) * share[1] : 0.0;
    }
    if (!(low >= wb_w_lower[i] && low <= high && high <= wb_w_upper[i])) return 0;
    wb_disturb(s, i, low, high);
  }
  return 1;
}

/* What the step from t to t + h adds to a row. While BRAKE may be in force the speed is what bounds it,
 * and the speed's integral may have been reset. */
static void wb_join(const wb_drive *d, double t, double *lower, double *upper, int first) {
  double low[WB_N], high[WB_N];
  int i;
  wb_segment(&d->s, low, high);
  if (d->braking) {
    const int waits = t < d->order->switch_upper;
    low[WB_SPEED] = d->low;
    high[WB_SPEED] = d->high;
    low[WB_SPEED_INTEGRAL] = waits ? wb_min(low[WB_SPEED_INTEGRAL], 0.0) : 0.0;
    high[WB_SPEED_INTEGRAL] = waits ? wb_max(high[WB_SPEED_INTEGRAL], 0.0) : 0.0;
  }
  for (i = 0; i < WB_N; ++i) {
    lower[i] = first ? low[i] : wb_min(lower[i], low[i]);
    upper[i] = first ? high[i] : wb_max(upper[i], high[i]);
  }
}

/* The time of row k: the end of the last one may come earlier than a whole step. */
static double wb_row_from(const wb_order *order, int k) { return k * order->step; }

static double wb_row_to(const wb_order *order, int k) {
  return k + 1 < order->rows ? (k + 1) * order->step : order->until;
}

/* How long row k is; a whole step is the very number, not a difference of two instants. */
static double wb_row_length(const wb_order *order, int k) {
  const double whole = order->rows * order->step;
  if (k + 1 < order->rows || (order->until >= whole && order->until <= whole)) return order->step;
  return order->until - k * order->step;
}

/* Row k in `substeps` steps; *spent never exceeds `most`. */
static int wb_drive_row(wb_drive *d, int k, int substeps, long *spent, long most, double *lower,
                        double *upper) {
  const double t = wb_row_from(d->order, k), h = wb_row_length(d->order, k) / substeps;
  int j;
  for (j = 0; j < substeps; ++j) {
    const long before = d->s.spent;
    double from, to;
    int status;
    if (*spent + WB_KINK_TRIALS > most) return WB_UNFINISHED;
    d->free = d->free || (d->braking && wb_lets_go(d, t + j * h));
    if (!wb_disturb_drive(d, t + j * h, h, &from, &to)) return WB_LEFT_REGION;
    if (!d->prepared && wb_prepare(&d->s) != WB_COMPLETE) return WB_NO_ENCLOSURE;
    d->prepared = 1;
    status = wb_step(&d->s, h);
    *spent += d->s.spent - before;
    if (status != WB_COMPLETE) return status;
    if (!(d->s.box_lower[WB_STATION] >= from && d->s.box_upper[WB_STATION] <= to)) return WB_NO_ENCLOSURE;
    wb_join(d, t + j * h, lower, upper, j == 0);
    status = wb_commit(&d->s);
    if (status != WB_COMPLETE) return status;
  }
  return WB_COMPLETE;
}

/* The row of a car that stands: nothing moves any more, but for a steering that is disturbed (as far as it
 * comes within all rows). */
static void wb_stand(const wb_drive *d, double *lower, double *upper) {
  memcpy(lower, d->s.now->lower, WB_N * sizeof *lower);
  memcpy(upper, d->s.now->upper, WB_N * sizeof *upper);
  lower[WB_SPEED] = upper[WB_SPEED] = 0.0;
  lower[WB_SPEED_INTEGRAL] = upper[WB_SPEED_INTEGRAL] = 0.0;
  lower[WB_STEERING] += wb_min(d->turn[0], 0.0) * (WB_ROWS * d->order->step * WB_UP);
  upper[WB_STEERING] += wb_max(d->turn[1], 0.0) * (WB_ROWS * d->order->step * WB_UP);
}

/* Range of a disturbance that a loop may lack. */
static void wb_felt(const double *q, int disturbance, double *range) {
  range[0] = disturbance < 0 ? 0.0 : q[WB_Q_DISTURBANCE_LOWER + disturbance];
  range[1] = disturbance < 0 ? 0.0 : q[WB_Q_DISTURBANCE_UPPER + disturbance];
}

static void wb_depart(wb_drive *d, const double *center, const double *radius, double *work) {
  double p[WB_NP];
  memcpy(p, d->q + WB_Q_PARAMETERS, WB_OWN_PARAMETERS * sizeof *p);
  p[WB_TRACKING] = 1.0;
  p[WB_BRAKING] = 0.0;
  p[WB_INTEGRATING] = 1.0;
  d->prepared = d->braking = d->free = 0;
  d->brake_from = d->brake_lower = d->brake_upper = d->low = d->high = 0.0;
  wb_felt(d->q, WB_PUSH, d->push);
  wb_felt(d->q, WB_MISREAD, d->misread);
  wb_felt(d->q, WB_TURN, d->turn);
  wb_start(&d->s, center, radius, p, work);
}
