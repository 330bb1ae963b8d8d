/* Stall witness: wakes every millisecond on one core, above everything else, and writes
 * down when it was itself more than 0.2 ms late: then the machine took the time.
 *
 *     witness CORE SECONDS > file      lines: monotonic time [ns], lateness [ns]
 */
#define _GNU_SOURCE
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>

#define PERIOD_NS 1000000LL
#define LATE_NS 200000LL

static long long now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

int main(int argc, char **argv)
{
    if (argc != 3)
        return 2;
    cpu_set_t cores;
    CPU_ZERO(&cores);
    CPU_SET(atoi(argv[1]), &cores);
    sched_setaffinity(0, sizeof cores, &cores);
    struct sched_param above = {.sched_priority = 99};
    if (sched_setscheduler(0, SCHED_FIFO, &above))
        perror("SCHED_FIFO");
    mlockall(MCL_CURRENT | MCL_FUTURE);
    long long next = now_ns(), end = next + atof(argv[2]) * 1e9;
    while (next < end) {
        next += PERIOD_NS;
        struct timespec until = {next / 1000000000LL, next % 1000000000LL};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
        long long late = now_ns() - next;
        if (late > LATE_NS) {
            printf("%lld %lld\n", next + late, late);
            fflush(stdout);
            next += late / PERIOD_NS * PERIOD_NS;
        }
    }
    return 0;
}
