/* One decision: three tubes along the path, each compared with the people's tubes.
 *
 * For each the largest of the nested initial sets comes first: what is proved for it holds for the
 * smaller ones. Where the deciding one is left unproved it is cut into cells, the worst first, until all
 * are proved or WB_TUBES tubes have been computed. Cells overlap by rounding and cover the set. Every
 * step that is tried counts; a tube whose budget is used up is not proved.
 */

enum wb_verdict { WB_SAFE = 0, WB_UNPROVED = 1, WB_INVALID = 2 };
enum wb_tube_kind { WB_TRACK, WB_STOP, WB_BRAKE, WB_ORDERS };

/* Of the fields of one tube in the result, after those of the tubes before. */
enum wb_tube_field {
  WB_T_VERDICTS = 0,
  WB_T_STATUS = WB_LEVELS,
  WB_T_ROWS,
  WB_T_LEVEL,
  WB_T_CELLS,
  WB_T_NEAREST,
  WB_T_LOWER = WB_T_NEAREST + WB_KINDS * WB_NEAREST,
  WB_T_UPPER = WB_T_LOWER + WB_ROWS * WB_N,
  WB_T_OCCUPANCY = WB_T_UPPER + WB_ROWS * WB_N,
  WB_T_SIZE = WB_T_OCCUPANCY + WB_ROWS * 5
};

/* Shares of the budget that may be used up after each tube. */
static const int wb_order_of[] = {WB_STOP, WB_TRACK, WB_BRAKE};
static const long wb_budget[] = {WB_BUDGET * 45L / 100, WB_BUDGET * 85L / 100, WB_BUDGET};

typedef struct {
  const double *q;
  wb_path path;
  wb_crowd crowd;
  double *boxes, *tube;             /* work memory: boxes of the crowd, of the tube */
  double center[WB_LEVELS][WB_N], radius[WB_LEVELS][WB_N];
  long spent, most;
  wb_order order;
  double boxed_lower, boxed_upper; /* held times that the boxes of the crowd are for */
} wb_case;

/* A part of an initial set and what its tube proves. */
typedef struct {
  double center[WB_N], radius[WB_N];
  double nearest[WB_KINDS * WB_NEAREST];
  double *lower, *upper; /* rows of the tube */
  int status, rows, substeps, cut;
  int ended; /* before its last row, where it came too near to be proved */
} wb_cell;

/* Rows that cover the horizon, 0 where the kernel has not as many, or not for steps as long. */
static int wb_rows_of(const double *q) {
  const double step = q[WB_Q_STEP_S], horizon = q[WB_Q_HORIZON_S];
  const double rows = ceil(horizon / step - 1e-9); /* it is rarely an exact multiple */
  if (!(step > 0.0 && step <= WB_STEP_MAX && horizon > 0.0 && rows <= WB_ROWS)) return 0;
  return rows > 1.0 ? (int)rows : 1;
}

