/* Counts calls of the heap while a compiled decision runs, and watches the process' memory.
 *
 * usage: harness KERNEL.so QUERIES QUERY RESULT CALLS; QUERIES holds whole queries of QUERY doubles each,
 * a result has RESULT doubles. The queries are decided in turns, CALLS times in all. Prints the calls of
 * malloc, calloc, realloc, free and of the aligned ones inside wb_decide, then lines "calls KiB" at the
 * start and after every hundredth part.
 *
 * What is defined here takes the place of the C library's for every object that is loaded, the kernel
 * included; the work is done by glibc's own names.
 */
#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

extern void *__libc_malloc(size_t);
extern void *__libc_calloc(size_t, size_t);
extern void *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);
extern void __libc_free(void *);

enum { MALLOC, CALLOC, REALLOC, FREE, ALIGNED, KINDS };

static volatile int counting;
static unsigned long long counts[KINDS];

static void count(int kind) {
  if (counting) ++counts[kind];
}

void *malloc(size_t size) {
  count(MALLOC);
  return __libc_malloc(size);
}

void *calloc(size_t number, size_t size) {
  count(CALLOC);
  return __libc_calloc(number, size);
}

void *realloc(void *old, size_t size) {
  count(REALLOC);
  return __libc_realloc(old, size);
}

void free(void *old) {
  count(FREE);
  __libc_free(old);
}

void *memalign(size_t alignment, size_t size) {
  count(ALIGNED);
  return __libc_memalign(alignment, size);
}

void *aligned_alloc(size_t alignment, size_t size) { return memalign(alignment, size); }

int posix_memalign(void **place, size_t alignment, size_t size) {
  *place = memalign(alignment, size);
  return *place ? 0 : ENOMEM;
}

typedef int (*decide_function)(const double *, double *, double *);
typedef long long (*size_function)(void);

static void *symbol(void *object, const char *name) {
  void *found = object ? dlsym(object, name) : NULL;
  if (!found) {
    fprintf(stderr, "%s\n", dlerror());
    exit(1);
  }
  return found;
}

static void print_memory(unsigned long long calls) {
  char line[256];
  FILE *file = fopen("/proc/self/status", "r");
  if (!file) exit(1);
  while (fgets(line, sizeof line, file))
    if (!strncmp(line, "VmRSS:", 6)) printf("%llu %s", calls, line + 6);
  fclose(file);
  fflush(stdout);
}

int main(int argc, char **argv) {
  decide_function decide;
  size_function work_size;
  size_t query_size, result_size, queries;
  unsigned long long calls, each, k;
  double *query, *result, *work;
  long bytes;
  FILE *input;
  void *object;
  int kind;
  if (argc != 6 || !(input = fopen(argv[2], "rb"))) return 2;
  object = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
  /* POSIX promises that object and function pointers convert. */
  *(void **)&decide = symbol(object, "wb_decide");
  *(void **)&work_size = symbol(object, "wb_work_size");
  query_size = strtoull(argv[3], NULL, 10);
  result_size = strtoull(argv[4], NULL, 10);
  calls = strtoull(argv[5], NULL, 10);
  if (fseek(input, 0, SEEK_END) || (bytes = ftell(input)) < 1 || fseek(input, 0, SEEK_SET)) return 1;
  queries = (size_t)bytes / sizeof(double) / query_size;
  query = malloc((size_t)bytes);
  result = calloc(result_size, sizeof(double));
  work = calloc((size_t)work_size(), sizeof(double));
  if (!queries || !query || !result || !work) return 1;
  if (fread(query, query_size * sizeof(double), queries, input) != queries) return 1;
  each = calls < 100 ? 1 : calls / 100;
  print_memory(0);
  for (k = 0; k < calls; ++k) {
    int failed;
    counting = 1;
    failed = decide(query + (size_t)(k % queries) * query_size, result, work);
    counting = 0;
    if (failed) return 1;
    if ((k + 1) % each == 0) print_memory(k + 1);
  }
  for (kind = 0; kind < KINDS; ++kind) printf("%llu ", counts[kind]);
  printf("\n");
  return 0;
}
