/* The online tube: C99, no heap, static capacity, caller-owned memory.
 *
 * Generated in front of this text: sizes and tables (WB_...), wb_map_columns, wb_map_pairs, wb_sum_dots
 * and the functions wb_advance, wb_second, wb_source, wb_majorant and, with inputs or kinks, wb_inputs,
 * wb_drivers, wb_limits.
 *
 * At an instant the set is x + S d + 1/2 Q[d, d] + G [-1, 1]^m + [-pending, pending], d in [-1, 1]^M.
 * Columns 0 .. M-1 of g are S, the others G; q holds Q by pairs, halved on the diagonal. Within a step
 * the nominal is the exact solution of the relaxed equation from x; what the computed end differs by
 * enters `pending`. Every comparison that accepts is false for NaN. Theory: docs/online-kernel.md.
 *
 * Vectors over the states have WB_L entries, the number of states rounded up to whole registers; the
 * spare entries stay 0 or harmless.
 */

enum wb_status { WB_COMPLETE = 0, WB_LEFT_REGION = 1, WB_NO_ENCLOSURE = 2, WB_BAD_INPUT = 4 };

/* Covers the rounding of any sum and product here: relative 2^-53 for each of fewer than 2^12 operations
 * on non-negative numbers. */
#define WB_UP (1.0 + 0x1p-40)
#define WB_COLUMN_ROUNDING 0x1p-46
#define WB_TRIALS 8
#define WB_KINK_TRIALS 6
#define WB_ROOM 0.05   /* bounds are made for premises this much larger, to serve several steps */
#define WB_AHEAD 3.0   /* and for a set that has moved on by so many steps */
#define WB_PATIENCE 0.1 /* what guesses are widened by, more with every trial */
#define WB_KINK_ROOM 0.004
#define WB_FLUSH_STEP 0.05 /* up to which the share of WB_FLUSH_SHARE holds, in s */
#define WB_LEAST 0x1p-900 /* what bounds are made for even where nothing is needed */

/* What the bounds of a step are made for; every entry may only be larger than what the step needs. */
enum wb_premise {
  WB_BELOW = 0,             /* minus the lower end of the box */
  WB_ABOVE = WB_L,          /* its upper end */
  WB_LINEAR = 2 * WB_L,     /* radius of the set's linear part */
  WB_REST = 3 * WB_L,       /* of the rest; w is their sum */
  WB_GUESS = 4 * WB_L,      /* what the step adds */
  WB_SMALL = 5 * WB_L,      /* its small terms */
  WB_EXTRA = 6 * WB_L,      /* rate at which w changes beyond the linear flow */
  WB_JUMP = 7 * WB_L,       /* how far the computed end of the step can be off */
  WB_V = 8 * WB_L,          /* radii of the exogenous inputs */
  WB_SLOPE = WB_V + WB_NV,  /* magnitudes of the lines */
  WB_OFFSET = WB_SLOPE + WB_NK,
  WB_PREMISE = (WB_OFFSET + WB_NK + 3) / 4 * 4
};

typedef struct {
  double cubic[WB_L], quartic[WB_L], quintic[WB_L];
  double curvature[WB_L], taylor_x[WB_L], taylor_w[WB_L], bend_rest[WB_L], second[WB_L], third[WB_L];
  double second_bend[WB_L], bend_linear[WB_L], response[WB_L], source_bend[WB_L], source_turn[WB_L], source_slip[WB_L], input_slip[WB_L];
  double input_rate[WB_L];
  double input_response[WB_L], jump_rate[WB_L], grown[WB_L], grown_bend[WB_L], grown_small[WB_L];
  double driver_curvature[WB_NK + 1], driver_third[WB_NK + 1], driver_input[WB_NK + 1];
  double driver_jump[WB_NK + 1];
} wb_bounds;

typedef struct {
  double sizes[WB_HESSIAN + 1];                               /* |D2g|, rounding included */
  double source[WB_N * WB_PAIRS + 1], bent[WB_N * WB_PAIRS + 1];
  double source_round[WB_N], bent_round[WB_N]; /* of source and bent, summed over the pairs */
} wb_derivatives;

typedef struct {
  double x[WB_L], pending[WB_L];
  double linear[WB_L], spread[WB_L], rest[WB_L]; /* of S, of G; radius = linear + rest */
  double q_low[WB_L], q_high[WB_L];              /* range of 1/2 Q[d, d]: [-q_low, q_high] */
  double lower[WB_L], upper[WB_L];               /* the set */
  int columns;
} wb_instant;

typedef struct {
  wb_instant instants[2], *now, *next;
  wb_derivatives derivatives[2], *at_start, *at_end;
  double *g, *g_next, *q, *q_next;
  int source[WB_COLUMNS]; /* of a column: the state whose box it was, or WB_N + the input */
  double p[WB_NP_ALL + 1], w_mid[WB_NW + 1], w_rad[WB_NW + 1];
  double slope[WB_NK + 1], offset[WB_NK + 1], gap[WB_NK + 1];
  double range_low[WB_NK + 1], range_high[WB_NK + 1]; /* drivers, over the last step */
  double guess_low[WB_NK + 1], guess_high[WB_NK + 1];
  double floor[WB_NK + 1], ceiling[WB_NK + 1];
  double at_low[2][WB_NK + 1], at_high[2][WB_NK + 1];  /* at its two ends */
  int ranged;  /* at_low[0], at_high[0] belong to `now` and the current lines */
  int moved;   /* range_low, range_high are of a step that was done */
  int derived; /* at_start belongs to now->x, the current parameters and lines */
  int bounded; /* bounds follow from premise */
  long spent;  /* steps attempted */
  double premise[WB_PREMISE];
  wb_bounds bounds;
  double bend[WB_L], slack[WB_L], guess[WB_L], jump[WB_L], small[WB_L], margin[WB_L], second[WB_L];
  double box_lower[WB_L], box_upper[WB_L], chord[WB_L]; /* everything during the last step */
} wb_set;

typedef struct {
  double phi[WB_PHI_NNZ + 1], inputs[2][WB_INPUT_NNZ + 1];
  double matrix[WB_PHI_NNZ + 1]; /* errors of phi, where they are known one by one */
  double sizes[WB_N * WB_L];     /* |phi|, dense */
#if WB_ENCLOSED
  double errors[WB_N * WB_L];    /* matrix, dense */
#endif
  double round[WB_L], from_start[WB_L], from_end[WB_L], added[WB_L], v[WB_NV + 1];
} wb_moves;

static int wb_finite(const double *v, int count) {
  double sum = 0.0;
  int i;
  for (i = 0; i < count; ++i) sum += v[i] - v[i];
  return sum == 0.0;
}

static double wb_max(double a, double b) { return a > b ? a : b; }

static double wb_min(double a, double b) { return a < b ? a : b; }

static double *wb_row(double *g, int i) { return g + (size_t)i * WB_COLUMNS; }

/* Radius about the rounded middle of [low, high] that covers both ends in spite of rounding. */
static double wb_radius(double low, double high) {
  const double size = wb_max(fabs(low), fabs(high));
  return high > low ? (high - low) / 2 * (1 + 1e-15) + 1e-15 * size + 1e-300 : 0.0;
}