static int wb_sane_query(const double *q) {
  int i;
  if (!wb_finite(q, WB_Q_PEOPLE_TUBES) || !wb_finite(q + WB_Q_SKEW_S, WB_QUERY_SIZE - WB_Q_SKEW_S)) return 0;
  if (!wb_sane_path(q) || !(q[WB_Q_CLEARANCE_REQUIRED_M] >= 0.0) || !wb_rows_of(q)) return 0;
  if (!(q[WB_Q_FRONT_M] >= 0.0 && q[WB_Q_REAR_M] >= 0.0 && q[WB_Q_HALF_WIDTH_M] >= 0.0)) return 0;
  for (i = 0; i < WB_LEVELS * WB_N; ++i) {
    if (!(q[WB_Q_INITIAL_RADIUS + i] >= 0.0)) return 0;
  }
  for (i = 0; i < WB_NW; ++i) {
    if (!(q[WB_Q_DISTURBANCE_LOWER + i] <= q[WB_Q_DISTURBANCE_UPPER + i])) return 0;
  }
  for (i = 0; i < WB_OWN_PARAMETERS; ++i) {
    const double p = q[WB_Q_PARAMETERS + i];
    if (!(p >= wb_p_lower[i] && p <= wb_p_upper[i])) return 0;
  }
  for (i = 0; i < 6; i += 2) {
    const double *times = q + (i == 0 ? WB_Q_SWITCH_S : i == 2 ? WB_Q_START_S : WB_Q_BRAKE_S);
    if (!(times[0] >= 0.0 && times[0] <= times[1] && times[1] <= WB_LONGEST_S)) return 0;
  }
  /* BRAKE's tube has the car that waits for its start only if BRAKE may be in force from the stamp on. */
  if (q[WB_Q_START_S + 1] > 0.0 && q[WB_Q_BRAKE_S] > 0.0) return 0;
  if (!(q[WB_Q_BRAKE + WB_BRAKE_LEAST] > 0.0 && q[WB_Q_BRAKE + WB_BRAKE_MOST] >= q[WB_Q_BRAKE])) return 0;
  if (!(q[WB_Q_BRAKE + WB_BRAKE_DELAY] >= 0.0 && q[WB_Q_BRAKE + WB_BRAKE_BUILD_UP] >= 0.0)) return 0;
#if WB_REFERENCE_CHANGE >= 0
  for (i = 0; i < 3; ++i) {
    if (!(q[WB_Q_REFERENCE_RAMP + i] >= 0.0)) return 0;
  }
  if (!(q[WB_Q_REFERENCE_RAMP + WB_RAMP_LEAST] <= q[WB_Q_REFERENCE_RAMP + WB_RAMP_MOST])) return 0;
  /* A ramp begins at the reference of the decision. */
  if (!(q[WB_Q_DISTURBANCE_LOWER + WB_REFERENCE_CHANGE] <= 0.0)) return 0;
  if (!(q[WB_Q_DISTURBANCE_UPPER + WB_REFERENCE_CHANGE] >= 0.0)) return 0;
#endif
  /* A standstill lasts, and the steering rests in it. */
  if (WB_MISREAD >= 0 && !(q[WB_Q_DISTURBANCE_UPPER + WB_MISREAD] <= q[WB_Q_BRAKE + WB_BRAKE_STOP_SPEED])) return 0;
  if (WB_PUSH >= 0 && !(q[WB_Q_DISTURBANCE_UPPER + WB_PUSH] < q[WB_Q_BRAKE + WB_BRAKE_LEAST])) return 0;
  return q[WB_Q_BRAKE + WB_BRAKE_STOP_SPEED] > 0.0;
}

/* The levels of the query, each widened where rounding let the next one stick out. */
static void wb_take_levels(wb_case *c) {
  int i, k;
  memcpy(c->center, c->q + WB_Q_INITIAL_CENTER, sizeof c->center);
  memcpy(c->radius, c->q + WB_Q_INITIAL_RADIUS, sizeof c->radius);
  for (k = WB_LEVELS - 1; k > 0; --k) {
    for (i = 0; i < WB_N; ++i) {
      const double gap = fabs(c->center[k][i] - c->center[k - 1][i]);
      const double reach = gap > 0.0 ? (gap + c->radius[k][i]) * WB_UP : c->radius[k][i];
      if (!(c->radius[k - 1][i] >= reach)) c->radius[k - 1][i] = reach;
    }
  }
}

/* The car's times after the stamp that row k is of. */
static double wb_row_start(const wb_order *order, int k) {
  return k ? wb_row_from(order, k) + order->held_lower : 0.0;
}

static double wb_row_end(const wb_order *order, int k) { return wb_row_to(order, k) + order->held_upper; }

/* Boxes around the people for every block of rows: the same for all tubes whose rows are of the same
 * times. */
static void wb_box_people(wb_case *c) {
  int k;
  if (c->boxed_lower == c->order.held_lower && c->boxed_upper == c->order.held_upper) return;
  c->boxed_lower = c->order.held_lower;
  c->boxed_upper = c->order.held_upper;
  for (k = 0; k < c->order.rows; k += WB_BLOCK) {
    const int last = k + WB_BLOCK < c->order.rows ? k + WB_BLOCK : c->order.rows;
    double window[2];
    wb_window(&c->crowd, wb_row_start(&c->order, k), wb_row_end(&c->order, last - 1), window);
    wb_crowd_boxes(&c->crowd, window, c->boxes + k / WB_BLOCK * 4 * WB_MOST_TUBES);
  }
}

