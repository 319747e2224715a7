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

_SMALL_MAP = ("....G", ".##..", ".....", "..##.", "S....")
_CELL = 8  # side of a cell in an RGB image
_COLOURS = {".": (255, 255, 255), "#": (64, 64, 64), "S": (158, 202, 225), "G": (161, 217, 155)}
_AGENT_COLOUR = (214, 39, 40)

_PIXELS = 200  # a metre
_GRASS, _BALL, _GOAL = (44, 122, 62), (240, 140, 30), (230, 230, 230)
_ROBOT, _OBSTACLE, _FRONT = (40, 80, 200), (235, 200, 30), (214, 39, 40)


class _TabularEnv(gymnasium.Env[Any, Any]):
    """Numbered states and actions, and the reward R(s, a) = weights[s, a]."""

    def __init__(
        self, n_states: int, n_actions: int, weights: ArrayLike | None, render_mode: str | None
    ) -> None:
        modes = self.metadata["render_modes"]
        if render_mode not in (None, *modes):
            raise ValueError(f"unknown render mode {render_mode!r}; known: {', '.join(modes)}")
        self.render_mode = render_mode
        self.weights = _checked_weights((n_states, n_actions), weights)
        self.observation_space = gymnasium.spaces.Discrete(n_states)
        self.action_space = gymnasium.spaces.Discrete(n_actions)
        self._state: int | None = None

    def _start(self) -> int:
        raise NotImplementedError

    def _move(self, state: int, action: int) -> tuple[int, bool, bool, dict[str, Any]]:
        """Return the next state, whether it ends the episode, whether time is up, and more."""
        raise NotImplementedError

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[int, dict[str, Any]]:
        """Go back to the start; the environment draws nothing from its seed."""
        super().reset(seed=seed)
        self._state = self._start()
        return self._state, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """Take an action; returns (state, reward, terminated, truncated, info)."""
        if self._state is None:
            raise gymnasium.error.ResetNeeded("call reset() before the first step()")
        if not self.action_space.contains(action):
            last = self.weights.shape[1] - 1
            raise gymnasium.error.InvalidAction(
                f"there is no action {action!r}; actions are 0..{last}"
            )
        reward = self.weights.item(self._state, action)
        self._state, terminated, truncated, info = self._move(self._state, action)
        return self._state, reward, terminated, truncated, info


class MazeEnv(_TabularEnv):
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
        super().__init__(self.maze.n_states, self.maze.n_actions, weights, render_mode)

    def _start(self) -> int:
        return self.maze.start

    def _move(self, state: int, action: int) -> tuple[int, bool, bool, dict[str, Any]]:
        successor = self.maze.next_state.item(state, action)
        return successor, successor == self.maze.goal, False, {}

    def render(self) -> Any:
        """Draw the maze and the agent; None without a render mode."""
        if self.render_mode == "ansi":
            return self._text()
        return self._image() if self.render_mode else None

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


class SoccerEnv(_TabularEnv):
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
        super().__init__(rules.N_STATES, len(rules.ACTIONS), weights, render_mode)
        self.world = FastSoccerWorld(params)

    def _start(self) -> int:
        return self.world.reset()

    def _move(self, state: int, action: int) -> tuple[int, bool, bool, dict[str, Any]]:
        return *self.world.step(action), {"time": self.world.time}

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


def _checked_weights(shape: tuple[int, int], weights: ArrayLike | None) -> NDArray[np.float64]:
    array = np.zeros(shape) if weights is None else np.array(weights, dtype=np.float64)
    if array.shape != shape:
        raise ValueError(f"weights have shape {array.shape}; this environment needs {shape}")
    if not np.isfinite(array).all():
        raise ValueError("weights must be finite; replace NaN and infinity")
    array.setflags(write=False)
    return array
