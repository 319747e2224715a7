"""Compiled Q-learning (Eq. 1) and greedy roll-outs on tabular tasks.

`replication.reference` defines what is computed, in plain Python; this module returns the same
bits. A step of Q-learning is a chain of dependent operations, so one trial leaves a core mostly
waiting. Therefore the trials advance in lock step, eight to a group, one in each lane of a SIMD
vector (`_advance`), and two groups are interleaved so that one computes while the other waits.
Numba has no vectors, hence `_advance` writes LLVM instructions through `_Vector`; LLVM breaks them
down to what the processor has. The last few trials, too few for a group, run one after the other
(`_finish`).
"""

# Numba infers the types of compiled functions, and llvmlite has none.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, import-untyped"

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]

MAX_ACTIONS = 16  # the time to compile grows with it
LARGEST = 1e280  # far enough from overflow: a NaN would have no largest action
LANES = 8
WORTHWHILE = 5  # trials from which a group is faster than they are one after the other
FIELDS = 7  # of a trial's progress: stream (4), state, time in the episode, episodes left
FOREVER = np.uint64(2**62)
WORD, FLOAT, BIT = ir.IntType(64), ir.DoubleType(), ir.IntType(1)
VECTOR = ir.VectorType(WORD, LANES)


class _Rule(NamedTuple):
    """The scalars of a call."""

    start: np.uint64
    goal: np.uint64
    horizon: np.uint64
    beta: float
    gamma: float
    threshold: np.uint64  # explore if the high half of the draw is below this
    random_ties: bool
    bootstrap_goal: bool


def stream(seed_sequence: np.random.SeedSequence) -> Words:
    """Return a random stream: the state, uint64 [4], of a xoshiro256++ generator.

    Examples
    --------
    >>> stream(np.random.SeedSequence(1)).shape
    (4,)
    """
    words: Words = seed_sequence.generate_state(4, np.uint64)  # type: ignore[assignment]
    return words if words.any() else np.ones(4, np.uint64)  # the generator cannot leave 0


def learn(
    next_state: ArrayLike,
    weights: ArrayLike,
    q: ArrayLike,
    streams: ArrayLike,
    *,
    start: int,
    goal: int,
    episodes: int,
    horizon: int,
    beta: float,
    gamma: float,
    epsilon: float,
    random_ties: bool = True,
    bootstrap_goal: bool = False,
) -> tuple[Floats, Words, Ints]:
    """Learn Q by epsilon-greedy Q-learning (Eq. 1) on the reward ``weights``, trial by trial.

    A trial's result depends on its own stream, weights and Q only, to the last bit.

    Parameters
    ----------
    next_state
        Integers [state, action], for at most 16 actions.
    weights, q
        Rewards and initial values, float64 [trial, state, action].
    streams
        Random streams, uint64 [trial, 4], see `stream`.
    start, goal
        States. Every episode begins in ``start`` and ends on reaching ``goal``.
    episodes, horizon
        Episodes a trial, and steps after which an episode ends without having reached the goal.
        Such a time-out is not terminal: its target bootstraps.
    beta, gamma, epsilon
        Learning rate, discount and probability of exploring, each in [0, 1].
    random_ties
        Break ties at random, or else by the lowest action.
    bootstrap_goal
        Let the goal be worth max Q(goal, .) instead of 0. No action is taken there unless the
        goal is also the start, so that is the value it has in ``q``: 0 if Q starts at 0.

    Returns
    -------
    q, streams, steps
        New arrays: Q, float64 [trial, state, action]; the streams after the last draw,
        uint64 [trial, 4]; and the number of steps taken, int64 [trial].

    Raises
    ------
    ValueError
        If a shape or a value does not fit.
    """
    successors = _successors(next_state, start=start, goal=goal, horizon=horizon)
    initial, words = _table("q", q, successors, 3), _words("streams", streams, 2)
    rewards = _table("weights", weights, successors, 3)
    if not len(initial) == len(rewards) == len(words):
        raise ValueError(
            "weights, q and streams must have the same number of trials, "
            f"not {len(rewards)}, {len(initial)} and {len(words)}"
        )
    if not 1 <= int(episodes) * int(horizon) < FOREVER:
        raise ValueError(f"episodes must be positive and fewer than 2**62 steps, not {episodes}")
    for name, value in (("beta", beta), ("gamma", gamma), ("epsilon", epsilon)):
        if not 0 <= value <= 1:
            raise ValueError(f"{name} must be in [0, 1], not {value}")

    trials, states, actions = initial.shape
    # A state's values and rewards stand side by side: for four actions they share a cache line.
    # The last trial is a dummy for the lanes that have none.
    tables = np.zeros((trials + 1, states, 2, actions))
    tables[:trials, :, 0], tables[:trials, :, 1] = initial, rewards
    progress = np.zeros((trials + 1, FIELDS), np.uint64)
    progress[:trials, :4], progress[:, 4], progress[:, 6] = words, start, episodes
    steps = np.zeros(trials + 1, np.int64)
    rule = _rule(start, goal, horizon, beta, gamma, epsilon, random_ties, bootstrap_goal)
    _run((0,) * actions, progress, tables, successors, rule, steps)
    return tables[:trials, :, 0].copy(), progress[:trials, :4].copy(), steps[:trials].copy()