/* Derivatives at x and what they make of the set's columns, with what rounding can change. */
static int wb_derive(wb_set *s, const double *x, double *g, wb_derivatives *d) {
  double scratch[WB_SCRATCH], hessian[WB_HESSIAN + 1], columns[WB_N * WB_M + 1];
  const double *arg[] = {x, s->p, s->w_mid, s->slope, s->offset, columns};
#if WB_ENCLOSED
  double round[WB_HESSIAN + 1], ok = 0.0;
#if WB_M > 0
  double *res[] = {hessian, d->source, d->bent, round, d->source_round, d->bent_round, &ok};
#else
  double *res[] = {hessian, round, &ok};
#endif
#else
  const double *round = wb_round_hessian;
  const double ok = 1.0;
  double *res[] = {hessian, d->source, d->bent};
#endif
  int i, j;
  for (i = 0; i < WB_N; ++i) {
    for (j = 0; j < WB_M; ++j) columns[i * WB_M + j] = wb_row(g, i)[j];
  }
  if (wb_second(arg, res, 0, scratch, 0) || !(ok == 1.0)) return WB_NO_ENCLOSURE;
  for (i = 0; i < WB_HESSIAN; ++i) d->sizes[i] = (fabs(hessian[i]) + round[i]) * WB_UP;
#if WB_PAIRS > 0 && !WB_ENCLOSED
  memcpy(d->source_round, wb_round_source, sizeof d->source_round);
  memcpy(d->bent_round, wb_round_bent, sizeof d->bent_round);
#endif
  return WB_COMPLETE;
}

/* Radius and bounds of a set from the sizes of its parts. */
WB_WIDE static void wb_enclose(wb_instant *restrict t) {
  int i;
  for (i = 0; i < WB_L; ++i) {
    const double radius = t->spread[i] + t->pending[i];
    const double rounding = 0x1p-51 * fabs(t->x[i]);
    t->rest[i] = (wb_max(t->q_low[i], t->q_high[i]) + radius) * WB_UP;
    t->lower[i] = t->x[i] - ((t->linear[i] + t->q_low[i] + radius) * WB_UP + rounding);
    t->upper[i] = t->x[i] + ((t->linear[i] + t->q_high[i] + radius) * WB_UP + rounding);
  }
}

static void wb_start(wb_set *s, const double *center, const double *radius, const double *p,
                     double *work) {
  int i, j;
  memset(s, 0, sizeof *s);
  s->now = s->instants;
  s->next = s->instants + 1;
  s->at_start = s->derivatives;
  s->at_end = s->derivatives + 1;
  s->g = work;
  s->g_next = work + (size_t)WB_N * WB_COLUMNS;
  s->q = s->g_next + (size_t)WB_N * WB_COLUMNS;
  s->q_next = s->q + WB_N * WB_PAIRS;
  memcpy(s->p, p, WB_NP * sizeof *p);
  memcpy(s->p + WB_NP, wb_constants, WB_NC * sizeof *p);
  for (i = 0; i < WB_N * WB_PAIRS; ++i) s->q[i] = 0.0;
  for (i = 0; i < WB_L; ++i) s->jump[i] = s->small[i] = s->bend[i] = s->second[i] = 1e-9;
  for (i = 0; i < WB_L; ++i) s->guess[i] = s->slack[i] = s->margin[i] = 1e-9;
  for (i = 0; i < WB_N; ++i) {
    s->now->x[i] = center[i];
    s->now->pending[i] = radius[i];
    for (j = 0; j < WB_MS; ++j) wb_row(s->g, i)[j] = 0.0;
  }
  for (j = 0; j < WB_M; ++j) {
    wb_row(s->g, wb_axis[j])[j] = radius[wb_axis[j]];
    s->now->linear[wb_axis[j]] += radius[wb_axis[j]] * WB_UP;
    s->now->pending[wb_axis[j]] = 0.0;
  }
  s->now->columns = WB_MS;
  wb_enclose(s->now);
}

#if WB_NK > 0
static double wb_clip(double d, double low, double high) {
  return wb_min(wb_max(d, low), high);
}

/* Best line slope d + offset of clip(d, floor, ceiling) for low <= d <= high, and its largest error. */
static void wb_line(double low, double high, double floor_, double ceiling, double *line) {
  const double knee_low = wb_min(wb_max(low, floor_), high);
  const double knee_high = wb_max(wb_min(high, ceiling), low);
  int k, j;
  line[0] = line[1] = line[2] = 0.0;
  if (low >= floor_ && high <= ceiling) {
    line[0] = 1.0;
    return;
  }
  if (low >= ceiling || high <= floor_) {
    line[1] = low >= ceiling ? ceiling : floor_;
    return;
  }
  line[2] = HUGE_VAL;
  for (k = 0; k < 3; ++k) {
    const double left = k == 0 ? low : k == 1 ? knee_low : high, right = k ? high : knee_high;
    const double points[4] = {low, knee_low, knee_high, high};
    double slope = 0.0, top = -HUGE_VAL, bottom = HUGE_VAL, gap;
    if (right > left) {
      slope = (wb_clip(right, floor_, ceiling) - wb_clip(left, floor_, ceiling)) / (right - left);
    }
    slope = wb_min(wb_max(slope, 0.0), 1.0);
    for (j = 0; j < 4; ++j) {
      const double deviation = wb_clip(points[j], floor_, ceiling) - slope * points[j];
      top = wb_max(top, deviation);
      bottom = wb_min(bottom, deviation);
    }
    gap = (top - bottom) / 2 * WB_UP + 1e-14 * (fabs(low) + fabs(high) + fabs(top) + fabs(bottom));
    if (gap < line[2]) {
      line[0] = slope;
      line[1] = (top + bottom) / 2;
      line[2] = gap;
    }
  }
}

/* Whether the line is that close to the clip for all of low <= d <= high: often further than it was made
 * for, since one without an error holds to the next kink. */
static int wb_line_holds(const wb_set *s, int i, double low, double high) {
  const double floor_ = s->floor[i], ceiling = s->ceiling[i], slope = s->slope[i], offset = s->offset[i];
  const double points[4] = {low, wb_min(wb_max(low, floor_), high), wb_max(wb_min(high, ceiling), low), high};
  double most = 0.0;
  int j;
  if (!(low <= high)) return 0;
  if (low > s->guess_low[i] && high < s->guess_high[i]) return 1;
  if (!(s->gap[i] > 0.0)) {
    if (slope > 0.0) return low >= floor_ && high <= ceiling;
    return offset >= ceiling ? low >= ceiling : high <= floor_;
  }
  for (j = 0; j < 4; ++j) {
    const double value = wb_clip(points[j], floor_, ceiling) - slope * points[j];
    most = wb_max(most, fabs(value - offset) * WB_UP + 1e-14 * (fabs(points[j]) + fabs(value) + fabs(offset)));
  }
  return most <= s->gap[i];
}

