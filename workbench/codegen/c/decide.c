/* One decision: the tube along the path, the ground it covers, and its clearance from people.
 *
 * When the tube of the whole initial set proves too little, the set is cut into cells, the worst first,
 * until all are proved or WB_TUBES tubes have been computed; what is not proved by then counts as
 * unproved. Cells overlap by rounding and cover the set.
 *
 * Offsets WB_Q_... and WB_R_... are generated from the bundle's layout. The curvature enters as a
 * disturbance in the hull of the path's bins over the stations that a step can reach; whether the tube
 * stayed within these stations is checked after the step.
 */

enum wb_verdict { WB_SAFE = 0, WB_UNPROVED = 1, WB_INVALID = 2 };

typedef struct {
  int count;
  double start, spacing;
  const double *x, *y, *heading, *low, *high;
} wb_path;

/* Hull of the curvature over [from, to]; 0 when the table does not cover it. */
static int wb_curvature(const wb_path *path, double from, double to, double *low, double *high) {
  /* A hair more, so that rounding cannot choose the bin beside. */
  const double first = (from - path->start) / path->spacing - 1e-9;
  const double last = (to - path->start) / path->spacing + 1e-9;
  int j;
  if (!(first >= 0.0 && last <= path->count - 1 && first <= last)) return 0;
  *low = HUGE_VAL;
  *high = -HUGE_VAL;
  for (j = (int)first; j < path->count - 1 && j <= (int)last; ++j) {
    if (path->low[j] < *low) *low = path->low[j];
    if (path->high[j] > *high) *high = path->high[j];
  }
  return *low <= *high;
}

static int wb_sane_query(const double *q) {
  const double people = q[WB_Q_PEOPLE_COUNT], nodes = q[WB_Q_PATH_COUNT];
  int i, j;
  if (!wb_finite(q, WB_QUERY_SIZE)) return 0;
  if (!(people >= 0.0 && people <= WB_PEOPLE && people == (int)people)) return 0;
  if (!(nodes >= 2.0 && nodes <= WB_NODES && nodes == (int)nodes)) return 0;
  for (i = 0; i < (int)nodes - 1; ++i) {
    if (!(q[WB_Q_PATH_CURVATURE_LOWER + i] <= q[WB_Q_PATH_CURVATURE_UPPER + i])) return 0;
  }
  if (!(q[WB_Q_PATH_SPACING_M] > 0.0 && q[WB_Q_CLEARANCE_REQUIRED_M] >= 0.0)) return 0;
  if (!(q[WB_Q_FRONT_M] >= 0.0 && q[WB_Q_REAR_M] >= 0.0 && q[WB_Q_HALF_WIDTH_M] >= 0.0)) return 0;
  for (i = 0; i < WB_N; ++i) {
    if (!(q[WB_Q_INITIAL_RADIUS + i] >= 0.0)) return 0;
  }
  for (i = 0; i < WB_NW; ++i) {
    if (!(q[WB_Q_DISTURBANCE_LOWER + i] <= q[WB_Q_DISTURBANCE_UPPER + i])) return 0;
  }
  for (i = 0; i < WB_NP; ++i) {
    const double p = q[WB_Q_PARAMETERS + i];
    if (!(p >= wb_p_lower[i] && p <= wb_p_upper[i])) return 0;
  }
  for (i = 0; i < (int)people; ++i) {
    for (j = 4; j < 7; ++j) {
      if (!(q[WB_Q_PEOPLE + 7 * i + j] >= 0.0)) return 0;
    }
  }
  return 1;
}

/* Sets the disturbance ranges of the next step of length h; the stations reached lie in
 * [*from, *to]. */
static int wb_disturb_along(wb_set *s, const double *q, const wb_path *path, double h, double *from,
                            double *to) {
  const double slow = wb_min(s->now->lower[WB_SPEED], 0.0);
  const double fast = wb_max(s->now->upper[WB_SPEED], 0.0);
  double low, high;
  int i;
  *from = s->now->lower[WB_STATION] + WB_REACH * h * slow - WB_SLACK;
  *to = s->now->upper[WB_STATION] + WB_REACH * h * fast + WB_SLACK;
  for (i = 0; i < WB_NW; ++i) {
    low = q[WB_Q_DISTURBANCE_LOWER + i];
    high = q[WB_Q_DISTURBANCE_UPPER + i];
    if (i == WB_CURVATURE && !wb_curvature(path, *from, *to, &low, &high)) return 0;
    if (!(low >= wb_w_lower[i] && high <= wb_w_upper[i])) return 0;
    wb_disturb(s, i, low, high);
  }
  return 1;
}

