/* The tube loop around the generated step functions: C99, no heap, static capacity.
 *
 * Sizes and tables (WB_...) and the functions wb_enclose, wb_driver_row_i, wb_relaxation_i,
 * wb_bounds, wb_advance and wb_remainder are generated in front of this text. The set at an instant is
 * x + G [-1, 1]^m + [-pending, pending]; rows of G are contiguous. Every comparison that accepts is
 * written so that a NaN refuses.
 */

#define WB_FLUSH_SHARE 4e-3 /* measured on B1: below it columns cost more than they tighten */

enum wb_status { WB_COMPLETE = 0, WB_LEFT_REGION = 1, WB_NO_ENCLOSURE = 2, WB_BAD_INPUT = 4 };

typedef struct {
  double x[WB_N];
  double r[WB_N];
  double pending[WB_N];
  double p[WB_NP_ALL + 1];
  double w_mid[WB_NW + 1], w_rad[WB_NW + 1];
  double slope[WB_NK + 1], offset[WB_NK + 1], gap[WB_NK + 1];
  double box_lower[WB_N], box_upper[WB_N], f_lower[WB_N], f_upper[WB_N];
  double true_lower[WB_N], true_upper[WB_N];
  double sizes[WB_SIZES];
  double chord[WB_N];
  int columns;
  double *g, *g_next;
} wb_set;

static int wb_call(wb_function function, const double **arg, double **res) {
  double scratch[WB_SCRATCH];
  return function(arg, res, 0, scratch, 0);
}

static int wb_finite(const double *v, int count) {
  double sum = 0.0;
  int i;
  for (i = 0; i < count; ++i) sum += v[i] - v[i];
  return sum == 0.0;
}

static double *wb_row(double *g, int i) { return g + (size_t)i * WB_COLUMNS; }

/* Radius about the rounded middle of [low, high] that covers both ends in spite of rounding. */
static double wb_radius(double low, double high) {
  const double size = fabs(low) > fabs(high) ? fabs(low) : fabs(high);
  return high > low ? (high - low) / 2 * (1 + 1e-15) + 1e-15 * size + 1e-300 : 0.0;
}

/* Four running sums: the order is fixed, so the bits are too, and the additions overlap. */
static double wb_sum_abs(const double *v, int count) {
  double a = 0.0, b = 0.0, c = 0.0, d = 0.0;
  int j = 0;
  for (; j + 4 <= count; j += 4) {
    a += fabs(v[j]);
    b += fabs(v[j + 1]);
    c += fabs(v[j + 2]);
    d += fabs(v[j + 3]);
  }
  for (; j < count; ++j) a += fabs(v[j]);
  return (a + b) + (c + d);
}

static void wb_start(wb_set *s, const double *center, const double *radius, const double *p,
                     double *work) {
  int i;
  memset(s, 0, sizeof *s);
  s->g = work;
  s->g_next = work + (size_t)WB_N * WB_COLUMNS;
  memcpy(s->p, p, WB_NP * sizeof *p);
  memcpy(s->p + WB_NP, wb_constants, WB_NC * sizeof *p);
  for (i = 0; i < WB_N; ++i) {
    s->x[i] = center[i];
    s->r[i] = radius[i];
    s->pending[i] = radius[i];
  }
}

/* Turns the pending box into columns of its own, so that later steps keep its signs. A state that feeds
 * no other keeps its share in the box, and so does one whose share is too small to be worth it. */
static void wb_flush(wb_set *s) {
  int i, row;
  for (i = 0; i < WB_N; ++i) {
    if (!wb_feeds[i] || !(s->pending[i] > WB_FLUSH_SHARE * s->r[i])) continue;
    for (row = 0; row < WB_N; ++row) wb_row(s->g, row)[s->columns] = 0.0;
    wb_row(s->g, i)[s->columns] = s->pending[i];
    s->pending[i] = 0.0;
    ++s->columns;
  }
}