/* Range of every driver at one instant, but for exogenous inputs and third order. */
static int wb_driver_ranges(const wb_set *s, const wb_instant *t, double *g, const double *q,
                            double *lower, double *upper) {
  double scratch[WB_SCRATCH], middle[WB_NK], gradient[WB_NK * WB_N], second[WB_NK];
  double pairs[WB_NK * WB_PAIRS + 1], columns[WB_N * WB_M + 1], sums[WB_NK];
  const double *arg[] = {t->x, s->p, s->w_mid, s->slope, s->offset, t->linear, t->rest, columns};
#if WB_ENCLOSED
  double round[WB_NK], ok = 0.0;
#if WB_M > 0
  double *res[] = {middle, gradient, second, pairs, round, &ok};
#else
  double *res[] = {middle, gradient, second, round, &ok};
  (void)pairs;
#endif
#else
  const double *round = wb_round_driver;
  const double ok = 1.0;
  double *res[] = {middle, gradient, second, pairs};
#endif
  int i, j;
  for (i = 0; i < WB_N; ++i) {
    for (j = 0; j < WB_M; ++j) columns[i * WB_M + j] = wb_row(g, i)[j];
  }
  if (wb_drivers(arg, res, 0, scratch, 0) || !(ok == 1.0)) return WB_NO_ENCLOSURE;
  wb_sum_dots(gradient, g, t->columns, sums);
  for (i = 0; i < WB_NK; ++i) {
    const double *row = gradient + i * WB_N;
    double low = sums[i] + second[i], high;
    for (j = 0; j < WB_N; ++j) {
      low += fabs(row[j]) * (t->pending[j] + WB_COLUMN_ROUNDING * (t->linear[j] + t->rest[j]));
    }
    high = low;
#if WB_PAIRS > 0
    for (j = 0; j < WB_PAIRS; ++j) {
      double value = pairs[i * WB_PAIRS + j], size;
      int k;
      for (k = 0; k < WB_N; ++k) value += row[k] * q[k * WB_PAIRS + j];
      size = fabs(value);
      low += !wb_square[j] || value < 0.0 ? size : 0.0;
      high += !wb_square[j] || value > 0.0 ? size : 0.0;
    }
#else
    (void)q;
#endif
    lower[i] = middle[i] - (low * WB_UP + round[i]);
    upper[i] = middle[i] + (high * WB_UP + round[i]);
  }
  return WB_COMPLETE;
}

/* Lines for the guessed ranges of the drivers. */
static int wb_lines(wb_set *s) {
  int i, ok = 1;
  for (i = 0; i < WB_NK; ++i) {
    double line[3];
    wb_line(s->guess_low[i], s->guess_high[i], s->floor[i], s->ceiling[i], line);
    if (line[0] < s->slope[i] || line[0] > s->slope[i]) s->ranged = s->derived = 0;
    if (line[1] < s->offset[i] || line[1] > s->offset[i]) s->ranged = s->derived = 0;
    s->slope[i] = line[0];
    s->offset[i] = line[1];
    s->gap[i] = line[2];
#if WB_ENCLOSED
    ok &= line[2] < HUGE_VAL;
#else
    ok &= line[2] <= wb_gap_limit[i] && fabs(line[1]) <= wb_offset_limit[i];
#endif
  }
  return ok ? WB_COMPLETE : WB_LEFT_REGION;
}
#endif

/* Largest quotient of two rows of non-negative numbers; 0 / 0 counts as nothing. */
static double wb_share(const double *a, const double *b, int count) {
  double share = 0.0;
  int i;
  for (i = 0; i < count; ++i) {
    const double quotient = a[i] > 0.0 ? a[i] / b[i] : 0.0;
    share = quotient <= share ? share : quotient;
  }
  return share;
}

static double wb_largest(const double *v) {
  double largest = v[0];
  int i;
  for (i = 1; i < WB_L; ++i) largest = wb_max(largest, v[i]);
  return largest;
}

/* By how much the step needs less than the bounds were made for: in all of linear, rest, extra and v;
 * in linear; in guess; in small. What was made room for is never 0. */
WB_WIDE static void wb_scales(const double *restrict need, const double *restrict have,
                              double *restrict less) {
  double all[WB_L], linear[WB_L], guess[WB_L], small[WB_L];
  int i;
  for (i = 0; i < WB_L; ++i) {
    const double rest = need[WB_REST + i] / have[WB_REST + i];
    const double extra = need[WB_EXTRA + i] / have[WB_EXTRA + i];
    linear[i] = WB_M > 0 ? need[WB_LINEAR + i] / have[WB_LINEAR + i] : 0.0;
    guess[i] = need[WB_GUESS + i] / have[WB_GUESS + i];
    small[i] = need[WB_SMALL + i] / have[WB_SMALL + i];
    all[i] = wb_max(wb_max(rest, extra), linear[i]);
  }
  less[0] = wb_largest(all);
  for (i = WB_V; i < WB_SLOPE; ++i) less[0] = wb_max(less[0], need[i] / have[i]);
  less[0] *= WB_UP;
  less[1] = wb_largest(linear) * WB_UP;
  less[2] = wb_largest(guess) * WB_UP;
  less[3] = wb_largest(small) * WB_UP;
}

/* How many entries of `need` are above what `have` covers. */
WB_WIDE static double wb_missing(const double *restrict need, const double *restrict have) {
  double lane[4] = {0.0, 0.0, 0.0, 0.0};
  int i, k;
  for (i = 0; i < WB_PREMISE; i += 4) {
    for (k = 0; k < 4; ++k) lane[k] += need[i + k] <= have[i + k] ? 0.0 : 1.0;
  }
  return (lane[0] + lane[1]) + (lane[2] + lane[3]);
}

/* Bounds for a premise that covers `need` with some room, so that later steps find them valid too. */
static int wb_bound(wb_set *restrict s, const double *restrict need) {
  double *restrict have = s->premise;
  wb_bounds *b = &s->bounds;
  double scratch[WB_SCRATCH], ok = 0.0;
  int i;
  if (s->bounded && wb_missing(need, have) == 0.0) return WB_COMPLETE;
  for (i = 0; i < WB_L; ++i) {
    const double room = WB_ROOM * (need[WB_ABOVE + i] + need[WB_BELOW + i]);
    const double ahead = WB_AHEAD * (s->next->x[i] - s->now->x[i]);
    const double grown = wb_max(s->next->linear[i] - s->now->linear[i], 0.0);
    const double more = wb_max(s->next->rest[i] - s->now->rest[i], 0.0);
    have[WB_BELOW + i] = wb_enters[i] > 0.0 ? need[WB_BELOW + i] + (room - wb_min(ahead, 0.0)) : 1e9;
    have[WB_ABOVE + i] = wb_enters[i] > 0.0 ? need[WB_ABOVE + i] + (room + wb_max(ahead, 0.0)) : 1e9;
    have[WB_LINEAR + i] = WB_M > 0 ? need[WB_LINEAR + i] * (1.0 + WB_ROOM) + WB_AHEAD * grown + WB_LEAST : 0.0;
    have[WB_REST + i] = need[WB_REST + i] * (1.0 + WB_ROOM) + WB_AHEAD * more;
    have[WB_GUESS + i] = 1.4 * need[WB_GUESS + i];
    have[WB_SMALL + i] = 2.0 * need[WB_SMALL + i];
    have[WB_EXTRA + i] = 1.4 * need[WB_EXTRA + i];
    have[WB_JUMP + i] = 1.4 * need[WB_JUMP + i];
  }
  for (i = WB_V; i < WB_SLOPE; ++i) have[i] = (1.0 + WB_ROOM) * need[i] + WB_LEAST;
  for (i = WB_SLOPE; i < WB_OFFSET; ++i) have[i] = need[i];
  for (i = WB_OFFSET; i < WB_OFFSET + WB_NK; ++i) have[i] = (1.0 + WB_ROOM) * need[i];
  {
    const double *arg[] = {have + WB_BELOW, have + WB_ABOVE, have + WB_LINEAR, have + WB_REST,
                           have + WB_V, have + WB_GUESS, have + WB_SMALL, have + WB_EXTRA,
                           have + WB_JUMP, s->p, s->w_mid, have + WB_SLOPE, have + WB_OFFSET};
    double *res[] = {b->curvature, b->cubic, b->quartic, b->quintic, b->taylor_x, b->taylor_w,
                     b->bend_linear, b->bend_rest, b->second, b->third, b->second_bend, b->response,
                     b->source_bend, b->source_turn, b->source_slip, b->input_slip,
                     b->input_rate, b->input_response, b->jump_rate, b->grown,
                     b->grown_bend, b->grown_small, b->driver_curvature, b->driver_third,
                     b->driver_input, b->driver_jump, &ok};
    s->bounded = !wb_majorant(arg, res, 0, scratch, 0) && ok == 1.0;
  }
  return s->bounded ? WB_COMPLETE : WB_NO_ENCLOSURE;
}