static int wb_cover(const double *q, const wb_path *path, const double *lower, const double *upper,
                    double *rectangle) {
  const double middle = (lower[WB_STATION] + upper[WB_STATION]) / 2;
  const double place = (middle - path->start) / path->spacing + 0.5;
  const int j = place < 0.0 ? 0 : place > path->count - 1 ? path->count - 1 : (int)place;
  const double low[] = {lower[WB_STATION], lower[WB_OFFSET_STATE], lower[WB_HEADING_ERROR]};
  const double high[] = {upper[WB_STATION], upper[WB_OFFSET_STATE], upper[WB_HEADING_ERROR]};
  const double node[] = {path->start + j * path->spacing, path->x[j], path->y[j], path->heading[j]};
  const double body[] = {q[WB_Q_FRONT_M], q[WB_Q_REAR_M], q[WB_Q_HALF_WIDTH_M]};
  double curvature[2], ok = 0.0, scratch[WB_SCRATCH];
  const double *arg[] = {low, high, node, curvature, body};
  double *res[] = {rectangle, &ok};
  const double from = low[0] < node[0] ? low[0] : node[0], to = high[0] > node[0] ? high[0] : node[0];
  if (!wb_curvature(path, from, to, curvature, curvature + 1)) return 0;
  return !wb_occupancy(arg, res, 0, scratch, 0) && ok == 1.0;
}

/* A part of the initial set and what its tube proves. */
typedef struct {
  double center[WB_N], radius[WB_N];
  double clearance, time, person;
  double *lower, *upper; /* rows of the tube */
  int status, rows, cut;
} wb_cell;

/* Keeps the smallest clearance; 0 when a clearance could not be computed. */
static int wb_keep_clear(const double *q, wb_cell *cell, const double *rectangle, int k) {
  const double start = k * WB_STEP, end = (k + 1) * WB_STEP;
  int i;
  for (i = 0; i < (int)q[WB_Q_PEOPLE_COUNT]; ++i) {
    double clearance, ok = 0.0, scratch[WB_SCRATCH];
    const double *arg[] = {rectangle, q + WB_Q_PEOPLE + 7 * i, &start, &end};
    double *res[] = {&clearance, &ok};
    if (wb_clearance(arg, res, 0, scratch, 0) || !(ok == 1.0)) return 0;
    if (!(clearance >= cell->clearance)) {
      cell->clearance = clearance;
      cell->time = start;
      cell->person = i;
    }
  }
  return 1;
}

/* One row of the tube, in WB_SUBSTEPS steps of integration. */
static int wb_decide_row(wb_set *s, const double *q, const wb_path *path, wb_cell *cell, int k) {
  const double h = WB_STEP / WB_SUBSTEPS;
  double *lower = cell->lower + k * WB_N, *upper = cell->upper + k * WB_N, rectangle[5];
  int i, j, status;
  for (j = 0; j < WB_SUBSTEPS; ++j) {
    double low[WB_N], high[WB_N], from, to;
    if (!wb_disturb_along(s, q, path, h, &from, &to)) return WB_LEFT_REGION;
    if (k == 0 && j == 0 && wb_prepare(s) != WB_COMPLETE) return WB_NO_ENCLOSURE;
    status = wb_step(s, h);
    if (status != WB_COMPLETE) return status;
    if (!(s->box_lower[WB_STATION] >= from && s->box_upper[WB_STATION] <= to)) return WB_NO_ENCLOSURE;
    wb_segment(s, low, high);
    for (i = 0; i < WB_N; ++i) {
      lower[i] = j ? wb_min(lower[i], low[i]) : low[i];
      upper[i] = j ? wb_max(upper[i], high[i]) : high[i];
    }
    status = wb_commit(s);
    if (status != WB_COMPLETE) return status;
  }
  if (!wb_cover(q, path, lower, upper, rectangle)) return WB_NO_ENCLOSURE;
  return wb_keep_clear(q, cell, rectangle, k) ? WB_COMPLETE : WB_NO_ENCLOSURE;
}

static void wb_decide_cell(const double *q, const wb_path *path, wb_cell *cell, double *work) {
  wb_set s;
  cell->clearance = WB_NO_CLEARANCE;
  cell->time = 0.0;
  cell->person = -1.0;
  cell->cut = 0;
  cell->status = WB_COMPLETE;
  wb_start(&s, cell->center, cell->radius, q + WB_Q_PARAMETERS, work);
  for (cell->rows = 0; cell->rows < WB_ROWS; ++cell->rows) {
    cell->status = wb_decide_row(&s, q, path, cell, cell->rows);
    if (cell->status != WB_COMPLETE) return;
  }
}

static int wb_proved(const double *q, const wb_cell *cell) {
  return cell->status == WB_COMPLETE && cell->clearance >= q[WB_Q_CLEARANCE_REQUIRED_M];
}

/* The unproved cell with the least clearance, one without a complete tube before all others; -1 when
 * every cell is proved. */
