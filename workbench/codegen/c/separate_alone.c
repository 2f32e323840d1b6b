/* The separation as an entry of its own: rectangles given, no vehicle.
 *
 * query: people, tubes, skew lower, skew upper, mask, segments, then times (WB_SEGMENTS + 1),
 * rectangles (5 WB_SEGMENTS), tubes and pieces at full capacity. result: WB_NEAREST doubles per kind.
 * Returns 1, with nothing proved, for a query that makes no sense.
 */

enum { WB_S_TIMES = 6, WB_S_RECTANGLES = WB_S_TIMES + WB_SEGMENTS + 1,
       WB_S_TUBES = WB_S_RECTANGLES + 5 * WB_SEGMENTS,
       WB_S_PIECES = WB_S_TUBES + WB_TUBE_NUMBERS * WB_MOST_TUBES };

int wb_separate(const double *query, double *result, double *work) {
  wb_crowd crowd;
  const double *times = query + WB_S_TIMES;
  const double most = (1 << WB_KINDS) - 1;
  int i, k, mask;
  for (i = 0; i < WB_KINDS * WB_NEAREST; ++i) {
    result[i] = i % WB_NEAREST == WB_CLEAR_M ? -WB_NO_CLEARANCE : -1.0;
  }
  crowd.tube = query + WB_S_TUBES;
  crowd.piece = query + WB_S_PIECES;
  crowd.skew_lower = query[2];
  crowd.skew_upper = query[3];
  if (!wb_take_crowd(&crowd, query[0], query[1], WB_MOST_TUBES * WB_TUBE_PIECES)) return 1;
  if (!(query[4] >= 0.0 && query[4] <= most && query[4] == (int)query[4])) return 1;
  if (!wb_whole(query[5], WB_SEGMENTS)) return 1;
  mask = (int)query[4];
  for (k = 0; k <= (int)query[5]; ++k) {
    if (!(times[k] >= -WB_LONGEST_S && times[k] <= WB_LONGEST_S)) return 1;
    if (k && !(times[k] > times[k - 1])) return 1;
  }
  wb_begin_clear(&crowd, mask, times[0], result);
  for (k = 0; k < (int)query[5]; ++k) {
    const int last = k + WB_BLOCK < (int)query[5] ? k + WB_BLOCK : (int)query[5];
    double window[2];
    if (k % WB_BLOCK == 0) {
      wb_window(&crowd, times[k], times[last], window);
      wb_crowd_boxes(&crowd, window, work);
    }
    wb_window(&crowd, times[k], times[k + 1], window);
    wb_clear_segment(&crowd, mask, window, work, query + WB_S_RECTANGLES + 5 * k, times[k], result);
  }
  return 0;
}