def roll_out(
    next_state: ArrayLike,
    q: ArrayLike,
    stream: ArrayLike,
    *,
    start: int,
    goal: int,
    horizon: int,
    random_ties: bool = True,
) -> tuple[Ints, Ints, Words]:
    """Follow the greedy policy of ``q`` [state, action] until ``goal``, ``horizon`` steps at most.

    Parameters are those of `learn`, for one trial. Returns the states, int64 [T + 1], the actions,
    int64 [T], and the stream after T draws, uint64 [4]. Raises ValueError as `learn` does.
    """
    successors = _successors(next_state, start=start, goal=goal, horizon=horizon)
    values, words = _table("q", q, successors, 2), _words("stream", stream, 1)
    rule = _rule(start, goal, horizon, 0.0, 0.0, 0.0, random_ties, False)
    return _follow((0,) * values.shape[1], words, values, successors, rule)


def _rule(
    start: int,
    goal: int,
    horizon: int,
    beta: float,
    gamma: float,
    epsilon: float,
    random_ties: bool,
    bootstrap_goal: bool,
) -> _Rule:
    """Give the scalars the types that the compiled functions expect."""
    return _Rule(
        np.uint64(start),
        np.uint64(goal),
        np.uint64(horizon),
        float(beta),
        float(gamma),
        np.uint64(round(epsilon * 2**32)),
        bool(random_ties),
        bool(bootstrap_goal),
    )


def _successors(next_state: ArrayLike, *, start: int, goal: int, horizon: int) -> Words:
    """Check the task and return its transitions."""
    table = np.asarray(next_state)
    if table.ndim != 2 or table.dtype.kind not in "iu" or not 1 <= table.shape[1] <= MAX_ACTIONS:
        raise ValueError(
            f"next_state must hold integers [state, action] for 1 to {MAX_ACTIONS} actions, "
            f"not {table.dtype} {list(table.shape)}"
        )
    for name, low, high in (
        ("next_state", table.min(initial=0), table.max(initial=0)),
        ("start", start, start),
        ("goal", goal, goal),
    ):
        if low < 0 or high >= len(table):
            raise ValueError(f"{name} must hold states from 0 to {len(table) - 1}")
    if not 1 <= horizon < FOREVER:
        raise ValueError(f"horizon must be positive and less than 2**62, not {horizon}")
    return np.ascontiguousarray(table, np.uint64)


def _table(name: str, values: ArrayLike, successors: Words, ndim: int) -> Floats:
    """Check a table of values or rewards and return it as a contiguous array."""
    table = np.ascontiguousarray(values, np.float64)
    if table.ndim != ndim or table.shape[-2:] != successors.shape:
        raise ValueError(
            f"{name} must have the shape [{'trial, ' * (ndim - 2)}state, action] with "
            f"{list(successors.shape)} states and actions, not {list(table.shape)}"
        )
    if not (np.abs(table) < LARGEST).all():
        raise ValueError(f"{name} must be finite and below {LARGEST}")
    return table


def _words(name: str, streams: ArrayLike, ndim: int) -> Words:
    """Check random streams and return a copy."""
    words = np.array(streams)
    if words.dtype != np.uint64 or words.ndim != ndim or words.shape[-1] != 4:
        raise ValueError(f"{name} must be uint64 [{'trial, ' * (ndim - 1)}4]")
    if not words.any(axis=-1).all():
        raise ValueError(f"{name} must not be all zero")
    return words


