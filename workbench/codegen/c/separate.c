/* Separation of a rectangle per time segment from the predicted tubes of many people.
 *
 * Generated in front of this text: capacities and limits (WB_...), and the functions wb_car, wb_box and
 * wb_gap, whose results are proved in spite of rounding. A tube is WB_TUBE_NUMBERS doubles (person,
 * kind, until, first piece, pieces), a piece WB_PIECE_NUMBERS (bound, from, then seven of the disc);
 * the person is in every bound of a tube, and the best bound counts. No heap; every comparison that
 * accepts is written so that a NaN refuses.
 */

enum wb_cause {
  WB_PROVED = 0,
  WB_NOT_PREDICTED = 1, /* somebody has no such tube, or it does not hold at that time */
  WB_NOT_COMPUTED = 2,
  WB_NOT_ASKED = 3
};

/* What is known of one kind of tube: the smallest proved clearance, and what gave it. */
enum wb_nearest { WB_CLEAR_M, WB_CLEAR_TIME_S, WB_CLEAR_PERSON, WB_CLEAR_TUBE, WB_CLEAR_CAUSE };

typedef struct {
  int people, tubes;
  const double *tube, *piece;
  double skew_lower, skew_upper;
} wb_crowd;

static int wb_whole(double value, int most) {
  return value >= 0.0 && value <= most && value == (int)value;
}

static const double *wb_tube_at(const wb_crowd *crowd, int t) {
  return crowd->tube + (size_t)t * WB_TUBE_NUMBERS;
}

static const double *wb_piece_at(const wb_crowd *crowd, int j) {
  return crowd->piece + (size_t)j * WB_PIECE_NUMBERS;
}

/* Pieces from j on: bounds numbered from 0 without a gap, starts that rise and stay before until. */
static int wb_sane_pieces(const wb_crowd *crowd, int j, int count, double until) {
  const double *before = 0;
  int end = j + count, i;
  for (; j < end; ++j) {
    const double *piece = wb_piece_at(crowd, j);
    for (i = 0; i < WB_PIECE_NUMBERS; ++i) {
      if (!(piece[i] >= wb_piece_least[i] && piece[i] <= wb_piece_most[i])) return 0;
    }
    if (!(piece[1] < until)) return 0;
    if (!before) {
      if (!(piece[0] == 0.0)) return 0;
    } else if (piece[0] == before[0]) {
      if (!(piece[1] > before[1])) return 0;
    } else if (!(piece[0] == before[0] + 1.0)) {
      return 0;
    }
    before = piece;
  }
  return 1;
}

/* Takes people as `packed` lays them out, tubes, at most `pool` pieces and skews being set in `crowd`; 0
 * when a number makes no sense or more came than fits. */
static int wb_take_crowd(wb_crowd *crowd, double people, double tubes, int pool) {
  int t, pieces = 0, of_person = 0, person = 0;
  if (!(wb_whole(people, WB_MOST_PEOPLE) && wb_whole(tubes, WB_MOST_TUBES))) return 0;
  if (!(crowd->skew_lower >= -WB_LONGEST_S && crowd->skew_lower <= crowd->skew_upper)) return 0;
  if (!(crowd->skew_upper <= WB_LONGEST_S)) return 0;
  crowd->people = (int)people;
  crowd->tubes = (int)tubes;
  for (t = 0; t < crowd->tubes; ++t) {
    const double *tube = wb_tube_at(crowd, t);
    if (!(wb_whole(tube[0], crowd->people - 1) && (int)tube[0] >= person)) return 0;
    of_person = (int)tube[0] == person ? of_person + 1 : 1;
    person = (int)tube[0];
    if (of_person > WB_PERSON_TUBES || !wb_whole(tube[1], WB_KINDS - 1)) return 0;
    if (!(tube[2] >= -WB_LONGEST_S && tube[2] <= WB_LONGEST_S)) return 0;
    if (!(tube[3] == pieces && wb_whole(tube[4], WB_TUBE_PIECES) && tube[4] >= 1.0)) return 0;
    if (!(tube[4] <= pool - pieces)) return 0;
    if (!wb_sane_pieces(crowd, pieces, (int)tube[4], tube[2])) return 0;
    pieces += (int)tube[4];
  }
  return 1;
}

/* a + b rounded away from the other end of a window (side -1 or 1); exact sums stay exact. */
static double wb_sum_outward(double a, double b, double side) {
  const double sum = a + b, part = sum - a;
  const double error = (a - (sum - part)) + (b - part);
  return error * side > 0.0 ? sum + side * (fabs(sum) * 0x1p-52 + 0x1p-1021) : sum;
}

/* The people's times while the car's are in [start, end]. */
static void wb_window(const wb_crowd *crowd, double start, double end, double *window) {
  window[0] = wb_sum_outward(start, crowd->skew_lower, -1.0);
  window[1] = wb_sum_outward(end, crowd->skew_upper, 1.0);
}

