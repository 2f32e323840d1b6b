/* Classical Runge-Kutta steps of the single-track field, which CasADi wrote above.
 *
 * x: 9 doubles, x y heading v_x v_y yaw_rate steering slip_front slip_rear, read and written; u:
 * acceleration and steering rate; p: parameters, the last one the steering limit. The field does not
 * push a standing car backwards; what a step overshoots is set back to v_x = 0. Once it stands and
 * nothing pushes it forwards, a car that hardly slides (below WB_STILL m/s and rad/s) is at rest.
 */
#define N 9
#define WB_STILL 0.01

static double wb_within(double value, double limit) {
  return value > limit ? limit : value < -limit ? -limit : value;
}

static void wb_rest(double *x, const double *dx) {
  if (x[3] < 0.0) x[3] = 0.0;
  if (x[3] == 0.0 && dx[3] <= 0.0 && fabs(x[4]) < WB_STILL && fabs(x[5]) < WB_STILL) {
    x[4] = x[5] = x[7] = x[8] = 0.0;
  }
}

int wb_advance(double *x, const double *u, const double *p, double duration_s, long long steps) {
  double w[WB_SCRATCH], k[4][N], at[N];
  static const double reach[4] = {0.0, 0.5, 0.5, 1.0};
  const double h = duration_s / (double)steps;
  const double *arg[3] = {at, u, p};
  double *res[1];
  long long n;
  int i, j;
  for (n = 0; n < steps; ++n) {
    for (j = 0; j < 4; ++j) {
      for (i = 0; i < N; ++i) at[i] = x[i] + (j ? reach[j] * h * k[j - 1][i] : 0.0);
      res[0] = k[j];
      if (single_track(arg, res, 0, w, 0)) return 1;
    }
    for (i = 0; i < N; ++i) x[i] += h / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
    x[6] = wb_within(x[6], p[WB_LIMIT]);
    wb_rest(x, k[3]);
  }
  return 0;
}