#if WB_NK > 0
static int wb_relax_kinks(wb_set *s, double h) {
  int i;
  for (i = 0; i < WB_NK; ++i) s->slope[i] = s->offset[i] = s->gap[i] = 0.0;
  for (i = 0; i < WB_NK; ++i) {
    double driver, gradient[WB_N], spread = 0.0, slope, offset, gap, ok = 0.0;
    int j, c;
    const double *row_arg[] = {s->x, s->p, s->w_mid, s->slope, s->offset};
    double *row_res[] = {&driver, gradient};
    if (wb_call(wb_driver_rows[i], row_arg, row_res)) return WB_NO_ENCLOSURE;
    for (c = 0; c < s->columns; ++c) {
      double value = 0.0;
      for (j = 0; j < WB_N; ++j) value += gradient[j] * wb_row(s->g, j)[c];
      spread += fabs(value);
    }
    for (j = 0; j < WB_N; ++j) spread += fabs(gradient[j]) * s->pending[j];
    {
      const double *arg[] = {s->x,      s->r,         s->p,         s->w_mid,   s->w_rad,
                             s->slope,  s->offset,    s->gap,       &h,         s->box_lower,
                             s->box_upper, s->true_lower, s->true_upper, &driver, &spread};
      double *res[] = {&slope, &offset, &gap, &ok};
      if (wb_call(wb_relaxations[i], arg, res) || !(ok == 1.0)) return WB_NO_ENCLOSURE;
    }
    s->slope[i] = slope;
    s->offset[i] = offset;
    s->gap[i] = gap;
  }
  return WB_COMPLETE;
}
#endif

/* Picard trials from the guessed range of the field, which arg ends with: the previous step's. */
static int wb_picard(wb_set *s, wb_function function, const double **arg, double *guess_lower,
                     double *guess_upper) {
  double ok, f_lower[WB_N], f_upper[WB_N];
  double *res[] = {s->box_lower, s->box_upper, f_lower, f_upper, &ok, s->sizes};
  int trial;
  for (trial = 0; trial < WB_PICARD_TRIALS; ++trial) {
    ok = 0.0;
    if (wb_call(function, arg, res)) return WB_NO_ENCLOSURE;
    if (!wb_finite(f_lower, WB_N) || !wb_finite(f_upper, WB_N)) return WB_NO_ENCLOSURE;
    memcpy(guess_lower, f_lower, sizeof f_lower);
    memcpy(guess_upper, f_upper, sizeof f_upper);
    if (ok == 1.0) return WB_COMPLETE;
  }
  return WB_NO_ENCLOSURE;
}

static int wb_bound_field(wb_set *s, double h) {
  const double *arg[] = {s->x,      s->r,   s->p, s->w_mid,   s->w_rad,  s->slope,
                         s->offset, s->gap, &h,   s->f_lower, s->f_upper};
#if WB_NK > 0
  const double *plain[] = {s->x, s->r, s->p, s->w_mid, s->w_rad, &h, s->true_lower, s->true_upper};
  if (wb_picard(s, wb_enclose, plain, s->true_lower, s->true_upper)) return WB_NO_ENCLOSURE;
  if (wb_relax_kinks(s, h)) return WB_NO_ENCLOSURE;
#endif
  return wb_picard(s, wb_bounds, arg, s->f_lower, s->f_upper);
}

static int wb_in_region(const wb_set *s) {
  int i;
  for (i = 0; i < WB_N; ++i) {
    if (!(s->box_lower[i] >= wb_region_lower[i] && s->box_upper[i] <= wb_region_upper[i])) return 0;
  }
  return 1;
}

/* G becomes Phi G; r_end its row sums, the pending box included. */
static void wb_map(wb_set *s, const double *phi, double *r_end) {
  double pending[WB_N];
  double *swap;
  int i, k;
  wb_map_columns(phi, s->g, s->g_next, s->columns);
  swap = s->g;
  s->g = s->g_next;
  s->g_next = swap;
  for (i = 0; i < WB_N; ++i) pending[i] = 0.0;
  for (k = 0; k < WB_PHI_NNZ; ++k) {
    pending[wb_phi_row[k]] += fabs(phi[k]) * s->pending[wb_phi_col[k]];
  }
  for (i = 0; i < WB_N; ++i) {
    s->pending[i] = pending[i];
    r_end[i] = wb_sum_abs(wb_row(s->g, i), s->columns) + pending[i];
  }
}

static void wb_add_exogenous(wb_set *s, const double *by_v, double *r_end) {
  int j, k, row;
  for (j = 0; j < WB_NV; ++j) {
    const double radius = j < WB_NW ? s->w_rad[j] : s->gap[j - WB_NW];
    if (!(radius > 0.0)) continue;
    for (row = 0; row < WB_N; ++row) wb_row(s->g, row)[s->columns] = 0.0;
    for (k = 0; k < WB_BY_V_NNZ; ++k) {
      if (wb_by_v_col[k] != j) continue;
      wb_row(s->g, wb_by_v_row[k])[s->columns] = by_v[k] * radius;
      r_end[wb_by_v_row[k]] += fabs(by_v[k] * radius);
    }
    ++s->columns;
  }
}