/* The next piece from j on that holds in the window, with the part in which it does; `end` when there
 * is none before it. Pieces from j to end are of one bound. */
static int wb_next_piece(const wb_crowd *crowd, int j, int end, const double *window, double *part) {
  for (; j < end; ++j) {
    const double from = wb_piece_at(crowd, j)[1];
    const double next = j + 1 < end ? wb_piece_at(crowd, j + 1)[1] : HUGE_VAL;
    if (from > window[1]) break;
    if (next <= window[0]) continue;
    part[0] = from > window[0] ? from : window[0];
    part[1] = next < window[1] ? next : window[1];
    return j;
  }
  return end;
}

/* One past the last piece of j's bound. */
static int wb_bound_end(const wb_crowd *crowd, int j, int end) {
  const double bound = wb_piece_at(crowd, j)[0];
  while (j < end && wb_piece_at(crowd, j)[0] == bound) ++j;
  return j;
}

static int wb_covers(const wb_crowd *crowd, int j, double until, const double *window) {
  return window[0] >= wb_piece_at(crowd, j)[1] && window[1] <= until && window[0] <= window[1];
}

/* Hull of one bound's boxes over the window; 0 when one could not be computed. */
static int wb_bound_box(const wb_crowd *crowd, int j, int end, const double *window, double *hull) {
  double part[2], box[4], ok, scratch[WB_SEPARATION_SCRATCH];
  hull[0] = hull[2] = HUGE_VAL;
  hull[1] = hull[3] = -HUGE_VAL;
  for (j = wb_next_piece(crowd, j, end, window, part); j < end;
       j = wb_next_piece(crowd, j + 1, end, window, part)) {
    const double *arg[] = {wb_piece_at(crowd, j) + 1, part};
    double *res[] = {box, &ok};
    ok = 0.0;
    if (wb_box(arg, res, 0, scratch, 0) || !(ok == 1.0)) return 0;
    if (box[0] < hull[0]) hull[0] = box[0];
    if (box[1] > hull[1]) hull[1] = box[1];
    if (box[2] < hull[2]) hull[2] = box[2];
    if (box[3] > hull[3]) hull[3] = box[3];
  }
  return 1;
}

/* A box around tube t during the window: the common part of its bounds' boxes. The whole plane where
 * nothing is known, so that the tube is then looked at. */
static void wb_tube_box(const wb_crowd *crowd, int t, const double *window, double *box) {
  const double *tube = wb_tube_at(crowd, t);
  const int end = (int)tube[3] + (int)tube[4];
  int j, next;
  box[0] = box[2] = -HUGE_VAL;
  box[1] = box[3] = HUGE_VAL;
  for (j = (int)tube[3]; j < end; j = next) {
    double hull[4];
    next = wb_bound_end(crowd, j, end);
    if (!wb_covers(crowd, j, tube[2], window)) continue;
    if (!wb_bound_box(crowd, j, next, window, hull)) continue;
    if (hull[0] > box[0]) box[0] = hull[0];
    if (hull[1] < box[1]) box[1] = hull[1];
    if (hull[2] > box[2]) box[2] = hull[2];
    if (hull[3] < box[3]) box[3] = hull[3];
  }
}

/* Four doubles per tube for one window: the same for every rectangle of its segments. */
static void wb_crowd_boxes(const wb_crowd *crowd, const double *window, double *boxes) {
  int t;
  for (t = 0; t < crowd->tubes; ++t) wb_tube_box(crowd, t, window, boxes + 4 * t);
}

/* Whether two boxes are certainly further apart than `best`. The squares err by less than 2^-50 of
 * themselves and 1e-320; neither an overflow nor a NaN says so. */
static int wb_far(const double *one, const double *other, double best) {
  const double need = (best > 0.0 ? best * best * (1.0 + 0x1p-40) : 0.0) + 1e-300;
  double x = one[0] - other[1], y = one[2] - other[3];
  if (other[0] - one[1] > x) x = other[0] - one[1];
  if (other[2] - one[3] > y) y = other[2] - one[3];
  if (!(x > 0.0)) x = 0.0;
  if (!(y > 0.0)) y = 0.0;
  return x * x + y * y > need;
}

/* Smallest gap over one bound's pieces in the window. */
static int wb_bound_gap(const wb_crowd *crowd, int j, int end, const double *window,
                        const double *rectangle, const double *car, double *smallest) {
  double part[2], gap, ok, scratch[WB_SEPARATION_SCRATCH];
  *smallest = HUGE_VAL;
  for (j = wb_next_piece(crowd, j, end, window, part); j < end;
       j = wb_next_piece(crowd, j + 1, end, window, part)) {
    const double *arg[] = {rectangle, car, wb_piece_at(crowd, j) + 1, part};
    double *res[] = {&gap, &ok};
    ok = 0.0;
    if (wb_gap(arg, res, 0, scratch, 0) || !(ok == 1.0)) return WB_NOT_COMPUTED;
    if (!(gap >= *smallest)) *smallest = gap;
  }
  return *smallest <= WB_NO_CLEARANCE ? WB_PROVED : WB_NOT_COMPUTED;
}

