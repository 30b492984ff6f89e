/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Faults that tools/faults injects. It sends SIGRTMIN with a number: the low byte selects the fault at the next frame
 * (enum misbehaviour), the other bytes are a seed. If several signals arrive before a frame, the last one is used.
 */
#ifndef ARHOST_TEST_MISBEHAVE_H
#define ARHOST_TEST_MISBEHAVE_H

#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <fcntl.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

/* The order must be the same as in tools/faults. */
enum misbehaviour {
    MISBEHAVE_CRASH = 1,
    MISBEHAVE_EXIT,
    MISBEHAVE_HANG,        /* never returns; ignores SIGABRT if the seed is odd */
    MISBEHAVE_SLOW,        /* responds late, but within the timeout */
    MISBEHAVE_ERROR,       /* returns an error status for the frame */
    MISBEHAVE_MESSAGE,     /* sends malformed messages to the host */
    MISBEHAVE_PASS,        /* sends messages of all types, with file descriptors */
    MISBEHAVE_RING,        /* writes random data to the memory shared with the host */
    MISBEHAVE_DOORBELL,    /* floods the doorbell */
    MISBEHAVE_CLOSE,       /* closes the control channel */
    MISBEHAVE_DESCRIPTORS, /* opens as many file descriptors as possible and keeps them open */
    MISBEHAVE_MEMORY       /* allocates as much as possible, then frees it */
};

static volatile sig_atomic_t misbehave_request;

static void misbehave_on_signal(int number, siginfo_t *info, void *context) {
    (void)number, (void)context;
    misbehave_request = info->si_value.sival_int;
}

static inline void misbehave_install(void) {
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_sigaction = misbehave_on_signal;
    action.sa_flags = SA_SIGINFO | SA_RESTART;
    sigaction(SIGRTMIN, &action, NULL);
}

static inline uint32_t misbehave_random(uint32_t *seed) {
    *seed = *seed * 1664525u + 1013904223u;
    return *seed >> 8;
}

