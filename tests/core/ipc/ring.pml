/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A model of the link between the host and one worker (core/ipc/ring.hpp, core/supervise): the command ring, the result
 * ring, the slots, and the death of the worker at any step. The model is sequentially consistent; the memory orderings
 * of ring.hpp are tested with the thread sanitizer.
 *
 * Properties that are checked for every interleaving: frames return in order, and no frame is lost, duplicated or torn;
 * the worker never writes a slot while the host reads it; positions are at most one capacity apart; the host always
 * finishes.
 *
 * Each macro FAULT… plants a fault; `check-model --faults` verifies that the model detects it.
 */
#define CAPACITY 2  /* number of entries of each ring */
#define SLOTS    2
#define FRAMES   4
#define DEATHS   2  /* maximum number of deaths of the worker */
#define NOBODY   255

/* Written by the host. */
byte command_published, result_consumed;
byte command_slot[CAPACITY], command_frame[CAPACITY];
/* Written by the worker. */
byte result_published, command_consumed;
byte result_frame[CAPACITY];
/* The two halves of each slot hold a frame number, which reveals torn frames. */
byte low[SLOTS], high[SLOTS];
/* The slot that the host is reading, or NOBODY. */
byte reading = NOBODY;

bool alive = true, done;
byte deaths;

/* The worker may die at every step. */
#define may_die  if :: deaths < DEATHS -> deaths++; goto dead :: true fi

proctype worker() {
    byte position = 0, results = 0, slot, frame;
again:
    may_die;
end_waiting:
    atomic { command_published != position -> slot = command_slot[position % CAPACITY];
             frame = command_frame[position % CAPACITY]; }
    position++;
    command_consumed = position;
    may_die;
#ifdef FAULT_PUBLISH_FIRST
    result_frame[results % CAPACITY] = frame;
    results++;
    result_published = results;
#endif
    assert(reading != slot);          /* the host has released the slot */
    low[slot] = frame;
    may_die;
    assert(reading != slot);
    high[slot] = frame;
    may_die;
#ifndef FAULT_PUBLISH_FIRST
#ifndef FAULT_NO_FULL_CHECK
    assert(results - result_consumed < CAPACITY); /* the host limits the frames in flight */
#endif
    result_frame[results % CAPACITY] = frame;
    may_die;
    results++;
    result_published = results;
#endif
    goto again;
dead:
    alive = false
}

/* Receives one result, if available. */
inline take_result() {
    if
    :: result_published != result_position ->
        assert(result_published - result_position <= CAPACITY);
        assert(result_frame[result_position % CAPACITY] == expected); /* in order, not duplicated */
        slot = expected % SLOTS;
        reading = slot;
        assert(low[slot] == expected);
        assert(high[slot] == expected);                               /* not torn */
        reading = NOBODY;
        result_position++;
        result_consumed = result_position;
        expected++
    :: else
    fi
}

active proctype host() {
    byte submitted = 0;        /* frames submitted */
    byte expected = 0;         /* the next frame to return */
    byte position = 0, result_position = 0, slot;
    run worker();
    do
    :: expected == FRAMES -> break
#ifdef FAULT_REUSE_SLOT
    :: submitted < FRAMES && submitted - expected < CAPACITY + 1 && position - command_consumed < CAPACITY ->
#elif defined(FAULT_NO_FULL_CHECK)
    :: submitted < FRAMES && submitted - expected < SLOTS + 1 ->
#else
    :: submitted < FRAMES && submitted - expected < SLOTS && position - command_consumed < CAPACITY ->
#endif
        command_slot[position % CAPACITY] = submitted % SLOTS;
        command_frame[position % CAPACITY] = submitted;
        position++;
        submitted++;
        command_published = position
    :: result_published != result_position -> take_result()
    :: !alive ->
        /* Results that the worker published before its death are valid. */
        do
        :: result_published != result_position -> take_result()
        :: else -> break
        od;
        /* Creates new memory and a new worker. Unanswered frames are submitted again. */
        atomic {
            command_published = 0; command_consumed = 0; result_published = 0; result_consumed = 0;
            low[0] = NOBODY; low[1] = NOBODY; high[0] = NOBODY; high[1] = NOBODY;
            position = 0; result_position = 0;
#ifndef FAULT_LOSE_IN_FLIGHT
            submitted = expected;
#endif
            alive = true;
            run worker()
        }
    od;
    done = true
}

/* The host always finishes. Assumes weak fairness. */
ltl finishes { <> done }
