"""The compiled learner: Q-learning that computes an update only if it can change a bit.

:mod:`replication.learning.reference` defines what is computed, in plain Python; this module returns
the same bits. An update of Q(s, a) depends on three numbers alone, R(s, a), Q(s, a) and
max Q(s', .), and after a while most updates write the bits that were there already.

A pair (s, a) is **frozen** when an update has left the bits of Q(s, a) as they were, and **thaws**
when max Q(s', .) changes. In between all three numbers stay the same: the reward is fixed, and only
the pair's own updates change Q(s, a). So a further update would repeat the last one and write the
same bits again, and it can be left out. The maximum of a state changes only in an update of one of
its own pairs; that update then thaws all pairs that lead to the state. (If it changes from 0 to -0,
nothing follows: added to a number neither shows, and 0 and -0 as targets give the same update.)

Every step still takes its draw and moves on, so streams and numbers of steps stay as they are. For
that, each state has a row in a table. The entry of an action says where the row of its successor
begins if the pair is frozen, plus 1 if that is the state itself, or else THAWED. After the actions
come SLOTS entries for the greedy choice: copies of the entries of the tied actions, each as often
as the others, or all THAWED. Of k tied actions, a draw x in [0, 1) takes number floor(k x); slot
floor(SLOTS x) belongs to the same one if k divides SLOTS. They are filled when the choice was
computed, and become THAWED with each change of the state's values and each thawing of one of its
pairs. So whatever entry is found, it leads to where a computed step would lead, and a frozen step
is a draw and a look at one entry.

This is one file because numba renews its cache on disk only when the file of the cached function
changes: a compiled function must not call what is compiled from another file.
"""

# Numba infers the types of compiled functions.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, var-annotated, call-arg"

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numba.extending import intrinsic

# Indices are unsigned: numba counts negative ones from the end, which takes time.
ONE, HALF, LOW = np.uint64(1), np.uint64(32), np.uint64(2**32 - 1)
SLOTS = np.uint64(12)  # divisible by 1, 2, 3 and 4
THAWED = np.uint32(2**32 - 1)
MAX_STATES = 2**27  # so that no place in the table is THAWED


class Rule(NamedTuple):
    """The scalars of a call."""

    start: int
    goal: int
    horizon: int
    tolerance: float
    random_ties: bool
    episodes: int = 0
    beta: float = 0.0
    gamma: float = 0.0
    fused: bool = False
    threshold: int = 0  # explore if the high half of the draw is below this


def cached(function: Callable[..., Any]) -> Any:
    """Compile a function, and cache the result on disk if there is a writable place for it."""
    try:
        return njit(nogil=True, cache=True)(function)
    except RuntimeError:  # neither the package's folder nor the user's can be written
        return njit(nogil=True)(function)


@intrinsic
def fma(context, a, b, c):
    """Return a b + c, rounded once."""
    return a(a, b, c), lambda context, builder, signature, arguments: builder.fma(*arguments)


# `actions` is a tuple whose length is the number of actions: as part of the signature, it lets the
# compiler unroll the loops over actions. A stream is a tuple of four words.


@cached
def load(words):
    """Return the stream that is stored in an array."""
    return words[0], words[1], words[2], words[3]


@cached
def save(stream, words):
    """Store a stream in an array."""
    for i in range(4):
        words[i] = stream[i]


@cached
def draw(stream):
    """Return a xoshiro256++ stream after a draw, and the two halves of the word drawn."""
    s0, s1, s2, s3 = stream
    word = s0 + s3
    word = (word << np.uint64(23) | word >> np.uint64(41)) + s0
    s2 ^= s0
    s3 ^= s1
    stream = s0 ^ s3, s1 ^ s2, s2 ^ s1 << np.uint64(17), s3 << np.uint64(45) | s3 >> np.uint64(19)
    return stream, word >> HALF, word & LOW


@cached
def largest(actions, values, state):
    """Return the greatest value of a state; of zeros of both signs, the first."""
    best = values[state, 0]
    for a in range(1, len(actions)):
        best = values[state, a] if values[state, a] > best else best
    return best


@cached
def tied(actions, values, state, tolerance, random_ties):
    """Return what an action must be worth to count as best, and how many of those to pick from."""
    best = largest(actions, values, state)
    least, ties = best - tolerance * abs(best), 0
    for a in range(len(actions)):
        ties += values[state, a] >= least
    return least, np.uint64(ties if random_ties else 1)


@cached
def pick(actions, values, state, low, least, ties):
    """Return the action that `reference.choose` takes when it does not explore."""
    number, seen, action = low * ties >> HALF, np.uint64(0), np.uint64(0)
    for a in range(len(actions) - 1):
        seen += np.uint64(values[state, a] >= least)
        action += np.uint64(seen <= number)
    return action


@cached
def choose(actions, stream, values, state, threshold, tolerance, random_ties):
    """Return the stream after a draw, and the action that `reference.choose` takes by it."""
    stream, high, low = draw(stream)
    if high < np.uint64(threshold):
        return stream, np.int64(low * np.uint64(len(actions)) >> HALF)
    least, ties = tied(actions, values, state, tolerance, random_ties)
    return stream, np.int64(pick(actions, values, state, low, least, ties))