static int wb_clear(const wb_case *c, const wb_cell *cell) {
  int kind;
  for (kind = 0; kind < WB_KINDS; ++kind) {
    const double *nearest = cell->nearest + kind * WB_NEAREST;
    if (!(c->order.mask >> kind & 1)) continue;
    if (!(nearest[WB_CLEAR_CAUSE] == WB_PROVED && nearest[WB_CLEAR_M] >= c->q[WB_Q_CLEARANCE_REQUIRED_M])) return 0;
  }
  return 1;
}

static int wb_proved(const wb_case *c, const wb_cell *cell) {
  return cell->status == WB_COMPLETE && !cell->ended && wb_clear(c, cell);
}

/* Compares row k with everybody; 0 when the ground covered could not be bounded. */
static int wb_compare(const wb_case *c, wb_cell *cell, int k) {
  const double start = wb_row_start(&c->order, k);
  double rectangle[5], window[2];
  if (!wb_cover(c->q, &c->path, cell->lower + k * WB_N, cell->upper + k * WB_N, rectangle)) return 0;
  wb_window(&c->crowd, start, wb_row_end(&c->order, k), window);
  wb_clear_segment(&c->crowd, c->order.mask, window, c->boxes + k / WB_BLOCK * 4 * WB_MOST_TUBES, rectangle,
                   start, cell->nearest);
  return 1;
}

static int wb_run_rows(wb_case *c, wb_cell *cell, int to_the_end) {
  wb_drive d;
  d.q = c->q;
  d.path = &c->path;
  d.order = &c->order;
  wb_depart(&d, cell->center, cell->radius, c->tube);
  wb_begin_clear(&c->crowd, c->order.mask, 0.0, cell->nearest);
  cell->ended = 0;
  for (cell->rows = 0; cell->rows < c->order.rows; ++cell->rows) {
    const int k = cell->rows, stands = wb_stands(&d, wb_row_from(&c->order, k));
    double *lower = cell->lower + k * WB_N, *upper = cell->upper + k * WB_N;
    if (stands) {
      wb_stand(&d, lower, upper);
    } else {
      const int status = wb_drive_row(&d, k, cell->substeps, &c->spent, c->most, lower, upper);
      if (status != WB_COMPLETE) return status;
    }
    if (!wb_compare(c, cell, k)) return WB_NO_ENCLOSURE;
    if (stands || (!to_the_end && !wb_clear(c, cell))) {
      cell->ended = !stands;
      ++cell->rows;
      return WB_COMPLETE;
    }
  }
  return c->order.brakes ? WB_UNFINISHED : WB_COMPLETE;
}

/* The cell's tube, in finer steps where the coarse ones fail. `to_the_end`: also of one that is too near. */
static void wb_run_cell(wb_case *c, wb_cell *cell, int to_the_end) {
  cell->cut = 0;
  cell->status = wb_run_rows(c, cell, to_the_end);
  if (cell->substeps == 1 && (cell->status == WB_LEFT_REGION || cell->status == WB_NO_ENCLOSURE)) {
    cell->substeps = WB_SUBSTEPS;
    cell->status = wb_run_rows(c, cell, to_the_end);
  }
}

static double wb_least(const wb_case *c, const wb_cell *cell) {
  double least = HUGE_VAL;
  int kind;
  for (kind = 0; kind < WB_KINDS; ++kind) {
    if (c->order.mask >> kind & 1) least = wb_min(least, cell->nearest[kind * WB_NEAREST + WB_CLEAR_M]);
  }
  return least;
}

/* The unproved cell with the least clearance, one without a complete tube before all others; -1 when
 * every cell is proved. */
static int wb_worst(const wb_case *c, const wb_cell *cells, int count) {
  int i, worst = -1;
  double least = HUGE_VAL;
  for (i = 0; i < count; ++i) {
    const double value = cells[i].status == WB_COMPLETE ? wb_least(c, cells + i) : -HUGE_VAL;
    if (cells[i].cut || wb_proved(c, cells + i)) continue;
    if (worst < 0 || value < least) {
      worst = i;
      least = value;
    }
  }
  return worst;
}

