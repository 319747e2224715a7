/* The yardstick of the benchmark: Q-learning (Eq. 1) as one would write it in C for speed.
 *
 * It has the semantics and the bits of replication/learning/reference.py. The
 * number of actions is a compile-time constant (-DACTIONS=4), tables are contiguous, the random
 * stream stays in registers. Of four ways to choose the greedy action this was the fastest: its
 * branches are mostly foreseen, so that the next step begins before the present one is done.
 */

#include <math.h>
#include <stdint.h>

#ifndef ACTIONS
#define ACTIONS 4
#endif

typedef struct {
    int64_t states, start, goal, episodes, horizon;
    double beta, gamma, tolerance;
    uint64_t threshold; /* explore if the high half of the draw is below this */
    int64_t random_ties;
} task;

static inline uint64_t rotate(uint64_t word, int bits) {
    return word << bits | word >> (64 - bits);
}

static inline uint64_t draw(uint64_t s[4]) {
    const uint64_t word = rotate(s[0] + s[3], 23) + s[0], t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = rotate(s[3], 45);
    return word;
}

static inline double best_of(const double *row) {
    double best = row[0];
    for (int a = 1; a < ACTIONS; a++) best = row[a] > best ? row[a] : best;
    return best;
}

static inline int64_t choose(const double *row, uint64_t word, const task *k) {
    const uint64_t low = word & 0xffffffff;
    if (word >> 32 < k->threshold) return (int64_t)(low * ACTIONS >> 32);
    double best = row[0];
    uint64_t ties = 0;
    int64_t action = 0;
    for (int a = 1; a < ACTIONS; a++) {
        if (row[a] > best) best = row[a], action = a;
    }
    const double least = best - k->tolerance * fabs(best);
    for (int a = 0; a < ACTIONS; a++) ties += row[a] >= least;
    if (ties > 1) {
        const uint64_t pick = k->random_ties ? low * ties >> 32 : 0;
        uint64_t seen = 0;
        action = 0;
        for (int a = 0; a < ACTIONS - 1; a++) action += (seen += row[a] >= least) <= pick;
    }
    return action;
}

/* next_state, weights, q [states, ACTIONS]; stream [4]; returns the number of steps, and counts in
 * collisions those that end where they began */
int64_t learn(const task *k, const int64_t *restrict next_state, const double *restrict weights,
              double *restrict q, uint64_t *restrict stream, int64_t *restrict collisions) {
    uint64_t s[4] = {stream[0], stream[1], stream[2], stream[3]};
    int64_t steps = 0, hits = 0;
    for (int64_t episode = 0; episode < k->episodes; episode++) {
        int64_t state = k->start;
        for (int64_t t = 0; t < k->horizon; t++) {
            double *row = q + state * ACTIONS;
            const int64_t action = choose(row, draw(s), k);
            const int64_t next = next_state[state * ACTIONS + action];
            const int goal = next == k->goal;
            const double value = goal ? 0.0 : best_of(q + next * ACTIONS);
            const double target = weights[state * ACTIONS + action] + k->gamma * value;
            row[action] += k->beta * (target - row[action]);
            steps++;
            hits += next == state;
            state = next;
            if (goal) break;
        }
    }
    for (int i = 0; i < 4; i++) stream[i] = s[i];
    *collisions = hits;
    return steps;
}
