/* One decision: the tube along the path, the ground it covers, and its clearance from people.
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
  const double low[] = {lower[WB_STATION], lower[WB_OFFSET], lower[WB_HEADING_ERROR]};
  const double high[] = {upper[WB_STATION], upper[WB_OFFSET], upper[WB_HEADING_ERROR]};
  const double node[] = {path->start + j * path->spacing, path->x[j], path->y[j], path->heading[j]};
  const double body[] = {q[WB_Q_FRONT_M], q[WB_Q_REAR_M], q[WB_Q_HALF_WIDTH_M]};
  double curvature[2], ok = 0.0, scratch[WB_SCRATCH];
  const double *arg[] = {low, high, node, curvature, body};
  double *res[] = {rectangle, &ok};
  const double from = low[0] < node[0] ? low[0] : node[0], to = high[0] > node[0] ? high[0] : node[0];
  if (!wb_curvature(path, from, to, curvature, curvature + 1)) return 0;
  return !wb_occupancy(arg, res, 0, scratch, 0) && ok == 1.0;
}

/* Keeps the smallest clearance; 0 when a clearance could not be computed. */
static int wb_keep_clear(const double *q, double *r, const double *rectangle, int k) {
  const double start = k * WB_STEP, end = (k + 1) * WB_STEP;
  int i;
  for (i = 0; i < (int)q[WB_Q_PEOPLE_COUNT]; ++i) {
    double clearance, ok = 0.0, scratch[WB_SCRATCH];
    const double *arg[] = {rectangle, q + WB_Q_PEOPLE + 7 * i, &start, &end};
    double *res[] = {&clearance, &ok};
    if (wb_clearance(arg, res, 0, scratch, 0) || !(ok == 1.0)) return 0;
    if (!(clearance >= r[WB_R_CLEARANCE_M])) {
      r[WB_R_CLEARANCE_M] = clearance;
      r[WB_R_CLEARANCE_TIME_S] = start;
      r[WB_R_CLEARANCE_PERSON] = i;
    }
  }
  return 1;
}

/* One row of the tube, in WB_SUBSTEPS steps of integration. */
static int wb_decide_row(wb_set *s, const double *q, const wb_path *path, double *r, int k) {
  const double h = WB_STEP / WB_SUBSTEPS;
  double *lower = r + WB_R_TUBE_LOWER + k * WB_N, *upper = r + WB_R_TUBE_UPPER + k * WB_N;
  double *rectangle = r + WB_R_OCCUPANCY + 5 * k;
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
  return wb_keep_clear(q, r, rectangle, k) ? WB_COMPLETE : WB_NO_ENCLOSURE;
}

long long wb_query_size(void) { return WB_QUERY_SIZE; }
long long wb_result_size(void) { return WB_RESULT_SIZE; }

int wb_decide(const double *query, double *result, double *work) {
  wb_path path;
  wb_set s;
  int k, status = WB_COMPLETE;
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
  wb_start(&s, query + WB_Q_INITIAL_CENTER, query + WB_Q_INITIAL_RADIUS, query + WB_Q_PARAMETERS,
           work);
  for (k = 0; k < WB_ROWS; ++k) {
    status = wb_decide_row(&s, query, &path, result, k);
    if (status != WB_COMPLETE) break;
  }
  result[WB_R_STATUS] = status;
  result[WB_R_STEPS_DONE] = k;
  if (status == WB_COMPLETE) {
    const int clear = result[WB_R_CLEARANCE_M] >= query[WB_Q_CLEARANCE_REQUIRED_M];
    result[WB_R_VERDICT] = clear ? WB_SAFE : WB_UNPROVED;
  }
  return 0;
}
