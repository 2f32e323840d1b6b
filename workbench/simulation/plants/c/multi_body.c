/* Runge-Kutta steps of the multi-body field, which CasADi traced from the package; 29 states.
 *
 * x: as in the package, except that x[3] is the speed along the body throughout. rolling_...: the
 * package's dynamic branch; creeping_...: its kinematic one, below WB_CREEP m/s; each for drive and
 * brake. While a car creeps the package leaves yaw rate, lateral speeds and wheels to themselves;
 * here they follow the road. u: steering rate and acceleration, as in the package. p: arms to front
 * and rear axle, tracks front and rear, wheel radius, steering limit, and the time constant of a
 * rolling wheel over its speed, s / (m/s), which sets the step.
 */
#define N 29
#define WB_CREEP 0.1
#define WB_LONGEST_S 0.001
#define WB_STABLE 1.5
#define WB_LEAST_MPS 0.02

typedef int (*wb_field)(const double **, double **, casadi_int *, double *, int);

static double wb_yaw_rate(const double *x, const double *p) {
  return x[3] * tan(x[2]) / (p[0] + p[1]);
}

/* The package's kinematic branch counts speed along the path of the centre of mass. */
static double wb_along(const double *x, const double *p) {
  return cos(atan(tan(x[2]) * p[1] / (p[0] + p[1])));
}

static int wb_rates(int creeps, const double *x, const double *u, const double *p, double *dx) {
  static const wb_field fields[4] = {rolling_brake, rolling_drive, creeping_brake, creeping_drive};
  double w[WB_SCRATCH], at[N], along = 1.0;
  const double *arg[2] = {at, u};
  double *res[1] = {dx};
  int status;
  memcpy(at, x, sizeof at);
  if (creeps) {
    along = wb_along(x, p);
    at[3] /= along;
  }
  status = fields[2 * creeps + (u[1] > 0.0)](arg, res, 0, w, 0);
  dx[3] *= along;
  return status;
}

static void wb_follow_road(double *x, const double *p) {
  const double c = cos(x[2]), s = sin(x[2]);
  double front;
  x[5] = wb_yaw_rate(x, p);
  x[10] = p[1] * x[5];
  x[15] = front = x[10] + p[0] * x[5];
  x[20] = 0.0;
  x[23] = ((x[3] + 0.5 * p[2] * x[5]) * c + front * s) / p[4];
  x[24] = ((x[3] - 0.5 * p[2] * x[5]) * c + front * s) / p[4];
  x[25] = (x[3] + 0.5 * p[3] * x[5]) / p[4];
  x[26] = (x[3] - 0.5 * p[3] * x[5]) / p[4];
}

/* As far as the slowest wheel's slip, the stiffest part, lets the integration be stable. */
static double wb_step(const double *x, const double *p) {
  double slowest = x[3] - 0.5 * p[2] * fabs(x[5]), step;
  if (slowest < WB_LEAST_MPS) slowest = WB_LEAST_MPS;
  step = WB_STABLE * p[6] * slowest;
  return step < WB_LONGEST_S ? step : WB_LONGEST_S;
}

static void wb_settle(int creeps, double *x, const double *p) {
  int i;
  if (x[3] < 0.0) x[3] = 0.0;
  if (x[2] > p[5]) x[2] = p[5];
  if (x[2] < -p[5]) x[2] = -p[5];
  for (i = 23; i < 27; ++i) {
    if (x[i] < 0.0) x[i] = 0.0;
  }
  if (creeps) wb_follow_road(x, p);
}

/* The number of steps; -1 where a field cannot be evaluated. */
int wb_advance(double *x, const double *u, const double *p, double duration_s) {
  static const double reach[4] = {0.0, 0.5, 0.5, 1.0};
  double k[4][N], at[N], left = duration_s;
  int i, j, steps = 0;
  while (left > 0.0) {
    const int creeps = x[3] < WB_CREEP;
    double h = creeps ? WB_LONGEST_S : wb_step(x, p);
    if (h > 0.999999 * left) h = left;
    if (creeps) wb_follow_road(x, p);
    for (j = 0; j < 4; ++j) {
      for (i = 0; i < N; ++i) at[i] = x[i] + (j ? reach[j] * h * k[j - 1][i] : 0.0);
      if (wb_rates(creeps, at, u, p, k[j])) return -1;
    }
    for (i = 0; i < N; ++i) x[i] += h / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
    wb_settle(creeps, x, p);
    left -= h;
    ++steps;
  }
  return steps;
}