@cached
def _width(actions):
    """Return the length of a row: a power of 2, so that `^` can add to the place where it begins.

    With 4 actions, a row of 16 entries is a cache line.
    """
    return np.uint64(16 if len(actions) <= 4 else 32)


@cached
def _predecessors(n, width, successors):
    """Return the pairs by the states that they lead to, and where the pairs of each state begin.

    A pair is its place in the table; the second array has one entry more than there are states.
    """
    first = np.zeros(len(successors) + 2, np.uint64)
    pairs = np.empty(len(successors) * n, np.uint64)
    for state in range(len(successors)):
        for a in range(n):
            first[successors[state, a] + 2] += ONE
    for state in range(len(successors)):
        first[state + 2] += first[state + 1]
    for state in range(len(successors)):
        for a in range(n):
            last = successors[state, a] + 1
            pairs[first[last]] = np.uint64(state) * width + np.uint64(a)
            first[last] += ONE
    return pairs, first


@cached
def _thaw(n, width, pair, table):
    """Thaw a pair, and with it the greedy choice of its state."""
    table[pair] = THAWED
    slots = (pair ^ pair % width) + n
    for slot in range(SLOTS):
        table[slots + slot] = THAWED


@cached
def _fill(actions, values, state, table, at, least, ties):
    """Fill the slots of a state for its greedy choice."""
    slot = at + np.uint64(len(actions))
    end = slot + SLOTS
    share = SLOTS // ties if SLOTS % ties == 0 else np.uint64(0)
    for a in range(len(actions)):
        if values[state, a] >= least and slot < end:
            for _ in range(share):
                table[slot] = table[at + np.uint64(a)]
                slot += ONE
    while slot < end:
        table[slot] = THAWED
        slot += ONE


@cached
def learn(actions, words, values, bits, weights, successors, rule):
    """Run one trial and return the numbers of steps and of collisions.

    Advances, in place, the stream's `words` and `values` [state, action], whose type is that of all
    operations, and that of `weights`. `bits` are the values as integers.
    """
    n, width = np.uint64(len(actions)), _width(actions)
    start, goal = np.uint64(rule.start), np.uint64(rule.goal)
    threshold = np.uint64(rule.threshold)
    real = values.dtype.type
    beta, gamma, nothing = real(rule.beta), real(rule.gamma), real(0.0)
    table = np.full(len(successors) * np.int64(width), THAWED)
    pairs, first = _predecessors(len(actions), width, successors)
    stream, steps, collisions = load(words), 0, np.uint64(0)
    for _ in range(rule.episodes):
        at, left = start * width, rule.horizon
        while left:
            while True:  # through frozen pairs, without a branch on whether to explore
                stream, high, low = draw(stream)
                left -= 1
                greedy = np.uint64(high >= threshold)
                place = (low * (n + greedy * (SLOTS - n)) >> HALF) + greedy * n
                entry = table[at ^ place]
                if entry == THAWED or left == 0:
                    break
                stays = np.uint64(entry) & ONE
                collisions += stays
                at = np.uint64(entry) ^ stays
            if entry != THAWED:  # time is up
                collisions += np.uint64(entry) & ONE
                break
            state = at // width
            least, ties = tied(actions, values, state, rule.tolerance, rule.random_ties)
            action = pick(actions, values, state, low, least, ties) if greedy else place
            successor = np.uint64(successors[state, action])
            stays = np.uint64(successor == state)
            collisions += stays
            frozen = table[at ^ action] != THAWED
            if not frozen:
                best, was = largest(actions, values, state), bits[state, action]
                value = largest(actions, values, successor) if successor != goal else nothing
                reward, old = weights[state, action], values[state, action]
                if rule.fused:
                    values[state, action] = fma(beta, fma(gamma, value, reward) - old, old)
                else:
                    values[state, action] = old + beta * (reward + gamma * value - old)
                frozen = bits[state, action] == was
                now = largest(actions, values, state)
                if frozen and successor != goal:  # where the episode ends
                    table[at ^ action] = successor * width + stays
                if now != best:
                    for i in range(first[state], first[state + ONE]):
                        _thaw(n, width, pairs[i], table)
            if frozen:
                _fill(actions, values, state, table, at, least, ties)
            else:
                for slot in range(SLOTS):
                    table[(at ^ n) + slot] = THAWED
            if successor == goal:
                break
            at = successor * width
        steps += rule.horizon - left
    save(stream, words)
    return steps, collisions


@cached
def follow(actions, words, values, successors, rule):
    """Roll out the greedy policy of `values` [state, action]; the stream advances in place."""
    stream, states, taken = load(words), [rule.start], [0 for _ in range(0)]
    while len(taken) < rule.horizon:
        stream, action = choose(
            actions, stream, values, states[-1], rule.threshold, rule.tolerance, rule.random_ties
        )
        taken.append(action)
        states.append(successors[states[-1], action])
        if states[-1] == rule.goal:
            break
    save(stream, words)
    return np.array(states), np.array(taken)
