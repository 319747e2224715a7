"""The maze and the soccer field as Gymnasium environments.

They are registered as ``replication/Maze-v0`` and ``replication/Soccer-v0``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from replication.envs.maze import Maze
from replication.envs.soccer import rules
from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.rules import SoccerParams

Array = NDArray[np.float64]

_SMALL_MAP = ("....G", ".##..", ".....", "..##.", "S....")
_CELL = 8  # side of a cell in an RGB image
_COLOURS = {".": (255, 255, 255), "#": (64, 64, 64), "S": (158, 202, 225), "G": (161, 217, 155)}
_AGENT_COLOUR = (214, 39, 40)


class MazeEnv(gymnasium.Env[Any, Any]):
    """A maze as a Gymnasium environment, registered as ``replication/Maze-v0``.

    Observations are states, actions the numbers of `ACTIONS`. An episode starts at the start and
    terminates at the goal; truncation is left to Gymnasium's ``TimeLimit`` (500 steps when made
    through the registry).

    Parameters
    ----------
    maze
        A `Maze` or the rows of one; a small built-in maze by default.
    weights
        Reward R(s, a) of taking action a in state s, float [state, action]; 0 by default.
    render_mode
        "ansi": the map as text with the agent as ``@``; "rgb_array": uint8 [height, width, 3].

    Raises
    ------
    MazeError
        If the map is not a maze.
    ValueError
        If the weights have another shape or are not finite, or the render mode is unknown.

    Examples
    --------
    >>> from replication.envs.maze import ACTIONS
    >>> env = gymnasium.make("replication/Maze-v0", maze=["S.G"])
    >>> env.reset(seed=1)
    (0, {})
    >>> env.step(ACTIONS.index("right"))
    (1, 0.0, False, False, {})
    >>> env.step(ACTIONS.index("right"))
    (2, 0.0, True, False, {})
    """

    # Gymnasium declares this as an instance variable, so it cannot be a ClassVar here.
    metadata: dict[str, Any] = {"render_modes": ["ansi", "rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        maze: Maze | Sequence[str] = _SMALL_MAP,
        weights: ArrayLike | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.maze = maze if isinstance(maze, Maze) else Maze(tuple(maze))
        self.weights = _checked_weights(self.maze.n_states, self.maze.n_actions, weights)
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"unknown render mode {render_mode!r}; known: ansi, rgb_array")
        self.render_mode = render_mode
        self.observation_space = gymnasium.spaces.Discrete(self.maze.n_states)
        self.action_space = gymnasium.spaces.Discrete(self.maze.n_actions)
        self._state: int | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[int, dict[str, Any]]:
        """Go to the start; the environment draws nothing from its seed."""
        super().reset(seed=seed)
        self._state = self.maze.start
        return self._state, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """Take one action; returns (state, reward, terminated, truncated, info)."""
        if self._state is None:
            raise gymnasium.error.ResetNeeded("call reset() before the first step()")
        if not self.action_space.contains(action):
            raise gymnasium.error.InvalidAction(f"there is no action {action!r}; actions are 0..3")
        reward = self.weights.item(self._state, action)
        self._state = self.maze.next_state.item(self._state, action)
        return self._state, reward, self._state == self.maze.goal, False, {}

    def render(self) -> Any:
        """Draw the maze and the agent; None without a render mode."""
        if self.render_mode == "ansi":
            return self._text()
        if self.render_mode == "rgb_array":
            return self._image()
        return None

    def _text(self) -> str:
        rows = [list(row) for row in self.maze.rows]
        if self._state is not None:
            row, column = self.maze.cell(self._state)
            rows[row][column] = "@"
        return "\n".join("".join(row) for row in rows) + "\n"

    def _image(self) -> NDArray[np.uint8]:
        cells = [[_COLOURS[character] for character in row] for row in self.maze.rows]
        image = np.array(cells, dtype=np.uint8).repeat(_CELL, axis=0).repeat(_CELL, axis=1)
        if self._state is not None:
            top, left = (_CELL * index + 2 for index in self.maze.cell(self._state))
            image[top : top + _CELL - 4, left : left + _CELL - 4] = _AGENT_COLOUR
        return image


_PIXELS = 200  # a metre
_GRASS, _BALL, _GOAL = (44, 122, 62), (240, 140, 30), (230, 230, 230)
_ROBOT, _OBSTACLE, _FRONT = (40, 80, 200), (235, 200, 30), (214, 39, 40)


class SoccerEnv(gymnasium.Env[Any, Any]):
    """Robot soccer as a Gymnasium environment, registered as ``replication/Soccer-v0``.

    Observations are states, actions the numbers of `rules.ACTIONS`. An episode terminates with a
    goal and is truncated when the simulated time is up. The world is deterministic.

    Parameters
    ----------
    params
        What the paper leaves open.
    weights
        Reward R(s, a) of taking action a in state s, float [state, action]; 0 by default.
    render_mode
        "rgb_array": uint8 [height, width, 3].

    Raises
    ------
    ValueError
        If the weights have another shape or are not finite, or the render mode is unknown.

    Examples
    --------
    >>> env = gymnasium.make("replication/Soccer-v0")
    >>> state, _ = env.reset(seed=1)
    >>> env.step(rules.ACTIONS.index("forward"))[0] == state
    False
    """

    # Gymnasium declares this as an instance variable, so it cannot be a ClassVar here.
    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 2}  # noqa: RUF012

    def __init__(
        self,
        params: SoccerParams | None = None,
        weights: ArrayLike | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.weights = _checked_weights(rules.N_STATES, len(rules.ACTIONS), weights)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"unknown render mode {render_mode!r}; known: rgb_array")
        self.render_mode = render_mode
        self.world = FastSoccerWorld(params)
        self.observation_space = gymnasium.spaces.Discrete(rules.N_STATES)
        self.action_space = gymnasium.spaces.Discrete(len(rules.ACTIONS))
        self._state: int | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[int, dict[str, Any]]:
        """Put everything in its place; the environment draws nothing from its seed."""
        super().reset(seed=seed)
        self._state = self.world.reset()
        return self._state, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """Take a decision; returns (state, reward, terminated, truncated, info)."""
        if self._state is None:
            raise gymnasium.error.ResetNeeded("call reset() before the first step()")
        if not self.action_space.contains(action):
            raise gymnasium.error.InvalidAction(f"there is no action {action!r}; actions are 0..4")
        reward = self.weights.item(self._state, action)
        self._state, scored, timed_out = self.world.step(action)
        return self._state, reward, scored, timed_out, {"time": self.world.time}

    def render(self) -> Any:
        """Draw the field from above; None without a render mode."""
        return self._image() if self.render_mode else None

    def _image(self) -> NDArray[np.uint8]:
        width = rules.WIDTH + 2 * rules.BALL_RADIUS
        y, x = np.mgrid[rules.HEIGHT : 0 : -1 / _PIXELS, 0 : width : 1 / _PIXELS]
        image = np.full((*x.shape, 3), _GRASS, np.uint8)
        image[(x > rules.WIDTH) & (rules.GATE[0] < y) & (y < rules.GATE[1])] = _GOAL

        def draw(pose: tuple[float, float, float], colour: tuple[int, int, int]) -> None:
            along_x, along_y = math.cos(pose[2]), math.sin(pose[2])
            ahead = (x - pose[0]) * along_x + (y - pose[1]) * along_y
            aside = (y - pose[1]) * along_x - (x - pose[0]) * along_y
            inside = np.maximum(np.abs(ahead), np.abs(aside)) < rules.ROBOT_SIDE / 2
            image[inside] = colour
            image[inside & (ahead > rules.ROBOT_SIDE / 4)] = _FRONT

        for pose in self.world.obstacles:
            draw(pose, _OBSTACLE)
        draw(self.world.pose, _ROBOT)
        ball = np.hypot(x - self.world.ball[0], y - self.world.ball[1]) < rules.BALL_RADIUS
        image[ball] = _BALL
        return image


def _checked_weights(n_states: int, n_actions: int, weights: ArrayLike | None) -> Array:
    shape = n_states, n_actions
    array = np.zeros(shape) if weights is None else np.array(weights, dtype=np.float64)
    if array.shape != shape:
        raise ValueError(f"weights have shape {array.shape}; this environment needs {shape}")
    if not np.isfinite(array).all():
        raise ValueError("weights must be finite; replace NaN and infinity")
    array.setflags(write=False)
    return array
