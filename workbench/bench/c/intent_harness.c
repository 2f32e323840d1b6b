/* Times the compiled update of the particles of several people, one after the other.
 *
 * usage: harness KERNEL.so INPUT ROUNDS; prints nanoseconds of each round, in which everybody is
 * updated once from the same state. INPUT holds doubles: number of people, lengths of the arrays;
 * then per person the sizes and the arrays, in the order of intent_update.
 */
#define _POSIX_C_SOURCE 200809L
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { ARRAYS = 19, COUNTS = 4, NUMBERS = 6 };

typedef struct {
  long counts[COUNTS];
  double numbers[NUMBERS];
} sizes_t;

typedef void (*update_function)(const sizes_t *, double *, double *, double *, double *, double *, double *,
                                double *, double *, double *, double *, double *, double *, double *, double *,
                                double *, double *, double *, double *, double *);

static double *read_doubles(FILE *file, size_t number) {
  double *memory = calloc(number + 1, sizeof(double));
  if (!memory || fread(memory, sizeof(double), number, file) != number) exit(1);
  return memory;
}

static double now_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

int main(int argc, char **argv) {
  update_function update;
  FILE *input;
  void *object;
  double *head, *work, **given, *a[ARRAYS];
  sizes_t *sizes;
  size_t people, all = 0, k, i;
  long rounds, round;
  if (argc != 4 || !(input = fopen(argv[2], "rb"))) return 2;
  object = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
  if (!object) return 1;
  /* POSIX promises that object and function pointers convert. */
  *(void **)&update = dlsym(object, "intent_update");
  if (!update) return 1;
  rounds = atol(argv[3]);
  head = read_doubles(input, 1 + ARRAYS);
  people = (size_t)head[0];
  for (i = 0; i < ARRAYS; ++i) all += (size_t)head[1 + i];
  sizes = calloc(people, sizeof(sizes_t));
  given = calloc(people, sizeof(double *));
  work = calloc(all, sizeof(double));
  if (!sizes || !given || !work) return 1;
  for (k = 0; k < people; ++k) {
    double *numbers = read_doubles(input, COUNTS + NUMBERS);
    for (i = 0; i < COUNTS; ++i) sizes[k].counts[i] = (long)numbers[i];
    memcpy(sizes[k].numbers, numbers + COUNTS, sizeof sizes[k].numbers);
    given[k] = read_doubles(input, all);
    free(numbers);
  }
  a[0] = work;
  for (i = 1; i < ARRAYS; ++i) a[i] = a[i - 1] + (size_t)head[i];
  for (round = 0; round < rounds; ++round) {
    double spent = 0.0, start;
    for (k = 0; k < people; ++k) {
      memcpy(work, given[k], all * sizeof(double));
      start = now_ns();
      update(&sizes[k], a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8], a[9], a[10], a[11], a[12], a[13],
             a[14], a[15], a[16], a[17], a[18]);
      spent += now_ns() - start;
    }
    printf("%.0f\n", spent);
  }
  return 0;
}