static int wb_step(wb_set *s, double h, int k) {
  double x_end[WB_N], phi[WB_PHI_NNZ + 1], by_v[WB_BY_V_NNZ + 1], r_end[WB_N];
  double box[WB_N], radius[WB_N], cut_x[WB_N], cut_s[WB_N], ok = 0.0;
  int i;
  if (wb_bound_field(s, h)) return WB_NO_ENCLOSURE;
  if (!wb_in_region(s)) return WB_LEFT_REGION;
  {
    const double *arg[] = {s->x, s->p, s->w_mid, s->slope, s->offset, &h};
    double *res[] = {x_end, phi, by_v, cut_x};
    if (wb_call(wb_advance, arg, res)) return WB_NO_ENCLOSURE;
  }
  if (k % WB_MERGE == 0) wb_flush(s);
  wb_map(s, phi, r_end);
  {
    const double *arg[] = {s->r, r_end, s->w_rad, s->gap, &h, s->f_lower, s->f_upper, s->sizes};
    double *res[] = {box, s->chord, radius, cut_s, &ok};
    if (wb_call(wb_remainder, arg, res) || !(ok == 1.0)) return WB_NO_ENCLOSURE;
  }
  wb_add_exogenous(s, by_v, r_end);
  for (i = 0; i < WB_N; ++i) {
    const double added = box[i] + cut_x[i] + cut_s[i];
    s->pending[i] += added;
    s->r[i] = r_end[i] + added;
    s->x[i] = x_end[i];
  }
  return wb_finite(s->x, WB_N) && wb_finite(s->r, WB_N) ? WB_COMPLETE : WB_NO_ENCLOSURE;
}

/* Segment enclosure: hull of the two instants, widened by the chord deviation, cut to the box. */
static void wb_segment(const wb_set *s, const double *lower_before, const double *upper_before,
                       double *lower, double *upper) {
  int i;
  for (i = 0; i < WB_N; ++i) {
    double low = s->x[i] - s->r[i], high = s->x[i] + s->r[i];
    low = (lower_before[i] < low ? lower_before[i] : low) - s->chord[i];
    high = (upper_before[i] > high ? upper_before[i] : high) + s->chord[i];
    lower[i] = low > s->box_lower[i] ? low : s->box_lower[i];
    upper[i] = high < s->box_upper[i] ? high : s->box_upper[i];
  }
}

long long wb_work_size(void) { return 2LL * WB_N * WB_COLUMNS; }

/* query: center (n), radius (n), parameters (n_p), w lower (n_w), w upper (n_w), horizon_s, step_s;
 * result: status, steps_done, then lower, upper (STEPS x n), lower_at, upper_at (STEPS+1 x n). */
int wb_tube(const double *query, double *result, double *work) {
  const double *w = query + 2 * WB_N + WB_NP;
  const double horizon = w[2 * WB_NW], step = w[2 * WB_NW + 1];
  double *lower = result + 2, *upper = lower + WB_STEPS * WB_N;
  double *lower_at = upper + WB_STEPS * WB_N, *upper_at = lower_at + (WB_STEPS + 1) * WB_N;
  wb_set s;
  const double grid = horizon / step - 1e-9; /* horizon_s is rarely an exact multiple */
  int i, k, count, status = WB_COMPLETE;
  result[0] = WB_BAD_INPUT;
  result[1] = 0.0;
  if (!wb_finite(query, 2 * WB_N + WB_NP + 2 * WB_NW + 2)) return 0;
  if (!(step > 0.0 && step <= WB_STEP_MAX && horizon > 0.0 && grid <= WB_STEPS)) return 0;
  count = (int)grid;
  if (count < grid || count < 1) ++count;
  wb_start(&s, query, query + WB_N, query + 2 * WB_N, work);
  for (i = 0; i < WB_NW; ++i) {
    s.w_mid[i] = (w[i] + w[WB_NW + i]) / 2;
    s.w_rad[i] = wb_radius(w[i], w[WB_NW + i]);
  }
  for (i = 0; i < WB_N; ++i) {
    lower_at[i] = s.x[i] - s.r[i];
    upper_at[i] = s.x[i] + s.r[i];
  }
  for (k = 0; k < count; ++k) {
    const double h = k + 1 < count ? step : horizon - k * step;
    status = wb_step(&s, h, k);
    if (status != WB_COMPLETE) break;
    for (i = 0; i < WB_N; ++i) {
      lower_at[(k + 1) * WB_N + i] = s.x[i] - s.r[i];
      upper_at[(k + 1) * WB_N + i] = s.x[i] + s.r[i];
    }
    wb_segment(&s, lower_at + k * WB_N, upper_at + k * WB_N, lower + k * WB_N, upper + k * WB_N);
  }
  result[0] = status;
  result[1] = k;
  return 0;
}
