"""The compiled learner: Q-learning on many trials at once, and greedy roll-outs.

:mod:`replication.learning.reference` defines what is computed, in plain Python; this module returns
the same bits.

A step of Q-learning is a chain of dependent operations, so a core that runs one trial mostly waits.
Therefore trials advance in lock step, eight to a group, each in its lane of a SIMD vector, and two
groups take turns, so that one computes while the other waits. Numba has no vectors: `_advance`
writes LLVM's instructions through `_Vector`, and LLVM lowers them to what the processor has. The
last few trials, too few for a group, run one after the other in `_finish`.

This is one file because numba renews its cache on disk only when the file of the cached function
changes: a compiled function must not call what is compiled from another file.
"""

# Numba infers the types of compiled functions and hands an intrinsic its first argument; llvmlite
# has no types.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, import-untyped"
# mypy: disable-error-code="call-arg, var-annotated"

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

LANES = 8
WORTHWHILE = 5  # from this many trials on, a group is faster than one trial after the other
STATE, TIME, LEFT, STEPS = range(4)  # a trial's progress; LEFT is the number of episodes left
LOW, HALF = np.uint64(2**32 - 1), np.uint64(32)


class Rule(NamedTuple):
    """The scalars of a call."""

    start: int
    goal: int
    horizon: int
    beta: float
    gamma: float
    threshold: int  # explore if the high half of the draw is below this
    random_ties: bool


def _compiled(function: Callable[..., Any]) -> Any:
    """Compile a function, and cache the result on disk if there is a writable place for it."""
    try:
        return njit(nogil=True, cache=True)(function)
    except RuntimeError:  # neither the package's folder nor the user's can be written
        return njit(nogil=True)(function)


# One trial. `actions` is a tuple whose length is the number of actions: as part of the signature,
# it lets the compiler unroll the loops over actions. A state's values and rewards lie side by side
# in `table` [state, 2, action]: with four actions they share a cache line.


@_compiled
def _draw(stream):
    """Advance a xoshiro256++ stream in place and return its next word in two halves."""
    s0, s1, s2, s3 = stream[0], stream[1], stream[2], stream[3]
    word = s0 + s3
    word = (word << np.uint64(23) | word >> np.uint64(41)) + s0
    s2 ^= s0
    s3 ^= s1
    stream[0], stream[1], stream[2] = s0 ^ s3, s1 ^ s2, s2 ^ s1 << np.uint64(17)
    stream[3] = s3 << np.uint64(45) | s3 >> np.uint64(19)
    return np.int64(word >> HALF), np.int64(word & LOW)


@_compiled
def choose(actions, row, stream, threshold, random_ties):
    """Return the action that `reference.choose` takes."""
    high, low = _draw(stream)
    if high < threshold:
        return low * len(actions) >> 32
    # Branches, unlike in a vector: a predicted action lets the next step start early.
    best, action, ties = row[0], 0, 1
    for a in range(1, len(actions)):
        if row[a] > best:
            best, action, ties = row[a], a, 1
        elif row[a] == best:
            ties += 1
    if ties > 1 and random_ties:
        pick, seen, action = low * ties >> 32, 0, 0
        for a in range(len(actions) - 1):
            seen += row[a] == best
            action += seen <= pick
    return action


@_compiled
def _finish(actions, stream, progress, table, successors, rule):
    """Run one trial to its end."""
    state, time = progress[STATE], progress[TIME]
    while progress[LEFT]:
        action = choose(actions, table[state, 0], stream, rule.threshold, rule.random_ties)
        successor = successors[state, action]
        value = 0.0
        if successor != rule.goal:
            value = table[successor, 0, 0]
            for a in range(1, len(actions)):
                other = table[successor, 0, a]
                value = other if other > value else value
        old = table[state, 0, action]
        target = table[state, 1, action] + rule.gamma * value
        table[state, 0, action] = old + rule.beta * (target - old)
        progress[STEPS] += 1
        state, time = successor, time + 1
        if state == rule.goal or time == rule.horizon:
            state, time = rule.start, 0
            progress[LEFT] -= 1


