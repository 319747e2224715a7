"""Where someone demonstrates by hand: it plays actions, and draws what came of them as text."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import gymnasium
import numpy as np

from replication.demos.checks import goal_phrase, no_op_phrase
from replication.envs.environment import Environment
from replication.envs.gym import MazeEnv
from replication.envs.maze import Maze
from replication.envs.tasks.base import is_over
from replication.envs.tasks.gymnasium import GymTask
from replication.envs.tasks.stepped import WrappedTask
from replication.envs.tasks.table import TabularTask
from replication.errors import UserError, clip

AGENT, WAY, GOAL, WALL, PLAIN = "\x1b[1;31m", "\x1b[36m", "\x1b[1;32m", "\x1b[2m", "\x1b[0m"
"""How a terminal is told to colour a cell of a maze."""

HEADS = {"up": "^", "down": "v", "right": ">", "left": "<"}


@dataclass(frozen=True)
class Scene:
    """What came of some actions.

    Attributes
    ----------
    states
        Those visited, the start included.
    told
        What the last action did, in a few words; empty if that goes without saying.
    over
        Whether no action can follow.
    """

    states: tuple[int, ...]
    told: str = ""
    over: bool = False


class World(Protocol):
    """An environment in which someone demonstrates."""

    @property
    def environment(self) -> Environment:
        """What the demonstrations are of."""
        ...

    def play(self, actions: Sequence[int], attempt: int) -> Scene:
        """Play actions from the start; moves that are random repeat in the same attempt.

        Raises
        ------
        UserError
            If that cannot be done.
        """
        ...

    def draw(self, actions: Sequence[int], scene: Scene, columns: int, lines: int) -> list[str]:
        """Return lines of text that show the end of the scene, which was played last."""
        ...


def as_world(given: Any) -> World:
    """Return the world of an environment of ours or of Gymnasium.

    Raises
    ------
    UserError
        If its states or actions are not numbered.
    """
    if isinstance(given, gymnasium.Env):
        bare = given.unwrapped
        if isinstance(bare, MazeEnv):
            return _Known(bare.maze)
        given = GymTask(given)
    if isinstance(given, GymTask | WrappedTask):
        return _Stepped(given)
    if isinstance(given, TabularTask) and given.is_random:
        return _Random(given)
    if not hasattr(given, "replay"):
        raise UserError(f"give a maze, a task or a Gymnasium environment, not {clip(repr(given))}")
    return _Known(given)


@dataclass(frozen=True)
class _Known:
    """A deterministic environment that can be replayed."""

    environment: Environment

    def play(self, actions: Sequence[int], attempt: int) -> Scene:
        states = self.environment.replay(actions)
        over = bool(is_over(self.environment, states, np.array(actions, np.int64)))
        stays = len(states) > 1 and states[-1] == states[-2]
        return Scene(tuple(states.tolist()), _told(self.environment, over=over, stays=stays), over)

    def draw(self, actions: Sequence[int], scene: Scene, columns: int, lines: int) -> list[str]:
        if isinstance(self.environment, Maze):
            return _drawn(self.environment, actions, scene.states, columns, lines)
        return []


def _told(environment: Environment, *, over: bool, stays: bool) -> str:
    if over:
        reached = {"maze": goal_phrase(environment), "soccer": "the gate: a goal"}
        return f"reaches {reached.get(environment.kind, 'an end of the episode')}"
    return no_op_phrase(environment) if stays else ""


@dataclass(frozen=True)
class _Random:
    """A task whose table of moves has several outcomes; an attempt is the seed of the luck."""

    environment: TabularTask

    def play(self, actions: Sequence[int], attempt: int) -> Scene:
        task, luck = self.environment, np.random.default_rng(attempt)
        table = task.table

        def drawn(pair: int) -> int:
            outcomes = slice(table.first[pair], table.first[pair + 1])
            chances = table.probabilities[outcomes]
            return int(luck.choice(table.successors[outcomes], p=chances / chances.sum()))

        states = [drawn(task.n_states * task.n_actions)]  # the start stands behind all pairs
        for action in actions:
            states.append(drawn(states[-1] * task.n_actions + action))
        over, stays = bool(table.ends[states[-1]]), states[-1:] == states[-2:-1]
        return Scene(tuple(states), _told(task, over=over, stays=stays), over)

    def draw(self, actions: Sequence[int], scene: Scene, columns: int, lines: int) -> list[str]:
        return []


def _drawn(
    maze: Maze, actions: Sequence[int], states: Sequence[int], columns: int, lines: int
) -> list[str]:
    """Draw the part of a maze around the agent that has room, and the way that it took."""
    heads = {state: HEADS[maze.actions[a]] for state, a in zip(states, actions, strict=False)}
    row, column = maze.cell(states[-1])

    def cell(at: tuple[int, int]) -> str:
        state, character = maze.state(*at), maze.rows[at[0]][at[1]]
        if state == states[-1]:
            return f"{AGENT}@{PLAIN}"
        if state in heads and character == ".":
            return f"{WAY}{heads[state]}{PLAIN}"
        colour = {"S": WAY, "G": GOAL, "#": WALL}.get(character)
        return f"{colour}{character}{PLAIN}" if colour else character

    # a blank between two cells makes them about as wide as high
    across = _around(column, maze.shape[1], max(columns // 2, 1))
    down = _around(row, maze.shape[0], max(lines, 1))
    return [" ".join(cell((at, beside)) for beside in across) for at in down]


def _around(place: int, length: int, room: int) -> range:
    """Return the part of a length that has room, with the place in its middle if possible.

    Examples
    --------
    >>> _around(5, 9, 3), _around(0, 9, 3), _around(8, 9, 3), _around(1, 2, 3)
    (range(4, 7), range(0, 3), range(6, 9), range(0, 2))
    """
    first = max(min(place - room // 2, length - room), 0)
    return range(first, min(first + room, length))


class _Stepped:
    """A Gymnasium environment: it is stepped, and begins anew only where a step is undone."""

    def __init__(self, task: GymTask | WrappedTask) -> None:
        self.environment = task
        inner = task.task if isinstance(task, GymTask) else task
        self._number: Callable[[Any], int] = int
        if isinstance(inner, WrappedTask):
            try:
                self._env, self._number = copy.deepcopy(inner.env), inner.number
            except TypeError as error:
                raise UserError(
                    f"{inner.name} cannot be copied, so not recorded: {error}"
                ) from None
        else:
            self._env = _drawn_as_text(task.env)
        self._seed = task.reset_seed if isinstance(task, GymTask) else None
        self._attempt = -1
        self._actions: list[int] = []
        self._scenes: list[Scene] = []

    def play(self, actions: Sequence[int], attempt: int) -> Scene:
        before = self._scenes if attempt == self._attempt else []
        if not before or self._actions != [*actions[: len(self._actions)]]:
            state, _ = self._env.reset(seed=attempt if self._seed is None else self._seed)
            self._attempt, self._actions, self._scenes = (
                attempt,
                [],
                [Scene((self._number(state),))],
            )
        for action in actions[len(self._actions) :]:
            self._actions.append(action)
            self._scenes.append(self._stepped(action))
        scene = self._scenes[-1]
        if before and len(before) > len(actions) and before[len(actions)].states != scene.states:
            raise UserError(
                "this environment does not repeat itself after reset(seed=...), so that no step "
                "can be undone or shown again; it began anew"
            )
        return scene

    def _stepped(self, action: int) -> Scene:
        state, reward, terminated, truncated, _ = self._env.step(action)
        told = f"reward {float(reward):g}"
        if terminated or truncated:
            told += ", and the episode is over" + (": its time is up" if truncated else "")
        states = *self._scenes[-1].states, self._number(state)
        return Scene(states, told, bool(terminated or truncated))

    def draw(self, actions: Sequence[int], scene: Scene, columns: int, lines: int) -> list[str]:
        picture = self._env.render() if self._env.render_mode == "ansi" else None
        return picture.strip("\n").split("\n") if isinstance(picture, str) else []


def _drawn_as_text(env: gymnasium.Env[Any, Any]) -> gymnasium.Env[Any, Any]:
    """Return a copy of the environment, which nobody else steps; one that draws if it can."""
    can = "ansi" in (env.metadata.get("render_modes") or [])
    if can and env.render_mode != "ansi" and env.spec is not None:
        return gymnasium.make(env.spec, render_mode="ansi")
    return copy.deepcopy(env)
