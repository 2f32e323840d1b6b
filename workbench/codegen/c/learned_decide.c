/* TRACK's tube by learned beta in a decision: each region's own tube is held against the people, so that it
 * is their union that must be clear. The region's simulation follows the curvature of the path where it is;
 * all that else disturbs the car is left out.
 */

/* What disturbs a simulation that moves from station x[WB_STATION] at x[WB_SPEED] for h; 0 off the path. */
static int wb_nominal(const wb_case *c, const double *x, double h, double *w) {
  const double here = x[WB_STATION], there = here + x[WB_SPEED] * h;
  double low, high;
  int i;
  for (i = 0; i < WB_NW; ++i) w[i] = (c->q[WB_Q_DISTURBANCE_LOWER + i] + c->q[WB_Q_DISTURBANCE_UPPER + i]) / 2;
  if (!wb_curvature(&c->path, wb_min(here, there), wb_max(here, there), &low, &high)) return 0;
  w[WB_CURVATURE] = (low + high) / 2;
  return 1;
}

static int wb_operated(const double *lower, const double *upper) {
  int i;
  for (i = 0; i < WB_N; ++i) {
    if (!(lower[i] >= wb_region_lower[i] && upper[i] <= wb_region_upper[i])) return 0;
  }
  return 1;
}

static int wb_learned_rows(wb_case *c, wb_cell *cell, int to_the_end) {
  const double *p = c->q + WB_Q_PARAMETERS;
  double x[WB_N], w[WB_NW + 1], low[WB_N], high[WB_N];
  memcpy(x, cell->center, sizeof x);
  if (!wb_bloated(x, 0.0, cell->radius, low, high)) return WB_LEFT_REGION;
  for (cell->rows = 0; cell->rows < c->order.rows; ++cell->rows) {
    const int k = cell->rows;
    const double h = wb_row_length(&c->order, k);
    double *lower = cell->lower + k * WB_N, *upper = cell->upper + k * WB_N;
    if (c->spent >= c->most) return WB_UNFINISHED;
    ++c->spent;
    if (!wb_nominal(c, x, h, w)) return WB_LEFT_REGION;
    wb_widen(lower, upper, low, high, 1);
    if (!wb_simulated(x, p, w, h) || !wb_bloated(x, wb_row_to(&c->order, k), cell->radius, low, high)) {
      return WB_NO_ENCLOSURE;
    }
    wb_widen(lower, upper, low, high, 0);
    if (!wb_operated(lower, upper)) return WB_LEFT_REGION;
    if (!wb_compare(c, cell, k)) return WB_NO_ENCLOSURE;
    if (!to_the_end && !wb_clear(c, cell)) {
      cell->ended = 1;
      ++cell->rows;
      break;
    }
  }
  return WB_COMPLETE;
}

/* Hull of all regions' rows, and the least clearance, in the first cell. */
static void wb_unite(wb_cell *cells, int rows) {
  int i, k, kind;
  for (i = 1; i < WB_REGIONS; ++i) {
    for (k = 0; k < rows * WB_N; k += WB_N) {
      wb_widen(cells->lower + k, cells->upper + k, cells[i].lower + k, cells[i].upper + k, 0);
    }
    for (kind = 0; kind < WB_KINDS; ++kind) {
      const double *nearest = cells[i].nearest + kind * WB_NEAREST;
      double *kept = cells->nearest + kind * WB_NEAREST;
      if (nearest[WB_CLEAR_M] < kept[WB_CLEAR_M]) memcpy(kept, nearest, WB_NEAREST * sizeof *kept);
    }
  }
  cells->rows = rows;
}

/* Runs all regions of a level. A motion that begins after a standstill begins with the speed's integral at 0. */
static int wb_settle_learned(wb_case *c, wb_cell *cells, int level, double *r) {
  const int decides = level == WB_DECIDING;
  const double *radius = c->radius[level];
  double center[WB_N];
  int i, known, proved = 1, status = WB_COMPLETE, rows = c->order.rows;
  memcpy(center, c->center[level], sizeof center);
  if (c->order.held_upper > 0.0) center[WB_SPEED_INTEGRAL] = 0.0;
  known = wb_learned_on(center, radius);
  for (i = 0; i < WB_REGIONS; ++i) {
    wb_cell *cell = cells + i;
    wb_region(center, radius, i, cell->center, cell->radius);
    wb_begin_clear(&c->crowd, c->order.mask, 0.0, cell->nearest);
    cell->cut = cell->rows = cell->ended = 0;
    cell->status = known ? wb_learned_rows(c, cell, decides) : WB_LEFT_REGION;
    if (cell->status != WB_COMPLETE) status = cell->status;
    if (cell->rows < rows) rows = cell->rows;
    proved = wb_proved(c, cell) && proved;
  }
  if (level > WB_DECIDING || (!proved && !decides)) return proved;
  wb_unite(cells, rows);
  cells->status = status;
  return wb_report(c, cells, level, WB_REGIONS, r) && proved;
}