# One trial. The compiled functions take `actions`, a tuple whose length is the number of actions:
# so it is part of their signature, known to the compiler, which unrolls the loops over actions.


@njit(cache=True, nogil=True)
def _draw(s0, s1, s2, s3):
    """Return the next word of a xoshiro256++ stream, and the stream after it."""
    word = s0 + s3
    word = (word << np.uint64(23) | word >> np.uint64(41)) + s0
    t = s1 << np.uint64(17)
    s2 ^= s0
    s3 ^= s1
    return word, (s0 ^ s3, s1 ^ s2, s2 ^ t, s3 << np.uint64(45) | s3 >> np.uint64(19))


@njit(cache=True, nogil=True)
def _choose(actions, row, word, rule):
    """Return the action that ``reference.choose`` takes."""
    low = word & np.uint64(0xFFFFFFFF)
    if word >> np.uint64(32) < rule.threshold:
        return low * np.uint64(len(actions)) >> np.uint64(32)
    # Branches, unlike in a vector: a predicted action lets the next step begin before its time.
    best, action, ties = row[0], np.uint64(0), np.uint64(1)
    for a in range(1, len(actions)):
        if row[a] > best:
            best, action, ties = row[a], np.uint64(a), np.uint64(1)
        elif row[a] == best:
            ties += np.uint64(1)
    if ties > 1 and rule.random_ties:
        pick, seen, action = low * ties >> np.uint64(32), np.uint64(0), np.uint64(0)
        for a in range(len(actions) - 1):
            seen += np.uint64(row[a] == best)
            action += np.uint64(seen <= pick)
    return action


@njit(cache=True, nogil=True)
def _finish(actions, progress, table, successors, rule):
    """Run one trial to its end and return the number of steps."""
    words = progress[0], progress[1], progress[2], progress[3]
    state, time, left, steps = progress[4], progress[5], progress[6], 0
    while left:
        word, words = _draw(*words)
        action = _choose(actions, table[state, 0], word, rule)
        successor = successors[state, action]
        at_goal = successor == rule.goal
        value = 0.0
        if rule.bootstrap_goal or not at_goal:
            value = table[successor, 0, 0]
            for a in range(1, len(actions)):
                other = table[successor, 0, a]
                value = other if other > value else value
        old = table[state, 0, action]
        target = table[state, 1, action] + rule.gamma * value
        table[state, 0, action] = old + rule.beta * (target - old)
        steps += 1
        time += np.uint64(1)
        state = successor
        if at_goal or time == rule.horizon:
            state, time, left = rule.start, np.uint64(0), left - np.uint64(1)
    progress[0], progress[1], progress[2], progress[3] = words
    progress[6] = left
    return steps


@njit(cache=True, nogil=True)
def _follow(actions, words, values, successors, rule):
    """Roll out the greedy policy."""
    states, taken = [np.int64(rule.start)], [np.int64(0) for _ in range(0)]
    stream = words[0], words[1], words[2], words[3]
    while len(taken) < rule.horizon:
        word, stream = _draw(*stream)
        action = _choose(actions, values[states[-1]], word, rule)
        states.append(np.int64(successors[states[-1], action]))
        taken.append(np.int64(action))
        if states[-1] == np.int64(rule.goal):
            break
    return np.array(states), np.array(taken), np.array(stream)


# Eight trials to a group.


def _operator(name: str) -> Callable[["_Vector", Any], "_Vector"]:
    """Return an operator that appends an instruction, in its form for floats if need be."""

    def operator(self: "_Vector", other: Any) -> "_Vector":
        prefix = "f" if self.value.type.element == FLOAT else ""
        emit = getattr(self.builder, prefix + name)
        return _Vector(self.builder, emit(self.value, self.like(other).value))

    return operator


