/* The waiting of MAIN_FAST. One call lasts until a cycle needs Python: a device is to be asked, a recording begins again,
   a cycle was missed. Cycles in which samples of a recording only become due are served here: they are copied into the
   ring, and MAIN_SLOW is woken where a window ends.

   The same arithmetic as FastTask, CycleStats and PeriodicTimer. */

#define _GNU_SOURCE
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

struct ticks {
    /* what does not change */
    int64_t timer, period_ns, bins, capacity, sample_bytes, late_ns;
    int64_t *counters, *head, *taken, *beats;
    char *ring;
    int64_t wake; /* eventfd; -1: the end of a window needs Python */
    double per_ns, per_window;
    /* the stretch of samples that may be written when they are due */
    const char *ahead;
    int64_t available, expected, windows, elapsed_ns, read, written;
    /* the last wake-up */
    int64_t due_ns, woke_ns, working;
};

enum { CYCLES, MISSED, EXCEEDED, LATE, SUM, LEAST, MOST, BUSY }; /* counters after the histogram */

static int64_t monotonic(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1000000000LL + now.tv_nsec;
}

/* The cycle that began with the last wake-up is over. */
static void note(struct ticks *t, int64_t expirations)
{
    int64_t *rest = t->counters + t->bins;
    const int64_t late = t->woke_ns - t->due_ns, busy = monotonic() - t->woke_ns, us = late > 0 ? late / 1000 : 0;
    t->counters[us < t->bins ? us : t->bins - 1]++;
    rest[CYCLES]++;
    rest[SUM] += us;
    rest[BUSY] += busy;
    if (us < rest[LEAST])
        rest[LEAST] = us;
    if (us > rest[MOST])
        rest[MOST] = us;
    rest[MISSED] += expirations - 1;
    rest[EXCEEDED] += busy > t->period_ns;
    rest[LATE] += late > t->period_ns / 2;
    __atomic_store_n(t->beats, *t->beats + 1, __ATOMIC_RELEASE);
}

/* Windows that end at or before sample `index`: window k ends at floor((k + 1) per_window + 1/2). */
static int64_t whole_windows(const struct ticks *t, int64_t index)
{
    return (int64_t)ceil(((double)index + 0.5) / t->per_window) - 1;
}

/* Whether all samples that are due were ahead, and nothing else is to be done. */
static int serve(struct ticks *t, int64_t expirations)
{
    const int64_t stall_ns = expirations * t->period_ns, elapsed_ns = t->elapsed_ns + stall_ns;
    const int64_t due = (int64_t)((double)elapsed_ns * t->per_ns) - t->read;
    const int64_t windows = whole_windows(t, t->expected + due);
    if (stall_ns - t->period_ns >= t->late_ns || due > t->available || (t->wake < 0 && windows > t->windows))
        return 0;
    const int64_t at = *t->head % t->capacity, first = due < t->capacity - at ? due : t->capacity - at;
    memcpy(t->ring + at * t->sample_bytes, t->ahead, (size_t)(first * t->sample_bytes));
    memcpy(t->ring, t->ahead + first * t->sample_bytes, (size_t)((due - first) * t->sample_bytes));
    __atomic_store_n(t->head, *t->head + due, __ATOMIC_RELEASE);
    *t->taken = monotonic();
    t->elapsed_ns = elapsed_ns;
    t->ahead += due * t->sample_bytes;
    t->available -= due;
    t->expected += due;
    t->read += due;
    t->written += due;
    if (windows > t->windows) {
        const uint64_t one = 1;
        t->windows = windows;
        return write((int)t->wake, &one, sizeof one) == sizeof one || errno == EAGAIN;
    }
    return 1;
}

/* Counts the cycle in progress. */
void acqd_end(struct ticks *t)
{
    if (t->working)
        note(t, t->working);
    t->working = 0;
}

/* Periods that have passed when a cycle needs Python; 0: a signal has come; -1: the timer cannot be read. */
int64_t acqd_wait(struct ticks *t)
{
    acqd_end(t);
    for (;;) {
        uint64_t expirations;
        if (read((int)t->timer, &expirations, sizeof expirations) != sizeof expirations)
            return errno == EINTR ? 0 : -1;
        t->woke_ns = monotonic();
        t->due_ns += (int64_t)expirations * t->period_ns;
        t->working = (int64_t)expirations;
        if (!t->available || !serve(t, t->working))
            return t->working;
        acqd_end(t);
    }
}

int64_t acqd_ticks_bytes(void) { return sizeof(struct ticks); }