/* Where to cut: the axis whose radius is the largest share of the whole set's; -1 for a point. */
static int wb_cut_axis(const wb_cell *whole, const wb_cell *cell) {
  static const int axes[] = {WB_OFFSET_STATE, WB_SPEED, WB_HEADING_ERROR};
  double most = 0.0;
  int i, axis = -1;
  for (i = 0; i < 3; ++i) {
    const double share = whole->radius[axes[i]] > 0.0 ? cell->radius[axes[i]] / whole->radius[axes[i]] : 0.0;
    if (share > most * 1.01) {
      most = share;
      axis = axes[i];
    }
  }
  return axis;
}

/* Half of a cell, with a hair more than half of its radius. */
static void wb_half(const wb_cell *cell, int axis, double side, wb_cell *half) {
  const double center = cell->center[axis], radius = cell->radius[axis];
  memcpy(half->center, cell->center, sizeof half->center);
  memcpy(half->radius, cell->radius, sizeof half->radius);
  half->center[axis] = center + side * (radius / 2);
  half->radius[axis] = radius / 2 * (1 + 1e-15) + 4e-16 * (fabs(center) + radius) + 1e-300;
  half->substeps = cell->substeps;
}

/* Cuts cells until all are proved; returns how many there are, or 0 when they are not. */
static int wb_partition(wb_case *c, wb_cell *cells) {
  int count = 1, worst;
  while ((worst = wb_worst(c, cells, count)) >= 0) {
    const int axis = wb_cut_axis(cells, cells + worst);
    if (axis < 0 || count + 2 > WB_TUBES || cells[worst].status == WB_UNFINISHED) return 0;
    wb_half(cells + worst, axis, -1.0, cells + count);
    wb_half(cells + worst, axis, 1.0, cells + count + 1);
    cells[worst].cut = 1;
    wb_run_cell(c, cells + count, 0);
    wb_run_cell(c, cells + count + 1, 0);
    count += 2;
  }
  return count;
}

/* Hull of the rows of all cells that were not cut, in the first cell; a car that stands earlier stays. */
static void wb_merge(wb_cell *cells, int count) {
  int i, j, k, kind, first = 1, rows = 0;
  for (i = 0; i < count; ++i) {
    if (!cells[i].cut && cells[i].rows > rows) rows = cells[i].rows;
  }
  for (i = 0; i < count; ++i) {
    if (cells[i].cut) continue;
    for (k = 0; k < rows; ++k) {
      const int own = k < cells[i].rows ? k : cells[i].rows - 1;
      for (j = 0; j < WB_N; ++j) {
        const double low = cells[i].lower[own * WB_N + j], high = cells[i].upper[own * WB_N + j];
        double *lower = cells->lower + k * WB_N + j, *upper = cells->upper + k * WB_N + j;
        *lower = first ? low : wb_min(*lower, low);
        *upper = first ? high : wb_max(*upper, high);
      }
    }
    for (kind = 0; kind < WB_KINDS; ++kind) {
      const double *nearest = cells[i].nearest + kind * WB_NEAREST;
      double *kept = cells->nearest + kind * WB_NEAREST;
      if (first || nearest[WB_CLEAR_M] < kept[WB_CLEAR_M]) memcpy(kept, nearest, WB_NEAREST * sizeof *kept);
    }
    first = 0;
  }
  cells->status = WB_COMPLETE;
  cells->ended = 0;
  cells->rows = rows;
}

/* Rows of the result are of the stamp's time: with a held start, of everything that may be by then. What
 * stands in its last row stays there; other tubes say nothing about later rows. */
