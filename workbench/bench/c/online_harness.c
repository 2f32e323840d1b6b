/* Times a compiled tube over all cells of a set against the compiled trajectory, interleaved, outside
 * any interpreter; or measures the stack that one call touches.
 *
 * usage: harness TUBE.so TRAJECTORY.so INPUT ROUNDS; prints one line per round: nanoseconds for all
 * queries to wb_tube and for one call of wb_trajectory. With ROUNDS 0 every query and the trajectory are
 * run exactly once, for counting instructions; with ROUNDS stack every query runs on a painted stack and
 * the bytes it touched are printed. INPUT holds doubles: the numbers of queries and of calls per round, the
 * lengths of a query, result, x0, p, w and out, then the queries, x0, p, w and h.
 */
#define _POSIX_C_SOURCE 200809L
#define _XOPEN_SOURCE 700
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <ucontext.h>

typedef int (*tube_function)(const double *, double *, double *);
typedef int (*trajectory_function)(const double *, const double *, const double *, const double *,
                                   double *);
typedef long long (*size_function)(void);

enum { TRAJECTORY_CALLS = 50, LENGTHS = 8, STACK_BYTES = 1 << 24, PAINT = 0xA5 };

static tube_function tube;
static const double *queries;
static double *result, *work;
static size_t count, query_length;
static int failures;
static unsigned char *stack_top;
static ucontext_t main_context, painted_context;

static void *symbol(const char *file, const char *name) {
  void *object = dlopen(file, RTLD_NOW | RTLD_LOCAL);
  void *found = object ? dlsym(object, name) : NULL;
  if (!found) {
    fprintf(stderr, "%s\n", dlerror());
    exit(1);
  }
  return found;
}

static double *doubles(size_t number) {
  double *memory = calloc(number + 1, sizeof(double));
  if (!memory) exit(1);
  return memory;
}

static double *read_doubles(FILE *file, size_t number) {
  double *memory = doubles(number);
  if (fread(memory, sizeof(double), number, file) != number) exit(1);
  return memory;
}

static double now_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static void all_queries(void) {
  size_t k;
  for (k = 0; k < count; ++k) {
    failures |= tube(queries + k * query_length, result, work) || result[0] != 0.0;
  }
}

/* The caller's frame lies above `here`; what the calls use begins below it. */
static void on_painted_stack(void) {
  unsigned char here;
  stack_top = &here;
  all_queries();
}

static int print_stack(void) {
  unsigned char *stack = malloc(STACK_BYTES);
  size_t untouched = 0;
  if (!stack || getcontext(&painted_context)) return 1;
  memset(stack, PAINT, STACK_BYTES);
  painted_context.uc_stack.ss_sp = stack;
  painted_context.uc_stack.ss_size = STACK_BYTES;
  painted_context.uc_link = &main_context;
  makecontext(&painted_context, on_painted_stack, 0);
  if (swapcontext(&main_context, &painted_context)) return 1;
  while (untouched < STACK_BYTES && stack[untouched] == PAINT) ++untouched;
  printf("%lld\n", (long long)(stack_top - (stack + untouched)));
  return untouched == 0;
}

int main(int argc, char **argv) {
  trajectory_function trajectory;
  FILE *input;
  double *lengths, *x0, *p, *w, *h, *out;
  size_function work_size;
  int round, rounds, k, calls;
  if (argc != 5 || !(input = fopen(argv[3], "rb"))) return 2;
  /* POSIX promises that object and function pointers convert. */
  *(void **)&work_size = symbol(argv[1], "wb_work_size");
  *(void **)&tube = symbol(argv[1], "wb_tube");
  *(void **)&trajectory = symbol(argv[2], "wb_trajectory");
  lengths = read_doubles(input, LENGTHS);
  count = (size_t)lengths[0];
  calls = (int)lengths[1];
  query_length = (size_t)lengths[2];
  queries = read_doubles(input, count * query_length);
  x0 = read_doubles(input, (size_t)lengths[4]);
  p = read_doubles(input, (size_t)lengths[5]);
  w = read_doubles(input, (size_t)lengths[6]);
  h = read_doubles(input, 1);
  result = doubles((size_t)lengths[3]);
  out = doubles((size_t)lengths[7]);
  work = doubles((size_t)work_size());
  if (!strcmp(argv[4], "stack")) return print_stack();
  rounds = atoi(argv[4]);
  if (rounds == 0) {
    all_queries();
    return failures | trajectory(x0, p, w, h, out);
  }
  for (round = 0; round < rounds; ++round) {
    double start = now_ns(), middle, end;
    for (k = 0; k < calls; ++k) all_queries();
    middle = now_ns();
    for (k = 0; k < TRAJECTORY_CALLS; ++k) failures |= trajectory(x0, p, w, h, out);
    end = now_ns();
    printf("%.3f %.3f\n", (middle - start) / calls, (end - middle) / TRAJECTORY_CALLS);
  }
  return failures;
}
