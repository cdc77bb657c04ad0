// SPDX-License-Identifier: MIT
// Preloaded into a program under test: a disk that takes SLOW_DISK_MS for each file that is made durable, and a wall clock that jumps by a day, back
// and forth, each time it is read where JUMPING_CLOCK is set.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static void* next_of(const char* name) {
    return dlsym(RTLD_NEXT, name);
}

static void be_slow(void) {
    const char* const ms = getenv("SLOW_DISK_MS");
    if (ms) usleep((useconds_t)atoi(ms) * 1000);
}

int fsync(int fd) {
    be_slow();
    return ((int (*)(int))next_of("fsync"))(fd);
}

int fdatasync(int fd) {
    be_slow();
    return ((int (*)(int))next_of("fdatasync"))(fd);
}

static time_t jump_s(void) {
    static atomic_int reads;
    const int days[] = {0, 1, -1, 400};
    return getenv("JUMPING_CLOCK") ? days[atomic_fetch_add(&reads, 1) % 4] * 86400 : 0;
}

int clock_gettime(clockid_t clock, struct timespec* now) {
    const int error = ((int (*)(clockid_t, struct timespec*))next_of("clock_gettime"))(clock, now);
    if (clock == CLOCK_REALTIME) now->tv_sec += jump_s();
    return error;
}

int gettimeofday(struct timeval* restrict now, void* restrict zone) {
    const int error = ((int (*)(struct timeval*, void*))next_of("gettimeofday"))(now, zone);
    now->tv_sec += jump_s();
    return error;
}

time_t time(time_t* now) {
    const time_t jumped = ((time_t(*)(time_t*))next_of("time"))(NULL) + jump_s();
    if (now) *now = jumped;
    return jumped;
}
