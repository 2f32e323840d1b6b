/* The learned tube: from the middle of each region of the set one simulation, bloated by a table of beta.
 *
 * Generated in front of this text: WB_N, WB_NP, WB_NW, WB_STEPS, WB_STEP_MAX, WB_SCRATCH, WB_REGIONS,
 * WB_BETA_ROWS, WB_BETA_STEP, WB_BETA_SUMS and tables wb_beta (rows x N x N; below 0 where nothing is known),
 * wb_parts, wb_learned_lower, wb_learned_upper, and wb_simulate, one step of classical Runge-Kutta.
 * Nothing here is proved: what it rests on are sampled runs. docs/learned-tube.md.
 */

enum wb_learned_status { WB_L_COMPLETE = 0, WB_L_LEFT = 1, WB_L_FAILED = 2, WB_L_BAD = 4 };

static int wb_l_finite(const double *v, int count) {
  int i;
  for (i = 0; i < count; ++i) {
    if (!(fabs(v[i]) < HUGE_VAL)) return 0;
  }
  return 1;
}

/* Row k of the table for these radii; infinite along a radius that nothing is known of. */
static double wb_beta_row(int k, int i, const double *radius) {
  const double *row = wb_beta + ((size_t)k * WB_N + (size_t)i) * WB_N;
  double found = 0.0;
  int j;
  for (j = 0; j < WB_N; ++j) {
    const double part = row[j] * radius[j];
    if (!(radius[j] > 0.0)) continue;
    if (row[j] < 0.0) return HUGE_VAL;
    if (WB_BETA_SUMS) found += part;
    else if (part > found) found = part;
  }
  return found;
}

/* Half widths at t, between two instants of the table the larger ones; 0 where the table has ended. */
static int wb_half_widths(double t, const double *radius, double *half) {
  const double place = t / WB_BETA_STEP, nearest = floor(place + 0.5);
  const int on = fabs(place - nearest) < 1e-6;
  const double from = on ? nearest : floor(place), to = on ? nearest : from + 1.0;
  int i;
  if (!(from >= 0.0 && to <= WB_BETA_ROWS - 1)) return 0;
  for (i = 0; i < WB_N; ++i) {
    const double first = wb_beta_row((int)from, i, radius), last = wb_beta_row((int)to, i, radius);
    half[i] = first > last ? first : last;
  }
  return wb_l_finite(half, WB_N);
}

/* Whether the set is where the bound was learned, and wide only where it knows widths. */
static int wb_learned_on(const double *center, const double *radius) {
  double half[WB_N];
  int i;
  for (i = 0; i < WB_N; ++i) {
    /* The rounding of a middle and a radius must not push a set out of where it lies. */
    const double slack = 1e-12 * (fabs(center[i]) + radius[i]);
    if (!(center[i] - radius[i] >= wb_learned_lower[i] - slack)) return 0;
    if (!(center[i] + radius[i] <= wb_learned_upper[i] + slack)) return 0;
  }
  return wb_half_widths(0.0, radius, half);
}

/* Region number `index` of a set, the last axis running fastest. */
static void wb_region(const double *center, const double *radius, int index, double *c, double *r) {
  int i;
  for (i = WB_N - 1; i >= 0; --i) {
    const int parts = wb_parts[i], at = index % parts;
    index /= parts;
    r[i] = parts > 1 ? radius[i] / parts : radius[i];
    c[i] = parts > 1 ? center[i] + radius[i] * ((2 * at + 1) / (double)parts - 1.0) : center[i];
  }
}

/* Moves x on by h; 0 where it leaves the finite numbers. */
static int wb_simulated(double *x, const double *p, const double *w, double h) {
  double next[WB_N], scratch[WB_SCRATCH];
  const double *arg[] = {x, p, w, &h};
  double *res[] = {next};
  if (wb_simulate(arg, res, 0, scratch, 0) || !wb_l_finite(next, WB_N)) return 0;
  memcpy(x, next, sizeof next);
  return 1;
}

/* The box about x at t; 0 where there is none. */
static int wb_bloated(const double *x, double t, const double *radius, double *low, double *high) {
  double half[WB_N];
  int i;
  if (!wb_half_widths(t, radius, half)) return 0;
  for (i = 0; i < WB_N; ++i) {
    low[i] = x[i] - half[i];
    high[i] = x[i] + half[i];
  }
  return 1;
}

static void wb_widen(double *lower, double *upper, const double *low, const double *high, int first) {
  int i;
  for (i = 0; i < WB_N; ++i) {
    if (first || low[i] < lower[i]) lower[i] = low[i];
    if (first || high[i] > upper[i]) upper[i] = high[i];
  }
}

/* query and result as of `wb_tube`: center, radius, parameters, w lower, w upper, horizon_s, step_s;
 * status, steps_done, lower, upper, lower_at, upper_at. Disturbances rest in the middle of their ranges. */
int wb_learned_tube(const double *query, double *result, double *work) {
  const double *p = query + 2 * WB_N, *w = p + WB_NP, horizon = w[2 * WB_NW], step = w[2 * WB_NW + 1];
  double *lower = result + 2, *upper = lower + WB_STEPS * WB_N;
  double *lower_at = upper + WB_STEPS * WB_N, *upper_at = lower_at + (WB_STEPS + 1) * WB_N;
  double middle[WB_NW + 1];
  int count, done, region, i, k;
  (void)work;
  result[0] = WB_L_BAD;
  result[1] = 0.0;
  if (!wb_l_finite(query, 2 * WB_N + WB_NP + 2 * WB_NW + 2)) return 0;
  if (!(step > 0.0 && step <= WB_STEP_MAX && horizon > 0.0 && horizon / step - 1e-9 <= WB_STEPS)) return 0;
  for (i = 0; i < WB_N; ++i) {
    if (!(query[WB_N + i] >= 0.0)) return 0;
  }
  result[0] = WB_L_LEFT;
  if (!wb_learned_on(query, query + WB_N)) return 0;
  result[0] = WB_L_COMPLETE;
  for (i = 0; i < WB_NW; ++i) middle[i] = (w[i] + w[WB_NW + i]) / 2;
  done = count = (int)ceil(horizon / step - 1e-9);
  for (region = 0; region < WB_REGIONS; ++region) {
    double x[WB_N], radius[WB_N], low[WB_N], high[WB_N];
    wb_region(query, query + WB_N, region, x, radius);
    for (k = 0; k <= done; ++k) {
      const double t = k < count ? k * step : horizon, h = k < count ? step : horizon - (count - 1) * step;
      const int first = region == 0;
      if (k && !wb_simulated(x, p, middle, h)) break;
      if (k) wb_widen(lower + (k - 1) * WB_N, upper + (k - 1) * WB_N, low, high, first);
      if (!wb_bloated(x, t, radius, low, high)) break;
      if (k) wb_widen(lower + (k - 1) * WB_N, upper + (k - 1) * WB_N, low, high, 0);
      wb_widen(lower_at + k * WB_N, upper_at + k * WB_N, low, high, first);
    }
    if (k > done) continue;
    result[0] = WB_L_FAILED;
    done = k ? k - 1 : 0;
  }
  result[1] = done;
  return 0;
}