/* Clearance of tube t in the window: the largest of its bounds' smallest gaps. */
static int wb_tube_gap(const wb_crowd *crowd, int t, const double *window, const double *rectangle,
                       const double *car, double *largest) {
  const double *tube = wb_tube_at(crowd, t);
  const int end = (int)tube[3] + (int)tube[4];
  int j, next, cause = WB_NOT_PREDICTED;
  *largest = -WB_NO_CLEARANCE;
  for (j = (int)tube[3]; j < end; j = next) {
    double gap;
    next = wb_bound_end(crowd, j, end);
    if (!wb_covers(crowd, j, tube[2], window)) continue;
    cause = wb_bound_gap(crowd, j, next, window, rectangle, car, &gap);
    if (cause != WB_PROVED) return cause;
    if (gap > *largest) *largest = gap;
  }
  return cause;
}

/* Keeps a clearance that is smaller than all before, or that could not be proved. */
static void wb_keep(const wb_crowd *crowd, int person, int tube, double time, int cause, double gap,
                    double *nearest) {
  const double clearance = cause == WB_PROVED ? gap : -WB_NO_CLEARANCE;
  int first = tube;
  if (clearance >= nearest[WB_CLEAR_M]) return;
  while (first > 0 && (int)wb_tube_at(crowd, first - 1)[0] == person) --first;
  nearest[WB_CLEAR_M] = clearance;
  nearest[WB_CLEAR_TIME_S] = time;
  nearest[WB_CLEAR_PERSON] = person;
  nearest[WB_CLEAR_TUBE] = tube - first;
  nearest[WB_CLEAR_CAUSE] = cause;
}

/* Starts a comparison with the kinds in `mask` (bit k: kind k); nearest has WB_NEAREST doubles per
 * kind. Somebody without a tube of a kind that is asked for is never clear. */
static void wb_begin_clear(const wb_crowd *crowd, int mask, double time, double *nearest) {
  unsigned long seen[WB_KINDS] = {0};
  int kind, person, t;
  for (t = 0; t < crowd->tubes; ++t) {
    seen[(int)wb_tube_at(crowd, t)[1]] |= 1ul << (int)wb_tube_at(crowd, t)[0];
  }
  for (kind = 0; kind < WB_KINDS; ++kind, nearest += WB_NEAREST) {
    const int asked = mask >> kind & 1;
    nearest[WB_CLEAR_M] = asked ? WB_NO_CLEARANCE : -WB_NO_CLEARANCE;
    nearest[WB_CLEAR_TIME_S] = time;
    nearest[WB_CLEAR_PERSON] = nearest[WB_CLEAR_TUBE] = -1.0;
    nearest[WB_CLEAR_CAUSE] = asked ? WB_PROVED : WB_NOT_ASKED;
    for (person = 0; asked && person < crowd->people; ++person) {
      if (seen[kind] >> person & 1) continue;
      nearest[WB_CLEAR_M] = -WB_NO_CLEARANCE;
      nearest[WB_CLEAR_PERSON] = person;
      nearest[WB_CLEAR_CAUSE] = WB_NOT_PREDICTED;
      break;
    }
  }
}

/* Compares one segment: the car is in `rectangle` from `time` on, the people's times are in `window`,
 * `boxes` are wb_crowd_boxes of a window that contains this one. */
static void wb_clear_segment(const wb_crowd *crowd, int mask, const double *window,
                             const double *boxes, const double *rectangle, double time,
                             double *nearest) {
  double car[6], ok = 0.0, scratch[WB_SEPARATION_SCRATCH];
  const double *arg[] = {rectangle};
  double *res[] = {car, &ok};
  const int known = !wb_car(arg, res, 0, scratch, 0) && ok == 1.0;
  int t;
  for (t = 0; t < crowd->tubes; ++t) {
    const int person = (int)wb_tube_at(crowd, t)[0], kind = (int)wb_tube_at(crowd, t)[1];
    double *kept = nearest + WB_NEAREST * kind, gap = 0.0;
    int cause = WB_NOT_COMPUTED;
    if (!(mask >> kind & 1)) continue;
    if (known) {
      if (wb_far(car + 2, boxes + 4 * t, kept[WB_CLEAR_M])) continue;
      cause = wb_tube_gap(crowd, t, window, rectangle, car, &gap);
    }
    wb_keep(crowd, person, t, time, cause, gap, kept);
  }
}
