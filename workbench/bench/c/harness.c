/* Times two compiled kernels against each other, interleaved, outside any interpreter.
 *
 * usage: harness TUBE.so TRAJECTORY.so INPUT ROUNDS; prints one line per round: nanoseconds per call of
 * wb_tube and of wb_trajectory. INPUT holds doubles: the lengths of query, result, x0, p, w and out, then
 * query, x0, p, w and h. With ROUNDS 0 each kernel is called exactly once, for counting instructions.
 */
#define _POSIX_C_SOURCE 200809L
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

typedef int (*tube_function)(const double *, double *, double *);
typedef int (*trajectory_function)(const double *, const double *, const double *, const double *,
                                   double *);
typedef long long (*size_function)(void);

enum { TUBE_CALLS = 5, TRAJECTORY_CALLS = 50, LENGTHS = 6 };

static void *symbol(const char *file, const char *name) {
  void *object = dlopen(file, RTLD_NOW | RTLD_LOCAL);
  void *found = object ? dlsym(object, name) : NULL;
  if (!found) {
    fprintf(stderr, "%s\n", dlerror());
    exit(1);
  }
  return found;
}

static double *doubles(size_t count) {
  double *memory = calloc(count + 1, sizeof(double));
  if (!memory) exit(1);
  return memory;
}

static double *read_doubles(FILE *file, size_t count) {
  double *memory = doubles(count);
  if (fread(memory, sizeof(double), count, file) != count) exit(1);
  return memory;
}

static double now_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

int main(int argc, char **argv) {
  size_function work_size;
  tube_function tube;
  trajectory_function trajectory;
  FILE *input;
  double *lengths, *query, *result, *work, *x0, *p, *w, *h, *out;
  int round, rounds, k, failures = 0;
  if (argc != 5 || !(input = fopen(argv[3], "rb"))) return 2;
  /* POSIX promises that object and function pointers convert. */
  *(void **)&work_size = symbol(argv[1], "wb_work_size");
  *(void **)&tube = symbol(argv[1], "wb_tube");
  *(void **)&trajectory = symbol(argv[2], "wb_trajectory");
  lengths = read_doubles(input, LENGTHS);
  query = read_doubles(input, (size_t)lengths[0]);
  x0 = read_doubles(input, (size_t)lengths[2]);
  p = read_doubles(input, (size_t)lengths[3]);
  w = read_doubles(input, (size_t)lengths[4]);
  h = read_doubles(input, 1);
  result = doubles((size_t)lengths[1]);
  out = doubles((size_t)lengths[5]);
  work = doubles((size_t)work_size());
  rounds = atoi(argv[4]);
  if (rounds == 0) return tube(query, result, work) | trajectory(x0, p, w, h, out);
  for (round = 0; round < rounds; ++round) {
    double start = now_ns(), middle, end;
    for (k = 0; k < TUBE_CALLS; ++k) failures |= tube(query, result, work);
    middle = now_ns();
    for (k = 0; k < TRAJECTORY_CALLS; ++k) failures |= trajectory(x0, p, w, h, out);
    end = now_ns();
    printf("%.3f %.3f\n", (middle - start) / TUBE_CALLS, (end - middle) / TRAJECTORY_CALLS);
  }
  return failures || result[0] != 0.0;
}