class _Vector:
    """A value in each lane; operators append LLVM instructions to the function being built."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def like(self, other: Any) -> "_Vector":
        """Return a vector as it is, and a number as a vector of this one's type filled with it."""
        if isinstance(other, _Vector):
            return other
        return _Vector(self.builder, self.value.type(other))

    __add__, __sub__, __mul__ = _operator("add"), _operator("sub"), _operator("mul")
    __and__, __or__, __xor__ = _operator("and_"), _operator("or_"), _operator("xor")
    __lshift__, __rshift__ = _operator("shl"), _operator("lshr")

    def rotate(self, bits: int) -> "_Vector":
        """Rotate to the left."""
        return self << bits | self >> 64 - bits

    def compare(self, sign: str, other: Any) -> "_Vector":
        """Return the mask of ``self sign other``; integers count as signed."""
        is_float = self.value.type.element == FLOAT
        emit = self.builder.fcmp_ordered if is_float else self.builder.icmp_signed
        return _Vector(self.builder, emit(sign, self.value, self.like(other).value))

    def where(self, mask: "_Vector", other: Any) -> "_Vector":
        """Return this vector where the mask holds, and the other elsewhere."""
        value = self.builder.select(mask.value, self.value, self.like(other).value)
        return _Vector(self.builder, value)

    def any(self) -> Any:
        """Return, as a scalar, whether this mask holds in any lane."""
        lanes = self.builder.bitcast(self.value, ir.IntType(LANES))
        return self.builder.icmp_unsigned("!=", lanes, lanes.type(0))

    def count(self) -> "_Vector":
        """Return this mask as numbers, 0 or 1."""
        return _Vector(self.builder, self.builder.zext(self.value, VECTOR))

    def load(self, element: Any) -> "_Vector":
        """Return what is stored at these addresses."""
        kind = ir.VectorType(element, LANES)
        masks, pointers = ir.VectorType(BIT, LANES), ir.VectorType(ir.PointerType(), LANES)
        size = ir.IntType(32)
        gather = cgutils.get_or_insert_function(
            self.builder.module,
            ir.FunctionType(kind, [pointers, size, masks, kind]),
            f"llvm.masked.gather.v{LANES}{'f' if element == FLOAT else 'i'}64.v{LANES}p0",
        )
        addresses = self.builder.inttoptr(self.value, pointers)
        value = self.builder.call(gather, [addresses, size(8), masks(1), kind(ir.Undefined)])
        return _Vector(self.builder, value)

    def store(self, values: "_Vector") -> None:
        """Store values at these addresses, one by one: faster than a scatter, and portable."""
        for lane in map(ir.IntType(32), range(LANES)):
            address = self.builder.extract_element(self.value, lane)
            value = self.builder.extract_element(values.value, lane)
            self.builder.store(value, self.builder.inttoptr(address, ir.PointerType()), align=8)


def _spread(builder: Any, scalar: Any) -> _Vector:
    """Return the vector with a scalar in every lane."""
    value = ir.VectorType(scalar.type, LANES)(ir.Undefined)
    for lane in map(ir.IntType(32), range(LANES)):
        value = builder.insert_element(value, scalar, lane)
    return _Vector(builder, value)


def _largest(row: list[_Vector]) -> _Vector:
    """Return the maximum, the first one if there are zeros of both signs."""
    best = row[0]
    for value in row[1:]:
        best = value.where(value.compare(">", best), best)
    return best


def _step(rule: Any, tables: _Vector, successors: _Vector, lanes: list[_Vector]) -> list[_Vector]:
    """Append one step of one group.

    The loop's variables are the stream, the state, the time, the episodes left, and the values of
    the state's actions, which are kept from when they were read as those of the successor.
    """
    s0, s1, s2, s3, state, time, left, *row = lanes
    builder, actions = state.builder, len(row)

    def values(of: _Vector) -> list[_Vector]:
        at = tables + of * (16 * actions)
        return [(at + 8 * a).load(FLOAT) for a in range(actions)]

    word, t = (s0 + s3).rotate(23) + s0, s1 << 17
    s2, s3 = s2 ^ s0, s3 ^ s1
    stream = [s0 ^ s3, s1 ^ s2, s2 ^ t, s3.rotate(45)]

    # Candidate number `pick`, counted from 0, is the first action up to which there are more.
    explore, best = (word >> 32).compare("<", rule.threshold), _largest(row)
    ranks = [(explore | value.compare("==", best)).count() for value in row]
    for a in range(1, actions):
        ranks[a] = ranks[a - 1] + ranks[a]
    draw = (word & 0xFFFFFFFF).where(explore | rule.random_ties, 0)
    pick = draw * ranks[-1] >> 32
    action, old = state.like(actions - 1), row[-1]
    for a in reversed(range(actions - 1)):
        here = ranks[a].compare(">", pick)
        action, old = state.like(a).where(here, action), row[a].where(here, old)

    successor = (successors + state * (8 * actions) + action * 8).load(WORD)
    at = tables + state * (16 * actions) + action * 8
    reward = (at + 8 * actions).load(FLOAT)

    time = time + 1
    at_goal, late = successor.compare("==", rule.goal), time.compare("==", rule.horizon)
    done = at_goal | late
    follow = rule.start.where(done, successor)
    row = values(follow)
    # Only an episode that ends without a terminal value needs the row of its last state as well.
    value = cgutils.alloca_once_value(builder, _largest(row).value)
    with builder.if_then((late | at_goal & rule.bootstrap_goal).any(), likely=False):
        builder.store(_largest(values(successor)).value, value)
    value = _Vector(builder, builder.load(value))
    value = value.where((at_goal ^ 1) | rule.bootstrap_goal, 0.0)
    new = old + rule.beta * (reward + rule.gamma * value - old)
    at.store(new)
    again = follow.compare("==", state)
    row = [new.where(again & action.compare("==", a), row[a]) for a in range(actions)]
    return [*stream, follow, time.where(done ^ 1, 0), left - done.count(), *row]