/* What the bounds of this step must be made for. */
WB_WIDE static void wb_need(const wb_set *restrict s, const wb_moves *restrict m, double h,
                            double *restrict need) {
  const wb_instant *restrict a = s->now, *restrict e = s->next;
  const double rate = 1.0 / h;
  int i;
  for (i = 0; i < WB_L; ++i) {
    const double rest = (wb_max(a->rest[i], e->rest[i]) + (WB_M > 0 ? 0.0 : s->bend[i]) + s->slack[i]) * WB_UP;
    const double straight = wb_max(a->linear[i], e->linear[i]) + s->bend[i] + s->jump[i];
    const double linear = WB_M > 0 ? straight * WB_UP : 0.0;
    const double size = wb_max(fabs(a->x[i]), fabs(e->x[i]));
    const double reach = (linear + rest + s->margin[i]) * WB_UP + 0x1p-50 * size;
    need[WB_BELOW + i] = reach - wb_min(a->x[i], e->x[i]);
    need[WB_ABOVE + i] = reach + wb_max(a->x[i], e->x[i]);
    need[WB_LINEAR + i] = linear;
    need[WB_REST + i] = rest;
    need[WB_GUESS + i] = s->guess[i];
    need[WB_SMALL + i] = s->small[i];
    need[WB_JUMP + i] = s->jump[i];
    need[WB_EXTRA + i] = (s->guess[i] * rate + (WB_M > 0 ? s->second[i] : 0.0)) * WB_UP;
  }
  for (i = 0; i < WB_NV; ++i) need[WB_V + i] = m->v[i];
  for (i = 0; i < WB_NK; ++i) {
    need[WB_SLOPE + i] = s->gap[i] > 0.0 ? 1.0 : s->slope[i];
    need[WB_OFFSET + i] = fabs(s->offset[i]);
  }
  for (i = WB_OFFSET + WB_NK; i < WB_PREMISE; ++i) need[i] = 0.0;
}

/* Rates at both ends of the step, for sets as large as the slack allows there. */
static int wb_sources(const wb_set *s, const double *v, double *start, double *end) {
  double scratch[WB_SCRATCH], linear[2][WB_L], rest[2][WB_L];
  const double *at_start[] = {s->at_start->sizes, linear[0], rest[0], v};
  const double *at_end[] = {s->at_end->sizes, linear[1], rest[1], v};
  double *from_start[] = {start}, *from_end[] = {end};
  int i;
  for (i = 0; i < WB_L; ++i) {
    linear[0][i] = WB_M > 0 ? s->now->linear[i] + s->bend[i] : 0.0;
    linear[1][i] = WB_M > 0 ? s->next->linear[i] + s->bend[i] : 0.0;
    /* What the step adds has not grown yet at its start. */
    rest[0][i] = s->now->rest[i] + (s->slack[i] - s->guess[i] + 0x1p-40 * s->slack[i]);
    rest[1][i] = s->next->rest[i] + s->slack[i];
    if (WB_M == 0) {
      rest[0][i] += s->bend[i];
      rest[1][i] += s->bend[i];
    }
  }
  return wb_source(at_start, from_start, 0, scratch, 0) || wb_source(at_end, from_end, 0, scratch, 0);
}

/* Terms of one step from the bounds; updates what is guessed for the next trial or step. Returns how
 * many of the guesses are not verified. */
WB_WIDE static double wb_terms(wb_set *restrict s, wb_moves *restrict m, double h,
                               const double *restrict start, const double *restrict end,
                               const double *restrict less, double more, double room) {
  const wb_bounds *restrict b = &s->bounds;
  const double h2 = h * h, h5 = h2 * h2 * h, high = h5 * h; /* of Taylor steps of order 5 */
  const double twelfth = h2 / 12, eighth = h2 / 8, quarter = h2 / 4, cube = h2 * h;
  const double third = h / 3, sixth = h / 6, half = h / 2;
  /* The bounds are homogeneous in what they were made for, of degree 1, 2 or 3. */
  const double both = less[0] * less[0], square = less[1] * less[1], mapped = more * less[0];
  double jump[WB_L], bad[WB_L];
  int i;
  for (i = 0; i < WB_L; ++i) {
    jump[i] = (high * (b->taylor_x[i] + mapped * b->taylor_w[i]) + m->round[i]) * WB_UP;
  }
  for (i = 0; i < WB_L; ++i) {
    const double source_bend = WB_M > 0 ? square * b->source_bend[i] : 0.0;
    const double source = WB_M > 0 ? twelfth * b->source_turn[i] + half * b->source_slip[i] +
                                     h5 * (square * b->response[i]) : 0.0;
    const double input = WB_NV > 0 ? half * b->input_slip[i] + cube * b->input_response[i] : 0.0;
    const double tiny = (twelfth * (less[2] * b->grown_bend[i]) + source + input) * WB_UP;
    const double constant = both * (quarter * b->second_bend[i] + less[0] * b->third[i]) * WB_UP;
    const double rate = wb_max(start[i], end[i]) + constant;
    const double bend = WB_M > 0 ? eighth * (less[1] * b->bend_linear[i]) * WB_UP : 0.0;
    const double rest = (eighth * (less[0] * b->bend_rest[i] + source_bend) + jump[i]) * WB_UP;
    const double small = (tiny + h * (less[3] * b->grown_small[i])) * WB_UP;
    const double push = WB_NV > 0 ? rate + b->input_rate[i] : rate;
    const double guess = (h * (less[2] * b->grown[i] + push) + small) * WB_UP;
    const double slack = (rest + s->guess[i]) * WB_UP;
    /* |t^i - t h^(i-1)| <= h^i (1/4, 0.385, 0.4725, 0.535) for i = 2 .. 5 and 0 <= t <= h. */
    const double margin = (quarter * b->curvature[i] + cube * (0.385 * b->cubic[i] +
                           h * (0.4725 * b->quartic[i] + 0.535 * h * b->quintic[i])) + jump[i]) * WB_UP;
    bad[i] = (small < s->small[i] ? 0.0 : 1.0) + (guess < s->guess[i] ? 0.0 : 1.0) +
             (slack < s->slack[i] ? 0.0 : 1.0) + (margin < s->margin[i] ? 0.0 : 1.0) +
             (bend < s->bend[i] ? 0.0 : 1.0) + (jump[i] < s->jump[i] ? 0.0 : 1.0) + (WB_M == 0 || b->second[i] < s->second[i] ? 0.0 : 1.0);
    m->from_start[i] = (third * start[i] + sixth * end[i] + half * constant) * WB_UP;
    m->from_end[i] = (sixth * start[i] + third * end[i] + half * constant) * WB_UP;
    m->added[i] = (small + jump[i]) * WB_UP;
    s->chord[i] = (quarter * b->curvature[i] + (WB_NW > 0 ? half * b->jump_rate[i] : 0.0)) * WB_UP;
    s->small[i] = (1.2 + room) * small + 1.0 * wb_max(small - s->small[i], 0.0) + 1e-12;
    s->guess[i] = (1.05 + room) * guess + 1.0 * wb_max(guess - s->guess[i], 0.0) + 1e-11;
    s->slack[i] = s->guess[i] + (1.02 + room) * rest + 1e-10;
    s->bend[i] = (1.02 + room) * bend + 1e-10;
    s->jump[i] = (1.1 + room) * jump[i] + 1e-12;
    s->margin[i] = (1.1 + room) * margin + 1e-10;
    s->second[i] = (1.1 + room) * b->second[i] + 1e-10;
  }
  for (i = 1; i < WB_L; ++i) bad[0] += bad[i];
  return bad[0];
}