static int wb_report_rows(const wb_case *c, const wb_cell *cell, double *r) {
  const double early = c->order.held_lower / c->order.step, late = c->order.held_upper / c->order.step;
  const int stands = c->order.brakes && cell->status == WB_COMPLETE && !cell->ended;
  const double more = stands && late > 0.0 ? ceil(late + 2e-9) : 0.0; /* so that the last row stands */
  int rows, i, j, k;
  if (!(cell->rows + more <= c->order.rows)) return WB_UNFINISHED;
  rows = cell->rows + (int)more;
  for (k = 0; k < rows; ++k) {
    double *lower = r + WB_T_LOWER + k * WB_N, *upper = r + WB_T_UPPER + k * WB_N;
    /* Rows of the motion that can be in progress, the ends of a row belonging to both neighbours. */
    const double first = late > 0.0 ? floor(k - late - 1e-9) : k;
    const double last = late > 0.0 ? floor(k + 1 - early + 1e-9) : k;
    const int to = (int)wb_min(wb_max(last, 0.0), cell->rows - 1);
    const int from = (int)wb_min(wb_max(first, 0.0), to);
    for (j = from; j <= to; ++j) {
      for (i = 0; i < WB_N; ++i) {
        const double low = cell->lower[j * WB_N + i], high = cell->upper[j * WB_N + i];
        lower[i] = j == from ? low : wb_min(lower[i], low);
        upper[i] = j == from ? high : wb_max(upper[i], high);
      }
    }
    if (!wb_cover(c->q, &c->path, lower, upper, r + WB_T_OCCUPANCY + 5 * k)) return WB_NO_ENCLOSURE;
  }
  r[WB_T_ROWS] = rows;
  return WB_COMPLETE;
}

/* Reports a tube; 0 when it could not be, and then no row of it is. */
static int wb_report(const wb_case *c, const wb_cell *cell, int level, int tubes, double *r) {
  int status;
  memset(r + WB_T_LOWER, 0, (WB_T_SIZE - WB_T_LOWER) * sizeof *r);
  r[WB_T_ROWS] = 0.0;
  r[WB_T_LEVEL] = level;
  r[WB_T_CELLS] = tubes;
  memcpy(r + WB_T_NEAREST, cell->nearest, sizeof cell->nearest);
  status = wb_report_rows(c, cell, r);
  r[WB_T_STATUS] = status == WB_COMPLETE ? cell->status : status;
  if (status == WB_COMPLETE) return 1;
  memset(r + WB_T_LOWER, 0, (WB_T_SIZE - WB_T_LOWER) * sizeof *r);
  return 0;
}

/* A motion that begins after a standstill begins with the speed's integral at 0, and with wheels that may
 * have turned until then if anything disturbs them. */
static void wb_reset(const wb_case *c, wb_cell *cell) {
  const double center = cell->center[WB_SPEED_INTEGRAL], wait = c->order.held_upper;
  double turn[2], *steering = cell->radius + WB_STEERING;
  wb_felt(c->q, WB_TURN, turn);
  cell->radius[WB_SPEED_INTEGRAL] = wb_max(cell->radius[WB_SPEED_INTEGRAL], fabs(center));
  if (turn[0] < 0.0 || turn[1] > 0.0) *steering = (*steering + wb_max(-turn[0], turn[1]) * wait) * WB_UP;
}

#ifdef WB_REGIONS
static int wb_settle_learned(wb_case *c, wb_cell *cells, int level, double *r); /* learned_decide.c */
#endif

/* Whether the level is proved, as a whole or in cells; the deciding level, and what settles it, is
 * reported. */
static int wb_settle_level(wb_case *c, wb_cell *cells, int level, double *r) {
  const int decides = level == WB_DECIDING;
  int count;
#ifdef WB_REGIONS
  if (!c->order.brakes) return wb_settle_learned(c, cells, level, r);
#endif
  memcpy(cells->center, c->center[level], sizeof cells->center);
  memcpy(cells->radius, c->radius[level], sizeof cells->radius);
  if (c->order.held_upper > 0.0) wb_reset(c, cells);
  cells->substeps = 1;
  wb_run_cell(c, cells, decides);
  if (level > WB_DECIDING) return wb_proved(c, cells);
  if (wb_proved(c, cells)) return wb_report(c, cells, level, 1, r);
  if (!decides) return 0;
  wb_report(c, cells, level, 1, r);
  count = wb_partition(c, cells);
  if (!count) return 0;
  wb_merge(cells, count);
  return wb_report(c, cells, level, (count + 1) / 2, r);
}

static void wb_settle(wb_case *c, wb_cell *cells, double *r) {
  int level, proved = 0;
  wb_box_people(c);
  for (level = 0; level < WB_LEVELS; ++level) {
    if (!proved) proved = wb_settle_level(c, cells, level, r);
    r[WB_T_VERDICTS + level] = proved ? WB_SAFE : WB_UNPROVED;
  }
}

/* TRACK to the end against what people intend; TRACK, then BRAKE, against what they can do; BRAKE at once
 * against both. */
