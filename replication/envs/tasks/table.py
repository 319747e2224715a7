"""A task whose moves are known: a table of next states, or of their probabilities."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replication.envs.tasks.base import Ints, Task, TaskError, Walk, named_actions, out_of_range
from replication.envs.tasks.moves import Moves

Floats = NDArray[np.float64]


class TabularTask(Task):
    """A task that is a table.

    Parameters
    ----------
    moves
        Where actions lead: next states, integers [state, action]; or probabilities
        P(s' | s, a), [state, action, next state]; or Gymnasium's ``env.unwrapped.P``, where
        ``P[state][action]`` lists ``(probability, next state, reward, whether the episode ends)``.
    start
        The state in which episodes start, or several, each as likely as the others, or the
        probability of each state, float [state].
    terminal
        The state in which an episode ends, or several. Gymnasium's table names them itself.
    actions
        Names of the actions; their numbers by default.

    Attributes
    ----------
    table
        All of it, see :class:`replication.envs.tasks.moves.Moves`.

    Raises
    ------
    TaskError
        If the table is no table, a probability is negative, or those of a pair do not sum to 1.

    Examples
    --------
    A corridor of three states, whose end is the goal:

    >>> task = TabularTask([[0, 1], [0, 2], [2, 2]], terminal=[2], actions=("back", "on"))
    >>> task.replay([1, 1]).tolist(), task.is_random
    ([0, 1, 2], False)
    """

    table: Moves

    def __init__(
        self,
        moves: ArrayLike | Mapping[int, Mapping[int, Sequence[tuple[Any, ...]]]],
        *,
        start: int | Sequence[int] | ArrayLike = 0,
        terminal: int | Iterable[int] = (),
        actions: Sequence[str] | None = None,
    ) -> None:
        try:
            shape, outcomes, ended, loose = _read(moves)
        except (TypeError, ValueError, LookupError) as error:
            if isinstance(error, TaskError):
                raise
            raise TaskError(f"moves are no table: {error}") from None
        self.n_states = shape[0]
        self.actions = named_actions(actions, shape[1])
        ends = np.zeros(self.n_states, bool)
        final = [*terminal] if isinstance(terminal, Iterable) else [terminal]
        for states in (ended, final):
            ends[_states(states, self.n_states, "terminal")] = True
        starts = _starts(start, self.n_states)
        if (starts[ends] > 0).any():
            first = np.flatnonzero(ends & (starts > 0))[0]
            raise TaskError(f"start: an episode would end in state {first} at once")
        try:
            self.table = Moves.of(outcomes, shape=shape, starts=starts, ends=ends)
        except ValueError as error:
            raise TaskError(str(error)) from None
        for state in self._reachable().intersection(loose):
            raise TaskError(
                f"P: a move from state {state} does not end the episode where another one does; "
                "step the environment instead: WrappedTask(env, int, n_states)"
            )

    @property
    def is_random(self) -> bool:
        """Whether a move or the start is random."""
        return len(self.table.successors) > len(self.table.first) - 1

    def walk(self, actions: Sequence[int]) -> Walk:
        """Return where actions lead; raises `TaskError` if moves or the start are random."""
        if self.is_random:
            raise TaskError("moves or the start are random: give the states as well as the actions")
        states, end = [self.table.starts.item(0)], None
        for step, action in enumerate(actions, start=1):
            states.append(self.table.after(states[-1], action).item(0))
            if end is None and self.table.ends[states[-1]]:
                end = step
        return Walk(np.array(states, np.int64), end)

    def fault(self, states: Ints, actions: Ints) -> str | None:
        """Return at which step states [T + 1] and actions [T] cannot be an episode, and why."""
        wrong = out_of_range(states, actions, self.n_states, self.n_actions)
        if wrong:
            return wrong
        starts = self.table.starts
        if states[0] not in starts:
            return f"it starts in state {states[0]}, but episodes start in {_few(starts)}"
        for step, action in enumerate(actions, start=1):
            before, after = states[step - 1], states[step]
            if self.table.ends[before]:
                return f"it goes on after the episode has ended at step {step - 1}; drop the rest"
            possible = self.table.after(before, action)
            if after not in possible:
                return (
                    f"step {step}: {self.actions[action]!r} in state {before} leads to "
                    f"{_few(possible)}, never to {after}"
                )
        return None

    def is_over(self, states: Ints, actions: Ints) -> bool:
        """Return whether the last state ends an episode."""
        return bool(self.table.ends[states[-1]])

    def _reachable(self) -> set[int]:
        """Return the states that are visited in some episode, but for those that end one."""
        found: set[int] = set()
        waiting = {*self.table.starts.tolist()}
        while waiting:
            state = waiting.pop()
            found.add(state)
            first, last = self.table.first[[state * self.n_actions, (state + 1) * self.n_actions]]
            after = self.table.successors[first:last]
            waiting |= {*after[~self.table.ends[after]].tolist()} - found
        return found

    def describe(self) -> dict[str, Any]:
        """Return plain JSON values; a digest stands for the table."""
        digest = hashlib.sha256()
        for array in self.table:
            digest.update(array.tobytes())
        return {
            "kind": self.kind,
            "states": self.n_states,
            "actions": list(self.actions),
            "digest": digest.hexdigest(),
        }


Outcomes = tuple[list[Any] | Ints, list[Any] | Ints, list[Any] | Ints, list[Any] | Floats]
"""States, actions, the states that they lead to, and probabilities."""


def _read(moves: Any) -> tuple[tuple[int, int], Outcomes, list[int], list[int]]:
    """Return the shape [state, action], the outcomes, the ends and the loose states of a table."""
    if isinstance(moves, Mapping):
        return _of_gymnasium(moves)
    return *_of_array(np.asarray(moves)), [], []


def _of_array(table: NDArray[Any]) -> tuple[tuple[int, int], Outcomes]:
    """Return the shape [state, action] and the outcomes of an array."""
    if table.ndim == 2 and table.dtype.kind in "iu" and table.size:
        states, actions = np.indices(table.shape).reshape(2, -1)
        successors = _states(table.ravel(), len(table), "moves")
        return table.shape, (states, actions, successors, np.ones(table.size))
    if table.ndim == 3 and table.dtype.kind in "iuf" and len(table) == table.shape[2] > 0:
        states, actions, successors = np.nonzero(table)
        return table.shape[:2], (states, actions, successors, table[table != 0])
    raise TaskError(
        "moves must be integers [state, action], or probabilities [state, action, next state], "
        f"not {table.dtype} {list(table.shape)}"
    )


def _of_gymnasium(
    table: Mapping[int, Mapping[int, Sequence[tuple[Any, ...]]]],
) -> tuple[tuple[int, int], Outcomes, list[int], list[int]]:
    """Return the shape [state, action] of Gymnasium's table, its outcomes and its ends.

    The last are states from which a move to one of the ends does not end the episode.
    """
    found = [
        (state, action, *outcome)
        for state, row in table.items()
        for action, outcomes in row.items()
        for outcome in outcomes
    ]
    states, actions, probabilities, successors, _, done = zip(*found, strict=True)
    ends = {state for state, over in zip(successors, done, strict=True) if over}
    moves = zip(states, successors, done, strict=True)
    loose = [state for state, successor, over in moves if successor in ends and not over]
    shape = len(table), max(actions) + 1
    outcomes = list(states), list(actions), list(successors), list(probabilities)
    return shape, outcomes, [*ends], loose


def _starts(start: Any, n_states: int) -> Floats:
    """Return the probability of each state to be the first."""
    array = np.atleast_1d(np.asarray(start))
    if array.dtype.kind == "f" and array.shape == (n_states,):
        return array.astype(np.float64)
    if array.dtype.kind not in "iu" or not array.size:
        raise TaskError(
            f"start must be a state, several states, or {n_states} probabilities, not "
            f"{array.dtype} {list(array.shape)}"
        )
    if len(np.unique(array)) < len(array):
        raise TaskError("start names a state twice; write probabilities as 1.0, 0.0, ...")
    chances = np.zeros(n_states)
    chances[_states(array, n_states, "start")] = 1.0
    return chances / chances.sum()


def _states(states: ArrayLike, n_states: int, where: str) -> Ints:
    """Return the numbers of states, int64 [n], after checking them."""
    array = np.asarray(states)
    if array.dtype.kind not in "iu" and array.size:
        raise TaskError(f"{where}: states are whole numbers, not {array.dtype}")
    wrong = array[(array < 0) | (array >= n_states)]
    if wrong.size:
        raise TaskError(f"{where}: there is no state {wrong[0]}; states are 0..{n_states - 1}")
    return array.astype(np.int64)


def _few(states: Ints) -> str:
    """Return some states in words."""
    shown = [str(state) for state in states[:5]]
    return " or ".join(shown) + (" or others" if len(states) > 5 else "")