/* Bounds what the step adds: verifies slack, bend, guess, small, margin and second by each other. */
static int wb_close(wb_set *s, wb_moves *m, double h) {
  int trial, i;
  for (trial = 0; trial < WB_TRIALS; ++trial) {
    double need[WB_PREMISE], start[WB_L], end[WB_L], less[4], more = 1.0, bad;
    wb_need(s, m, h, need);
    if (wb_bound(s, need)) return WB_NO_ENCLOSURE;
    wb_scales(need, s->premise, less);
    /* What the transition maps besides the set: the source of the quadratic term. */
    if (WB_M > 0) {
      more += h * wb_share(s->bounds.second, need + WB_REST, WB_L) * WB_UP;
      more += h * h / 12 * wb_share(s->bounds.source_bend, need + WB_REST, WB_L) * WB_UP;
    }
    for (i = WB_N; i < WB_L; ++i) start[i] = end[i] = 0.0;
    if (wb_sources(s, m->v, start, end)) return WB_NO_ENCLOSURE;
    for (i = 0; i < WB_N; ++i) {
      s->box_lower[i] = -need[WB_BELOW + i];
      s->box_upper[i] = need[WB_ABOVE + i];
    }
    bad = wb_terms(s, m, h, start, end, less, more, WB_PATIENCE * trial);
    if (bad == 0.0) return WB_COMPLETE;
  }
  return WB_NO_ENCLOSURE;
}

static int wb_in_region(const wb_set *s) {
  int i, ok = 1;
  for (i = 0; i < WB_N; ++i) {
    ok &= wb_region_lower[i] <= s->box_lower[i] && s->box_upper[i] <= wb_region_upper[i];
  }
  return ok;
}

/* The nominal, its transition and the inputs' columns; `at_start`, `at_end` get what rounding can change
 * in what is added there. */
static int wb_advance_nominal(wb_set *s, wb_moves *m, double h, double *at_start, double *at_end) {
  double scratch[WB_SCRATCH];
  const double *from[] = {s->now->x, s->p, s->w_mid, s->slope, s->offset, &h};
  int i;
#if WB_ENCLOSED
  double ok = 0.0;
  double *res[] = {s->next->x, m->phi, at_end, m->matrix, &ok};
  if (wb_advance(from, res, 0, scratch, 0) || !(ok == 1.0)) return WB_NO_ENCLOSURE;
  for (i = 0; i < WB_L; ++i) at_start[i] = 0.0;
  for (i = WB_N; i < WB_L; ++i) at_end[i] = 0.0;
#else
  double rates[WB_RATES];
  double *res[] = {s->next->x, rates};
  if (wb_advance(from, res, 0, scratch, 0)) return WB_NO_ENCLOSURE;
  wb_transition(rates, m->phi);
  for (i = 0; i < WB_L; ++i) {
    at_start[i] = wb_round_start[i];
    at_end[i] = wb_round_step[i];
  }
#endif
#if WB_NV > 0
  {
    const double *to[] = {s->next->x, s->p, s->w_mid, s->slope, s->offset};
#if WB_ENCLOSED
    double round[2][WB_INPUT_NNZ + 1], fine[2] = {0.0, 0.0};
    double *first[] = {m->inputs[0], round[0], fine}, *last[] = {m->inputs[1], round[1], fine + 1};
#else
    const double fine[2] = {1.0, 1.0};
    double *first[] = {m->inputs[0]}, *last[] = {m->inputs[1]};
#endif
    if (wb_inputs(from, first, 0, scratch, 0) || wb_inputs(to, last, 0, scratch, 0)) return WB_NO_ENCLOSURE;
    if (!(fine[0] == 1.0 && fine[1] == 1.0)) return WB_NO_ENCLOSURE;
#if WB_ENCLOSED
    for (i = 0; i < WB_NV; ++i) {
      int k;
      for (k = wb_input_start[i]; k < wb_input_start[i + 1]; ++k) {
        at_start[wb_input_row[k]] += h * round[0][k] * m->v[i] * WB_UP;
        at_end[wb_input_row[k]] += h * round[1][k] * m->v[i] * WB_UP;
      }
    }
#endif
  }
#endif
  return WB_COMPLETE;
}

/* Advances x and maps the set; next->pending holds the image of the box, m->round the rounding of all
 * this. */