static void wb_take_order(wb_case *c, int kind) {
  const double *start = c->q + WB_Q_START_S;
  const double *command = c->q + (kind == WB_STOP ? WB_Q_SWITCH_S : WB_Q_BRAKE_S);
  wb_order *order = &c->order;
  memset(order, 0, sizeof *order);
  order->rows = wb_rows_of(c->q);
  order->step = c->q[WB_Q_STEP_S];
  order->until = c->q[WB_Q_HORIZON_S];
  order->brakes = kind != WB_TRACK;
  order->mask = kind == WB_TRACK ? 1 << WB_INTENT : kind == WB_STOP ? 1 << WB_GUARD : (1 << WB_KINDS) - 1;
  if (kind != WB_BRAKE) {
    order->held_lower = start[0];
    order->held_upper = start[1];
  }
  if (kind == WB_TRACK) return;
  order->switch_lower = wb_max(command[0] - order->held_upper - WB_GRAIN, 0.0);
  order->switch_upper = wb_max(command[1] - order->held_lower + WB_GRAIN, 0.0);
}

long long wb_query_size(void) { return WB_QUERY_SIZE; }
long long wb_result_size(void) { return WB_RESULT_SIZE; }

enum { WB_BOXES = ((WB_ROWS + WB_BLOCK - 1) / WB_BLOCK) * 4 * WB_MOST_TUBES };

long long wb_work_size(void) { return wb_tube_work() + WB_BOXES + 2LL * WB_TUBES * WB_ROWS * WB_N; }

static void wb_invalid(double *result) {
  int kind, level;
  memset(result, 0, WB_RESULT_SIZE * sizeof *result);
  result[WB_R_STATUS] = WB_BAD_INPUT;
  for (kind = 0; kind < WB_ORDERS; ++kind) {
    double *r = result + WB_R_TRACK_VERDICTS + kind * WB_T_SIZE;
    for (level = 0; level < WB_LEVELS; ++level) r[WB_T_VERDICTS + level] = WB_INVALID;
    r[WB_T_STATUS] = WB_BAD_INPUT;
    r[WB_T_LEVEL] = -1.0;
    for (level = 0; level < WB_KINDS; ++level) {
      double *nearest = r + WB_T_NEAREST + level * WB_NEAREST;
      nearest[WB_CLEAR_M] = -WB_NO_CLEARANCE;
      nearest[WB_CLEAR_PERSON] = nearest[WB_CLEAR_TUBE] = -1.0;
      nearest[WB_CLEAR_CAUSE] = WB_NOT_ASKED;
    }
  }
}

int wb_decide(const double *query, double *result, double *work) {
  wb_cell cells[WB_TUBES];
  wb_case c;
  int i;
  wb_invalid(result);
  c.q = query;
  c.spent = 0;
  c.boxed_lower = c.boxed_upper = -1.0; /* of no order yet */
  if (!wb_sane_query(query)) return 0;
  c.crowd.tube = query + WB_Q_PEOPLE_TUBES;
  c.crowd.piece = query + WB_Q_PEOPLE_PIECES;
  c.crowd.skew_lower = query[WB_Q_SKEW_S];
  c.crowd.skew_upper = query[WB_Q_SKEW_S + 1];
  if (!wb_take_crowd(&c.crowd, query[WB_Q_PEOPLE_COUNT], query[WB_Q_TUBES_COUNT], WB_POOL)) return 0;
  wb_take_path(&c.path, query);
  wb_take_levels(&c);
  c.tube = work;
  c.boxes = work + wb_tube_work();
  for (i = 0; i < WB_TUBES; ++i) {
    cells[i].lower = c.boxes + WB_BOXES + 2 * i * WB_ROWS * WB_N;
    cells[i].upper = cells[i].lower + WB_ROWS * WB_N;
  }
  for (i = 0; i < WB_ORDERS; ++i) {
    c.most = wb_budget[i];
    wb_take_order(&c, wb_order_of[i]);
    wb_settle(&c, cells, result + WB_R_TRACK_VERDICTS + wb_order_of[i] * WB_T_SIZE);
  }
  result[WB_R_STATUS] = WB_COMPLETE;
  result[WB_R_SPENT] = (double)c.spent;
  return 0;
}
