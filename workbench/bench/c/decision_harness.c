/* Times a compiled decision on many queries, each as it would be called: once, after others.
 *
 * usage: harness KERNEL.so INPUT CALLS; prints one line per query: nanoseconds of the first call and of
 * the quickest of CALLS, then the results that were asked for. INPUT holds doubles: lengths of a query,
 * of a result, of the head in front of people's tubes and of the tail behind their pieces, first place
 * of the pieces and of the tail, number of results to print, number of queries; the places of those
 * results; then per query how many numbers it has of tubes and of pieces, its head, those, and its tail.
 */
#define _POSIX_C_SOURCE 200809L
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

typedef int (*decide_function)(const double *, double *, double *);
typedef long long (*size_function)(void);

enum { QUERY, RESULT, HEAD, TAIL, PIECES_AT, TAIL_AT, PRINTED, QUERIES, LENGTHS };

static void *symbol(void *object, const char *name) {
  void *found = object ? dlsym(object, name) : NULL;
  if (!found) {
    fprintf(stderr, "%s\n", dlerror());
    exit(1);
  }
  return found;
}

static double *read_doubles(FILE *file, size_t number) {
  double *memory = calloc(number + 1, sizeof(double));
  if (!memory || fread(memory, sizeof(double), number, file) != number) exit(1);
  return memory;
}

static void fill(FILE *file, double *to, size_t number) {
  if (fread(to, sizeof(double), number, file) != number) exit(1);
}

static double now_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

/* The next query; what the one before left of its people is not cleared, nobody reads it. */
static void next_query(FILE *input, const size_t *size, double *query) {
  double counts[2];
  fill(input, counts, 2);
  fill(input, query, size[HEAD]);
  fill(input, query + size[HEAD], (size_t)counts[0]);
  fill(input, query + size[PIECES_AT], (size_t)counts[1]);
  fill(input, query + size[TAIL_AT], size[TAIL]);
}

int main(int argc, char **argv) {
  decide_function decide;
  size_function work_size;
  FILE *input;
  double *lengths, *places, *query, *result, *work;
  size_t size[LENGTHS], k, i;
  int calls, j;
  void *object;
  if (argc != 4 || !(input = fopen(argv[2], "rb"))) return 2;
  object = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
  /* POSIX promises that object and function pointers convert. */
  *(void **)&decide = symbol(object, "wb_decide");
  *(void **)&work_size = symbol(object, "wb_work_size");
  calls = atoi(argv[3]);
  lengths = read_doubles(input, LENGTHS);
  for (i = 0; i < LENGTHS; ++i) size[i] = (size_t)lengths[i];
  places = read_doubles(input, size[PRINTED]);
  query = calloc(size[QUERY], sizeof(double));
  result = calloc(size[RESULT], sizeof(double));
  work = calloc((size_t)work_size(), sizeof(double));
  if (!query || !result || !work) return 1;
  for (k = 0; k < size[QUERIES]; ++k) {
    double first = 0.0, quickest = 0.0;
    next_query(input, size, query);
    for (j = 0; j < calls; ++j) {
      const double start = now_ns();
      double taken;
      if (decide(query, result, work)) return 1;
      taken = now_ns() - start;
      if (j == 0) first = taken;
      if (j == 0 || taken < quickest) quickest = taken;
    }
    printf("%.0f %.0f", first, quickest);
    for (i = 0; i < size[PRINTED]; ++i) printf(" %.17g", result[(size_t)places[i]]);
    printf("\n");
  }
  return 0;
}