static int wb_worst(const double *q, const wb_cell *cells, int count) {
  int i, worst = -1;
  double least = HUGE_VAL;
  for (i = 0; i < count; ++i) {
    const double value = cells[i].status == WB_COMPLETE ? cells[i].clearance : -HUGE_VAL;
    if (cells[i].cut || wb_proved(q, cells + i)) continue;
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
  half->radius[axis] = radius / 2 * (1 + 1e-15) + 4e-16 * (fabs(center) + radius);
}

/* Cuts cells until all are proved; returns how many there are, or 0 when they are not. */
static int wb_partition(const double *q, const wb_path *path, wb_cell *cells, double *work) {
  int count = 1, worst;
  while ((worst = wb_worst(q, cells, count)) >= 0) {
    const int axis = wb_cut_axis(cells, cells + worst);
    if (axis < 0 || count + 2 > WB_TUBES) return 0;
    wb_half(cells + worst, axis, -1.0, cells + count);
    wb_half(cells + worst, axis, 1.0, cells + count + 1);
    cells[worst].cut = 1;
    wb_decide_cell(q, path, cells + count, work);
    wb_decide_cell(q, path, cells + count + 1, work);
    count += 2;
  }
  return count;
}

/* Hull of the rows of all cells that were not cut, in the first cell. */
static void wb_merge(wb_cell *cells, int count) {
  int i, k, first = 1;
  for (i = 0; i < count; ++i) {
    if (cells[i].cut) continue;
    for (k = 0; k < WB_ROWS * WB_N; ++k) {
      cells->lower[k] = first ? cells[i].lower[k] : wb_min(cells->lower[k], cells[i].lower[k]);
      cells->upper[k] = first ? cells[i].upper[k] : wb_max(cells->upper[k], cells[i].upper[k]);
    }
    if (first || cells[i].clearance < cells->clearance) {
      cells->clearance = cells[i].clearance;
      cells->time = cells[i].time;
      cells->person = cells[i].person;
    }
    first = 0;
  }
  cells->status = WB_COMPLETE;
  cells->rows = WB_ROWS;
}

static int wb_report(const double *q, const wb_path *path, const wb_cell *cell, double *r) {
  int k;
  for (k = 0; k < cell->rows; ++k) {
    if (!wb_cover(q, path, cell->lower + k * WB_N, cell->upper + k * WB_N, r + WB_R_OCCUPANCY + 5 * k)) return 0;
  }
  memcpy(r + WB_R_TUBE_LOWER, cell->lower, (size_t)cell->rows * WB_N * sizeof *r);
  memcpy(r + WB_R_TUBE_UPPER, cell->upper, (size_t)cell->rows * WB_N * sizeof *r);
  r[WB_R_CLEARANCE_M] = cell->clearance;
  r[WB_R_CLEARANCE_TIME_S] = cell->time;
  r[WB_R_CLEARANCE_PERSON] = cell->person;
  r[WB_R_STATUS] = cell->status;
  r[WB_R_STEPS_DONE] = cell->rows;
  if (cell->status == WB_COMPLETE) r[WB_R_VERDICT] = wb_proved(q, cell) ? WB_SAFE : WB_UNPROVED;
  return 1;
}

long long wb_query_size(void) { return WB_QUERY_SIZE; }
long long wb_result_size(void) { return WB_RESULT_SIZE; }

long long wb_work_size(void) { return wb_tube_work() + 2LL * WB_TUBES * WB_ROWS * WB_N; }

int wb_decide(const double *query, double *result, double *work) {
  wb_cell cells[WB_TUBES];
  wb_path path;
  int i, count;
  memset(result, 0, WB_RESULT_SIZE * sizeof *result);
  result[WB_R_VERDICT] = WB_INVALID;
  result[WB_R_STATUS] = WB_BAD_INPUT;
  result[WB_R_CLEARANCE_M] = WB_NO_CLEARANCE;
  result[WB_R_CLEARANCE_PERSON] = -1.0;
  if (!wb_sane_query(query)) return 0;
  path.count = (int)query[WB_Q_PATH_COUNT];
  path.start = query[WB_Q_PATH_START_M];
  path.spacing = query[WB_Q_PATH_SPACING_M];
  path.x = query + WB_Q_PATH_X;
  path.y = query + WB_Q_PATH_Y;
  path.heading = query + WB_Q_PATH_HEADING;
  path.low = query + WB_Q_PATH_CURVATURE_LOWER;
  path.high = query + WB_Q_PATH_CURVATURE_UPPER;
  for (i = 0; i < WB_TUBES; ++i) {
    cells[i].lower = work + wb_tube_work() + 2 * i * WB_ROWS * WB_N;
    cells[i].upper = cells[i].lower + WB_ROWS * WB_N;
  }
  memcpy(cells->center, query + WB_Q_INITIAL_CENTER, sizeof cells->center);
  memcpy(cells->radius, query + WB_Q_INITIAL_RADIUS, sizeof cells->radius);
  wb_decide_cell(query, &path, cells, work);
  if (!wb_report(query, &path, cells, result)) return 0;
  if (wb_proved(query, cells)) return 0;
  count = wb_partition(query, &path, cells, work);
  if (!count) return 0;
  wb_merge(cells, count);
  if (!wb_report(query, &path, cells, result)) {
    result[WB_R_VERDICT] = WB_INVALID;
    result[WB_R_STATUS] = WB_NO_ENCLOSURE;
    result[WB_R_STEPS_DONE] = 0.0;
  }
  return 0;
}
