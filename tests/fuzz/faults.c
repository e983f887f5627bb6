/* System calls that fail, and a clock that is wrong: loaded before the C library (LD_PRELOAD).

   FAULTS_IN     folder: only calls about files below it are noted, and fail
   FAULTS_LOG    file to which every such call is noted: operation, site, path, Python's traceback
   FAULTS_FAIL   "OPERATION SITE ERRNO TIMES": what fails; "any" is every site, 0 times is always
   FAULTS_CLOCK  "OFFSET AFTER JUMP": s added to the date, and s after which it jumps by s more

   A site is the hash of the operation and of the lines of Python that lead to it. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
static __thread int inside; /* the calls of this library itself */
static int failed;

static void traceback(char *text, size_t size) {
  void *(*state)(void) = (void *(*)(void))dlsym(RTLD_DEFAULT, "PyGILState_GetThisThreadState");
  void (*dump)(int, void *) = (void (*)(int, void *))dlsym(RTLD_DEFAULT, "_Py_DumpTraceback");
  int file = state && dump && state() ? memfd_create("traceback", 0) : -1;
  ssize_t length = 0;
  if (file >= 0) {
    dump(file, state());
    length = pread(file, text, size - 1, 0);
    close(file);
  }
  text[length > 0 ? length : 0] = 0;
}

static int fails_here(const char *operation, const char *path) {
  const char *log = getenv("FAULTS_LOG"), *fail = getenv("FAULTS_FAIL");
  char text[1 << 15], line[(1 << 15) + PATH_MAX + 100], site[17], what[20], where[20];
  uint64_t hash = 14695981039346656037u; /* FNV-1a */
  int code, times;
  traceback(text, sizeof text);
  for (const char *c = operation; *c; c++) hash = (hash ^ (uint8_t)*c) * 1099511628211u;
  for (const char *c = text; *c; c++) hash = (hash ^ (uint8_t)*c) * 1099511628211u;
  snprintf(site, sizeof site, "%016lx", (unsigned long)hash);
  int now = fail && sscanf(fail, "%19s %19s %d %d", what, where, &code, &times) == 4 &&
            !strcmp(what, operation) && (!strcmp(where, "any") || !strcmp(where, site)) &&
            (!times || __atomic_fetch_add(&failed, 1, __ATOMIC_SEQ_CST) < times);
  if (log) {
    int file = open(log, O_WRONLY | O_CREAT | O_APPEND, 0600);
    int n = snprintf(line, sizeof line, "@ %s %s %d %s\n%s", operation, site, now, path, text);
    if (file < 0 || write(file, line, n) != n || close(file)) abort();
  }
  if (now) errno = code;
  return now;
}

static int fails(const char *operation, const char *path) {
  const char *folder = getenv("FAULTS_IN");
  char full[PATH_MAX + 1] = "";
  int before = errno;
  if (inside || !folder || !path) return 0;
  inside = 1;
  if (*path != '/' && getcwd(full, sizeof full)) {
    strncat(full, "/", PATH_MAX - strlen(full));
    strncat(full, path, PATH_MAX - strlen(full));
    path = full;
  }
  size_t n = strlen(folder);
  int below = !strncmp(path, folder, n) && (!path[n] || path[n] == '/');
  int found = below && fails_here(operation, path);
  inside = 0;
  if (!found) errno = before;
  return found;
}

static int fails_of(const char *operation, int file) {
  char link[40], path[PATH_MAX + 1];
  int before = errno;
  if (inside || !getenv("FAULTS_IN")) return 0;
  snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  ssize_t length = readlink(link, path, PATH_MAX);
  errno = before;
  if (length < 0 || *path != '/') return 0; /* no file */
  path[length] = 0;
  return fails(operation, path);
}

#define OPENS(name, kinds, values)                                                              \
  int name kinds {                                                                              \
    va_list rest;                                                                               \
    va_start(rest, flags);                                                                      \
    mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, mode_t) : 0;                     \
    va_end(rest);                                                                               \
    if ((flags & (O_WRONLY | O_RDWR | O_CREAT)) && fails("open", path)) return -1;              \
    return NEXT(name) values;                                                                   \
  }
OPENS(open, (const char *path, int flags, ...), (path, flags, mode))
OPENS(open64, (const char *path, int flags, ...), (path, flags, mode))
OPENS(openat, (int at, const char *path, int flags, ...), (at, path, flags, mode))
OPENS(openat64, (int at, const char *path, int flags, ...), (at, path, flags, mode))

#define FILES(type, operation, name, kinds, values) \
  type name kinds { return fails_of(#operation, file) ? -1 : NEXT(name) values; }
FILES(ssize_t, read, read, (int file, void *data, size_t n), (file, data, n))
FILES(ssize_t, write, write, (int file, const void *data, size_t n), (file, data, n))
FILES(ssize_t, write, pwrite, (int file, const void *data, size_t n, off_t at), (file, data, n, at))
FILES(ssize_t, write, pwrite64, (int file, const void *data, size_t n, off64_t at),
      (file, data, n, at))
FILES(ssize_t, write, writev, (int file, const struct iovec *parts, int n), (file, parts, n))
FILES(int, fsync, fsync, (int file), (file))
FILES(int, flock, flock, (int file, int how), (file, how))

int close(int file) {
  int found = fails_of("close", file), code = errno;
  int status = NEXT(close)(file); /* the descriptor is gone in any case */
  if (found) errno = code;
  return found ? -1 : status;
}

#define PATHS(operation, name, kinds, values) \
  int name kinds { return fails(#operation, path) ? -1 : NEXT(name) values; }
PATHS(rename, rename, (const char *old, const char *path), (old, path))
PATHS(rename, renameat, (int from, const char *old, int to, const char *path), (from, old, to, path))
PATHS(link, link, (const char *old, const char *path), (old, path))
PATHS(link, linkat, (int from, const char *old, int to, const char *path, int flags),
      (from, old, to, path, flags))
PATHS(unlink, unlink, (const char *path), (path))
PATHS(mkdir, mkdir, (const char *path, mode_t mode), (path, mode))
PATHS(chmod, chmod, (const char *path, mode_t mode), (path, mode))

static double moved(void) {
  static double start;
  double offset, after, jump;
  const char *text = getenv("FAULTS_CLOCK");
  struct timespec now;
  if (!text || sscanf(text, "%lf %lf %lf", &offset, &after, &jump) != 3) return 0;
  NEXT(clock_gettime)(CLOCK_MONOTONIC, &now);
  double here = now.tv_sec + 1e-9 * now.tv_nsec;
  if (!start) start = here;
  return offset + (here - start > after ? jump : 0);
}

int clock_gettime(clockid_t clock, struct timespec *now) {
  int status = NEXT(clock_gettime)(clock, now);
  if (clock == CLOCK_REALTIME) now->tv_sec += moved();
  return status;
}
time_t time(time_t *out) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (out) *out = now.tv_sec;
  return now.tv_sec;
}
int gettimeofday(struct timeval *now, void *zone) {
  int status = NEXT(gettimeofday)(now, zone);
  now->tv_sec += moved();
  return status;
}