@intrinsic
def _advance(typing_context, groups, actions, trials, progress, tables, successors, rule):
    """Let the trials [group * lane] take steps together until one has finished its episodes.

    The tuple `groups` has one entry a group. Returns the number of steps that each trial took.
    """
    signature = types.int64(groups, actions, trials, progress, tables, successors, rule)

    def generate(context, builder, signature, arguments):
        def array(index):
            return context.make_array(signature.args[index])(context, builder, arguments[index])

        def address(index):
            return _spread(builder, builder.ptrtoint(array(index).data, WORD))

        scalars = cgutils.unpack_tuple(builder, arguments[6])
        vectors = _Rule(*(_spread(builder, x) for x in scalars))  # type: ignore[arg-type]
        row = 16 * len(actions)  # bytes of a state's values and rewards
        size = _spread(builder, builder.extract_value(array(4).shape, 1)) * row
        lane_addresses = address(2) + _Vector(builder, VECTOR([8 * i for i in range(LANES)]))
        loops = []  # of each group: the addresses of its records and tables, and its variables
        for group in range(len(groups)):
            trial = (lane_addresses + 8 * LANES * group).load(WORD)
            record, table = address(3) + trial * (8 * FIELDS), address(4) + trial * size
            lanes = [(record + 8 * i).load(WORD) for i in range(FIELDS)]
            lanes += [(table + lanes[4] * row + 8 * a).load(FLOAT) for a in range(len(actions))]
            variables = [cgutils.alloca_once_value(builder, x.value) for x in lanes]
            loops.append((record, table, variables))
        count = cgutils.alloca_once_value(builder, WORD(0))

        body, end = builder.append_basic_block("body"), builder.append_basic_block("end")
        builder.branch(body)
        builder.position_at_end(body)
        finished = BIT(0)
        for _, table, variables in loops:
            lanes = [_Vector(builder, builder.load(x)) for x in variables]
            lanes = _step(vectors, table, address(5), lanes)
            for lane, variable in zip(lanes, variables, strict=True):
                builder.store(lane.value, variable)
            finished = builder.or_(finished, lanes[6].compare("==", 0).any())
        builder.store(builder.add(builder.load(count), WORD(1)), count)
        builder.cbranch(finished, end, body)
        builder.position_at_end(end)
        for record, _, variables in loops:
            for i in range(FIELDS):
                (record + 8 * i).store(_Vector(builder, builder.load(variables[i])))
        return builder.load(count)

    return signature, generate


@njit(cache=True, nogil=True)
def _run(actions, progress, tables, successors, rule, steps):
    """Run all trials to their end; whenever one finishes, the lanes are allotted anew."""
    dummy = len(tables) - 1
    trials = np.empty(2 * LANES, np.uint64)
    while True:
        live = np.flatnonzero(progress[:dummy, 6])
        groups = min(2, (len(live) + LANES - WORTHWHILE) // LANES)
        if groups == 0:
            break
        trials[:] = dummy
        running = live[: groups * LANES]
        trials[: len(running)] = running
        progress[dummy, 6] = FOREVER
        arguments = actions, trials, progress, tables, successors, rule
        if groups == 1:
            steps[running] += _advance((0,), *arguments)  # type: ignore[call-arg]
        else:
            steps[running] += _advance((0, 0), *arguments)  # type: ignore[call-arg]
    for trial in live:
        steps[trial] += _finish(actions, progress[trial], tables[trial], successors, rule)
