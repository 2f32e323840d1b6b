/* The path table of a query, the curvature over a stretch of it, and the ground that a box of path states
 * covers. Offsets WB_Q_... are generated from the bundle's layout.
 */

typedef struct {
  int count;
  double start, spacing;
  const double *x, *y, *heading, *low, *high;
} wb_path;

static void wb_take_path(wb_path *path, const double *q) {
  path->count = (int)q[WB_Q_PATH_COUNT];
  path->start = q[WB_Q_PATH_START_M];
  path->spacing = q[WB_Q_PATH_SPACING_M];
  path->x = q + WB_Q_PATH_X;
  path->y = q + WB_Q_PATH_Y;
  path->heading = q + WB_Q_PATH_HEADING;
  path->low = q + WB_Q_PATH_CURVATURE_LOWER;
  path->high = q + WB_Q_PATH_CURVATURE_UPPER;
}

static int wb_sane_path(const double *q) {
  const double nodes = q[WB_Q_PATH_COUNT];
  int i;
  if (!(nodes >= 2.0 && nodes <= WB_NODES && nodes == (int)nodes)) return 0;
  for (i = 0; i < (int)nodes - 1; ++i) {
    if (!(q[WB_Q_PATH_CURVATURE_LOWER + i] <= q[WB_Q_PATH_CURVATURE_UPPER + i])) return 0;
  }
  return q[WB_Q_PATH_SPACING_M] > 0.0;
}

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

/* The rectangle that contains the body for every path state in [lower, upper]; 0 when there is none. */
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