@_compiled
def follow(actions, stream, values, successors, rule):
    """Roll out the greedy policy of `values` [state, action]; the stream advances in place."""
    states, taken = [rule.start], [0 for _ in range(0)]
    while len(taken) < rule.horizon:
        action = choose(actions, values[states[-1]], stream, 0, rule.random_ties)
        taken.append(action)
        states.append(successors[states[-1], action])
        if states[-1] == rule.goal:
            break
    return np.array(states), np.array(taken)


# Eight trials to a group.

WORD, FLOAT, BIT = ir.IntType(64), ir.DoubleType(), ir.IntType(1)
INDICES = [ir.IntType(32)(lane) for lane in range(LANES)]


def _operator(name: str) -> Callable[["_Vector", Any], "_Vector"]:
    """Return an operator that appends an instruction, in its form for floats where needed."""

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
        """Return a vector unchanged, and a number as a vector of this type filled with it."""
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

    def select(self, yes: Any, no: "_Vector") -> "_Vector":
        """Return `yes` where this mask holds, and `no` elsewhere."""
        return _Vector(self.builder, self.builder.select(self.value, no.like(yes).value, no.value))

    def any(self) -> Any:
        """Return, as a scalar, whether this mask holds in any lane."""
        lanes = self.builder.bitcast(self.value, ir.IntType(LANES))
        return self.builder.icmp_unsigned("!=", lanes, lanes.type(0))

    def count(self) -> "_Vector":
        """Return this mask as numbers 0 and 1."""
        return _Vector(self.builder, self.builder.zext(self.value, ir.VectorType(WORD, LANES)))

    def load(self, element: Any) -> "_Vector":
        """Return the values stored at these addresses."""
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
        for lane in INDICES:
            address = self.builder.extract_element(self.value, lane)
            value = self.builder.extract_element(values.value, lane)
            self.builder.store(value, self.builder.inttoptr(address, ir.PointerType()), align=8)


def _spread(builder: Any, scalar: Any) -> _Vector:
    """Return the vector with a scalar in every lane."""
    value = ir.VectorType(scalar.type, LANES)(ir.Undefined)
    for lane in INDICES:
        value = builder.insert_element(value, scalar, lane)
    return _Vector(builder, value)


def _largest(row: list[_Vector]) -> _Vector:
    """Return the maximum; of zeros of both signs, the first."""
    best = row[0]
    for value in row[1:]:
        best = value.compare(">", best).select(value, best)
    return best


def _step(rule: Any, tables: _Vector, successors: _Vector, lanes: list[_Vector]) -> list[_Vector]:
    """Append one step of one group.

    The variables of the loop are the stream, the state, the time, the episodes left, and the values
    of the state's actions, which were read when it was the successor.
    """
    s0, s1, s2, s3, state, time, left, *row = lanes
    builder, actions = state.builder, len(row)

    def addresses(of: _Vector) -> list[_Vector]:
        at = tables + of * (16 * actions)
        return [at + 8 * a for a in range(actions)]

    word, t = (s0 + s3).rotate(23) + s0, s1 << 17
    s2, s3 = s2 ^ s0, s3 ^ s1
    stream = [s0 ^ s3, s1 ^ s2, s2 ^ t, s3.rotate(45)]

    # Candidate number `pick`, counted from 0, is the first action up to which there are more.
    explore, best = (word >> 32).compare("<", rule.threshold), _largest(row)
    ranks = [(explore | value.compare("==", best)).count() for value in row]
    for a in range(1, actions):
        ranks[a] = ranks[a - 1] + ranks[a]
    draw = (explore | rule.random_ties).select(word & 0xFFFFFFFF, word.like(0))
    pick = draw * ranks[-1] >> 32
    action, old = state.like(actions - 1), row[-1]
    for a in reversed(range(actions - 1)):
        here = ranks[a].compare(">", pick)
        action, old = here.select(a, action), here.select(row[a], old)

    successor = (successors + state * (8 * actions) + action * 8).load(WORD)
    at = tables + state * (16 * actions) + action * 8
    reward = (at + 8 * actions).load(FLOAT)

    time = time + 1
    at_goal, late = successor.compare("==", rule.goal), time.compare("==", rule.horizon)
    follow = at_goal.select(rule.start, successor)
    places = addresses(follow)
    row = [x.load(FLOAT) for x in places]
    value = at_goal.select(0.0, _largest(row))
    new = old + rule.beta * (reward + rule.gamma * value - old)
    at.store(new)
    # The row was read before the store, which may have changed one of its places.
    row = [x.compare("==", at).select(new, value) for x, value in zip(places, row, strict=True)]
    # After a time-out the next state is not the one whose value is in the target. This branch comes
    # last: LLVM would move a gather from before it to after it, which costs a fifth of the speed.
    follow = late.select(rule.start, follow)
    variables = [cgutils.alloca_once_value(builder, x.value) for x in row]
    with builder.if_then(late.any(), likely=False):
        for x, variable in zip(addresses(follow), variables, strict=True):
            builder.store(x.load(FLOAT).value, variable)
    row = [_Vector(builder, builder.load(x)) for x in variables]
    done = at_goal | late
    return [*stream, follow, done.select(0, time), left - done.count(), *row]


