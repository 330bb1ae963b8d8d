/* A 500 Hz loop in C: only waking up, or the whole exchange with a served arm.
 *
 *     exchange CORE SECONDS [SOCKET]
 *
 * Prints one line per cycle: deadline, wake-up, seventh position, torques sent [ns];
 * zeros where there is no socket or a position was missing after 1.5 ms.
 */
#define _GNU_SOURCE
#include <poll.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>

#define PERIOD_NS 2000000LL
#define GIVE_UP_NS 1500000LL
#define LARGEST 400000

struct frame {
    uint32_t id;
    uint8_t length, gap[3], data[8];
};

static long long now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

static void send_frame(int bus, uint32_t id, int length, const uint8_t *data)
{
    struct frame out = {.id = id, .length = length};
    memcpy(out.data, data, length);
    if (send(bus, &out, sizeof out, 0) < 0)
        perror("send");
}

static long long positions(int bus, long long deadline)
{
    int seen = 0;
    struct frame in;
    while (seen != 0x7F) {
        long long left = deadline + GIVE_UP_NS - now_ns();
        if (left <= 0)
            return 0;
        struct pollfd wait = {.fd = bus, .events = POLLIN};
        struct timespec most = {0, left};
        if (ppoll(&wait, 1, &most, NULL) <= 0)
            return 0;
        while (recv(bus, &in, sizeof in, MSG_DONTWAIT) == sizeof in)
            for (int node = 1; node <= 7; node++)
                if (in.id == 0x403u + 0x20u * node)
                    seen |= 1 << (node - 1);
    }
    return now_ns();
}

int main(int argc, char **argv)
{
    if (argc < 3)
        return 2;
    int bus = -1;
    if (argc > 3) {
        struct sockaddr_un path = {.sun_family = AF_UNIX};
        strncpy(path.sun_path, argv[3], sizeof path.sun_path - 1);
        bus = socket(AF_UNIX, SOCK_SEQPACKET, 0);
        if (connect(bus, (struct sockaddr *)&path, sizeof path)) {
            perror(argv[3]);
            return 1;
        }
    }
    static long long rows[LARGEST][4];
    cpu_set_t cores;
    CPU_ZERO(&cores);
    CPU_SET(atoi(argv[1]), &cores);
    sched_setaffinity(0, sizeof cores, &cores);
    struct sched_param priority = {.sched_priority = 80};
    if (sched_setscheduler(0, SCHED_FIFO, &priority))
        perror("SCHED_FIFO");
    mlockall(MCL_CURRENT | MCL_FUTURE);
    const uint8_t get_p = 0x30, get_ft = 0x36, torques[8] = {0xAA};
    struct frame stale;
    int count = 0;
    long long next = now_ns() + PERIOD_NS, end = next + atof(argv[2]) * 1e9;
    while (next < end && count < LARGEST) {
        struct timespec until = {next / 1000000000LL, next % 1000000000LL};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
        long long *row = rows[count++], woke = now_ns();
        if (woke - next >= PERIOD_NS)
            next += (woke - next) / PERIOD_NS * PERIOD_NS;
        row[0] = next;
        row[1] = woke;
        if (bus >= 0) {
            while (recv(bus, &stale, sizeof stale, MSG_DONTWAIT) > 0)
                ;
            send_frame(bus, 0x404, 1, &get_p);
            send_frame(bus, 0x008, 1, &get_ft);
            row[2] = positions(bus, woke);
            if (row[2]) {
                send_frame(bus, 0x401, 8, torques);
                send_frame(bus, 0x402, 8, torques);
                row[3] = now_ns();
            }
        }
        next += PERIOD_NS;
    }
    for (int i = 0; i < count; i++)
        printf("%lld %lld %lld %lld\n", rows[i][0], rows[i][1], rows[i][2], rows[i][3]);
    return 0;
}