/* Sends a message, optionally with four descriptors. */
static inline void misbehave_send(const char *text, size_t size, int with_descriptors) {
    enum { control = 3, count = 4 };
    char ancillary[CMSG_SPACE(sizeof(int) * count)] __attribute__((aligned(8)));
    struct iovec part;
    struct msghdr message;
    int fds[count], i;
    memset(&message, 0, sizeof message);
    memset(ancillary, 0, sizeof ancillary);
    part.iov_base = (void *)(uintptr_t)text;
    part.iov_len = size;
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    if (with_descriptors) {
        for (i = 0; i < count; ++i)
            fds[i] = open("/dev/null", O_RDWR | O_CLOEXEC);
        message.msg_control = ancillary;
        message.msg_controllen = sizeof ancillary;
        CMSG_FIRSTHDR(&message)->cmsg_level = SOL_SOCKET;
        CMSG_FIRSTHDR(&message)->cmsg_type = SCM_RIGHTS;
        CMSG_FIRSTHDR(&message)->cmsg_len = CMSG_LEN(sizeof fds);
        memcpy(CMSG_DATA(CMSG_FIRSTHDR(&message)), fds, sizeof fds);
    }
    (void)!sendmsg(control, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
    for (i = 0; with_descriptors && i < count; ++i)
        close(fds[i]);
}

static inline void misbehave_message(uint32_t seed, int with_descriptors) {
    static const char *const texts[] = {"{\"type\": \"log\", \"severity\": 1, \"text\": \"a word\"}",
                                        "{\"type\": \"detached\"}",
                                        "{\"type\": ",
                                        "{\"type\": \"log\", \"severity\": [], \"text\": {}}",
                                        "{\"type\": \"hello\", \"descriptor\": 7}",
                                        "{\"type\": \"ready\"}",
                                        "{\"type\": \"attached\", \"is_output\": true, \"generation\": 99}",
                                        "{\"type\": \"stopped\", \"status\": 1, \"text\": \"\"}",
                                        "[[[[[[[[[[[[[[[["};
    const size_t count = sizeof texts / sizeof *texts;
    const size_t choice = misbehave_random(&seed) % (count + 1);
    char garbage[4096];
    size_t i;
    if (choice < count) {
        misbehave_send(texts[choice], strlen(texts[choice]), with_descriptors);
        return;
    }
    for (i = 0; i < sizeof garbage; ++i)
        garbage[i] = (char)misbehave_random(&seed);
    misbehave_send(garbage, sizeof garbage, with_descriptors);
}

/* Corrupts only the page that contains the rings, because a plugin may write anything to images. */
static inline void misbehave_scribble(uint32_t seed) {
    FILE *maps = fopen("/proc/self/maps", "r");
    char line[512], mode[8];
    unsigned long begin, end;
    while (maps && fgets(line, sizeof line, maps)) {
        if (!strstr(line, "memfd:arhost-worker-page") || sscanf(line, "%lx-%lx %7s", &begin, &end, mode) != 3 ||
            mode[1] != 'w')
            continue;
        {
            uint64_t *words = (uint64_t *)begin;
            const size_t count = (end - begin) / sizeof *words;
            size_t i;
            switch (misbehave_random(&seed) % 4) {
            case 0:
                for (i = 0; i < count; ++i)
                    words[i] = misbehave_random(&seed) * UINT64_C(0x9e3779b97f4a7c15);
                break;
            case 1:
                words[misbehave_random(&seed) % count] = misbehave_random(&seed);
                break;
            case 2:
                words[8] += 1 + misbehave_random(&seed) % 20; /* number of results; see struct WorkerPage */
                break;
            default:
                madvise(words, end - begin, MADV_REMOVE);
            }
        }
    }
    if (maps)
        fclose(maps);
}

static inline void misbehave_sleep_ms(long ms) {
    struct timespec time;
    time.tv_sec = ms / 1000;
    time.tv_nsec = ms % 1000 * 1000000;
    nanosleep(&time, NULL);
}

static inline void misbehave_fill_memory(void) {
    enum { step = 1 << 20, max_steps = 4096 };
    void *first = NULL;
    int i;
    for (i = 0; i < max_steps; ++i) {
        void **bytes = (void **)malloc(step);
        if (!bytes)
            break;
        memset(bytes, 1, step);
        *bytes = first;
        first = bytes;
    }
    while (first) {
        void *next = *(void **)first;
        free(first);
        first = next;
    }
}

/* Must be called once per frame. Returns non-zero if the plugin must return an error for the frame. */
static inline int misbehave_if_requested(void) {
    const uint32_t request = (uint32_t)misbehave_request;
    const uint32_t seed = request >> 8;
    int i;
    misbehave_request = 0;
    switch (request & 0xff) {
    case MISBEHAVE_CRASH:
        signal(SIGSEGV, SIG_DFL);
        raise(SIGSEGV);
        break;
    case MISBEHAVE_EXIT:
        _exit((int)(seed & 1));
    case MISBEHAVE_HANG:
        if (seed & 1)
            signal(SIGABRT, SIG_IGN);
        for (;;)
            pause();
    case MISBEHAVE_SLOW:
        misbehave_sleep_ms(20 + (long)(seed % 200));
        break;
    case MISBEHAVE_ERROR:
        return 1;
    case MISBEHAVE_MESSAGE:
        misbehave_message(seed, 0);
        break;
    case MISBEHAVE_PASS:
        for (i = 0; i < 8; ++i)
            misbehave_message(seed + (uint32_t)i, 1);
        break;
    case MISBEHAVE_RING:
        misbehave_scribble(seed);
        break;
    case MISBEHAVE_DOORBELL:
        for (i = 0; i < 20000; ++i)
            (void)!write(4, "!", 1); /* a pipe */
        break;
    case MISBEHAVE_CLOSE:
        close(3);
        break;
    case MISBEHAVE_DESCRIPTORS:
        while (open("/dev/null", O_RDONLY | O_CLOEXEC) >= 0) {
        }
        break;
    case MISBEHAVE_MEMORY:
        misbehave_fill_memory();
        break;
    default:
        break;
    }
    return 0;
}

#endif