static int wb_move(wb_set *s, wb_moves *m, double h) {
  double mapped[WB_L], start[WB_L];
  wb_instant *t = s->next;
  int i;
  if (wb_advance_nominal(s, m, h, start, m->round)) return WB_NO_ENCLOSURE;
  wb_size(m->phi, m->sizes);
  if (WB_M > 0) wb_map_columns(m->phi, s->g, s->g_next, 0, WB_MS, t->linear);
  wb_map_columns(m->phi, s->g, s->g_next, WB_MS, s->now->columns, t->spread);
  t->columns = s->now->columns;
  if (wb_derive(s, t->x, s->g_next, s->at_end)) return WB_NO_ENCLOSURE;
  for (i = 0; i < WB_L; ++i) {
    t->pending[i] = 0.0;
    mapped[i] = s->now->linear[i] + s->now->rest[i];
  }
#if WB_PAIRS > 0
  {
    double sizes[4][WB_L];
    const double twelfth = h * h / 12;
    wb_map_pairs(m->phi, s->q, s->at_start->source, s->at_start->bent, s->at_end->source,
                 s->at_end->bent, h, s->q_next);
    wb_sum_sizes(s->at_start->source, sizes[0]);
    wb_sum_sizes(s->at_start->bent, sizes[1]);
    wb_sum_sizes(s->at_end->source, sizes[2]);
    wb_sum_sizes(s->at_end->bent, sizes[3]);
    for (i = 0; i < WB_N; ++i) {
      mapped[i] += h * sizes[0][i] + twelfth * sizes[1][i];
      start[i] += (h * s->at_start->source_round[i] + twelfth * s->at_start->bent_round[i]) * WB_UP;
      m->round[i] += (h * (WB_COLUMN_ROUNDING * sizes[2][i] + s->at_end->source_round[i]) +
                      twelfth * (WB_COLUMN_ROUNDING * sizes[3][i] + s->at_end->bent_round[i])) * WB_UP;
    }
  }
#endif
#if WB_ENCLOSED
  wb_size(m->matrix, m->errors);
  wb_map_sizes(m->errors, mapped, m->round);
#endif
  for (i = 0; i < WB_L; ++i) start[i] += WB_COLUMN_ROUNDING * mapped[i];
  wb_map_sizes(m->sizes, s->now->pending, t->pending);
  wb_map_sizes(m->sizes, start, m->round);
  wb_sum_pairs(s->q_next, t->q_low, t->q_high);
  wb_enclose(t);
  return WB_COMPLETE;
}

#if WB_NV > 0
/* size: sums of the sizes of the products that the entries of `column` are sums of. */
static void wb_append(wb_set *s, int input, const double *column, const double *size) {
  wb_instant *t = s->next;
  int row;
  for (row = 0; row < WB_N; ++row) {
    wb_row(s->g_next, row)[t->columns] = column[row];
    t->spread[row] += fabs(column[row]) * WB_UP;
    t->pending[row] += WB_COLUMN_ROUNDING * size[row];
  }
  s->source[t->columns++] = WB_N + input;
}

/* Columns of the exogenous inputs: their effect is split onto the two ends of the step. */
static void wb_extend_inputs(wb_set *s, const wb_moves *m, double h) {
  int i, j, k;
  for (j = 0; j < WB_NV; ++j) {
    const double radius = m->v[j] * (h / 2) * WB_UP;
    double column[WB_N], size[WB_N];
    if (!(radius > 0.0)) continue;
    memset(column, 0, sizeof column);
    memset(size, 0, sizeof size);
    for (k = wb_input_start[j]; k < wb_input_start[j + 1]; ++k) {
      for (i = wb_phi_start[wb_input_row[k]]; i < wb_phi_start[wb_input_row[k] + 1]; ++i) {
        const double value = m->phi[i] * (m->inputs[0][k] * radius);
        column[wb_phi_row[i]] += value;
        size[wb_phi_row[i]] += fabs(value);
      }
    }
    wb_append(s, j, column, size);
    memset(column, 0, sizeof column);
    memset(size, 0, sizeof size);
    for (k = wb_input_start[j]; k < wb_input_start[j + 1]; ++k) {
      column[wb_input_row[k]] = m->inputs[1][k] * radius;
      size[wb_input_row[k]] = fabs(column[wb_input_row[k]]);
    }
    wb_append(s, j, column, size);
  }
}
#endif

/* Turns the box at the start, with what the step adds there, into columns at the end where that pays. */
static void wb_extend(wb_set *s, const wb_moves *m, double h) {
  wb_instant *t = s->next;
  double box[WB_L], turned[WB_L], added[WB_L];
  /* Remainders grow faster than with the step's square: in long steps a box matters less. */
  const double share = WB_FLUSH_SHARE * wb_max(1.0, h * h / (WB_FLUSH_STEP * WB_FLUSH_STEP));
  int i;
#if WB_ENCLOSED
  double mapped[WB_L];
#endif
  for (i = 0; i < WB_L; ++i) {
    const double part = (s->now->pending[i] + m->from_start[i]) * WB_UP;
    const double size = share * (s->now->linear[i] + s->now->rest[i]);
    turned[i] = part > size ? part * wb_feeds[i] : 0.0;
    box[i] = turned[i] > 0.0 ? 0.0 : part;
    t->pending[i] = (m->from_end[i] + m->added[i]) * WB_UP;
    added[i] = 0.0;
  }
#if WB_ENCLOSED
  /* What the transition maps besides the set. */
  for (i = 0; i < WB_L; ++i) mapped[i] = m->from_start[i];
#if WB_NV > 0
  for (i = 0; i < WB_NV; ++i) {
    int k;
    for (k = wb_input_start[i]; k < wb_input_start[i + 1]; ++k) {
      mapped[wb_input_row[k]] += fabs(m->inputs[0][k]) * m->v[i] * h;
    }
  }
#endif
  wb_map_sizes(m->errors, mapped, t->pending);
#endif
  t->columns = wb_box_columns(m->phi, turned, s->g_next, s->source, t->columns);
  wb_map_sizes(m->sizes, turned, added);
  wb_map_sizes(m->sizes, box, t->pending);
  for (i = 0; i < WB_L; ++i) {
    t->spread[i] += added[i];
    t->pending[i] += 0x1p-52 * added[i];
  }
}

/* Fills the last group of four columns up with zeros. */
static void wb_fill(double *g, int from) {
  const int to = (from + 3) / 4 * 4;
  int i, j;
  for (i = 0; i < WB_N; ++i) {
    for (j = from; j < to; ++j) wb_row(g, i)[j] = 0.0;
  }
}

#if WB_REDUCED
/* How much of each column a box around it adds, in shares of the set: all but its largest entry. */
WB_WIDE static void wb_scores(const wb_instant *restrict t, const double *restrict g,
                              double *restrict scores) {
  const int count = t->columns;
  double largest[WB_COLUMNS];
  int i, j;
  for (j = WB_MS; j < count; ++j) scores[j] = largest[j] = 0.0;
  for (i = 0; i < WB_N; ++i) {
    const double size = t->linear[i] + t->rest[i], weight = size > 1e-200 ? 1.0 / size : 0.0;
    const double *row = g + (size_t)i * WB_COLUMNS;
    for (j = WB_MS; j < count; ++j) {
      const double share = fabs(row[j]) * weight;
      scores[j] += share;
      largest[j] = wb_max(largest[j], share);
    }
  }
  for (j = WB_MS; j < count; ++j) scores[j] -= largest[j];
}

/* A score that at least so many columns do not exceed, but few more. */
WB_WIDE static double wb_threshold(const double *scores, int from, int to, double least) {
  double most = WB_N, step = WB_N;
  int j, k;
  for (k = 0; k < 16; ++k) {
    double count = 0.0;
    step /= 2;
    for (j = from; j < to; ++j) count += scores[j] <= most - step ? 1.0 : 0.0;
    if (count >= least) most -= step;
  }
  return most;
}