@intrinsic
def _advance(typing_context, groups, actions, streams, progress, tables, successors, rule):
    """Let groups of trials take steps together until some trial has finished its episodes.

    The tuple `groups` has an array of eight trials for each group. Returns the number of steps.
    """
    signature = types.int64(groups, actions, streams, progress, tables, successors, rule)

    def generate(context, builder, signature, arguments):
        def address(kind, array):
            array = context.make_array(kind)(context, builder, array)
            return _spread(builder, builder.ptrtoint(array.data, WORD))

        all_streams, all_progress, all_tables, transitions = map(
            address, signature.args[2:6], arguments[2:6]
        )
        scalars = cgutils.unpack_tuple(builder, arguments[6])
        vectors = Rule(*(_spread(builder, x) for x in scalars))  # type: ignore[arg-type]
        row = 16 * len(actions)  # bytes of a state's values and rewards
        array = context.make_array(tables)(context, builder, arguments[4])
        size = _spread(builder, builder.extract_value(array.shape, 1)) * row
        loops = []  # of each group: where its trials are stored, and its variables
        for group in cgutils.unpack_tuple(builder, arguments[0]):
            first = address(groups.dtype, group)
            offsets = _Vector(builder, first.value.type([8 * lane for lane in range(LANES)]))
            trial = (first + offsets).load(WORD)
            stream, state = all_streams + trial * 32, all_progress + trial * 32
            table = all_tables + trial * size
            record = [at + 8 * i for at, n in ((stream, 4), (state, 3)) for i in range(n)]
            lanes = [at.load(WORD) for at in record]
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
            lanes = _step(vectors, table, transitions, lanes)
            for lane, variable in zip(lanes, variables, strict=True):
                builder.store(lane.value, variable)
            finished = builder.or_(finished, lanes[6].compare("==", 0).any())
        builder.store(builder.add(builder.load(count), WORD(1)), count)
        builder.cbranch(finished, end, body)
        builder.position_at_end(end)
        for record, _, variables in loops:
            for at, variable in zip(record, variables, strict=False):
                at.store(_Vector(builder, builder.load(variable)))
        return builder.load(count)

    return signature, generate


# The schedule.


@_compiled
def count_groups(live):
    """Return how many groups to run if so many trials are not finished."""
    return min(2, (live + LANES - WORTHWHILE) // LANES)


@_compiled
def run(actions, streams, progress, tables, successors, rule):
    """Run all trials to their end; whenever one finishes, the lanes are allotted anew.

    Advances, in place, `streams` [trial, 4], `progress` [trial, 4], and the values in `tables`
    [trial, state, 2, action].
    """
    while True:
        live = np.flatnonzero(progress[:, LEFT])
        groups = count_groups(len(live))
        if groups == 0:
            break
        running = live[: groups * LANES]
        # Spare lanes repeat the last trial. It is in the same group, so they do the same at once.
        lanes = np.full(2 * LANES, running[-1])
        lanes[: len(running)] = running
        first, second = lanes[:LANES], lanes[LANES:]
        arguments = actions, streams, progress, tables, successors, rule
        if groups == 1:
            count = _advance((first,), *arguments)
        else:
            count = _advance((first, second), *arguments)
        for trial in running:
            progress[trial, STEPS] += count
    for trial in live:
        _finish(actions, streams[trial], progress[trial], tables[trial], successors, rule)
