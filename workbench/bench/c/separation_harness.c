/* Calls wb_separate on the doubles of a file (query size, then the query), or times it.
 *
 * usage: harness INPUT ROUNDS; prints one line per round: nanoseconds per call. With ROUNDS 0 there is
 * exactly one call, for counting instructions. Compiled together with the kernel's own text.
 */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

int wb_separate(const double *query, double *result, double *work);

static double now_ns(void) {
  struct timespec t;
  timespec_get(&t, TIME_UTC);
  return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

int main(int argc, char **argv) {
  enum { CALLS = 10 };
  double count, result[64], *query, *work;
  FILE *input;
  int rounds, k, code;
  if (argc != 3 || !(input = fopen(argv[1], "rb"))) return 2;
  if (fread(&count, sizeof count, 1, input) != 1) return 2;
  query = calloc((size_t)count, sizeof *query);
  work = calloc(4096, sizeof *work);
  if (!query || !work || fread(query, sizeof *query, (size_t)count, input) != (size_t)count) return 2;
  fclose(input);
  code = wb_separate(query, result, work) ? 3 : 0;
  for (rounds = atoi(argv[2]); rounds > 0 && !code; --rounds) {
    const double start = now_ns();
    for (k = 0; k < CALLS; ++k) wb_separate(query, result, work);
    printf("%.1f\n", (now_ns() - start) / CALLS);
  }
  free(query);
  free(work);
  return code;
}