/* Pairs every other column with the one before it from the same source, to which it is nearly
 * parallel: b = ratio a + remainder. Where the remainder is less than what a box around b adds, it is
 * the score, and `partner` is a. */
static void wb_pair(const wb_set *s, double *scores, double *ratio, int *partner) {
  const wb_instant *t = s->now;
  double *g = s->g;
  int last[WB_N + WB_NV], i, j;
  double weight[WB_N];
  for (i = 0; i < WB_N + WB_NV; ++i) last[i] = -1;
  for (i = 0; i < WB_N; ++i) {
    const double size = t->linear[i] + t->rest[i];
    weight[i] = size > 1e-200 ? 1.0 / size : 0.0;
  }
  for (j = WB_MS; j < t->columns; ++j) {
    const int before = last[s->source[j]];
    double own = 0.0, both = 0.0, left = 0.0;
    partner[j] = -1;
    last[s->source[j]] = before < 0 ? j : -1;
    if (before < 0) continue;
    for (i = 0; i < WB_N; ++i) {
      const double one = wb_row(g, i)[before] * weight[i];
      own += one * one;
      both += one * (wb_row(g, i)[j] * weight[i]);
    }
    if (!(own > 0.0)) continue;
    ratio[j] = both / own;
    for (i = 0; i < WB_N; ++i) {
      left += fabs(wb_row(g, i)[j] - ratio[j] * wb_row(g, i)[before]) * weight[i];
    }
    if (!(left < scores[j])) continue;
    scores[j] = left;
    partner[j] = before;
  }
}

/* Merges columns into others or into the box, those first that this widens least, until few enough are
 * left: a e + b f = a (e + ratio f) + (b - ratio a) f. */
static void wb_reduce(wb_set *s) {
  wb_instant *t = s->now;
  double scores[WB_COLUMNS], ratio[WB_COLUMNS], most, wider[WB_L] = {0.0}, box[WB_L] = {0.0};
  int partner[WB_COLUMNS], kept = WB_MS, i, j;
  wb_scores(t, s->g, scores);
  wb_pair(s, scores, ratio, partner);
  most = wb_threshold(scores, WB_MS, t->columns, t->columns - WB_MS - WB_KEPT);
  for (j = WB_MS; j < t->columns; ++j) {
    const int other = partner[j], paired = other >= 0 && !(scores[other] <= most);
    if (!(scores[j] <= most)) continue;
    for (i = 0; i < WB_N; ++i) {
      double *row = wb_row(s->g, i);
      const double size = fabs(row[j]);
      if (paired) {
        const double left = fabs(row[j] - ratio[j] * row[other]);
        row[other] *= 1.0 + fabs(ratio[j]);
        wider[i] += 2 * left;
        box[i] += left + 0x1p-50 * (size + fabs(row[other]));
      } else {
        box[i] += size;
      }
    }
  }
  for (j = WB_MS; j < t->columns; ++j) {
    if (scores[j] <= most) continue;
    for (i = 0; i < WB_N; ++i) wb_row(s->g, i)[kept] = wb_row(s->g, i)[j];
    s->source[kept++] = s->source[j];
  }
  t->columns = kept;
  for (i = 0; i < WB_N; ++i) {
    t->pending[i] = (t->pending[i] + box[i]) * WB_UP;
    t->rest[i] = (t->rest[i] + wider[i]) * (1.0 + 0x1p-38);
  }
  wb_fill(s->g, t->columns);
  s->ranged = 0;
}
#endif

static int wb_commit(wb_set *s) {
  double *swap = s->g;
  wb_instant *const instant = s->now;
  wb_derivatives *const derivatives = s->at_start;
  s->g = s->g_next;
  s->g_next = swap;
  swap = s->q;
  s->q = s->q_next;
  s->q_next = swap;
  s->now = s->next;
  s->next = instant;
  s->at_start = s->at_end;
  s->at_end = derivatives;
  memcpy(s->at_low[0], s->at_low[1], sizeof s->at_low[0]);
  memcpy(s->at_high[0], s->at_high[1], sizeof s->at_high[0]);
  s->ranged = WB_NK > 0;
  if (!wb_finite(s->now->lower, WB_N) || !wb_finite(s->now->upper, WB_N)) return WB_NO_ENCLOSURE;
#if WB_REDUCED
  if (s->now->columns > WB_MS + WB_MOST) wb_reduce(s);
  if (s->now->columns > WB_MS + WB_MOST) return WB_NO_ENCLOSURE;
#endif
  return WB_COMPLETE;
}

static int wb_attempt(wb_set *s, wb_moves *m, double h) {
  int j;
  ++s->spent;
  for (j = 0; j < WB_NW; ++j) m->v[j] = s->w_rad[j];
  for (j = 0; j < WB_NK; ++j) m->v[WB_NW + j] = s->gap[j];
  if (!s->derived && wb_derive(s, s->now->x, s->g, s->at_start)) return WB_NO_ENCLOSURE;
  s->derived = 1;
  if (wb_move(s, m, h) || wb_close(s, m, h)) return WB_NO_ENCLOSURE;
  wb_extend(s, m, h);
#if WB_NV > 0
  wb_extend_inputs(s, m, h);
#endif
  wb_fill(s->g_next, s->next->columns);
  wb_enclose(s->next);
  return WB_COMPLETE;
}

#if WB_NK > 0
/* Ranges of the drivers over the step just attempted: hull of both instants, widened by the chord. */
static int wb_step_ranges(wb_set *s, double h) {
  const wb_bounds *b = &s->bounds;
  double (*lower)[WB_NK + 1] = s->at_low, (*upper)[WB_NK + 1] = s->at_high;
  int i;
  if (!s->ranged && wb_driver_ranges(s, s->now, s->g, s->q, lower[0], upper[0])) return WB_NO_ENCLOSURE;
  s->ranged = 1;
  if (wb_driver_ranges(s, s->next, s->g_next, s->q_next, lower[1], upper[1])) return WB_NO_ENCLOSURE;
  for (i = 0; i < WB_NK; ++i) {
    const double more = (b->driver_third[i] + b->driver_input[i] + h * h / 4 * b->driver_curvature[i] +
                         h / 2 * b->driver_jump[i]) * WB_UP;
    const double low = wb_min(lower[0][i], lower[1][i]), high = wb_max(upper[0][i], upper[1][i]);
    s->range_low[i] = low - more - 1e-13 * fabs(low);
    s->range_high[i] = high + more + 1e-13 * fabs(high);
  }
  return wb_finite(s->range_low, WB_NK) && wb_finite(s->range_high, WB_NK) ? WB_COMPLETE : WB_NO_ENCLOSURE;
}

static int wb_step_kinks(wb_set *s, wb_moves *m, double h) {
  double before_low[WB_NK], before_high[WB_NK];
  int trial, i;
  if (!s->derived) s->ranged = 0; /* whoever changes parameters says so once */
  memcpy(before_low, s->range_low, sizeof before_low);
  memcpy(before_high, s->range_high, sizeof before_high);
  for (trial = 0; trial < WB_KINK_TRIALS; ++trial) {
    int verified = 1, status = wb_lines(s);
    if (status == WB_COMPLETE) status = wb_attempt(s, m, h);
    if (status == WB_COMPLETE) status = wb_step_ranges(s, h);
    if (status != WB_COMPLETE) return status;
    for (i = 0; i < WB_NK; ++i) {
      const double share = WB_KINK_ROOM * (double)(1 << trial);
      const double room = share * (s->range_high[i] - s->range_low[i]) + 1e-9;
      if (wb_line_holds(s, i, s->range_low[i], s->range_high[i])) continue;
      verified = 0;
      s->guess_low[i] = s->range_low[i] - room;
      s->guess_high[i] = s->range_high[i] + room;
    }
    if (!verified) continue;
    /* Next guess: this range, moved on as it moved last. */
    for (i = 0; i < WB_NK; ++i) {
      const double room = WB_KINK_ROOM * (s->range_high[i] - s->range_low[i]) + 1e-9;
      const double low = s->moved ? s->range_low[i] - before_low[i] : 0.0;
      const double high = s->moved ? s->range_high[i] - before_high[i] : 0.0;
      s->guess_low[i] = s->range_low[i] + low - room;
      s->guess_high[i] = s->range_high[i] + high + room;
      if (!(s->guess_low[i] < s->guess_high[i])) {
        s->guess_low[i] = s->range_low[i] - room;
        s->guess_high[i] = s->range_high[i] + room;
      }
    }
    s->moved = 1;
    return WB_COMPLETE;
  }
  return WB_NO_ENCLOSURE;
}
#endif

static int wb_step(wb_set *s, double h) {
  wb_moves m;
#if WB_NK > 0
  const int status = wb_step_kinks(s, &m, h);
#else
  const int status = wb_attempt(s, &m, h);
#endif
  if (status != WB_COMPLETE) return status;
  return wb_in_region(s) ? WB_COMPLETE : WB_LEFT_REGION;
}

/* Segment enclosure: hull of the two instants, widened by the chord's deviation. */
static void wb_segment(const wb_set *s, double *lower, double *upper) {
  int i;
  for (i = 0; i < WB_N; ++i) {
    const double low = wb_min(s->now->lower[i], s->next->lower[i]) - s->chord[i];
    const double high = wb_max(s->now->upper[i], s->next->upper[i]) + s->chord[i];
    lower[i] = low - 0x1p-50 * fabs(low);
    upper[i] = high + 0x1p-50 * fabs(high);
  }
}

static int wb_prepare(wb_set *s) {
#if WB_NK > 0
  double scratch[WB_SCRATCH], lower[WB_NK], upper[WB_NK];
  const double *arg[] = {s->p};
  double *res[] = {s->floor, s->ceiling};
  int i;
  if (wb_limits(arg, res, 0, scratch, 0)) return WB_NO_ENCLOSURE;
  if (!wb_finite(s->floor, WB_NK) || !wb_finite(s->ceiling, WB_NK)) return WB_NO_ENCLOSURE;
  for (i = 0; i < WB_NK; ++i) {
    if (!(s->floor[i] <= s->ceiling[i])) return WB_NO_ENCLOSURE;
    s->slope[i] = 1.0;
  }
  s->derived = s->ranged = 0;
  if (wb_driver_ranges(s, s->now, s->g, s->q, lower, upper)) return WB_NO_ENCLOSURE;
  for (i = 0; i < WB_NK; ++i) {
    const double room = 0.1 * (upper[i] - lower[i]) + 1e-6;
    s->guess_low[i] = lower[i] - room;
    s->guess_high[i] = upper[i] + room;
  }
#else
  (void)s;
#endif
  return WB_COMPLETE;
}

static void wb_disturb(wb_set *s, int i, double low, double high) {
  const double middle = (low + high) / 2, radius = wb_radius(low, high);
  if (middle < s->w_mid[i] || middle > s->w_mid[i]) s->bounded = s->derived = s->ranged = 0;
  s->w_mid[i] = middle;
  s->w_rad[i] = radius;
}

/* Numbers of work memory that a tube needs. */
static long long wb_tube_work(void) { return 2LL * WB_N * (WB_COLUMNS + WB_PAIRS); }

static int wb_sane(const double *query, int *count) {
  const double *p = query + 2 * WB_N, *w = p + WB_NP;
  const double horizon = w[2 * WB_NW], step = w[2 * WB_NW + 1];
  const double grid = horizon / step - 1e-9; /* horizon_s is rarely an exact multiple */
  int i, ok = 1;
  if (!wb_finite(query, 2 * WB_N + WB_NP + 2 * WB_NW + 2)) return 0;
  if (!(step > 0.0 && step <= WB_STEP_MAX && horizon > 0.0 && grid <= WB_STEPS)) return 0;
  *count = (int)grid;
  if (*count < grid || *count < 1) *count += 1;
  for (i = 0; i < WB_N; ++i) ok &= query[WB_N + i] >= 0.0;
  for (i = 0; i < WB_NP; ++i) ok &= p[i] >= wb_p_lower[i] && p[i] <= wb_p_upper[i];
  for (i = 0; i < WB_NW; ++i) {
    ok &= w[i] >= wb_w_lower[i] && w[i] <= w[WB_NW + i] && w[WB_NW + i] <= wb_w_upper[i];
  }
  return ok && horizon - (*count - 1) * step > 0.0;
}

/* query: center (n), radius (n), parameters (n_p), w lower (n_w), w upper (n_w), horizon_s, step_s;
 * result: status, steps_done, then lower, upper (STEPS x n), lower_at, upper_at (STEPS+1 x n). */
int wb_tube(const double *query, double *result, double *work) {
  const double *w = query + 2 * WB_N + WB_NP;
  const double horizon = w[2 * WB_NW], step = w[2 * WB_NW + 1];
  double *lower = result + 2, *upper = lower + WB_STEPS * WB_N;
  double *lower_at = upper + WB_STEPS * WB_N, *upper_at = lower_at + (WB_STEPS + 1) * WB_N;
  wb_set s;
  int i, k, status, count = 0;
  result[0] = WB_BAD_INPUT;
  result[1] = 0.0;
  if (!wb_sane(query, &count)) return 0;
  wb_start(&s, query, query + WB_N, query + 2 * WB_N, work);
  for (i = 0; i < WB_NW; ++i) wb_disturb(&s, i, w[i], w[WB_NW + i]);
  memcpy(lower_at, s.now->lower, WB_N * sizeof *lower_at);
  memcpy(upper_at, s.now->upper, WB_N * sizeof *upper_at);
  status = wb_prepare(&s);
  for (k = 0; k < count && status == WB_COMPLETE; ++k) {
    const double h = k + 1 < count ? step : horizon - k * step;
    status = wb_step(&s, h);
    if (status != WB_COMPLETE) break;
    wb_segment(&s, lower + k * WB_N, upper + k * WB_N);
    status = wb_commit(&s);
    if (status != WB_COMPLETE) break;
    memcpy(lower_at + (k + 1) * WB_N, s.now->lower, WB_N * sizeof *lower_at);
    memcpy(upper_at + (k + 1) * WB_N, s.now->upper, WB_N * sizeof *upper_at);
  }
  result[0] = status;
  result[1] = k;
  return 0;
}
